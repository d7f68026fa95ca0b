"""Maps that grow while one watches: orbit diagram, basins, Poincare section, paths under noise.

Each is a generator of (header, arrays) for the page, in pieces of about 50 ms of work, the first ones spread over the
whole picture: `sweep.refine` and `refine_basins`, told piece by piece, so that a finished map is that of the package.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from ..analysis.maps.sections import poincare_map
from ..analysis.maps.seen import Return, Strobe
from ..codegen.machine.workers import cores
from ..door import checks
from ..noise.diffusion import Diffusion
from ..studies.attraction import orbit_diagram, refine_basins
from ..studies.measures import Points
from ..studies.refining import SweepPlan, make_plan, refine, spread
from .describe import LIMITS
from .labels import written
from .live import Answer, method_of, seen_by, state_of
from .subject import Subject

_SLICE = 0.05  # s between two pieces
_BEGIN = 28  # columns of the first picture of a diagram: they show where it goes, after 30 ms of work
_STROBES = 5000  # of a section
_REPEATS = 1e-9  # relative to 1 + abs(x): so nearly a section's last strobes repeat, where it ends
_COARSEST = 64  # starts that one start stands for at first, along each axis of a basin
_UNKNOWN = -9  # a start that has no label yet
_STARTS = 9000  # columns of a diagram, eighty periods each, that cost as much as basins: 90 000 starts of eight
_PATHS, _INSTANTS = 20, 601  # of the noise; as many kicks are drawn


def _driven(
    subject: Subject, asked: Mapping[str, Any]
) -> tuple[Any, dict[str, float], Strobe | Return, dict[str, Any]]:
    """(system, start, how it is seen, options) of a map."""
    p, x0, _ = state_of(subject, asked)
    options = {
        "atol": [subject.atol.get(s.name, 1e-12) for s in subject.system.states],
        "max_steps": LIMITS["steps"],
        **method_of(subject, asked),
    }
    return subject.system.with_parameters(p), x0, seen_by(subject, asked), options


class _Progress:
    """What has been done, and since when."""

    def __init__(self, of: int, said: str = "") -> None:
        self.done, self.of, self.begun, self.said = 0, of, time.process_time(), said

    def told(self, more: int) -> dict[str, Any]:
        self.done += more
        finished = self.done >= self.of
        rest = "" if finished or not self.said else f" {self.done} of {self.of} columns."
        hint = " Click: orbit there; drag: zoom." if self.said else ""
        cpu = time.process_time() - self.begun
        each = cpu / max(1, self.done)
        minutes = math.ceil(each * (self.of - self.done) / 60)
        return {"done": self.done, "of": self.of, "cpu": cpu, "finished": finished, "said": self.said + rest + hint,
                "long": f"↻ computes all of it, in {minutes} minutes or so. " if cpu > 1 and minutes > 1 else "",
                "basins": _foretold(each * _STARTS)}  # fmt: skip


def _foretold(seconds: float) -> str:
    """How long basins will take; nothing where they are so quick that they begin by themselves."""
    told = f"{seconds / 60:.0f} minutes" if seconds > 90 else "a minute"
    return f"↻ shows which orbit each start leads to, in {told} or so." if seconds > 40 else ""


def _returns(seen: Strobe | Return) -> str:
    """What the points of a map are."""
    if isinstance(seen, Strobe):
        return "Strobes"
    return f"Returns to {written(seen.section)} = 0, {'rising' if seen.direction > 0 else 'falling'}"


def diagram(subject: Subject, asked: Mapping[str, Any]) -> Iterator[Answer]:
    """Strobes over a parameter. `carry`: 0 each from the same start, 1 from left to right, -1 from right to left."""
    system, x0, seen, options = _driven(subject, asked)
    name, (low, high) = str(asked["parameter"]), checks.interval(asked["range"], "`range`")
    count = min(checks.whole(asked.get("columns", 800), "`columns`", 2), LIMITS["columns"])
    keep = min(checks.whole(asked.get("keep", 100), "`keep`", 1), LIMITS["points"])
    values, carry = np.linspace(low, high, count), int(asked.get("carry", 0))
    states = [s.name for s in system.states]
    head = {"kind": "diagram", "parameter": name, "range": [low, high], "columns": count, "names": states,
            "keep": keep}  # fmt: skip
    ways = {
        0: "each from the same start",
        1: "carried on from left to right",
        -1: "carried on from right to left",
    }
    progress = _Progress(count, f"{_returns(seen)}, {ways[int(np.sign(carry))]}.")
    if carry:
        for which, points in _carried(system, name, values, x0, keep, carry, options | {"seen": seen}):
            yield head | progress.told(len(which)), _columns(which, points)
        return
    plan = make_plan(
        system, {name: values.tolist()}, x0=x0, transient=100, periods=keep,
        measures=[Points(*states, last=keep)], seen=seen, **options,
    )  # fmt: skip
    for which, found in _paced(plan):
        points = np.stack([found[f"{state}_points"] for state in states], axis=-1)
        yield head | progress.told(len(which)), _columns(which, points)


def _paced(plan: SweepPlan) -> Iterator[tuple[np.ndarray, dict[str, np.ndarray]]]:
    """`refine`, after a few columns at first; of slow orbits, as the first one shows, fewer at a time."""
    order, workers, begun = spread(plan.shape).tolist(), max(1, cores() - 1), time.perf_counter()
    ((which, found),) = refine(plan, order[:1])
    each = time.perf_counter() - begun
    if 40 * each < 1:
        for part in (order[1:_BEGIN], order[_BEGIN:]):
            for more, values in refine(plan, part, workers=workers):
                yield np.append(which, more), {n: np.concatenate([found[n], v]) for n, v in values.items()}
                which, found = which[:0], {n: v[:0] for n, v in found.items()}
        return
    yield which, found
    size, done = max(1, int(_SLICE / each)), 1
    while done < len(order):
        yield from refine(plan, order[done : done + size])
        done += size


def _carried(
    system: Any, name: str, values: np.ndarray, x0: Mapping[str, float], keep: int, way: int,
    options: Mapping[str, Any],
) -> Iterator[tuple[np.ndarray, np.ndarray]]:  # fmt: skip
    """Columns, each from where its neighbour ended: hysteresis shows where the two ways differ."""
    order, done, size = np.arange(len(values))[::way], 0, 1
    start: Any = dict(x0)
    while done < len(order):
        which, begun = order[done : done + size], time.perf_counter()
        found = orbit_diagram(
            system, name, values[which].tolist(), start, transient=100, keep=keep, carry=True, **options
        )
        done += len(which)
        size = max(1, min(2 * size, int(len(which) * _SLICE / (time.perf_counter() - begun))))
        last = found.points[:, -1][np.isfinite(found.points[:, -1]).all(axis=1)]
        start = dict(zip(found.states, last[-1].tolist())) if len(last) else start
        yield which, found.points


def _columns(which: np.ndarray, points: np.ndarray) -> dict[str, np.ndarray]:
    return {"column": which.astype(np.int32), "points": points, "last": points[:, -1]}


def section(subject: Subject, asked: Mapping[str, Any]) -> Iterator[Answer]:
    """Strobes of the current orbit, ever more of them, until they repeat."""
    system, x0, seen, options = _driven(subject, asked)
    method = {n: v for n, v in options.items() if n == "method"}
    strobe = poincare_map(system, seen, method)
    names = [s.name for s in system.states]
    last, progress, size = np.array([[x0[n] for n in names]]), _Progress(_STROBES), 8
    while True:
        begun = time.perf_counter()
        points = strobe.iterate(last[-1], size + 1)[1:]
        points = points[np.isfinite(points).all(axis=1)]
        told = {"kind": "section", "names": names} | progress.told(len(points))
        tail = points[-32:]
        cycles = (tail[c:] - tail[:-c] for c in range(1, 9) if len(tail) == 32)
        repeats = any(bool((np.abs(off) <= _REPEATS * (1 + np.abs(tail).max(axis=0))).all()) for off in cycles)
        told["finished"] |= repeats or len(points) < size
        what, hint = (
            "returns" if isinstance(seen, Return) else "periods",
            "" if subject.read_only else " Click: start there.",
        )
        yield (
            told | {"repeats": repeats, "said": f"{progress.done} {what}{', repeating' * repeats}.{hint}"},
            {"points": np.concatenate([last, points]) if len(last) == 1 else points},
        )
        if told["finished"]:
            return
        last = points
        size = int(np.clip(size * _SLICE / (time.perf_counter() - begun), 32, 4 * size + 32))


def basins(subject: Subject, asked: Mapping[str, Any]) -> Iterator[Answer]:
    """The attractor that each start of a grid over two states comes to; labels as of the package, 3 added."""
    system, x0, seen, options = _driven(subject, asked)
    axes = [str(n) for n in checks.several(asked["axes"], "`axes`")]
    ranges = [checks.interval(r, "`ranges`") for r in checks.several(asked["ranges"], "`ranges`")]
    if not len(axes) == len(ranges) == len(set(axes)) == 2:
        raise ValueError(
            f"`axes` are {checks.listing(axes)}; a basin is drawn over two states, with two ranges."
        )
    n = min(checks.whole(asked.get("cells", 300), "`cells`", 2), LIMITS["cells"])
    grid = {name: np.linspace(low, high, n).tolist() for name, (low, high) in zip(axes, ranges)}
    rest = {name: value for name, value in x0.items() if name not in axes}
    head = {"kind": "basins", "axes": axes, "ranges": ranges, "cells": n}
    counts, progress, known = np.zeros(256, int), _Progress(n * n), np.full((n, n), _UNKNOWN)
    order = _borders_first(known)
    for which, labels, attractors in refine_basins(system, grid, seen, x0=rest, order=order, **options):
        known.flat[which] = labels
        column, row = which // n, which % n
        lowest = (column | row) & -(column | row)
        counts += np.bincount(labels + 3, minlength=256)[:256]
        told = head | progress.told(len(which)) | {
            "failed": int(counts[1]), "unsettled": int(counts[2]),
            "cycles": [_told(orbit, int(k)) for orbit, k in zip(attractors, counts[3:])],
        }  # fmt: skip
        yield told | {"said": _basins_said(told)}, {
            "cell": (row * n + column).astype(np.int32), "label": (labels + 3).astype(np.uint8),
            "step": np.where(lowest == 0, _COARSEST, np.minimum(lowest, _COARSEST)).astype(np.uint8),
        }  # fmt: skip


def _borders_first(known: np.ndarray) -> Iterator[int]:
    """Starts of a square grid, coarse ones first; those whose surroundings agree, of 5 x 5 coarser ones, last.

    `known` has the labels that were found meanwhile; what is foreseen is written into a copy, and computed later.
    """
    n = len(known)
    step, foreseen, later = _COARSEST, known[::_COARSEST, ::_COARSEST], []
    yield from _scattered(n, np.ones_like(foreseen, bool), step)
    while step > 1:
        coarse = np.where(foreseen == _UNKNOWN, known[::step, ::step], foreseen)
        least, most = (f(coarse, 5, mode="nearest") for f in (minimum_filter, maximum_filter))
        step //= 2
        below = np.arange(len(range(0, n, step))) // 2  # the coarser one that each is beside
        fine = np.ix_(below, below)
        new = np.ones((len(below), len(below)), bool)
        new[::2, ::2] = False
        agree = ((least == most) & (least != _UNKNOWN))[fine] & new
        foreseen = np.where(agree | ~new, coarse[fine], _UNKNOWN)
        later.append((agree, step))
        yield from _scattered(n, new & ~agree, step)
    for agree, step in later:
        yield from _scattered(n, agree, step)


def _scattered(n: int, chosen: np.ndarray, step: int) -> list[int]:
    """Numbers in the whole grid of the chosen places of a coarser one, so that any part of them is all over it."""
    rows, columns = np.nonzero(chosen)
    numbers = rows * step * n + columns * step
    return numbers[spread(numbers.shape)].tolist()


def noise(subject: Subject, asked: Mapping[str, Any]) -> Iterator[Answer]:
    """Paths of the state under its noise, one after the other: the numbers 0, 1, ... of a seed."""
    if subject.noise is None:
        raise ValueError("no noise was given: explore(..., noise=Kicks(...)).")
    p, x0, span = state_of(subject, asked)
    names = [str(n) for n in checks.several(asked.get("names", ()), "`names`")]
    seed = checks.exact_integer(asked.get("seed", 0), "`seed`")
    times, progress = _instants(subject.noise, span), _Progress(_PATHS)
    total = np.zeros((len(names), len(times)))
    for k in range(_PATHS):
        run = subject.scene.solve(
            span, x0, parameters=p, noise=replace(subject.noise, seed=seed, trajectory=k), t_eval=times,
            max_steps=LIMITS["steps"], max_seconds=LIMITS["seconds"] * 10,
        )  # fmt: skip
        values = np.full((len(names), len(times)), np.nan)
        values[:, : len(run.t)] = [run[n] for n in names]
        total += values
        told = {"kind": "noise", "names": names, "seed": seed} | progress.told(1)
        paths = f"{k + 1} paths of {str(subject.noise).partition(', seed')[0]}"
        yield (
            told | {"said": f"{paths}, and their mean; blue: without noise."},
            {"t": times, "values": values, "mean": total / (k + 1)},
        )


def _instants(noise: Any, span: tuple[float, float]) -> np.ndarray:
    """Times at which paths are drawn: even ones, and both sides of kicks, or multiples of a diffusion's step."""
    times = np.linspace(*span, _INSTANTS)
    if isinstance(noise, Diffusion):  # where its path is given
        times = noise.step * np.unique(np.rint(times / noise.step))
    else:
        kicks = noise.every * np.unique(np.rint(times / noise.every))
        beside = (kicks + side * 1e-6 * noise.every for side in (-1, 1))
        times = np.unique(np.concatenate([times, *beside]))
    return times[(times >= span[0]) & (times <= span[1])]


def _told(orbit: Any, cells: int) -> dict[str, Any]:
    return {
        "period": orbit.map.count, "time": float(orbit.period), "x": [float(v) for v in orbit.x], "cells": cells,
        "multipliers": [[float(m.real), float(m.imag)] for m in orbit.multipliers[:4]],
    }  # fmt: skip


def _basins_said(told: Mapping[str, Any]) -> str:
    sizes = [math.hypot(*next(iter(c["multipliers"]), (0.0, 0.0))) for c in told["cycles"]]
    said = [
        f"{k}: period {c['period']}, |multiplier| {size:.3f}"
        for k, (c, size) in enumerate(zip(told["cycles"], sizes), 1)
    ]
    said += [f"{told[what]} {what}" for what in ("unsettled", "failed") if told[what]]
    if not told["finished"]:
        said.append(f"{100 * told['done'] // told['of']} %, paler: foreseen")
    return "; ".join(said)


JOBS = {"diagram": diagram, "basins": basins, "section": section, "noise": noise}
