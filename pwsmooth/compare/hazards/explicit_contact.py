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

import numpy as np
import sympy as sp

from ...laws.contact import KelvinVoigt, LinearResidual
from ...scenes.impact import pressed_block
from .failures import Finding, attempt
from .fixed import FIXED, compiled, fixed, longest_stable
from .hazard import Axis, Hazard, decades

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


def dai_contact(fast: bool) -> Hazard:
    """h against 2/gamma."""
    K, beta = 1000.0, 0.02
    rest = GRAVITY / K

    @functools.cache
    def rates():
        def f(t, x, p):
            K, beta, gamma, G = p
            push = x[0] + beta * gamma * (x[0] - x[2])
            rate = max(-gamma * x[2] / (1 + gamma * beta), gamma * (x[0] - x[2]))
            return np.array([x[1], G - K * max(0.0, push), rate])

        return compiled(f)

    def jacobian(gamma: float) -> np.ndarray:
        bg = beta * gamma
        return np.array([[0, 1, 0], [-K * (1 + bg), 0, K * bg], [gamma, 0, -gamma]])

    def energy(p, v, a, gamma):
        p, a = p - rest, a - rest
        return v**2 / 2 + K / 2 * (p**2 + beta * gamma * (p - a) ** 2)

    struck = 0.1 * rest * np.sqrt(K)  # a tenth of the speed at which it would lift off

    def stepped(method):
        def trial(h: float, gamma: float) -> Finding:
            x = fixed(
                method,
                rates(),
                0.0,
                (rest, struck, rest),
                h,
                _steps(jacobian(gamma), h),
                (K, beta, gamma, GRAVITY),
            )
            with np.errstate(over="ignore", invalid="ignore"):
                return _judged(energy(x[:, 0], x[:, 1], x[:, 2], gamma))

        return trial

    def ours(h: float, gamma: float) -> Finding:
        scene = pressed_block(LinearResidual(K=K, beta=beta, gamma=gamma), sp.Float(GRAVITY), p0=rest)
        start = {**scene.start, "v": struck, "a": rest}
        span = h * _steps(jacobian(gamma), h)
        return attempt(
            lambda: scene.solve((0.0, span), start, max_step=h),
            lambda s: _judged(energy(s["p"], s["v"], s["a"], gamma)),
        )

    return Hazard(
        "dai-contact",
        "explicit steps on the contact inclusion",
        Axis("step h (s)", decades(-4, -1, 4 if fast else 16)),
        Axis("γ (1/s)", decades(2, 4, 1 if fast else 4)),
        {m: stepped(m) for m in FIXED} | {"event-driven": ours},
        lambda method, gamma: longest_stable(method, jacobian(gamma)),
        "|R(hλ)| = 1 for the eigenvalues in contact; h = 2/γ for the fast one",
        unit="energy left, as a share of that at the start",
        truth="passivity: the energy of the exact motion falls",
    )


def stiff_contact(fast: bool) -> Hazard:
    """h w against the damping of a Kelvin-Voigt contact."""
    w = 1000.0
    rest = GRAVITY / w**2

    @functools.cache
    def rates():
        def f(t, x, p):
            w, zeta, G = p
            force = w * w * x[0] + 2 * zeta * w * x[1] if x[0] > 0 else 0.0
            return np.array([x[1], G - force])

        return compiled(f)

    def jacobian(zeta: float) -> np.ndarray:
        return np.array([[0, 1], [-w * w, -2 * zeta * w]])

    struck = 0.1 * rest * w

    def stepped(method):
        def trial(hw: float, zeta: float) -> Finding:
            h = hw / w
            steps = _steps(jacobian(zeta), h)
            p, v = fixed(method, rates(), 0.0, (rest, struck), h, steps, (w, zeta, GRAVITY)).T
            with np.errstate(over="ignore", invalid="ignore"):
                return _judged(v**2 / 2 + (w * (p - rest)) ** 2 / 2)

        return trial

    def ours(hw: float, zeta: float) -> Finding:
        scene = pressed_block(KelvinVoigt(K=w * w, b=2 * zeta / w), sp.Float(GRAVITY), p0=rest)
        span = hw / w * _steps(jacobian(zeta), hw / w)
        return attempt(
            lambda: scene.solve((0.0, span), {**scene.start, "v": struck}, max_step=hw / w),
            lambda s: _judged(s["v"] ** 2 / 2 + (w * (s["p"] - rest)) ** 2 / 2),
        )

    return Hazard(
        "stiff-contact",
        "explicit steps on a Kelvin-Voigt contact",
        Axis("hω", decades(-3, 1, 4 if fast else 16)),
        Axis("damping ζ", decades(-3, 0, 1 if fast else 4)),
        {m: stepped(m) for m in FIXED} | {"event-driven": ours},
        lambda method, zeta: w * longest_stable(method, jacobian(zeta)),
        "|R(hλ)| = 1: hω = 2ζ for Euler",
        unit="energy left, as a share of that at the start",
        truth="the energy of the exact motion falls",
    )
