"""Maps that grow while one watches: orbit diagram, basins, Poincare section.

Each is a generator of (header, arrays) for the page, in pieces of about 50 ms of work, the first ones spread over the
whole picture. Orbits run through the package's own sweeps, and an attractor has its name once Newton's method has it.

    strobes x(kT):   settled where the last 32 repeat;   basin k:   strobes that come to the points of cycle k
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..analysis.orbits import refine as refined
from ..analysis.sections import poincare_map
from ..codegen.machine.workers import cores
from ..definition import checks
from ..results.records import Outcome
from ..sweep.basins import FAILED, UNSETTLED
from ..sweep.chunk import run_chunk
from ..sweep.measures import Points
from ..sweep.periodicity import Period
from ..sweep.plan import Plan, make_plan
from .describe import LIMITS
from .live import Answer, state_of
from .subject import Subject

SLICE = 0.05  # s of work between two looks at the pipe
EARLY = 32  # last strobes, whose repetition ends a column
REPEATS = 1e-6  # relative to 1 + abs(x)
CAUGHT = 1e-3  # a strobe so near to a point of a known cycle is in its basin
_BLOCK = 6  # periods of a basin's trajectory between two looks
_LOOKED = 4 * _BLOCK  # last strobes of a trajectory that are looked at for a cycle, of 8 periods at most
_BESIDE = 1e-9  # from 1, a multiplier of orbits side by side
_NEW = 1e-5  # repetition of a trajectory that may be at a cycle that is not known yet
_PERIODS = 400  # of a trajectory in basins, before it is unsettled


class Runner:
    """Orbits of one system over the period of its drive: strobes of many starts and parameter values at once."""

    def __init__(
        self, subject: Subject, p: Mapping[str, float], parameter: str | None, periods: int, transient: int
    ):
        self.names = [s.name for s in subject.system.states]
        system = subject.system.with_parameters(p)
        self.parameter, self.periods = parameter, periods
        given = {n: [subject.start[n]] for n in self.names}
        if parameter is not None:
            given[parameter] = [
                system.parameters[checks.lookup(parameter, system.parameters, "`parameter`", "parameter")]
            ]
        options = {"atol": [subject.atol.get(n, 1e-12) for n in self.names], "max_steps": LIMITS["steps"]}
        self.plan: Plan
        self.plan, _ = make_plan(
            system, None, given, {n: subject.start[n] for n in self.names}, [Points(*self.names, last=periods)], None,
            None, subject.period, transient, periods, None, None, options,
        )  # fmt: skip

    def __call__(self, x: np.ndarray, values: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """(strobes (k, periods, n), outcomes (k,)) from the starts x (k, n) at these values of the parameter."""
        columns = {n: np.ascontiguousarray(c) for n, c in zip(self.names, x.T)}
        if self.parameter is not None:
            columns[self.parameter] = values
        found = run_chunk(self.plan, columns)
        return np.stack([found[f"{n}_points"] for n in self.names], axis=-1), found["outcome"]


def orbit_diagram(subject: Subject, asked: Mapping[str, Any]) -> Iterator[Answer]:
    """Strobes over a parameter. `carry`: 0 each from the same start, 1 from left to right, -1 from right to left."""
    p, x0, _ = state_of(subject, asked)
    name = str(asked["parameter"])
    low, high = checks.interval(asked["range"], "`range`")
    count = min(checks.whole(asked.get("columns", 800), "`columns`", 2), LIMITS["columns"])
    keep = min(checks.whole(asked.get("keep", 100), "`keep`", EARLY), LIMITS["points"])
    values, carry = np.linspace(low, high, count), int(asked.get("carry", 0))
    subject.system.with_parameters({name: low}), subject.system.with_parameters({name: high})
    start = np.array([x0[n] for n in (s.name for s in subject.system.states)])
    early = Runner(subject, p, name, EARLY, 18)
    later = Runner(subject, p, name, keep, 100 if carry else keep - 50 if keep > 50 else 50)
    head = {"kind": "diagram", "parameter": name, "range": [low, high], "columns": count, "names": early.names,
            "keep": keep, "carry": carry}  # fmt: skip
    work = _Work()
    if carry:
        yield from _carried(later, values, start, carry, head, work)
        return
    order = spread(count)
    waiting: list[tuple[np.ndarray, np.ndarray]] = []
    at, before = 0, None
    while at < count:
        which = order[at : at + work.size]
        points, outcome = work.timed(early, np.tile(start, (len(which), 1)), values[which])
        work.periods += 50 * len(which)
        settled = repeating(points) | (outcome < 0)
        waiting.append((which[~settled], points[~settled, -1]))
        at += len(which)
        if len(which) == 1 and at < 2:  # shown with what follows at once
            before = which, points, settled
            continue
        if before is not None:
            which, points, settled = (np.concatenate(pair) for pair in zip(before, (which, points, settled)))
            before = None
        yield head | work.told(at, count, sum(len(w) for w, _ in waiting)), _columns(which, points, settled)
    which = np.concatenate([w for w, _ in waiting])
    x = np.concatenate([x for _, x in waiting])
    work.size, done = max(1, work.size // 4), 0
    while done < len(which):
        piece = slice(done, done + work.size)
        points, _ = work.timed(later, x[piece], values[which[piece]])
        work.periods += len(which[piece]) * (later.periods + later.plan.transient)
        done += len(which[piece])
        yield head | work.told(count, count, len(which) - done), _columns(which[piece], points, True)
    yield head | work.told(count, count, 0) | {"finished": True}, {}


def _carried(
    run: Runner, values: np.ndarray, start: np.ndarray, way: int, head: dict, work: _Work
) -> Iterator[Answer]:
    """Each column from where its neighbour ended: hysteresis shows where the two ways differ."""
    order = np.arange(len(values))[::way]
    x, done, pieces = start, 0, []
    for k in order:
        points, outcome = work.timed(run, x[None], values[[k]])
        if outcome[0] >= 0 and np.isfinite(points[0, -1]).all():
            x = points[0, -1]
        pieces.append((k, points[0]))
        done += 1
        work.periods += run.periods + run.plan.transient
        if work.late or done == len(order):
            which, points = np.array([k for k, _ in pieces]), np.stack([q for _, q in pieces])
            pieces = []
            yield (
                head | work.told(done, len(order), 0) | {"finished": done == len(order)},
                _columns(which, points, True),
            )


def _columns(which: np.ndarray, points: np.ndarray, final: Any) -> dict[str, np.ndarray]:
    return {
        "column": which.astype(np.int32), "points": points, "last": points[:, -1],
        "final": np.broadcast_to(np.asarray(final, np.uint8), len(which)).astype(np.uint8),
    }  # fmt: skip


def spread(count: int) -> np.ndarray:
    """0, ..., count - 1 in van der Corput's order: any first part is spread over the whole."""
    bits = max(1, int(count - 1).bit_length())
    order = np.zeros(1 << bits, int)
    for k in range(bits):
        order |= ((np.arange(1 << bits) >> k) & 1) << (bits - 1 - k)
    return order[order < count]


