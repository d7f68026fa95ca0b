"""Periodic orbits as fixed points of Poincare maps, by Newton's method with the map's exact derivative.

    F(x) = P(x) - x = 0,    (D P - 1) dx = -F;     Floquet multipliers: eigenvalues of D P

D P comes from the variational equations and saltation matrices (variations.py). A stick makes it singular, which does
no harm: only an eigenvalue 1 of D P does. For the half-period map N of a symmetric orbit the multipliers of the
whole period are the squares of those of N, and -1 is where the symmetry breaks.

An orbit whose deviations grow too much to be shot over in one piece takes segments (segments.py): x is then all
points at which these begin, P their shift map, and Newton's method the same.

Chain: sections.py, segments.py -> **orbits** -> continuation.py.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..definition import checks, pointwise
from ..definition.describe import Described, Rows, listed, number, some, values
from ..paths.budget import whole
from ..results.solution import Solution
from ..solve import solve
from .multipliers import cyclic_multipliers
from .poincare import Image, why_stopped
from .sections import LONGEST, Section, Stroboscopic, Word, depends_on_time, poincare_map
from .segments import SHORT, TOO_LONG, Segments, Shooting, cut, growth, sizes

__all__ = ["PeriodicOrbit", "find_orbit", "refine"]

TOLERANCE = 1e-11  # of the return, relative to the states' size: a few roundings of a period
_ROUNDINGS = 1e-3  # times TOLERANCE: returns of one x scatter by some ten roundings of it, times their growth
_MOST_STEPS = 30
PINNED = 1e-12  # of a row of the map's Jacobian: rounding
MULTIPLIERS = 1e-9  # to which multipliers are known, with something to spare
SAME = 1e-6  # relative to the states' size: nearer together two points are one, converged to TOLERANCE or not quite
_REPEATED = 1e3  # times the tolerance of the runs: what they differ by in one period and in the next
_GROWS = 1e2  # over a period
_NEAR = 1e-2  # relative to the states' size: an orbit so near to the first guess is the one that was meant
_FEWEST = 8  # segments that begin at one guess
_RECURRENCE = 1e-5  # a transient that returns so closely is near a periodic orbit


@dataclass(frozen=True, repr=False)
class PeriodicOrbit(Described):
    """A periodic orbit, or the best that Newton's method reached (`success` False, `message` why).

    Attributes
    ----------
    map : Stroboscopic or Section
        The Poincare map of which `x` is a fixed point, with the system and its parameters.
    x : ndarray, shape (n,)
        The point on the section, in the units of the states.
    residual : float, dimensionless
        Largest |P(x) - x|, relative to 1 + |x| (and to 1e-3 |D P| |x|: what roundings of x grow to counts little).
    jacobian : ndarray, shape (n, n)
        D P at x (of the half-period map where `map` has a symmetry), in the units of the states; with segments the
        product of their matrices.
    word : tuple
        Events of one application of the map: (switch, kind, "from to to").
    time : float, in the unit of the model's time
        That one application takes.
    steps : int
        Of Newton's method.
    success : bool
        Whether it converged, and repeats in the period that follows.
    message : str
        In words, with what to try next; also where the orbit is not isolated, or shorter than was asked for.
    degenerate : tuple of str
        Where the map has no derivative at this orbit (grazing, corners).
    segments : Segments or None
        How it was shot over, where deviations grow too much for one piece.

    Examples
    --------
    The orbit of dx/dt = cos t - x has the multiplier exp(-2 pi):

    >>> import math
    >>> import sympy as sp
    >>> from pwsmooth import System, find_orbit
    >>> t, x = sp.symbols("t x", real=True)
    >>> orbit = find_orbit(System({x: sp.cos(t) - x}, time=t), {x: 0}, period=2 * sp.pi)
    >>> print(f"{orbit.start['x']:.9f} {orbit.multipliers[0].real:.9f} {math.exp(-2 * math.pi):.9f}")
    0.500000000 0.001867443 0.001867443
    """

    map: Stroboscopic | Section
    x: np.ndarray
    residual: float
    jacobian: np.ndarray
    word: Word
    time: float
    steps: int
    success: bool
    message: str
    degenerate: tuple[str, ...] = ()
    segments: Segments | None = None

    @property
    def system(self) -> Any:
        """The system, with the orbit's parameter values."""
        return self.map.system

    @property
    def symmetric(self) -> bool:
        """Whether it was found as a fixed point of the half-period map."""
        return getattr(self.map, "symmetry", None) is not None

    @property
    def period(self) -> float:
        """Period of the orbit, in the unit of the model's time."""
        return 2 * self.time if self.symmetric else self.time

    @functools.cached_property
    def map_multipliers(self) -> np.ndarray:
        """Eigenvalues of D P on the section, largest first; of the half-period map for a symmetric orbit."""
        if not np.isfinite(self.jacobian).all():
            return np.full(len(self.x), np.nan, complex)
        matrices = [self.jacobian] if self.segments is None else list(self.segments.matrices)
        if isinstance(self.map, Section):
            # Tangent to the section: the direction across it would only add an eigenvalue 0.
            normal = self.map.gradient(self.x)
            basis = np.linalg.svd(normal[None])[2][1:].T
            matrices[0] = matrices[0] @ basis
            matrices[-1] = basis.T @ matrices[-1]
        if len(matrices) > 1:
            return cyclic_multipliers(matrices)
        values = np.linalg.eigvals(matrices[0]).astype(complex)
        return values[np.argsort(-np.abs(values), kind="stable")]

    @property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers over `period`, largest first, without the 1 of an autonomous flow."""
        return self.map_multipliers**2 if self.symmetric else self.map_multipliers

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle, by more than their own rounding."""
        return bool(np.all(np.abs(self.multipliers) < 1 - MULTIPLIERS))

    @property
    def isolated(self) -> bool:
        """Whether no multiplier of the map is 1: where one is, orbits beside it may be periodic too."""
        return not np.any(np.abs(self.map_multipliers - 1) <= MULTIPLIERS)

    @property
    def start(self) -> dict[str, float]:
        """State on the section by name, as `solve` takes it."""
        return {str(s): float(value) for s, value in zip(self.system.model.states, self.x)}

    def after(self, applications: int) -> np.ndarray:
        """The orbit after some periods (returns) of its `count`.

        Parameters
        ----------
        applications : int
            How many, 1 to `count`.

        Returns
        -------
        ndarray, shape (n,)
            On the section, in the units of the states.
        """
        if self.segments is not None:
            firsts = Shooting(self.map, self.segments.cuts).firsts
            return self.segments.nodes[firsts[applications % len(firsts)]]
        return replace(self.map, count=applications).image(self.x).x

    def runs(self, dense_output: bool = False) -> tuple[Solution, ...]:
        """One whole period as it was shot over: a run for each segment, of a symmetric orbit for both halves.

        Parameters
        ----------
        dense_output : bool
            Whether they have it.

        Returns
        -------
        tuple of Solution
            In order of time; of a return map the time of each begins anew.
        """
        if self.segments is None:
            return (self.map.over(self.x, self.period, dense_output=dense_output),)
        return tuple(run for _, run in self._legs(0, dense_output))

    def _legs(self, periods: int, dense_output: bool = False) -> Iterator[tuple[np.ndarray, Solution]]:
        """The segments of the orbit so many periods later: what each should end at, and its run."""
        assert self.segments is not None
        map_: Any = self.map
        nodes = self.segments.nodes
        legs = Shooting(map_, self.segments.cuts).legs
        halves = [np.eye(len(self.x)), map_.symmetry] if self.symmetric else [np.eye(len(self.x))]
        for half, seen in enumerate(halves):
            moved = half + periods * len(halves) * map_.turns
            targets = [*nodes[1:] @ seen.T, (halves[half - 1] if self.symmetric else seen) @ nodes[0]]
            for x, target, (k, begin, end) in zip(nodes @ seen.T, targets, legs):
                yield target, map_.leg(x, (k + moved, begin, end), () if dense_output else None).runs[0]

    @checks.door(periods=checks.integer(1, 10**9))
    def solution(self, periods: int = 1, **options: Any) -> Solution:
        """The orbit over whole periods.

        Parameters
        ----------
        periods : int
            How many.
        **options
            For `solve`.

        Returns
        -------
        Solution
            With dense output.

        Notes
        -----
        One run, which leaves the orbit as fast as its multipliers say: for those of 1e8 and more take `runs`.
        """
        t0 = self.map.start_time if isinstance(self.map, Stroboscopic) else 0.0
        chosen = {"rtol": 1e-10, "dense_output": True, **self.map.options, **options}
        return solve(self.system, (t0, t0 + periods * self.period), list(map(float, self.x)), **chosen)

    def _described(self) -> tuple[str, Rows]:
        unstable = np.any(np.abs(self.multipliers) > 1 + MULTIPLIERS)
        holds = {"stable": self.stable, "unstable": unstable, "neutral": self.isolated, "not isolated": True}
        kind = ("symmetric " if self.symmetric else "") + next(word for word in holds if holds[word])
        pieces = (
            f", in {len(self.segments)} segments"
            if self.segments is not None and len(self.segments) > 1
            else ""
        )
        told = self.message.startswith("no orbit")
        missing = f"N{self.message[1:]}" if told else f"No orbit: {self.message}"
        return f"PeriodicOrbit: {kind}, period {self.period:.9g}{pieces}" if self.success else missing, {
            "at": values(self.start, self.x),
            "multipliers": listed(list(map(number, self.multipliers))),
            "events": [" | ".join(some([kind for _, kind, _ in self.word])) or "none"],
            "message": [self.message] if self.success else [],
            "degenerate": list(self.degenerate),
        }.items()


