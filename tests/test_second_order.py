"""Switches of relative degree 2 at rest on their surface: the relay that holds a position (second-order sliding)."""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Family, Memory, Switch, System, Unilateral, solve

t, x, v, y, w = sp.symbols("t x v y w", real=True)
a, b, c, A = sp.symbols("a b c A", positive=True)


def test_a_relay_holds_its_position_until_the_force_exceeds_it():
    # x'' = -sign x + 3/2 sin t from rest: held with lambda = 3/2 sin t until sin t = 2/3, then free.
    solution = solve(System({x: v, v: -sp.sign(x) + 1.5 * sp.sin(t)}, time=t), (0, 2), [0, 0], t_eval=[0.3, 2])
    leaves = math.asin(2 / 3)
    speed = 1.5 * (math.cos(leaves) - math.cos(2)) - (2 - leaves)
    assert solution.mult[0, 0] == pytest.approx(1.5 * math.sin(0.3), abs=1e-14)
    assert solution.x[:, 0].tolist() == [0, 0]
    assert [(e.time, e.kind) for e in solution.events] == [(pytest.approx(leaves), "slip by tangency")]
    assert solution["v"][-1] == pytest.approx(speed, abs=1e-12)
    assert not solution.ambiguities


def test_what_a_surface_that_is_no_state_holds_stays_there():
    # The same in other coordinates, on a circle: h = r**2 - 1 is held while the angle turns.
    angle, r, u = sp.symbols("angle r u", real=True)
    system = System({r: u, u: -2 * sp.sign(r**2 - 1) + sp.cos(angle), angle: 1})
    solution = solve(system, (0, 50), [1, 0, 0], dense_output=True)
    assert np.ptp(solution["r"]) < 1e-14 and np.abs(solution["u"]).max() < 1e-14
    assert solution.mult[0] == pytest.approx(np.cos(solution.t) / 2, abs=1e-10)


@pytest.mark.parametrize("force", [0.9, 1.2, 1.6])
def test_relay_and_friction_on_one_body_hold_the_sum_of_both(force):
    # Rest is left where the force exceeds 1 + 0.3, and is where the spiral ends before.
    rate = -sp.sign(x) - sp.Rational(3, 10) * sp.sign(v) + A * sp.sin(t)
    solution = solve(System({x: v, v: rate}, time=t, parameters={A: force}), (0, 30), [0, 0])
    still = solution.t[np.abs(solution["x"]) > 1e-14]
    leaves = math.asin(1.3 / force) if force > 1.3 else math.inf
    assert solution.success and not solution.ambiguities
    assert still.min(initial=math.inf) >= leaves - 1e-12
    slips = [e.time for e in solution.events if e.kind == "slip by tangency"]
    assert slips[:1] == ([pytest.approx(leaves)] if force > 1.3 else [])


def _other_coordinates(rate):
    """x = y + w - c, v = y - w: neither surface is a state, and the position is far from 0."""
    X, V = y + w - c, y - w
    rate = rate.xreplace({x: X, v: V})
    return System({y: (V + rate) / 2, w: (V - rate) / 2}, time=t, parameters=dict.fromkeys((a, b, c, A), 1))


@pytest.mark.parametrize("seed", range(3))
def test_relay_and_friction_do_not_depend_on_coordinates(seed):
    """Random forces; starts at rest and not; friction weaker and stronger than the relay."""
    random = np.random.default_rng(seed)
    rate = -a * sp.sign(x) - b * sp.sign(v) - v / 10 + A * sp.sin(2 * t)
    bare, other = (
        System({x: v, v: rate}, time=t, parameters=dict.fromkeys((a, b, A), 1)),
        _other_coordinates(rate),
    )
    for k in range(20):
        p = {a: random.uniform(0.5, 2), b: random.uniform(0.1, 1.5), A: random.uniform(0.2, 4)}
        x0, v0 = random.uniform(-0.3, 0.3, 2) * (k % 2)
        shift = random.uniform(0.5, 3)
        one = solve(bare, (0, 10), [x0, v0], parameters=p)
        two = solve(other, (0, 10), [(x0 + shift + v0) / 2, (x0 + shift - v0) / 2], parameters=p | {c: shift})
        assert one.success and two.success
        assert two["y"][-1] + two["w"][-1] - shift == pytest.approx(one["x"][-1], abs=1e-7)
        assert two["y"][-1] - two["w"][-1] == pytest.approx(one["v"][-1], abs=1e-7)


