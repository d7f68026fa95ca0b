"""How diagrams are looked for: the checked arguments of the call, the orbit diagram, and the search that it begins.

    sweep over values and starts  ->  ends  ->  branches through them, and those that begin on these  ->  Diagram

Chain: sweep, searching.py, result.py -> **looking** -> over_two.py, calling.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from ..analysis.continuation.steps import Steps
from ..analysis.equilibria.equilibrium import Equilibrium
from ..analysis.equilibria.finding import equilibria
from ..analysis.maps.scales import Scale, units_at
from ..analysis.maps.sections import Stroboscopic, poincare_map
from ..analysis.maps.seen import Return, Strobe
from ..analysis.maps.symmetry import symmetry_matrix
from ..analysis.orbits.periodic_orbit import PeriodicOrbit
from ..door import checks
from ..results.records import Outcome
from ..studies import Period, Points, Work, sweep
from ..studies.identity import digest
from .plain import Setting, data_of
from .result import Diagram
from .searching import Ends, Search
from .tasks import Tasks

_RTOL, _ATOL = 1e-9, 1e-12  # of the sweep
_LONGER = 10  # transients, of a trajectory that does not repeat after one
SWEEPS = "sweeps"  # folder in a store


@dataclass(frozen=True)
class Looking:
    """How a diagram is looked for, over whatever parameter: checked arguments of `diagram`."""

    setting: Setting
    seen: Strobe | Return | None
    x0: tuple[tuple[float, ...], ...]
    orbits: tuple[dict[str, Any], ...]
    box: Mapping[Any, Any] | None
    values: int
    transient: int
    tol: float
    max_count: int
    max_depth: int
    max_branches: int
    steps: Steps
    options: Mapping[str, Any]

    def identity(self) -> dict[str, str]:
        """What a store must agree with."""
        s, look = self.setting, self.seen
        return {
            "system": digest(s.system), "map": digest([None if s.map is None else [
                str(getattr(s.map, "period", "")), str(getattr(s.map, "surface", "")), getattr(look, "direction", 1)]]),
            "phase": str(getattr(look, "phase", 0.0)), "symmetry": digest(s.symmetry), "virtual": str(s.virtual),
            "x0": str(self.x0), "orbits": digest(list(self.orbits)),
            "box": str(self.box), "sweep": str((self.values, self.transient, self.max_count, self.tol)),
            "bounds": str((self.max_depth, self.max_branches)), "steps": str(self.steps),
            "options": str(dict(self.options)),
        }  # fmt: skip

    # ---- the orbit diagram

    def ends(
        self, name: str, bounds: tuple[float, float], values: Mapping[str, float], store: Path | None
    ) -> Any:
        """Where trajectories end, by a sweep; None without starts."""
        if not self.x0:
            return None
        grid = np.linspace(*bounds, self.values)
        q = np.repeat(grid, len(self.x0))
        first = np.tile(np.array(self.x0), (len(grid), 1))
        folder = (lambda kind: None) if store is None else (lambda kind: store / f"{name}_{kind}.zarr")
        at, cycle, outcome = self._led(name, values, q, first, self.transient, folder("ends"))
        slow = np.flatnonzero((cycle == 0) & (outcome == Outcome.FINISHED))
        if slow.size:  # they are led on
            longer = _LONGER * self.transient
            at[slow], cycle[slow], outcome[slow] = self._led(
                name, values, q[slow], at[slow, -1], longer, folder("slow")
            )
        shape = len(grid), len(self.x0)
        return Ends(
            grid, at.reshape(*shape, *at.shape[1:]), cycle.reshape(shape), outcome.reshape(shape), self.tol
        )

    def _led(
        self,
        name: str,
        values: Mapping[str, float],
        q: np.ndarray,
        first: np.ndarray,
        transient: int,
        store: Any,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The last points of trajectories, after how many they repeat, and how they ended."""
        system = self.setting.system.with_parameters(dict(values))
        states = [s.name for s in system.model.states]
        points: dict[Any, Any] = {name: q.tolist(), **dict(zip(states, first.T.tolist()))}
        kept = 2 * self.max_count
        found = sweep(
            system, points=points, seen=self.seen, transient=transient, periods=2 * kept,
            measures=[Period(self.max_count, self.tol), Points(*states, last=kept)],
            work=Work(progress=False, store=store), **self.options,
        )  # fmt: skip
        at = np.stack([found[f"{s}_points"].values for s in states], axis=-1)
        return at, found["period"].values.copy(), found["outcome"].values.copy()

    # ---- the whole

    def diagram(
        self, name: str, bounds: tuple[float, float], values: Mapping[str, float], work: Tasks, tell: Any,
        sweeps: Path | None,
    ) -> Diagram:  # fmt: skip
        setting = self.setting
        search = Search(
            setting,
            name,
            bounds,
            values,
            self.steps,
            self.max_branches,
            self.max_depth,
            self.max_count,
            work,
            tell,
        )
        for data in self.orbits:
            # Those of another value of what is held are of another line.
            if all(data["parameters"][p] == v for p, v in values.items() if p != name):
                if bounds[0] <= data["parameters"][name] <= bounds[1]:
                    search.tree(search._task(start=data), "given")
        for e in self._at_rest(name, bounds, values):
            task = search.from_orbit(e)
            if not any(
                line.holds(values, task["start"]["parameters"][name], e.x[None], setting)
                for line in search.lines
            ):
                search.tree(task, f"equilibrium at {name} = {task['start']['parameters'][name]:.9g}")
        tell(f"the orbit diagram over {name}: {self.values} values, starts {len(self.x0)}")
        ends = self.ends(name, bounds, values, sweeps)
        explained = np.zeros((0, 0), np.int64)
        if ends is not None:
            search.from_ends(ends)
            explained = np.array(
                [[search.fate(ends, i, j) for j in range(len(self.x0))] for i in range(len(ends.values))]
            )
        states = tuple(s.name for s in setting.system.model.states)
        strobed = "" if setting.map is None else "period" if setting.driven else "return"
        return Diagram(
            name,
            bounds,
            states,
            search.lines,
            ends,
            explained,
            tuple(search.lost),
            search.left,
            strobed,
            setting,
        )

    def _at_rest(
        self, name: str, bounds: tuple[float, float], values: Mapping[str, float]
    ) -> list[Equilibrium]:
        """Equilibria in the box at both ends of the range and in its middle."""
        if self.box is None:
            return []
        found: list[Equilibrium] = []
        for q in (*bounds, 0.5 * sum(bounds)):
            system = self.setting.system.with_parameters({**values, name: q})
            found += [e for e in equilibria(system, self.box) if e.success and e.isolated]
        return found