@checks.door(
    system=checks.system, direction=checks.one_of(1, -1), count=checks.optional(checks.integer(1)), phase=checks.number,
    symmetry=checks.optional(checks.mapping), transient=checks.integer(0, 10**7), most=checks.integer(1),
    segments=checks.optional(checks.integer(1, 10**4)),
)  # fmt: skip
@whole
def find_orbit(
    system: Any,
    x0: Any,
    *,
    period: Any = None,
    section: Any = None,
    direction: int = 1,
    count: int | None = None,
    phase: float = 0.0,
    symmetry: Mapping[Any, Any] | None = None,
    transient: int = 0,
    most: int = 16,
    segments: int | None = None,
    **options: Any,
) -> PeriodicOrbit:
    """Find a periodic orbit near a start: after a transient, Newton's method on the Poincare map.

    Parameters
    ----------
    system : System
        Event-driven or smoothed.
    x0 : mapping or sequence of float, length n
        First guess, on the section or not, in the units of the states.
    period : float or Expr, in the unit of the model's time
        Of the forcing; or
    section : Expr
        A surface, function of states, for an autonomous system.
    direction : {1, -1}
        The section is crossed with its function rising or falling.
    count : int, optional
        Forcing periods (returns) of the orbit; found from the transient if not given, 1 without a transient.
    phase : float, dimensionless
        The section is t = phase*period; choose one at which nothing switches or sticks.
    symmetry : mapping of state to Expr, optional
        (x, t) -> (G x, t + T/2): finds symmetric orbits, also unstable ones, through half a period.
    transient : int
        Applications of the map before Newton's method starts.
    most : int
        Longest orbit looked for in the transient, in applications of the map.
    segments : int, optional
        In how many pieces a period is shot over; by default in one, and in as many as their growth asks for where a
        multiplier exceeds 1e4 or one piece does not lead to the orbit.
    **options
        For `solve`; `max_steps` and `max_seconds` bound the whole search.

    Returns
    -------
    PeriodicOrbit
        With `success` False and a `message` where none was found: also where the point returns after one period but
        not after the next, as with a memory that counts on. One that repeats sooner than after `count` has its own.

    Raises
    ------
    ValueError, TypeError
        Bad input; neither or both of `period` and `section`.

    Notes
    -----
    Newton's method with the exact derivative of the map (variations.py).

    Source: U. Ascher, R. Mattheij, R. Russell, Numerical Solution of Boundary Value Problems for ODEs (1995), ch. 4,
    for segments.

    Examples
    --------
    Den Hartog's oscillator, forced and with Coulomb friction:

    >>> import sympy as sp
    >>> from pwsmooth import System, find_orbit
    >>> t, x, v = sp.symbols("t x v", real=True)
    >>> dry = System({x: v, v: sp.sin(sp.Rational(2, 3)*t) - x - sp.sign(v)/4}, time=t)
    >>> orbit = find_orbit(dry, {x: 1, v: 0.5}, period=3*sp.pi, symmetry={x: -x, v: -v})
    >>> orbit.success, len(orbit.word)
    (True, 1)
    """
    if section is not None and symmetry is not None:
        raise ValueError("`symmetry` belongs to forced systems, together with `period`; leave it out.")
    more = {} if section is not None else {"phase": phase, "symmetry": symmetry}
    first = poincare_map(system, period, section, direction, LONGEST, options, count=count or 1, **more)
    at = np.array(system.initial_state(x0), float)
    if section is not None:
        # The guess need not lie on the section: the first return does.
        reached = first.image(at)
        if not reached.success:
            return none_found(first, at, f"from the first guess no return: {reached.reason}")
        at = reached.x
    if transient:
        points, reason = first._iterated(at, transient + 1)
        if reason:
            last = np.flatnonzero(np.isfinite(points).all(axis=1))
            at = points[last[-1]] if last.size else at
            return none_found(first, at, f"the transient ended after {last.size} of {transient}: {reason}")
        at = points[-1]
        if count is None and symmetry is None:
            first = replace(first, count=_recurrence(points, most))
    return _refined(first, at, segments)


