"""The built-in problems with exact answers; each derivation stands in its function.

Tolerances: event times and states to 1e-9 (a thousand times the tolerance of the run, for errors that the flow
amplifies), 1e-12 where every piece is a polynomial in t, half a unit of the last digit of a table.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import sympy as sp

from ...analysis.sticking.capture import capture_threshold
from ...definition.primitives import Switch, Unilateral
from ...solving import solve
from ...system import System
from .contract import Check, ExactProblem

t, x, y, v, x1, x2, x3 = sp.symbols("t x y v x1 x2 x3", real=True)
TIGHT: dict[str, Any] = dict(rtol=1e-12, atol=1e-14)
FLOW, POLYNOMIAL = 1e-9, 1e-12
HALF_DIGIT = 0.5e-9  # of a table of nine decimals
GRAVITY = 9.81
PROBLEMS: list[ExactProblem] = []


def problem(name, statement, source="closed form"):
    """Adds a generator of Checks to the list."""

    def listed(answer):
        PROBLEMS.append(ExactProblem(name, statement, source, answer))
        return answer

    return listed


def count(quantity, number, expected):
    """A number of events, which has to be right."""
    return Check(quantity, float(number), float(expected), 0.0)


# ---- crossing and sliding


def spirals() -> System:
    """x' = A1 x outside of the unit circle, A2 x inside: one spiral outwards, its turn reversed at |x| = 1."""
    w, inside = 2 * sp.pi, x1**2 + x2**2 < 1
    return System(
        {
            x1: sp.Piecewise((x1 - w * x2, inside), (x1 + w * x2, True)),
            x2: sp.Piecewise((w * x1 + x2, inside), (-w * x1 + x2, True)),
        }
    )


def spiral_end() -> tuple[float, float]:
    """The radius grows as exp(t - 1) on both sides; after t = 1 the angle runs back."""
    r, angle = math.exp(math.pi / 2 - 1), -2 * math.pi * (math.pi / 2 - 1)
    return r * math.cos(angle), r * math.sin(angle)


@problem("spirals", "x' = A1 x for |x| > 1, A2 x for |x| < 1, from (1/e, 0)")
def _spirals():
    solution = solve(spirals(), (0, math.pi / 2), {x1: math.exp(-1), x2: 0}, **TIGHT)
    yield count("events", len(solution.events), 1)
    yield Check("time of the crossing", solution.events[0].time, 1.0, FLOW)
    for name, end, exact in zip(("x1", "x2"), solution.x[:, -1], spiral_end()):
        yield Check(f"{name}(pi/2)", end, exact, FLOW)


def relays() -> System:
    """One surface in two notations."""
    return System(
        {x: sp.Piecewise((-2, x > y), (2, True)), y: sp.Piecewise((-3, y > x), (sp.Rational(3, 2), True))}
    )


@problem("relays", "x' = -2 if x > y else 2, y' = -3 if y > x else 3/2, from (3/2, 1)")
def _relays():
    # On x = y: -2 lam = -3/4 + 9/4 lam, lam = 3/17, x' = y' = -6/17 from (17/14, 17/14) at t = 1/7.
    solution = solve(relays(), (0, 1), {x: 1.5, y: 1}, **TIGHT)
    yield count("events", len(solution.events), 1)
    yield Check("start of sliding", solution.events[0].time, 1 / 7, POLYNOMIAL)
    yield Check("lambda while sliding", solution[solution.multipliers[0]][-1], 3 / 17, POLYNOMIAL)
    yield Check("x(1)", solution["x"][-1], 31 / 34, POLYNOMIAL)
    yield Check("y(1)", solution["y"][-1], 31 / 34, POLYNOMIAL)


def dry_oscillator() -> System:
    """A mass on a spring under Coulomb friction, free."""
    return System({x: v, v: -x - sp.sign(v)})


@problem("dry-oscillator", "x'' + x in -Sgn(x'), x = 12, x' = 6")
def _dry_oscillator():
    # Half turns about -1 and 1 in turn: the radius shrinks by 2 at each, until |x| < 1 at the eighth reversal.
    solution = solve(dry_oscillator(), (0, 40), {x: 12, v: 6}, **TIGHT)
    yield count("events", len(solution.events), 8)
    for k, event in enumerate(solution.events):
        yield Check(f"time of reversal {k + 1}", event.time, math.atan(6 / 13) + k * math.pi, FLOW)
    yield Check("x at rest", solution["x"][-1], 15 - math.sqrt(205), FLOW)
    yield Check("v at rest", solution["v"][-1], 0.0, 0.0)


# ---- hidden terms


def hidden_pair(hidden: bool) -> System:
    """(-lam, 2 lam^2 - 1) or (-lam, 1): equal off the surface x1 = 0, different on it."""
    lam = Switch("lam", x1)
    return System({x1: -lam, x2: 2 * lam**2 - 1 if hidden else sp.Integer(1)})


