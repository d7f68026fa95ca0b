"""The contract of a method of a comparison.

A method takes a case and one setting, and gives a runner to be timed; the runner solves the case from its start to
`t_end` and returns a Run. What a method cannot do it says at once, by CannotDo, and the chart says so too. Compilation
happens in the first call, which is not timed.
Chain: cases.py -> **this file** -> own.py, rivals.py -> methods.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...door import checks
from ...door.documenting import complete
from .case import Case
from .plain import happenings


@complete
class CannotDo(Exception):
    """The method has no form for this case; the text says why.

    >>> METHODS["smoothed, algebraic"].runner(CASES["ball"], (1e-3, 1e-6))
    Traceback (most recent call last):
        ...
    pwsmooth.compare.efficiency.contract.CannotDo: an impact has no smoothed form
    """


@complete
@dataclass(frozen=True)
class Run:
    """What one run of a method gave.

    Attributes
    ----------
    x : ndarray, shape (n,)
        State at the end, in the units of the states.
    events : list of (float, str), callable that gives one, or None
        Time in the unit of the model's and kind ("crossing", "stick", "slip", "impact"); None for a method that knows
        no events. What has to be read out of a run's record is read after the clock has stopped.
    evaluations : int
        Of the right-hand side; a Taylor polynomial of order K counts K + 1.

    >>> run = METHODS["event-driven"].runner(CASES["relay"], 1e-9)(1.0)
    >>> [(f"{time:.6f}", kind) for time, kind in run.log()]
    [('0.471117', 'stick')]
    """

    x: np.ndarray
    events: list[tuple[float, str]] | Callable[[], list[tuple[float, str]]] | None
    evaluations: int

    def log(self) -> list[tuple[float, str]] | None:
        """The events.

        Returns
        -------
        list of (float, str), s and a word, or None
            Time and kind of each; None for a method that knows no events.
        """
        return self.events() if callable(self.events) else self.events


def without_jumps(case: Case, impacts: str, events: str) -> None:
    """CannotDo with these words where a case has impacts, or events that change its state."""
    if case.restitution is not None:
        raise CannotDo(impacts)
    if happenings(case.system.model):
        raise CannotDo(events)


MOST = 50_000  # evaluations of a right-hand side through Python
MANY = 500_000  # the same for compiled ones
Runner = Callable[[float], Run]


@checks.door()
@dataclass(frozen=True)
class Method:
    """One method of a comparison, a line of its chart.

    Parameters
    ----------
    name : str
        As it stands in the chart.
    group : str
        Methods of one group share a colour in every chart.
    knob : str
        What the setting is: "rtol", "step" (share of the longest step), "(eps, rtol)".
    settings : tuple
        From loose to tight.
    runner : callable
        (case, setting) -> runner(t_end), which gives a `Run`; raises `CannotDo`.
    extra : str
        The package that it needs besides the core.
    options : str
        How it is tuned, in words.

    >>> method = METHODS["DOP853, restarted"]
    >>> method.group, method.knob, method.options
    ('SciPy', 'rtol', 'terminal events, longest step bounded, right-hand side compiled')
    """

    name: str
    group: str
    knob: str
    settings: tuple[Any, ...]
    runner: Callable[[Case, Any], Runner]
    extra: str = ""
    options: str = ""
