"""What a sweep keeps of an orbit: measures over its window, each one or a few named numbers.

Chain: Solution or ensemble -> **this** -> variables of the Dataset.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..analysis.maps.poincare import RETURN
from ..door import calls, checks
from .contract import Measure, integer, real
from .functions import Cost, Function, Lyapunov
from .of_solution import segments_in, strobes
from .periodicity import Itinerary, Period
from .quantities import Amplitude, Extremes, OfQuantities, Statistics

__all__ = [
    "Amplitude",
    "Cost",
    "Counts",
    "Extremes",
    "Function",
    "Itinerary",
    "Lyapunov",
    "Period",
    "Points",
    "Statistics",
    "Sticks",
]


@checks.door()
@dataclass(frozen=True)
class Sticks(Measure):
    """The variables `stick_time` and `sticks`: time stuck per period, and sticks per period (return to a section).

    Sliding counts as stuck, of a contact being closed; a stick is counted in the period in which it begins. Of
    several switches both have the dimension `switch`.

    >>> t, y, v = sp.symbols("t y v", real=True)
    >>> sigma = sp.Symbol("sigma", positive=True)
    >>> block = System({y: v, v: -sigma * sp.sin(t) - 3 * y - sp.sign(v)}, time=t, parameters={sigma: 1})
    >>> found = sweep(block, {"sigma": [1.2]}, x0={"y": 0.5, "v": 0.3}, seen=Strobe(2 * sp.pi), measures=["sticks"])
    >>> found["sticks"].values.tolist()
    [2.0]
    """

    def variables(self, setting):
        dims, shape = setting.switch_dims
        once = setting.strobed_by or "period"
        return {
            "stick_time": real(setting, f"time stuck per {once}", setting.time_unit, dims, shape),
            "sticks": real(setting, f"sticks per {once}", "1", dims, shape),
        }

    def gather(self, orbits, setting):
        keep = setting.switch_columns
        time, number = (a[:, keep] / setting.periods for a in (orbits.stick_time, orbits.sticks))
        failed = ~orbits.ok
        time[failed] = number[failed] = np.nan
        return {
            name: a if setting.switch_dims[0] else a[:, 0]
            for name, a in (("stick_time", time), ("sticks", number))
        }

    def of(self, solution, window, setting):
        time, number = [], []
        for j in setting.switch_columns:
            pieces = segments_in(solution, j)
            inside = [min(b, window.end) - max(a, window.start) for a, b, s in pieces if s == 0]
            time.append(sum(max(d, 0.0) for d in inside) / window.periods)
            number.append(sum(s == 0 and window.start <= a < window.end for a, _, s in pieces) / window.periods)
        pair = {"stick_time": np.array(time), "sticks": np.array(number)}
        return pair if setting.switch_dims[0] else {name: a[0] for name, a in pair.items()}


@checks.door()
@dataclass(frozen=True)
class Points(Measure):
    """The variables `<state>_points`: states at the window's start and after every period or return, along the
    dimension `strobe`.

    They are the Poincare points of a forced system (stroboscopic) or of one with a section.

    Parameters
    ----------
    *names : str or Symbol
        States; all by default.
    last : int, optional
        Keep only that many, along the dimension `last_<number>`.

    Attributes
    ----------
    names : tuple of str
        The states.

    >>> t, x = sp.symbols("t x", real=True)
    >>> found = sweep(System({x: sp.cos(t) - x}, time=t), {"x": [0.0, 3.0]}, seen=Strobe(2 * sp.pi), transient=5,
    ...               measures=[Points("x", last=2)])
    >>> found["x_points"].values.round(6).tolist()  # x = (cos t + sin t)/2 is the periodic orbit
    [[0.5, 0.5], [0.5, 0.5]]
    """

    names: tuple[str, ...] = ()
    last: int | None = None

    def __init__(self, *names: Any, last: int | None = None) -> None:
        object.__setattr__(self, "names", tuple(str(name) for name in names))
        object.__setattr__(self, "last", checks.optional(checks.integer(1))(last, "`last`"))

    def _states(self, setting):
        return self.names or setting.states

    def _count(self, setting):
        most = setting.periods + 1
        return most if self.last is None else min(self.last, most)

    def variables(self, setting):
        count = self._count(setting)
        dim = "strobe" if self.last is None else f"last_{count}"
        return {
            f"{name}_points": real(
                setting, f"{name} once a {setting.strobed_by or 'period'}", setting.unit(name), (dim,), (count,)
            )
            for name in self._states(setting)
        }

    def gather(self, orbits, setting):
        return self._of(orbits.strobe, setting)

    def of(self, solution, window, setting):
        return self._of(strobes(solution, window, setting.strobed_by == "return"), setting)

    def _of(self, x, setting):
        """The last points, from the states x (..., strobes, n)."""
        last = x[..., -self._count(setting) :, :]
        return {
            f"{name}_points": last[..., setting.states.index(name)].copy() for name in self._states(setting)
        }


@checks.door()
@dataclass(frozen=True)
class Counts(Measure):
    """The variables `events` and `steps`: how many events are inside the window, how many steps the whole orbit took.

    >>> x, v = sp.symbols("x v", real=True)
    >>> block = System({x: v, v: -x - sp.sign(v)})
    >>> found = sweep(block, {"x": [1.5, 3.5]}, x0={"v": 0}, t_span=(0, 10), measures=["counts"])
    >>> found["events"].values.tolist()
    [1, 2]
    """

    def variables(self, setting):
        about = {"events": "events inside the window", "steps": "steps of the whole orbit"}
        return {name: integer(np.int64, text) for name, text in about.items()}

    def gather(self, orbits, setting):
        return {"events": orbits.events_inside.copy(), "steps": orbits.steps.copy()}

    def of(self, solution, window, setting):
        times = np.array([e.time for e in solution.events if e.switch != RETURN])
        return {"events": int(np.sum(times > window.start)), "steps": int(solution.cost["steps"])}


_BY_NAME: dict[str, Any] = {
    "sticks": Sticks,
    "itinerary": Itinerary,
    "period": Period,
    "amplitude": Amplitude,
    "extremes": Extremes,
    "statistics": Statistics,
    "points": Points,
    "counts": Counts,
    "lyapunov": Lyapunov,
}


@checks.door()
def measure_from_text(text: str) -> Measure:
    """A measure by name, with its quantities in parentheses: "sticks", "amplitude(y, v)", "points".

    Parameters
    ----------
    text : str
        Name, and names of quantities where it takes them.

    Returns
    -------
    Measure
        With the default settings.

    Raises
    ------
    ValueError
        No such measure, or arguments that it does not take.

    >>> measure_from_text("amplitude(y)")
    Amplitude(names=('y',))
    """
    text = checks.name(text, "`text`")
    match = re.fullmatch(r"\s*(\w+)\s*(?:\(([^()]*)\))?\s*", text)
    if not match or match[1] not in _BY_NAME:
        raise ValueError(
            f"`text` is {text!r}, no measure; they are {', '.join(_BY_NAME)}, some with names: amplitude(y)."
            + calls.hint(match[1] if match else text, _BY_NAME)
        )
    kind, names = _BY_NAME[match[1]], [name.strip() for name in (match[2] or "").split(",") if name.strip()]
    if names and not issubclass(kind, (OfQuantities, Points)):
        raise ValueError(f"the measure {match[1]!r} takes no names; write it without parentheses.")
    return kind(*names)
