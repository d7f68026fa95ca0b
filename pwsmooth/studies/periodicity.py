"""Measures of what repeats: the period of an orbit, and the word of its segments.

Chain: contract.py, of_solution.py -> **periodicity** -> measures.py, orbits.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..door import checks
from .contract import Measure, Variable, integer, real
from .of_solution import segments_in, strobes


@checks.door()
@dataclass(frozen=True)
class Period(Measure):
    """The variable `period`: after how many drive periods, or returns to the section, the state repeats; 0 for none.

    With a section also `period_time`, how long that takes. All strobes in the second half of the window must repeat,
    each state within tol (1 + abs(x)). A transient that has not died down to `tol`, a quasi-periodic and a chaotic
    orbit all give 0.

    Parameters
    ----------
    max_count : int
        Largest number of periods or returns that is looked for.
    tol : float, dimensionless
        How nearly the state must repeat.

    The logistic map has period 1, 2, 4, and none that is so short:

    >>> t, x, c = sp.symbols("t x c", real=True)
    >>> jump = Event(sp.sin(2 * sp.pi * t - 1), direction=1, update={x: c * x * (1 - x)})
    >>> logistic = System({x: 0 * x}, time=t, parameters={c: 3}, events=[jump])
    >>> found = sweep(logistic, {"c": [2.5, 3.2, 3.5, 3.9]}, x0={"x": 0.3}, seen=Strobe(1), transient=500,
    ...               measures=[Period(max_count=8)])
    >>> found["period"].values.tolist()
    [1, 2, 4, 0]
    """

    max_count: int = 8
    tol: float = 1e-6

    def __post_init__(self) -> None:
        checks.fields(self, max_count=checks.integer(1), tol=checks.positive)

    def variables(self, setting):
        if setting.strobed_by != "return":
            return {"period": integer(np.int16, "period in drive periods, 0 for none")}
        return {
            "period": integer(np.int16, "period in returns to the section, 0 for none"),
            "period_time": real(setting, "period", setting.time_unit),
        }

    def gather(self, orbits, setting):
        period = np.where(orbits.code_done, orbits.found, -1).astype(np.int16)
        return self._timed(period, orbits.strobe_t, setting)

    def of(self, solution, window, setting):
        period = self.find(strobes(solution, window, setting.strobed_by == "return"))
        return self._timed(period, window.times, setting)

    def _timed(self, period, times, setting):
        """With the time that it takes, from the times of the strobes (..., strobes)."""
        if setting.strobed_by != "return":
            return {"period": period}
        back = np.expand_dims(np.asarray(times.shape[-1] - 1 - np.maximum(period, 0)), -1)
        since = times[..., -1] - np.take_along_axis(times, back, -1)[..., 0]
        return {"period": period, "period_time": np.where(np.asarray(period) > 0, since, np.nan)}

    def find(self, x: np.ndarray, unit: Any = 1.0) -> int:
        """The period of a sequence of states.

        Parameters
        ----------
        x : ndarray, shape (strobes, n)
            States at the strobes, in their units.
        unit : ndarray, shape (n,), in the units of the states, optional
            Their sizes, 1 by default.

        Returns
        -------
        int
            In strobes, 0 for none.
        """
        last = len(x) - 1
        for period in range(1, min(self.max_count, last // 2) + 1):
            back = np.arange(min(last // 2, last - period) + 1)
            near, far = x[last - back], x[last - back - period]
            if np.all(np.abs(near - far) <= self.tol * (unit + np.abs(far))):
                return period
        return 0


@checks.door()
@dataclass(frozen=True)
class Itinerary(Measure):
    """The variable `itinerary`: the segments of the periodic orbit in order, one letter each.

    A slip-velocity switch has S stick, R slip right, L slip left; another one 0 sliding, + and - its sides; a
    contact c closed, o open. Several switches stand side by side: "S+ R+". The word begins with its first stick in
    a fixed order, so that one orbit has one word whatever its phase. "aperiodic" where `period` is 0, "..." where
    more than 32 segments make the word. Without a drive or a section it is the word of the whole window.

    >>> x, v = sp.symbols("x v", real=True)
    >>> block = System({x: v, v: -x - sp.sign(v)})
    >>> found = sweep(block, {"x": [1.5, 3.5]}, x0={"v": 0}, t_span=(0, 10), measures=[Itinerary()])
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
        words[bool(setting.strobed_by) & (orbits.found == 0)] = -3
        words[~orbits.ok] = -4
        # A sweep has few different words: a dict finds them ten times faster than sorting the rows.
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
        if setting.strobed_by and statuses:
            order = [tuple({0: 0, 1: 1, -1: 2}[s] for s in status) for status in statuses]
            turn = min(range(len(order)), key=lambda k: order[k:] + order[:k])
            statuses = statuses[turn:] + statuses[:turn]
        alphabets = setting.alphabets
        return " ".join("".join(a[s] for a, s in zip(alphabets, status)) for status in statuses)

    def of(self, solution, window, setting):
        detector = setting.period_detector
        period = detector.find(strobes(solution, window, setting.strobed_by == "return"))
        if window.strobed and not period:
            return {"itinerary": "aperiodic"}
        begin = window.times[-1 - max(period, 1)]
        pieces = segments_in(solution, *setting.word_columns)
        inside = [p for p in pieces if p[0] >= begin] or pieces[-1:]
        return {"itinerary": "..." if len(inside) > self.most else self._word([p[2:] for p in inside], setting)}
