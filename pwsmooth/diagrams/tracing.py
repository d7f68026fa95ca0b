"""One branch from one start: both ways, around its folds, to the ends of the range. A task and its result are data.

    start  ->  follow to either end of the range, around folds  ->  parameter, points once a period, stability and
    specials, in order along the branch

Chain: plain.py -> **tracing** -> line.py, one_parameter.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..analysis.continuation.bifurcations import ON_CIRCLE
from ..analysis.continuation.branch import branch_of
from ..analysis.continuation.branches import begin_orbits, branch_off
from ..analysis.continuation.equilibria.hopf import cycle_from
from ..analysis.continuation.equilibria.sliding_cycle import cycle_beside
from ..analysis.continuation.following import follow
from ..analysis.continuation.orbit_problem import in_units, value_of
from ..analysis.continuation.steps import Steps
from ..analysis.continuation.way import CLOSED, How, Way
from ..analysis.equilibria.equilibrium import Equilibrium
from ..analysis.orbits.periodic_orbit import PeriodicOrbit
from ..paths.budget import Budget, within
from .plain import (
    Setting,
    aligned,
    data_of_special,
    distance,
    found_at,
    point_of,
    points_of,
    special_of,
    values_of,
)

SWITCHED = ("flip", "symmetry breaking", "branch point", "Hopf", "sliding Hopf")  # where other branches begin
_COUNTED = 2**62
USUAL = 0.005, 0.03, 1e-7  # first, longest and shortest step in the arc of a diagram's branches
_STEPS = 1000  # of solve() for each of the points that a branch may have: long orbits have fewer points
_SHRUNK = 0.1  # of its first size: a cycle so small, followed back to its Hopf point, has come to its beginning
_NEAR = 0.02  # of the range: a branch that begins at a bifurcation begins so near to it
_SAME = 1e-5  # relative to unit + |x|: an orbit that is back at the branch's start
MEETS, SHRINKS = "meets its mirror image", "shrinks onto the equilibrium"
UNDECIDED = -1  # stability at a bifurcation: that of the way to it counts


class _Entry:
    """A point of a branch: an orbit, or a bifurcation (its number) with the orbit there."""

    def __init__(self, orbit: Any, setting: Setting, name: str, number: int = -1) -> None:
        self.orbit, self.number = orbit, number
        self.q, self.setting = value_of(orbit, name), setting
        self.points, self.mirrored = points_of(orbit, setting)
        self.decided = number < 0 and _decided(orbit)

    @property
    def skew(self) -> np.ndarray | None:
        """How far it is from its mirror image, at every point; None of its own mirror image, and without a symmetry."""
        if self.mirrored is None:
            return None
        return self.points - np.roll(self.mirrored, aligned(self.mirrored, self.points), axis=0)

    def shifted(self, before: _Entry) -> _Entry:
        """With the points in the order of those of the entry before; one that is run through several times."""
        times = len(before.points) // max(len(self.points), 1)
        if times > 1 and times * len(self.points) == len(before.points):
            self.points = np.tile(self.points, (times, 1))
            self.mirrored = None if self.mirrored is None else np.tile(self.mirrored, (times, 1))
        k = aligned(self.points, before.points)
        self.points = np.roll(self.points, k, axis=0)
        self.mirrored = None if self.mirrored is None else np.roll(self.mirrored, k, axis=0)
        return self


def _decided(orbit: Any) -> bool:
    """Whether multipliers, or an equilibrium's mode, tell the stability: at a bifurcation they do not."""
    if isinstance(orbit, Equilibrium):
        return orbit.stability != "undecided"
    return not np.any(np.abs(np.abs(orbit.multipliers) - 1) < ON_CIRCLE)


def begun(setting: Setting, task: Mapping[str, Any]) -> Any:
    """The first orbit of a task: as given, or on the branch that begins at a bifurcation."""
    if "off" not in task:
        return point_of(task["start"], setting)
    bifurcation = special_of(task["off"], setting)
    still = isinstance(bifurcation.point, Equilibrium)
    size = float((setting.sizes + np.abs(bifurcation.point.x)).max())
    low, high = task["range"]
    found = None
    for amplitude in task["amplitudes"]:
        if bifurcation.cycle:
            found = cycle_beside(bifurcation, abs(amplitude) * (high - low))
            found = _on_section(found, setting) if found.success else found
        elif still:
            found = cycle_from(bifurcation, abs(amplitude) * size)
            found = _on_section(found, setting) if found.success else found
        else:
            found = branch_off(bifurcation, amplitude * size)
        if not found.success:
            continue
        q = value_of(found, task["parameter"])
        if low <= q <= high and abs(q - bifurcation.parameter) <= _NEAR * (high - low):
            return found
        words = f"what was found is at {task['parameter']} = {q:.9g}, too far off."
        found = replace(found, success=False, message=words)
    return found


