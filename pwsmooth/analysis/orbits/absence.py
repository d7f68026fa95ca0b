"""Why a point that nearly returns is on no periodic orbit: it goes to a rest, or a state of it runs on.

    x'' = -x - v^3          each return is nearer to the rest by a part that vanishes with it: P(x) - x = -c x^3
    x' = v, v' = f(sin x)   each return adds 2 pi to x, and x itself never comes back

Newton's method cannot tell: beside such a rest its steps never end, and far away a turn is less than a rounding of x.

Chain: periodic_orbit.py, fixed_points.py -> **absence** -> finding.py.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..maps.poincare import Image
from ..maps.scales import extents
from ..maps.sections import Section
from .periodic_orbit import PeriodicOrbit

_REST = 1e-9  # of what the first return moved: what moves less is a rest
_NEARER = 0.5  # of the same: an orbit among others that has shrunk so far is none, but the way to a rest
_AT_ONCE = 1e-3  # of the time of the first return
_PART = 0.1  # of the largest component of a direction: states with less have no part in it
_SAME_TURN = 1e-3  # of a turn, by which two in succession differ
_ONWARD = 0.9  # of the way that a state goes in a return: by so much it comes on at least
_RETURNS = 4  # each of which moves less than the one before, on the way to a rest
_FAR = 1e6  # times what a return moves: an orbit so far from 0 is looked at twice


def left_of(orbit: PeriodicOrbit, first: Sequence[Image], among: np.ndarray | None = None) -> float:
    """How much of what the first returns moved the orbit still moves, of all states or `among` some."""
    if orbit.moves is None or not first:
        return 1.0
    before = np.max([extents(image.runs) for image in first], axis=0)
    some = before > 0 if among is None else (before > 0) & among
    return float((orbit.moves[some] / before[some]).max(initial=0.0)) if some.any() else 1.0


def why_none(orbit: PeriodicOrbit, first: Sequence[Image]) -> str:
    """Why there is no orbit where Newton's method has ended, in words with a remedy; empty where nothing is known."""
    if not np.isfinite(orbit.jacobian).all():
        return ""
    if turn := _runs_on(orbit, first):
        k, by = turn
        name = orbit.system.model.states[k]
        return (
            f"no orbit: {name} runs on, by {by:.9g} with each return, whatever the guess or the `transient`. If {name} "
            f"is an angle, give its turn, as `angles={{{name}: 2*pi}}`."
        )
    left = left_of(orbit, first)
    rest = ", ".join(f"{s} = {value:.6g}" for s, value in zip(orbit.system.model.states, orbit.x))
    if isinstance(orbit.map, Section):
        if left < _REST:
            return f"no orbit: the motion comes to rest at {rest}; find_equilibrium() finds that."
        shortest = _AT_ONCE * min((image.time for image in first), default=0.0)
        if orbit.time < shortest:
            return (
                f"no orbit: near {rest} the section is met again after {orbit.time:.3g}, and from the first guess it "
                f"was after {first[-1].time:.3g}: the motion comes to rest there, or slides. Give another `section`."
            )
    nearer = _NEARER if orbit.isolated else left_of(orbit, first, _neutral(orbit))
    if left and nearer < _NEARER and not (left < _REST and orbit.success):
        return (
            f"no orbit: each return is a little nearer to a rest, and Newton's method has come to {rest} with them; "
            "find_equilibrium() finds the rest."
        )
    if not orbit.success and isinstance(orbit.map, Section) and (by := _shrinks(orbit, first)):
        return (
            f"no orbit: each return moves {by:.3g} times as far as the one before, on the way to a rest; "
            "find_equilibrium() finds that."
        )
    return ""


def _shrinks(orbit: PeriodicOrbit, first: Sequence[Image]) -> float:
    """By what factor each return moves less than the one before; 0 where it does not."""
    image, moved = first[-1], []
    for _ in range(_RETURNS):
        if not image.success:
            return 0.0
        moved.append(extents(image.runs))
        image = orbit.map.image(image.x)
    moves = np.array(moved)
    shares = moves[1:][:, moves[0] > 0] / moves[:-1][:, moves[0] > 0]
    return float(shares[-1].max()) if shares.size and shares.max() < 1 else 0.0


def _neutral(orbit: PeriodicOrbit) -> np.ndarray:
    """Which states have a part in the direction of the multiplier that is nearest to 1, bool (n,)."""
    unit = orbit.map.unit
    matrix = orbit.jacobian * unit / unit[:, None] - np.eye(len(unit))
    direction = np.abs(np.linalg.svd(matrix)[2][-1])
    return direction >= _PART * direction.max()


def _runs_on(orbit: PeriodicOrbit, first: Sequence[Image]) -> tuple[int, float] | None:
    """A state that each return moves on by the same, without a turn back, and by how much; None without one."""
    if not first or orbit.success and (np.abs(orbit.x) <= _FAR * (orbit.map.unit + orbit.moves)).all():
        return None
    last = first[-1]
    again = orbit.map.image(last.x)
    if not again.success:
        return None
    turn, next_turn = last.x - last.runs[0].x[:, 0], again.x - last.x
    same = np.abs(next_turn - turn) <= _SAME_TURN * np.abs(turn)
    on = np.flatnonzero(same & (np.abs(turn) >= _ONWARD * extents(again.runs)) & (turn != 0))
    return (int(on[0]), float(next_turn[on[0]])) if on.size else None
