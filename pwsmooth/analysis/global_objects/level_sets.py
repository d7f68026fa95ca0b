"""Stable curves of saddles that contract strongly, or at once: where the motion comes to stick.

    F(y) = l . (P^j(y) - x) = 0,    grad F = l D P^j,    l the left eigenvector of the multiplier |m| > 1

A stick has the multiplier 0: P collapses a region onto a curve, has no inverse, and what comes to the saddle is the
whole level set P^j(y) = x. It is traced by its exact derivative in the plane, with the least j that brings the points
so near to the saddle that F = 0 is its stable curve, up to the square of their distance from there.

Chain: arms.py, map_manifolds.py -> **level_sets** -> manifolds.py.
"""

from __future__ import annotations

import numpy as np

from ..orbits.periodic_orbit import PeriodicOrbit
from .arms import SMALLEST, Arm, Growing, Lost, Rules, Sample
from .map_manifolds import changed

_NEAR = 1e-6  # relative: how near to the saddle the j-th images come
_MOST_APPLICATIONS = 12
_MOST_NEWTON = 8
_CONVERGED = 1e-12  # of a step, relative
_JUMPS = 100.0  # times what the derivative explains


def traced_arms(orbit: PeriodicOrbit, multiplier: float, rules: Rules) -> list[Arm]:
    """Both arms of the stable curve in the plane; `multiplier` is the one outside the unit circle."""
    values, vectors = np.linalg.eig(orbit.jacobian.T)
    left = np.real(vectors[:, int(np.argmin(np.abs(values - multiplier)))])
    tracing = _Tracing(orbit, left / np.linalg.norm(left), rules)
    return [tracing.arm(side) for side in (1.0, -1.0)]


class _Tracing:
    def __init__(self, orbit: PeriodicOrbit, left: np.ndarray, rules: Rules) -> None:
        self.orbit, self.left, self.rules = orbit, left, rules
        self.near = _NEAR * (1 + float(np.abs(orbit.x).max()))

    def equation(self, y: np.ndarray, times: int) -> tuple[float, np.ndarray, float, object]:
        """F, its gradient, how far the last image is from the saddle, and the events of the first application."""
        x, matrix, word = y, np.eye(2), None
        for _ in range(times):
            image = self.orbit.map.image(x, ())
            if not image.success:
                raise Lost(f"the image of the next points does not exist: {image.reason}")
            x, matrix = image.x, image.jacobian @ matrix
            word = image.word if word is None else word
        off = x - self.orbit.x
        return float(self.left @ off), self.left @ matrix, float(np.linalg.norm(off)), word

    def corrected(self, guess: np.ndarray, along: np.ndarray, times: int) -> tuple[Sample, np.ndarray, float]:
        """The point of the curve across from a guess, the tangent there, and how far its last image is."""
        y = guess
        for _ in range(_MOST_NEWTON):
            F, gradient, far, word = self.equation(y, times)
            square = np.array([gradient, along])
            if not np.isfinite(square).all() or abs(np.linalg.det(square)) <= 1e-12 * np.linalg.norm(gradient):
                break
            step = np.linalg.solve(square, [-F, -along @ (y - guess)])
            y = y + step
            if np.abs(step / (1 + np.abs(y))).max() <= _CONVERGED:
                tangent = np.array([-gradient[1], gradient[0]]) / np.linalg.norm(gradient)
                return Sample(y, word), tangent * np.sign(tangent @ along), far
        raise Lost("the curve was lost: the map has no continuous derivative in the next points.")

    def why(self, x: np.ndarray, tangent: np.ndarray, times: int) -> str:
        """Whether the map jumps just ahead of the last point, in words; empty if it does not."""
        step = SMALLEST * self.rules.spacing
        for k in range(1, times + 1):
            try:
                (_, gradient, here, _), (_, _, ahead, _) = (
                    self.equation(y, k) for y in (x, x + step * tangent)
                )
            except Lost:
                return ""
            if abs(ahead - here) > _JUMPS * (self.near + step * float(np.linalg.norm(gradient))):
                return (
                    f"the map jumps there, after {k} application{'s' * (k > 1)}: the stable curve ends, and boundaries "
                    "of basins go on along the jump."
                )
        return ""

    def arm(self, side: float) -> Arm:
        rules, x = self.rules, self.orbit.x
        arm = Growing(x, rules, changed)
        gradient = self.equation(x, 1)[1]
        tangent = side * np.array([-gradient[1], gradient[0]]) / np.linalg.norm(gradient)
        here, times, ds, first = Sample(x), 1, SMALLEST * rules.spacing, True
        while True:
            try:
                there, turned, far = self.corrected(here.x + ds * tangent, tangent, times)
                if np.linalg.norm(there.x - here.x) > 1.5 * ds:
                    raise Lost("the curve was lost: it turns too sharply.")
                if far > self.near:
                    if times == _MOST_APPLICATIONS:
                        return arm.arm(
                            f"its points do not come to the saddle in {times} applications of the map."
                        )
                    times += 1
                    continue
                if turned @ tangent < np.cos(rules.angle) and ds > SMALLEST * rules.spacing:
                    raise Lost("")
            except Lost as lost:
                ds *= 0.4
                if ds < 0.1 * SMALLEST * rules.spacing:
                    return arm.arm(self.why(here.x, tangent, times) or str(lost))
                continue
            end = arm.take([there], first=first)
            if end:
                return arm.arm(end)
            here, tangent, first = there, turned, False
            ds = min(1.5 * ds, 0.99 * rules.spacing)
