"""Singular arguments: no step is continued through a pole, a branch point or the end of a domain unseen.

Closed forms throughout: h' = -h^p arrives at t = h0^(1 - p)/(1 - p) and rests; |v|' = -|v|^(-1/5) ends, where it began
with v0, at t = v0^1.2/1.2. And what is no singular point is not watched.

Guards: definition/singular.py, kernels/step/singular.py.
"""

import math
import random

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from pwsmooth import Algebraic, Event, Family, Outcome, System, solve
from pwsmooth.compare.efficiency.cases import CASES

t, x, y, u, v, w, h, a = sp.symbols("t x y u v w h a", real=True)
m = sp.Symbol("m", positive=True)
METHODS = pytest.mark.parametrize("method", ["taylor", "rk"])
ALL = pytest.mark.parametrize("method", ["taylor", "rk", "stiff"])
r = sp.sqrt(u**2 + v**2)


def watched(rate, **options):
    """(kind, argument) of what is watched in x' = rate."""
    model = System({x: rate, **dict.fromkeys(rate.free_symbols & {y}, sp.S.Zero)}, **options).model
    return [(e.singular, e.surface) for e in model.events]


# ---- what is watched


@pytest.mark.parametrize(
    ("rate", "kind", "argument"),
    [
        (-sp.sqrt(x), "end", x),
        (x ** sp.Rational(3, 2), "end", x),
        (sp.log(x), "pole", x),
        (1 / (x - 1), "pole", x - 1),
        (sp.tan(x), "pole", sp.cos(x)),
        (sp.cot(x), "pole", sp.sin(x)),
        (sp.atanh(x), "pole", 1 - x),
        (sp.acosh(x), "end", x - 1),
        (1 / sp.sqrt(x**2 + y**2), "pole", x**2 + y**2),
        (sp.sqrt(x**2 + y**2), "cone", x**2 + y**2),
        (-sp.sign(x) * sp.sqrt(sp.Abs(x)), "branch", x),
        (-x / sp.sqrt(sp.Abs(x)), "branch", x),
        (sp.log(sp.Abs(x)), "pole", x),
    ],
)
def test_a_singular_argument_is_watched(rate, kind, argument):
    assert (kind, argument) in watched(rate)


@pytest.mark.parametrize(
    "rate",
    [
        1 / (1 + x**2),
        1 / (2 + sp.cos(x)),
        sp.log(1 + sp.Abs(x)),
        x / (m + sp.Abs(x - 1)),
        1 / (m + (m + 1 - m) * sp.exp(-(x**2))),
        sp.sqrt(m**2 + x**2),
        sp.asin(sp.tanh(x) / 2),
        sp.Abs(x) ** sp.Rational(3, 2),
        sp.Max(0, x) ** sp.Rational(5, 2),
        x / sp.Abs(x),
        sp.atan2(sp.sin(x), sp.cos(x)),
        # In a branch its condition is known.
        sp.Piecewise((1 / x, x > m), (0, True)),
        sp.Piecewise((sp.log(m - 2 * x), x < -1), (0, True)),
        sp.Piecewise((1 / sp.sqrt(m + (x**2 - 1) / (2 + x**2)), x**2 > 1), (0, True)),
    ],
)
def test_what_never_vanishes_is_not_watched(rate):
    assert watched(rate, parameters={m: 1} if rate.has(m) else {}) == []


def test_the_sign_of_a_state_is_not_believed():
    level = sp.Symbol("level", positive=True)
    assert System({level: -sp.sqrt(level)}).model.events[0].singular == "end"


@pytest.mark.parametrize("name", sorted(set(CASES) - {"slider-crank"}))
def test_the_scenes_of_the_comparison_watch_nothing(name):
    assert not any(event.singular for event in CASES[name].system.model.events)


def test_a_system_lists_what_it_watches():
    text = repr(System({x: -sp.sqrt(x), y: 1 / (y - 1)}))
    assert "sqrt(x) at x = 0   (end)" in text and "at y - 1 = 0   (pole)" in text


