"""Many events, and events together: accumulation, sliding on several surfaces, simultaneous arrival.

accumulation   a ball with restitution q; x' = -a sgn y - sgn x, y' = a sgn x - sgn y with q = (a - 1)/(a + 1): the
               intervals between events shrink by q, and the limit time is passed or not
sliding        x_i' = d_i - lambda_i - c/(m - 1) sum_{j != i} lambda_j: all m slide, lambda = A^{-1} d
together       x' = -l1 + l2/2, y' = -l2 + 1/5: two arrivals separated by less than any tolerance
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import sympy as sp

from ...definition.primitives import Switch, Unilateral
from ...solving import solve
from ...system import System
from ..efficiency.plain import Plain, plain
from ..efficiency.restarting import restarted
from ..efficiency.timestepping import bouncing, stepper
from .failures import Collapsed, Finding, Stalled, attempt
from .hazard import Axis, Hazard, decades
from .unguarded import quiet, scipy_end

GRAVITY = 9.81
x, y, z = sp.symbols("x y z", real=True)
Q = sp.Symbol("q", positive=True)
l1, l2 = Switch("l1", x), Switch("l2", y)


def stopped(functions: Plain, span: tuple[float, float], start: Any, **options: Any) -> np.ndarray:
    """The state at the end by SciPy's DOP853, stopped at every event and started anew."""
    import warnings

    try:
        with quiet(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return restarted(
                functions, span, np.array(start, float), rtol=1e-10, atol=1e-12, most=500,
                most_evaluations=50_000, **options,
            )[0]  # fmt: skip
    except RuntimeError as error:
        raise (Stalled if "more than" in str(error) else Collapsed) from error
    except (np.linalg.LinAlgError, StopIteration) as error:
        raise Collapsed from error


def not_stopped(method: str, rates: Any, end: float, start: Any, judge: Any) -> Finding:
    """By one of SciPy's methods on a right-hand side with its bare sign."""
    return attempt(scipy_end, judge, method, rates, (0.0, end), start, 1e-6, 1e-8, most=20_000)


# ---- accumulation


def spiral_limit(q: float) -> float:
    """From (1/2, 1/2): to x = 0, then quarter turns that shrink by q."""
    a = (1 + q) / (1 - q)
    first = 0.5 / (a + 1)
    height = 0.5 + (a - 1) * first
    return first + height / (a + 1) / (1 - q)


def ball_limit(q: float) -> float:
    fall = math.sqrt(2 / GRAVITY)
    return fall * (1 + 2 * q / (1 - q))


def accumulation(fast: bool) -> Hazard:
    """How much successive intervals shrink, 1 - q."""
    reaction = Unilateral(x, restitution=Q, name="R").reaction
    ball = System({x: y, y: -GRAVITY + reaction}, parameters={Q: 0.5})
    gain = (1 + Q) / (1 - Q)
    spiral = System({x: -gain * l2 - l1, y: gain * l1 - l2}, parameters={Q: 0.5})

    def problem(q: float, row: float) -> tuple[System, float, tuple[float, float]]:
        if row:
            return spiral, 1.5 * spiral_limit(q), (0.5, 0.5)
        return ball, 1.5 * ball_limit(q), (1.0, 0.0)

    def judged(end: np.ndarray, row: float, bound: float) -> Finding:
        off = float(np.max(np.abs(end)))
        if not row and end[0] < -0.1:
            return Finding("missed event", off)  # fallen through the floor
        return Finding("right" if off <= bound else "drift", off)

    def ours(shrink: float, row: float, **options: Any) -> Finding:
        q = 1 - shrink
        system, end, start = problem(q, row)

        def judge(s: Any) -> Finding:
            return judged(s.x[:, -1], row, 1e-9)  # at rest after the limit: a billionth of the start, rtol

        return attempt(solve, judge, system, (0.0, end), start, parameters={Q: q}, **options)

    def scipy(shrink: float, row: float) -> Finding:
        q = 1 - shrink
        system, end, start = problem(q, row)
        functions, span = plain(system, ("q",)), (0.0, end)
        return attempt(
            stopped, lambda x: judged(x[:2], row, 1e-6), functions, span, (*start, q), max_step=end / 100
        )

    def moreau(shrink: float, row: float) -> Finding:
        q = 1 - shrink
        system, end, start = problem(q, row)
        advance = (stepper if row else bouncing)(plain(system, ("q",)))
        steps = 20_000
        state = advance(0.0, end, np.array([*start, q]), steps, 0.5 if row else q)[0][-1, :2]
        # Of first order: ten steps at the largest speed of the motion, but no more than a hundredth of the start.
        speed = 2 / shrink if row else GRAVITY * math.sqrt(2 / GRAVITY)
        return judged(state, row, min(10 * end / steps * speed, 0.01))

    def bare(method: str, shrink: float, row: float) -> Finding | list[Finding]:
        if not row:
            return []  # an impact is no term of a right-hand side
        q = 1 - shrink
        _, end, start = problem(q, row)
        a = (1 + q) / (1 - q)

        def rates(t: float, s: np.ndarray) -> list[float]:
            sx, sy = np.sign(s)
            return [-a * sy - sx, a * sx - sy]

        return not_stopped(method, rates, end, start, lambda x: judged(x, row, 1e-5))

    return Hazard(
        "accumulation",
        "infinitely many events in finite time",
        Axis(
            "by how much intervals shrink, 1 − q",
            (0.1, 0.7) if fast else (1e-3, 0.003, 0.01, 0.03, 0.1, 0.3, 0.7, 0.9),
        ),
        Axis("system", (0.0, 1.0), ("bouncing ball", "spiral into a corner")),
        {
            "event-driven": ours,
            "event-driven, 8(5,3) pair": functools.partial(ours, method="rk"),
            "DOP853, restarted": scipy,
            **{method: functools.partial(bare, method) for method in ("RK45", "BDF")},
            "Moreau-Jean": moreau,
        },
        unit="distance from rest at 1.5 times the limit time",
        truth="closed form: geometric series",
    )


# ---- several switches that slide


def _coupled(m: int, c: float) -> tuple[System, np.ndarray, np.ndarray]:
    """(system, A, d); the switches slide with lambda = A^{-1} d."""
    states = sp.symbols(f"x0:{m}", real=True)
    lams = [Switch(f"l{i}", s) for i, s in enumerate(states)]
    matrix = np.full((m, m), c / max(1, m - 1))
    np.fill_diagonal(matrix, 1.0)
    drive = 0.3 * np.cos(1.0 + np.arange(m))
    rates = {
        s: sp.Float(drive[i]) - sum((sp.Float(matrix[i, j]) * lams[j] for j in range(m)), sp.Integer(0))
        for i, s in enumerate(states)
    }
    return System(rates), matrix, drive


def several_sliding(fast: bool) -> Hazard:
    """The number of switches that slide together."""
    built = functools.cache(_coupled)
    end = 5.0

    def start(m: int) -> np.ndarray:
        return 0.2 + 0.1 * np.arange(m)

    def judged(state: np.ndarray, bound: float, error: float = 0.0) -> Finding:
        off = float(np.max(np.abs(state)))
        if off > bound:
            return Finding("drift", off)
        return Finding("right" if error < 1e-9 else "inaccurate", off)

    def ours(m: float, c: float, **options: Any) -> Finding:
        system, matrix, drive = built(int(m), c)

        def judge(s: Any) -> Finding:
            error = np.max(np.abs(s.mult[:, -1] - np.linalg.solve(matrix, drive)))
            return judged(s.x[:, -1], 0.0, float(error))  # surfaces that are states: exactly 0

        return attempt(solve, judge, system, (0.0, end), start(int(m)).tolist(), **options)

    # In fast maps the rivals get the largest number only: every number of switches is compiled anew.
    def scipy(m: float, c: float) -> Finding | list[Finding]:
        if fast and m == 1:
            return []
        functions = plain(built(int(m), c)[0])
        return attempt(stopped, lambda x: judged(x, 1e-6), functions, (0.0, end), start(int(m)), max_step=0.1)

    def moreau(m: float, c: float) -> Finding | list[Finding]:
        if fast and m == 1:
            return []
        advance = stepper(plain(built(int(m), c)[0]))
        return judged(advance(0.0, end, start(int(m)), 2000, 0.5)[0][-1], 1e-6)

    def bare(method: str, m: float, c: float) -> Finding:
        _, matrix, drive = built(int(m), c)

        def rates(t: float, s: np.ndarray) -> np.ndarray:
            return drive - matrix @ np.sign(s)

        return not_stopped(method, rates, end, start(int(m)), lambda x: judged(x, 1e-6))

    return Hazard(
        "several-sliding",
        "several switches slide together",
        Axis("number of switches", (1.0, 3.0) if fast else (1.0, 2.0, 3.0, 4.0, 6.0, 8.0)),
        Axis("coupling c", (0.6,)),
        {
            "event-driven": ours,
            "event-driven, 8(5,3) pair": functools.partial(ours, method="rk"),
            "DOP853, restarted": scipy,
            **{method: functools.partial(bare, method) for method in ("RK45", "LSODA", "BDF")},
            "Moreau-Jean": moreau,
        },
        unit="distance from the surfaces at the end",
        truth="closed form: lambda = A^{-1} d, all states 0",
    )


# ---- arrivals together


def pair_integral(separation: float, end: float = 2.0) -> float:
    """z at the end if y arrives `separation` after x, at t = 1: l1 l2 is 1, then 1/2 or 1/5, then 1/50."""
    if separation >= 0:
        return 1 + separation / 2 + (end - 1 - separation) / 50
    # y first: l2 = 1/5 from 1 + separation, x' = -9/10 from x = -separation/2.
    alone = -separation / 2 / 0.9
    return 1 + separation + alone / 5 + (end - 1 - separation - alone) / 50


def simultaneous(fast: bool) -> Hazard:
    """The time between two arrivals."""
    system = System({x: -l1 + l2 / 2, y: -l2 + sp.Rational(1, 5), z: l1 * l2})

    def start(separation: float) -> tuple[float, float, float]:
        return 0.5, 0.8 * (1 + separation), 0.0

    def judged(state: np.ndarray, separation: float, still: float) -> Finding:
        off = float(np.max(np.abs(state[:2])))
        if off > still:
            return Finding("missed event" if off > 1e-3 else "drift", off)
        error = abs(float(state[2]) - pair_integral(separation))
        if error > 1e-2:
            return Finding("wrong itinerary", error)
        return Finding("right" if error < 1e-6 else "inaccurate", error)

    def signed(separation: float, row: float) -> float:
        return -separation if row else separation

    def ours(separation: float, row: float, **options: Any) -> Finding:
        s = signed(separation, row)
        return attempt(solve, lambda run: judged(run.x[:, -1], s, 0.0), system, (0.0, 2.0), start(s), **options)

    def scipy(separation: float, row: float) -> Finding:
        s = signed(separation, row)
        return attempt(stopped, lambda x: judged(x, s, 1e-6), plain(system), (0.0, 2.0), start(s), max_step=0.1)

    def moreau(separation: float, row: float) -> Finding:
        s = signed(separation, row)
        state = stepper(plain(system))(0.0, 2.0, np.array(start(s)), 20_000, 0.5)[0][-1]
        # z is not linear in the multipliers: only whether both are held is asked of this scheme.
        state[2] = pair_integral(s)
        return judged(state, s, 1e-6)

    return Hazard(
        "simultaneous",
        "two arrivals at one instant",
        Axis("time between them (s)", decades(-16, -1, 1 / 3 if fast else 1)),
        Axis("first to arrive", (0.0, 1.0), ("the one that holds the other", "the other")),
        {
            "event-driven": ours,
            "event-driven, 8(5,3) pair": functools.partial(ours, method="rk"),
            "DOP853, restarted": scipy,
            "Moreau-Jean": moreau,
        },
        unit="distance from the surfaces, or error of the integral of l1 l2",
    )
