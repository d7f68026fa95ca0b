"""Inside the layer: fixed steps on a stick, kicks that throw a contact out of it, and the ratio of two small times.

steps      v' = F - L(v/eps):  at rest in the layer, lambda = F, the rate is (1 - F^2)^{3/2}/eps (algebraic sigmoid)
kicks      v' = F - L(1 + rho (1 - L^2)):  between lambda_1 and lambda_2, the roots of lambda(4 - 3 lambda^2) = F,
           lies the way out: a kick of v beyond eps (u_2 - u_1) ends the stick, u = lambda/sqrt(1 - lambda^2);
           in the limit eps -> 0 all kicks do, so that smoothing gives another answer for kicks below eps
ratio      v' = -F - L(1 + rho z), beta z' = 1 - L^2 - z:  captured on arrival if F < F_c(eps/beta)
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import sympy as sp

from ...analysis.sticking.capture import capture_threshold
from ...definition.primitives import Switch
from ...noise.kicks import Kicks
from ...solving import solve
from ...system import System
from .failures import Finding, attempt
from .fixed import FIXED, REAL, compiled, fixed
from .hazard import Axis, Hazard, decades

RHO = 3.0
v, z, F = sp.symbols("v z F", real=True)
lam = Switch("lam", v)


# ---- fixed steps


def _relay_rates(t, x, p):
    return np.array([p[0] - x[0] / math.sqrt(p[1] * p[1] + x[0] * x[0])])


def layer_steps(fast: bool) -> Hazard:
    """h/eps against the share of friction that is used."""
    eps, start = 1e-4, 0.2
    smoothed = System({v: F - lam}, parameters={F: 0.0}).smoothed(eps)

    def steps(h: float, force: float) -> int:
        landing = start / (1 - force)
        return math.ceil(landing / h) + max(400, math.ceil(40 * eps / (1 - force**2) ** 1.5 / h))

    def judged(speeds: np.ndarray, force: float) -> Finding:
        rest = eps * force / math.sqrt(1 - force**2)
        off = float(np.max(np.abs(speeds - rest)) / (eps + rest))
        return Finding("creep in stick" if not off < 0.01 else "right", off)

    def stepped(method: str, ratio: float, force: float) -> Finding:
        h = ratio * eps
        x = fixed(method, compiled(_relay_rates), 0.0, (start,), h, steps(h, force), (force, eps))
        return judged(x[-100:, 0], force)

    def ours(ratio: float, force: float) -> Finding:
        h = ratio * eps
        view, span = smoothed.with_parameters({F: force}), (0.0, h * steps(h, force))
        return attempt(solve, lambda s: judged(s["v"][-5:], force), view, span, [start], rtol=1e-6, max_step=h)

    return Hazard(
        "layer-steps",
        "fixed steps on a smoothed stick",
        Axis("h/ε", decades(-1, 3, 2 if fast else 8)),
        Axis("force F/N", (0.0, 0.8) if fast else (0.0, 0.5, 0.8, 0.9)),
        {m: functools.partial(stepped, m) for m in FIXED} | {"smoothed path": ours},
        lambda method, force: REAL.get(method, math.inf) / (1 - force**2) ** 1.5,
        "h/ε = 2/(1 − F²)^{3/2} for Euler, 2.785/(1 − F²)^{3/2} for Runge-Kutta 4",
        unit="distance from the rest in the layer, over its width",
    )


# ---- kicks


def way_out(force: float) -> float:
    """u_2 - u_1; 0 where the force is below that of slip: every kick is taken back then, in the limit too."""
    if force <= 1:
        return 0.0
    roots = np.roots([-RHO, 0.0, 1 + RHO, -force])
    inside = sorted(r.real for r in roots if abs(r.imag) < 1e-12 and 0 < r.real < 1)
    u1, u2 = (r / math.sqrt(1 - r * r) for r in inside)
    return u2 - u1


def noise(fast: bool) -> Hazard:
    """kappa/eps: kicks against the width of the layer."""
    eps, every, kicks = 1e-5, 0.01, 100 if fast else 400
    system = System({v: F - lam * (1 + RHO * (1 - lam**2))}, parameters={F: 0.0})
    views = {"smoothed path": system.smoothed(eps), "event-driven": system}

    def judged(s: Any, force: float) -> Finding:
        # In the limit eps -> 0 every kick leaves the layer: slip, with kinetic friction 1, begins if F > 1.
        speed = float(s["v"][-1])
        slipped = speed > 0.01
        if slipped == (force > 1):
            return Finding("right", speed)
        return Finding("wrong itinerary" if slipped else "missed event", speed)

    def kicked(which: System, ratio: float, force: float) -> list[Finding]:
        def trial(seed: int) -> Finding:
            hits = Kicks(ratio * eps, every=every, on="v", seed=seed)
            options = dict(parameters={F: force}, noise=hits, rtol=1e-6)
            return attempt(solve, lambda s: judged(s, force), which, (0.0, every * kicks), [0.0], **options)

        return [trial(seed) for seed in range(2 if fast else 4)]

    return Hazard(
        "noise",
        "kicks and the layer: is the limit ε → 0 met?",
        Axis("size of the kicks κ/ε", decades(-1, 1, 3 if fast else 8)),
        Axis("force F/N", (1.2, 1.6) if fast else (0.9, 1.1, 1.2, 1.4, 1.6, 1.7)),
        {name: functools.partial(kicked, which) for name, which in views.items()},
        lambda method, force: way_out(force) if method == "smoothed path" else math.nan,
        "κ/ε = u₂ − u₁, the way from the stick to the unstable balance; smaller kicks stay inside the layer",
        worse="left",
        unit="velocity at the end",
        truth="closed form of the limit eps -> 0: a kicked contact slips if F > N",
    )


# ---- eps/beta


@functools.cache
def critical_ratio(force: float) -> float:
    """eps/beta at which F_c reaches the force."""
    from scipy.optimize import brentq

    return float(brentq(lambda r: capture_threshold(RHO, r) - force, 1e-6, 0.69, xtol=1e-8))


def capture_ratio(fast: bool) -> Hazard:
    """eps/beta across the value at which a landing sticks."""
    eps, beta = 1e-6, sp.Symbol("beta", positive=True)
    rates = {v: -F - lam * (1 + RHO * z), z: (1 - lam**2 - z) / beta}
    system = System(rates, parameters={F: 0.0, beta: 1.0})
    slaved, two_stage = system.layered({z: sp.oo}), system.layered({z: 0})
    start, end = 0.2, 0.5

    def judged(ratio: float, force: float, speed: float) -> Finding:
        captured = speed > -1e-3
        return Finding("right" if captured == (ratio > critical_ratio(force)) else "wrong itinerary", speed)

    def ours(view_of: Any, ratio: float, force: float) -> Finding:
        def judge(s: Any) -> Finding:
            return judged(ratio, force, float(s["v"][-1]))

        view, values, x0 = view_of(ratio)
        return attempt(solve, judge, view, (0.0, end), x0, parameters={F: force, **values}, rtol=1e-6)

    def moreau(ratio: float, force: float) -> Finding:
        # Linear in lambda: z' takes its value off the surface, so that static friction never builds up.
        h, n = end / 5000, 5000
        speed = start
        for _ in range(n):
            free = speed - h * force
            speed = free - max(-h, min(h, free))
        return judged(ratio, force, speed)

    views = {
        "event-driven, layered": lambda r: (system.layered({z: r}), {}, [start]),
        "smoothed path": lambda r: (system.smoothed(eps), {"beta": eps / r}, [start, 0.0]),
        "event-driven, slaved": lambda r: (slaved, {}, [start]),
        "event-driven, two-stage": lambda r: (two_stage, {}, [start]),
    }
    return Hazard(
        "capture-ratio",
        "two small times: does a landing stick?",
        Axis("ε/β", decades(-3, 0.5, 2 if fast else 8)),
        Axis("force F/N", (1.1, 1.6) if fast else (1.05, 1.1, 1.2, 1.4, 1.6, 1.7)),
        {name: functools.partial(ours, view) for name, view in views.items()} | {"Moreau-Jean": moreau},
        lambda method, force: critical_ratio(force),
        "F = F_c(ε/β), the separatrix of the layer",
        worse="left",
        unit="velocity at the end",
        truth="capture_threshold: separatrix of the layer's own equations",
    )
