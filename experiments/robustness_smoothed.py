"""Is the smoothed path ever wrong? Thousands of starts, every sigmoid, six decades of eps.

Question. At the loosest tolerance that a user can get (rtol = 1e-3), how many runs of the smoothed friction
oscillator end on the wrong side of a crossing/sticking decision? Wrong = the state after 1.5 periods is off by
more than 0.05 from two references (Radau of orders 9 and 13 at 1e-10 and 1e-11) that agree to 1e-6.
Expected: none. Starts beside a basin boundary are counted apart: those whose outcome changes by more than
0.05 when the start moves by rtol.

The references share code with what they judge, so --cross-check compares the first of every group with SciPy's
LSODA (rtol 1e-11, steps bounded by 5 eps, since an unguarded solver steps over the layer), written out apart.

Usage: python experiments/robustness_smoothed.py [--random 2000] [--grazing 200] [--rtol 1e-3] [--method auto]
       [--cross-check 2] [--out FILE.json]
"""

from __future__ import annotations

import argparse
import math
import time

import numpy as np
from benchtools import provenance, write_json
from friction_oscillator import hidden
from smoothed_cases import SPAN, count_wrong, grazing_cases, random_cases, references

EPSILONS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
SIGMOIDS = ("algebraic", "tanh", "erf")
SEED = 20_240


def lsoda(case, sigmoid):
    """The end state by an independent solver and an independent right-hand side."""
    from scipy.integrate import solve_ivp
    from scipy.special import erf

    curve = {"algebraic": lambda u: u / math.hypot(1, u), "tanh": math.tanh, "erf": erf}[sigmoid]
    k, sigma, rho, beta, eps = (case.values[name] for name in ("k", "sigma", "rho", "beta", "eps"))

    def rhs(t, x):
        lam = curve(x[1] / eps)
        force = -sigma * math.sin(t) - k * x[0] - 0.1 * x[1] - lam * (1 + rho * x[2])
        return x[1], force, (1 - lam * lam - x[2]) / beta

    run = solve_ivp(
        rhs,
        (case.t0, case.t0 + SPAN),
        case.state,
        "LSODA",
        rtol=1e-11,
        atol=1e-14,
        max_step=min(0.1, 5 * eps),
    )
    return run.y[:, -1]


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--random", type=int, default=2000)
    parser.add_argument("--grazing", type=int, default=200)
    parser.add_argument("--rtol", type=float, default=1e-3)
    parser.add_argument("--method", default="auto")
    parser.add_argument("--cross-check", type=int, default=0, help="starts of every group with eps >= 1e-4")
    parser.add_argument("--out", help="write the results as JSON")
    options = parser.parse_args()

    rows, total = [], 0
    print(f"rtol {options.rtol:g}, method {options.method}: wrong + beside a boundary + no reference")
    for sigmoid in SIGMOIDS:
        view = hidden().smoothed(eps=1e-3, sigmoid=sigmoid)
        for eps in EPSILONS:
            groups = {"random": random_cases(options.random, eps, SEED)}
            # at eps = 0.1 the layer fills the whole range of v: no start dips into it from outside
            groups["grazing"] = grazing_cases(options.grazing, eps, SEED) if eps < 0.05 else []
            row = {"sigmoid": sigmoid, "eps": eps}
            for name, cases in groups.items():
                begin = time.perf_counter()
                wrong, boundary, unclear = count_wrong(view, cases, options.rtol, options.method)
                took = time.perf_counter() - begin
                row[name] = {
                    "starts": len(cases),
                    "wrong": len(wrong),
                    "beside a boundary": len(boundary),
                    "references disagree": len(unclear),
                    "seconds": took,
                    "wrong starts": [(c.values, c.t0, c.state) for c in wrong],
                }
                total += len(wrong)
                if eps >= 1e-4:
                    for case in cases[: options.cross_check]:
                        ours, agree = references(view, case)
                        gap = float(np.max(np.abs(lsoda(case, sigmoid) - ours)))
                        row[name]["gap to LSODA"] = max(gap, row[name].get("gap to LSODA", 0.0))
            rows.append(row)
            print(
                f"{sigmoid:10} eps {eps:7.0e}  "
                + "   ".join(
                    f"{name} {row[name]['starts']:5d}: {row[name]['wrong']} + {row[name]['beside a boundary']}"
                    f" + {row[name]['references disagree']}"
                    + (f", LSODA within {row[name]['gap to LSODA']:.0e}" if "gap to LSODA" in row[name] else "")
                    for name in groups
                ),
                flush=True,
            )
    print(f"wrong in all: {total}")
    if options.out:
        write_json(options.out, {"options": vars(options), "rows": rows, "provenance": provenance()})


if __name__ == "__main__":
    main()
