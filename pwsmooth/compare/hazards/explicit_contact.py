"""Explicit steps on contacts: the inclusion with residual indentation, and a stiff spring with a dashpot.

    residual       p' = v,  v' = G - (K/m) max(0, p + beta gamma (p - a)),
                   a' = max(-gamma a/(1 + gamma beta), gamma (p - a))
    Kelvin-Voigt   p' = v, v' = G - w^2 (p + (2 zeta/w) v) while p > 0

A body of 1 kg lies on the contact and is struck. The energy of the exact motion falls: it dies out at rest. In
contact both are linear, and the border is where |R(h lambda)| = 1 for the first of their eigenvalues: for the fast
one of the inclusion, near -gamma, this is h = 2/gamma; for an oscillation with damping zeta < 1, h = 2 zeta/w with
Euler, however stiff the contact.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import sympy as sp

from ...laws.contact import KelvinVoigt, LinearResidual
from ...scenes.impact import pressed_block
from .failures import Finding, attempt
from .fixed import FIXED, compiled, fixed, longest_stable
from .hazard import Axis, Hazard, Trial, decades

GRAVITY = 9.81
LIVES = (
    20.0  # of the slowest mode: a step 7 % beyond the border, half a cell of the map, then shows as exp(2.8)
)


def _judged(energy: np.ndarray) -> Finding:
    """By the energy of the deviation from rest in the last tenth of the steps; that of the exact motion only falls."""
    late = float(np.max(energy[len(energy) * 9 // 10 :]) / energy[0])
    if not late < 1e6:  # nor nan
        return Finding("blow-up", late)
    return Finding("energy growth" if late > 1 else "right", late)


def _steps(jacobian: np.ndarray, h: float) -> int:
    """Enough for LIVES, within bounds: with steps far below the border the sign of the change is seen sooner."""
    span = LIVES / float(np.min(-np.linalg.eigvals(jacobian).real))
    return min(20_000, max(400, int(span / h)))


def _methods(
    rates: Any, numbers: Any, start: dict[str, float], jacobian: Any, energy: Any, law: Any, w: float = 1.0
) -> dict[str, Trial]:
    """Trials at (h w, row) of the explicit methods and of the event-driven path.

    rates(t, x, numbers(row)) and law(row) are the contact, jacobian(row) is that of the rates while it is closed,
    energy(row, *x) that of the deviation from rest.
    """

    def stepped(method: str, hw: float, row: float) -> Finding:
        h = hw / w
        steps = _steps(jacobian(row), h)
        x = fixed(method, compiled(rates), 0.0, tuple(start.values()), h, steps, numbers(row))
        with np.errstate(over="ignore", invalid="ignore"):
            return _judged(energy(row, *x.T))

    def ours(hw: float, row: float) -> Finding:
        def judge(s: Any) -> Finding:
            return _judged(energy(row, *(s[name] for name in start)))

        scene, h = pressed_block(law(row), sp.Float(GRAVITY), p0=start["p"]), hw / w
        span = h * _steps(jacobian(row), h)
        return attempt(scene.solve, judge, (0.0, span), {**scene.x0, **start}, max_step=h)

    return {m: functools.partial(stepped, m) for m in FIXED} | {"event-driven": ours}


def dai_contact(fast: bool) -> Hazard:
    """h against 2/gamma."""
    K, beta = 1000.0, 0.02
    rest = GRAVITY / K

    def rates(t, x, p):
        K, beta, gamma, G = p
        push = x[0] + beta * gamma * (x[0] - x[2])
        rate = max(-gamma * x[2] / (1 + gamma * beta), gamma * (x[0] - x[2]))
        return np.array([x[1], G - K * max(0.0, push), rate])

    def jacobian(gamma: float) -> np.ndarray:
        bg = beta * gamma
        return np.array([[0, 1, 0], [-K * (1 + bg), 0, K * bg], [gamma, 0, -gamma]])

    def energy(gamma, p, v, a):
        p, a = p - rest, a - rest
        return v**2 / 2 + K / 2 * (p**2 + beta * gamma * (p - a) ** 2)

    struck = 0.1 * rest * np.sqrt(K)  # a tenth of the speed at which it would lift off
    return Hazard(
        "dai-contact",
        "explicit steps on the contact inclusion",
        Axis("step h (s)", decades(-4, -1, 4 if fast else 16)),
        Axis("γ (1/s)", decades(2, 4, 1 if fast else 4)),
        _methods(
            rates, lambda gamma: (K, beta, gamma, GRAVITY), {"p": rest, "v": struck, "a": rest}, jacobian, energy,
            lambda gamma: LinearResidual(K=K, beta=beta, gamma=gamma),
        ),
        lambda method, gamma: longest_stable(method, jacobian(gamma)),
        "|R(hλ)| = 1 for the eigenvalues in contact; h = 2/γ for the fast one",
        unit="energy left, as a share of that at the start",
        truth="passivity: the energy of the exact motion falls",
    )  # fmt: skip


def stiff_contact(fast: bool) -> Hazard:
    """h w against the damping of a Kelvin-Voigt contact."""
    w = 1000.0
    rest = GRAVITY / w**2

    def rates(t, x, p):
        w, zeta, G = p
        force = w * w * x[0] + 2 * zeta * w * x[1] if x[0] > 0 else 0.0
        return np.array([x[1], G - force])

    def jacobian(zeta: float) -> np.ndarray:
        return np.array([[0, 1], [-w * w, -2 * zeta * w]])

    def energy(zeta, p, v):
        return v**2 / 2 + (w * (p - rest)) ** 2 / 2

    return Hazard(
        "stiff-contact",
        "explicit steps on a Kelvin-Voigt contact",
        Axis("hω", decades(-3, 1, 4 if fast else 16)),
        Axis("damping ζ", decades(-3, 0, 1 if fast else 4)),
        _methods(
            rates, lambda zeta: (w, zeta, GRAVITY), {"p": rest, "v": 0.1 * rest * w}, jacobian, energy,
            lambda zeta: KelvinVoigt(K=w * w, b=2 * zeta / w), w,
        ),
        lambda method, zeta: w * longest_stable(method, jacobian(zeta)),
        "|R(hλ)| = 1: hω = 2ζ for Euler",
        unit="energy left, as a share of that at the start",
        truth="the energy of the exact motion falls",
    )  # fmt: skip