def _recurrence(points: np.ndarray, most: int) -> int:
    """After how many steps the last point has been nearest before; 1 if never near."""
    size = 1 + np.abs(points[-1])
    back = np.array(
        [np.abs((points[-1] - points[-1 - k]) / size).max() for k in range(1, min(most, len(points) - 1) + 1)]
    )
    near = np.flatnonzero(back < _RECURRENCE)
    return int(near[0]) + 1 if near.size else 1


def none_found(map_: Any, x: np.ndarray, message: str) -> PeriodicOrbit:
    n = len(x)
    return PeriodicOrbit(map_, x, np.inf, np.full((n, n), np.nan), (), np.nan, 0, False, message)


@checks.door(map_=checks.instance((Stroboscopic, Section), "a Stroboscopic or Section"))
@whole
def refine(map_: Stroboscopic | Section, x0: Any) -> PeriodicOrbit:
    """Newton's method from a point on the section; the step is shortened while the return does not improve.

    Parameters
    ----------
    map_ : Stroboscopic or Section
        The Poincare map.
    x0 : mapping or sequence of float, length n
        First guess, in the units of the states.

    Returns
    -------
    PeriodicOrbit
        With `success` False and a `message` where it did not converge.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System
    >>> from pwsmooth.analysis.orbits import refine
    >>> from pwsmooth.analysis.sections import Stroboscopic
    >>> t, x = sp.symbols("t x", real=True)
    >>> orbit = refine(Stroboscopic(System({x: sp.cos(t) - x}, time=t), 2 * sp.pi), {x: 3})
    >>> orbit.success, round(float(orbit.x[0]), 9)
    (True, 0.5)
    """
    return _refined(map_, np.array(map_.system.initial_state(x0), float))


