"""Orbits, equilibria and bifurcations as plain data, and back: what tasks take and give, and what a store keeps.

    data  ->  the map at the parameters, its image of x  ->  the same orbit

Floats keep their bits in JSON; an orbit made from data is the one that the data were taken from, in any process. So a
branch is the same whoever follows it, and nothing of a store is code.

Chain: analysis -> **plain** -> tracing.py, growing.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
import sympy as sp

from ..analysis.continuation.special import Special
from ..analysis.equilibria.equilibrium import Equilibrium
from ..analysis.equilibria.finding import find_equilibrium
from ..analysis.maps.sections import Section, Stroboscopic
from ..analysis.maps.segments import Shooting
from ..analysis.orbits.finding import refine
from ..analysis.orbits.fixed_points import orbit_of, relative
from ..analysis.orbits.itineraries import Change, Letter
from ..analysis.orbits.periodic_orbit import PeriodicOrbit
from ..door import checks

SHRUNK = "continued"


@dataclass(frozen=True)
class Setting:
    """What all orbits of a diagram are orbits of: the map of one period (return), and the symmetry if there is one."""

    system: Any
    map: Any  # Stroboscopic or Section of count 1; None where equilibria are looked for, and their cycles
    symmetry: Any = None  # (n, n), or None
    virtual: bool = False
    unit: tuple[float, ...] = ()  # sizes of the states; empty where all are 1

    @property
    def sizes(self) -> np.ndarray:
        """Sizes of the states against which orbits are compared, shape (n,)."""
        return np.array(self.unit or (1.0,) * len(self.system.model.states))

    @property
    def driven(self) -> bool:
        return isinstance(self.map, Stroboscopic)

    def at(self, values: Mapping[str, float]) -> Any:
        """The map of one period at other parameter values."""
        return self.map.with_parameters(dict(values))


def values_of(system: Any) -> dict[str, float]:
    return {p.name: float(value) for p, value in system.parameters.items()}


def data_of(point: PeriodicOrbit | Equilibrium, setting: Setting) -> dict[str, Any]:
    """An orbit or an equilibrium as data."""
    if isinstance(point, Equilibrium):
        return {
            "equilibrium": True, "parameters": values_of(point.system), "x": point.x.tolist(),
            "mult": point.mult.tolist(), "sides": list(point.sides), "unit": point.unit.tolist(),
        }  # fmt: skip
    map_: Any = point.map
    data: dict[str, Any] = {
        "parameters": values_of(point.system), "x": point.x.tolist(), "count": map_.count,
    }  # fmt: skip
    if isinstance(map_, Stroboscopic):
        parts = sp.nsimplify(setting.map.period / map_.period, rational=True) if setting.driven else 1
        data |= {"phase": map_.phase, "symmetric": map_.symmetry is not None, "parts": int(parts)}
    elif setting.map is None or map_.surface != setting.map.surface or map_.direction != setting.map.direction:
        data |= {"surface": str(map_.surface), "direction": map_.direction}
    if point.segments is not None:
        s = point.segments
        data |= {"cuts": [list(c) for c in s.cuts], "nodes": s.nodes.tolist(), "kept": list(map(bool, s.kept))}
    return data


def point_of(data: Mapping[str, Any], setting: Setting) -> Any:
    """The orbit or the equilibrium of data; without success where it is none."""
    if data.get("equilibrium"):
        system = setting.system.with_parameters(data["parameters"])
        start = dict(zip(map(str, system.states), data["x"]))
        names = [str(mu.symbol) for mu in system.model.multipliers]
        start |= dict(zip(names, data["mult"]))
        e = find_equilibrium(system, start, sides=dict(zip(names, data["sides"])) or None, virtual=True)
        return replace(e, _unit=tuple(data["unit"]))
    map_ = map_of(data, setting)
    x = np.array(data["x"])
    if "cuts" in data:
        shooting = Shooting(map_, tuple(map(tuple, data["cuts"])))
        X = np.array(data["nodes"]).ravel()
        image = shooting.image(X, ())
        size = relative(shooting, image.x - X, X, image)
        return orbit_of(shooting, X, image, size, 0, image.success, SHRUNK, tuple(data["kept"]))
    image = map_.image(x, ())
    return orbit_of(map_, x, image, relative(map_, image.x - x, x, image), 0, image.success, SHRUNK)


def map_of(data: Mapping[str, Any], setting: Setting) -> Any:
    """The map of an orbit's data."""
    if "surface" in data:
        system = setting.system.with_parameters(data["parameters"])
        surface = checks.expression(
            data["surface"], "`surface`", {s.name: s for s in (*system.model.states, *system.parameters)}
        )
        options = {} if setting.map is None else setting.map.options
        return Section(
            system, surface=surface, direction=data["direction"], count=data["count"], options=options
        )
    map_ = replace(setting.map, count=data["count"])
    if setting.driven:
        map_ = replace(map_, phase=data["phase"], period=map_.period / data["parts"])
        map_ = replace(map_, symmetry=setting.symmetry if data["symmetric"] else None)
    return map_.with_parameters(data["parameters"])


