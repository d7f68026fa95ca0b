"""How many orbits a second does a sweep make? The oscillator with rho = 0 over random (k, sigma), 20 periods each.

    y' = v,   v' = -sigma sin t - k y - 0.1 v - sign(v),   (y, v) = (0.5, 0.3),   k in [1.5, 5], sigma in [0.6, 3]

Every entrant has to end every orbit with an error below 1e-8 against the closed form, and with its number of
events. Of several tolerances of an entrant, the fastest that qualifies counts. Compile time is left out; time is
processor time, rounds interleaved, medians.

Entrants
--------
closed form   tests/reference/coulomb_oscillator.py, compiled, all orbits in one call
pwsmooth      sweep() as a user calls it, on one thread, everything included: axes, sticks, itineraries, periods,
              the last state, counts of events, the Dataset
heyoka        fast_math; one orbit after the other with one integrator, k and sigma as run-time parameters; its
              event callback is Python, as heyoka offers no other

Expected from a feasibility study on another machine: 30 000 orbits a second and core, closed form 104 000,
heyoka 5 100. Goals: 25 000, and 5 times heyoka; on two cores 1.8 times; cost linear in the number of points;
memory bounded by the measures.

Usage: python experiments/bench_sweep.py [--rounds 5] [--points 10000] [--largest 1000000] [--out FILE.json]
"""

from __future__ import annotations

import argparse
import math
import resource
import statistics
import time

import numpy as np
from benchtools import provenance, write_json
from reference.coulomb_oscillator import ensemble

START = (0.5, 0.3)
PERIODS = 20
T_END = PERIODS * 2 * math.pi
ERROR_BOUND = 1e-8


def random_points(count):
    """(k, sigma), each (count,)."""
    rng = np.random.default_rng(20240)
    return rng.uniform(1.5, 5, count), rng.uniform(0.6, 3, count)


def closed_form(k, sigma):
    """Events and last states of all orbits: (count,), (count, 2)."""
    counts, final = np.zeros(len(k), np.int64), np.zeros((len(k), 2))
    y0, v0 = (np.full(len(k), value) for value in START)
    times, kinds = np.empty((len(k), 0)), np.empty((len(k), 0), np.int64)
    ensemble(k, sigma, 0.1, 1.0, 1.0, 1.0, 1.0, y0, v0, T_END, times, kinds, counts, final)
    return counts, final


def pwsmooth_runner(rtol):
    """The System is built outside the clock, as in a notebook."""
    import sympy as sp

    from pwsmooth import Strobe, Switch, System, sweep
    from pwsmooth.studies import Points, Work

    t, y, v = sp.symbols("t y v", real=True)
    k, c, N, sigma, omega = sp.symbols("k c N sigma omega", nonnegative=True)
    rates = {y: v, v: -sigma * sp.sin(omega * t) - k * y - c * v - N * Switch("lam", v)}
    oscillator = System(rates, time=t, parameters={k: 3.1, c: 0.1, N: 1, sigma: 2.4, omega: 1})

    def run(ks, sigmas, workers=1, chunk=None):
        found = sweep(
            oscillator, points={"k": ks, "sigma": sigmas}, x0={y: START[0], v: START[1]},
            seen=Strobe(2 * sp.pi / omega),
            transient=0, periods=PERIODS, rtol=rtol, atol=1e-3 * rtol,
            work=Work(workers=workers, chunk=chunk, progress=False),
            measures=["sticks", "itinerary", "period", "counts", Points("y", "v", last=1)],
        )  # fmt: skip
        final = np.column_stack([found.y_points.values[:, 0], found.v_points.values[:, 0]])
        return found.events.values, final

    return run


def heyoka_runner(tol):
    """As in bench_events.py, with k and sigma as parameters of the integrator."""
    import heyoka as hy

    hy.set_logger_level_critical()
    y, v = hy.make_vars("y", "v")
    lam, slip, k, sigma = (hy.par[i] for i in range(4))
    force = -sigma * hy.sin(hy.time) - k * y
    sin, count = math.sin, [0]

    def act(ta, sign):
        count[0] += 1
        f = -pars[3] * sin(ta.time) - pars[2] * state[0]
        if pars[1]:
            state[1] = 0.0
            if abs(f) <= 1.0:
                pars[1] = 0.0
            else:
                pars[0] = -pars[0]
        else:
            pars[0] = 1.0 if f > 0 else -1.0
            pars[1] = 1.0
        return True

    cycle = hy.t_event(
        slip * lam * v + (1 - slip) * (1.0 - force**2), callback=act, direction=hy.event_direction.negative
    )
    ta = hy.taylor_adaptive(
        [(y, v), (v, slip * (force - 0.1 * v - lam))], list(START), pars=[1.0, 1.0, 3.1, 2.4], tol=tol,
        fast_math=True, t_events=[cycle],
    )  # fmt: skip
    state, pars = ta.state, ta.pars

    def run(ks, sigmas):
        counts, final = np.zeros(len(ks), np.int64), np.zeros((len(ks), 2))
        for i in range(len(ks)):
            ta.time = 0.0
            ta.reset_cooldowns()
            pars[:] = (1.0, 1.0, ks[i], sigmas[i])
            state[:] = START
            count[0] = 0
            ta.propagate_until(T_END)
            counts[i], final[i] = count[0], state
        return counts, final

    return run