def test_members_of_a_family_are_watched():
    (z,) = Family(10).symbols("z")
    solution = solve(System({z: -sp.sqrt(z)}), (0, 3), {z: [1 + 0.1 * k for k in range(10)]})
    # z_k = (sqrt(z0) - t/2)^2 until it rests at 2 sqrt(z0); an error atol in z is one of sqrt(atol) in that
    assert solution.outcome is Outcome.FINISHED
    assert solution.event_times("rest") == pytest.approx(
        [2 * math.sqrt(1 + 0.1 * k) for k in range(10)], abs=10 * math.sqrt(1e-12)
    )
    assert np.all(solution.x[:, -1] == 0.0)


# ---- poles: the run ends there and says so


@ALL
def test_a_force_that_grows_towards_rest_ends_where_two_velocities_vanish_under_one_root(method):
    speed = r ** sp.Rational(6, 5)  # |v|' = -|v|^(-1/5)
    solution = solve(System({x: u, u: -u / speed, v: -v / speed}), (0, 3), {x: 0, u: 1, v: 0.5}, method=method)
    assert solution.outcome is Outcome.SINGULAR_POINT
    assert solution.t[-1] == pytest.approx(math.sqrt(1.25) ** 1.2 / 1.2, abs=1e-7)
    assert solution["x"][-1] == pytest.approx(math.sqrt(1.25) ** 1.2 / 2.2, abs=1e-8)
    assert "u and v stand under one root" in solution.message and "(u**2 + v**2)" in solution.message


@METHODS
def test_a_driven_one_ends_in_few_steps(method):
    speed = r ** sp.Rational(6, 5)
    system = System({u: -u / speed + sp.sin(t) / 3, v: -v / speed}, time=t)
    solution = solve(system, (0, 3), {u: 1, v: 0.5}, method=method)
    assert solution.outcome is Outcome.SINGULAR_POINT and solution.cost["steps"] < 200


@pytest.mark.parametrize(("start", "nearest"), [(-0.125, 2e-2), (-0.14, 9e-3), (-0.15, 2e-4)])
@METHODS
def test_a_velocity_that_passes_near_rest_is_no_singular_point(method, start, nearest):
    # Turned by a transverse force before it comes to rest.
    system = System({u: -1, v: (u + sp.Rational(1, 10)) / (10 * r)}, time=t)
    solution = solve(system, (0, 2), {u: 1, v: start}, method=method, dense_output=True)
    assert solution.outcome is Outcome.FINISHED
    assert np.hypot(*solution(np.linspace(0.5, 1.5, 40_001))).min() == pytest.approx(nearest, rel=0.2)
    fun = lambda _, z: [-1.0, (z[0] + 0.1) / (10 * math.hypot(*z))]  # noqa: E731
    exact = solve_ivp(fun, (0, 2), [1, start], method="DOP853", rtol=1e-13, atol=1e-14, max_step=0.01).y[:, -1]
    assert solution.x[:, -1] == pytest.approx(exact, abs=1e-9)


@METHODS
@pytest.mark.parametrize(
    ("rate", "start", "end"),
    [
        (-1 / x, 1.0, 0.5),  # x = sqrt(1 - 2 t)
        (sp.tan(x), 1.0, -math.log(math.sin(1.0))),  # sin x = sin(1) e^t
        (1 / sp.log(x), 2.0, None),  # away from the pole
        (-1 - sp.sqrt(x), 1.0, 2 - 2 * math.log(2)),  # int dx/(1 + sqrt x) over [0, 1]
    ],
)
def test_a_pole_or_an_end_is_named_with_its_time(method, rate, start, end):
    solution = solve(System({x: rate}), (0, 1), {x: start}, method=method)
    if end is None:
        assert solution.outcome is Outcome.FINISHED
        return
    assert solution.outcome is Outcome.SINGULAR_POINT
    assert solution.t[-1] == pytest.approx(end, abs=1e-7) and np.isfinite(solution.x).all()
    assert solution.events[-1].kind == "singular point"


@METHODS
def test_a_start_on_a_singular_point_is_named(method):
    speed = r ** sp.Rational(6, 5)
    solution = solve(System({u: -u / speed, v: -v / speed}), (0, 3), {u: 0, v: 0}, method=method)
    assert solution.outcome is Outcome.SINGULAR_POINT and solution.t.tolist() == [0.0]


