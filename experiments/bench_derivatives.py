"""What do derivatives and gradients cost, in plain solves of the same run?

Forward: the friction oscillator (rho = 3, beta = 0.1) over 20 periods, by its 3 initial values and 4 parameters.
Backward: a cost with an integral, by 50 parameters: of a chain of 10 blocks with dry friction, and of the oscillator
under a drive of 50 Fourier coefficients. Rounds are interleaved, the least processor time of each task is reported,
compile time is left out.

Goals: forward within 4 plain solves, backward within 6.

Usage: python experiments/bench_derivatives.py [--rounds 40] [--out FILE.json]
"""

from __future__ import annotations

import argparse
import gc
import time

import numpy as np
import sympy as sp
from benchtools import provenance, write_json

from pwsmooth import Switch, System, solve
from pwsmooth.costs import Objective, final, integral

T, Y, V, Z = sp.symbols("t y v z", real=True)


def oscillator(pull, parameters):
    rho, beta = sp.symbols("rho beta", positive=True)
    lam = Switch("lam", V)
    values = parameters | {rho: 3, beta: 0.1}
    rates = {Y: V, V: -pull - V / 10 - lam * (1 + Z), Z: (rho * (1 - lam**2) - Z) / beta}
    return System(rates, time=T, parameters=values)


def forward():
    sigma, omega = sp.symbols("sigma omega", positive=True)
    system = oscillator(2.4 * sp.sin(omega * T) + sigma * Y, {sigma: 3.1, omega: 1})
    run = system, (0, 40 * np.pi), {Y: 0.5, V: 0.3, Z: 0}
    names = ["rho", "beta", "sigma", "omega", "y", "v", "z"]
    return {
        "plain": lambda: solve(*run),
        "derivatives": lambda: solve(*run, with_respect_to=names).derivatives.end,
    }


def backward(system, span, start, cost, names):
    objective = Objective(system, cost, span, start, names)
    return {"plain": lambda: solve(system, span, start), "gradient": lambda: objective(objective.start)}


def driven(rng):
    c = sp.symbols("c1:51", real=True)
    waves = [f((j + 1) * T / 8) for j in range(25) for f in (sp.cos, sp.sin)]
    pull = 3.1 * Y + sum(a * wave for a, wave in zip(c, waves))
    system = oscillator(pull, dict(zip(c, (0.4 * rng.normal(size=50)).tolist())))
    return backward(system, (0, 62.8), {Y: 0.5, V: 0.3, Z: 0}, final(Y**2) + integral(V**2), list(c))


def chain(rng, n=10):
    y, v = sp.symbols(f"y1:{n + 1}", real=True), sp.symbols(f"v1:{n + 1}", real=True)
    bounds = {"k": (1, 2), "d": (0.05, 0.1), "f": (0.1, 0.3), "a": (0.5, 1.5), "b": (0.5, 1.5)}
    each = {name: sp.symbols(f"{name}1:{n + 1}", positive=True) for name in bounds}
    values = {s: float(rng.uniform(*bounds[name])) for name, row in each.items() for s in row}
    rates = {}
    for i, (k, d, f, a, b) in enumerate(zip(*each.values())):
        beside = [y[j] - y[i] for j in (i - 1, i + 1) if 0 <= j < n]
        rates[y[i]] = v[i]
        rates[v[i]] = -k * y[i] - d * v[i] - f * sp.sign(v[i]) + a * sp.cos(b * T) + sum(beside)
    start = dict(zip(rates, (0.5 * rng.normal(size=2 * n)).tolist()))
    cost = final(y[0] ** 2) + integral(v[3] ** 2)
    return backward(System(rates, time=T, parameters=values), (0, 20), start, cost, list(values))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument("--out", default=None)
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    scenes = {
        "oscillator, 7 forward": forward(),
        "drive, 50 backward": driven(rng),
        "chain, 50 backward": chain(rng),
    }
    results = {}
    for name, tasks in scenes.items():
        best = dict.fromkeys(tasks, np.inf)
        for task in tasks.values():
            task()
        gc.disable()
        for _ in range(arguments.rounds):
            for key, task in tasks.items():
                began = time.process_time()
                task()
                best[key] = min(best[key], time.process_time() - began)
        gc.enable()
        plain, other = best.values()
        results[name] = {"plain_ms": 1e3 * plain, "ratio": other / plain}
        print(f"{name}: {1e3 * plain:.3f} ms plain, {other / plain:.2f} plain solves")
    if arguments.out:
        write_json(arguments.out, {"provenance": provenance(), "results": results})


if __name__ == "__main__":
    main()