def _refined(map_: Stroboscopic | Section, x: np.ndarray, number: int | None = None) -> PeriodicOrbit:
    """The orbit near a point: shot over in one piece if it can be and nothing else is asked for."""
    image = map_.image(x, ())
    if number is not None and number > 1:
        return _checked(_in_segments(map_, x, number))
    if not image.success:
        return none_found(map_, x, f"the trajectory from the first guess did not return: {image.reason}")
    orbit = _newton(map_, x, image)
    if number is not None:
        return _checked(orbit)
    moved = _distance(orbit.x, x) if orbit.success else math.inf
    if moved > _NEAR and _leaves(x, image):
        other = _in_segments(map_, x, None)
        if other.success and _distance(other.x, x) < moved:
            return _checked(_in_one_piece(other) or other)
    if orbit.success and np.abs(orbit.map_multipliers).max(initial=0.0) > TOO_LONG:
        other = _in_segments(map_, orbit.x, None)
        orbit = other if other.success else orbit
    return _checked(orbit)


def _distance(a: np.ndarray, b: np.ndarray) -> float:
    """Of two points, relative to the states' size."""
    return float(np.abs((a - b) / (1 + np.abs(b))).max(initial=0.0))


def _leaves(x: np.ndarray, image: Image) -> bool:
    """Whether deviations grow so much that Newton's method in one piece follows the trajectory to wherever it goes."""
    if not np.abs(image.jacobian).max(initial=0.0) > _GROWS:
        return False
    return growth(image.jacobian, sizes(image.runs)) > _GROWS


