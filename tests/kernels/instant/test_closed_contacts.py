"""A closed contact at which something jumps: a force, a velocity, the wall's motion, another contact.

Closed forms: uniformly accelerated flights, Newton's restitution, complementarity of all that close at once.

Guards: kernels/instant/contacts.py, kernels/instant/together.py.
"""

import math

import mpmath
import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Memory, System, Unilateral, solve

t, x, y, v, w = sp.symbols("t x y v w", real=True)
HALF = sp.Rational(1, 2)
METHODS = pytest.mark.parametrize("method", ["taylor", "rk"])


def floor(restitution=0):
    return Unilateral(x, restitution=restitution, name="A")


def ends(system, span, start, method="taylor", **options):
    solution = solve(system, (0, span), start, method=method, **options)
    assert solution.outcome.name == "FINISHED", solution.message
    return solution


@METHODS
def test_a_force_that_turns_round_lifts_the_body(method):
    A = floor()
    s = ends(System({x: v, v: sp.sign(t - 1) + A.reaction}, time=t), 2, [0, 0], method)
    assert s["x"][-1] == pytest.approx(0.5, abs=1e-9) and s["A"][-1] == 0
    m = Memory("m", -1)
    pulled = System({x: v, v: m + A.reaction}, time=t, events=[Event(at=[1], update={m: 1})])
    s = ends(pulled, 2, [0, 0], method)
    assert s["x"][-1] == pytest.approx(0.5, abs=1e-9) and s["A"][-1] == 0


@METHODS
@pytest.mark.parametrize(
    ("restitution", "kick", "end", "position", "speed"),
    [
        (0, 1, 2, 0.5, 0.0),
        (0, -1, 2, 0.0, 0.0),
        (HALF, 1, 2, 0.5, 0.0),
        (HALF, -1, 1.5, 0.125, 0.0),  # halfway through the first bounce, which begins with 1/2
        (HALF, -1, 3.1, 0.0, 0.0),  # bounces of 1, 1/2, 1/4, ... end after 2
    ],
)
def test_a_kick_lifts_or_rebounds(restitution, kick, end, position, speed, method):
    A = floor(restitution)
    kicked = System({x: v, v: -1 + A.reaction}, time=t, events=[Event(at=[1], update={v: v + kick})])
    s = ends(kicked, end, [0, 0], method)
    assert s["x"][-1] == pytest.approx(position, abs=1e-9)
    assert s["v"][-1] == pytest.approx(speed, abs=1e-9)


@METHODS
def test_a_body_that_is_lifted_falls_and_closes_again(method):
    A = floor()
    s = ends(
        System({x: v, v: -1 + A.reaction}, time=t, events=[Event(at=[1], update={x: HALF})]),
        1.5,
        [0, 0],
        method,
    )
    assert s["x"][-1] == pytest.approx(0.5 - 0.125, abs=1e-9)
    assert s["A"][-1] == 0
    later = ends(
        System({x: v, v: -1 + A.reaction}, time=t, events=[Event(at=[1], update={x: HALF})]), 3, [0, 0], method
    )
    assert later["x"][-1] == 0 and later["A"][-1] == pytest.approx(1)


@METHODS
@pytest.mark.parametrize(("rate", "position", "speed"), [(1, 1.0, 1.0), (-1, -0.5, -1.0)])
def test_a_wall_that_starts_to_move_takes_the_body_along_or_leaves_it(rate, position, speed, method):
    wall = Unilateral(x - rate * sp.Max(0, t - 1), name="A")
    s = ends(System({x: v, v: -1 + wall.reaction}, time=t), 2, [0, 0], method)
    assert s["x"][-1] == pytest.approx(position, abs=1e-9)
    assert s["v"][-1] == pytest.approx(speed, abs=1e-9)


def two_masses(e_floor=0, e_between=0):
    """Two unit masses one above the other, on a floor, under gravity 1."""
    A, B = floor(e_floor), Unilateral(y - x, restitution=e_between, name="B")
    return System({x: v, v: -1 + A.reaction - B.reaction, y: w, w: -1 + B.reaction})


