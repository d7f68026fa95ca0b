"""From starts to all branches: attractors, the branches through them, the branches that begin on these, and so on.

    for every end of the orbit diagram that no branch explains yet:
        its orbit by Newton's method -> its branch -> one more from every flip, symmetry breaking, branch and Hopf point

Branches are taken in one order, whoever follows them: processes work ahead on what comes next as it looks now, and what
turns out to be known already is not used.

Chain: tracing.py, line.py, work.py -> **searching** -> looking.py.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ..analysis.continuation.steps import Steps
from ..analysis.maps.sections import Stroboscopic
from ..analysis.orbits.finding import refine
from ..results.records import Outcome
from ..studies.plan import NO_RETURN
from .line import Line, same_points
from .plain import Setting, data_of, distance, found_at, points_of
from .tasks import Task, Tasks
from .tracing import SWITCHED

_AMPLITUDES = (1e-2, 1e-3, 1e-4, 1e-5)  # relative to unit + |x|, tried in this order
_SAME_PARAMETER = 1e-7  # of the range: bifurcations nearer together, of one orbit and one kind, are one
NOWHERE, IN_A_SET = -1, -2  # instead of the number of a branch
_VERTEX = 1e-2  # relative to unit + |x|, and its square of the range: within it a fold is a pitchfork's vertex
_SLOW = 100  # times the tolerance of the sweep: an end that is still on its way to the orbit beside it


@dataclass
class Ends:
    """Where trajectories end: one for every value of the parameter and every start.

    `points` (values, starts, kept, n), `cycle` (values, starts) after how many points they repeat, 0 for none;
    `outcome` likewise, as of `sweep`.
    """

    values: np.ndarray
    points: np.ndarray
    cycle: np.ndarray
    outcome: np.ndarray
    tol: float

    def order(self) -> list[tuple[int, int]]:
        """Neighbours, which as a rule are on one branch, far apart."""
        count, starts = self.cycle.shape
        bits = max(1, (count - 1).bit_length())
        turned = sorted(range(count), key=lambda k: int(format(k, f"0{bits}b")[::-1], 2))
        return [(i, j) for i in turned for j in range(starts)]


@dataclass
class Search:
    """What is looked for, and what was found: `lines`, and in `lost` why nothing was found at places."""

    setting: Setting
    name: str
    bounds: tuple[float, float]
    values: Mapping[str, float]  # of all parameters
    steps: Steps
    max_branches: int
    max_depth: int
    max_count: int  # periods or returns of an orbit
    work: Tasks
    tell: Callable[[str], None] = lambda words: None
    lines: list[Line] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    left: int = 0  # branches that were not followed, for the bounds
    seen: list[dict[str, Any]] = field(default_factory=list, repr=False)

    # ---- tasks

    def from_orbit(self, orbit: Any) -> Task:
        return self._task(start=data_of(orbit, self.setting))

    def _task(self, **what: Any) -> Task:
        return {
            "parameter": self.name, "range": list(self.bounds), "steps": asdict(self.steps),
            "virtual": self.setting.virtual, **what,
        }  # fmt: skip

    def _children(self, line: Line) -> Iterator[tuple[str, int, Task, Any]]:
        """Where other branches begin on a branch, at bifurcations that no branch before it has."""
        for b in line.located:
            b["first"] = self._new(b) and not (b["kind"] == "fold" and self._vertex(line, b))
            origin = f"{b['kind']} at {self.name} = {b['parameter']:.9g}"
            if b["first"] and b["point"].get("count", line.count) < line.count:
                yield f"stem of the {origin}", line.depth + 1, self._task(start=b["point"]), None
            elif b["first"] and b["kind"] == "flip" and 2 * line.count > self.max_count:
                self.left += 1
            elif b["first"] and (b["kind"] in SWITCHED or b.get("cycle") == "attracting"):
                for sign in (1, -1) if b["kind"] == "branch point" else (1,):
                    amplitudes = [sign * a for a in _AMPLITUDES]
                    root = b if b["kind"] == "branch point" else None
                    yield origin, line.depth + 1, self._task(off=bare(b), amplitudes=amplitudes), root

    def _vertex(self, line: Line, b: dict[str, Any]) -> bool:
        """Whether a fold is where a branch comes through the branch point at which it began: a pitchfork's vertex."""
        if line.root is None:
            return False
        near = abs(line.root["parameter"] - b["parameter"]) <= _VERTEX**2 * (self.bounds[1] - self.bounds[0])
        return near and distance(np.asarray(line.root["points"]), b["points"], self.setting) <= _VERTEX

    def _new(self, b: dict[str, Any]) -> bool:
        """Whether a bifurcation is none of those known; it is known then. It gets its points once a period."""
        low, high = self.bounds
        for other in self.seen:
            near = abs(other["parameter"] - b["parameter"]) <= _SAME_PARAMETER * (high - low) + b["uncertainty"]
            if near and other["kind"] == b["kind"] and _meet(other["points"], b["points"], self.setting):
                return False
            if near and other["kind"] == b["kind"] and _meet(other.get("mirrored"), b["points"], self.setting):
                return False
        self.seen.append(b)
        return True

    # ---- branches

    def tree(self, first: Task, origin: str, upcoming: Iterable[Task] = ()) -> None:
        """The branch of a task and those that begin on it, recursively."""
        queue, more = deque[tuple[str, int, Task, Any]]([(origin, 0, first, None)]), iter(upcoming)
        while queue:
            if len(self.lines) >= self.max_branches:
                self.left += len(queue)
                return
            ahead = self.work.workers.ahead
            coming = [task for _, _, task, _ in itertools.islice(queue, ahead)]
            self.work.ask([*coming, *itertools.islice(more, max(0, ahead - len(coming)))])
            origin, depth, task, root = queue.popleft()
            if depth > self.max_depth:
                self.left += 1
                continue
            waiting = f", {len(queue)} waiting" if queue else ""
            self.tell(f"branch {len(self.lines) + 1} over {self.name}, from {origin}{waiting}")
            item = self.work.result(task)
            line = self._kept(item, origin, depth, root)
            if line is not None:
                queue += self._children(line)

    def _kept(self, item: dict[str, Any], origin: str, depth: int, root: Any) -> Line | None:
        """The branch, if there is one that is not known."""
        if item["about"]["lost"]:
            self.lost.append(f"{origin}: {item['about']['lost']}")
            return None
        line = Line(item["arrays"], item["about"], origin, depth, root)
        place = {-1: None, **{int(n): k for k, n in enumerate(line.arrays["located"])}}
        for number, b in enumerate(line.located):
            k = place[number]
            b["points"] = line.arrays["points"][k]
            b["mirrored"] = line.arrays["mirrored"][k] if "mirrored" in line.arrays else None
        if len(line.values) < 2 or self._known(line):
            return None
        self.lines.append(line)
        return line

    def _known(self, line: Line) -> bool:
        """Whether a branch is one that was followed already: both of two orbits of it lie on that one."""
        inside = np.flatnonzero(line.arrays["located"] < 0)
        if inside.size == 0:
            return False
        some = inside[[len(inside) // 3, (2 * len(inside)) // 3]]
        return any(
            all(
                known.holds(self.values, float(line.values[k]), line.arrays["points"][k], self.setting)
                for k in some.tolist()
            )
            for known in self.lines
        )

    # ---- attractors

    def explained(self, ends: Ends, i: int, j: int, exact: np.ndarray | None = None) -> int:
        """The number of the branch on which an end lies; `NOWHERE` for none."""
        q, cycle = float(ends.values[i]), int(ends.cycle[i, j])
        if ends.outcome[i, j] == NO_RETURN:
            at_rest = (k for k, line in enumerate(self.lines) if line.of_equilibria)
            return next((k for k in at_rest if any(a <= q <= b for a, b in self.lines[k].covered())), NOWHERE)
        if cycle <= 0:
            return NOWHERE
        points = ends.points[i, j, -cycle:] if exact is None else exact
        for k, line in enumerate(self.lines):
            if line.holds(self.values, q, points, self.setting):
                return k
        return NOWHERE

    def fate(self, ends: Ends, i: int, j: int) -> int:
        """The same of an end that is still on its way, too; `IN_A_SET` of one at an orbit that is not isolated."""
        known = self.explained(ends, i, j)
        if known >= 0 or (orbit := self.orbit_at(ends, i, j)) is None:
            return known
        known = self.explained(ends, i, j, points_of(orbit, self.setting)[0])
        return IN_A_SET if known < 0 and not orbit.isolated else known

    def orbit_at(self, ends: Ends, i: int, j: int) -> Any:
        """The orbit at an end, by Newton's method; None where there is none beside it."""
        cycle = int(ends.cycle[i, j])
        if cycle <= 0 or ends.outcome[i, j] != Outcome.FINISHED or self.setting.map is None:
            return None
        points = ends.points[i, j, -cycle:]
        values = {**self.values, self.name: float(ends.values[i])}
        orbit = found_at(self.setting, values, points)
        slack = _SLOW * ends.tol * (self.setting.sizes + np.abs(points[0]))
        if orbit is None or np.any(np.abs(orbit.x - points[0]) > slack):
            return None
        return self.symmetrical(orbit)

    def symmetrical(self, orbit: Any) -> Any:
        """The same orbit as one of the half-period map, if it is its own mirror image."""
        if self.setting.symmetry is None or not isinstance(orbit.map, Stroboscopic) or orbit.map.count != 1:
            return orbit
        if orbit.symmetric:
            return orbit
        half = refine(replace(orbit.map, symmetry=self.setting.symmetry), orbit.x)
        return half if half.success and same_points(half.x[None], orbit.x[None], self.setting) else orbit

    def from_ends(self, ends: Ends) -> None:
        """Branches through all ends that are on none."""
        order = ends.order()
        exact: dict[tuple[int, int], Any] = {}

        def seed(i: int, j: int) -> Task | None:
            if self.explained(ends, i, j) >= 0:
                return None
            if (i, j) not in exact:
                exact[i, j] = self.orbit_at(ends, i, j)
            orbit = exact[i, j]
            if (
                orbit is None
                or not orbit.isolated
                or self.explained(ends, i, j, points_of(orbit, self.setting)[0]) >= 0
            ):
                return None
            return self.from_orbit(orbit)

        for number, (i, j) in enumerate(order):
            if len(self.lines) >= self.max_branches:
                return
            task = seed(i, j)
            if task is not None:
                rest = (later for at in order[number + 1 :] if (later := seed(*at)) is not None)
                self.tree(task, f"attractor at {self.name} = {ends.values[i]:.9g}", rest)


def bare(b: dict[str, Any]) -> dict[str, Any]:
    """A bifurcation's data as the branch's task gave them."""
    return {key: value for key, value in b.items() if key not in ("points", "mirrored", "first")}


def _meet(a: np.ndarray | None, b: np.ndarray | None, setting: Setting) -> bool:
    """Whether two cycles are one, be it run through several times."""
    if a is None or b is None or np.isnan(a).all() or np.isnan(b).all():
        return False
    short, long = sorted((a, b), key=len)
    if len(long) % len(short):
        return False
    return same_points(np.tile(short, (len(long) // len(short), 1)), long, setting)
