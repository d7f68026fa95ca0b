"""A case of a comparison: a scene, what its errors are measured in, and a reference from an independent path.

    reference   a closed form, or two methods without common code that agree: the event-driven kernels and
                restarting.py over SciPy's DOP853
Chain: scenes, plain.py, restarting.py -> **this file** -> cases.py, contract.py, measuring.py.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ...door import checks
from ...scenes.scene import Scene
from ...solving import solve
from ...system import System
from .plain import plain
from .restarting import restarted

__all__ = ["Case", "Reference", "case_of"]

KINDS = ("crossing", "stick", "slip", "impact")
WORST = 1e-9  # by which the two paths of a reference may differ, in units of the states' sizes


@dataclass(frozen=True)
class Reference:
    """The answer of a case: states at the ends asked for, events up to the last, and how they were found.

    Attributes
    ----------
    ends : tuple of float, s
        Times at which states are known.
    states : ndarray, shape (number of ends, n)
        In the units of the states.
    times : ndarray, shape (ne,), s
        Of the events.
    kinds : tuple of str
        Of the events: "crossing", "stick", "slip", "impact".
    source : str
        "closed form" or "two paths without common code".
    uncertainty : float, dimensionless
        Of states and times, in units of their sizes.

    Examples
    --------
    >>> from pwsmooth.compare import CASES
    >>> reference = CASES["relay"].reference
    >>> reference.kinds, reference.source
    (('stick',), 'closed form')
    """

    ends: tuple[float, ...]
    states: np.ndarray
    times: np.ndarray
    kinds: tuple[str, ...]
    source: str
    uncertainty: float


@checks.door()
@dataclass(frozen=True)
class Case:
    """A scene for all methods of a comparison.

    Parameters
    ----------
    name, title : str
        For the command line and files, and in words.
    system : System
        Without noise.
    x0 : tuple of float
        Of all states, memories included, in their units.
    t_end : float, s
        From t = 0. Errors are taken at 0.31, 0.72 and 1 of it: a dissipative system forgets early ones.
    sizes : tuple of float
        Of the states, in their units: errors are in these units, and every method gets them in its `atol`. An error
        above a tenth is a wrong orbit.
    longest : float, s
        Bound on the step that a careful user gives methods whose events can be stepped over.
    exact : callable, optional
        t -> exact state; without it two methods have to agree.
    counted : tuple of str
        Kinds of events that make the itinerary.

    >>> case = CASES["relay"]
    >>> case.t_end, [f"{end:.2f}" for end in case.ends]
    (4.0, ['1.24', '2.88', '4.00'])
    """

    name: str
    title: str
    system: System
    x0: tuple[float, ...]
    t_end: float
    sizes: tuple[float, ...]
    longest: float
    exact: Callable[[float], Sequence[float]] | None = None
    counted: tuple[str, ...] = KINDS

    @property
    def restitution(self) -> float | None:
        """Of the contact, with the values of the system; None without one, nan if it depends on the impact."""
        system = self.system._written_out()
        given = {p: sp.Float(value) for p, value in system.parameters.items()}
        found = {e.xreplace(given) for *_, e in system._field.contacts}
        if not found:
            return None
        return float(found.pop()) if len(found) == 1 and not any(e.free_symbols for e in found) else math.nan

    def tolerances(self, rtol: float) -> dict[str, Any]:
        """Tolerances of a method, the absolute one a hundredth of the relative one at the states' sizes.

        Parameters
        ----------
        rtol : float, dimensionless
            Relative tolerance.

        Returns
        -------
        dict of str to (float or ndarray, shape (n,))
            `rtol`, dimensionless, and `atol`, in the units of the states.
        """
        return {"rtol": rtol, "atol": 1e-2 * rtol * np.array(self.sizes)}

    def apart(self, one: np.ndarray, other: np.ndarray) -> float:
        """Largest difference of two states, or of rows of them, in units of the sizes.

        Parameters
        ----------
        one, other : ndarray, shape (n,) or (k, n)
            In the units of the states.

        Returns
        -------
        float
            Dimensionless.
        """
        return float(np.max(np.abs(np.asarray(one) - other) / np.array(self.sizes)))

    def itinerary(self, log: Iterable[tuple[float, str]]) -> list[tuple[float, str]]:
        """The events that count.

        Parameters
        ----------
        log : iterable of (float, str), s and a word
            Time and kind of every event.

        Returns
        -------
        list of (float, str), s and a word
            Those whose kind is in `counted`.
        """
        return [(time, kind) for time, kind in log if kind in self.counted]

    @property
    def ends(self) -> tuple[float, ...]:
        """Times at which errors are taken, s."""
        return tuple(share * self.t_end for share in (0.31, 0.72, 1.0))

    @functools.cached_property
    def reference(self) -> Reference:
        """Computed once.

        Raises
        ------
        RuntimeError
            The two paths disagree by more than 1e-9: neither can serve.
        """
        tight = self.tolerances(1e-13)
        own = solve(self.system, (0, self.t_end), self.x0, dense_output=True, **tight)
        if not own.success:
            raise RuntimeError(f"the reference of {self.name!r} cannot be computed: {own.message}")
        log = self.itinerary((event.time, basic(event.kind)) for event in own.events)
        times = np.array([time for time, _ in log])
        mine = np.array([own(end)[: len(self.x0)] for end in self.ends])
        if self.exact is not None:
            states, source = np.array([self.exact(end) for end in self.ends], float), "closed form"
            apart = self.apart(states, mine)
        else:
            functions, source = plain(self.system), "two paths without common code"
            runs = [
                restarted(functions, (0, end), np.array(self.x0), max_step=self.longest, **tight)
                for end in self.ends
            ]
            states = np.array([run[0] for run in runs])
            others = self.itinerary(runs[-1][1])
            if [kind for _, kind in others] != [kind for _, kind in log]:
                raise RuntimeError(f"the two references of {self.name!r} have different events.")
            late = np.abs(times - [time for time, _ in others])
            apart = max(self.apart(states, mine), float(np.max(late, initial=0.0)))
        if not apart < WORST:
            raise RuntimeError(
                f"the two references of {self.name!r} differ by {apart:.1e}, more than {WORST:g}: neither can serve."
            )
        return Reference(self.ends, states, times, tuple(kind for _, kind in log), source, apart)


@checks.door()
def case_of(
    scene: Scene,
    *,
    exact: Callable[[float], Sequence[float]] | None = None,
    sizes: Sequence[float] | None = None,
    longest: float | None = None,
    counted: Sequence[str] = KINDS,
    name: str = "",
    title: str = "",
    t_end: float | None = None,
) -> Case:
    """A scene as a case.

    Parameters
    ----------
    scene : Scene
        Its span begins at 0.
    exact : callable, optional
        t -> exact state, in the order of `scene.system.states`. Without it the reference is made of two methods that
        agree, see `Case.reference`.
    sizes : sequence of float, length n, optional
        Of the states, in their units; by default the largest values on the motion.
    longest : float, s, optional
        Bound on the steps of rivals; by default a two-hundredth of the span.
    counted : sequence of str
        Kinds of events that make the itinerary.
    name, title : str
        The scene's by default.
    t_end : float, s, optional
        The span's end by default.

    Returns
    -------
    Case
        Its reference is computed when it is asked for.

    Raises
    ------
    ValueError
        A span that does not begin at 0.

    >>> case = case_of(block_on_belt(StaticKinetic()), t_end=10.0)
    >>> case.name, case.longest
    ('block on a belt, StaticKinetic', 0.05)
    """
    begin, end = scene.t_span
    if begin != 0:
        raise ValueError(f"`scene` begins at t = {begin:g}; comparisons begin at 0, so shift its drive.")
    end = end if t_end is None else t_end
    start = tuple(scene.system.initial_state(scene.x0))
    if sizes is None:
        motion = np.abs(scene.solve((0, end)).x).max(axis=1)
        sizes = np.where(motion > 0, motion, 1.0).tolist()
    return Case(name or scene.name, title or scene.name, scene.system, start, end, tuple(sizes),
                longest or end / 200, exact, tuple(counted))  # fmt: skip


def basic(kind: str) -> str:
    """Kinds of events as all methods can tell them apart; "" for those that are none to the others."""
    if kind == "slip by reset":  # the reset says it
        return ""
    if kind.startswith("slip"):
        return "slip"
    return kind if kind in ("crossing", "stick", "impact", "reset") else ""