@METHODS
def test_a_mass_lands_on_one_at_rest(method):
    s = ends(two_masses(), 3, [0, 0, 1, 0], method)
    assert [s[name][-1] for name in "xvyw"] == pytest.approx([0, 0, 0, 0], abs=1e-12)
    assert (s["A"][-1], s["B"][-1]) == pytest.approx((2, 1))


def test_two_masses_in_contact_land_together():
    s = ends(two_masses(), 3, [1, 0, 1, 0])
    assert [s[name][-1] for name in "xvyw"] == pytest.approx([0, 0, 0, 0], abs=1e-12)


def test_two_contacts_that_close_at_one_instant():
    fall = math.sqrt(2)  # both gaps, 1 - t^2/2 and 1 - t/fall, vanish then
    s = ends(two_masses(), 3, [1, 0, 2, -1 / fall])
    assert [s[name][-1] for name in "xvyw"] == pytest.approx([0, 0, 0, 0], abs=1e-12)


RATIOS = (0.3, 0.3, 0.2)
STACKS = [  # masses, heights, speeds
    ((2.1, 0.8, 3.0), (0.77, 1.73, 2.1), (-0.1, -0.5, -0.9)),
    ((0.9, 0.5, 1.8), (0.5, 0.62, 0.86), (0.8, -0.7, -0.3)),
    ((2.9, 0.6, 1.4), (0.82, 0.94, 1.1), (0.9, 0.4, -0.5)),
]


def collapse_in_digits(masses, heights, speeds):
    """Time of inelastic collapse of three masses above a floor under gravity 1, impact by impact in 300 digits, and how
    many impacts there are until their speeds are 1e-25."""
    with mpmath.workdps(300):
        y, u = [list(map(mpmath.mpf, q)) for q in (heights, speeds)]
        e, mass = [list(map(mpmath.mpf, q)) for q in (RATIOS, masses)]
        time = mpmath.mpf(0)
        for count in range(1, 5000):
            meets = [(u[0] + mpmath.sqrt(u[0] ** 2 + 2 * y[0]), 0)]
            meets += [((y[i] - y[i - 1]) / (u[i - 1] - u[i]), i) for i in (1, 2) if u[i] < u[i - 1]]
            step, i = min(meets)
            time += step
            y = [a + b * step - step**2 / 2 for a, b in zip(y, u, strict=True)]
            u = [b - step for b in u]
            if i == 0:
                u[0], y[0] = -e[0] * u[0], mpmath.mpf(0)
            else:
                kick = (1 + e[i]) * (u[i - 1] - u[i]) / (1 / mass[i] + 1 / mass[i - 1])
                u[i], u[i - 1] = u[i] + kick / mass[i], u[i - 1] - kick / mass[i - 1]
                y[i] = y[i - 1]
            if max(map(abs, u)) < 1e-25:
                return float(time), count
    return math.nan, count


@pytest.mark.parametrize(("masses", "heights", "speeds"), STACKS)
def test_impacts_among_three_masses_that_fall_on_each_other_come_to_an_end(masses, heights, speeds):
    """Inelastic collapse: hundreds of impacts within the rounding of time."""
    z, q = sp.symbols("z q", real=True)
    gaps = (x, y - x, z - y)
    named = zip(gaps, RATIOS, "ABC", strict=True)
    A, B, C = (Unilateral(gap, restitution=e, name=name).reaction for gap, e, name in named)
    a, b, c = masses
    stack = System({x: v, y: w, z: q, v: -1 + (A - B) / a, w: -1 + (B - C) / b, q: -1 + C / c})
    run = ends(stack, 40, dict(zip((x, y, z, v, w, q), (*heights, *speeds), strict=True)))
    time, count = collapse_in_digits(masses, heights, speeds)
    assert count > 100
    assert [e.kind for e in run.events][-6:] == 3 * ["accumulation"] + 3 * ["closed contact"]
    assert run.events[-1].time == pytest.approx(time, abs=1e-11)
    assert run.x[:, -1] == pytest.approx(np.zeros(6), abs=1e-20)