def _on_section(cycle: Any, setting: Setting) -> Any:
    """A cycle by its returns to the section that was asked for, if it has one return there."""
    if setting.map is None:
        return cycle
    times = np.linspace(0, cycle.period, 33)
    run = cycle.map._over(cycle.x, cycle.period, times=times)
    values = values_of(cycle.system)
    map_ = setting.at(values)
    for x in run.x.T[::8]:
        image = map_.image(x)
        if image.success and (other := found_at(setting, values, image.x[None])) is not None:
            if abs(other.period - cycle.period) <= 1e-6 * cycle.period:
                return other
    return cycle


def traced(setting: Setting, task: Mapping[str, Any]) -> dict[str, Any]:
    """The branch of a task: {"arrays": ..., "about": ...}; only "about" with "lost" in words where nothing begins."""
    try:
        return _traced(setting, task)
    except (ArithmeticError, np.linalg.LinAlgError, ValueError) as error:  # one branch costs no other
        return {"arrays": {}, "about": {"lost": f"{type(error).__name__}: {error}"}}


def _traced(setting: Setting, task: Mapping[str, Any]) -> dict[str, Any]:
    name, (low, high) = task["parameter"], task["range"]
    orbit = begun(setting, task)
    if not orbit.success:
        return {"arrays": {}, "about": {"lost": orbit.message}}
    if not isinstance(orbit, Equilibrium):
        orbit = in_units(orbit, setting.sizes)
    steps, specials = Steps(**task.get("steps", {})), list[dict[str, Any]]()
    born = None
    if task.get("off", {}).get("point", {}).get("equilibrium"):
        born = _Entry(special_of(task["off"], setting).point, setting, name)
        born.decided = False
    ends: list[str] = []
    sides: list[list[_Entry]] = []
    for to in (low, high):
        if sides and ends[0] == CLOSED:
            break
        entries, end = _one_way(setting, orbit, name, to, (low, high), steps, specials, born)
        sides.append(entries)
        ends.append(end)
    entries = sides[0][::-1] + (sides[1][1:] if len(sides) > 1 else [])
    for before, entry in zip(entries, entries[1:]):
        entry.shifted(before)
    entries = _with_middles(entries, setting, name)
    order = [entry.number for entry in entries if entry.number >= 0]
    ranks = {number: rank for rank, number in enumerate(order)}
    about = {
        "lost": "", "parameters": [name], "kind": "", "equilibria": isinstance(orbit, Equilibrium),
        "symmetric": bool(getattr(orbit, "symmetric", False)), "ends": ends,
        "specials": [specials[number] for number in order],
    }  # fmt: skip
    return {"arrays": _arrays(entries, ranks), "about": about}


def _one_way(
    setting, orbit, name, to, bounds, steps, specials, born
) -> tuple[list[_Entry], str]:  # fmt: skip
    """Entries from the start on, and why they end."""
    q = value_of(orbit, name)
    if abs(q - to) <= 1e-12 * (abs(to) + bounds[1] - bounds[0]):  # but for a rounding in the arc
        return [_Entry(orbit, setting, name)], f"began at {name} = {q:.10g}."
    if isinstance(orbit, Equilibrium):
        way = 1 if to == bounds[1] else -1
        branch = follow(orbit, {name: bounds}, way=way, virtual=setting.virtual, steps=steps)
        return _entries_of(
            branch, [_Entry(e, setting, name) for e in branch.points], setting, name, specials
        ), branch.end
    entries = [_Entry(orbit, setting, name)]
    told: list[str] = []
    size = _size(orbit) if born is not None else 0.0
    budget = Budget(_COUNTED)

    def stops(way: Way) -> str:
        if _COUNTED - budget.left > _STEPS * steps.max_points:
            told.append(
                f"steps are used up at {way.problem.where(way.points[-1])}: give `steps` more `max_points`."
            )
        for new in way.points[len(entries) :]:
            entries.append(_Entry(new.orbit, setting, name).shifted(entries[-1]))
            told.extend(_over(entries, name))
            if born is not None and _size(new.orbit) < _SHRUNK * size:
                told.append(f"{SHRINKS} at {name} = {entries[-1].q:.10g}.")
        return told[0] if told else ""

    sign, how = 1.0 if to == bounds[1] else -1.0, How(steps._lengths(*USUAL), steps.max_points, stops)
    with within(budget):
        way, *first = begin_orbits(orbit, name, bounds, sign, how)
        way.follow(*first)
    stops(way)
    branch, end = branch_of(way, (way.end,), (name,)), way.end
    if CLOSED in (way.end, *told[:1]):
        entries[-1] = entries[0]
        return _entries_of(branch, entries, setting, name, specials), CLOSED
    if told and told[0].startswith(SHRINKS) and born is not None:
        entries.append(born)
    placed = _entries_of(branch, entries, setting, name, specials)
    if told and told[0].startswith(MEETS) and placed[-1] is entries[-1]:
        # What is past the mirror image is its own; a fold or branch point there is the symmetric branch's.
        placed.pop()
        if placed[-1].number >= 0:
            placed[-1].number = -1
    return placed, told[0] if told else end