@problem("hidden-term", "x' = (-lam, 2 lam^2 - 1) and (-lam, 1), lam = sign x1")
def _hidden_term():
    for hidden, slope in ((True, -1.0), (False, 1.0)):
        solution = solve(hidden_pair(hidden), (0, 2), {x1: 0.5, x2: 0.25}, **TIGHT)
        yield Check("start of sliding", solution.events[0].time, 0.5, POLYNOMIAL)
        # x2' = 1 off the surface in both.
        name = "2 lam^2 - 1" if hidden else "1"
        yield Check(f"x2(2) of x2' = {name}", solution["x2"][-1], 0.75 + 1.5 * slope, POLYNOMIAL)


def inner_relaxation() -> System:
    """A relaxation oscillation inside the surface x1 = 0."""
    lam = Switch("lam", x1)
    return System({x1: x2 / 10 + lam - 2 * lam**3, x2: -lam})


@problem("inner-relaxation", "x' = (x2/10 + lam - 2 lam^3, -lam), lam = sign x1")
def _inner_relaxation():
    # Sliding: x2 = 10 (2 lam^3 - lam), x2' = -lam. From where a fold lands, -2/sqrt 6, to the next fold, -1/sqrt 6,
    # takes the time int 10 (6 lam - 1/lam) d lam = 15 - 10 ln 2; x2 there is 20/(3 sqrt 6).
    solution = solve(inner_relaxation(), (0, 200), {x1: -0.1, x2: 0}, **TIGHT)
    folds = [event.time for event in solution.events if "sliding" in event.kind or "fold" in event.kind]
    yield count("events that are no fold", len(solution.events) - len(folds), 1)
    gaps = np.diff(folds)
    yield Check(
        "period (farthest of all half periods)",
        2 * gaps[np.argmax(abs(gaps - gaps.mean()))],
        30 - 20 * math.log(2),
        2 * FLOW,
    )
    yield Check("max |x2|", np.max(np.abs(solution["x2"])), 20 / (3 * math.sqrt(6)), FLOW)
    slid = solution["x1"][solution.t >= solution.events[0].time]
    yield Check("max |x1| while sliding", np.max(np.abs(slid)), 0.0, 0.0)


# ---- impacts


def ball(restitution) -> System:
    """A ball falling on a floor under gravity."""
    return System({y: v, v: -GRAVITY + Unilateral(y, restitution=restitution, name="R").reaction})


@problem("elastic-ball", "y'' = -9.81 m/s^2 over a floor, e = 1, from 1 m")
def _elastic_ball():
    fall = math.sqrt(2 / GRAVITY)
    solution = solve(ball(1), (0, 200.5 * fall), {y: 1.0, v: 0}, **TIGHT)
    impacts = solution.event_times("impact")
    yield count("impacts", len(impacts), 100)
    yield Check("time of impact 100 (s)", impacts[-1], 199 * fall, FLOW)
    energy = solution["v"] ** 2 / 2 + GRAVITY * solution["y"]
    # 100 impacts, each with its share of rounding and of the tolerance 1e-12.
    yield Check("energy drift / energy", np.max(np.abs(energy / GRAVITY - 1)), 0.0, 100 * 1e-12)


@problem("dying-ball", "y'' = -9.81 m/s^2 over a floor, e = 0.9, from 1 m")
def _dying_ball():
    # fall (1 + 2 e/(1 - e)) = 19 fall for e = 9/10, then at rest under its weight.
    fall = math.sqrt(2 / GRAVITY)
    solution = solve(ball(sp.Rational(9, 10)), (0, 20 * fall), {y: 1.0, v: 0}, **TIGHT)
    end = [event.time for event in solution.events if event.kind in ("accumulation", "closed contact")]
    yield Check("end of all bounces (s)", end[-1] if end else math.nan, 19 * fall, FLOW)
    yield Check("y at rest (m)", solution["y"][-1], 0.0, 0.0)
    yield Check("reaction at rest (N/kg)", solution["R"][-1], GRAVITY, POLYNOMIAL)


# ---- what is not unique is said


def two_fold(V) -> System:
    """An invisible two-fold at the origin."""
    right = x1 > 0
    return System(
        {
            x1: sp.Piecewise((-x2, right), (x3, True)),
            x2: sp.Piecewise((1, right), (V, True)),
            x3: sp.Piecewise((V, right), (1, True)),
        }
    )


@problem("two-fold", "x1 > 0: (-x2, 1, -2), x1 < 0: (x3, -2, 1), from (0, 1/2, 1/2)")
def _two_fold():
    # On x2 = x3 sliding has lam = 0 and x2' = x3' = (1 + V)/2 = -1/2: at the origin after 2 a.
    a = 0.5
    solution = solve(two_fold(-2), (0, 2), {x1: 0, x2: a, x3: a}, **TIGHT)
    met = [record.time for record in solution.ambiguities if record.kind == "two-fold"]
    yield Check("time of the two-fold, as reported", met[0] if met else math.nan, 2 * a, FLOW)