def test_two_relays_that_act_on_each_other_are_solved_together():
    # Both hold: x'' = -2 sign x + sign(y - x) + 1/2 = 0 and y'' = -sign(y - x) + 4/5 = 0 with lambdas 0.65 and 0.8.
    system = System(
        {x: v, v: -2 * sp.sign(x) + sp.sign(y - x) + sp.Rational(1, 2), y: w, w: -sp.sign(y - x) + 0.8}
    )
    solution = solve(system, (0, 3), [0, 0, 0, 0])
    assert np.all(solution.x == 0)
    lam = dict(zip((str(m.surface) for m in system.model.multipliers), solution.mult[:, -1]))
    assert lam["x"] == pytest.approx(0.65) and abs(lam.get("y - x", lam.get("x - y"))) == pytest.approx(0.8)


def test_a_kick_and_a_step_of_the_force_release_what_is_held():
    kicked = System({x: v, v: -sp.sign(x)}, events=[Event(at=[1], update={v: v + 1})])
    assert solve(kicked, (0, 2), [0, 0])["x"][-1] == pytest.approx(0.5, abs=1e-12)
    push = Memory("push", 0)
    pushed = System({x: v, v: -sp.sign(x) + push}, events=[Event(at=[1], update={push: 3})])
    solution = solve(pushed, (0, 2), [0, 0])
    assert solution["x"][-1] == pytest.approx(1, abs=1e-12)
    weak = System({x: v, v: -sp.sign(x) + push}, events=[Event(at=[1], update={push: sp.Rational(1, 2)})])
    solution = solve(weak, (0, 2), [0, 0])
    assert np.all(solution.x[:2] == 0) and solution.mult[0, -1] == pytest.approx(0.5)


def test_an_impact_throws_a_body_off_that_a_relay_holds():
    # y falls onto the body at rest, e = 1 and equal masses: it takes over the speed sqrt 2, against the relay's 4.
    drop = Unilateral(y - x, restitution=1, name="R")
    system = System({x: v, v: -4 * sp.sign(x) - drop.reaction, y: w, w: -1 + drop.reaction})
    solution = solve(system, (0, 1.6), [0, 0, 1, 0])
    since = 1.6 - math.sqrt(2)
    assert solution["x"][-1] == pytest.approx(-math.sqrt(2) * since + 2 * since**2, abs=1e-12)


def test_what_pushes_away_from_both_sides_is_not_unique():
    (ambiguity,) = solve(System({x: v, v: sp.sign(x) + sp.Rational(1, 2)}), (0, 1), [0, 0]).ambiguities
    assert ambiguity.kind == "repelling sliding" and ambiguity.taken == "leave to +1"


def test_crossings_that_multiply_below_the_tolerance_are_passed_and_said():
    # Damping alone: the amplitude decays like exp(-t/6), and the crossings multiply for ever.
    rate = -sp.sin(x) - v - sp.sign(x - sp.Rational(1, 5)) + sp.cos(t) / 2
    system = System({x: v, v: rate}, time=t)
    solution = solve(system, (0, 100), [0.3, 0.2], atol=1e-9)
    (said,) = solution.ambiguities
    assert solution.success and said.kind == "chattering within atol"
    assert solution["x"][-1] == pytest.approx(0.2, abs=1e-15)
    held = solution.t > said.time
    assert solution.mult[0, held] == pytest.approx(-math.sin(0.2) + np.cos(solution.t[held]) / 2, abs=1e-9)
    assert solve(system, (0, 100), [0.3, 0.2], atol=1e-9, strict=True).outcome.name == "AMBIGUITY"


def test_a_term_nonlinear_in_the_relay_has_no_mean_to_go_on_with():
    # lambda**2 is 1 at every instant of the chattering, but not for a lambda between. Said, not guessed.
    lam = Switch("lam", x)
    rate = -lam - sp.sign(v) / 3 + sp.sin(t) / 2
    assert solve(System({x: v, v: rate, y: lam**2}, time=t), (0, 60), [1, 0, 0]).outcome.name == "CHATTERING"
    assert solve(System({x: v, v: rate, y: lam}, time=t), (0, 60), [1, 0, 0]).success


def test_the_elements_of_a_family_hold_as_those_written_out():
    elements = Family(8)
    z, u = elements.symbols("z u")
    (load,) = elements.symbols("load", positive=True)
    system = System({z: u, u: -sp.sign(z) + load}, parameters={load: 1})
    loads = np.linspace(0.3, 1.7, 8)
    solution = solve(system, (0, 1), {z: 0, u: 0}, parameters={load: loads})
    expected = np.where(loads > 1, (loads - 1) / 2, 0)
    assert [solution[f"z_{k + 1}"][-1] for k in range(8)] == pytest.approx(expected, abs=1e-12)
