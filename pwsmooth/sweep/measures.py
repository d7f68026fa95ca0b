"""What a sweep keeps of an orbit: measures over its window, each one or a few named numbers.

Chain: Solution or ensemble -> **this** -> variables of the Dataset.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..definition import checks
from .contract import Measure, OfQuantities, Variable, real
from .functions import Function, Lyapunov
from .of_solution import moments, range_of, segments_in, strobes

__all__ = [
    "Amplitude",
    "Counts",
    "Extremes",
    "Function",
    "Itinerary",
    "Lyapunov",
    "Period",
    "Points",
    "Statistics",
    "Sticks",
    "measure_from_text",
]


@dataclass(frozen=True)
class Sticks(Measure):
    """The variables `stick_time` and `sticks`: time stuck per period, and sticks per period.

    Sliding counts as stuck, of a contact being closed; a stick is counted in the period in which it begins. Of
    several switches both have the dimension `switch`.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, sweep
    >>> t, y, v = sp.symbols("t y v", real=True)
    >>> sigma = sp.Symbol("sigma", positive=True)
    >>> block = System({y: v, v: -sigma * sp.sin(t) - 3 * y - sp.sign(v)}, time=t, parameters={sigma: 1})
    >>> found = sweep(block, {"sigma": [1.2]}, start={"y": 0.5, "v": 0.3}, period=2 * sp.pi, measures=["sticks"])
    >>> found["sticks"].values.tolist()
    [2.0]
    """

    def variables(self, setting):
        dims, shape = setting.switch_dims
        return {
            "stick_time": real(setting, "time stuck per period", setting.time_unit, dims, shape),
            "sticks": real(setting, "sticks per period", "1", dims, shape),
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


@dataclass(frozen=True)
class Period(Measure):
    """The variable `period`: after how many drive periods the state repeats; 0 for none.

    All strobes in the second half of the window must repeat, each state within tol (1 + abs(x)). A transient that has
    not died down to `tol`, a quasi-periodic and a chaotic orbit all give 0.

    Parameters
    ----------
    longest : int
        Largest number of periods that is looked for.
    tol : float, dimensionless
        How nearly the state must repeat.

    Raises
    ------
    ValueError, TypeError
        Bad input, with the argument, its value and the remedy.

    Examples
    --------
    The logistic map has period 1, 2, 4, and none that is so short:

    >>> import sympy as sp
    >>> from pwsmooth import Event, System, sweep
    >>> from pwsmooth.sweep import Period
    >>> t, x, c = sp.symbols("t x c", real=True)
    >>> jump = Event(sp.sin(2 * sp.pi * t - 1), direction=1, update={x: c * x * (1 - x)})
    >>> logistic = System({x: 0 * x}, time=t, parameters={c: 3}, events=[jump])
    >>> found = sweep(logistic, {"c": [2.5, 3.2, 3.5, 3.9]}, start={"x": 0.3}, period=1, transient=500,
    ...               measures=[Period(longest=8)])
    >>> found["period"].values.tolist()
    [1, 2, 4, 0]
    """

    longest: int = 8
    tol: float = 1e-6

    def __post_init__(self) -> None:
        checks.fields(self, longest=checks.integer(1), tol=checks.positive)

    def variables(self, setting):
        about = {"long_name": "period in drive periods, 0 for none", "units": "1"}
        return {"period": Variable((), (), np.int16, -1, about)}

    def gather(self, orbits, setting):
        return {"period": np.where(orbits.code_done, orbits.found, -1).astype(np.int16)}

    def of(self, solution, window, setting):
        return {"period": self.find(strobes(solution, window))}

    def find(self, x: np.ndarray) -> int:
        """The period of a sequence of states.

        Parameters
        ----------
        x : ndarray, shape (strobes, n)
            States at the strobes, in their units.

        Returns
        -------
        int
            In drive periods, 0 for none.
        """
        last = len(x) - 1
        for period in range(1, min(self.longest, last // 2) + 1):
            back = np.arange(min(last // 2, last - period) + 1)
            near, far = x[last - back], x[last - back - period]
            if np.all(np.abs(near - far) <= self.tol * (1 + np.abs(far))):
                return period
        return 0


@dataclass(frozen=True)
class Itinerary(Measure):
    """The variable `itinerary`: the segments of the periodic orbit in order, one letter each.

    A slip-velocity switch has S stick, R slip right, L slip left; another one 0 sliding, + and - its sides; a
    contact c closed, o open. Several switches stand side by side: "S+ R+". The word begins with its first stick in
    a fixed order, so that one orbit has one word whatever its phase. "aperiodic" where `period` is 0, "..." where
    more than 32 segments make the word. Without a drive it is the word of the whole window.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, sweep
    >>> from pwsmooth.sweep import Itinerary
    >>> x, v = sp.symbols("x v", real=True)
    >>> block = System({x: v, v: -x - sp.sign(v)})
    >>> found = sweep(block, {"x": [1.5, 3.5]}, start={"v": 0}, t_span=(0, 10), measures=[Itinerary()])
    >>> found.itinerary.values.tolist()
    ['L S', 'L R S']
    """

    most: ClassVar[int] = 32

    def variables(self, setting):
        about = {"long_name": "itinerary", "letters": "S stick, R slip right, L slip left"}
        return {"itinerary": Variable((), (), np.dtypes.StringDType(), "", about)}

    def gather(self, orbits, setting):
        words = np.where(np.arange(self.most) < orbits.word_length[:, None], orbits.word, -1)
        words[orbits.word_length < 0] = -2
        words[setting.forced & (orbits.found == 0)] = -3
        words[~orbits.ok] = -4
        # A few words make a whole sweep; a dict finds them in a tenth of the time of a sort of rows.
        number: dict[Any, int] = {}
        rows = (
            np.ascontiguousarray(words).view(np.dtype((np.void, words.itemsize * self.most))).ravel().tolist()
        )
        which = [number.setdefault(row, len(number)) for row in rows]
        spoken = [self._spoken(np.frombuffer(row, words.dtype).tolist(), setting) for row in number]
        return {"itinerary": np.array(spoken, np.dtypes.StringDType())[which]}

    def _spoken(self, codes, setting):
        if codes[0] <= -2:
            return {-2: "...", -3: "aperiodic", -4: ""}[codes[0]]
        m = len(setting.word_columns)
        statuses = [tuple(c // 3**k % 3 - 1 for k in range(m)) for c in codes if c >= 0]
        return self._word(statuses, setting)

    def _word(self, statuses, setting):
        if setting.forced and statuses:
            order = [tuple({0: 0, 1: 1, -1: 2}[s] for s in status) for status in statuses]
            turn = min(range(len(order)), key=lambda k: order[k:] + order[:k])
            statuses = statuses[turn:] + statuses[:turn]
        alphabets = setting.alphabets
        return " ".join("".join(a[s] for a, s in zip(alphabets, status)) for status in statuses)

    def of(self, solution, window, setting):
        detector = setting.period_detector
        period = detector.find(strobes(solution, window))
        if window.forced and not period:
            return {"itinerary": "aperiodic"}
        begin = window.end - max(period, 1) * window.period
        pieces = segments_in(solution, *setting.word_columns)
        inside = [p for p in pieces if p[0] >= begin] or pieces[-1:]
        return {"itinerary": "..." if len(inside) > self.most else self._word([p[2:] for p in inside], setting)}


class Extremes(OfQuantities):
    """The variables `<name>_min` and `<name>_max`, over the window and between steps too.

    Parameters
    ----------
    *names : str or Symbol
        States, multipliers or outputs.

    Examples
    --------
    >>> import math
    >>> import sympy as sp
    >>> from pwsmooth import System, sweep
    >>> from pwsmooth.sweep import Extremes
    >>> x, v = sp.symbols("x v", real=True)
    >>> found = sweep(System({x: v, v: -x}), {"x": [1.0, 2.0]}, start={"v": 0}, t_span=(0, 10),
    ...               measures=[Extremes("x")])
    >>> found["x_max"].values.round(6).tolist()
    [1.0, 2.0]
    """

    bits = 1

    def variables(self, setting):
        return {
            f"{name}_{end}": real(setting, f"{word} of {name}", setting.unit(name))
            for name in self.names
            for end, word in (("min", "minimum"), ("max", "maximum"))
        }

    def gather(self, orbits, setting):
        columns = {name: setting.quantities.index(name) for name in self.names}
        return {
            f"{name}_{end}": np.where(orbits.ok, array[:, q], np.nan)
            for name, q in columns.items()
            for end, array in (("min", orbits.low), ("max", orbits.high))
        }

    def of(self, solution, window, setting):
        ends = {name: range_of(solution, name, window) for name in self.names}
        return {f"{name}_{end}": pair[k] for name, pair in ends.items() for k, end in enumerate(("min", "max"))}


class Amplitude(OfQuantities):
    """The variable `<name>_amplitude`: half the distance from minimum to maximum over the window.

    Parameters
    ----------
    *names : str or Symbol
        States, multipliers or outputs.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, sweep
    >>> from pwsmooth.sweep import Amplitude
    >>> x, v = sp.symbols("x v", real=True)
    >>> found = sweep(System({x: v, v: 1 - x}), {"x": [1.5, 2.0]}, start={"v": 0}, t_span=(0, 10),
    ...               measures=[Amplitude("x")])
    >>> found["x_amplitude"].values.round(6).tolist()
    [0.5, 1.0]
    """

    bits = 1

    def variables(self, setting):
        return {
            f"{name}_amplitude": real(setting, f"amplitude of {name}", setting.unit(name))
            for name in self.names
        }

    def gather(self, orbits, setting):
        columns = {name: setting.quantities.index(name) for name in self.names}
        with np.errstate(invalid="ignore"):  # inf - inf of an orbit that never reached its window
            return {
                f"{name}_amplitude": np.where(orbits.ok, 0.5 * (orbits.high[:, q] - orbits.low[:, q]), np.nan)
                for name, q in columns.items()
            }

    def of(self, solution, window, setting):
        ends = {name: range_of(solution, name, window) for name in self.names}
        return {f"{name}_amplitude": 0.5 * (high - low) for name, (low, high) in ends.items()}


class Statistics(OfQuantities):
    """The variables `<name>_mean` and `<name>_rms`: time averages over the window.

    Parameters
    ----------
    *names : str or Symbol
        States, multipliers or outputs (forces).

    Examples
    --------
    >>> import math
    >>> import sympy as sp
    >>> from pwsmooth import System, sweep
    >>> from pwsmooth.sweep import Statistics
    >>> x, v = sp.symbols("x v", real=True)
    >>> found = sweep(System({x: v, v: -x}), {"x": [1.0, 2.0]}, start={"v": 0}, t_span=(0, 4 * math.pi),
    ...               measures=[Statistics("x")])
    >>> found["x_rms"].values.round(6).tolist()  # x/sqrt(2)
    [0.707107, 1.414214]
    """

    bits = 2

    def variables(self, setting):
        return {
            f"{name}_{kind}": real(setting, f"{word} of {name}", setting.unit(name))
            for name in self.names
            for kind, word in (("mean", "time average"), ("rms", "root mean square"))
        }

    def gather(self, orbits, setting):
        result = {}
        for name in self.names:
            q = setting.quantities.index(name)
            span = np.where(orbits.ok, orbits.reached - orbits.window[:, 0], np.nan)
            with np.errstate(all="ignore"):  # a terminal event may come before the window
                result[f"{name}_mean"] = orbits.first[:, q] / span
                result[f"{name}_rms"] = np.sqrt(orbits.second[:, q] / span)
        return result

    def of(self, solution, window, setting):
        result = {}
        for name in self.names:
            result[f"{name}_mean"], result[f"{name}_rms"] = moments(solution, name, window)
        return result


@dataclass(frozen=True)
class Points(Measure):
    """The variables `<state>_points`: states at the window's start and after every period, along the dimension
    `strobe`.

    They are the stroboscopic (Poincare) points of a forced system.

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

    Raises
    ------
    ValueError, TypeError
        Bad input, with the argument, its value and the remedy.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, sweep
    >>> from pwsmooth.sweep import Points
    >>> t, x = sp.symbols("t x", real=True)
    >>> found = sweep(System({x: sp.cos(t) - x}, time=t), {"x": [0.0, 3.0]}, period=2 * sp.pi, transient=5,
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

    def variables(self, setting):
        count = setting.periods + 1 if self.last is None else min(self.last, setting.periods + 1)
        dim = "strobe" if self.last is None else f"last_{count}"
        return {
            f"{name}_points": real(setting, f"{name} once a period", setting.unit(name), (dim,), (count,))
            for name in self._states(setting)
        }

    def gather(self, orbits, setting):
        count = 0 if self.last is None else -min(self.last, setting.periods + 1)
        return {
            f"{name}_points": orbits.strobe[:, count:, setting.states.index(name)].copy()
            for name in self._states(setting)
        }

    def of(self, solution, window, setting):
        x = strobes(solution, window)[0 if self.last is None else -min(self.last, setting.periods + 1) :]
        return {f"{name}_points": x[:, setting.states.index(name)] for name in self._states(setting)}


@dataclass(frozen=True)
class Counts(Measure):
    """The variables `events` and `steps`: how many events are inside the window, how many steps the whole orbit took.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, sweep
    >>> x, v = sp.symbols("x v", real=True)
    >>> block = System({x: v, v: -x - sp.sign(v)})
    >>> found = sweep(block, {"x": [1.5, 3.5]}, start={"v": 0}, t_span=(0, 10), measures=["counts"])
    >>> found["events"].values.tolist()
    [1, 2]
    """

    def variables(self, setting):
        about = {"events": "events inside the window", "steps": "steps of the whole orbit"}
        return {
            name: Variable((), (), np.int64, -1, {"long_name": text, "units": "1"})
            for name, text in about.items()
        }

    def gather(self, orbits, setting):
        return {"events": orbits.events_inside.copy(), "steps": orbits.steps.copy()}

    def of(self, solution, window, setting):
        times = np.array([e.time for e in solution.events])
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

    Examples
    --------
    >>> from pwsmooth.sweep.measures import measure_from_text
    >>> measure_from_text("amplitude(y)")
    Amplitude(names=('y',))
    """
    text = checks.name(text, "`text`")
    match = re.fullmatch(r"\s*(\w+)\s*(?:\(([^()]*)\))?\s*", text)
    if not match or match[1] not in _BY_NAME:
        raise ValueError(
            f"`text` is {text!r}, no measure; they are {', '.join(_BY_NAME)}, some with names: amplitude(y)."
        )
    kind, names = _BY_NAME[match[1]], [name.strip() for name in (match[2] or "").split(",") if name.strip()]
    if names and not issubclass(kind, (OfQuantities, Points)):
        raise ValueError(f"the measure {match[1]!r} takes no names; write it without parentheses.")
    return kind(*names)