@pytest.mark.parametrize("gap", [1e-3, 1e-9, 1e-11, 1e-12, 1e-15, 1e-30])
def test_elastic_impacts_within_the_rounding_of_time_keep_their_energy(gap):
    """A heavy body drives a light one against a wall, and is turned round by 314 impacts, however near they all are."""
    A, B = floor(1), Unilateral(y - x, restitution=1, name="B")
    squeeze = System({x: v, y: w, v: A.reaction - B.reaction, w: B.reaction / 10_000})
    s = ends(squeeze, 1, {x: gap, y: 2 * gap, v: 0, w: -1})
    v_end, w_end = s["v"][-1], s["w"][-1]
    assert w_end**2 + v_end**2 / 10_000 == pytest.approx(1, abs=1e-13)
    # 314 times the velocity turns by the angle whose tangent is 1/100.
    assert w_end == pytest.approx(-math.cos(314 * math.atan(0.01)), abs=1e-12)


@pytest.mark.parametrize("span", [1, 1e3, 1e6])
def test_a_pile_does_not_sink_however_long_it_rests(span):
    """Forces are known to a rounding, and a rounding of them has moved a body by 1e-4 after 1e6."""
    z, q = sp.symbols("z q", real=True)
    A, B, C = (Unilateral(gap, name=name).reaction for gap, name in zip((x, y - x, z - y), "ABC", strict=True))
    pile = System({x: v, y: w, z: q, v: -1 + (A - B) / 2.9, w: -1 + (B - C) / 0.6, q: -1 + C / 1.4})
    for start in (0, 0.1):
        s = ends(pile, span, [start, start, start, 0, 0, 0])
        assert s.x[:, -1] == pytest.approx(np.zeros(6), abs=1e-20)


def test_what_depends_on_the_order_of_impacts_is_recorded():
    # Both arrive with -sqrt 2, the lower one rebounds with e = 1/2: together (Moreau) the pair leaves with sqrt(2)/2;
    # one after the other the upper mass, still falling, takes the speed away again.
    s = ends(two_masses(HALF), 1.5, [1, 0, 1, 0])
    after = math.sqrt(2) / 2
    rest = 1.5 - math.sqrt(2)
    assert s["x"][-1] == pytest.approx(after * rest - rest**2 / 2, abs=1e-9)
    assert [a.kind for a in s.ambiguities] == ["simultaneous impacts"]
    strict = solve(two_masses(HALF), (0, 1.5), [1, 0, 1, 0], strict=True)
    assert strict.outcome.name == "AMBIGUITY"
    # Where the order does not matter nothing is recorded.
    assert not ends(two_masses(), 3, [0, 0, 1, 0]).ambiguities


def test_a_contact_that_rests_and_is_hit_through_another_one_may_rebound():
    # A mass falls onto one, four times heavier, that rests on the floor; they stay together. Together both stop.
    # One by one both go down with a fifth of the speed, the floor throws the lower one back with half of that, and this
    # outweighs the upper one: they leave the floor.
    lower, upper = Unilateral(x, restitution=HALF, name="A"), Unilateral(y - x, name="B")
    rates = {x: v, v: -1 + (lower.reaction - upper.reaction) / 4, y: w, w: -1 + upper.reaction}
    s = ends(System(rates), 3, [0, 0, 1, 0])
    assert [s[name][-1] for name in "xvyw"] == pytest.approx([0, 0, 0, 0], abs=1e-12)
    assert [a.kind for a in s.ambiguities] == ["simultaneous impacts"]