@problem("repelling", "x' = sign x from 0")
def _repelling():
    solution = solve(System({x: sp.sign(x)}), (0, 1), {x: 0})
    kinds = [record.kind for record in solution.ambiguities]
    yield count("reports of repelling sliding", kinds.count("repelling sliding"), 1)
    yield Check("their time", solution.ambiguities[0].time if kinds else math.nan, 0.0, 0.0)


# ---- the friction oscillator


def friction_oscillator(rho) -> System:
    """x'' + c x' + k x = -sigma sin t - mu, mu = lam (1 + rho (1 - lam^2)): static friction as a hidden term."""
    lam = Switch("lam", v)
    mu = lam * (1 + rho * (1 - lam**2))
    return System({y: v, v: -2.4 * sp.sin(t) - 3.1 * y - 0.1 * v - mu}, time=t)


@problem("fold-force", "friction oscillator, slaved, rho = 3, k = 3.1, c = 0.1, N = 1, sigma = 2.4")
def _stick_balance():
    # A stick of the slaved oscillator ends in the fold, where |sigma sin t + k y| = mu_s = 16/9.
    solution = solve(friction_oscillator(3), (0, 60), {y: 0.78, v: -1.03}, dense_output=True, **TIGHT)
    ends = np.array([event.time for event in solution.events if event.kind == "slip by fold"])
    yield count(
        "sticks that end by |lambda| = 1", sum(e.kind == "slip by tangency" for e in solution.events), 0
    )
    force = np.abs(2.4 * np.sin(ends) + 3.1 * solution(ends, "y"))
    yield Check("force at the folds (farthest)", force[np.argmax(abs(force - 16 / 9))], 16 / 9, FLOW)


@problem(
    "slaved-orbit",
    "friction oscillator, slaved, rho = 3, 2, 1: sticks of the periodic orbit",
    "an independent computation, nine decimals",
)
def _slaved_orbit():
    rows = ((3, 0.539389027, 1.755610496), (2, 0.350778709, 1.789548342), (1, 0.070676656, 1.813524584))
    for rho, stick, phase in rows:
        solution = solve(friction_oscillator(rho), (0, 400 * 2 * math.pi), {y: 0.78, v: -1.03}, **TIGHT)
        start = solution.event_times("stick")[-3]
        end = next(time for time in solution.event_times("slip by fold") if time > start)
        yield Check(f"duration of the stick, rho = {rho}", end - start, stick, HALF_DIGIT)
        # Two sticks a period, half a period apart.
        yield Check(f"its phase modulo pi, rho = {rho}", start % math.pi, phase, HALF_DIGIT)


@problem(
    "capture",
    "u' = F - L(u)(1 + 3 z), z' = r (G(u) - z): the separatrix",
    "two independent computations that agree to the digits given",
)
def _capture():
    # Two independent computations of the separatrix agree to these digits (algebraic sigmoid, rho = 3).
    for ratio, threshold in (
        (0.001, 1.029986),
        (0.01, 1.129780),
        (0.1, 1.456936),
        (0.3, 1.690079),
        (0.5, 1.765479),
    ):
        yield Check(f"F_c({ratio}) / N", capture_threshold(3, ratio), threshold, 0.5e-6)
    yield Check("F_c(inf) / N", capture_threshold(3, math.inf), 16 / 9, POLYNOMIAL)


@problem(
    "den-hartog",
    "x'' + x = sin(0.7 t) - 0.3 sign(x'): the symmetric non-sticking orbit",
    "Den Hartog 1931, closed form",
)
def _den_hartog():
    # J. P. Den Hartog (1931): the symmetric non-sticking orbit of x'' + x = sin(w t) - F sign(x').
    w, F = 0.7, 0.3
    V, U = 1 / (1 - w * w), math.tan(math.pi / (2 * w)) / w
    from scipy.optimize import root

    system = System({x: v, v: -x + sp.sin(w * t) - F * sp.sign(v)}, time=t)

    def half_turn(unknown):
        """From rest at the amplitude x = a at time s: half a period later the mirror image."""
        s, a = unknown
        end = solve(system, (s, s + math.pi / w), {x: a, v: 0}, **TIGHT).x[:, -1]
        return end[0] + a, end[1]

    begin = (math.pi / w, math.sqrt(V * V - F * F * U * U) * 1.01)
    orbit = root(half_turn, begin, tol=1e-13)
    yield Check("amplitude", abs(orbit.x[1]), math.sqrt(V * V - F * F * U * U), FLOW)
