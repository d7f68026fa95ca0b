"""Switches of relative degree 2 at rest on their surface: the relay that holds a position (second-order sliding)."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

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


@pytest.mark.parametrize("heads", [1e-3, 1e3, 1e6])
def test_chattering_is_passed_in_any_unit_of_the_states(heads):
    """An epidemic with a rule for its infected: heads in the place of shares are the same motion, event by event."""
    susceptible, exposed, infected, N = sp.symbols("S E I N", real=True)
    rate = sp.Piecewise((a, infected > N / 100), (b, True)) * susceptible * infected / N
    rates = {susceptible: -rate, exposed: rate - exposed / 5, infected: exposed / 5 - infected / 10}
    epidemic = System(rates, parameters={N: 1, a: 0.1, b: 0.5})
    one, many = (
        solve(
            epidemic,
            (0, 300),
            [0.999 * n, 0.001 * n, 0],
            parameters={N: n},
            atol=1e-12 * min(n, 1),
            max_steps=200_000,
        )
        for n in (1, heads)
    )
    assert (
        one.success
        and many.success
        and [found.kind for found in many.ambiguities] == ["chattering within atol"]
    )
    assert len(many.events) == pytest.approx(len(one.events), rel=1e-3)
    assert many.x[:, -1] / heads == pytest.approx(one.x[:, -1], rel=1e-7)


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


# ---- Control laws that come to rest in finite time: arrival, rest and equivalent control are known.

s, z, x1, x2, x3 = sp.symbols("s z x1 x2 x3", real=True)
first, second, gain, size, speed = sp.symbols("first second gain size speed", positive=True)
d = size * sp.sin(speed * t)
POWERS = [sp.S.Half, sp.Rational(3, 5), sp.Rational(2, 3)]


def signed(e, power):
    return sp.Abs(e) ** power * sp.sign(e)


def system(rates, *parameters):
    return System(rates, time=t, parameters=dict.fromkeys((*parameters, size, speed), 1))


SUPER_TWISTING = system(
    {s: -first * signed(s, sp.S.Half) + w + d, w: -second * sp.sign(s), z: sp.sign(s)}, first, second
)


def after_arrival(solution, end, within):
    """Which points lie behind the arrival, of which the last event tells."""
    assert solution.success and not solution.ambiguities
    assert solution.events[-1].time == pytest.approx(end, abs=within)
    return solution.t > end + 1e-6


def super_twisting_by_another_path(first, second, d, s0, w0):
    """(arrival, integral of sign s): with r = sqrt(|s|) sign s and dtau = dt/(2 |r|) the right-hand side is smooth."""

    def at_zero(tau, y):
        return y[0]

    def arrived(tau, y):
        return abs(y[0]) + abs(y[1] + d(y[2])) - 1e-13

    at_zero.terminal = arrived.terminal = True
    y = np.array([math.copysign(math.sqrt(abs(s0)), s0), w0, 0.0, 0.0])
    while arrived(0, y) > 0:
        side = np.sign(y[0] or y[1] + d(y[2]))
        at_zero.direction = -side
        run = solve_ivp(
            lambda tau, y, side=side: [
                -first * y[0] + y[1] + d(y[2]), -2 * second * y[0], 2 * side * y[0], 2 * y[0]
            ],
            (0, 2000 / first), y, method="DOP853", rtol=3e-14, atol=1e-17, events=[at_zero, arrived],
        )  # fmt: skip
        y = run.y[:, -1]
        if len(run.t_events[1]):
            break
        y[0] = 0.0
    return y[2], y[3]


@pytest.mark.parametrize("seed", range(20))
def test_super_twisting_arrives_and_its_control_is_the_disturbance(seed):
    """Weakly damped, with many switchings, to overdamped, with one or none."""
    random = np.random.default_rng(seed)
    k2, rate = random.uniform(0.5, 3, 2)
    k1, force = math.sqrt(k2) * random.uniform(0.8, 4.5), random.uniform(0, 0.6) * k2 / rate
    start = random.normal(size=2)
    end, integral = super_twisting_by_another_path(k1, k2, lambda t: force * math.sin(rate * t), *start)
    p = {first: k1, second: k2, size: force, speed: rate}
    solution = solve(SUPER_TWISTING, (0, end + 2), [*start, 0], parameters=p)
    after = after_arrival(solution, end, 2e-8)
    d_now = force * np.sin(rate * solution.t[after])
    assert np.all(solution["s"][after] == 0) and solution["w"][after] == pytest.approx(-d_now, abs=1e-12)
    slope = force * rate * np.cos(rate * solution.t[after])
    assert solution.mult[0, after] == pytest.approx(slope / k2, abs=1e-11)
    integral += (d_now[-1] - force * math.sin(rate * end)) / k2
    assert solution["z"][-1] == pytest.approx(integral, abs=3e-8)


def reach(h, x0, v0, k, force, rate):
    """(time, x, v) where x'' = -k sign h + force sin(rate t) first comes to h(x, v) = 0."""
    side = math.copysign(1.0, h(x0, v0))

    def at(t):
        v = v0 - side * k * t + force / rate * (1 - math.cos(rate * t))
        return x0 + v0 * t - side * k * t**2 / 2 + force / rate * (t - math.sin(rate * t) / rate), v

    end = 1e-3
    while side * h(*at(end)) > 0:
        end += 1e-3
    end = brentq(lambda t: h(*at(t)), max(end - 1e-3, 0), end, xtol=1e-15, rtol=1e-15)
    return end, *at(end)


def power(e, p):
    return math.copysign(abs(e) ** float(p), e)


def arrives_by_sliding(model, p, h, pull, time_left, random):
    """Starts and gains at random, of which each has to slide from h = 0 to the origin; how many did."""
    count = 0
    for _ in range(12):
        k, rate, ratio = random.uniform(1, 4), random.uniform(0.5, 3), random.uniform(0.5, 1)
        force = random.uniform(0, 0.4) * k
        start = random.normal(size=2)
        there, *at = reach(lambda x, v, c=ratio: h(x, v, c), *start, k, force, rate)
        if pull(*at, ratio) > 0.95 * (k - force):
            continue  # crosses first
        end = there + time_left(*at, ratio)
        solution = solve(model, (0, end + 2), start, parameters={c: ratio, gain: k, size: force, speed: rate})
        after = after_arrival(solution, end, 1e-9)
        assert np.all(solution.x[:, after] == 0)
        expected = force * np.sin(rate * solution.t[after]) / k
        assert solution.mult[-1, after] == pytest.approx(expected, abs=1e-11)
        count += 1
    assert count >= 3


@pytest.mark.parametrize("p", POWERS)
def test_terminal_sliding_comes_to_rest(p):
    # Along v = -c |x|**p sign x: |v'| = c**2 p |x|**(2 p - 1), and |x|**(1 - p) falls evenly.
    arrives_by_sliding(
        system({x: v, v: -gain * sp.sign(v + c * signed(x, p)) + d}, c, gain), p,
        lambda x, v, c: v + c * power(x, p),
        lambda x, v, c: c**2 * p * abs(x) ** float(2 * p - 1),
        lambda x, v, c: abs(x) ** float(1 - p) / (c * float(1 - p)),
        np.random.default_rng(1),
    )  # fmt: skip


@pytest.mark.parametrize("q", [2, sp.Rational(5, 3), sp.Rational(3, 2)])
def test_nonsingular_terminal_sliding_comes_to_rest(q):
    # Along x = -c |v|**q sign v: |v'| = |v|**(2 - q)/(c q).
    arrives_by_sliding(
        system({x: v, v: -gain * sp.sign(x + c * signed(v, q)) + d}, c, gain), q,
        lambda x, v, c: x + c * power(v, q),
        lambda x, v, c: abs(v) ** float(2 - q) / (c * float(q)),
        lambda x, v, c: c * float(q) * abs(v) ** float(q - 1) / float(q - 1),
        np.random.default_rng(2),
    )  # fmt: skip


def test_the_time_optimal_control_of_a_double_integrator_stops_at_the_origin():
    solution = solve(System({x: v, v: -sp.sign(x + v * sp.Abs(v) / 2)}), (0, 9), [1, 0])
    after = after_arrival(solution, 2.0, 1e-13)
    assert np.all(solution.x[:, after] == 0) and np.all(solution.mult[:, after] == 0)


@pytest.mark.parametrize("p", POWERS[:2])
def test_a_chain_of_three_slides_on_to_where_its_inner_surface_leads(p):
    # s1 = x2 + c x1 is 0 after s1' = -|s1|**p sign s1 has brought it there; then x1' = -c x1.
    inner = x2 + c * x1
    surface = x3 + c * x2 + signed(inner, p)
    model = system({x1: x2, x2: x3, x3: -gain * sp.sign(surface) + d}, c, gain)
    value = sp.lambdify((x1, x2, x3, c), surface.replace(sp.sign, lambda e: e / sp.Abs(e)))
    random = np.random.default_rng(3)
    for _ in range(6):
        k, rate, a = random.uniform(2, 5), random.uniform(0.5, 3), random.uniform(0.3, 1)
        force, start = random.uniform(0, 0.3) * k, random.normal(size=3) / 2
        side = math.copysign(1, value(*start, a))

        def at_surface(t, y, a=a):
            return value(*y, a)

        at_surface.terminal, at_surface.direction = True, -side
        run = solve_ivp(
            lambda t, y, u=side * k, f=force, w=rate: [y[1], y[2], f * math.sin(w * t) - u],
            (0, 30), start, method="DOP853", rtol=3e-14, atol=1e-16, events=at_surface, max_step=0.05,
        )  # fmt: skip
        end = run.t[-1] + abs(run.y[1, -1] + a * run.y[0, -1]) ** float(1 - p) / float(1 - p)
        solution = solve(model, (0, end + 2), start, parameters={c: a, gain: k, size: force, speed: rate})
        # Rounding of s1, relative to x: 1e-16**(1 - p) of time, and what is left of it.
        after = after_arrival(solution, end, 1e-8)
        u, y = solution.t[after], solution.x[:, after]
        assert y[0] == pytest.approx(y[0, 0] * np.exp(-a * (u - u[0])), abs=1e-9)
        assert y[1] == pytest.approx(-a * y[0], abs=1e-9)
        assert solution.mult[-1, after] == pytest.approx((force * np.sin(rate * u) + a**3 * y[0]) / k, abs=1e-9)


@pytest.mark.parametrize("b", [sp.S.Half, sp.Rational(2, 3)])
def test_the_arrival_of_homogeneous_control_scales(b):
    # x -> m**(r + 1) x, v -> m**r v, t -> m t with r = 1/(1 - b) changes nothing: spirals and nodes.
    r = float(1 / (1 - b))
    model = System({x: v, v: -first * signed(x, b / (2 - b)) - second * signed(v, b)},
                   parameters={first: 1, second: 1})  # fmt: skip
    for k1, k2 in ((1, 1), (2.7, 2), (1.5, 0.6), (1.4, 4), (0.85, 2.8)):
        ends = []
        for m in (1, 0.4):
            solution = solve(model, (0, 60), [m ** (r + 1), 0.3 * m**r], parameters={first: k1, second: k2})
            assert solution.success and np.all(solution.x[:, -1] == 0)
            ends.append(solution.events[-1].time / m)
        assert ends[0] == pytest.approx(ends[1], abs=2e-6)


@pytest.mark.parametrize(
    ("surface", "there"),
    [(v + signed(x, sp.S.Half), 2.0), (x + v * sp.Abs(v), 2.0), (x + signed(v, sp.Rational(3, 2)), 2.0)],
)
def test_a_disturbance_that_exceeds_the_gain_ends_the_rest(surface, there):
    # At rest from the start, and held with lambda = t/2 until 2; then x'' = t - 2.
    solution = solve(System({x: v, v: -2 * sp.sign(surface) + t}, time=t), (0, 3), [0, 0], t_eval=[1, 1.9, 3])
    assert np.all(solution.x[:, :2] == 0) and solution.mult[-1, :2] == pytest.approx([0.5, 0.95], abs=1e-12)
    assert solution.x[:, 2] == pytest.approx([1 / 6, 0.5], abs=1e-8)
    assert min(e.time for e in solution.events) == pytest.approx(there, abs=1e-9)


def test_a_surface_that_is_touched_is_no_place_to_rest():
    # x = (t - 1)**2/2 touches 0, where sqrt(|x|) has its branch point, and goes on.
    solution = solve(System({x: v, v: 1, y: signed(x, sp.S.Half)}), (0, 2), [0.5, -1, 0])
    assert solution.x[:, -1] == pytest.approx([0.5, 1, 1 / math.sqrt(2)], abs=1e-9)


def test_what_breaks_loose_and_comes_to_the_origin_overloaded_goes_on():
    # |d| up to 2.5 against a gain of 2: the slide arrives where it cannot rest, is let go there, and is caught again.
    surface = v + signed(x, sp.S.Half)
    solution = solve(System({x: v, v: -2 * sp.sign(surface) + 2.5 * sp.sin(t)}, time=t), (0, 6), [0.5, 0])
    steep = solve_ivp(
        lambda t, y: [y[1], -2 * math.tanh((y[1] + power(y[0], 0.5)) * 1e7) + 2.5 * math.sin(t)],
        (0, 6), [0.5, 0], method="Radau", rtol=1e-7, atol=1e-10, max_step=0.02,
    )  # fmt: skip
    assert solution.success and solution.x[:, -1] == pytest.approx(steep.y[:, -1], abs=1e-5)


@pytest.mark.parametrize("method", ["auto", "rk"])
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("start", [0, 0.3])
def test_a_relay_at_whose_position_a_stop_holds_has_nothing_to_hold_when_an_event_acts(start, sign, method):
    # The stop holds the body down: what another state is set to changes neither it nor the force on it.
    stop = Unilateral(x, restitution=0)
    rates = {x: v, v: -1 + 0.3 * sp.sin(t) + sign * sp.sign(x) / 2 + stop.reaction, y: -y}
    tick = Event(every=0.4, update={y: -y / 2})
    solution = solve(System(rates, time=t, events=[tick]), (0, 4), [start, 0, 1], method=method)
    assert solution.success and not solution.ambiguities
    assert solution["x"][-1] == 0
    assert solution.mult[:, -1] == pytest.approx([0, 1 - 0.3 * math.sin(4)], abs=1e-12)
