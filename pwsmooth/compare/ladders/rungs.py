"""What a ladder is made of: rungs, observables, and the setting that has both.

    poorest model -> ... -> richest model,    parameters of the poorer ones derived from the richest

A rung is a scene with its accuracy left open; an observable is a number (or a curve) of a motion. The motion is a
Solution with dense output, or for a model in closed form anything that answers `motion(times, name)`.
Chain: scenes -> **rungs** -> friction.py, contact.py, ... -> climbing.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...door import checks
from ...door.documenting import complete
from ...laws import Law
from ...scenes import Scene

__all__ = ["Motion", "Observable", "Rung", "Setting"]


@complete
class Motion(Protocol):
    """What observables look at: called with times and a name it gives that quantity.

    A `Solution` with dense output is one; so is a model in closed form.

    A closed form as the motion of an observable:

    >>> class Swing:
    ...     def __call__(self, t, name=None):
    ...         return np.cos(t)
    >>> round(amplitude("amplitude", "x", "m").measure(Swing(), (0.0, 7.0), 101), 6)
    1.0
    """

    def __call__(self, t: Any, name: Any = None) -> np.ndarray:
        """Values of one quantity at times."""


@complete
@dataclass(frozen=True)
class Rung:
    """One model of a ladder.

    Attributes
    ----------
    name : str
        As it stands in the table.
    scene : callable
        () -> Scene; or, of a model in closed form, () -> Motion.
    matched : str
        How its parameters follow from the richest rung's, in words with the numbers.
    noise : callable, optional
        Number of a trajectory -> noise of `solve`; the observable is then a mean over `samples` trajectories.
    samples : int
        Trajectories of a noisy rung.

    >>> Rung("Coulomb", lambda: block_on_belt(Coulomb()), "F_c = 1 N, given").samples
    1
    """

    name: str
    scene: Callable[[], Scene | Motion]
    matched: str
    noise: Callable[[int], Any] | None = None
    samples: int = 1


def top_rung(names: Mapping[str, str], richest: Law, build: Callable[[Law], Scene]) -> Rung:
    """The rung of the richest law, by its name in `names` if it has one there."""
    kind = type(richest).__name__
    return Rung(names.get(kind, kind), lambda: build(richest), "the richest law's own")


@complete
@dataclass(frozen=True)
class Observable:
    """A quantity of a motion.

    Attributes
    ----------
    name, unit, meaning : str
        For the command line, of its value, and in words.
    measure : callable
        (motion, window, points) -> float, or ndarray of fixed shape for a curve. `points` is the number of samples
        that it may take of the window; the ladder asks for twice as many where it wants the error.

    >>> end = Observable("end", "m", "position at the end", lambda motion, window, points: motion(window[1], "x"))
    >>> end.measure(lambda t, name: 2 * t, (0.0, 3.0), 101)
    6.0
    """

    name: str
    unit: str
    meaning: str
    measure: Callable[[Any, tuple[float, float], int], Any]


@checks.door()
@dataclass(frozen=True)
class Setting:
    """A scene with the models of growing fidelity for it.

    Attributes
    ----------
    richest : Rung
        The most complete model.
    coarser : callable
        Motion of the richest rung -> the other rungs, poorest first: typical speeds, restitutions and depths, at
        which the laws are matched, are read off that motion.
    points : int
        Samples of the window for the coarse measurement.

    >>> setting = setting_of("impact")
    >>> [observable.name for observable in setting.observables]
    ['restitution', 'duration', 'top indentation', 'top force']
    """

    name: str
    title: str
    richest: Rung
    coarser: Callable[[Any], Sequence[Rung]]
    observables: Sequence[Observable]
    window: tuple[float, float]
    points: int = 8001

    def observable(self, name: str | Observable) -> Observable:
        """One of its observables by name; an Observable of one's own is taken as it is.

        Parameters
        ----------
        name : str or Observable
            Which.

        Returns
        -------
        Observable
            Of this setting, or one's own.

        Raises
        ------
        ValueError
            An unknown name.
        """
        if isinstance(name, Observable):
            return name
        by_name = {o.name: o for o in self.observables}
        if name not in by_name:
            raise ValueError(
                f"`observable` is {name!r}, which {self.name} does not have; choose one of {', '.join(by_name)}, "
                "or give an Observable."
            )
        return by_name[name]