@METHODS
@pytest.mark.parametrize(("lean", "end"), [(-1, 3), (1, 6)])
def test_a_corner_of_two_walls_that_are_not_orthogonal(lean, end, method):
    # A block slides along the floor y = 0 into a wall that leans over it, or back, without restitution. At t = 2 it
    # comes with speed 1: under an overhang it stops; a wall that leans back it climbs with (1/5, 2/5), slides back, and
    # comes again with a fifth of the speed, until it rests in the corner from t = 14/3 on.
    A, B = Unilateral(y, name="A"), Unilateral(1 - x + lean * y / 2, name="B")
    system = System({x: v, v: HALF - B.reaction, y: w, w: -1 + A.reaction + lean * B.reaction / 2})
    s = ends(system, end, {x: 0, v: 0, y: 0, w: 0}, method)
    assert [s[name][-1] for name in "xvyw"] == pytest.approx([1, 0, 0, 0], abs=1e-9)
    assert (s["A"][-1], s["B"][-1]) == pytest.approx((1 - lean / 4, 0.5), abs=1e-9)


@pytest.mark.parametrize(
    ("k", "after"),
    [(1.25, (-0.32, 0.24)), (0.25, (0, 0)), (-0.25, (0.25, 0))],
    ids=["along the inclined wall", "at rest", "along the floor"],
)
def test_after_an_impact_in_a_corner_the_velocity_is_the_nearest_that_no_wall_forbids(k, after):
    # Moreau's projection of (-k, -1) on the cone w >= 0, 3 v + 4 w >= 0. In the first and the last case both walls
    # together stop the point only if one of them pulls: the other pushes alone, by 31/20 (3, 4)/5 or by (0, 1).
    A, B = Unilateral(y, name="A"), Unilateral((3 * x + 4 * y) / 5, name="B")
    point = System({x: v, v: 3 * B.reaction / 5, y: w, w: A.reaction + 4 * B.reaction / 5})
    s = ends(point, 2, {x: k, v: -k, y: 1, w: -1})
    assert [s[name][-1] for name in "xyvw"] == pytest.approx([*after, *after], abs=1e-12)


def test_two_contacts_that_say_the_same_are_one():
    A, B = floor(), Unilateral(2 * x, name="B")
    s = ends(System({x: v, v: sp.sign(t - 1) + A.reaction + B.reaction}, time=t), 2, [0.1, 0])
    assert s["x"][-1] == pytest.approx(0.5, abs=1e-9)


def test_a_closed_contact_keeps_its_gap_and_rate_at_zero():
    table = sp.sin(t) * sp.Rational(201, 200)
    A = Unilateral(x - table, restitution=HALF, name="A")
    s = solve(
        System({x: v, v: -1 + A.reaction}, time=t), (0, 60), [0, 1.005], t_eval=[k * 0.37 for k in range(163)]
    )
    closed = s.status[0] == 0
    assert closed.sum() > 100
    gap = s["x"] - 1.005 * np.sin(s.t)
    rate = s["v"] - 1.005 * np.cos(s.t)
    assert abs(gap[closed]).max() < 1e-11 and abs(rate[closed]).max() < 1e-11


def on_table(table, start, span, method, restitution=HALF, **options):
    """A ball on a table of this height, under g = 12."""
    stop = Unilateral(x - table, restitution=restitution, name="A")
    return solve(System({x: v, v: -12 + stop.reaction}, time=t), span, start, method=method, **options)


@METHODS
def test_a_ball_leaves_a_table_whose_velocity_jumps_at_a_known_instant(method):
    """The table goes down from t = 1 and up from t = 2: relative to it the ball comes with -2 and leaves with 1."""
    for table in (
        HALF - sp.Abs(sp.Mod(t, 2) - 1),
        HALF - sp.Abs(t - 1 - 2 * sp.floor(t / 2)),
        sp.Abs(t - 2) - HALF,
    ):
        run = on_table(table, [0, -1], (1.5, 2.1), method, max_steps=1000)
        assert run.x[:, -1] == pytest.approx([-0.36, 0.8], abs=1e-9), str(table)
    # Of any period the last one is as the first: bounces of 2/12, 1/12, ... have ended.
    late = on_table(HALF - sp.Abs(sp.Mod(t, 2) - 1), [0, -1], (1.5, 8.1), method, max_steps=1000)
    assert late.x[:, -1] == pytest.approx([-0.36, 0.8], abs=1e-9)


