"""The smoothed oscillator against its event-driven limit: the cases, and how the order is measured.

Shared by the test and the experiment, which look at different numbers of eps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from friction_oscillator import coulomb, hidden, v, y, z

from pwsmooth import solve
from pwsmooth.paths import stiff_steps as stiff

SIGMOIDS = ("algebraic", "tanh", "erf")
EPSILONS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
T_END = 10.0


@dataclass(frozen=True)
class Limit:
    """A limit: the event-driven system, the smoothed one, and the expected order for the algebraic sigmoid."""

    name: str
    exact: Any
    smooth: Any  # the System to be smoothed
    start: dict
    smooth_start: dict
    algebraic: float
    other: float
    beta_is_eps: bool = False


def _cases():
    symmetric = {y: 0.78, v: -1.03}
    asymmetric = {y: 0.6, v: -1.07, z: 0}
    full = symmetric | {z: 0}
    crossing = {y: 0.685823, v: -0.865823}  # on the slip-only orbit: from elsewhere there are sticks at first
    slaved = hidden().layered({z: sp.oo})
    fold, tail = 2 / 3, 4 / 5
    return (
        Limit("slaved, stick ends in a fold", slaved, slaved, symmetric, symmetric, fold, fold),
        Limit(
            "beta = eps, ends in a fold", hidden().layered({z: 1}), hidden(), symmetric, full, fold, fold, True
        ),
        Limit("beta = 0.1, ends by |lam| = 1", hidden(), hidden(), asymmetric, asymmetric, tail, 1.0),
        Limit("rho = 0, sticks", coulomb(sigma=1.2), coulomb(sigma=1.2), symmetric, symmetric, tail, 1.0),
        Limit("rho = 0, crosses only", coulomb(), coulomb(), crossing, crossing, 1.0, 1.0),
    )


CASES = _cases()


def exact_end(case):
    """(y, v) at T_END by the event-driven solver."""
    solution = solve(case.exact, (0, T_END), case.start, rtol=1e-12, atol=1e-14)
    assert solution.success
    return solution.x[:2, -1]


def smooth_end(case, view, eps):
    """(y, v) at T_END of the smoothed view at one eps."""
    values = {"eps": eps} | ({"beta": eps} if case.beta_is_eps else {})
    view = view.with_parameters(values)
    start = np.array(view.initial_state(case.smooth_start), float)
    p = np.array(view.parameter_values, float)
    # well below the model error of the smallest eps, some 1e-5
    run = stiff.integrate(view.model, (0, T_END), start, p, rtol=1e-11, atol=1e-14)
    assert run.status == 0
    return run.x[:2, -1]


def study(case, sigmoid, epsilons=EPSILONS):
    """Distances to the event-driven end, the order from the last two, and the extrapolated distance."""
    expected = case.algebraic if sigmoid == "algebraic" else case.other
    exact = exact_end(case)
    view = case.smooth.smoothed(eps=epsilons[0], sigmoid=sigmoid)
    ends = np.array([smooth_end(case, view, eps) for eps in epsilons])
    distances = np.max(np.abs(ends - exact), axis=1)
    step = epsilons[-2] / epsilons[-1]
    measured = float(np.log(distances[-2] / distances[-1]) / np.log(step))
    extrapolated = (step**expected * ends[-1] - ends[-2]) / (step**expected - 1)
    return {
        "expected": expected,
        "measured": measured,
        "distances": [float(d) for d in distances],
        "extrapolated": float(np.max(np.abs(extrapolated - exact))),
    }
