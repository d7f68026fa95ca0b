"""Is this checkout slower than another one?

Question: what do two checkouts of this project need for the same work? Expected of a change that claims no cost: no
scene slower by more than 3 %. Each checkout runs in a process of its own with caches of its own; after a warm-up the
processes take turns, one scene at a time, and the least processor time of all rounds counts, since other work on the
machine only adds. Two processes of one checkout differ by up to 2 % (where their memory lies): hence --processes.
The number of events and steps is shown where it differs, as more work is another matter than slower work.

Usage: python experiments/bench_checkouts.py BEFORE [AFTER] [--rounds 15] [--processes 3] [--only WORD]
"""

from __future__ import annotations

import argparse
import ast
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent


def scenes():
    """Name -> a call that does the work once and returns its cost."""
    import numpy as np
    import sympy as sp

    from pwsmooth import Strobe, Switch, System, Unilateral, solve, sweep

    t, x, y, v, z, p, q = sp.symbols("t x y v z p q", real=True)
    sigma = sp.Symbol("sigma", positive=True)
    lam, wall = Switch("lam", v), Unilateral(x, restitution=sp.Rational(9, 10), name="W")
    block = {y: v, v: -sigma * sp.sin(t) - 3.1 * y - v / 10 - lam}
    hidden = {y: v, v: -2.4 * sp.sin(t) - 3.1 * y - v / 10 - lam * (1 + 3 * z), z: (1 - lam**2 - z) / 0.1}
    coulomb = System(block, time=t, parameters={sigma: 2.4})
    sticking = System(block, time=t, parameters={sigma: 1.2})
    pendulum = System({p: q, q: -sp.sin(p) - sp.sign(q) / 5 + sp.cos(t)}, time=t)
    falling = sp.sign(1 - v) * (0.3 + 0.7 / (1 + 3 * sp.Abs(1 - v)))
    belt = System({y: v, v: -y + falling}, time=t)
    bouncing = System({x: q, q: -x - q / 20 + sp.cos(2 * t) + wall.reaction}, time=t)
    view, stiffer = (System(hidden, time=t).smoothed(eps=eps) for eps in (1e-3, 1e-4))
    tight = {"rtol": 1e-11, "atol": 1e-13}

    def run(system, end, start, **options):
        return lambda: solve(system, (0, end), start, **options).cost

    def short():
        for k in range(1000):
            cost = solve(coulomb, (0, 1), [0.5, 0.3 + k / 1000])
        return cost.cost

    def swept():
        grid = {"sigma": np.linspace(1, 4, 200)}
        sweep(coulomb, grid, x0=[0.5, 0.3], seen=Strobe(2 * sp.pi), transient=30, periods=10)
        return {}

    return {
        "crossing": run(coulomb, 80000, [0.5, 0.3], **tight),
        "sticking": run(sticking, 80000, [0.5, 0.3], **tight),
        "pendulum": run(pendulum, 15000, [0.5, 0.3], **tight),
        "belt": run(belt, 15000, [0.5, 0.3], **tight),
        "impacts": run(bouncing, 40000, [0.5, 0.3], **tight),
        "pair": run(coulomb, 4000, [0.5, 0.3], method="rk", rtol=1e-8, atol=1e-10),
        "hidden": run(System(hidden, time=t), 10000, [0.5, 0.3, 0]),
        "short": short,
        "smoothed 1e-4": run(view, 3000, [0.5, 0.3, 0], rtol=1e-4, atol=1e-4),
        "smoothed 1e-8": run(view, 1500, [0.5, 0.3, 0], rtol=1e-8, atol=1e-8),
        "smoothed 1e-12": run(view, 600, [0.5, 0.3, 0], rtol=1e-12, atol=1e-12),
        "stiffer 1e-4": run(stiffer, 1500, [0.5, 0.3, 0], rtol=1e-4, atol=1e-4),
        "stiffer 1e-8": run(stiffer, 600, [0.5, 0.3, 0], rtol=1e-8, atol=1e-8),
        "stiffer 1e-12": run(stiffer, 200, [0.5, 0.3, 0], rtol=1e-12, atol=1e-12),
        "sweep": swept,
    }


def serve(only):
    """One of the processes: warm up, then do a named scene for every line that comes in."""
    import warnings

    warnings.simplefilter("ignore")
    chosen = {name: work for name, work in scenes().items() if only in name}
    cost = {name: (work(), work())[1] for name, work in chosen.items()}
    counted = {name: {k: c[k] for k in ("steps", "events") if k in c} for name, c in cost.items()}
    print(repr(counted), flush=True)
    for line in sys.stdin:
        begin = time.process_time()
        chosen[line.strip()]()
        print(time.process_time() - begin, flush=True)


def start(checkout, cache, only):
    """A serving process of a checkout, and the cost of its scenes."""
    environment = os.environ | {"PYTHONPATH": str(checkout), "PWSMOOTH_CACHE_DIR": str(cache)}
    command = [sys.executable, __file__, "--serve", "--only", only]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, env=environment, cwd=cache, stdin=pipe, stdout=pipe, text=True)
    return process, ast.literal_eval(process.stdout.readline())


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", nargs="?", type=Path)
    parser.add_argument("after", nargs="?", type=Path, default=HERE)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--processes", type=int, default=3)
    parser.add_argument("--only", default="", help="scenes whose name contains this")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        return serve(options.only)
    if options.before is None:
        parser.error("name the checkout to compare with")
    checkouts = [options.before.resolve(), options.after.resolve()]
    least, costs = [{}, {}], [{}, {}]
    with tempfile.TemporaryDirectory() as scratch:
        caches = [Path(scratch, side) for side in ("before", "after")]
        for cache in caches:
            cache.mkdir()
        for _ in range(options.processes):
            running = [start(*pair, options.only) for pair in zip(checkouts, caches, strict=True)]
            costs = [cost for _, cost in running]
            for _ in range(options.rounds):
                for name in costs[0]:
                    for side, (process, _) in enumerate(running):
                        process.stdin.write(name + "\n")
                        process.stdin.flush()
                        took = float(process.stdout.readline())
                        least[side][name] = min(took, least[side].get(name, took))
            for process, _ in running:
                process.stdin.close()
                process.wait()
    print(f"{'scene':16} {'before, ms':>11} {'after, ms':>11} {'ratio':>7}")
    for name, before in least[0].items():
        after = least[1][name]
        work = "" if costs[0][name] == costs[1][name] else f"   {costs[0][name]} / {costs[1][name]}"
        print(f"{name:16} {before * 1e3:11.2f} {after * 1e3:11.2f} {after / before:7.3f}{work}")


if __name__ == "__main__":
    main()
