"""What does an event of a large assembly cost, and does it depend on how many elements there are?

Question: of a family whose elements act on their neighbours alone, is the cost of an event that of the neighbourhood?
Expected: yes: what an event changes decays with the links that it crosses, so that a fixed number of elements is
renewed; what grows is the share of memory beyond the caches. Setting up and compiling should not depend on n but for
the numbers that are given.

Models
------
chain         the reference chain of tests/chain_models.py: blocks on a belt, springs kc = 2 between neighbours,
              static friction 1.5 times the kinetic one by a hidden term, T = 30 (times 1000/n for fewer than 1000)
Fs = Fk       the same chain with kinetic friction alone, which a run of all takes too without writing elements out
uniform       equal blocks from equal places: all let go at one instant, and worked out together then, at a cost that
              grows with how many they are
independent   the same blocks without springs
network       the blocks on a random graph, four links each, T = 10
slip_stick    a generalised Maxwell-slip law of n elements in prescribed motion (tests/family_models.py)

"A run of all" (`local=False`) renews every element at every event. An event's time is the run's less the set-up of its
arrays (a run of 1e-9), over the number of events. All of this is processor time on one thread; what a second thread
saves is told by the clock, of the same chain, the rounds interleaved, with the set-up and without it.

The same chain beside others
----------------------------
How long to T = 30 with states right to 1e-8? Of several tolerances the fastest that is right counts.

pwsmooth      solve() as a user calls it, start and end kept
heyoka        Taylor series of all elements, one terminal event an element by a run-time flag (slipping or not); compact
              mode
SciPy         DOP853 with one terminal event, the least of the n margins, restarted after each; not of 1000 blocks
Moreau-Jean   fixed steps, no events: v + h f, then each block's friction as a projection; compiled. Its error falls
              with the step: the time to 1e-8 is that of a step at which it was run, times the ratio of the errors (an
              extrapolation). A block is let go when its force exceeds 1.5 times the kinetic friction, as everywhere.

Where another wins: of ten blocks heyoka's time is a fraction of ours, since its run is one compiled loop while a call
of `solve` checks its arguments and makes its arrays in Python, and ten elements are hardly more than a neighbourhood.
From some hundred on the run by elements is ahead, by as much as there are elements beyond a neighbourhood.

No solver of quantised states (QSS) could be installed from the registries of Python packages. Their cost an event does
not depend on n either; of third order, their steps shrink as the tolerance to the power 1/3.

Usage: python experiments/bench_assemblies.py [--rounds 3] [--most 100000] [--million] [--out FILE.json]
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import resource
import statistics
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from benchtools import provenance, write_json
from chain_models import BELT, belt, chain, networks, start_of, with_templates
from family_models import MODELS, t
from numba import njit

from pwsmooth import System, plotting, solve
from pwsmooth.families import Recorder

END, BOUND = 30.0, 1e-8  # of the comparison with others
KC, RATIO = 2.0, 1.5


def seconds(call):
    """Processor time of a call."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


# ---- events


def uniform(n):
    system = belt(n, RATIO, np.ones(n))
    return system, start_of(system, np.zeros(n))


def independent(n):
    return chain(n, couple=None)


def network(n):
    i = np.arange(n)
    system = belt(n, RATIO, 1 + 0.06 * ((7 * i) % 5), table=networks(n))
    return system, start_of(system, 0.3 * np.sin(1.7 * i + 0.3))


def kinetic_alone(n):
    return chain(n, None)


SPANS = {"chain": 30.0, "Fs = Fk": 30.0, "uniform": 60.0, "independent": 30.0, "network": 10.0}
BUILD = {"chain": chain, "Fs = Fk": kinetic_alone, "uniform": uniform, "independent": independent,
         "network": network}  # fmt: skip


