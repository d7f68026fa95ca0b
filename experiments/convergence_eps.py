"""How fast does the smoothed oscillator tend to the event-driven one as eps -> 0?

The state at t = 10 of the smoothed view at falling eps, against the event-driven solution of the limit.
Expected orders of the distance in eps:

    2/3   a stick ends in a fold (slaved, or eps/beta fixed), every sigmoid
    4/5   algebraic sigmoid, a stick ends by |lambda| = 1 (rho = 0, or beta fixed): its tail falls as 1/u^2
    1     tanh and erf there, and every sigmoid where the orbit only crosses

Richardson extrapolation with the expected order has to come closer to the event-driven answer than the smallest
eps alone: two paths of the package that share no step agree.

Usage: python experiments/convergence_eps.py [--out FILE.json]
"""

from __future__ import annotations

import argparse

from benchtools import provenance, write_json
from smoothed_limit import CASES, EPSILONS, SIGMOIDS, study


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", help="write the results as JSON")
    options = parser.parse_args()
    rows = []
    print(f"{'case':34} {'sigmoid':10} expected measured  distance at eps = {EPSILONS[-1]:g}, extrapolated")
    for case in CASES:
        for sigmoid in SIGMOIDS:
            result = study(case, sigmoid)
            rows.append({"case": case.name, "sigmoid": sigmoid, **result})
            print(
                f"{case.name:34} {sigmoid:10} {result['expected']:8.3f} {result['measured']:8.3f}"
                f"  {result['distances'][-1]:.2e}, {result['extrapolated']:.2e}",
                flush=True,
            )
    if options.out:
        write_json(options.out, {"rows": rows, "epsilons": EPSILONS, "provenance": provenance()})


if __name__ == "__main__":
    main()
