"""Long sticks: a block at rest under a force that never reaches its friction, for a thousand cycles.

    x' = v,  v' = A (1 + sin t)/2 - lambda,  A < 1:   x = 0 and v = 0 for ever

A smoothed contact creeps: v = eps F/sqrt(1 - F^2), which adds up to
eps int_0^{2 pi} F/sqrt(1 - F^2) dt a cycle, F = A (1 + sin t)/2.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import sympy as sp

from ...definition.primitives import Switch
from ...solving import solve
from ...system import System
from ..efficiency.plain import plain
from ..efficiency.timestepping import stepper
from .corners import not_stopped, stopped
from .failures import Finding, attempt
from .hazard import Axis, Hazard

EPS = 1e-8
BOUND = 1e-6  # of displacement, in units in which the block slides by 1 in a unit of time
t, x, v, A = sp.symbols("t x v A", real=True)


def creep(share: float, eps: float) -> float:
    """Displacement of a smoothed contact in a cycle."""
    force = share * (1 + np.sin(np.linspace(0, 2 * math.pi, 2000, endpoint=False))) / 2
    return float(2 * math.pi * eps * np.mean(force / np.sqrt(1 - force**2)))


def long_stick(fast: bool) -> Hazard:
    """Cycles of a force below the friction."""
    rates = {x: v, v: A * (1 + sp.sin(t)) / 2 - Switch("lam", v)}
    block = System(rates, time=t, parameters={A: 0.5})

    def judged(displacement: np.ndarray, bound: float = BOUND) -> Finding:
        off = float(np.max(np.abs(displacement)))
        return Finding("creep in stick" if off > bound else "right", off)

    def run_of(view: System, judge: Any, cycles: float, share: float, **options: Any) -> Finding:
        span = 0.0, 2 * math.pi * cycles
        return attempt(solve, judge, view, span, [0.0, 0.0], parameters={A: share}, **options)

    def ours(cycles: float, share: float, **options: Any) -> Finding:
        return run_of(block, lambda s: judged(s.x, 0.0), cycles, share, **options)  # exactly 0, x and v

    def smoothed(cycles: float, share: float) -> Finding:
        tolerances = dict(rtol=1e-6, atol=1e-14, max_step=0.5)
        return run_of(block.smoothed(EPS), lambda s: judged(s.x[0]), cycles, share, **tolerances)

    def scipy(cycles: float, share: float) -> Finding:
        functions, span = plain(block, ("A",)), (0.0, 2 * math.pi * cycles)
        longest = 0.5 if cycles < 300 else 2.0
        return attempt(stopped, lambda x: judged(x[0]), functions, span, (0.0, 0.0, share), max_step=longest)

    def moreau(cycles: float, share: float) -> Finding:
        advance, start = stepper(plain(block, ("A",))), np.array([0.0, 0.0, share])
        return judged(advance(0.0, 2 * math.pi * cycles, start, int(100 * cycles), 0.5)[0][:, 0])

    def bare(method: str, cycles: float, share: float) -> Finding:
        def rates(at: float, s: np.ndarray) -> list[float]:
            return [s[1], share * (1 + math.sin(at)) / 2 - np.sign(s[1])]

        return not_stopped(method, rates, 2 * math.pi * cycles, (0.0, 0.0), lambda x: judged(x[0]))

    return Hazard(
        "long-stick",
        "a thousand cycles at rest",
        Axis("cycles", (1.0, 100.0) if fast else (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)),
        Axis("largest force / friction", (0.9,) if fast else (0.5, 0.9, 0.99)),
        {
            "event-driven": ours,
            "event-driven, 8(5,3) pair": functools.partial(ours, method="rk"),
            "smoothed path": smoothed,
            "DOP853, restarted": scipy,
            **{method: functools.partial(bare, method) for method in ("RK45", "LSODA", "BDF")},
            "Moreau-Jean": moreau,
        },
        lambda method, share: BOUND / creep(share, EPS) if method == "smoothed path" else math.nan,
        "smoothed: creep of ε F/√(1 − F²) reaches 1e-6 (ε = 1e-8)",
        unit="displacement",
        truth="rest: x = 0 and v = 0",
    )
