"""What does the smoothed path cost at equal error, against the compiled peers of its users?

Question: time a drive period of the smoothed friction oscillator (rho = 3, algebraic sigmoid, eps = beta), at
errors of 1e-4, 1e-8 and 1e-12, against heyoka (fast_math), numbalsoda LSODA and scikit-sundae CVODE (jitted
right-hand side and Jacobian). Expected: eps = 1e-3: at most 1/4, 1/4, 1/1.5 of the best peer; eps = 1e-4: at
most 1/5, 1/8, 1/10.

Error: the largest of |dy|, |dv|, |dz| at five end times within ten periods, against heyoka at 1e-15 without
fast_math. For every entrant the fastest tolerance that meets the error; then interleaved rounds over PERIODS
periods, medians of processor time (every entrant runs on one core, and other processes must not decide).
Compilation and construction are not timed. CVODE pays for a call from C into Python at every evaluation.
The peers come with `pip install -e '.[bench]'`; where numbalsoda has no wheel it builds from source, which takes a
Fortran and a C++ compiler. A peer that is missing is named and left out.

Run: python experiments/bench_smoothed.py [--out FILE] [--rounds N] [--eps EPS ...]
"""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np
from benchtools import provenance, write_json

PERIOD = 2 * np.pi
ENDS = PERIOD * np.array([9.13, 9.37, 9.61, 9.87, 10.0])
PERIODS = 60
START = (0.5, 0.3, 0.0)
CONSTANTS = {"rho": 3.0, "k": 3.1, "c": 0.1, "N": 1.0, "sigma": 2.4, "omega": 1.0}
GOALS = {
    (1e-3, 1e-4): 4.0, (1e-3, 1e-8): 4.0, (1e-3, 1e-12): 1.5,
    (1e-4, 1e-4): 5.0, (1e-4, 1e-8): 8.0, (1e-4, 1e-12): 10.0,
}  # fmt: skip
TIGHT = [10.0 ** -(k / 2) for k in range(6, 29)]


def own_entrant(eps):
    """solve() as a user calls it, no dense output; the System is built outside the clock, as in a sweep."""
    import sympy as sp

    from pwsmooth import Switch, System, solve

    t, y, v, z = sp.symbols("t y v z", real=True)
    names = rho, beta, k, c, N, sigma, omega = sp.symbols("rho beta k c N sigma omega", nonnegative=True)
    lam = Switch("lam", v)
    rates = {
        y: v,
        v: -sigma * sp.sin(omega * t) - k * y - c * v - N * lam * (1 + rho * z),
        z: (1 - lam**2 - z) / beta,
    }
    constants = {s: dict(CONSTANTS, beta=eps)[s.name] for s in names}
    view = System(rates, time=t, parameters=constants).smoothed(eps=eps)

    def run(tol, end):
        return solve(view, (0.0, end), START, rtol=tol, atol=tol).x[:, -1]

    return run, [tol for tol in TIGHT if tol <= 1e-3]


def heyoka_entrant(eps, fast=True):
    import heyoka as hy

    y, v, z = hy.make_vars("y", "v", "z")
    lam = v / eps / hy.sqrt(1.0 + (v / eps) ** 2)
    C = CONSTANTS
    system = [
        (y, v),
        (
            v,
            -C["sigma"] * hy.sin(C["omega"] * hy.time)
            - C["k"] * y
            - C["c"] * v
            - C["N"] * lam * (1.0 + C["rho"] * z),
        ),
        (z, (1.0 - lam * lam - z) / eps),
    ]
    built = {}

    def run(tol, end):
        if tol not in built:
            built[tol] = hy.taylor_adaptive(system, list(START), tol=tol, fast_math=fast)
        ta = built[tol]
        ta.time = 0.0
        ta.state[:] = START
        ta.propagate_until(end)
        return ta.state.copy()

    return run, ([1e-15] if not fast else [1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 1e-15])


def lsoda_entrant(eps):
    import numba
    from numbalsoda import lsoda, lsoda_sig

    C = CONSTANTS
    sigma, omega, k, c, N, rho = C["sigma"], C["omega"], C["k"], C["c"], C["N"], C["rho"]

    @numba.cfunc(lsoda_sig)
    def rhs(t, x, dx, p):
        u = x[1] / eps
        lam = u / np.sqrt(1.0 + u * u)
        dx[0] = x[1]
        dx[1] = -sigma * np.sin(omega * t) - k * x[0] - c * x[1] - N * lam * (1.0 + rho * x[2])
        dx[2] = (1.0 / (1.0 + u * u) - x[2]) / eps

    address = rhs.address

    def run(tol, end, keep=rhs):
        grid = np.array([0.0, end])
        x, ok = lsoda(address, np.array(START), grid, rtol=tol, atol=min(tol, 0.1 * eps), mxstep=10**8)
        return x[-1] if ok else np.full(3, np.nan)

    return run, TIGHT[:22]