def repeating(points: np.ndarray) -> np.ndarray:
    """Whether the strobes (k, m, n) of each repeat after 1, ..., 8 periods."""
    found = np.zeros(len(points), bool)
    for cycle in range(1, 9):
        off = np.abs(points[:, cycle:] - points[:, :-cycle]) <= REPEATS * (1 + np.abs(points[:, cycle:]))
        found |= off.all(axis=(1, 2))
    return found


class _Work:
    """How much a piece of work may be, and what has been done. The first piece is small: it shows what one costs."""

    def __init__(self, first: int = 1, most: int = 40) -> None:
        self.size, self.periods, self.begun = first, 0, time.process_time()
        self._since, self._most = time.perf_counter(), most

    def timed(self, run: Any, *arguments: Any) -> Any:
        """The result; the next piece is as large as fits into the slice."""
        begun = time.perf_counter()
        result = run(*arguments)
        taken = max(time.perf_counter() - begun, 1e-5)
        self.size = int(
            np.clip(self.size * SLICE / taken, max(1, self.size // 4), max(4 * self.size, self._most))
        )
        return result

    @property
    def late(self) -> bool:
        """Whether a slice has passed since this was last so."""
        if time.perf_counter() - self._since < SLICE:
            return False
        self._since = time.perf_counter()
        return True

    def told(self, done: int, of: int, unsettled: int) -> dict[str, Any]:
        return {"done": done, "of": of, "unsettled": unsettled, "periods": self.periods,
                "cpu": time.process_time() - self.begun}  # fmt: skip


def section(subject: Subject, asked: Mapping[str, Any]) -> Iterator[Answer]:
    """Strobes of the current orbit, ever more of them."""
    p, x0, _ = state_of(subject, asked)
    run = Runner(subject, p, None, 50, 0)
    x = np.array([[x0[n] for n in run.names]])
    head, work, total = {"kind": "section", "names": run.names}, _Work(), 5000
    pieces, count = [x], 0
    while count < total:
        points, outcome = run(x)
        if outcome[0] < 0 or not np.isfinite(points[0, -1]).all():
            break
        x, count = points[0, -1:], count + len(points[0])
        pieces.append(points[0])
        if work.late or count >= total or count == len(points[0]):
            yield (
                head | {"done": count, "of": total, "finished": count >= total},
                {"points": np.concatenate(pieces)},
            )
            pieces = []
        if count >= 4 * EARLY and repeating(points)[0]:
            break
    yield head | {"done": count, "of": count, "finished": True}, {"points": np.concatenate([*pieces, x])}


@dataclass
class Cycle:
    """An attractor: its points on the section, and its orbit once Newton's method has it.

    `rest` stands for orbits side by side, as the places at which a block can rest: none of them is isolated.
    """

    points: np.ndarray
    orbit: Any = None
    rest: bool = False
    seen: bool = False  # by Newton's method

    def told(self) -> dict[str, Any]:
        if self.orbit is None:
            return {"period": 0 if self.seen else len(self.points), "sure": False, "rest": self.rest}
        sizes = [[float(m.real), float(m.imag)] for m in self.orbit.multipliers[:4]]
        return {"period": len(self.points), "time": float(self.orbit.period), "sure": True, "multipliers": sizes,
                "x": [float(v) for v in self.orbit.x]}  # fmt: skip


class Grid:
    """Starts over two states, their labels, and the cycles known so far."""

    def __init__(self, subject: Subject, asked: Mapping[str, Any]) -> None:
        p, self.x0, _ = state_of(subject, asked)
        self.axes = [str(n) for n in checks.several(asked["axes"], "`axes`")]
        self.n = min(checks.whole(asked.get("cells", 300), "`cells`", 2), LIMITS["cells"])
        self.ranges = [checks.interval(r, "`ranges`") for r in checks.several(asked["ranges"], "`ranges`")]
        if len(self.axes) != 2 or len(self.ranges) != 2:
            raise ValueError("`axes` and `ranges` of a basin are two each.")
        for name in self.axes:
            checks.lookup(name, subject.system.states, "`axes`", "state")
        self.run = Runner(subject, p, None, _BLOCK, 0)
        self.map = poincare_map(subject.system.with_parameters(p), subject.period, None, 1, 1.0, {})
        self.cycles: list[Cycle] = []
        self.refused: list[np.ndarray] = []  # points of cycles that do not attract
        self.label = np.full(self.n * self.n, _OPEN, np.int8)
        self.step = np.zeros(self.n * self.n, np.uint8)  # side of the square that a cell stands for
        self.guessed = np.zeros(self.n * self.n, bool)
        self.changed: list[np.ndarray] = []

    def starts(self, cells: np.ndarray) -> np.ndarray:
        """States (k, n) of cells, numbered row by row, the second axis up."""
        x = np.tile([self.x0[n] for n in self.run.names], (len(cells), 1))
        for name, (low, high), k in zip(self.axes, self.ranges, (cells % self.n, cells // self.n)):
            x[:, self.run.names.index(name)] = np.linspace(low, high, self.n)[k]
        return x

    def queue(self) -> Iterator[np.ndarray]:
        """Cells of every pass, coarse to fine; those whose coarser neighbours agree come last."""
        later = []
        for step in (16, 8, 4, 2, 1):
            rows, columns = (a.ravel() for a in np.meshgrid(*[np.arange(0, self.n, step)] * 2, indexing="ij"))
            new = (rows % (2 * step) != 0) | (columns % (2 * step) != 0) | (step == 16)
            cells = (rows * self.n + columns)[new]
            cells = cells[spread(len(cells))]
            self.step[cells] = step
            for piece in np.array_split(cells, max(1, len(cells) // 512)):
                likely = self._likely(piece, 2 * step) if step < 16 else np.full(len(piece), _OPEN)
                sure = likely != _OPEN
                later.append(piece[sure])
                self.put(piece[sure], likely[sure], guessed=True)
                yield piece[~sure]
        yield from later

    def _likely(self, cells: np.ndarray, step: int) -> np.ndarray:
        """The label of the 5 x 5 cells of the coarser grid around each, where they are known and agree."""
        last, around = (self.n - 1) // step * step, []
        for i in range(-2, 3):
            for j in range(-2, 3):
                row = np.clip(cells // self.n // step * step + i * step, 0, last)
                column = np.clip(cells % self.n // step * step + j * step, 0, last)
                at = row * self.n + column
                around.append(np.where(self.guessed[at], _OPEN, self.label[at]))
        agree = (np.array(around) == around[0]).all(axis=0) & (around[0] >= 0)
        return np.where(agree, around[0], _OPEN)

    def put(self, cells: np.ndarray, labels: Any, guessed: bool = False) -> None:
        """Labels of cells, which the page is told of next."""
        self.label[cells], self.guessed[cells] = labels, guessed
        self.changed.append(cells)

    def news(self) -> dict[str, np.ndarray]:
        """What has changed since this was asked last; 0 stands for open, 1 failed, 2 unsettled, 3 + k for cycle k."""
        cells = np.unique(np.concatenate([*self.changed, np.zeros(0, int)])).astype(int)
        self.changed = []
        return {"cell": cells.astype(np.int32), "label": (self.label[cells] + 3).astype(np.uint8),
                "step": self.step[cells], "guessed": self.guessed[cells]}  # fmt: skip

    def caught(self, points: np.ndarray) -> np.ndarray:
        """Index of the known cycle that each trajectory's strobes (k, m, n) come to, or _OPEN."""
        found = np.full(len(points), _OPEN, np.int8)
        for k, cycle in enumerate(self.cycles):
            for x in cycle.points:
                near = (np.abs(points - x) <= CAUGHT * (1 + np.abs(x))).all(axis=2).any(axis=1)
                found[near & (found == _OPEN)] = k
        return found

    def look(self, strobes: np.ndarray) -> np.ndarray:
        """Labels of trajectories with strobes (k, m, n) that repeat, where a cycle is new or not isolated."""
        found = np.full(len(strobes), _OPEN, np.int8)
        rest = next((k for k, c in enumerate(self.cycles) if c.rest), None)
        for i, points in enumerate(strobes):
            count = Period(8, _NEW).find(points)
            if not count or self.caught(points[None, -count:])[0] != _OPEN or self._refused(points[-1]):
                continue
            if rest is not None and self._newton(points[-count:])[0]:
                found[i] = rest
            elif len(self.cycles) < 100:
                self.cycles.append(Cycle(points[-count:]))
        return found

    def _refused(self, x: np.ndarray) -> bool:
        return any((np.abs(x - y) <= 10 * _NEW * (1 + np.abs(y))).all() for y in self.refused)

    def _newton(self, points: np.ndarray) -> tuple[bool, Any]:
        """(whether it is one of orbits side by side, the orbit if it attracts) where these points repeat."""
        orbit = refined(replace(self.map, count=len(points)), points[-1])
        if not orbit.success:
            return False, None
        sizes = np.abs(orbit.multipliers)
        beside = bool((np.abs(orbit.multipliers - 1) <= _BESIDE).any() and (sizes <= 1 + _BESIDE).all())
        return beside, orbit if orbit.stable else None

    def confirm(self) -> bool:
        """Newton's method from the first cycle that it has not seen; False where there is none."""
        k = next((k for k, c in enumerate(self.cycles) if not c.seen), None)
        if k is None:
            return False
        cycle, mine = self.cycles[k], self.label == k
        cycle.seen = True
        beside, orbit = self._newton(cycle.points)
        if orbit is not None:
            same = self.caught(orbit.x[None, None])[0]
            cycle.points = replace(orbit.map, count=1).iterate(orbit.x, orbit.map.count)
            if same in (_OPEN, k) or self.cycles[same].orbit is None:
                cycle.orbit = orbit
                return True
            self.label[mine] = same
        elif beside:
            rest = next((j for j, c in enumerate(self.cycles) if c.rest), k)
            self.label[mine], self.cycles[rest].rest = rest, True
        else:  # what seemed to repeat is no attractor
            self.label[mine] = UNSETTLED
            self.refused.extend(cycle.points)
        cycle.points = np.full_like(cycle.points, np.nan)  # nothing is caught by it
        self.changed.append(np.flatnonzero(mine))
        return True


def basins(subject: Subject, asked: Mapping[str, Any]) -> Iterator[Answer]:
    """The cycle that each start of a grid over two states comes to."""
    grid = Grid(subject, asked)
    work, queue, done = _Work(4, 256), grid.queue(), 0
    threads = max(1, cores() - 1)
    head = {"kind": "basins", "axes": grid.axes, "ranges": grid.ranges, "cells": grid.n}
    cell, age = np.zeros(0, int), np.zeros(0, int)
    last = np.zeros((0, _LOOKED, len(grid.run.names)))
    more = True
    with ThreadPoolExecutor(threads) as pool:

        def block(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            if threads == 1 or len(x) < 8 * threads:
                return grid.run(x)
            found = list(pool.map(grid.run, np.array_split(x, threads)))
            return np.concatenate([s for s, _ in found]), np.concatenate([o for _, o in found])

        while True:
            while more and len(cell) < work.size:
                if (new := next(queue, None)) is None:
                    more = False
                elif len(new):
                    cell, age = np.append(cell, new), np.append(age, np.zeros(len(new), int))
                    begin = np.full((len(new), _LOOKED, last.shape[2]), np.nan)
                    begin[:, -1] = grid.starts(new)
                    last = np.concatenate([last, begin])
            if not len(cell):
                break
            now = slice(0, work.size)
            strobes, outcome = work.timed(block, last[now, -1])
            count = len(strobes)
            work.periods += _BLOCK * count
            last[now] = np.concatenate([last[now, _BLOCK:], strobes], axis=1)
            age[now] += _BLOCK
            found = grid.caught(strobes)
            look = (found == _OPEN) & (age[now] % (2 * _BLOCK) == 0) & (age[now] >= _LOOKED) & (outcome >= 0)
            if look.any():
                which = np.flatnonzero(look)[:256]
                labels = grid.look(last[now][which])
                found[which] = np.where(labels == _OPEN, grid.caught(strobes[which]), labels)
            found[(found == _OPEN) & (age[now] >= _PERIODS)] = UNSETTLED
            found[outcome < Outcome.FINISHED] = FAILED
            ended = found != _OPEN
            grid.put(cell[now][ended], found[ended])
            done += int(ended.sum())
            # Those on their way go behind, so that all get older alike.
            order = np.concatenate([np.arange(count, len(cell)), np.flatnonzero(~ended)])
            cell, age, last = cell[order], age[order], last[order]
            if work.late or done == grid.n**2:
                yield head | _told(grid, work, done), grid.news()
                grid.confirm()
        while grid.confirm():
            yield head | _told(grid, work, done), grid.news()
    yield head | _told(grid, work, done) | {"finished": True}, grid.news()


def _told(grid: Grid, work: _Work, done: int) -> dict[str, Any]:
    counts = np.bincount(grid.label[~grid.guessed] + 3, minlength=3 + len(grid.cycles)).tolist()
    return work.told(done, grid.n**2, counts[2]) | {
        "failed": counts[1], "cycles": [c.told() | {"cells": k} for c, k in zip(grid.cycles, counts[3:])],
    }  # fmt: skip


_OPEN = -3  # a cell whose trajectory is on its way
JOBS = {"diagram": orbit_diagram, "basins": basins, "section": section}
