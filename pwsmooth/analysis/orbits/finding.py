"""Periodic orbits near a start: after a transient, in one piece or in segments, checked to repeat.

An orbit whose deviations grow too much to be shot over in one piece takes segments (segments.py): x is then all
points at which these begin, P their shift map, and Newton's method the same.

Chain: periodic_orbit.py, fixed_points.py -> **orbits** -> continuation.py.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...door import calls, checks
from ...paths.budget import whole
from ..maps.poincare import Image
from ..maps.scales import extents, lowest, scale_at
from ..maps.sections import Section, Stroboscopic, poincare_map
from ..maps.seen import Return, Strobe, how_seen
from ..maps.segments import SHORT, TOO_LONG, Shooting, cut, growth, sizes
from ..maps.symmetry import turns_of
from .absence import why_none
from .fixed_points import SAME, newton, not_repeated, off_and_size, repeats_after, shot
from .integrals import with_integrals
from .orders import in_both_orders
from .periodic_orbit import PeriodicOrbit, none_found

__all__ = ["find_orbit", "refine"]

_GROWS = 1e2  # over a period
_NEAR = 1e-2  # relative to the states' size: an orbit so near to the first guess is the one that was meant
_FEWEST = 8  # segments that begin at one guess
_PART = 1e-6  # of a population: a larger absolute tolerance is worth a word
_RESTS = 1e-6  # of what the first return moved, between the last points of a transient
_COMES_TO_REST = " The motion comes to rest there, which is no orbit; find_equilibrium() finds the rest."
_RECURRENCE = 1e-5  # a transient that returns so closely is near a periodic orbit


@checks.door(
    (*calls.RUNS, "parameters"),
    system=checks.system, seen=how_seen, count=checks.optional(checks.integer(1)), transient=checks.integer(0, 10**7),
    max_count=checks.integer(1), segments=checks.optional(checks.integer(1, 10**4)),
    angles=checks.optional(checks.mapping),
)  # fmt: skip
@whole
def find_orbit(
    system: Any,
    x0: Any,
    seen: Strobe | Return,
    *,
    count: int | None = None,
    transient: int = 0,
    max_count: int = 16,
    segments: int | None = None,
    angles: Mapping[Any, float] | None = None,
    **options: Any,
) -> PeriodicOrbit:
    """Find a periodic orbit near a start: after a transient, Newton's method on the Poincare map.

    Parameters
    ----------
    system : System
        Event-driven or smoothed.
    x0 : mapping or sequence of float, length n
        First guess, on the section or not, in the units of the states.
    count : int, optional
        Forcing periods (returns) of the orbit; found from the transient if not given, 1 without a transient.
    transient : int
        Applications of the map before Newton's method starts.
    max_count : int
        Longest orbit looked for in the transient, in applications of the map.
    segments : int, optional
        In how many pieces a period is shot over; by default in one, and in as many as their growth asks for where a
        multiplier exceeds 1e4 or one piece does not lead to the orbit.
    angles : mapping of state to float, in the units of the states, optional
        Turns of states that are angles, as {x: 2*pi}: a motion is back that has gone whole turns, its `winding`.
    **options
        For `solve`: rtol, atol, method, order, max_step, strict, parameters; `max_steps` and `max_seconds` bound the
        whole search.

    Returns
    -------
    PeriodicOrbit
        With `success` False and a `message` where none was found: also where the point returns after one period but
        not after the next, as with a memory that counts on. One that repeats sooner than after `count` has its own.

    Raises
    ------
    ValueError, TypeError
        Bad input; `angles` together with a symmetry.

    Notes
    -----
    Newton's method with the exact derivative of the map (first_order.py).

    Source: U. Ascher, R. Mattheij, R. Russell, Numerical Solution of Boundary Value Problems for ODEs (1995), ch. 4,
    for segments.

    Den Hartog's oscillator, forced and with Coulomb friction:

    >>> t, x, v = sp.symbols("t x v", real=True)
    >>> dry = System({x: v, v: sp.sin(sp.Rational(2, 3)*t) - x - sp.sign(v)/4}, time=t)
    >>> orbit = find_orbit(dry, {x: 1, v: 0.5}, Strobe(3*sp.pi, symmetry={x: -x, v: -v}))
    >>> orbit.success, len(orbit.word)
    (True, 1)
    """
    first = poincare_map(system, seen, options, count or 1, symmetric=True)
    symmetric = getattr(first, "symmetry", None) is not None
    at = np.array(system.initial_state(x0), float)
    first, begun = first._with(scale=scale_at(at)), None
    if angles is not None:
        if symmetric:
            raise ValueError("`angles` and `symmetry` are both given; find the orbit without its symmetry.")
        first = first._with(angles=turns_of(system, angles, getattr(first, "surface", None)))
    if isinstance(first, Section):
        # The guess need not lie on the section: the first return does.
        begun = first.image(at)
        if not begun.success:
            return none_found(first, at, f"from the first guess no return: {begun.reason}")
        if (careful := first.careful(begun.runs)) is not first:
            first, begun = careful, careful.image(at)
        at = begun.x
    if transient:
        points, reason = first._iterated(at, transient + 1)
        if reason:
            last = np.flatnonzero(np.isfinite(points).all(axis=1))
            at = points[last[-1]] if last.size else at
            said = f"the transient ended after {last.size} of {transient}: {reason}"
            if begun is not None and last.size > 1:
                left = np.abs(at - points[last[-2]]) / np.where((moves := extents(begun.runs)) > 0, moves, 1.0)
                said += _COMES_TO_REST if left.max() <= _RESTS else ""
            return none_found(first, at, said)
        at = first.within_a_turn(points[-1], at)
        if count is None and not symmetric:
            first = replace(first, count=_recurrence(points, max_count, first))
    orbit = _refined(first, at, segments, begun)
    if orbit.success and "atol" in options:
        _warn_below(orbit)
    return orbit


def _warn_below(orbit: PeriodicOrbit) -> None:
    """Say where a population falls so low that the absolute tolerance of the runs is no small part of it."""
    tolerance = orbit.map.tolerance
    for k, least in lowest(orbit.runs()).items():
        if tolerance[k] > _PART * least:
            warnings.warn(
                f"`atol` is {tolerance[k]:g}, and {orbit.system.model.states[k]} falls to {least:.2g} along the orbit: "
                f"give less than {_PART * least:.1g}, or leave `atol` out.",
                stacklevel=5,
            )


def _recurrence(points: np.ndarray, most: int, map_: Any) -> int:
    """After how many steps the last point has been nearest before; 1 if never near."""
    last, size = points[-1], map_.unit + np.abs(points[-1])
    earlier = [map_.within_a_turn(points[-1 - k], last) for k in range(1, min(most, len(points) - 1) + 1)]
    back = np.array([np.abs((last - point) / size).max() for point in earlier])
    near = np.flatnonzero(back < _RECURRENCE)
    return int(near[0]) + 1 if near.size else 1


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

    >>> t, x = sp.symbols("t x", real=True)
    >>> orbit = refine(Stroboscopic(System({x: sp.cos(t) - x}, time=t), 2 * sp.pi), {x: 3})
    >>> orbit.success, round(float(orbit.x[0]), 9)
    (True, 0.5)
    """
    return _refined(map_, np.array(map_.system.initial_state(x0), float))


