"""Explicit steps on bristle laws: LuGre at speed, and the inclusion of Xiong, Kikuuwe and Yamamoto.

    LuGre          dz/dt = v - sigma0 |v| z/g(v)                 relaxes at sigma0 |v|/g: h < 2 g/(sigma0 |v|)
    XKY            da/dt = (clip(kappa a + sigma v, g) - kappa a)/sigma    saturated at kappa/sigma: h < 2 sigma/kappa

LuGre: a block of 1 kg under the force that keeps it at the speed V, its bristles 10 % off their steady deflection. At
that state J is triangular with the eigenvalues -sigma0 V/g and -sigma2/m, so that the border is exact. No exact
motion leaves |z| <= max(|z0|, F_s/sigma0).
XKY: prescribed v = V cos(t), whose element saturates once each half period and relaxes there: beyond the border a
oscillates from step to step, and the element falls back into presliding where the exact one is saturated.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import sympy as sp

from ...laws.friction import XKY, LuGre
from ...laws.friction.realtime import real_time
from ...scenes.prescribed import prescribed_motion
from ...scenes.sliding import force_driven
from .failures import Finding, attempt, held
from .fixed import FIXED, REAL, compiled, fixed
from .hazard import Axis, Hazard, decades

LIVES = 40.0  # relaxation times, and at least 400 steps: a growth of 7 % a step, half a cell of the map, shows


def _lugre_rates(t, x, p):
    sigma0, sigma1, sigma2, Fc, Fs, vs, u = p
    z, v = x
    g = Fc + (Fs - Fc) * math.exp(-((v / vs) ** 2))
    dz = v - sigma0 * abs(v) * z / g
    return np.array([dz, u - sigma0 * z - sigma1 * dz - sigma2 * v])


def lugre(fast: bool) -> Hazard:
    """h against 2 g/(sigma0 |v|)."""
    law = LuGre()

    def strength(V: float) -> float:
        return law.F_c + (law.F_s - law.F_c) * math.exp(-((V / law.v_s) ** 2))

    def judged(z: np.ndarray, v: np.ndarray, V: float) -> Finding:
        bound = law.F_s / law.sigma0
        with np.errstate(over="ignore"):
            broken = held(z**2, bound**2)  # an energy but for a factor
        if broken:
            return broken
        # The 10 % of the start must decay: more than a tenth of it left counts as not decayed.
        off = abs(z[-1] * law.sigma0 / strength(v[-1]) - 1)
        return Finding("inaccurate" if off > 1e-2 else "right", off)

    def number(h: float, V: float) -> int:
        """Of steps."""
        return min(20_000, max(400, math.ceil(LIVES * strength(V) / (law.sigma0 * V) / h)))

    def stepped(method: str, h: float, V: float) -> Finding:
        p = law.sigma0, law.sigma1, law.sigma2, law.F_c, law.F_s, law.v_s, strength(V) + law.sigma2 * V
        start = 1.1 * strength(V) / law.sigma0, V
        out = fixed(method, compiled(_lugre_rates), 0.0, start, h, number(h, V), p)
        return judged(out[:, 0], out[:, 1], V)

    def closed(h: float, V: float) -> Finding:
        u, block = strength(V) + law.sigma2 * V, real_time(law)
        block.state[0] = 1.1 * strength(V) / law.sigma0
        v, track = V, []
        for _ in range(number(h, V)):
            v = block.move(v, u, 1.0, h)
            track.append((block.state[0], v))
        z, speeds = np.array(track).T
        return judged(z, speeds, V)

    def ours(h: float, V: float) -> Finding:
        scene = force_driven(law, sp.Float(strength(V) + law.sigma2 * V))
        start = {**scene.x0, "v": V, "z": 1.1 * strength(V) / law.sigma0}
        # The step follows the bristles' own relaxation, and h is only its bound. A thousand relaxations are enough.
        span = min(h * number(h, V), 1000 * strength(V) / (law.sigma0 * V))
        return attempt(scene.solve, lambda s: judged(s["z"], s["v"], V), (0.0, span), start, max_step=h)

    return Hazard(
        "lugre",
        "explicit steps on LuGre's bristles",
        Axis("step h (s)", decades(-6, -2, 4 if fast else 16)),
        Axis("speed v (m/s)", decades(-2, 0, 1 if fast else 4)),
        {
            **{m: functools.partial(stepped, m) for m in FIXED},
            "closed-form backward Euler": closed,
            "event-driven": ours,
        },
        lambda method, V: REAL.get(method, math.inf) * strength(V) / (law.sigma0 * V),
        "h = 2 g/(σ₀|v|) for Euler, 2.785 g/(σ₀|v|) for Runge-Kutta 4",
        unit="energy over its bound, or relative error of z",
        truth="the invariant |z| <= F_s/sigma0, and the steady deflection",
    )


def _xky_rates(t, x, p):
    kappa, sigma, g, V = p
    trial = kappa * x[0] + sigma * V * math.cos(t)
    return np.array([(min(g, max(-g, trial)) - kappa * x[0]) / sigma])


def dai_friction(fast: bool) -> Hazard:
    """h against 2 sigma/kappa, at constant strength g = 1 N."""
    kappa, g, V, end = 2.5, 1.0, 10.0, 2 * math.pi

    def saturations(at: np.ndarray, a: np.ndarray, sigma: float) -> int:
        """How often the element enters or leaves saturation."""
        saturated = np.abs(kappa * a + sigma * V * np.cos(at)) > g
        return int(np.count_nonzero(np.diff(saturated.astype(int))))

    def stepping(method: str, h: float, sigma: float) -> tuple[np.ndarray, np.ndarray]:
        """Times and a, by steps of at most h."""
        steps = math.ceil(end / h)
        a = fixed(method, compiled(_xky_rates), 0.0, [0.0], end / steps, steps, (kappa, sigma, g, V))[:, 0]
        return np.linspace(0, end, steps + 1), a

    @functools.cache
    def truth(sigma: float) -> tuple[int, float]:
        at, a = stepping("Runge-Kutta 4", sigma / kappa / 50, sigma)
        return saturations(at, a, sigma), float(a[-1])

    def judged(at: np.ndarray, a: np.ndarray, sigma: float) -> Finding:
        changes, last = truth(sigma)
        broken = held(np.abs(a), g / kappa + sigma * V / kappa, 1e-6)
        if broken:
            return broken
        extra = saturations(at, a, sigma) - changes
        if extra:
            return Finding("wrong itinerary", float(extra))
        off = abs(a[-1] - last) * kappa / g
        return Finding("inaccurate" if off > 0.1 else "right", off)

    def stepped(method: str, h: float, sigma: float) -> Finding:
        return judged(*stepping(method, h, sigma), sigma)

    time = sp.Symbol("t", real=True)

    def ours(h: float, sigma: float) -> Finding:
        element = XKY(kappa=kappa, sigma=sigma, F_c=g, F_s=g, v_s=1.0, sigma2=0.0)
        scene = prescribed_motion(element, velocity=V * sp.cos(time), t_span=(0.0, end))
        return attempt(scene.solve, lambda s: judged(s.t, s["a"], sigma), max_step=h)

    return Hazard(
        "dai-friction",
        "explicit steps on the friction inclusion",
        Axis("step h (s)", decades(-4, -1.5, 4 if fast else 12)),
        Axis("micro-damping σ (N s/µm)", decades(-3, -1, 1 if fast else 4)),
        {m: functools.partial(stepped, m) for m in FIXED} | {"event-driven": ours},
        lambda method, sigma: REAL.get(method, math.inf) * sigma / kappa,
        "h = 2 σ/κ for Euler, 2.785 σ/κ for Runge-Kutta 4",
        unit="saturations too many, or relative error of the force",
        truth="Runge-Kutta 4 at a fiftieth of the relaxation time",
    )
