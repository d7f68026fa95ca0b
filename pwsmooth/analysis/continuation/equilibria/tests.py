"""Bifurcations between two equilibria of one mode, by test functions that are zeroed on the way.

    tau_q (fold), det [DF; tau'] (branch point), the product of mu_i + mu_j (Hopf), det L of the layer (fold of a hidden
    branch; with a linear switch a two-fold)

Source: Kuznetsov, Elements of Applied Bifurcation Theory, for the smooth ones.
Chain: problem.py, special.py -> **tests** -> branches.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import sympy as sp

from ....definition.pointwise import value
from ....definition.regularity import total_derivative
from ...equilibria.disc_modes import held as held_in
from ...equilibria.equilibrium import Equilibrium
from ...equilibria.stability import lyapunov_coefficient
from ..special import Special
from .problem import EquilibriumPoint, EquilibriumProblem


def between(problem: EquilibriumProblem, here: EquilibriumPoint, there: EquilibriumPoint) -> list[Special]:
    """Bifurcations between two points of one mode."""
    tests: dict[str, Callable[[EquilibriumPoint], float]] = {"fold": lambda p: float(p.tangent[problem.place])}
    if not problem.along_state:
        tests["branch point"] = _bordered
    tests |= {"Hopf": lambda p: _pairs(p.equilibrium.eigenvalues), "layer": _layer_determinant}
    if len(here.equilibrium.layer_eigenvalues) > 1:
        tests["layer Hopf"] = lambda p: _pairs(p.equilibrium.layer_eigenvalues)
    for event in problem.statics.system.model.events:
        if event.surface is not None and not event.singular:
            tests[f"event {event.name}"] = _event_surface(event.surface)
    found: list[Special] = []
    for kind, test in tests.items():
        a, b = test(here), test(there)
        if not a * b < 0:
            continue
        at = problem.zero(here, there, test)
        if at is None or abs(test(at[0])) > 1e-4 * max(abs(a), abs(b)):
            continue  # a pole: eigenvalues go through infinity where the layer folds
        if (named := _named(problem, kind, here, *at)) is not None:
            found.append(named)
    # Where all of x is held, the layer's fold is that of the branch.
    layer = [b for b in found if b.kind == "hidden fold"]
    width = 1e-7 * problem.sizes[problem.place]
    near = [
        b for b in found if b.kind == "fold" and any(abs(b.parameter - c.parameter) <= width for c in layer)
    ]
    found = [b for b in found if b not in near]
    return sorted(found, key=lambda b: float(np.linalg.norm(b.point.x - here.equilibrium.x)))


def _named(
    problem: EquilibriumProblem, kind: str, here: EquilibriumPoint, point: EquilibriumPoint, width: float
) -> Special | None:
    e = point.equilibrium
    made_ = Special(kind, problem.values(point), e, width)
    if kind == "Hopf":
        w = _critical(e.eigenvalues)
        if w is None:
            return None  # a neutral saddle: two real eigenvalues of opposite sign
        if e.linear.joined is not None:
            what = "half a turn on either side of the kink multiplies to 1"
            return replace(made_, kind="Hopf", frequency=w, note=what)
        kind = "sliding Hopf" if "pseudo" in e.kind else "Hopf"
        l1 = lyapunov_coefficient(e.system, e.x, e.mult, e.sides)
        return replace(made_, kind=kind, frequency=w, lyapunov=l1)
    if kind == "layer Hopf":
        w = _critical(e.layer_eigenvalues)
        return (
            None if w is None else replace(made_, note=f"{', '.join(e.held)} begin to oscillate in the layer")
        )
    if kind == "layer":
        name, what = _layer_kind(e)
        return replace(made_, kind=name, note=what)
    if kind.startswith("event "):
        return replace(made_, kind="surface of an event", note=f"the surface of {kind[6:]} is met")
    return made_


def _bordered(point: EquilibriumPoint) -> float:
    """Sign and size of det [DF; tau']: 0 where two branches meet, and not at a fold."""
    square = np.vstack([point.rows, point.tangent])
    return float(np.linalg.det(square / (1 + np.linalg.norm(square, axis=1))[:, None]))


def _pairs(mu: np.ndarray) -> float:
    """Product of mu_i + mu_j over pairs, every factor bounded; 0 where a pair is imaginary."""
    if not np.isfinite(mu).all():
        return 1.0
    factors = [(mu[i] + mu[j]) / (1e-300 + abs(mu[i]) + abs(mu[j])) for i in range(len(mu)) for j in range(i)]
    return float(np.prod(factors).real) if factors else 1.0


def _critical(mu: np.ndarray) -> float | None:
    """Frequency of the pair on the imaginary axis; None where it is none."""
    pairs = mu[mu.imag > 1e-7 * np.abs(mu).max(initial=0.0)]
    if not pairs.size:
        return None
    nearest = pairs[np.argmin(np.abs(pairs.real))]
    return float(nearest.imag) if abs(nearest.real) <= 1e-6 * np.abs(mu).max() else None


def _layer_determinant(point: EquilibriumPoint) -> float:
    layer = point.equilibrium.linear.layer
    if not len(layer) or not np.isfinite(layer).all():
        return 1.0
    return float(np.linalg.det(layer / max(np.abs(layer).max(), 1.0)))


def _event_surface(surface: sp.Expr) -> Callable[[EquilibriumPoint], float]:
    def test(point: EquilibriumPoint) -> float:
        return value(surface, _symbols(point.equilibrium))

    return test


def _symbols(e: Equilibrium) -> dict[sp.Symbol, float]:
    model = e.system.model
    names = (*model.states, *(mu.symbol for mu in model.multipliers), *e.system.parameters, model.time)
    return dict(zip(names, (*e.x, *e.mult, *e.system.parameters.values(), 0.0)))


def _layer_kind(e: Equilibrium) -> tuple[str, str]:
    """The name of a point at which the layer's determinant vanishes, and what happens there."""
    model = e.system.model
    held = [model.multipliers[j] for j in held_in(model, e.sides)]
    if any(mu.hidden for mu in held) or model.layer_states:
        return (
            "hidden fold",
            f"dg/dlambda = 0: one side of it attracts {', '.join(e.held)} in the layer, the other repels",
        )
    if len(held) > 1:
        return "fold of the layer", f"{', '.join(e.held)} are no longer determined by dh/dt = 0"
    (mu,) = held
    turns = []  # d2h/dt2 on both sides
    for side in (1, -1):
        rates = [f.xreplace({mu.symbol: sp.Integer(side)}) for f in model.rhs]
        speed = total_derivative(mu.surface, model.time, model.states, rates)
        turns.append(value(total_derivative(speed, model.time, model.states, rates), _symbols(e)))
    visible = [turns[0] > 0, turns[1] < 0]
    words = {0: "both invisible", 1: "one of them visible", 2: "both visible"}[sum(visible)]
    planar = len(model.states) - model.n_memory == 2
    name = "pseudo-Hopf" if planar and not any(visible) else "two-fold"
    return (
        name,
        f"the folds of {mu.symbol} on both sides meet, {words}: sliding turns from attracting to repelling",
    )