def _size(orbit: Any) -> float:
    """The largest extent of an orbit in a state."""
    return float(max(np.ptp(run.x, axis=1).max() for run in orbit.runs()))


def _over(entries: list[_Entry], name: str) -> list[str]:
    """Why nothing new comes after the last entry, in words: the branch closes, or goes on as its mirror image."""
    first, a, b = entries[0], *entries[-2:]
    one, other = a.skew, b.skew
    if one is not None and other is not None and one.shape == other.shape:
        size = np.abs(other / (b.setting.sizes + np.abs(b.points))).max()
        if size <= _SAME or float((one * other).sum()) < 0:
            return [f"{MEETS} at {name} = {a.q:.10g}, where a symmetric orbit is."]
    if len(entries) > 3 and a.points.shape == b.points.shape == first.points.shape:
        chord = distance(a.points, b.points, a.setting)
        if (a.q - first.q) * (b.q - first.q) <= 0 and a.q != b.q:
            part = (first.q - a.q) / (b.q - a.q)
            between = a.points + part * (b.points - a.points)
            if distance(between, first.points, a.setting) <= 0.1 * chord + _SAME:
                return [CLOSED]
    return []


def _entries_of(
    branch: Any, entries: list[_Entry], setting: Setting, name: str, specials: list[dict[str, Any]]
) -> list[_Entry]:
    """Orbits of a branch with its specials between them."""
    entries = list(entries)
    placed: list[tuple[int, list[_Entry]]] = []
    for place, b in zip(branch.places, branch.specials):
        these = [_Entry(b.point, setting, name, len(specials))]
        specials.append(data_of_special(b, setting))
        if isinstance(b.beyond, PeriodicOrbit):
            these.append(_Entry(b.beyond, setting, name))
        placed.append((place - 1, these))
    for where, these in reversed(placed):
        entries[where + 1 : where + 1] = these
    for before, entry in zip(entries, entries[1:]):
        entry.shifted(before)
    return entries


def _with_middles(entries: list[_Entry], setting: Setting, name: str) -> list[_Entry]:
    """With an orbit between two specials that have none between them: it says whether the way is stable."""
    found = entries[:1]
    for before, entry in zip(entries, entries[1:]):
        if (
            before.number >= 0
            and entry.number >= 0
            and not isinstance(entry.orbit, Equilibrium)
            and setting.map
        ):
            values = {**values_of(entry.orbit.system), name: 0.5 * (before.q + entry.q)}
            if before.q != entry.q and before.points.shape == entry.points.shape:
                middle = found_at(setting, values, 0.5 * (before.points + entry.points))
                if middle is not None:
                    found.append(_Entry(middle, setting, name).shifted(before))
        found.append(entry)
    return found


def _arrays(entries: list[_Entry], ranks: Mapping[int, int]) -> dict[str, np.ndarray]:
    count = max(len(entry.points) for entry in entries)
    n = entries[0].points.shape[1]
    points, mirrored = (np.full((len(entries), count, n), np.nan) for _ in range(2))
    sizes = []
    for k, entry in enumerate(entries):
        points[k, : len(entry.points)] = entry.points
        if entry.mirrored is not None:
            mirrored[k, : len(entry.mirrored)] = entry.mirrored
        orbit = entry.orbit
        rates = orbit.eigenvalues.real if isinstance(orbit, Equilibrium) else np.abs(orbit.multipliers)
        sizes.append(float(rates.max(initial=-np.inf)))
    arrays = {
        "values": np.array([entry.q for entry in entries]),
        "points": points,
        "stable": np.array([int(e.orbit.stable) if e.decided else UNDECIDED for e in entries], np.int8),
        "admissible": np.array([not getattr(e.orbit, "virtual", "") for e in entries]),
        "size": np.array(sizes),
        "period": np.array([getattr(e.orbit, "period", np.nan) for e in entries], float),
        "located": np.array([ranks.get(e.number, -1) for e in entries], np.int32),
    }
    return arrays if np.isnan(mirrored).all() else arrays | {"mirrored": mirrored}