# ---- arrival in finite time


@METHODS
@pytest.mark.parametrize("power", [sp.Rational(1, 2), sp.Rational(1, 3), sp.Rational(2, 3)])
def test_a_root_comes_to_rest_in_finite_time(method, power):
    solution = solve(System({x: -sp.sign(x) * sp.Abs(x) ** power, y: sp.Abs(x)}), (0, 5), [1, 0], method=method)
    arrival = 1 / (1 - float(power))  # an error atol in x is one of atol^(1 - p) in it
    assert solution.outcome is Outcome.FINISHED and solution["x"][-1] == 0.0
    assert solution.event_times("rest") == pytest.approx([arrival], abs=10 * 1e-12 ** (1 - float(power)))
    # y = int |x| dt = int x^(1 - p) dx
    assert solution["y"][-1] == pytest.approx(1 / (2 - float(power)), abs=1e-8)


@METHODS
def test_a_tank_runs_empty_and_fills_again(method):
    system = System({h: -sp.sqrt(h) + sp.Max(0, t - 3), x: sp.sqrt(h)}, time=t)
    solution = solve(system, (0, 5), [1, 0], method=method, t_eval=[1, 2.5, 5])
    # h = (1 - t/2)^2, then 0, then the root k of 2 k^2 = 1 - k as sqrt(h) = k (t - 3)
    assert solution["h"] == pytest.approx([0.25, 0, 1], abs=1e-8)
    assert solution["x"] == pytest.approx([0.75, 1, 2], abs=1e-8)


@METHODS
def test_an_empty_tank_fills(method):
    solution = solve(System({h: 1 - sp.sqrt(h)}), (0, 3), [0], method=method)
    # -2 (s + ln(1 - s)) = t, s = sqrt(h)
    s = brentq(lambda s: -2 * (s + math.log(1 - s)) - 3, 0, 1 - 1e-12, xtol=1e-15)
    assert solution["h"][-1] == pytest.approx(s**2, abs=1e-8)


@ALL
def test_decay_never_arrives(method):
    solution = solve(System({h: -h, x: sp.sqrt(h)}), (0, 40), [1, 0], method=method)
    assert solution.outcome is Outcome.FINISHED and not len(solution.event_times("rest"))


def test_a_difference_that_comes_to_rest_says_what_to_do():
    solution = solve(System({x: -sp.sqrt(x - y), y: 0}), (0, 5), [1, 0.3])
    assert solution.outcome is Outcome.SINGULAR_POINT
    assert solution.t[-1] == pytest.approx(2 * math.sqrt(0.7), abs=1e-6)
    assert "make x - y a state of its own" in solution.message


d = x - y + a
FLOWS = {
    "sign": sp.sign(d) * sp.sqrt(sp.Abs(d)),
    "branches": sp.Piecewise((sp.sqrt(d), d > 0), (-sp.sqrt(-d), True)),
    "maxima": sp.sqrt(sp.Max(0, d)) - sp.sqrt(sp.Max(0, -d)),
}


@METHODS
@pytest.mark.parametrize("flow", FLOWS.values(), ids=FLOWS)
@pytest.mark.parametrize("size", [1, 1e6, 1e-6])
def test_two_tanks_come_to_one_level_and_stay_there(method, flow, size):
    # d' = -0.6 k sqrt(d) from 3: at rest after sqrt(3)/0.3, in units in which sqrt(size) k = size
    tanks = System({x: -0.3 * h * flow, y: 0.3 * h * flow}, parameters={h: 1, a: 0})
    for offset in (0, 0.37):
        start = size * np.array([4 - offset, 1])
        values = {h: math.sqrt(size), a: offset * size}
        run = solve(tanks, (0, 10), start, method=method, parameters=values, atol=1e-12 * size)
        assert run.success and run.x[0, -1] + offset * size == pytest.approx(run.x[1, -1], rel=1e-8)
        assert run.x[:, -1].sum() == pytest.approx(start.sum(), rel=1e-9)
        assert run.event_times("rest") == pytest.approx([math.sqrt(3) / 0.3], abs=1e-3)