def looking(
    system: Any,
    x0: Any,
    seen: Strobe | Return | None,
    box: Any,
    virtual: bool,
    options: Mapping[str, Any],
    **how: Any,
) -> Looking:
    """Checked arguments."""
    map_ = None if seen is None else poincare_map(system, seen, options)
    alone = x0 is None or isinstance(x0, (Mapping, PeriodicOrbit, Equilibrium))
    given = ([] if x0 is None else [x0]) if alone else checks.several(x0, "`x0`")
    orbits = [start for start in given if isinstance(start, (PeriodicOrbit, Equilibrium))]
    starts = [start for start in given if not isinstance(start, (PeriodicOrbit, Equilibrium))]
    if starts and map_ is None:
        raise ValueError(
            "`x0` has states, at which trajectories begin: give `seen` too, Strobe(period) of a driven system or "
            "Return(section)."
        )
    rows = tuple(tuple(map(float, system.initial_state(checks.mapping(s, "`x0`")))) for s in starts)
    G = None
    if isinstance(seen, Strobe) and seen.symmetry is not None:
        G = symmetry_matrix(system, seen.symmetry, cast(Stroboscopic, map_).forcing_period)
    unit = _units(system, [*rows, *(orbit.x for orbit in orbits)], box)
    if map_ is not None and unit:
        map_ = replace(map_, scale=Scale(unit, unit))
    setting = Setting(system, map_, G, virtual, unit)
    kept = []
    for orbit in orbits:
        if not orbit.success:
            raise ValueError(f"`x0` contains {checks.shown(orbit)}, which did not converge; leave it out.")
        if isinstance(orbit, PeriodicOrbit) and map_ is None:
            raise ValueError("`x0` contains a periodic orbit; say by `seen` how it is seen, Strobe or Return.")
        if {p.name for p in orbit.system.parameters} != {p.name for p in system.parameters}:
            raise ValueError("`x0` contains an orbit of another system; give orbits of `system`.")
        kept.append(data_of(orbit, setting))
    if not (given or box):
        raise ValueError(
            "nothing to begin with: give `x0`, states, orbits or equilibria, or a `box` of equilibria."
        )
    tolerances = {"rtol": _RTOL, "atol": [_ATOL * u for u in unit] if unit else _ATOL, **options}
    return Looking(setting, seen, rows, tuple(kept), box, options=tolerances, **how)


def _units(system: Any, rows: Sequence[Any], box: Any) -> tuple[float, ...]:
    """Sizes of the states, of which the box, starts and orbits tell; empty where all are 1."""
    names = [str(s) for s in system.model.states]
    sizes = np.zeros(len(names))
    for row in rows:
        sizes = np.maximum(sizes, np.abs(row))
    for key, pair in (box or {}).items():
        name = str(getattr(key, "name", key))
        if name in names:
            k = names.index(name)
            sizes[k] = max(sizes[k], *np.abs(checks.pair(pair, f"`box` of {name}")))
    unit = tuple(units_at(sizes).tolist())
    return unit if set(unit) != {1.0} else ()
