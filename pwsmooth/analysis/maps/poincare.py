"""What Poincare maps have in common: a point's image, repeated application, and why a trajectory has no image.

Chain: solve -> **poincare** -> sections.py (the two maps).
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...door import calls, checks
from ...door.documenting import complete
from ...paths.budget import whole
from ...paths.call import Scratch
from ...results.records import Outcome
from ...results.solution import Solution
from ...solving import behind_the_door, solve
from .constraints import on_constraints
from .first_order import chosen_parameters
from .scales import Scale, scale_along, scale_of_populations, unit_of

#: (switch, kind, from and to) of every event: an itinerary in letters.
Word = tuple[tuple[str, str, str], ...]
#: Where the applications that a map consists of (periods, returns) are cut into legs, and a leg: which one, from, to.
Cuts = tuple[tuple[float, ...], ...]
Leg = tuple[int, float, float]
RETURN = "pws_return"  # name of the event that ends a return map's run
_COUNTS = {"count": checks.integer(1, 10**7), "discard": checks.integer(0, 10**9)}


@complete
@dataclass(frozen=True)
class Image:
    """A point's image under a Poincare map, with its derivatives if they were asked for.

    Attributes
    ----------
    x : ndarray, shape (n,)
        The image, in the units of the states; nan where the trajectory did not come back.
    time : float, in the unit of the model's time
        How long the map took.
    runs : tuple of Solution
        The trajectory; of a return map one run to each return.
    jacobian : ndarray, shape (n, n)
        By the point, in the units of the states; empty if not asked for.
    by_parameter : ndarray, shape (n, k)
        By parameters, in units of the states over theirs; empty if not asked for.
    degenerate : tuple of str
        Where the map has no derivative, in words.
    reason : str
        Why there is no image, in words; empty if there is one.

    >>> t, x = sp.symbols("t x", real=True)
    >>> image = Stroboscopic(System({x: sp.cos(t) - x}, time=t), 2 * sp.pi).image(np.array([0.5]), [])
    >>> print(f"{image.jacobian[0, 0]:.9f} {math.exp(-2 * math.pi):.9f}")
    0.001867443 0.001867443
    """

    x: np.ndarray
    time: float
    runs: tuple[Solution, ...]
    jacobian: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    by_parameter: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    degenerate: tuple[str, ...] = ()
    reason: str = ""

    @property
    def solution(self) -> Solution:
        """The trajectory; of a return map that to the last return."""
        return self.runs[-1]

    @property
    def by_legs(self) -> tuple[tuple[Solution, ...], ...]:
        """The runs of each leg: one, unless a leg is run through in several."""
        return tuple((run,) for run in self.runs)

    @property
    def word(self) -> Word:
        """The events on the way: (switch, kind, "from to to") of each."""
        return tuple(letter for run in self.runs for letter in word_of(run))

    @property
    def success(self) -> bool:
        """Whether the trajectory reached the section again."""
        return bool(np.isfinite(self.x).all())


@dataclass(frozen=True)
class _Map:
    """What both maps share: the system, and how its trajectories are solved."""

    system: Any
    options: Mapping[str, Any] = field(default_factory=dict, kw_only=True)
    scale: Scale | None = field(default=None, repr=False, compare=False, kw_only=True)
    angles: tuple[float, ...] | None = field(default=None, repr=False, compare=False, kw_only=True)
    _inner: Scratch = field(default_factory=Scratch, repr=False, compare=False, kw_only=True)

    def _solve(
        self, system: Any, span: tuple[float, float], x: Any, dense: bool, times: Any = None
    ) -> Solution:
        """A run behind the door, of the map's system or one made of it."""
        options: Any = tuple(self.options.items())
        try:
            hash(options)
        except TypeError:
            options = id(self.options)
        # The model and the options are kept along with the run.
        key = id(system.model), options, self.scale, dense
        if key not in self._inner:
            run = behind_the_door(system, dense_output=dense, **self._tight(system))
            self._inner[key] = run, system.model, self.options
        return self._inner[key][0](system, span, list(map(float, x)), times)

    def _tight(self, system: Any) -> dict[str, Any]:
        """Options of the map's runs."""
        rtol, atol = (1e-10, 1e-12) if system.model.smoothing else (1e-12, 1e-14)
        chosen: dict[str, Any] = {"rtol": rtol, "atol": atol}
        if self.scale is not None and len(self.scale.tolerance) == len(system.model.states):
            chosen["atol"] = tuple(atol * size for size in self.scale.tolerance)
        return {**chosen, **self.options}

    @property
    def unit(self) -> np.ndarray:
        """Sizes of the states against which deviations are measured, shape (n,)."""
        return np.ones(len(self.system.model.states)) if self.scale is None else np.array(self.scale.unit)

    def within_a_turn(self, x: np.ndarray, of: np.ndarray) -> np.ndarray:
        """The same states with angles less than half a turn from those of others.

        Parameters
        ----------
        x : ndarray, shape (n,)
            The states, in their units.
        of : ndarray, shape (n,)
            The others, in the units of the states.

        Returns
        -------
        ndarray, shape (n,)
            In the units of the states.
        """
        if self.angles is None:
            return x
        turn = np.array(self.angles)
        return x - turn * np.round((x - of) / np.where(turn > 0, turn, 1.0))

    @property
    def tolerance(self) -> np.ndarray:
        """Absolute tolerances of the runs, shape (n,), in the units of the states."""
        return np.broadcast_to(self._tight(self.system)["atol"], len(self.system.model.states))

    def fitted(self, image: Image, before: np.ndarray | None = None) -> Any:
        """The same map with the units of the states along an image that has derivatives.

        Parameters
        ----------
        image : Image
            Of a point of the orbit, or of a first guess.
        before : ndarray, shape (n,), optional
            How far each state moved on the way here, in its unit.

        Returns
        -------
        Stroboscopic or Section
            This one where they are its units already.
        """
        scale = scale_along(image.runs, image.jacobian, self.scale, before)
        if scale == self.scale:
            return self
        return self._with(scale=scale)

    def careful(self, runs: Sequence[Solution]) -> Any:
        """The same map with tolerances that suit how small populations become along runs.

        Parameters
        ----------
        runs : sequence of Solution
            Of this map.

        Returns
        -------
        Stroboscopic or Section
            This one where no state asks for smaller ones.
        """
        scale = scale_of_populations(runs, self.scale)
        return self if scale == self.scale else self._with(scale=scale)

    def tighter(self) -> Any:
        """The same map with runs at a tenth of the relative tolerance.

        Returns
        -------
        Stroboscopic or Section
            What is an orbit of one is an orbit of the other, but for the tolerances.
        """
        return self._with(options={**self.options, "rtol": 0.1 * self._tight(self.system)["rtol"]})

    def _with(self, **fields: Any) -> Any:
        """The same map with other fields that need no checks."""
        other = copy.copy(self)
        for name, value in fields.items():
            object.__setattr__(other, name, value)
        return other

    def with_parameters(self, values: Mapping[Any, float]) -> Any:
        """The same map of the system with other parameter values.

        Parameters
        ----------
        values : mapping of (Symbol or str) to float, in the units of the model
            Those that change.

        Returns
        -------
        Stroboscopic or Section
            Of the same kind as this one.
        """
        other = copy.copy(self)  # nothing of what __post_init__ checks or makes depends on values
        object.__setattr__(other, "system", self.system.with_parameters(values))
        return other

    def __call__(self, x: Any) -> np.ndarray:
        """P(x), shape (n,); nan where the trajectory fails or does not come back."""
        return self.image(self.system.initial_state(x)).x

    def image(self, x: Any, parameters: Sequence[Any] | None = None) -> Image:
        """Image of a point, with derivatives if `parameters` is given (it may be empty).

        Parameters
        ----------
        x : ndarray, shape (n,)
            The point, in the units of the states.
        parameters : sequence of str or Symbol, optional
            With respect to which is differentiated too.

        Returns
        -------
        Image
            With nan where the trajectory failed or did not come back.

        Raises
        ------
        ValueError
            A parameter that the system does not have.
        """
        raise NotImplementedError

    def leg(self, x: Any, leg: Leg, parameters: Sequence[Any] | None = None) -> Image:
        """The flow over a leg, for a time or to the next return; of a symmetry it knows nothing.

        Parameters
        ----------
        x : ndarray, shape (n,)
            Its beginning, in the units of the states.
        leg : tuple of (int, float, float)
            Which application of the map, and from where to where in it, in units of `beat`.
        parameters : sequence of str or Symbol, optional
            As of `image`.

        Returns
        -------
        Image
            Its end. The beginning of an application is put onto the constraints of a mechanism.
        """
        if not (self.system._constraints and self._begins(leg)):
            return self._leg(x, leg, parameters)
        chosen = chosen_parameters(self.system, parameters or ())
        start, by_x, by_parameter = on_constraints(self.system, *self._section_at(x), chosen)
        image = self._leg(start, leg, parameters)
        if parameters is None or not image.success:
            return image
        return replace(
            image,
            jacobian=image.jacobian @ by_x,
            by_parameter=image.by_parameter + image.jacobian @ by_parameter,
        )

    def _begins(self, leg: Leg) -> bool:
        """Whether a leg begins on the section."""
        raise NotImplementedError

    def _section_at(self, x: Any) -> tuple[float, np.ndarray, np.ndarray | None]:
        """(time, point, gradient of the section's surface there or None)."""
        raise NotImplementedError

    def _leg(self, x: Any, leg: Leg, parameters: Sequence[Any] | None) -> Image:
        raise NotImplementedError

    def closed(self, image: Image) -> Image:
        """The end of the last leg, as the map gives it: seen through the symmetry where there is one.

        Parameters
        ----------
        image : Image
            The end.

        Returns
        -------
        Image
            On the section.
        """
        raise NotImplementedError

    def doubled(self) -> Any:
        """The map over twice as long: twice as many periods or returns; a half period becomes a whole one.

        Returns
        -------
        Stroboscopic or Section
            Of the same kind as this one.
        """
        this: Any = self
        return replace(this, count=2 * this.count)

    @checks.door((*calls.RUNS, "dense_output", "t_eval"))
    def over(self, x: Any, time: float, **options: Any) -> Solution:
        """The trajectory of a point of the section over a time.

        Parameters
        ----------
        time : float, in the unit of the model's time
            How long.
        **options
            For `solve`, besides those of the map.

        Returns
        -------
        Solution
            Without dense output, unless asked for.
        """
        t0 = getattr(self, "start_time", 0.0)
        chosen = {**self._tight(self.system), **options}
        return solve(self.system, (t0, t0 + time), list(map(float, x)), **chosen)

    def _over(self, x: Any, time: float, dense: bool = False, times: Any = None) -> Solution:
        """The same behind the door."""
        t0 = getattr(self, "start_time", 0.0)
        return self._solve(self.system, (t0, t0 + time), x, dense, times)

    @checks.door(**_COUNTS)
    @whole
    def iterate(self, x: Any, count: int, discard: int = 0) -> np.ndarray:
        """The points P(x), P(P(x)), ... after the first `discard`.

        Parameters
        ----------
        x : mapping or sequence of float, length n
            The first point, in the units of the states.
        count : int
            How many are kept.
        discard : int
            How many before them are not.

        Returns
        -------
        ndarray, shape (count, n)
            In the units of the states; nan from a failure on.
        """
        return self._iterated(x, count, discard)[0]

    def _iterated(self, x: Any, count: int, discard: int = 0) -> tuple[np.ndarray, str]:
        """The points of `iterate`, and why they end where they do before `count`."""
        at = np.array(self.system.initial_state(x), float)
        points = np.full((count, len(at)), np.nan)
        for k in range(discard + count):
            image = self.image(at)
            if not image.success:
                return points, image.reason
            at = image.x
            if k >= discard:
                points[k - discard] = at
        return points, ""


