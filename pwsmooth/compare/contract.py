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

from .cases import Case


class CannotDo(Exception):
    """The method has no form for this case; the text says why."""


@dataclass(frozen=True)
class Run:
    """What one run gave.

    Attributes
    ----------
    x : ndarray (n,)
        State at the end.
    events : list of (float, str), callable that gives one, or None
        Time and kind ("crossing", "stick", "slip", "impact"); None for a method that knows no events. What has to be
        read out of a run's record is read after the clock has stopped.
    evaluations : int
        Of the right-hand side; a Taylor polynomial of order K counts K + 1.
    """

    x: np.ndarray
    events: list[tuple[float, str]] | Callable[[], list[tuple[float, str]]] | None
    evaluations: int

    def log(self) -> list[tuple[float, str]] | None:
        """The events."""
        return self.events() if callable(self.events) else self.events


MOST = 100_000  # evaluations of a right-hand side through Python
MANY = 2_000_000  # the same for compiled ones
Runner = Callable[[float], Run]


@dataclass(frozen=True)
class Method:
    """One line of a chart.

    Parameters
    ----------
    name : str
    group : str
        Methods of one group share a colour in every chart.
    knob : str
        What the setting is: "rtol", "step" (share of the longest step), "(eps, rtol)".
    settings : tuple
        From loose to tight.
    runner : callable
        (case, setting) -> runner(t_end); raises CannotDo.
    extra : str
        The package that it needs besides the core.
    options : str
        How it is tuned, in words.
    """

    name: str
    group: str
    knob: str
    settings: tuple[Any, ...]
    runner: Callable[[Case, Any], Runner]
    extra: str = ""
    options: str = ""