@METHODS
def test_tanks_that_are_level_go_on_with_an_inflow(method):
    inflow = sp.Piecewise((h, t > 8), (0, True))
    tanks = System({x: inflow - FLOWS["sign"], y: FLOWS["sign"]}, time=t, parameters={h: 1, a: 0})
    run = solve(tanks, (0, 9), [4, 1], method=method)
    # from level d' = 1 - 2 sqrt(d): t = -s - ln(1 - 2 s)/2, s = sqrt(d)
    s = brentq(lambda s: -s - math.log(1 - 2 * s) / 2 - 1, 0, 0.5 - 1e-12, xtol=1e-15)
    assert run.x[:, -1] == pytest.approx([3 + s**2 / 2, 3 - s**2 / 2], abs=1e-6)


@METHODS
def test_a_root_of_a_minimum_is_that_of_its_branches(method):
    # a reed: d' = 1/10 - sgn(d) sqrt|d| tends to d = 1/100; z' = sqrt|e| over e from -1 to 1
    d, e = sp.Min(0.55, t / 10) - x, sp.Min(x, 5)
    run = solve(System({x: sp.sign(d) * sp.sqrt(sp.Abs(d))}, time=t), (0, 3), {x: 0.01}, method=method)
    assert run["x"][-1] == pytest.approx(0.29, abs=1e-5)
    both = System({x: 1, y: sp.sqrt(sp.Abs(e)), w: sp.sign(e) * sp.sqrt(sp.Abs(e))})
    assert solve(both, (0, 2), [-1, 0, 0], method=method).x[:, -1] == pytest.approx([1, 4 / 3, 0], abs=1e-6)


@METHODS
def test_tanks_above_a_sill_come_to_one_level(method):
    d = sp.Max(x, a) - sp.Max(y, a)
    flow = sp.sign(d) * sp.sqrt(sp.Abs(d))
    tanks = System({x: -flow, y: flow}, parameters={a: 2})
    for start, end in (([4, 1], [2.5, 2.5]), ([2.5, 1], [2, 1.5]), ([1, 4], [2.5, 2.5])):
        assert solve(tanks, (0, 10), start, method=method).x[:, -1] == pytest.approx(end, abs=1e-6)


@METHODS
def test_a_check_valve_closes_with_the_flow(method):
    # x/10 + y = d/10 + (1 - (t - 1)^2)/2; x - y, d at first, closes as (w (1 - t))^2 with a constant w; shut from t = 1
    q = a * sp.sqrt(sp.Max(0, x - y))
    valve = System({x: 10 * (1 - t - q), y: q}, time=t, parameters={a: 1})
    rng = np.random.default_rng(4)
    for k in range(12):
        d, level = rng.uniform(0.1, 5), {a: rng.uniform(1, 4)}
        run = solve(valve, (0, 2), [d, 0], parameters=level, method=method, rtol=(1e-6, 1e-9)[k % 2])
        shut = (d / 10 + 0.5) / 1.1
        assert run.success and run.x[:, -1] == pytest.approx([shut - 5, shut], abs=1e-5)


@METHODS
def test_the_tip_of_a_cone_is_passed(method):
    # y' = |x|, x from -1 to 2
    solution = solve(System({x: 1, w: 0, y: sp.sqrt(x**2 + w**2)}), (0, 3), [-1, 0, 0], method=method)
    assert solution["y"][-1] == pytest.approx(2.5, abs=1e-8)


@METHODS
def test_an_event_of_the_user_at_the_same_place_has_its_way(method):
    system = System({x: -1 - sp.sqrt(x)}, events=[Event(x, update={x: 1})])
    solution = solve(system, (0, 2), [1], method=method)
    assert solution.outcome is Outcome.FINISHED
    period = 2 - 2 * math.log(2)
    assert solution.event_times("reset") == pytest.approx([k * period for k in (1, 2, 3)], abs=1e-7)


def test_super_twisting_control_ends_honestly():
    s = -sp.Rational(3, 2) * sp.sqrt(sp.Abs(x)) * sp.sign(x) + w + sp.Rational(3, 10) * sp.sin(t)
    solution = solve(
        System({x: s, w: -sp.Rational(11, 10) * sp.sign(x)}, time=t), (0, 10), [1, 0], max_steps=100_000
    )
    assert not solution.success or abs(solution["w"][-1] + 0.3 * math.sin(10)) < 1e-6


