"""Invariant curves of saddle fixed points of Poincare maps, by growth out of a fundamental domain.

    W(s) = P^k(x + delta m^(s-1) v),   0 <= s <= 1:   P maps the k-th piece onto the next one

v is the eigenvector of the multiplier m, |m| > 1. The pieces are as good as the first one, which is straight to
delta^2, and better: what it is off by shrinks. A stable manifold is the same of the inverse of P: runs backward in
time where the motion has one past, and else points y with P(y) = x, by Newton's method from their neighbours. Where
the motion comes to slide or rest the past is not unique, and the arm ends. With m < 0 P is applied twice.

Chain: arms.py, periodic_orbit.py -> **map_manifolds** -> manifolds.py.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from ...definition.pointwise import value
from ...results.records import Outcome
from ...solving import behind_the_door
from ..maps.poincare import Word
from ..maps.sections import Section
from ..orbits.fixed_points import onto_section
from ..orbits.periodic_orbit import PeriodicOrbit
from .arms import SMALLEST, Arm, Growing, Lost, Rules, Sample, dense

_FIRST = 1e-6  # relative to the states: how far from the saddle the first piece ends, times the root of its multiplier
_SEEDS = 9
_MOST_PIECES = 10_000
_FEWEST = 50  # pieces, before short ones are taken for its end: the first ones are short too
_MOST_NEWTON = 12
_CONVERGED = 1e-12  # of a step to a preimage, relative
_DEEPEST = 10  # bisections between a point and its neighbour, whose preimage is known, on the way to its own

#: A point and where its image may be -> the image, and the events on the way.
Apply = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, Word]]


def eigenvector(orbit: PeriodicOrbit, multiplier: float) -> np.ndarray:
    """Of D P on the section, (n,), of length 1."""
    values, vectors = np.linalg.eig(orbit.jacobian)
    v = np.real(vectors[:, int(np.argmin(np.abs(values - multiplier)))])
    if isinstance(orbit.map, Section):
        normal = orbit.map.gradient(orbit.x)
        v = v - normal * (normal @ v) / (normal @ normal)
    return v / np.linalg.norm(v)


def arms_of_map(orbit: PeriodicOrbit, multiplier: float, stable: bool, rules: Rules) -> list[Arm]:
    """Both arms of the manifold of one multiplier."""
    apply = forward(orbit.map)
    if stable:
        apply = backward(orbit.map) if reversible(orbit) else preimage(orbit.map)
    growth = 1 / multiplier if stable else multiplier
    if growth < 0:
        apply, growth = _twice(apply), growth * growth
    v = eigenvector(orbit, multiplier)
    size = _FIRST * (1 + float(np.abs(orbit.x).max())) * min(math.sqrt(growth), 1e3)
    return [_Growth(orbit, side * size * v, growth, apply, rules).arm() for side in (1, -1)]


class _Growth:
    """One arm. `trails` holds of each s its points in all pieces so far."""

    def __init__(
        self, orbit: PeriodicOrbit, end: np.ndarray, growth: float, apply: Apply, rules: Rules
    ) -> None:
        self.orbit, self.end, self.growth, self.apply, self.rules = orbit, end, growth, apply, rules
        self.trails: dict[float, list[Sample]] = {}

    def arm(self) -> Arm:
        arm, s = Growing(self.orbit.x, self.rules, changed), np.linspace(0.0, 1.0, _SEEDS)
        arm.take([self.sample(place, 0) for place in s.tolist()], first=True)
        for piece in range(1, _MOST_PIECES):
            s, samples, reason = dense(lambda place, k=piece: self.sample(place, k), s, self.rules, arm.room)  # type: ignore[misc]
            end = arm.take(samples[1:], first=piece == 1)
            if end or reason:
                return arm.arm(end or reason)
            ends = np.array([sample.x for sample in samples])
            if piece > _FEWEST and np.ptp(ends, axis=0).max() < SMALLEST * self.rules.spacing:
                return arm.arm("it comes to an end, a point that attracts it.")
        return arm.arm(f"stopped after {_MOST_PIECES} pieces.")

    def sample(self, s: float, piece: int, depth: int = 0) -> Sample:
        trail = self.trails.setdefault(s, [])
        if not trail:
            x = onto_section(self.orbit.map, self.orbit.x + self.growth ** (s - 1) * self.end)
            trail.append(Sample(x))
        while len(trail) <= piece:
            k = len(trail)
            near, guess = self._guess(s, k)
            try:
                x, word = self.apply(trail[-1].x, guess)
            except Lost:
                if near is None or abs(near - s) < 1e-9 or depth >= _DEEPEST:
                    raise
                self.sample((near + s) / 2, k, depth + 1)
                x, word = self.apply(trail[-1].x, self._guess(s, k)[1])
            trail.append(Sample(x, word))
        return trail[piece]

    def _guess(self, s: float, piece: int) -> tuple[float | None, np.ndarray]:
        """The nearest s whose point in a piece is known, and that point."""
        if not getattr(self.apply, "guessed", False):
            return None, self.orbit.x
        if s == 0.0 and piece > 1:
            return None, self.trails[1.0][piece - 1].x  # the same point
        known = [place for place, trail in self.trails.items() if len(trail) > piece]
        if not known:
            return None, self.orbit.x + self.growth * (self.trails[s][piece - 1].x - self.orbit.x)
        near = min(known, key=lambda place: abs(place - s))
        return near, self.trails[near][piece].x


def forward(map_: Any) -> Apply:
    """P."""

    def apply(x: np.ndarray, guess: np.ndarray) -> tuple[np.ndarray, Word]:
        image = map_.image(x)
        if not image.success:
            raise Lost(f"the image of the next points does not exist: {image.reason}")
        return image.x, image.word

    return apply


def backward(map_: Any) -> Apply:
    """The inverse of P, by a run backward in time."""
    t0, t1 = map_.start_time, map_.start_time + map_.duration
    solve = behind_the_door(map_.system, **{"rtol": 1e-12, "atol": 1e-14, **map_.options})

    def apply(x: np.ndarray, guess: np.ndarray) -> tuple[np.ndarray, Word]:
        at = x if map_.symmetry is None else map_.symmetry @ x
        run = solve(map_.system, (t1, t0), list(map(float, at)))
        if run.outcome is Outcome.IRREVERSIBLE:
            raise Lost(f"the past of the next points is not unique: {run.message}")
        if run.outcome is not Outcome.FINISHED:
            raise Lost(f"the past of the next points was not reached: {run.message}")
        return run.x[:, 0], tuple((e.switch, e.kind, e.note) for e in run.events)

    return apply


def reversible(orbit: PeriodicOrbit) -> bool:
    """Whether a run backward leads from the orbit back to it; none does of a return map or with a nonlinear reset."""
    if isinstance(orbit.map, Section):
        return False
    try:
        x = backward(orbit.map)(orbit.x, orbit.x)[0]
    except (ValueError, Lost):
        return False
    return bool(np.all(np.abs(x - orbit.x) <= 1e-4 * (1 + np.abs(orbit.x))))


def preimage(map_: Any) -> Apply:
    """The inverse of P near a guess, by Newton's method with the derivative of P."""

    def apply(x: np.ndarray, guess: np.ndarray) -> tuple[np.ndarray, Word]:
        y, last = np.array(guess), math.inf
        for _ in range(_MOST_NEWTON):
            image = map_.image(y, ())
            if not image.success:
                raise Lost(f"the search for a preimage of the next points left the map: {image.reason}")
            matrix, off = image.jacobian, x - image.x
            if isinstance(map_, Section):
                point = {**map_.system.parameters, **dict(zip(map_.system.model.states, map(float, y)))}
                matrix = np.vstack([matrix, map_.gradient(y)])
                off = np.append(off, -value(map_.surface, point))
            step = np.linalg.lstsq(matrix, off, rcond=1e-13)[0]
            size = float(np.abs(step / (1 + np.abs(y))).max())
            if size > 4 * last:
                break
            y, last = y + step, size
            # A map that folds or collapses what is near has no inverse: the step then misses x.
            if size <= _CONVERGED and np.abs(matrix @ step - off).max() <= 1e-9 * (1 + np.abs(x).max()):
                return y, image.word
        raise Lost(
            "Newton's method found no preimage of the next points near those of their neighbours: the map is not "
            "one-to-one there, folds, or has no derivative."
        )

    apply.guessed = True  # type: ignore[attr-defined]
    return apply


def _twice(apply: Apply) -> Apply:
    def both(x: np.ndarray, guess: np.ndarray) -> tuple[np.ndarray, Word]:
        middle, first = apply(x, guess)
        end, second = apply(middle, guess)
        return end, first + second

    both.guessed = getattr(apply, "guessed", False)  # type: ignore[attr-defined]
    return both


def changed(before: Word, after: Word) -> str:
    """What events an application has more or fewer, in words; empty where only their order differs."""
    count = Counter(letter[:2] for letter in after)
    count.subtract(letter[:2] for letter in before)
    parts = [
        f"{abs(n)} {kind} [{switch}] {'more' if n > 0 else 'fewer'}" for (switch, kind), n in count.items() if n
    ]
    return ", ".join(parts)
