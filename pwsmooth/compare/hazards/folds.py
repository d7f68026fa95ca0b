"""Near a fold: a stick under the force A sin t, A = mu_s (1 -+ d), holds for ever or breaks near t = pi/2.

    v' = A sin t - lambda (1 + rho (1 - lambda^2)),     mu_s = 16/9 at lambda_s = 2/3 for rho = 3

A smoothed stand-in follows its layer with delay, and the force is beyond the fold for a short time only. With
kappa = L'(u_s)/eps, excess e = A - mu_s and the deviation delta of lambda from lambda_s,

    delta' = kappa (e - mu_s s^2/2 + 3 rho lambda_s delta^2),

a Riccati equation whose linear form is the parabolic cylinder equation: delta runs away if and only if
3 rho lambda_s kappa^2 e exceeds the ground state kappa sqrt(3 rho lambda_s mu_s/2), that is
d > eps sqrt(1/(6 rho lambda_s mu_s))/ (1 - lambda_s^2)^{3/2}: in proportion to eps.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import sympy as sp

from ...definition.primitives import Switch
from ...solving import solve
from ...system import System
from .failures import Finding, attempt
from .hazard import Axis, Hazard, Trial, decades

RHO, MU, LAM = 3.0, 16 / 9, 2 / 3
EPS = 1e-6
t, v, A = sp.symbols("t v A", real=True)


def delayed(eps: float) -> float:
    """The distance d below which the smoothed stick survives a force beyond its fold."""
    return eps * math.sqrt(1 / (6 * RHO * LAM * MU)) / (1 - LAM**2) ** 1.5


def near_fold(fast: bool) -> Hazard:
    """Distance of the largest force from the fold."""
    lam = Switch("lam", v)
    system = System({v: A * sp.sin(t) - lam * (1 + 3 * (1 - lam**2))}, time=t, parameters={A: 1.0})

    def force(d: float, row: float) -> float:
        return MU * (1 + (d if row else -d))

    def judged(row: float, slips: int, recorded: bool = False) -> Finding:
        if recorded:
            return Finding("recorded")
        if slips == row:
            return Finding("right")
        return Finding("wrong itinerary" if slips > row else "missed event", slips)

    def pushed(judge: Any, view: System, d: float, row: float, **options: Any) -> Finding:
        return attempt(solve, judge, view, (0.0, math.pi), [0.0], parameters={A: force(d, row)}, **options)

    def ours(d: float, row: float, **options: Any) -> Finding:
        def judge(s: Any) -> Finding:
            return judged(row, len(s.event_times("slip")), bool(s.ambiguities))

        return pushed(judge, system, d, row, rtol=1e-12, atol=1e-14, **options)

    def smoothed(d: float, row: float) -> Finding:
        view = system.smoothed(EPS)
        return pushed(lambda s: judged(row, int(max(s["v"]) > 1e-3)), view, d, row, rtol=1e-9, atol=1e-15)

    def moreau(d: float, row: float) -> Finding:
        # The scheme is linear in lambda: the chord of the friction law from -1 to 1 is lambda itself.
        n, speed, highest = 2000, 0.0, 0.0
        h = math.pi / n
        for k in range(n):
            free = speed + h * force(d, row) * math.sin((k + 1) * h)
            speed = free - max(-h, min(h, free))
            highest = max(highest, speed)
        return judged(row, int(highest > 1e-3))

    methods: dict[str, Trial] = {
        "event-driven": ours,
        "event-driven, 8(5,3) pair": functools.partial(ours, method="rk"),
        "smoothed path": smoothed,
        "Moreau-Jean": moreau,
    }
    return Hazard(
        "near-fold",
        "near a fold: does the stick break?",
        Axis("distance |A/μₛ − 1|", decades(-15, -2, 0.5 if fast else 1)),
        Axis("force", (0.0, 1.0), ("below the fold", "beyond the fold")),
        methods,
        lambda method, row: delayed(EPS) if method == "smoothed path" and row else math.nan,
        "smoothed: d = 0.52 ε, from the Riccati equation at the fold (ε = 1e-6)",
        worse="left",
        truth="closed form: max λ(4 − 3λ²) = 16/9",
    )