# ---- quotients of a sign


@METHODS
@pytest.mark.parametrize(
    "rate",
    [-u / sp.Abs(u), -sp.Abs(u) / u, -u / sp.sqrt(u**2), -sp.diff(sp.Abs(u), u), -sp.Abs(3 * u) / (3 * u)],
)
def test_a_quotient_that_is_a_sign_sticks(method, rate):
    solution = solve(System({u: rate}), (0, 3), {u: 1}, method=method)
    assert solution.itinerary == ("sgn(u)=+1", "sgn(u) sliding")
    assert solution.event_times("stick") == pytest.approx([1.0], abs=1e-12)


def test_an_angle_of_long_expressions_is_lifted_at_once():
    # Factorising its size kept the lifting busy for hours.
    inner = sp.log(2 + x**2) + sp.cot(1 + sp.sin(x) / 2)
    solution = solve(System({x: sp.atan2(inner, 2 + sp.sin(inner)) - x}), (0, 1), [0.3])
    assert solution.success


@METHODS
def test_the_angle_of_a_rotation_jumps_by_two_pi_only_at_the_cut(method):
    solution = solve(System({x: -y, y: x, u: sp.atan2(y, x)}), (0, 7), [1, 0, 0], method=method)
    # int of the angle over a turn is 0
    assert solution["u"][-1] == pytest.approx((7 - 2 * math.pi) ** 2 / 2, abs=1e-8)


# ---- powers on surfaces


@METHODS
@pytest.mark.parametrize("slip", [v - 1, v - 1 - sp.sin(t) / 10])
@pytest.mark.parametrize(
    "law",
    [
        lambda s: 2 + sp.Abs(s) ** sp.Rational(3, 2),
        lambda s: 2 + sp.Abs(s) ** sp.Rational(5, 2),
        lambda s: 1 + sp.exp(-(sp.Abs(s) ** sp.Rational(3, 2))),
        lambda s: 1 + sp.exp(-sp.sqrt(sp.Abs(s))),
        lambda s: 2 + sp.Max(0, s) ** sp.Rational(3, 2),
    ],
)
def test_a_power_on_a_surface_that_slides_is_zero_there(method, slip, law):
    drag = sp.sign(slip) * law(slip)
    system = System({x: v, v: -x - drag}, time=t, outputs={"drag": drag})
    solution = solve(system, (0, 10), [-3, 2], method=method, rtol=1e-11, t_eval=np.linspace(0, 10, 201))
    assert solution.outcome is Outcome.FINISHED
    # While it sticks the drag is -x - v', and v' the acceleration of the belt.
    belt = sp.diff(v - slip, t)
    stuck = solution.status[solution.multipliers.index(str(system.switches[0]))] == 0
    exact = -solution["x"] - [float(belt.subs(t, at)) for at in solution.t]
    assert stuck.sum() > 10 and solution["drag"][stuck] == pytest.approx(exact[stuck], abs=1e-9)


@METHODS
@pytest.mark.parametrize("power", [sp.Rational(1, 2), sp.Rational(3, 2)])
def test_a_power_is_crossed_while_another_switch_slides(method, power):
    bend = sp.Abs(w - v) ** power
    rates = {x: v, v: -x - 2 * sp.sign(v - 1) - bend / 10, y: w, w: -4 * y + bend * sp.sign(v - w) / 3}
    ends = [
        solve(System(rates), (0, 8), [-3, 2, 0.5, 0], method=method, rtol=rtol).x[:, -1]
        for rtol in (1e-9, 1e-11)
    ]
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


# ---- unknowns with kinks in their residuals