def timed(run, *arguments, **options):
    begin = time.process_time()
    run(*arguments, **options)
    return time.process_time() - begin


def fastest_qualified(name, candidates, points, expected):
    """Of {label: runner}, the fastest that meets the bound: (label, runner, largest error, wrong counts)."""
    best = None
    for label, run in candidates.items():
        counts, final = run(*points)
        error = float(np.abs(final - expected[1]).max())
        wrong = int(np.sum(counts != expected[0]))
        took = min(timed(run, *points) for _ in range(2))
        ok = error < ERROR_BOUND and wrong == 0
        rate = len(points[0]) / took
        print(
            f"  {name} {label}: {rate:8.0f} orbits/s, error {error:.1e}, {wrong} wrong counts{'' if ok else ': out'}"
        )
        if ok and (best is None or took < best[0]):
            best = took, label, run, error
    return best and best[1:]


def two_cores(run, points, rounds):
    """Wall time on one thread over that on two, and processor time on two over that on one.

    The first needs two idle cores, the second does not.
    """
    walls, inflations = [], []
    for _ in range(rounds):
        wall, cpu = [], []
        for workers in (1, 2):
            begin, used = time.perf_counter(), time.process_time()
            run(*points, workers=workers, chunk=500)
            wall.append(time.perf_counter() - begin)
            cpu.append(time.process_time() - used)
        walls.append(wall[0] / wall[1])
        inflations.append(cpu[1] / cpu[0])
    return statistics.median(walls), statistics.median(inflations)


def growth(run, largest):
    """(points, processor seconds, peak resident memory in MB) from 1e2 to `largest`."""
    rows, count = [], 100
    while count <= largest:
        took = timed(run, *random_points(count), workers=2)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        rows.append((count, took, peak))
        print(
            f"  {count:8d} points: {took:8.3f} s, {took / count * 1e6:7.1f} us each, peak {peak:.0f} MB",
            flush=True,
        )
        count *= 10
    return rows


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--largest", type=int, default=1_000_000)
    parser.add_argument("--out", help="write the results as JSON")
    options = parser.parse_args()
    points = random_points(options.points)
    expected = closed_form(*points)
    few = tuple(p[: options.points // 10] for p in points)
    few_expected = tuple(e[: options.points // 10] for e in expected)
    ours = fastest_qualified(
        "pwsmooth", {f"rtol {r:g}": pwsmooth_runner(r) for r in (1e-8, 1e-9, 1e-10)}, points, expected
    )
    rival = fastest_qualified(
        "heyoka", {f"tol {r:g}": heyoka_runner(r) for r in (1e-6, 1e-8, 1e-10)}, few, few_expected
    )
    if not ours or not rival:
        raise SystemExit("an entrant has no tolerance that meets the bound")
    entrants = {
        "closed form": lambda: timed(closed_form, *points) / len(points[0]),
        f"pwsmooth {ours[0]}": lambda: timed(ours[1], *points) / len(points[0]),
        f"heyoka {rival[0]}": lambda: timed(rival[1], *few) / len(few[0]),
    }
    times = {name: [] for name in entrants}
    for _ in range(options.rounds):
        for name, run in entrants.items():
            times[name].append(run())
    rates = {name: 1 / statistics.median(row) for name, row in times.items()}
    for name, rate in rates.items():
        print(f"{name:28} {rate:10.0f} orbits a second and core")
    values = list(rates.values())
    wall, inflation = two_cores(ours[1], points, options.rounds)
    results = {
        "orbits a second and core (goal 25000)": values[1],
        "times heyoka (goal 5)": values[1] / values[2],
        "share of the closed form": values[1] / values[0],
        "two threads, wall time ratio (goal 1.8 on two idle cores)": wall,
        "two threads, processor time ratio": inflation,
        "largest error": ours[2],
    }
    for name, value in results.items():
        print(f"{name:60} {value:.4g}")
    rows = growth(ours[1], options.largest)
    if options.out:
        data = {
            "results": results,
            "rates": rates,
            "all rounds": times,
            "growth": rows,
            "provenance": provenance(),
        }
        write_json(options.out, data)


if __name__ == "__main__":
    main()