def lost(n: int, runs: tuple[Solution, ...], reason: str) -> Image:
    return Image(np.full(n, np.nan), math.nan, runs, reason=reason)


def why_stopped(run: Solution) -> str:
    """What ended a run before its time, in words."""
    where = f"at t = {run.t[-1]:.9g} "
    if run.outcome is Outcome.TERMINATED:
        name = next(e.switch for e in reversed(run.events) if e.kind == "terminal")
        return f"{where}the terminal event {name!r} stopped it."
    return f"{where}it ended, {run.message}"


@checks.door(solution=checks.instance(Solution, "a Solution, as solve() gives it"))
def word_of(solution: Solution) -> Word:
    """The events of a solution after its start: its itinerary in letters.

    Parameters
    ----------
    solution : Solution
        Event-driven.

    Returns
    -------
    tuple of (str, str, str)
        (switch, kind, from and to) of each event.

    >>> x = sp.Symbol("x", real=True)
    >>> word_of(solve(System({x: 1 + sp.Heaviside(x - 1)}), (0, 2), {x: 0}))
    (('sgn(x - 1)', 'crossing', '-1 to +1'),)
    """
    begin = after_start(solution)
    return tuple((e.switch, e.kind, e.note) for e in solution.events if e.time > begin and e.switch != RETURN)


def after_start(solution: Solution) -> float:
    """A time just after the start: a start that sticks, but for a rounding of its velocity, is no event."""
    first, length = float(solution.t[0]), float(solution.t[-1] - solution.t[0])
    return first + 1e-11 * (unit_of(length) + abs(first))
