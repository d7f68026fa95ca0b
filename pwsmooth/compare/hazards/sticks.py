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
from ...solve import solve
from ...system import System
from ..work_precision.plain import plain
from ..work_precision.timestepping import stepper
from .corners import stopped
from .failures import Finding, attempt
from .hazard import Axis, Hazard
from .unguarded import scipy_end

EPS = 1e-8
BOUND = 1e-6  # of displacement, in units in which the block slides by 1 in a unit of time
t, x, v, A = sp.symbols("t x v A", real=True)


@functools.cache
def _block() -> System:
    lam = Switch("lam", v)
    return System({x: v, v: A * (1 + sp.sin(t)) / 2 - lam}, time=t, parameters={A: 0.5})


def creep(share: float, eps: float) -> float:
    """Displacement of a smoothed contact in a cycle."""
    force = share * (1 + np.sin(np.linspace(0, 2 * math.pi, 2000, endpoint=False))) / 2
    return float(2 * math.pi * eps * np.mean(force / np.sqrt(1 - force**2)))


def long_stick(fast: bool) -> Hazard:
    """Cycles of a force below the friction."""

    def judged(states: np.ndarray, bound: float) -> Finding:
        off = float(np.max(np.abs(states[0])))
        return Finding("creep in stick" if off > bound else "right", off)

    def ours(**options: Any) -> Any:
        def trial(cycles: float, share: float) -> Finding:
            span = 0.0, 2 * math.pi * cycles
            run = functools.partial(solve, _block(), span, [0.0, 0.0], parameters={A: share}, **options)
            return attempt(
                run, lambda s: judged(np.vstack([np.abs(s.x).max(axis=0)]), 0.0)
            )  # exactly 0, x and v

        return trial

    def smoothed(cycles: float, share: float) -> Finding:
        view = _block().smoothed(EPS)
        span = 0.0, 2 * math.pi * cycles
        run = functools.partial(
            solve, view, span, [0.0, 0.0], parameters={A: share}, rtol=1e-6, atol=1e-14, max_step=0.5
        )
        return attempt(run, lambda s: judged(s.x, BOUND))

    def scipy(cycles: float, share: float) -> Finding:
        functions, span = plain(_block(), ("A",)), (0.0, 2 * math.pi * cycles)
        return attempt(
            lambda: stopped(functions, span, (0.0, 0.0, share), max_step=0.5 if cycles < 300 else 2.0),
            lambda state: judged(np.array([[state[0]]]), BOUND),
        )

    def moreau(cycles: float, share: float) -> Finding:
        advance, start = stepper(plain(_block(), ("A",))), np.array([0.0, 0.0, share])
        states = advance(0.0, 2 * math.pi * cycles, start, int(100 * cycles), 0.5)[0]
        return judged(states.T, BOUND)

    def bare(method: str) -> Any:
        def trial(cycles: float, share: float) -> Finding:
            def rates(at: float, s: np.ndarray) -> list[float]:
                return [s[1], share * (1 + math.sin(at)) / 2 - np.sign(s[1])]

            return attempt(
                lambda: scipy_end(
                    method, rates, (0.0, 2 * math.pi * cycles), (0.0, 0.0), 1e-6, 1e-8, most=20_000
                ),
                lambda state: judged(state[:, None], BOUND),
            )

        return trial

    return Hazard(
        "long-stick",
        "a thousand cycles at rest",
        Axis("cycles", (1.0, 100.0) if fast else (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)),
        Axis("largest force / friction", (0.9,) if fast else (0.5, 0.9, 0.99)),
        {
            "event-driven": ours(),
            "event-driven, 8(5,3) pair": ours(method="rk"),
            "smoothed path": smoothed,
            "DOP853, restarted": scipy,
            "RK45": bare("RK45"),
            "LSODA": bare("LSODA"),
            "BDF": bare("BDF"),
            "Moreau-Jean": moreau,
        },
        lambda method, share: BOUND / creep(share, EPS) if method == "smoothed path" else math.nan,
        "smoothed: creep of ε F/√(1 − F²) reaches 1e-6 (ε = 1e-8)",
        unit="displacement",
        truth="rest: x = 0 and v = 0",
    )
