"""What stands on a surface is looked at again when what holds it there lets go, and whatever its unit.

Statuses after accumulations, closed contacts under friction, coupled unknowns, restarts at folds. References: closed
forms, the same equations written otherwise, the same system in other units.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Algebraic, Event, Switch, System, Unilateral, solve

t, x, y, u, v, w, a, b, s = sp.symbols("t x y u v w a b s", real=True)
METHODS = pytest.mark.parametrize("method", ["taylor", "rk"])


# ---- unknowns that couple sliding switches


def test_a_slide_coupled_by_unknowns_is_released_when_another_switch_crosses():
    f1, f2 = 1 - sp.sign(w) / 2 - sp.sign(u), -2
    mass_matrix = [Algebraic(a, 2 * a + b - (2 * f1 + f2)), Algebraic(b, a + 2 * b - (f1 + 2 * f2))]
    for system in (System({u: a, w: b}, algebraic=mass_matrix), System({u: f1, w: f2})):
        solution = solve(system, (0, 1), {u: 0.1, w: 0.5})
        assert solution["u"][-1] == pytest.approx(0.375, abs=1e-9)  # slides from 0.2 to 0.25, then u' = 1/2
        assert np.abs(solution.mult[:2]).max() <= 1


@pytest.mark.parametrize("seed", range(6))
def test_coupled_unknowns_are_the_equations_solved_by_hand(seed):
    rng = np.random.default_rng(seed)
    n = 3
    speeds, rates = sp.symbols("q1:4", real=True), sp.symbols("a1:4", real=True)
    half = rng.uniform(-1, 1, (n, n))
    mass = sp.Matrix((half @ half.T + n * np.eye(n)).round(2))
    friction, drive = rng.uniform(0.5, 2, n).round(2), rng.uniform(-2, 2, n).round(2)
    force = sp.Matrix(
        [d * sp.cos(t + k) - f * sp.sign(q) for k, (d, f, q) in enumerate(zip(drive, friction, speeds))]
    )
    residuals = mass * sp.Matrix(rates) - force
    implicit = System(
        dict(zip(speeds, rates)), time=t, algebraic=[Algebraic(r, e) for r, e in zip(rates, residuals)]
    )
    by_hand = System(dict(zip(speeds, mass.inv() * force)), time=t)
    start = rng.uniform(-0.3, 0.3, n)
    one, other = (solve(system, (0, 10), start) for system in (implicit, by_hand))
    assert one.outcome is other.outcome
    assert one.x[:, -1] == pytest.approx(other.x[:, -1], abs=1e-7)
    assert np.abs(one.mult[:n]).max() <= 1 + 1e-9


# ---- what an accumulation leaves on a surface


def test_second_order_sliding_does_not_run_away_when_its_support_is_exceeded():
    # x'' = -2 sgn x - sgn v + d rests at 0 while abs(d) < 3. From d = 1 on sgn v alone no longer holds it, and the
    # switchings begin again: that is said, and x stays where it is.
    drive = sp.Max(0, sp.Min(2, t - 10))
    system = System({x: v, v: -2 * sp.sign(x) - sp.sign(v) + drive}, time=t)
    solution = solve(system, (0, 14), [1, 0])
    assert solution.outcome.name in ("FINISHED", "CHATTERING")
    assert abs(solution["x"][solution.t > 5]).max() < 1e-9


def test_a_relay_that_crosses_for_ever_below_the_tolerance_is_passed_within_bounds():
    # The amplitude of x decays exponentially, and the crossings come ever faster.
    relay = System({x: v, v: -x - 10 * v - 2 * sp.sign(x)})
    solution = solve(relay, (0, 200), [1, 0])
    assert solution.success and solution.cost["events"] < 300_000
    assert [a.kind for a in solution.ambiguities] == ["chattering within atol"]
    assert solution.x[:, -1].tolist() == [0, 0]


# ---- a contact that holds what friction holds too


@METHODS
def test_a_piston_with_dry_friction_rests_on_its_stop_and_leaves_it(method):
    R = Unilateral(x, name="R")
    lift = sp.Max(0, t - 2)
    system = System({x: v, v: -1 - sp.sign(v) / 2 + R.reaction + lift}, time=t)
    solution = solve(system, (0, 3), [1, 0], method=method)
    assert solution.outcome.name == "FINISHED" and solution.x[:, -1] == pytest.approx([0, 0], abs=1e-12)
    # Weight and friction are exceeded from t = 3.5 on, by t - 3.5.
    solution = solve(system, (0, 4), [1, 0], method=method)
    assert solution.x[:, -1] == pytest.approx([0.5**3 / 6, 0.5**2 / 2], abs=1e-9)


@METHODS
@pytest.mark.parametrize("kick", [-1, 1])
def test_a_mass_that_is_kicked_off_its_stop_has_friction_again(kick, method):
    R = Unilateral(x + 3, restitution=sp.Rational(1, 2), name="R")
    system = System({x: v, v: -1 - 2 * sp.sign(v) / 5 + R.reaction}, events=[Event(at=1, update={v: v + kick})])
    solution = solve(system, (0, 1.2), [-3, 0], method=method)
    speed = 1 if kick > 0 else 0.5
    after = [-3 + 0.2 * speed - 1.4 * 0.02, speed - 1.4 * 0.2]
    assert solution.x[:, -1] == pytest.approx(after, abs=1e-9) and solution.status[0, -1] == 1


@METHODS
@pytest.mark.parametrize("restitution", [0, sp.Rational(1, 2)])
@pytest.mark.parametrize(
    "force",
    [
        sp.sin(t) / 10,
        3 * sp.sin(t) / 4,
        13 * sp.sin(t) / 10,
        2 * sp.sin(t),
        3 * sp.cos(t) - 0.62 * x,
        3 * (sp.sin(t) + sp.sin(sp.sqrt(2) * t)) / 4,
    ],
    ids=["weak", "below the weight", "below the weight and friction", "lifts", "with a spring", "two tones"],
)
def test_a_mass_with_dry_friction_comes_to_rest_on_its_stop_wherever_that_is(force, restitution, method):
    # Friction holds it where the stop ceases to, and the stop where friction does; it slips upwards only.
    ends = []
    for at in (0, sp.Rational(1, 5), -sp.Rational(1, 3), sp.Rational(70, 3)):
        R = Unilateral(x + at, restitution=restitution, name="R")
        rates = {x: v, v: -1 + force.subs(x, x + at) - 2 * sp.sign(v) / 5 + R.reaction}
        solution = solve(System(rates, time=t), (0, 30), [1 - float(at), 0], method=method)
        assert solution.outcome.name == "FINISHED"
        assert np.min(solution["x"] + float(at)) >= -1e-8  # the pair's tolerance
        lifts = [e.time for e in solution.events if e.kind == "slip by tangency"]
        ends.append((solution["x"][-1] + float(at), solution["v"][-1], lifts))
    for end in ends[1:]:
        assert end[:2] == pytest.approx(ends[0][:2], abs=1e-7)
        if restitution == 0:
            assert end[2] == pytest.approx(ends[0][2], abs=1e-7)


# ---- a restart at a fold


def test_a_run_goes_on_from_wherever_beside_a_fold_it_is_cut():
    lam = Switch("lam", v)
    block = System({y: v, v: -2.4 * sp.sin(t) - 3.1 * y - 0.1 * v - lam * (4 - 3 * lam**2)}, time=t)
    whole = solve(block, (0, 10), {y: 0.5, v: 0.3}, rtol=1e-13)
    folds = [e for e in whole.events if "fold" in e.kind]
    rng = np.random.default_rng(1)
    for fold in folds:
        where = whole.x[:, np.flatnonzero(whole.t == fold.time)[0]]
        for rtol in (1e-6, 1e-9, 1e-13):
            for _ in range(20):
                begin = fold.time + rng.integers(-20, 21) * np.spacing(fold.time)
                start = where + [rng.integers(-20, 21) * np.spacing(where[0]), 0]
                assert solve(block, (begin, begin + 1), start, rtol=rtol).outcome.name == "FINISHED"
    assert len(folds) >= 3


# ---- units


@pytest.mark.parametrize("k", [1e-12, 1e-15])
def test_a_weak_friction_is_a_friction(k):
    # Amplitudes fall by 2 k every half turn: from 7.6 k it sticks after the fourth, at 0.4 k < k.
    solution = solve(System({y: v, v: -y - k * sp.sign(v)}), (0, 20), [7.6 * k, 0], atol=1e-12 * k)
    assert [e.kind for e in solution.events] == ["crossing"] * 3 + ["stick"]
    assert solution.events[-1].time == pytest.approx(4 * np.pi, abs=1e-8)


@pytest.mark.parametrize("power", [-12, -4, 3, 9])
def test_a_corner_is_settled_in_any_unit(power):
    scale = 10.0**power
    rates = [
        sp.Rational(3, 10) - sp.sign(u) + sp.sign(v) * 2 / 5,
        -sp.Rational(1, 2) + sp.sign(u) * 2 / 5 - sp.sign(v) / 5,
    ]
    system = System({u: s * rates[0], v: s * rates[1]}, parameters={s: 1})
    solution = solve(system, (0, 4), [0.2 * scale, scale], parameters={s: scale}, atol=1e-12 * scale)
    assert solution.outcome.name == "FINISHED"
    assert solution.x[:, -1] / scale == pytest.approx([0, -17 / 35], abs=1e-9)


@pytest.mark.parametrize("power", [-9, 3, 6])
def test_the_pair_slides_in_any_unit(power):
    scale = 10.0**power
    system = System({u: s * (sp.cos(t) * 3 / 10 - 2 * sp.sign(u - s * sp.sin(t)))}, parameters={s: 1}, time=t)
    solution = solve(system, (0, 14), [0.2 * scale], parameters={s: scale}, atol=1e-12 * scale, method="rk")
    assert solution.x[0, -1] / scale == pytest.approx(np.sin(14), abs=1e-12)


def test_the_pair_runs_at_the_precision_that_it_has():
    solution = solve(
        System({y: v, v: -y - sp.sign(v)}), (0, 25), [7.5, 0.3], method="rk", rtol=1e-14, atol=1e-17
    )
    assert solution.outcome.name == "FINISHED" and solution.tolerances["rtol"] == 1e-13


@METHODS
@pytest.mark.parametrize("rate", [1, -1])
def test_a_condition_that_comes_to_its_border_just_where_it_jumps_off_is_not_met(rate, method):
    # Mod(y, 3/4) falls to 0 as y does, and is 3/4 there: it is never below 0.
    saw = sp.Mod(y, sp.Rational(3, 4))
    below = sp.Piecewise((1, saw < 0), (0, True))
    for unknown in ([], [Algebraic(a, a + a**3 / 4 - x)]):
        run = solve(
            System({x: below, y: rate}, algebraic=unknown), (0, 2), {x: 0.8, y: -0.5 * rate}, method=method
        )
        assert run["x"][-1] == 0.8


@METHODS
def test_a_slide_whose_surface_jumps_with_a_stair_of_an_unknown_ends_on_the_side_it_finds_itself_on(method):
    # y slides on a tooth of the saw, whose place is a stair of a. The end is that of an integration piece by piece.
    follows = abs(x + sp.Rational(1, 4)) / 2 + abs(abs(x / 2 - sp.S.Half) / 2 - sp.Rational(3, 2)) - x
    saw = sp.Mod(2 * y + sp.floor(sp.S.Half - 2 * a) / 4 + sp.S.Half, sp.Rational(3, 4))
    rates = {
        x: a / 2 - x / 2 + 0.75 * sp.sin(t + 0.75) - abs(2 * a + abs(x - 0.75) + 0.75) + 0.5,
        y: saw / 2 - x / 2 - y / 2 - 0.375,
    }
    system = System(rates, time=t, algebraic=[Algebraic(a, a - follows)])
    run = solve(system, (0, 1.155094037751384), {x: -0.25, y: -0.25}, method=method)
    assert run["x"][-1] == pytest.approx(-19.049425, abs=1e-6)
    assert run["y"][-1] == pytest.approx(2.373302, abs=1e-6)
