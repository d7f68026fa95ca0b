"""What holds along a curve of equilibria in two parameters, beside F(u) = (f, h_J) = 0 of their mode: c(u) = 0.

    fold                                     g = 0,   (F_u  b) (v)   (0)
                                                      (c^T  0) (g) = (1)
    Hopf, sliding Hopf                       the product of mu_i + mu_j over all pairs of eigenvalues
    hidden fold, pseudo-Hopf, two-fold       det L of the layer
    boundary equilibrium                     how far the point is inside its mode, for one multiplier

The product of all mu_i + mu_j is a polynomial of the Jacobian's entries (the determinant of its bialternate product),
smooth where eigenvalues meet too; where it vanishes, mu_1 mu_2 tells a Hopf point from a neutral saddle.

Source: Kuznetsov, Elements of Applied Bifurcation Theory, chapters 8 and 10; di Bernardo, Budd, Champneys, Kowalczyk,
Piecewise-smooth Dynamical Systems, 2008, ch. 5, for boundary equilibria.

Chain: statics.py, stability.py -> **conditions** -> problem.py, ways.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...equilibria.stability import Linear, layer_at, linear_at, lyapunov_coefficient, sigmoid_slope
from ...equilibria.statics import Statics

HOPF = ("Hopf", "sliding Hopf")
LAYER = ("hidden fold", "pseudo-Hopf", "two-fold")
BOUNDARY = "boundary equilibrium"
_STEP = 6e-6  # of an unknown's unit, for differences of what has twelve digits
_REAL = 1e-9  # of the largest eigenvalue: what counts as an imaginary part


@dataclass(frozen=True)
class Spot:
    """A point u (N,) of the mode's equations, with F_u (size, size) and the linear part of its flow and layer."""

    statics: Statics
    u: np.ndarray
    DF: np.ndarray
    system: Any

    @property
    def state(self) -> tuple[np.ndarray, np.ndarray]:
        x, mult, _ = self.statics.parts(self.u[None])
        return x[:, 0], mult[:, 0]

    @property
    def linear(self) -> Linear:
        return linear_at(self.system, *self.state, self.statics.sides)

    @property
    def layer(self) -> np.ndarray:
        return layer_at(self.system, *self.state, self.statics.sides)


class EquilibriumCondition:
    """c(u) = 0, and test functions along its curve."""

    def __init__(self, kind: str) -> None:
        self.kind = kind

    def frame(self, spot: Spot) -> None:
        """What is kept fixed while the next point is sought."""

    def value(self, spot: Spot) -> float:
        raise NotImplementedError

    def tests(self, spot: Spot, slopes: np.ndarray) -> dict[str, float]:
        """Functions that change their sign at points of codimension 2, by the name of these."""
        return {}

    def ends(self, name: str) -> str:
        """Why the curve ends at such a point; empty where it goes on."""
        return ""

    def genuine(self, spot: Spot) -> bool:
        """Whether c = 0 is what its name says."""
        return True


class Fold(EquilibriumCondition):
    """F_u is singular."""

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        self.b = self.c = np.empty(0)

    def frame(self, spot: Spot) -> None:
        left, _, right = np.linalg.svd(self._square(spot))
        b, c = left[:, -1], right[-1]
        if self.b.size:  # the sign of the test functions is theirs
            b, c = b * np.sign(b @ self.b or 1.0), c * np.sign(c @ self.c or 1.0)
        self.b, self.c = b, c

    @staticmethod
    def _square(spot: Spot) -> np.ndarray:
        size = spot.statics.size
        return spot.DF[:, :size]

    def _null(self, spot: Spot) -> tuple[np.ndarray, np.ndarray, float]:
        square, n = self._square(spot), spot.statics.size
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n], matrix[:n, n], matrix[n, :n] = square, self.b, self.c
        last = np.append(np.zeros(n), 1.0)
        right, left = np.linalg.solve(matrix, last), np.linalg.solve(matrix.T, last)
        return right[:n], left[:n], float(right[n])

    def value(self, spot: Spot) -> float:
        return self._null(spot)[2]

    def tests(self, spot: Spot, slopes: np.ndarray) -> dict[str, float]:
        v, w, _ = self._null(spot)
        n, mu = spot.statics.n, spot.linear.eigenvalues
        found = {"cusp": float(slopes[: len(v)] @ v), "Bogdanov-Takens": float(w[:n] @ v[:n])}
        if len(mu) > 2 and np.isfinite(mu).all():
            found["fold + Hopf"] = pairs(np.delete(mu, np.argmin(np.abs(mu))))
        return found


class Hopf(EquilibriumCondition):
    """Two eigenvalues have the sum 0."""

    def frame(self, spot: Spot) -> None:
        mu = spot.linear.eigenvalues
        sums = _sums(mu)
        sizes = np.array([abs(mu[i]) + abs(mu[j]) for i in range(len(mu)) for j in range(i)])
        # Of all others, so that c is a sum of two eigenvalues in size.
        rest = np.delete(sizes, np.argmin(np.abs(sums))) if sums.size else sizes
        self.scale = float(np.prod(np.where(rest > 0, rest, 1.0)))

    def value(self, spot: Spot) -> float:
        return float(np.prod(_sums(spot.linear.eigenvalues)).real) / self.scale

    def tests(self, spot: Spot, slopes: np.ndarray) -> dict[str, float]:
        mu = spot.linear.eigenvalues
        i, j = critical(mu)
        rest = np.delete(mu, [i, j])
        found = {"Bogdanov-Takens": float((mu[i] * mu[j]).real)}
        if rest.size:
            size = 1e-300 + np.abs(mu).max()
            found[f"{self.kind} + fold"] = float(np.prod(rest / size).real)
        if len(rest) > 1:
            found[f"{self.kind} twice"] = pairs(rest)
        if found["Bogdanov-Takens"] > 0:
            l1 = lyapunov_coefficient(spot.system, *spot.state, spot.statics.sides)
            found["generalised Hopf"] = math.nan if l1 is None else l1
        return found

    def ends(self, name: str) -> str:
        if name == "Bogdanov-Takens":
            return "beyond it both eigenvalues are real, a neutral saddle, and no cycle is born"
        return ""

    def genuine(self, spot: Spot) -> bool:
        mu = spot.linear.eigenvalues
        i, j = critical(mu)
        return float((mu[i] * mu[j]).real) > -((_REAL * float(np.abs(mu).max())) ** 2)