def _in_one_piece(orbit: PeriodicOrbit) -> PeriodicOrbit | None:
    """The orbit without segments, where its multipliers do not ask for them."""
    if np.abs(orbit.map_multipliers).max(initial=0.0) > SHORT:
        return None
    image = orbit.map.image(orbit.x, ())
    whole = _newton(orbit.map, orbit.x, image) if image.success else orbit
    near = _distance(whole.x, orbit.x) <= SAME
    return replace(whole, steps=orbit.steps, message=orbit.message) if whole.success and near else None


def shot(shooting: Shooting, X: np.ndarray, kept: tuple[bool, bool] = (False, False)) -> PeriodicOrbit:
    """Newton's method from points at which segments begin."""
    image = shooting.image(X, ())
    if not image.success:
        return none_found(
            shooting.map, X[: len(X) // shooting.number], f"a segment did not end: {image.reason}"
        )
    return _newton(shooting, X, image, kept)


def _in_segments(map_: Stroboscopic | Section, x: np.ndarray, number: int | None) -> PeriodicOrbit:
    """The orbit near a point, in segments that begin along the trajectory from there, or all at the point itself."""
    whole, X = Shooting(map_, ((),) * map_.turns), x
    for _ in range(map_.turns - 1):
        X = np.append(X, replace(map_, count=1).image(X[-len(x) :]).x)
    image = whole.image(X, ())
    if not image.success:
        return none_found(map_, x, f"the trajectory from the first guess did not return: {image.reason}")
    guesses: list[tuple[Shooting, np.ndarray, Image, tuple[bool, bool]]] = []
    for many in (number, number or max(_FEWEST, _grown(whole, image))):
        if (new := cut(whole, X, image, number=many)) is None:
            return none_found(map_, x, "the trajectory from the first guess cannot be cut into segments.")
        cuts, nodes, _, held = new
        shooting = Shooting(map_, cuts)
        nodes = nodes if not guesses else np.tile(x, shooting.number)
        guesses.append((shooting, nodes, shooting.image(nodes, ()), (number is not None, held)))
    begun = [guess for guess in guesses if guess[2].success]
    orbit = none_found(map_, x, "the segments from the first guess do not end.")
    for shooting, nodes, image, kept in sorted(begun, key=lambda guess: _off(guess[1], guess[2])[1]):
        orbit = _newton(shooting, nodes, image, kept)
        if orbit.success:
            return orbit if number is not None else _cut_anew(orbit)
    return orbit


def _grown(whole: Shooting, image: Image) -> int:
    """How many segments a trajectory asks for."""
    size = sizes(image.runs)
    return math.ceil(sum(math.log10(max(1.0, growth(A, size))) for A in whole.matrices(image.jacobian)))


def _cut_anew(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """An orbit in segments that suit it, after those that suited the first guess."""
    assert orbit.segments is not None
    shooting, X = Shooting(orbit.map, orbit.segments.cuts), orbit.segments.nodes.ravel()
    new = cut(shooting, X, shooting.image(X, ()))
    if new is None:
        return orbit
    cuts, X, _, held = new
    other = shot(Shooting(orbit.map, cuts), X, (False, held))
    return replace(other, steps=orbit.steps, message=orbit.message) if other.success else orbit


def _newton(
    map_: Stroboscopic | Section | Shooting,
    x: np.ndarray,
    image: Image,
    kept: tuple[bool, bool] = (False, False),
) -> PeriodicOrbit:
    off, size = _off(x, image)
    steps = 0
    while size > TOLERANCE and steps < _MOST_STEPS:
        slope, step = image.jacobian - np.eye(len(x)), np.zeros(len(x))
        # A component that the map leaves at its start (a memory that events put back) keeps the first guess.
        free = (off != 0) | (np.abs(slope).max(axis=1) > PINNED)
        step[free] = np.linalg.lstsq(slope[:, free], -off, rcond=1e-13)[0]
        # One that returns exactly from every start nearby (v = 0 in a stick) stays: rounding would leave the surface.
        step[(off == 0) & (np.abs(image.jacobian).max(axis=1) <= PINNED)] = 0.0
        closer = _shortened(map_, x, step, size)
        if closer is None:
            break
        x, image = closer
        off, size = _off(x, image)
        steps += 1
    success = size <= TOLERANCE
    message = f"Newton's method converged in {steps} steps."
    if not success:
        message = (
            f"Newton's method stopped after {steps} steps, |P(x) - x| = {size:.2g}: give a guess nearer to the "
            "orbit, a `transient`, or another `phase`."
        )
    return orbit_of(map_, x, image, size, steps, success, message, kept)


def orbit_of(
    map_: Any,
    x: np.ndarray,
    image: Image,
    size: float,
    steps: int,
    success: bool,
    message: str,
    kept: tuple[bool, bool] = (False, False),
) -> PeriodicOrbit:
    """The orbit of a fixed point of a Poincare map, or of the shift map of its segments."""
    if not isinstance(map_, Shooting):
        return PeriodicOrbit(
            map_, x, size, image.jacobian, image.word, image.time, steps, success, message, image.degenerate
        )
    matrices, nodes = map_.matrices(image.jacobian), x.reshape(map_.number, -1)
    product = functools.reduce(lambda total, matrix: matrix @ total, matrices)
    return PeriodicOrbit(
        map_.map, nodes[0], size, product, image.word, image.time, steps, success, message, image.degenerate,
        Segments(map_.cuts, nodes, matrices, *kept),
    )  # fmt: skip


def _checked(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """A converged orbit with what is to be said of it: that it does not repeat, is shorter, or not isolated."""
    if not orbit.success:
        return orbit
    if broken := not_repeated(orbit):
        return replace(orbit, success=False, message=broken)
    map_, count = orbit.map, repeats_after(orbit)
    if count < map_.count:
        shorter = refined_to(orbit, count)
        said = f" It repeats after {count} of the {map_.count} applications of the map that were asked for."
        return replace(shorter, message=shorter.message + said) if shorter.success else orbit
    if not orbit.isolated:
        return replace(orbit, message=f"{orbit.message} {_NOT_ISOLATED}")
    return orbit


def refined_to(orbit: PeriodicOrbit, count: int, x: np.ndarray | None = None) -> PeriodicOrbit:
    """The orbit of `count` applications of the map near to the first ones of an orbit (or near to a point x)."""
    map_ = replace(orbit.map, count=count)
    if orbit.segments is None:
        return _refined(map_, orbit.x if x is None else x)
    shorter = Shooting(map_, orbit.segments.cuts[:count])
    nodes = orbit.segments.nodes[: shorter.number].copy()
    if x is not None:
        nodes[0] = x
    return _checked(shot(shorter, nodes.ravel(), orbit.segments.kept))


_NOT_ISOLATED = (
    "It is not isolated: a multiplier is 1, so that orbits beside it are periodic too (then this is the one that the "
    "first guess led to), or it is at a fold or a branch point."
)


def not_repeated(orbit: PeriodicOrbit) -> str:
    """What does not repeat in the period that follows, in words with a remedy; empty if all does.

    The map begins each time at its own start time and from states alone: a memory that counts on, a time that the
    period does not fit, and the branch of a layer are unknown to it.
    """
    map_, x = orbit.map, orbit.x
    if isinstance(map_, Section):
        return ""
    if orbit.segments is not None:
        return _not_repeated_in_segments(orbit)
    times = map_.start_time + orbit.period * np.array([1.0, 2.0])
    run = map_.over(x, 2 * orbit.period, t_eval=times)
    if len(run.t) < 2 or run.t[-1] < times[-1]:
        return f"the orbit closes after one period, but is not run through in the next: {why_stopped(run)}"
    growth = np.linalg.norm(orbit.jacobian) ** (2 if orbit.symmetric else 1)
    slack = _REPEATED * max(run.tolerances["rtol"], TOLERANCE) * (1 + growth)
    off = np.abs(run.x - x[:, None]).max(axis=1) / (1 + np.abs(x))
    moved = np.flatnonzero(off > (math.sqrt(slack) if orbit.degenerate else slack))
    if not moved.size:
        return ""
    return _why_not_repeated(orbit, moved, off[moved], x, run.x)


def _not_repeated_in_segments(orbit: PeriodicOrbit) -> str:
    """The same, segment by segment."""
    matrices = orbit.segments.matrices  # type: ignore[union-attr]
    for k, (target, run) in enumerate(orbit._legs(1)):
        slack = (
            _REPEATED
            * max(run.tolerances["rtol"], TOLERANCE)
            * (1 + np.linalg.norm(matrices[k % len(matrices)]))
        )
        off = np.abs(run.x[:, -1] - target) / (1 + np.abs(target))
        moved = np.flatnonzero(~(off <= (math.sqrt(slack) if orbit.degenerate else slack)))
        if moved.size:
            return _why_not_repeated(orbit, moved, off[moved], target, np.stack([run.x[:, -1]] * 2, axis=1))
    return ""


def _why_not_repeated(
    orbit: PeriodicOrbit, moved: np.ndarray, off: np.ndarray, x: np.ndarray, later: np.ndarray
) -> str:
    names = orbit.system.model.states
    memories = moved[moved >= len(names) - orbit.system.model.n_memory]
    k = int(memories[0]) if memories.size else int(moved[np.argmax(off)])
    if memories.size:
        why = (
            "this memory goes on from period to period; let it hold what repeats, as the time since an event does (a "
            "state of rate 1 that the event puts to 0)"
        )
    elif depends_on_time(orbit.system.model):
        why = "the system reads the time in another way than with this period; give the period of all that it reads"
    else:
        why = "it slides on another branch of the layer than the map begins with; choose another `phase`"
    return (
        f"no orbit of period {orbit.period:.9g}: {names[k]} is {x[k]:.9g} at first, then {later[k, 0]:.9g} and "
        f"{later[k, 1]:.9g}, one and two periods later: {why}."
    )


def repeats_after(orbit: PeriodicOrbit) -> int:
    """After how many of its map's `count` applications an orbit is back: a divisor of it."""
    count = orbit.map.count
    if count == 1:
        return 1
    if orbit.segments is None:
        points = replace(orbit.map, count=1).iterate(orbit.x, count)
    else:
        points = np.array([orbit.after(k) for k in range(1, count + 1)])
    back = np.abs((points - orbit.x) / (1 + np.abs(orbit.x))).max(axis=1) <= SAME
    return next((d for d in range(1, count) if count % d == 0 and back[d - 1]), count)


def _off(x: np.ndarray, image: Image) -> tuple[np.ndarray, float]:
    off = image.x - x
    return off, relative(off, x, image)


def relative(off: np.ndarray, x: np.ndarray, image: Image) -> float:
    """The largest part of P(x) - x, relative to the states' size and to what roundings of them grow to."""
    size = 1 + np.abs(x) + _ROUNDINGS * (np.abs(image.jacobian) @ np.abs(x))
    return float(np.abs(off / size).max(initial=0.0))


def _shortened(map_: Any, x: np.ndarray, step: np.ndarray, size: float) -> tuple[np.ndarray, Image] | None:
    """The first of x + step, x + step/2, ... whose return is better; the whole step beside a corner of the map."""
    fallback = None
    for k in range(8):
        trial = x + step / 2**k
        trial = onto_section(map_, trial)
        image = map_.image(trial, ())
        if not image.success:
            continue
        new = _off(trial, image)[1]
        if new < size or new <= TOLERANCE:
            return trial, image
        # Across a change of itinerary the derivative is a different one: a step to a worse return may still lead on.
        if fallback is None and new < 10 * size:
            fallback = trial, image
    return fallback


def onto_section(map_: Any, x: np.ndarray) -> np.ndarray:
    """x moved onto the section of a return map along its gradient, shape (n,); of segments the points after returns."""
    if isinstance(map_, Shooting) and isinstance(map_.map, Section):
        nodes = x.reshape(map_.number, -1).copy()
        for k in map_.firsts:
            nodes[k] = onto_section(map_.map, nodes[k])
        return nodes.ravel()
    if not isinstance(map_, Section):
        return x
    states = map_.system.model.states
    for _ in range(3):
        point = {**map_.system.parameters, **dict(zip(states, map(float, x)))}
        gradient = map_.gradient(x)
        x = x - gradient * pointwise.value(map_.surface, point) / (gradient @ gradient)
    return x
