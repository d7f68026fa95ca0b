"""How soon is a map seen, and what does all of it cost? The friction oscillator, z relaxing; processor time.

    y' = v,   v' = -sigma sin t - k y - 0.1 v - lam (1 + rho z),   z' = (1 - lam^2 - z)/beta,   lam = sign v

Orbit diagrams of 800 columns, 100 periods unseen and 100 kept, by `refine`: the first chunk, all of them, and all
without finishing early what has settled. Three parameters; along two of them the block sticks most of the time.

Basins of 300 x 300 starts with three attractors, by `refine_basins`: the first chunk, all of them, and the time of a
period in there over that of a period in `sweep` of the same starts, which is what looking at trajectories costs.

Goals: all columns <= 3 s; basins <= 1.3 of `sweep`, a period.

Usage: python experiments/bench_refine.py [--side 300] [--out FILE.json]
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import sympy as sp
from benchtools import provenance, write_json

from pwsmooth import Strobe, Switch, System, sweep
from pwsmooth.studies import Points, Work, basins, make_plan, refine

t, y, v, z = sp.symbols("t y v z", real=True)
rho, beta, k, sigma, omega = sp.symbols("rho beta k sigma omega", nonnegative=True)
lam = Switch("lam", v)
OSCILLATOR = System(
    {y: v, v: -sigma * sp.sin(omega * t) - k * y - v / 10 - lam * (1 + rho * z), z: (1 - lam**2 - z) / beta},
    time=t,
    parameters={rho: 3, beta: 0.1, k: 3.1, sigma: 2.4, omega: 1},
)
DRIVE = 2 * sp.pi / omega
RANGES = {"rho": (0, 6), "sigma": (0.5, 1.6), "omega": (0.5, 1.5)}


def diagram(name):
    """Seconds of the first chunk, of all columns, and of all columns run to their end; and the share of sticking."""
    plan = make_plan(
        OSCILLATOR, {name: np.linspace(*RANGES[name], 800)}, x0={"y": 0.5, "v": 0.3, "z": 0}, seen=Strobe(DRIVE),
        transient=100, periods=100, measures=[Points("y", last=100)],
    )  # fmt: skip
    begin = time.process_time()
    chunks = refine(plan)
    indices, _ = next(chunks)
    first = time.process_time() - begin
    for _ in chunks:
        pass
    whole = time.process_time() - begin
    for _ in refine(plan, settle=None):
        pass
    unsettled = time.process_time() - begin - whole
    sticks = sweep(
        OSCILLATOR, {name: np.linspace(*RANGES[name], 40)}, x0={"y": 0.5, "v": 0.3, "z": 0}, seen=Strobe(DRIVE),
        measures=["sticks"], work=Work(progress=False),
    )  # fmt: skip
    value = plan.values(indices)[name]
    return {
        "first chunk, s": first,
        "its columns": len(indices),
        "its range": [float(value.min()), float(value.max())],
        "all columns, s (goal 3)": whole,
        "all columns to their end, s": unsettled,
        "columns that stick": float((sticks.sticks > 0).mean()),
    }


def maps(side):
    """Seconds of basins, and of a period in there and in `sweep`."""
    grid = {"y": np.linspace(-2, 2, side), "v": np.linspace(-2, 2, side)}
    ran, work = 0, basins.run_chunk

    def counted(plan, columns):
        nonlocal ran
        ran += len(columns["y"]) * (plan.transient + plan.periods)
        return work(plan, columns)

    basins.run_chunk = counted
    begin = time.process_time()
    chunks = basins.refine_basins(OSCILLATOR, grid, Strobe(DRIVE), x0={"z": 0}, transient=200)
    labels = [next(chunks)[1]]
    first = time.process_time() - begin
    for _, some, found in chunks:
        labels.append(some)
        attractors = found
    whole = time.process_time() - begin
    basins.run_chunk = work
    labels = np.concatenate(labels)
    chosen = np.random.default_rng(1).permutation(side**2)[:20_000]
    starts = dict(
        zip(grid, (axis[i] for axis, i in zip(grid.values(), np.unravel_index(chosen, (side, side)))))
    )
    periods = round(ran / side**2)
    begin = time.process_time()
    sweep(
        OSCILLATOR, points=starts, x0={"z": 0}, seen=Strobe(DRIVE), transient=0, periods=periods,
        work=Work(workers=1, progress=False),
        measures=[Points("y", last=1)],
    )  # fmt: skip
    plain = (time.process_time() - begin) / (len(chosen) * periods)
    return {
        "starts": side**2,
        "attractors": len(attractors),
        "shares": [float(np.mean(labels == j)) for j in range(len(attractors))],
        "without a label": int(np.sum(labels < 0)),
        "first chunk, with Newton's method, s": first,
        "all starts, s": whole,
        "periods run": ran,
        "a period over that of sweep (goal 1.3)": whole / ran / plain,
    }


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=300, help="starts along an axis of the basins")
    parser.add_argument("--out", help="write the results as JSON")
    options = parser.parse_args()
    diagram("rho")  # compiles, or loads what was compiled
    results = {f"orbit diagram over {name}": diagram(name) for name in RANGES}
    results["basins"] = maps(options.side)
    for what, rows in results.items():
        print(what)
        for name, value in rows.items():
            print(f"  {name:45} {value if isinstance(value, (int, list)) else f'{value:.4g}'}")
    if options.out:
        write_json(options.out, {"results": results, "provenance": provenance()})


if __name__ == "__main__":
    main()