def _refined(
    map_: Stroboscopic | Section, x: np.ndarray, number: int | None = None, begun: Image | None = None
) -> PeriodicOrbit:
    """The orbit near a point: shot over in one piece if it can be and nothing else is asked for.

    `begun` is a return before a transient that has led to the point.
    """
    image = map_.image(x, ())
    if image.success and (careful := map_.careful(image.runs)) is not map_:
        map_ = careful
        image = map_.image(x, ())
    first = [one for one in (begun, image) if one is not None and one.success]
    if number is not None and number > 1:
        return _checked(_fitted(_in_segments(map_, x, number), first), first)
    if not image.success:
        return none_found(map_, x, f"the trajectory from the first guess did not return: {image.reason}")
    orbit = newton(map_, x, image)
    if number is not None:
        return _checked(_fitted(orbit, first), first)
    moved = _distance(orbit.x, x, map_.unit) if orbit.success else math.inf
    if moved > _NEAR and _leaves(x, image):
        other = _in_segments(map_, x, None)
        if other.success and _distance(other.x, x, map_.unit) < moved:
            return _checked(_fitted(_in_one_piece(other) or other, first), first)
    if orbit.success and np.abs(orbit.map_multipliers).max(initial=0.0) > TOO_LONG:
        other = _in_segments(map_, orbit.x, None)
        orbit = other if other.success else orbit
    return _checked(_fitted(orbit, first), first)