@pytest.mark.parametrize("start", [-40, -3.5, -0.1, 0, 0.1, 3.5, 40])
@pytest.mark.parametrize(
    "bend",
    [
        lambda a: sp.Abs(a) * a / 2,
        lambda a: sp.Max(a, 0) ** 2,
        lambda a: sp.Abs(a) ** sp.Rational(3, 2) * sp.sign(a),
        lambda a: sp.Abs(a - 1) / 2,
        lambda a: -(sp.Min(a, -1) ** 2),
    ],
)
def test_an_unknown_finds_the_side_of_its_kink(bend, start):
    system = System({v: a, x: v}, algebraic=[Algebraic(a, a + bend(a) + x)])
    solution = solve(system, (0, 5), {v: 1, x: start})
    residual = sp.lambdify((a, x), a + bend(a) + x)
    for value, at in zip(solution["a"], solution["x"]):
        assert abs(residual(value, at)) <= 1e-9 * (1 + abs(at))
    assert solution.outcome is Outcome.FINISHED


@pytest.mark.parametrize(("start", "root"), [(3.5, -2.5), (-3.5, 2.5), (0.25, 0.0)])
def test_an_unknown_finds_the_side_of_its_sign_or_stays_on_it(start, root):
    solution = solve(System({x: 0}, algebraic=[Algebraic(a, a + sp.sign(a) + x)]), (0, 1), {x: start})
    assert solution["a"][-1] == pytest.approx(root, abs=1e-12)


def test_an_unknown_changes_sides_with_a_reset():
    system = System(
        {x: 0},
        time=t,
        algebraic=[Algebraic(a, a + sp.Abs(a) * a / 2 + x)],
        events=[Event(at=[1], update={x: -3.5})],
    )
    assert solve(system, (0, 2), {x: 3.5})["a"][[0, -1]] == pytest.approx([1 - math.sqrt(8), math.sqrt(8) - 1])


# ---- at random


def _random_field(rng):
    def argument():
        return rng.choice([x, y, x - y, x + y / 2, x * y, x**2 + y**2, 1 + x, 2 + sp.cos(x), x - sp.sin(t) / 2])

    def term():
        b, p = argument(), sp.Rational(*rng.choice([(1, 2), (1, 3), (3, 2)]))
        shapes = [
            sp.sqrt(b), sp.Abs(b) ** p * sp.sign(b), sp.log(b), 1 / b, sp.tan(b), sp.asin(b / 2), sp.atan2(b, x),
            b * x / sp.Abs(b), x / sp.sqrt(x**2 + y**2), sp.Max(b, 0) ** p, sp.exp(-sp.sqrt(sp.Abs(b))), sp.cot(b),
        ]  # fmt: skip
        return sp.Rational(rng.choice([-8, -5, 5, 8]), 10) * rng.choice(shapes)

    return {x: term() - x / 3 + sp.sin(2 * t) / 4, y: term() - y / 2 + sp.Rational(rng.randint(-5, 5), 10)}


@pytest.mark.parametrize("seed", range(8))
def test_random_fields_end_right_or_say_that_they_do_not(seed):
    rng = random.Random(seed)
    rates = _random_field(rng)
    number = sp.lambdify((t, x, y), [rates[x], rates[y]], "numpy")

    def field(now, z):
        with np.errstate(all="ignore"):
            return np.array(number(now, *z), float)

    for _ in range(3):
        start = [round(rng.uniform(-1.5, 1.5), 3) for _ in range(2)]
        solution = solve(System(rates, time=t), (0, 2), start, max_steps=20_000, dense_output=True)
        ends = [e.time for e in solution.events if e.kind == "singular point"] + [solution.t[-1]]
        end = min(ends) - (0 if solution.success else 1e-2)
        if end <= 0 or any(e.kind == "stick" for e in solution.events):
            continue  # an integrator without surfaces is no oracle of sliding
        exact = solve_ivp(field, (0, end), start, method="DOP853", rtol=1e-10, atol=1e-11, max_step=0.01)
        # Steps of 0.01 across jumps and roots leave some 1e-5.
        assert exact.success and solution(end) == pytest.approx(exact.y[:, -1], abs=1e-4, rel=1e-4)


def test_a_bound_that_is_itself_an_exponential_ends_the_search_for_signs():
    # The ends of exp(sin w) are exp(-1) and exp(1): neither is bounded by something simpler.
    w, y = sp.symbols("w y", real=True)
    u = sp.exp(sp.sin(w)) * y**2
    solution = solve(System({y: sp.atan2(u, 2 + sp.sin(u)), w: 1}), (0, 1), [1, 0])
    assert solution.outcome.name == "FINISHED"