@METHODS
def test_a_table_that_steps_down_leaves_the_ball_and_one_that_steps_up_is_an_outcome(method):
    down = on_table(-sp.Heaviside(t - 2) / 10, [0, 0], (1, 2.1), method)
    assert down.x[:, -1] == pytest.approx([-0.06, -1.2], abs=1e-9)
    up = on_table(sp.Heaviside(t - 2) / 10, [0, 0], (1, 3), method)
    assert up.outcome.name == "BEHIND_CONTACT" and up.t[-1] == 2.0


@METHODS
def test_bounces_end_beside_another_body_that_rests(method):
    A, B = floor(HALF), Unilateral(y, restitution=HALF, name="B")
    pair = System({x: v, v: -9 + A.reaction, y: w, w: -7 + B.reaction})
    run = ends(pair, 4, {x: 0, v: 0, y: 0, w: 1e-4}, method, max_steps=200)
    assert len(run.event_times("closed contact")) == 1
    # With 2 w/7 (1 + 1/2 + 1/4 + ...).
    assert run.event_times("closed contact")[0] == pytest.approx(4e-4 / 7, rel=1e-6)


@METHODS
@pytest.mark.parametrize(
    ("masses", "e", "places", "unit"),
    [
        ((1, 1, 1), 0.01, (0, 1, 2.1), 1),
        ((1, 1, 1), 0.05, (100, 101, 102.1), 1e3),
        ((12, 1, 13), 0.16, (0, 1, 1.8), 1),
        ((1.2, 0.03, 1.3), 0.47, (0, 0.7, 1.9), 1e-3),
    ],
)
def test_bodies_whose_impacts_collapse_go_on_with_one_speed(masses, e, places, unit, method):
    """Where e is less than 7 - 4 sqrt 3 of equal ones (McNamara and Young 1992): with that of all their momentum."""
    z, q, a, b, c, ratio = sp.symbols("z q a b c ratio", real=True)
    A, B = Unilateral(y - x, restitution=ratio, name="A"), Unilateral(z - y, restitution=ratio, name="B")
    forces = {v: -A.reaction / a, w: (A.reaction - B.reaction) / b, q: B.reaction / c}
    row = System({x: v, y: w, z: q} | forces, parameters={a: 1, b: 1, c: 1, ratio: 0})
    speeds = np.array([1, 0, -1])
    start = dict(zip((x, y, z, v, w, q), unit * np.array([*places, *speeds]), strict=True))
    values = dict(zip((a, b, c, ratio), (*masses, e)))
    run = ends(row, 10, start, method, parameters=values)
    common = np.dot(masses, speeds) / sum(masses)
    assert np.abs(run.x[3:, -1] / unit - common).max() < 1e-12
    assert not run.ambiguities


@pytest.mark.parametrize(("force", "lifts"), [(-0.5, True), (-0.9, False)])
@METHODS
def test_a_switch_that_would_stick_by_a_pull_of_a_contact_crosses(method, force, lifts):
    """On y = 1/8 the force on the ball steps up by 1.5, and y is driven by half of its reaction: 0.75 - force before.

    Beyond the surface a contact that could pull would drive y back; a rigid one opens, or presses less.
    """
    R = Unilateral(x, name="A")
    push = sp.sign(2 * y + v - 0.25)
    system = System({x: v, v: w + R.reaction + 0.75 * push, y: 0.1 + R.reaction / 2, w: 0}, contacts=[R])
    met = 0.125 / (0.1 + (0.75 - force) / 2)
    run = ends(system, met + 0.5, {x: 0, v: 0, y: 0, w: force}, method)
    lift = max(force + 0.75, 0)
    assert len(run.event_times(kind="opening")) == lifts
    expected = 0.125 + 0.5 * (0.1 + max(-force - 0.75, 0) / 2)
    np.testing.assert_allclose(
        [run["x"][-1], run["v"][-1], run["y"][-1]], [lift / 8, lift / 2, expected], atol=1e-9
    )