def event_costs(name, sizes, rounds, ways=(True,)):
    """Rows of what an event costs for each n, rounds interleaved."""
    # Few events are few microseconds beside what a run has to make ready: of small n long spans.
    longer = name != "Fs = Fk"  # which comes to rest
    ends = {n: SPANS[name] * (max(1, 1000 // n) if longer else 1) for n in sizes}
    times_each = {n: 1 if longer else max(1, 1000 // n) for n in sizes}
    made = {n: with_templates(BUILD[name], n) for n in sizes}
    times = {(n, way): [] for n in sizes for way in ways}
    events = {}

    def run(n, way, span):
        system, start = made[n]
        return solve(system, (0, span), start, t_eval=[0, span], local=way, threads=1)

    for round_ in range(rounds + 1):
        for n, way in times:
            spent = 0.0
            for _ in range(times_each[n]):
                begin = time.process_time()
                run(n, way, 1e-9)
                ready = time.process_time()
                solution = run(n, way, ends[n])
                spent += (time.process_time() - ready) - (ready - begin)
            spent /= times_each[n]
            events[n, way] = len(solution.events)
            assert solution.success
            if round_:
                times[n, way].append(spent)
    rows = []
    for n in sizes:
        row = {"model": name, "n": n, "events": events[n, ways[0]]}
        for way in ways:
            label = "µs an event" if way else "µs an event, a run of all"
            row[label] = 1e6 * statistics.median(times[n, way]) / events[n, way]
        rows.append(row)
        print(row, flush=True)
    return rows


def slip_stick(sizes, rounds):
    """Milliseconds of a period, as `solve` chooses where times are asked for."""
    made, times, events = {}, {n: [] for n in sizes}, {}
    for n in sizes:
        arguments, start, span = MODELS["slip_stick"](n)
        made[n] = System(**({"time": t} | arguments)), span, start
    for round_ in range(rounds + 1):
        for n, (system, span, start) in made.items():
            begin = time.process_time()
            events[n] = len(solve(system, span, start, t_eval=span).events)
            if round_:
                times[n].append(time.process_time() - begin)
    return [
        {"model": "slip_stick", "n": n, "events": events[n], "period (ms)": 1e3 * statistics.median(times[n]),
         "µs an event": 1e6 * statistics.median(times[n]) / events[n]}
        for n in sizes
    ]  # fmt: skip


def set_up(sizes):
    """Seconds from the equations to the end of a run of no length."""
    rows = []
    for n in sizes:
        begin = time.process_time()
        system, start = chain(n)
        built = time.process_time()
        solve(system, (0, 1e-9), start, t_eval=[0, 1e-9], local=True)
        rows.append({"n": n, "system (s)": built - begin, "first run (s)": time.process_time() - built})
        print(rows[-1], flush=True)
    return rows


def quiescent(sizes, rounds):
    """Milliseconds of 100 blocks at work among others that have nothing to do; a run of nobody at work taken off."""
    made = {}
    for n in sizes:
        system = belt(n, RATIO, np.ones(n))
        places = np.zeros(n)
        idle = start_of(system, places)
        places[n // 2 : n // 2 + 100] = 0.9 * np.sin(3.0 * np.arange(100))
        made[n] = system, idle, start_of(system, places)
    times = {n: [] for n in sizes}
    for round_ in range(rounds + 1):
        for n, (system, *starts) in made.items():
            spent = []
            for start in starts:
                begin = time.process_time()
                solution = solve(system, (0, 8), start, t_eval=[0, 8], local=True, threads=1)
                spent.append(time.process_time() - begin)
            if round_:
                times[n].append(spent[1] - spent[0])
    return [
        {"n": n, "at work": 100, "events": len(solution.events), "ms": 1e3 * statistics.median(times[n])}
        for n in sizes
    ]


def both_cores(sizes, rounds):
    """The chain by the clock, on one thread over on two: whole calls, and without the set-up."""
    rows = []
    for n in sizes:
        system, start = with_templates(chain, n)
        times = {}
        for round_ in range(rounds + 1):
            for threads in (1, 2):
                begin = time.perf_counter()
                solve(system, (0, 1e-9), start, t_eval=[0, 1e-9], threads=threads)
                ready = time.perf_counter()
                solution = solve(system, (0, END), start, t_eval=[0, END], threads=threads)
                whole = time.perf_counter() - ready
                if round_:
                    times.setdefault(threads, []).append((whole, whole - (ready - begin)))
        ratios = np.median(np.array(times[1]) / np.array(times[2]), axis=0)
        rows.append({"n": n, "events": len(solution.events), "whole": ratios[0], "without set-up": ratios[1]})
        print(rows[-1], flush=True)
    return rows


def million(events):
    """A chain of 10^6 blocks, its events on disk: seconds, events and the largest memory of a process of its own."""
    n = 10**6
    begin = time.process_time()
    system, start = chain(n)
    built = time.process_time()
    end = 30.0 * events / 6.88e6
    with tempfile.TemporaryDirectory() as folder:
        record = Recorder(events=Path(folder) / "events.zarr")
        solution = solve(system, (0, end), start, local=True, threads=1, record=record)
    spent = time.process_time() - built
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return {
        "n": n,
        "events": solution.cost["events"],
        "system (s)": built - begin,
        "run (s)": spent,
        "memory (GB)": size,
    }


# ---- others


def forces(n):
    i = np.arange(n)
    return 1 + 0.06 * ((7 * i) % 5), 0.3 * np.sin(1.7 * i + 0.3) + 0.2 * np.sin(0.37 * i * i)


def by_pwsmooth(n, rtol):
    """A runner: () -> (events, states at the end)."""
    system, start = chain(n)

    def run():
        solution = solve(system, (0, END), start, t_eval=[0, END], rtol=rtol, atol=rtol / 1e2)
        return len(solution.events), solution.x[:, -1]

    return run


def pulls(x):
    """Force on every block without friction."""
    pull = -x
    pull[:-1] += KC * (x[1:] - x[:-1])
    pull[1:] -= KC * (x[1:] - x[:-1])
    return pull


def begin(n):
    """(kinetic friction, places, side of each block at the start: 0 while it sticks)."""
    friction, x = forces(n)
    R = pulls(x)
    return friction, x, np.where(np.abs(R) <= RATIO * friction, 0.0, np.sign(R))


class Heyoka:
    """Taylor series of the whole, with an event an element."""

    def __init__(self, n, tol):
        import heyoka as hy

        hy.set_logger_level_critical()
        self.n, self.friction = n, forces(n)[0]
        x = hy.make_vars(*(f"x_{i}" for i in range(n)))
        w = hy.make_vars(*(f"w_{i}" for i in range(n)))
        x, w = (x, w) if n > 1 else ([x], [w])
        rates, events = [], []
        for i in range(n):
            side, slips = hy.par[2 * i], hy.par[2 * i + 1]
            R = -x[i]
            if i:
                R += KC * (x[i - 1] - x[i])
            if i < n - 1:
                R += KC * (x[i + 1] - x[i])
            rates += [(x[i], w[i]), (w[i], slips * (R - self.friction[i] * side))]
            margin = slips * side * (w[i] - BELT) + (1 - slips) * ((RATIO * self.friction[i]) ** 2 - R * R)
            events.append(hy.t_event(margin, callback=self._action(i), direction=hy.event_direction.negative))
        self.events = 0
        self.ta = hy.taylor_adaptive(rates, [0.0] * (2 * n), pars=[0.0] * (2 * n), tol=tol, compact_mode=True,
                                     fast_math=True, t_events=events)  # fmt: skip
        self.state, self.pars = self.ta.state, self.ta.pars

    def _action(self, i):
        def act(ta, sign):
            self.events += 1
            x, pars = self.state[::2], self.pars
            R = (
                -x[i]
                + (KC * (x[i - 1] - x[i]) if i else 0.0)
                + (KC * (x[i + 1] - x[i]) if i < self.n - 1 else 0.0)
            )
            if pars[2 * i + 1]:
                self.state[2 * i + 1] = BELT
                if abs(R) <= RATIO * self.friction[i]:
                    pars[2 * i + 1] = 0.0
                else:
                    pars[2 * i] = math.copysign(1.0, R)
            else:
                pars[2 * i], pars[2 * i + 1] = math.copysign(1.0, R), 1.0
            return True

        return act

    def __call__(self):
        _, x, side = begin(self.n)
        self.ta.time = 0.0
        self.ta.reset_cooldowns()
        self.state[::2], self.state[1::2] = x, BELT
        self.pars[::2], self.pars[1::2] = side, side != 0
        self.events = 0
        self.ta.propagate_until(END)
        return self.events, np.concatenate([self.state[::2], self.state[1::2]])


def by_scipy(n, rtol):
    """DOP853; the event is the least of the margins of all blocks, restarted after each."""
    from scipy.integrate import solve_ivp

    def run():
        friction, x, side = begin(n)
        state, now, events = np.concatenate([x, np.full(n, BELT)]), 0.0, 0
        while True:
            slips, strength = side != 0, RATIO * friction
            quiet = np.zeros(n, bool)  # has begun to slip: its margin is 0 now

            def rates(t, u, slips=slips, side=side):
                return np.concatenate([u[n:], np.where(slips, pulls(u[:n]) - friction * side, 0.0)])

            def margins(u, slips=slips, side=side, strength=strength):
                return np.where(slips, side * (u[n:] - BELT), strength - np.abs(pulls(u[:n])))

            quiet = np.abs(margins(state)) < 1e-10

            def least(t, u, margins=margins, quiet=quiet):
                m = margins(u)
                # What starts at its margin is left out until it has come away from it.
                m[quiet & (np.abs(m) < 1e-9)] = 1.0
                return m.min()

            least.terminal, least.direction = True, -1
            out = solve_ivp(
                rates, (now, END), state, "DOP853", rtol=rtol, atol=rtol / 1e2, events=least, max_step=0.5
            )
            state, now = out.y[:, -1].copy(), out.t[-1]
            if out.status == 0:
                return events, state
            k = int(np.argmin(np.where(quiet & (np.abs(margins(state)) < 1e-9), 1.0, margins(state))))
            events += 1
            side = side.copy()
            R = pulls(state[:n])[k]
            if side[k]:
                state[n + k] = BELT
                side[k] = 0.0 if abs(R) <= strength[k] else np.sign(R)
            else:
                side[k] = np.sign(R)

    return run


@njit(cache=True)
def moreau(x, v, side, friction, steps, h):
    """Steps of Moreau and Jean with theta = 1/2 of the place and friction as a projection of every block."""
    n, events = len(x), 0
    for _ in range(steps):
        x += 0.5 * h * v
        for i in range(n):
            R = -x[i]
            if i > 0:
                R += KC * (x[i - 1] - x[i])
            if i < n - 1:
                R += KC * (x[i + 1] - x[i])
            free = v[i] - BELT + h * R
            bound = h * friction[i] * (RATIO if side[i] == 0.0 else 1.0)
            if abs(free) <= bound:
                events += side[i] != 0.0
                side[i], v[i] = 0.0, BELT
            else:
                events += side[i] == 0.0
                s = math.copysign(1.0, free)
                side[i], v[i] = s, BELT + free - s * h * friction[i]
        x += 0.5 * h * v
    return events


def by_moreau(n, h):
    def run():
        friction, x, side = begin(n)
        x, v = x.copy(), np.full(n, BELT)
        events = moreau(x, v, side, friction, round(END / h), END / round(END / h))
        return int(events), np.concatenate([x, v])

    return run


def race(n, rounds, entrants):
    """Rows: the fastest setting of every entrant that is right to the bound."""
    reference = by_pwsmooth(n, 1e-14)()
    rows = []

    def error(run):
        events, states = run()
        return events, float(np.abs(states - reference[1]).max())

    for name, makers in entrants.items():
        best = None
        for label, make in makers:
            run = make()
            run()
            events, off = error(run)
            took = seconds(run)
            print(f"  n = {n}, {name}, {label}: {took:.3g} s, error {off:.1e}, events {events}", flush=True)
            if name == "Moreau-Jean" and off < 1e-2:  # beside other events no error tells of a smaller step's
                best = min(
                    best or (math.inf,), (took * off / BOUND, label, run, off, events), key=lambda b: b[0]
                )
            elif name != "Moreau-Jean" and off < BOUND and events == reference[0]:
                best = min(best or (math.inf,), (took, label, run, off, events), key=lambda b: b[0])
        if best is None:
            continue
        took, label, run, off, events = best
        scale = off / BOUND if name == "Moreau-Jean" else 1.0
        took = statistics.median(seconds(run) for _ in range(rounds)) * scale
        rows.append({"n": n, "code": name, "setting": label, "time to 1e-8 (s)": took, "error": off, "events": events,
                     "extrapolated": name == "Moreau-Jean"})  # fmt: skip
        print(rows[-1], flush=True)
    return rows


def others(sizes, rounds):
    rows = []
    for n in sizes:
        entrants = {
            "pwsmooth": [(f"rtol {r:g}", partial(by_pwsmooth, n, r)) for r in (1e-8, 1e-9, 1e-10, 1e-11)]
        }
        if n <= 1000:
            entrants["heyoka"] = [(f"tol {r:g}", partial(Heyoka, n, r)) for r in (1e-9, 1e-11)]
        if n <= 100:
            entrants["SciPy DOP853"] = [(f"rtol {r:g}", partial(by_scipy, n, r)) for r in (1e-10, 1e-11)]
        steps = (1e-3, 1e-4, 1e-5) if n <= 100 else (1e-3, 1e-4)
        entrants["Moreau-Jean"] = [(f"h = {h:g}", partial(by_moreau, n, h)) for h in steps]
        rows += race(n, rounds, entrants)
    return rows


# ---- the picture and the table of what was asked for


def bars(rows, quiet, ready, cores):
    """What was asked for and what is measured."""
    cost = {}
    for r in rows:
        cost.setdefault(r["model"], {})[r["n"]] = r
    both = cost["Fs = Fk"]
    whole = {n: r["µs an event, a run of all"] / r["µs an event"] for n, r in both.items()}
    found = []

    def ratio(what, model, n, over, bar, of="µs an event"):
        value = cost[model][n][of] / cost[model][over][of]
        found.append((f"{what} at n = {n} over n = {over}", value, f"at most {bar}"))

    longest = {name: max(of) for name, of in cost.items()}
    ratio("chain, an event", "chain", longest["chain"], 10, 3)
    ratio("chain, an event", "chain", 10**4, 100, 1.6)
    ratio("chain, an event", "chain", longest["chain"], 100, 2)
    ratio("slip_stick, a period", "slip_stick", 1000, 10, 200, "period (ms)")
    ratio("network of degree 4, an event", "network", longest["network"], 100, 4)
    ratio("independent elements, an event", "independent", longest["independent"], 100, 2)
    found.append(("Fs = Fk, a run of all over one by elements, n = 1000", whole[1000], "at least 40"))
    found.append(("Fs = Fk, a run by elements over one of all, n = 10", 1 / whole[10], "at most 1.2"))
    few, many = quiet[0], quiet[-1]
    found.append(
        (f"100 at work among {many['n']} over among {few['n']}", many["ms"] / few["ms"], "at most 1.5")
    )
    for row in cores:
        what = f"one thread over two by the clock, n = {row['n']}, without set-up"
        found.append((what, row["without set-up"], "more than 1"))
    more = sum(ready[-1][k] - ready[0][k] for k in ("system (s)", "first run (s)"))
    found.append((f"set-up at n = {ready[-1]['n']} less that at n = 10 (s)", more, "at most 2"))
    return [{"ratio": name, "measured": value, "asked for": bar} for name, value, bar in found]


def draw(record, path):
    rows = record["cost of an event"]
    with plotting.style():
        figure = plotting.new_figure(9.0, 3.8)
        left, right = figure.subplots(1, 2)
        looks = {"chain": ("exact", "o"), "network": ("left", "s"), "independent": ("stick", "^"),
                 "uniform": ("velocity", "v"), "slip_stick": ("approximation", "D")}  # fmt: skip
        for name, (colour, mark) in looks.items():
            points = [(r["n"], r["µs an event"]) for r in rows if r["model"] == name]
            left.loglog(*zip(*points, strict=True), marker=mark, markersize=4, color=plotting.COLOUR[colour],
                        label=name.replace("_", "-"))  # fmt: skip
        points = [(r["n"], r["µs an event, a run of all"]) for r in rows if r["µs an event, a run of all"]]
        left.loglog(
            *zip(*points, strict=True), "--x", color=plotting.COLOUR["mark"], label="chain, all renewed"
        )
        left.set(xlabel="elements n", ylabel="processor time an event (µs)", title="What an event costs")
        left.legend(fontsize=7)
        rows = record["the same chain, to 1e-8"]
        codes = {"pwsmooth": ("exact", "o"), "heyoka": ("heyoka", "s"), "SciPy DOP853": ("SciPy", "^"),
                 "Moreau-Jean": ("time stepping", "x")}  # fmt: skip
        for name, (colour, mark) in codes.items():
            points = [(r["n"], r["time to 1e-8 (s)"]) for r in rows if r["code"] == name]
            guessed = any(r["extrapolated"] for r in rows if r["code"] == name)
            right.loglog(*zip(*points, strict=True), marker=mark, markersize=4, color=plotting.COLOUR[colour],
                         linestyle=":" if guessed else "-",
                         label=name + (", extrapolated" if guessed else ""))  # fmt: skip
        right.set(
            xlabel="blocks n", ylabel="processor time to T = 30 (s)", title="The same chain, states to 1e-8"
        )
        right.legend(fontsize=7)
        figure.savefig(path, dpi=150, bbox_inches="tight")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--most", type=int, default=100_000, help="blocks of the longest chain")
    parser.add_argument("--network", type=int, default=10_000, help="blocks of the largest network")
    parser.add_argument("--million", action="store_true", help="10^6 blocks too, with 10^6 and 10^7 events")
    parser.add_argument("--without-others", action="store_true")
    parser.add_argument("--out")
    arguments = parser.parse_args()
    sizes = [n for n in (10, 100, 1000, 10_000, 100_000) if n <= arguments.most]
    rounds = arguments.rounds
    ready = with_templates(lambda: set_up(sizes))
    rows = event_costs("chain", sizes, rounds)
    rows += event_costs("Fs = Fk", (10, 100, 1000), rounds, (True, False))
    rows += event_costs("uniform", [n for n in sizes if n <= 10_000], rounds)
    rows += event_costs("independent", sizes[1:], rounds)
    rows += event_costs("network", [n for n in sizes[1:] if n <= arguments.network], rounds)
    rows += slip_stick((10, 100, 1000), rounds)
    columns = dict.fromkeys(name for row in rows for name in row)
    rows = [{name: row.get(name) for name in columns} for row in rows]
    quiet = with_templates(lambda: quiescent((1000, sizes[-1]), 3 * rounds))
    cores = both_cores([n for n in (5_000, 20_000, 100_000) if n <= arguments.most], rounds)
    record = {
        "options": vars(arguments), "provenance": provenance(), "ratios": bars(rows, quiet, ready, cores),
        "one thread over two": cores,
        "cost of an event": rows, "set-up of the chain": ready, "blocks at rest": quiet,
    }  # fmt: skip
    if not arguments.without_others:
        record["the same chain, to 1e-8"] = others((10, 100, 1000, 10_000), rounds)
    if arguments.million:
        for events in (10**6, 10**7):
            with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as alone:
                record.setdefault("a million blocks", []).append(alone.submit(million, events).result())
    for row in record["ratios"]:
        print(f"{row['ratio']:70}{row['measured']:10.3g}   {row['asked for']}")
    if arguments.out:
        write_json(arguments.out, record)
        if not arguments.without_others:
            draw(record, Path(arguments.out).with_suffix(".png"))


if __name__ == "__main__":
    sys.exit(main())
