"""What do orbits, branches and exponents cost, in plain solves of the same motion?

    y' = v,   v' = -2.4 sin t - sigma y - 0.1 v - lam (1 + z),   z' = (3 (1 - lam^2) - z)/0.1,   sigma = 3.1

A period has a stick, its exit and a crossing. Rounds are interleaved, medians of processor time are reported, compile
time is left out: a period and a long run by solve(), the fundamental matrix of a period from the run's tape and by
collocation on its dense output, find_orbit() from a point 1 % off, follow() for each orbit of a branch of 13, the
multipliers at 20 values of sigma, each orbit begun at the one before, and exponents over the long run.

Goals: an orbit in 2 ms, one of a branch in 5 ms, an exponent in 3 plain solves.

Usage: python experiments/bench_orbits.py [--rounds 7] [--out FILE.json]
"""

from __future__ import annotations

import argparse
import copy
import math
import statistics
import time

import numpy as np
import sympy as sp
from benchtools import provenance, write_json

from pwsmooth import Strobe, Switch, System, find_orbit, follow, solve
from pwsmooth.analysis.lyapunov import lyapunov_exponents
from pwsmooth.analysis.maps import variations

PERIOD, LONG = 2 * math.pi, 350.0
TIGHT = dict(rtol=1e-12, atol=1e-14)  # as the Poincare maps are solved


def oscillator():
    t, y, v, z = sp.symbols("t y v z", real=True)
    sigma = sp.Symbol("sigma", positive=True)
    lam = Switch("lam", v)
    rates = {
        y: v,
        v: -sp.Rational(12, 5) * sp.sin(t) - sigma * y - v / 10 - lam * (1 + z),
        z: 10 * (3 * (1 - lam**2) - z),
    }
    return System(rates, time=t, parameters={sigma: 3.1})


def tasks():
    """Name -> (what is timed, by how many its time is divided)."""
    system = oscillator()
    orbit = find_orbit(system, {"y": 0.5, "v": 0.3, "z": 0}, seen=Strobe(2 * sp.pi), transient=20)
    near = dict(orbit.x0, y=1.01 * orbit.x0["y"], v=1.01 * orbit.x0["v"])
    run = solve(system, (0, PERIOD), orbit.x0, dense_output=True, **TIGHT)
    without = copy.copy(run)
    without.tape = None
    values = np.linspace(3.1, 3.6, 20)

    def multipliers():
        at = orbit
        for value in values:
            at = find_orbit(system.with_parameters({"sigma": value}), at.x, seen=Strobe(2 * sp.pi))
            assert at.success

    def exponents(count):
        return lambda: lyapunov_exponents(system, orbit.x0, LONG, count=count)

    branch = follow(orbit, {"sigma": 3.3})
    assert branch.end == "reached sigma = 3.3."
    return {
        "period": (lambda: solve(system, (0, PERIOD), orbit.x0, **TIGHT), 1),
        "long run": (lambda: solve(system, (0, LONG), orbit.x0), 1),
        "fundamental matrix, tape": (lambda: variations(run), 1),
        "fundamental matrix, collocation": (lambda: variations(without), 1),
        "find_orbit": (lambda: find_orbit(system, near, seen=Strobe(2 * sp.pi)), 1),
        "follow, an orbit": (lambda: follow(orbit, {"sigma": 3.3}), len(branch.points)),
        "multipliers, a value": (multipliers, len(values)),
        "exponent": (exponents(1), 1),
        "all exponents": (exponents(3), 1),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--out")
    options = parser.parse_args()
    found: dict[str, list[float]] = {}
    timed = tasks()
    for _ in range(options.rounds):
        for name, (run, parts) in timed.items():
            repeats = 0
            begin = time.process_time()
            while (spent := time.process_time() - begin) < 0.05 or repeats < 3:
                run()
                repeats += 1
            found.setdefault(name, []).append(spent / repeats / parts)
    seconds = {name: statistics.median(times) for name, times in found.items()}
    for name, each in seconds.items():
        unit = "long run" if "exponent" in name else "period"
        print(f"{name:32} {1e3 * each:8.3f} ms {each / seconds[unit]:8.1f} of a {unit}")
    if options.out:
        write_json(options.out, {"options": vars(options), "provenance": provenance(), "seconds": seconds})


if __name__ == "__main__":
    main()
