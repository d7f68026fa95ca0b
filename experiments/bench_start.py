"""How long until the first solved oscillator, and how heavy is the import?

Every number is a fresh process, rounds interleaved, medians of processor time reported, as the machine may be
shared (on an idle one it is the wall time: nothing here runs in threads):

import numpy, sympy, numba    the yardstick of a start: nobody can be quicker who uses them
import sympy                  the yardstick of `import pwsmooth`
second process                python -> definition -> solve() of the friction oscillator, caches warm
first process                 the same with an empty cache; core and model are told apart by a
                              second, different model that is solved in the same process
a changed parameter           what a slider, a fit or a sweep by hand pays: solve(system.with_parameters(...))
                              beside solve(system), of three models, in one process

Goals: second process <= 1.8 of the first yardstick, `import pwsmooth` <= 1.2 of the second,
a changed parameter <= 1.25 of the same one (a solve of 60 microseconds, and what its door costs).

Usage: python experiments/bench_start.py [--rounds 7] [--cold 2] [--out FILE.json]
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile

from benchtools import provenance, write_json

YARDSTICKS = {
    "python": "pass",
    "import numpy, sympy, numba": "import numpy, sympy, numba",
    "import sympy": "import sympy",
    "import pwsmooth": "import pwsmooth",
}

FIRST = """
import sympy as sp
from pwsmooth import Switch, System, solve
t, y, v, z = sp.symbols("t y v z", real=True)
rho, beta, k, c, N, sigma, omega = sp.symbols("rho beta k c N sigma omega", nonnegative=True)
lam = Switch("lam", v)
oscillator = System(
    {y: v, v: -sigma*sp.sin(omega*t) - k*y - c*v - N*lam*(1 + rho*z), z: (1 - lam**2 - z)/beta},
    time=t,
    parameters={rho: 3, beta: 0.1, k: 3.1, c: 0.1, N: 1, sigma: 2.4, omega: 1},
    outputs={"mu": lam*(1 + rho*z)},
)
solution = solve(oscillator, (0, 60), {y: 0.5, v: 0.3, z: 0})
assert solution.success and len(solution.events) > 10
"""

# A second model in the same process pays for its own functions only; its printed time is the model's share.
SECOND = (
    FIRST
    + """
import time
begin = time.process_time()
w = sp.symbols("w", real=True)
other = System(
    {y: v, v: -sigma*sp.cos(omega*t) - k*y - c*v - N*sp.sign(v) - k*(y - w)**3, w: y - w},
    time=t, parameters={k: 2.7, c: 0.2, N: 1, sigma: 2.1, omega: 1},
)
solution = solve(other, (0, 60), {y: 0.5, v: 0.3, w: 0})
assert solution.success
print(time.process_time() - begin)
"""
)

# A parameter that is 0, a period that is an expression, a family: each was looked through at every change.
CHANGED = (
    FIRST
    + """
import statistics, time
from pwsmooth import Event, Family
x, T, a = sp.symbols("x T a", positive=True)
logistic = System({x: 0*x}, time=t, parameters={a: 3.9, T: 6}, events=[Event(every=T/6, update={x: a*x*(1 - x)})])
blocks = Family(20)
p, q = blocks.symbols("p q")
(F,) = blocks.symbols("F", positive=True)
pull = blocks.neighbour(p, 1) - 2*p + blocks.neighbour(p, -1)
chain = System(
    {p: q, q: k*pull - p - F*Switch("mu", q - sp.Rational(1, 10))},
    parameters={k: 2, F: [1 + (7*i % 5)/15 for i in range(20)]},
)
for name, system, start, changed in (
    ("oscillator, a parameter 0", oscillator.with_parameters({c: 0}), {y: 0.5, v: 0.3, z: 0}, rho),
    ("map, its period an expression", logistic, {x: 0.3}, a),
    ("chain of 20 blocks", chain, {p: [0.1*(3*i % 7)/7 for i in range(20)], q: 0}, k),
):
    value, times = system.parameters[changed], ([], [])
    for i in range(402):
        other = i % 2
        begin = time.process_time()
        solve(system.with_parameters({changed: value*(1 + 1e-9*i)}) if other else system, (0, 60), start)
        times[other].append(time.process_time() - begin)
    print(name, *(statistics.median(row[1:]) for row in times), sep=";")
"""
)


def _children():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def seconds(code, cache):
    """Processor time (user and system) of `python -c code`, and what it printed."""
    environment = dict(os.environ, PWSMOOTH_CACHE_DIR=cache)
    begin = _children()
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    took = _children() - begin
    if done.returncode:
        raise RuntimeError(f"a timed process failed:\n{done.stderr}")
    return took, done.stdout.strip()


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--cold", type=int, default=2, help="rounds with an empty cache")
    parser.add_argument("--out", help="write the results as JSON")
    options = parser.parse_args()

    cold = []
    for _ in range(options.cold):
        with tempfile.TemporaryDirectory() as empty:
            total, model = seconds(SECOND, empty)
            cold.append((total, float(model), seconds(FIRST, empty)[0]))
    with tempfile.TemporaryDirectory() as cache:
        seconds(SECOND, cache)
        lines = [line.split(";") for line in seconds(CHANGED, cache)[1].splitlines()]
        moved = {name: (float(same), float(other)) for name, same, other in lines}
        entrants = {**YARDSTICKS, "second process: first solved oscillator": FIRST}
        times = {name: [] for name in entrants}
        for _ in range(options.rounds):
            for name, code in entrants.items():
                times[name].append(seconds(code, cache)[0])

    median = {name: statistics.median(row) for name, row in times.items()}
    for name, value in median.items():
        print(f"{name:45} {value:7.3f} s")
    first = statistics.median(total - model for total, model, _ in cold)
    second = statistics.median(model for _, model, _ in cold)
    warm = statistics.median(warm for *_, warm in cold)
    print(f"{'first process, empty cache':45} {first:7.3f} s")
    print(f"{'  of that: compiling (less a warm process)':45} {first - warm:7.3f} s, core and first model")
    print(f"{'  a second model, compiled and solved':45} {second:7.3f} s")
    print(f"{'  so the core alone, about':45} {first - warm - second:7.3f} s")
    ratios = {
        "second process / import numpy, sympy, numba": (
            median["second process: first solved oscillator"] / median["import numpy, sympy, numba"],
            1.8,
        ),
        "import pwsmooth / import sympy": (median["import pwsmooth"] / median["import sympy"], 1.2),
    }
    for name, (same, other) in moved.items():
        print(f"{name + ': a solve':45} {1e3 * same:7.3f} ms, with a changed parameter {1e3 * other:.3f} ms")
        ratios[f"changed / same, {name}"] = other / same, 1.25
    for name, (value, goal) in ratios.items():
        print(f"{name:45} {value:7.3f}   goal <= {goal} {'met' if value <= goal else 'NOT met'}")
    if options.out:
        seconds_of = median | {
            "first process, empty cache: first solved oscillator": first,
            "of that, compiling": first - warm,
            "a second model in the same process, compiled and solved": second,
        }
        data = {
            "options": {"rounds": options.rounds, "cold": options.cold},
            "results": {name: {"seconds": value} for name, value in seconds_of.items()},
            "ratios": {name: {"ratio": value, "goal": goal} for name, (value, goal) in ratios.items()},
            "all rounds": times,
            "cold": cold,
            "a solve, and with a changed parameter": moved,
            "provenance": provenance(),
        }
        write_json(options.out, data)


if __name__ == "__main__":
    main()