# ---- special points


def _letters(letters: Any) -> list[list[Any]]:
    return [[x.time, x.switch, x.kind, x.before, x.after] for x in letters]


def data_of_special(b: Special, setting: Setting) -> dict[str, Any]:
    """A special point of a branch as data."""
    ((name, at),) = b.values.items()
    data: dict[str, Any] = {
        "kind": b.kind, "name": name, "parameter": at, "uncertainty": b.uncertainty, "text": str(b), "note": b.note,
        "point": data_of(b.point, setting), "frequency": b.frequency if math.isfinite(b.frequency) else None,
        "lyapunov": b.lyapunov, "cycle": b.cycle,
    }  # fmt: skip
    if b.change is not None:
        data["change"] = [b.change.name, _letters(b.change.before), _letters(b.change.after), b.change.time]
    if isinstance(b.beyond, PeriodicOrbit):
        data["beyond"] = data_of(b.beyond, setting)
    if b.saddles:
        data["saddles"] = [data_of(e, setting) for e in b.saddles]
    return data


def special_of(data: Mapping[str, Any], setting: Setting | None) -> Special:
    """The special point of data; without a setting also without its orbit."""
    change = None
    if "change" in data:
        name, before, after, time = data["change"]
        gone, come = (tuple(Letter(*x) for x in part) for part in (before, after))
        change = Change(name, gone, come, time)

    def point(one: Mapping[str, Any] | None) -> Any:
        return None if one is None or setting is None else point_of(one, setting)

    return Special(
        data["kind"], {data["name"]: data["parameter"]}, point(data["point"]), data["uncertainty"],
        point(data.get("beyond")), data["note"], change,
        () if setting is None else tuple(point_of(e, setting) for e in data.get("saddles", ())),
        math.nan if data["frequency"] is None else data["frequency"], data["lyapunov"], data["cycle"],
    )  # fmt: skip


# ---- where an orbit is, whatever section it was found on


def points_of(orbit: Any, setting: Setting) -> tuple[np.ndarray, np.ndarray | None]:
    """Its points once a period at the setting's phase, or its returns, (count, n); the same of its mirror image.

    Of an equilibrium its state. The second is None for orbits that are their own mirror image, and without a symmetry.
    """
    if isinstance(orbit, Equilibrium):
        return orbit.x[None], None
    map_ = orbit.map
    if not (setting.driven and isinstance(map_, Stroboscopic)):
        return np.array([orbit.x, *(orbit.after(k) for k in range(1, map_.count))]), None
    base = setting.at(values_of(orbit.system))
    T = base.forcing_period
    periods = Fraction(orbit.period / T).limit_denominator(1000)
    lead = ((base.phase * T - map_.start_time) / T) % 1.0
    lead = 0.0 if lead > 1 - 1e-12 else lead
    steps = np.arange(max(1, periods.numerator))
    whole = _sampled(orbit, (lead + steps) * T)
    if setting.symmetry is None or orbit.symmetric:
        return whole, None
    half = _sampled(orbit, (lead + 0.5 + steps) * T)
    return whole, half @ np.linalg.inv(setting.symmetry).T


def _sampled(orbit: PeriodicOrbit, times: np.ndarray) -> np.ndarray:
    """States at times after the section, (number, n)."""
    map_: Any = orbit.map
    first = map_.start_time
    times = times % orbit.period
    if orbit.segments is None:
        order = np.argsort(times, kind="stable")
        wanted = np.unique(first + times[order])
        run = map_._over(orbit.x, max(float(times.max()), 1e-9 * orbit.period), times=wanted)
        columns = np.searchsorted(run.t, first + times).clip(max=run.x.shape[1] - 1)
        found = run.x[:, columns].T
    else:
        runs = orbit.runs(dense_output=True)
        ends = np.array([run.t[-1] for run in runs])
        found = np.array(
            [runs[min(int(np.searchsorted(ends, first + t)), len(runs) - 1)].dense(np.array([first + t]))[0][:, 0]
             for t in times]
        )  # fmt: skip
    found[times == 0] = orbit.x
    return found


def found_at(setting: Setting, values: Mapping[str, float], points: np.ndarray) -> PeriodicOrbit | None:
    """The orbit by Newton's method from points at the setting's phase, or of its section; None where there is none."""
    orbit = refine(replace(setting.at(values), count=len(points)), points[0])
    return orbit if orbit.success else None


def distance(a: np.ndarray, b: np.ndarray, setting: Setting) -> float:
    """Of two cycles of points (count, n), relative to unit + |x|, over the shifts of one; inf of different counts."""
    if a.shape != b.shape:
        return math.inf
    size = setting.sizes + np.abs(b)
    return min(float(np.abs((np.roll(a, k, axis=0) - b) / size).max(initial=0.0)) for k in range(len(a)))


def aligned(a: np.ndarray, b: np.ndarray) -> int:
    """The shift of `a` that brings it nearest to `b`."""
    if a.shape != b.shape:
        return 0
    return int(np.argmin([np.abs(np.roll(a, k, axis=0) - b).max(initial=0.0) for k in range(len(a))]))