def _fitted(orbit: PeriodicOrbit, first: Sequence[Image]) -> PeriodicOrbit:
    """The same orbit in its own units, where it is of another size than the first guess."""
    if (
        not orbit.success
        or orbit.segments is None
        and np.abs(orbit.map_multipliers).max(initial=0.0) > TOO_LONG
    ):
        return orbit
    whole, x = (orbit.map, orbit.x) if orbit.segments is None else (
        Shooting(orbit.map, orbit.segments.cuts), orbit.segments.nodes.ravel()
    )  # fmt: skip
    before = np.max([orbit.map.unit, *(extents(image.runs) for image in first)], axis=0)
    image = orbit._image if orbit._image is not None else whole.image(x, ())
    if (fitted := orbit.map.fitted(image, before)) is orbit.map:
        return orbit
    whole, kept = (fitted, (False, False)) if orbit.segments is None else (
        Shooting(fitted, orbit.segments.cuts), orbit.segments.kept
    )  # fmt: skip
    image = whole.image(x, ())
    other = newton(whole, x, image, kept) if image.success else orbit
    return replace(other, steps=orbit.steps + other.steps) if other.success else other


def _distance(a: np.ndarray, b: np.ndarray, unit: np.ndarray) -> float:
    """Of two points, relative to the states' size."""
    return float(np.abs((a - b) / (unit + np.abs(b))).max(initial=0.0))


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
    whole = newton(orbit.map, orbit.x, image) if image.success else orbit
    near = _distance(whole.x, orbit.x, orbit.map.unit) <= SAME
    return replace(whole, steps=orbit.steps, message=orbit.message) if whole.success and near else None


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
    for shooting, nodes, image, kept in sorted(begun, key=lambda guess: off_and_size(*guess[:3])[1]):
        orbit = newton(shooting, nodes, image, kept)
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


def _checked(orbit: PeriodicOrbit, first: Sequence[Image] = ()) -> PeriodicOrbit:
    """A converged orbit with what is to be said of it: that it does not repeat, is shorter, or not isolated.

    `first` are returns from before Newton's method.
    """
    orbit = replace(orbit, _image=None)
    if broken := why_none(orbit, first):
        return replace(orbit, success=False, message=broken)
    if not orbit.success:
        return orbit
    if broken := not_repeated(orbit):
        return replace(orbit, success=False, message=broken)
    orbit = with_integrals(in_both_orders(orbit))
    map_, count = orbit.map, repeats_after(orbit)
    if count < map_.count:
        shorter = refined_to(orbit, count)
        said = f" It repeats after {count} of the {map_.count} applications of the map that were asked for."
        return replace(shorter, message=shorter.message + said) if shorter.success else orbit
    free = orbit._free_multipliers
    if orbit.integrals is not None and len(free) and (np.abs(free - 1) > orbit.accuracy).all():
        kept = (
            f" The motion keeps {len(orbit.integrals)} of its quantities: so many multipliers are 1 for that."
        )
        return replace(orbit, message=orbit.message + kept)
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