class Layer(EquilibriumCondition):
    """The layer's determinant vanishes: that of dg/dlambda, without the sigmoid's slope, which lambda = +-1 makes 0."""

    def frame(self, spot: Spot) -> None:
        layer = self._layer(spot)
        self.scale = max(float(np.abs(layer).max(initial=0.0)), 1e-300) ** max(len(layer) - 1, 0)

    @staticmethod
    def _layer(spot: Spot) -> np.ndarray:
        model, (_, mult) = spot.system.model, spot.state
        slope, layer = sigmoid_slope(model.sigmoid), spot.layer.copy()
        held = [j for j in spot.statics.J if model.multipliers[j].kind == "switch"]
        for k, j in enumerate(held[: len(layer)]):
            layer[k] /= slope(mult[j]) if abs(mult[j]) < 1 else 1.0
        return layer

    def value(self, spot: Spot) -> float:
        layer = self._layer(spot)
        return float(np.linalg.det(layer)) / self.scale if len(layer) else math.nan

    def tests(self, spot: Spot, slopes: np.ndarray) -> dict[str, float]:
        statics = spot.statics
        held = [
            k
            for k, j in enumerate(statics.J, statics.n)
            if statics.system.model.multipliers[j].kind == "switch"
        ]
        if self.kind != "hidden fold" or len(held) != 1:
            return {}
        return {"hidden cusp": float(slopes[held[0]])}


class Boundary(EquilibriumCondition):
    """The point lies on the border of its mode, for one multiplier; the mode beside has the same point."""

    def __init__(self, j: int, new: int) -> None:
        super().__init__(BOUNDARY)
        self.j, self.new = j, new

    def value(self, spot: Spot) -> float:
        return float(spot.statics.margins(spot.u)[0][self.j])

    def slopes(self, spot: Spot) -> np.ndarray:
        return spot.statics.margins(spot.u)[2][self.j]

    def beside(self, spot: Spot) -> Spot | None:
        """The same point in the mode beside."""
        x, mult = spot.state
        sides, old = list(spot.statics.sides), spot.statics
        mult[self.j] = self.new if self.new else (0.0 if old.system.model.multipliers[self.j].kind == "contact" else
                                                  float(sides[self.j]))  # fmt: skip
        sides[self.j] = self.new
        there = Statics(old.system, tuple(sides), old.memories, old.q, old.unit[: old.n])
        u = np.concatenate([there.unknowns(x, mult, old.parts(spot.u[None])[2]), spot.u[old.size :]])
        DF = there(u[None])[1][0]
        return Spot(there, u, DF, spot.system) if np.isfinite(DF).all() else None

    def tests(self, spot: Spot, slopes: np.ndarray) -> dict[str, float]:
        found = {}
        for place, one in (("", spot), (" beside", self.beside(spot))):
            if one is None:
                continue
            square = one.DF[:, : one.statics.size]
            size = 1 + np.linalg.norm(square, axis=1)
            found[f"{BOUNDARY} + fold{place}"] = float(np.linalg.det(square / size[:, None]))
            if one.statics.system.model.multipliers[self.j].kind == "disc" and one.statics.sides[self.j]:
                continue  # a slip without speed is led along the force at an infinite rate
            mu = one.linear.eigenvalues
            if len(mu) > 1 and np.isfinite(mu).all():
                found[f"{BOUNDARY} + Hopf{place}"] = pairs(mu)
        return found


def _sums(mu: np.ndarray) -> np.ndarray:
    return np.array([mu[i] + mu[j] for i in range(len(mu)) for j in range(i)])


def critical(mu: np.ndarray) -> tuple[int, int]:
    """Which two eigenvalues have the sum nearest to 0."""
    both = [(i, j) for i in range(len(mu)) for j in range(i)]
    return min(both, key=lambda ij: abs(mu[ij[0]] + mu[ij[1]]))


def pairs(mu: np.ndarray) -> float:
    """Product of mu_i + mu_j, every factor bounded."""
    return float(
        np.prod(
            [(mu[i] + mu[j]) / (1e-300 + abs(mu[i]) + abs(mu[j])) for i in range(len(mu)) for j in range(i)]
        ).real
    )


def differences(condition: EquilibriumCondition, at: Any, spot: Spot, unit: np.ndarray) -> np.ndarray:
    """Slopes of c by u, (N,)."""
    slopes = np.empty(len(spot.u))
    for k in range(len(spot.u)):
        h = _STEP * unit[k] * np.eye(len(spot.u))[k]
        above, below = at(spot.u + h), at(spot.u - h)
        slopes[k] = (
            math.nan
            if above is None or below is None
            else (condition.value(above) - condition.value(below)) / (2 * _STEP * unit[k])
        )
    return slopes