def cvode_entrant(eps):
    import numba
    from sksundae.cvode import CVODE

    C = CONSTANTS
    sigma, omega, k, c, N, rho = C["sigma"], C["omega"], C["k"], C["c"], C["N"], C["rho"]

    @numba.njit
    def rhs(t, x, dx):
        u = x[1] / eps
        lam = u / np.sqrt(1.0 + u * u)
        dx[0] = x[1]
        dx[1] = -sigma * np.sin(omega * t) - k * x[0] - c * x[1] - N * lam * (1.0 + rho * x[2])
        dx[2] = (1.0 / (1.0 + u * u) - x[2]) / eps

    @numba.njit
    def jacobian(t, x, dx, J):
        u = x[1] / eps
        w = 1.0 / (1.0 + u * u)
        slope = w * np.sqrt(w) / eps
        J[0, 1] = 1.0
        J[1, 0], J[1, 1], J[1, 2] = -k, -c - N * slope * (1.0 + rho * x[2]), -N * u * np.sqrt(w) * rho
        J[2, 1], J[2, 2] = -2.0 * u * w * w / (eps * eps), -1.0 / eps

    def run(tol, end):
        solver = CVODE(
            rhs, rtol=tol, atol=min(tol, 0.1 * eps), method="BDF", jacfn=jacobian, max_num_steps=10**9
        )
        return solver.solve(np.array([0.0, end]), np.array(START)).y[-1]

    return run, TIGHT[:18]


def entrants(eps):
    """Name -> (run(tol, end) -> state, tolerances); a peer that is not installed is named and left out."""
    field = {"pwsmooth": own_entrant(eps)}
    for name, make in (("heyoka fast_math", heyoka_entrant), ("numbalsoda LSODA", lsoda_entrant),
                       ("scikit-sundae CVODE", cvode_entrant)):  # fmt: skip
        try:
            field[name] = make(eps)
        except ImportError as missing:
            print(f"  {name}: not installed ({missing.name})")
    return field


def clock(run, tol, end):
    begin = time.process_time()
    run(tol, end)
    return time.process_time() - begin


def fastest_meeting(run, tolerances, reference, goals):
    """For each error goal the tolerance that meets it in the least time, from one pass over the tolerances."""
    table = []
    for tol in tolerances:
        error = max(np.abs(run(tol, end) - x).max() for end, x in zip(ENDS, reference, strict=True))
        seconds = min(clock(run, tol, ENDS[-1]) for _ in range(3))
        table.append((tol, error, seconds))
    chosen = {}
    for goal in goals:
        good = [(seconds, tol, error) for tol, error, seconds in table if error <= goal]
        chosen[goal] = min(good)[1:] if good else None
    return chosen


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", help="write the table as JSON, with provenance")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--eps", type=float, nargs="*", default=[1e-3, 1e-4])
    arguments = parser.parse_args()
    goals = (1e-4, 1e-8, 1e-12)
    rows = []
    for eps in arguments.eps:
        exact, _ = heyoka_entrant(eps, fast=False)
        reference = [exact(1e-15, end) for end in ENDS]
        field = entrants(eps)
        chosen = {name: fastest_meeting(run, tols, reference, goals) for name, (run, tols) in field.items()}
        for goal in goals:
            racing = {name: chosen[name][goal] for name in field if chosen[name][goal]}
            times = {name: [] for name in racing}
            for _ in range(arguments.rounds):
                for name, (tol, _) in racing.items():
                    times[name].append(clock(field[name][0], tol, PERIODS * PERIOD) / PERIODS * 1e6)
            medians = {name: statistics.median(v) for name, v in times.items()}
            peers = [m for n, m in medians.items() if n != "pwsmooth"]
            met = "pwsmooth" in medians and peers
            ratio = min(peers) / medians["pwsmooth"] if met else float("nan")
            wanted = GOALS.get((eps, goal))
            verdict = "" if wanted is None else f"(goal {wanted:g}: {'met' if ratio >= wanted else 'MISSED'})"
            print(f"eps = beta = {eps:g}, error {goal:g}: best peer / pwsmooth = {ratio:.2f} {verdict}")
            for name, (tol, error) in racing.items():
                print(f"    {name:22s} {medians[name]:9.1f} us/period   tol {tol:.1e}   error {error:.1e}")
                rows.append({"eps": eps, "goal": goal, "entrant": name, "us_per_period": medians[name],
                             "tol": tol,
                             "error": error})  # fmt: skip
    if arguments.out:
        setting = {"periods": PERIODS, **CONSTANTS, "start": START}
        write_json(
            arguments.out, {"options": vars(arguments) | setting, "rows": rows, "provenance": provenance()}
        )


if __name__ == "__main__":
    main()
