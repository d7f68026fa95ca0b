"""minimise(): optima with closed forms, through switches, sticks and bounces; what stands in the way of a search.

Guards: costs/minimum.py, costs/telling.py.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Control, System, Unilateral
from pwsmooth.costs import at, at_event, event_time, final, integral, largest, minimise, minimising, misfit
from pwsmooth.costs.objective import Objective

x, y, v, w = sp.symbols("x y v w", real=True)
T, g, vx = sp.Symbol("T", positive=True), sp.Symbol("g", positive=True), sp.Symbol("vx", real=True)
TIGHT = {"rtol": 1e-13, "atol": 1e-15}
RELAY = System({x: 2 - sp.sign(x)})
STEER = (final(x) - sp.Rational(5, 3)) ** 2 + integral(x**2)
MU = 0.5
BOTH = pytest.mark.parametrize("method", ["SLSQP", "trust-constr"])
# A search ends where the slope is 1e-8 of the first one or the cost moves by 1e-9 (both 10 rtol at most): what is
# stationary is then found to its root or better, 1e-6 with a curvature of about one in unknowns of size 1.
NEAR = 1e-6


def block(u):
    return System({x: v, v: u - MU * sp.sign(v)})


@pytest.mark.parametrize("start", [-2.0, -1.0])
def test_an_optimum_through_the_switching(start):
    # tests/costs/test_costs.py derives it.
    found = minimise(RELAY, STEER, (0, 2), {x: start}, ["x"], bounds={x: (-2, -1)}, **TIGHT)
    assert found.values["x"] == pytest.approx((18 - np.sqrt(1668)) / 16, abs=1e-10)
    assert found.success and found.evaluations <= 15


def test_an_optimum_at_its_bound():
    found = minimise(RELAY, STEER, (0, 2), {x: -2}, ["x"], bounds={x: (-2, -1.5)})
    assert found.values["x"] == -1.5 and found.success and found.gradient[0] < 0


@BOTH
def test_an_inequality_that_is_active_at_the_optimum(method):
    # From x0 < 0 the run ends in 2 + x0/3: at least 1.6 from x0 = -1.2 on, where the slope of the integral,
    # -x0**2/3 + (2 + x0/3)**2/3, is positive: less would be better, down to -1.5.
    found = minimise(
        RELAY,
        integral(x**2),
        (0, 2),
        {x: -2},
        ["x"],
        constraints=[final(x) >= 1.6, final(x) <= 9],
        method=method,
    )
    near = NEAR if method == "SLSQP" else 1e-5  # an inner point method counts as at a bound what is so near
    assert found.values["x"] == pytest.approx(-1.2, abs=near) and found.success
    assert found.gradient[0] == pytest.approx((1.6**2 - 1.2**2) / 3, abs=near)
    assert list(found.holds.values()) == [True, True]


@BOTH
def test_least_effort_against_dry_friction_in_fixed_time(method):
    # With v > 0, w = u - mu has the integral 0 from rest to rest: integral(u**2) = integral(w**2) + mu**2 T, and the
    # least of integral(w**2) over distance D is 12 D**2/T**3, w = 6 D/T**2 (1 - 2 t/T): u is one straight line.
    u = Control("u", [0, 0.5, 1], [5, 1, 1, -5], degree=1)
    found = minimise(
        block(u), integral(u**2), (0, 1), {x: 0, v: 0}, [u], constraints=[sp.Eq(final(x), 1), sp.Eq(final(v), 0)],
        method=method,
    )  # fmt: skip
    assert found.cost == pytest.approx(12 + MU**2, abs=1e-8) and found.success
    assert list(found.values.values()) == pytest.approx([6 + MU, MU, MU, MU - 6], abs=1e-5)
    assert np.abs(list(found.constraints.values())).max() < 1e-7


def test_least_effort_with_a_stop_at_a_time_that_moves():
    # As before, but with time to spare: 12 D**2/T'**3 + mu**2 T' is least at T' = sqrt(6 D/mu), where
    # u = 2 mu (1 - t/T') ends at 0 as the block does, and friction holds it from then on. The cost is 4/3 mu**2 T'.
    u = Control("u", [0, 2.5, 5], [1.5, 0.5, 0], degree=1, continuous=True, movable=True)
    found = minimise(
        block(u), integral(u**2), (0, 5), {x: 0, v: 0}, ["u_0", "u_1", "u_t1"], constraints=[sp.Eq(final(x), 1)]
    )
    last = np.sqrt(6 / MU)
    assert found.cost == pytest.approx(4 / 3 * MU**2 * last, abs=1e-8) and found.success
    assert list(found.values.values()) == pytest.approx([2 * MU, 0, last], abs=1e-4)
    assert found.solution["v"][-1] == 0.0


@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_least_time_is_bang_bang_with_a_switch_where_friction_puts_it(mu):
    # It speeds up with 1 - mu and brakes with 1 + mu: peak speed sqrt(1 - mu**2), times sqrt((1 + mu)/(1 - mu)) and its
    # inverse, whose sum is 2/sqrt(1 - mu**2), and the first is (1 + mu)/2 of it. Time is counted in units of T.
    s = Control("s", [0, 0.4, 1], [0.9, -0.9], movable=True)
    body = System({x: T * v, v: T * (s - mu * sp.sign(v))}, parameters={T: 2.3})
    found = minimise(
        body, T, (0, 1), {x: -1, v: 0}, [T, s], bounds={s: (-1, 1)},
        constraints=[sp.Eq(final(x), 0), sp.Eq(final(v), 0)],
    )  # fmt: skip
    assert found.cost == pytest.approx(2 / np.sqrt(1 - mu**2), abs=1e-8) and found.success
    assert [found.values[n] for n in ("s_0", "s_1", "s_t1")] == pytest.approx([1, -1, (1 + mu) / 2], abs=1e-8)


@BOTH
def test_the_cheapest_throw_that_lands_at_a_place_after_a_bounce(method):
    # From the ground: 2 w/g of flight, then e times that; (1 + e) 2 vx w/g = X with the least vx**2 + w**2 has vx = w.
    ball = System(
        {x: vx, y: w, w: -g + Unilateral(y, restitution=0.5, name="R").reaction}, parameters={g: 9.81, vx: 3}
    )
    lands = sp.Eq(at_event(x, "R", number=1), 10)
    found = minimise(
        ball, vx**2 + at(w, 0) ** 2, (0, 6), {x: 0, y: 0, w: 6}, ["vx", "w"], constraints=[lands], method=method
    )
    assert found.cost == pytest.approx(9.81 * 10 / 1.5, rel=1e-7) and found.success
    assert list(found.values.values()) == pytest.approx([np.sqrt(9.81 * 10 / 3)] * 2, rel=1e-5)


def test_times_that_move_keep_their_order():
    # The best u would be 1 up to 0.5 and -1 from there on; the second piece, of the value 3, is in the way.
    u = Control("u", [0, 0.2, 0.7, 1], [1, 3, -1], movable=True, shortest=0.05)
    found = minimise(System({x: u}), integral(u**2), (0, 1), {x: 0}, [*u.instants])
    first, second = found.values.values()
    assert second - first == pytest.approx(0.05, abs=1e-9)
    assert all(e.values["u_t2"] - e.values["u_t1"] > 0.05 - 1e-9 for e in found.history)


def test_cost_and_constraints_share_one_run_a_point(monkeypatch):
    asked = []
    each = Objective._each
    monkeypatch.setattr(Objective, "_each", lambda self, q: asked.append(q) or each(self, q))
    found = minimise(
        RELAY, integral(x**2), (0, 2), {x: -2}, ["x"], constraints=[final(x) >= 1.5, largest(x) <= 3]
    )
    assert len(asked) == found.evaluations == len({tuple(q) for q in asked})


def test_several_costs_take_one_run(monkeypatch):
    runs = []
    parts = Objective._parts
    monkeypatch.setattr(Objective, "_parts", lambda self, q: runs.append(q) or parts(self, q))
    objective = Objective._of_several(RELAY, {"one": final(x), "two": integral(x)}, (0, 2), {x: -2}, ["x"])
    first, second = objective._each(objective.start)
    # 2 + x0/3 and -x0**2/6 + (2 + x0/3)**2/2
    assert [first.value, second.value] == pytest.approx([4 / 3, -4 / 6 + 8 / 9], rel=1e-9)
    assert [*first.gradient, *second.gradient] == pytest.approx([1 / 3, 2 / 3 + 4 / 9], rel=1e-9)
    assert len(runs) == 1


def test_constraints_of_one_text_are_told_apart():
    # 2 (x - 5)**2 <= 1 holds down to 5 - sqrt(1/2), 2 x**2 <= 1 up to sqrt(1/2): not both.
    near, far = (misfit(x, [0.5, 1], data) <= 1 for data in ([0, 0], [5, 5]))
    found = minimise(
        System({x: 0 * x}), final(x), (0, 1), {x: 3}, ["x"], bounds={x: (-9, 9)}, constraints=[far, near, far]
    )
    assert len(found.holds) == 2 and not all(found.holds.values()) and not found.success


def test_unknowns_far_apart_in_size_are_found():
    # Of size 1e6 and 1e-3: u/1e6 + 1e3 k = 2 and 1 from a start at (3e6, 5e-3).
    a, k = sp.symbols("a k", real=True)
    system = System({x: a / 10**6, y: 1000 * k}, parameters={a: 3e6, k: 5e-3})
    found = minimise(system, (final(x) - 2) ** 2 + (final(y) - 1) ** 2, (0, 1), {x: 0, y: 0}, ["a", "k"])
    assert [found.values["a"] / 2e6, found.values["k"] / 1e-3] == pytest.approx([1, 1], abs=NEAR)


# ---- what stands in the way


WALL = Unilateral(y, name="wall", restitution=0.8)
TOUCH = System({y: v, v: 1 - y + WALL.reaction})  # y = 1 + (y0 - 1) cos t touches the wall at t = pi for y0 = 2


def test_a_search_goes_on_from_a_grazing():
    # y(2) = 1 + (y0 - 1) cos 2 = 1.2, before the wall is met: y0 = 1 + 0.2/cos 2 < 1; it begins at the grazing y0 = 2.
    found = minimise(TOUCH, (at(y, 2) - 1.2) ** 2, (0, 5), {y: 2, v: 0}, ["y"])
    assert found.values["y"] == pytest.approx(1 + 0.2 / np.cos(2), abs=NEAR) and found.success
    assert found.refused == 1 and "grazing" in str(found.problem)
    assert "1 without a derivative" in repr(found) and "grazing" in repr(found)


def test_a_search_steps_back_where_an_event_does_not_happen():
    # A ball thrown at a ceiling of height 2 reaches it if w**2 >= 4 g: no run below has that event. The slope sends the
    # first step beyond. Least w at which it arrives with the speed 1: w**2 = 1 + 4 g.
    ceiling = Unilateral(2 - y, restitution=0.5, name="top")
    ball = System({y: w, w: -g - ceiling.reaction}, parameters={g: 1})
    hit = at_event(w, "top")
    found = minimise(ball, sp.exp(4 * hit) - 4 * sp.exp(4) * hit, (0, 9), {y: 0, w: 4}, ["w"])
    assert found.values["w"] == pytest.approx(np.sqrt(5), abs=NEAR) and found.success
    assert found.refused >= 1 and "does not happen" in str(found.problem)


def test_a_first_guess_without_a_cost_is_refused():
    with pytest.raises(ValueError, match="`by`.*does not happen.*Give others"):
        minimise(RELAY, event_time("sgn(x)", number=3), (0, 2), {x: -2}, ["x"])


FIVE = [0, 1, 2, 3, 4, 5]
MOVED = sp.Eq(final(x), 1)


@pytest.mark.parametrize(
    "further, begun",
    [
        (sp.Eq(final(v), 0), [1.5, 1.0, 0.5, 0.2, 0.0]),  # it holds at once, as the block sticks
        (sp.Eq(final(v), 0), [1.5, 1.0, 0.5, 1.0, 1.0]),  # the block still moves at the end of the first run
        (sp.Eq(2 * final(x / T), 2), [1.5, 1.0, 0.5, 0.2, 0.0]),  # the same again
        (sp.Eq(integral(v / T), 1), [1.5, 1.0, 0.5, 0.2, 0.0]),
        (final(v) <= 0, [1.5, 1.0, 0.5, 0.2, 0.0]),
    ],
)
@pytest.mark.parametrize("unit", [1.0, 1e6])
def test_a_constraint_that_others_or_a_stick_fulfil_costs_nothing(further, begun, unit):
    # The cheapest five pieces of force for a unit length let the block stop at t = 3.53 and stay: the cost is that of
    # the search without the second constraint. T is the unit.
    u = Control("u", FIVE, [unit * value for value in begun])
    system = System({x: v, v: u - T * sp.sign(v) / 2}, parameters={T: unit})
    constraints = [sp.Eq(final(x / T), 1), further]
    found = minimise(system, integral(u**2 / T**2), (0, 5), {x: 0, v: 0}, [u], constraints=constraints)
    assert found.success and all(found.holds.values())
    assert found.cost == pytest.approx(1.17748257, abs=1e-7)


def test_constraints_that_contradict_each_other_and_those_without_a_slope_say_so():
    u = Control("u", FIVE, [1.5, 1.0, 0.5, 0.2, 0.0])
    both = minimise(
        block(u), integral(u**2), (0, 5), {x: 0, v: 0}, [u], constraints=[MOVED, sp.Eq(final(x), 2)]
    )
    assert not both.success and "contradict each other" in both.message
    held = Control("u", FIVE, [0.1] * 5)
    still = minimise(block(held), integral(held**2), (0, 5), {x: 0, v: 0}, [held], constraints=[MOVED])
    assert not still.success and "no unknown changes it" in still.message


def test_least_time_of_a_car_with_a_turbo_is_a_success_at_its_digits():
    # Twice the force beyond v = 10, three times with sign: 5 and 15 up to 25, coasting, and 15 and 5 down: T = 11.8.
    # Speeding up and braking take 2 + 1 each over 10 + 17.5 each; the other 145 of 200 at 25 take 5.8.
    u = Control("u", [0, 0.25, 0.5, 0.75, 1], [1.0, 1.0, -1.0, -1.0], movable=True)
    car = System({x: T * v, v: T * u * (2 + sp.sign(v - 10))}, parameters={T: 12})
    found = minimise(
        car, T, (0, 1), {x: 0, v: 0}, [T, u], bounds={u: (-5, 5)},
        constraints=[sp.Eq(final(x), 200), sp.Eq(final(v), 0), largest(v) <= 25],
    )  # fmt: skip
    assert found.success and found.cost == pytest.approx(11.8, abs=1e-7)


def test_constraints_that_cannot_hold_are_no_success():
    found = minimise(
        RELAY, integral(x**2), (0, 2), {x: -2}, ["x"], bounds={x: (-2, -1)}, constraints=[final(x) >= 5]
    )
    assert not found.success and "constraints do not hold" in found.message
    assert found.values["x"] == pytest.approx(-1, abs=1e-12)  # the nearest to it
    assert "fails by 3.33" in repr(found)


def test_positive_parameters_stay_positive():
    # x(1) = exp(-k) = 2 would need k < 0.
    k = sp.Symbol("k", positive=True)
    found = minimise(System({x: -k * x}, parameters={k: 1}), (final(x) - 2) ** 2, (0, 1), {x: 1}, [k])
    assert 0 < found.values["k"] < 1e-9 and found.success


def test_an_interrupt_keeps_the_best_until_then():
    def stop(at):
        if at.number == 3:  # the second point is worse than the first
            raise KeyboardInterrupt

    found = minimise(RELAY, STEER, (0, 2), {x: -2}, ["x"], callback=stop)
    assert found.evaluations == 3 and not found.success and "Interrupted" in found.message
    assert found.cost == min(e.cost for e in found.history[:2])
    assert found.solution["x"][0] == found.values["x"]


def test_an_interrupt_in_the_first_run_is_an_interrupt(monkeypatch):
    def interrupted(self, q):
        raise KeyboardInterrupt

    monkeypatch.setattr(Objective, "_each", interrupted)
    with pytest.raises(KeyboardInterrupt):
        minimise(RELAY, STEER, (0, 2), {x: -2}, ["x"])


def test_runs_and_seconds_have_bounds(monkeypatch):
    found = minimise(RELAY, STEER, (0, 2), {x: -2}, ["x"], max_evaluations=3)
    assert found.evaluations == 3 and "max_evaluations" in found.message
    clock = iter(range(100))
    monkeypatch.setattr(minimising.clock, "monotonic", lambda: next(clock))
    found = minimise(RELAY, STEER, (0, 2), {x: -2}, ["x"], max_seconds=2.5)
    assert found.evaluations == 3 and "2.5 s" in found.message


def test_progress_is_told_on_demand(capsys):
    minimise(RELAY, STEER, (0, 2), {x: -2}, ["x"], progress=True)
    assert "minimise: run 1, cost" in capsys.readouterr().err
    minimise(RELAY, STEER, (0, 2), {x: -2}, ["x"])
    assert capsys.readouterr().err == ""


def test_the_convergence_is_drawn():
    ax = minimise(RELAY, STEER, (0, 2), {x: -2}, ["x"]).plot()
    assert ax.get_ylabel() == "cost"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"by": []}, "`by` is empty"),
        ({"by": ["q"]}, "`by` names 'q'"),
        ({"by": ["x", "x"]}, "`by` names something twice"),
        ({"by": {"x": "b"}}, "`by`.*first guess of x"),
        ({"bounds": {"y": (0, 1)}}, "`bounds` names 'y'"),
        ({"bounds": {"x": (1, 0)}}, "`bounds` of x.*lowest first"),
        ({"bounds": {"x": (0, 1)}}, "outside of its bounds"),
        ({"constraints": [final(x)]}, "`constraints`.*relations"),
        ({"constraints": [True]}, "`constraints`.*always"),
        ({"constraints": [final(x) > x]}, "`constraints`.*names x"),
        ({"constraints": [final(x) >= 0], "method": "L-BFGS-B"}, "`method`.*SLSQP"),
        ({"method": "Newton"}, "`method`"),
        ({"max_evaluations": 0}, "`max_evaluations`"),
        ({"max_seconds": -1}, "`max_seconds`"),
        ({"cost": sp.Integer(1)}, "`cost` reads nothing"),
        ({"cost": x}, "`cost` names x"),
    ],
)
def test_bad_calls_are_refused_at_the_door(arguments, message):
    given = {"system": RELAY, "cost": STEER, "t_span": (0, 2), "x0": {x: -2}, "by": ["x"]} | arguments
    with pytest.raises((ValueError, TypeError), match=message):
        minimise(**given)
