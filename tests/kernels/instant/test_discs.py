"""Vector friction: slip that comes to rest, sticks and begins again; closed forms and reference numbers.

Numbers that stand here without a formula were made by mpmath or by tests/fuzz/polar.py, not by the package.

Guards: kernels/instant/discs.py, kernels/step/onset.py, kernels/surface/vector.py.
"""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from pwsmooth import Disc, Event, Memory, Switch, System, Unilateral, solve

t, x, y, z, vx, vy, vz = sp.symbols("t x y z vx vy vz", real=True)
F1, F2, mu, rho = sp.symbols("F1 F2 mu rho", real=True)
TIGHT = {"rtol": 1e-12, "atol": 1e-14, "max_steps": 5_000}


def in_plane(name="lam"):
    lam = Disc(name, (vx, vy))
    return System({x: vx, y: vy, vx: F1 - mu * lam[0], vy: F2 - mu * lam[1]}, parameters={F1: 0, F2: 0, mu: 1})


@pytest.fixture(scope="module")
def block():
    """A block on an incline; F is the force along it."""
    return in_plane()


@pytest.fixture(scope="module")
def oscillator():
    """A spring in the plane, forced along an ellipse."""
    lam = Disc("lam", (vx, vy))
    return System({x: vx, y: vy, vx: 1.6 * sp.cos(t / 4) - x - lam[0], vy: sp.sin(t / 4) - y - lam[1]}, time=t)


def at_rest(solution):
    """Time and place of the only event."""
    (event,) = solution.events
    assert event.kind == "stick"
    return event.time, solution.x[:2, -1]


@pytest.mark.parametrize("ratio", [1.001, 1.05, 1.5, 3, 100])
def test_a_block_thrown_across_an_incline_rests_where_the_closed_form_says(block, ratio):
    thrown = solve(
        block, (0, 1.1 * ratio / (ratio**2 - 1)), [0, 0, 0, 1], parameters={"F1": 1, "mu": ratio}, **TIGHT
    )
    time, place = at_rest(thrown)
    down, across = 1 / (4 * (ratio**2 - 1)), 2 * ratio / (4 * ratio**2 - 1)
    assert time == pytest.approx(ratio / (ratio**2 - 1), rel=1e-11)
    assert place == pytest.approx([down, across], rel=1e-11)


def test_a_block_thrown_in_any_direction(block):
    start = [0, 0, 2 * math.cos(2.5), 2 * math.sin(2.5)]
    time, place = at_rest(solve(block, (0, 10), start, parameters={"F1": 1, "mu": 1.05}, **TIGHT))
    assert time == pytest.approx(4.855734330791537, abs=1e-12)
    assert place == pytest.approx([-0.395809755287294, 0.911823302389137], abs=1e-12)


def test_a_point_in_space_comes_to_rest():
    lam = Disc("lam", (vx, vy, vz))
    force = (0.2, -0.1, 0.15)
    space = System(
        {x: vx, y: vy, z: vz} | {v: F - n / 2 for v, F, n in zip((vx, vy, vz), force, lam, strict=True)}
    )
    s = solve(space, (0, 2), [0, 0, 0, 0.3, 0.5, -0.4], **TIGHT)
    assert s.events[0].time == pytest.approx(1.710159947004360, abs=1e-12)
    assert s.x[:3, -1] == pytest.approx([0.32345096, 0.29878062, -0.20020611], abs=1e-8)


def test_a_block_thrown_almost_against_the_force(block):
    start = [0, 0, -math.cos(1e-8), math.sin(1e-8)]
    time, place = at_rest(solve(block, (0, 2), start, parameters={"F1": 1, "mu": 1.5}, **TIGHT))
    assert time == pytest.approx(0.4, abs=1e-14)
    assert place == pytest.approx([-0.2, 2.5e-9], abs=1e-14)


@pytest.mark.parametrize("least", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_near_miss_keeps_the_identity_of_slip(block, least):
    from tests.fuzz.lines import _beside

    away = _beside(1.5, least)
    s = solve(block, (0, 2), [0, 0, -math.cos(away), math.sin(away)], parameters={"F1": 1.5}, **TIGHT)
    kept = np.hypot(s["vx"], s["vy"]) + 1.5 * s["vx"]
    assert len(s.events) == 0 and np.hypot(s["vx"], s["vy"]).min() < 2 * least
    # d/dt (mu |v| + F.v) = |F|^2 - mu^2
    assert kept - kept[0] == pytest.approx(1.25 * s.t, abs=1e-11)
    assert s.cost["steps"] < 50 + 5 * math.log10(1 / least)


def test_a_slip_begins_where_the_force_leaves_the_circle():
    lam = Disc("lam", (vx, vy))
    onset = System({x: vx, y: vy, vx: 1 + 0.7 * t - lam[0], vy: 0.4 * t - lam[1]}, time=t)
    s = solve(onset, (0, 1), [0, 0, 0, 0], **TIGHT)
    assert s.x[2:, -1] == pytest.approx([0.35946343299753, 0.07557447075304], abs=1e-12)
    assert s.x[:2, -1] == pytest.approx([0.11947887404634, 0.02084439403780], abs=1e-12)


def hidden():
    """A slow force on a block with hidden static friction: break-away at 16/9 mu for rho = 3."""
    lam = Disc("lam", (vx, vy))
    friction = [n * (1 + 3 * (1 - lam.square)) for n in lam]
    return System(
        {x: vx, y: vy, vx: sp.Rational(1, 10) * t * sp.cos(0.3) - friction[0],
         vy: sp.Rational(1, 10) * t * sp.sin(0.3) - friction[1]}, time=t,
    )  # fmt: skip


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-11])
def test_a_slip_that_begins_takes_switches_on_its_components_along_at_once(rtol):
    """A surface of the slip is 0 with it, and beyond it the slip leads: it is never on the other side."""
    lam, given = Disc("lam", (vx, vy)), {F1: 0.75, F2: 1, mu: 1}
    pull = sp.sin(3 * t) / 2 - F1, F2 * sp.sin(3 * t - 0.25) / 2
    rates = {vx: pull[0] - mu * lam[0], vy: pull[1] - mu * lam[1]}
    alone = System(rates, time=t, parameters=given)
    for sides, change in ((vx - vy, 1), (vy - vx, 0), (2 * vx + vy, 1)):
        beside = System(
            rates | {z: 1 + 0.1 * sp.Piecewise((z, sides < 0), (-z, True))}, time=t, parameters=given
        )
        for turned in (0.0, 0.7, 1.1):
            starts, options = {vx: 0, vy: 0}, {"rtol": rtol, "parameters": {F2: turned}}
            run = solve(alone, (0, 1.6), starts, **options)
            other = solve(beside, (0, 1.6), starts | {z: 0}, **options)
            assert run.success and other.success
            crossings = [event for event in other.events if event.kind == "crossing" and event.switch != "lam"]
            assert len(crossings) == change
            np.testing.assert_allclose(other.y[:2, -1], run.y[:2, -1], atol=10 * rtol)


@pytest.mark.parametrize("unit", [1e-8, 1e-6, 1.0, 1e6])
def test_a_small_slip_comes_to_rest_in_any_unit_of_time(unit):
    # From 3e-4 of rest powers of its rate exceed all numbers soon where the unit is short.
    lam = Disc("lam", (vx - 0.25, vy))
    rates = {vx: sp.sin(2 * t / unit + 0.75) / 2 - lam[0], vy: sp.sin(t / unit) / 2 - lam[1]}
    run = solve(
        System({v: rate / unit for v, rate in rates.items()}, time=t),
        (2.28 * unit, 3 * unit),
        {vx: 0.2497, vy: 0.00012},
    )
    assert run.success and run.y[:, -1].tolist() == [0.25, 0]
    np.testing.assert_allclose(run.event_times(kind="stick") / unit, [2.28071863], rtol=1e-8)


def test_a_hidden_fold_lets_go_on_the_break_away_circle():
    s = solve(hidden(), (0, 20), [0, 0, 0, 0], **TIGHT)
    (event,) = s.events
    assert event.kind == "slip by fold" and event.time == pytest.approx(160 / 9, abs=1e-11)
    assert math.atan2(s["vy"][-1], s["vx"][-1]) == pytest.approx(0.3, abs=1e-13)
    after = 20 - 160 / 9
    assert np.hypot(s["vx"], s["vy"])[-1] == pytest.approx(7 / 9 * after + 0.05 * after**2, abs=1e-11)


@pytest.mark.parametrize("force", [0.0, 0.5, 1.0, 1.5, 1.7])
def test_a_block_at_rest_within_the_break_away_circle_stays(force):
    s = solve(hidden(), (10 * force, 10 * force + 0.5), [1, 2, 0, 0], **TIGHT)
    assert s.success and len(s.events) == 0 and np.all(s.x[2:] == 0)


@pytest.mark.parametrize("excess", [1e-4, 6e-4, 1e-2])
def test_a_root_just_beyond_the_circle_is_no_stick(excess):
    """The layer creeps towards it, and on to the slip: from the start on, of which no event is told."""
    lam, force = Disc("lam", (vx, vy)), 1 + excess
    friction = 1 + 0.134 * (1 - lam.square)  # without a fold inside the circle
    system = System({vx: 0.6 * force - lam[0] * friction, vy: 0.8 * force - lam[1] * friction})
    s = solve(system, (0, 1), [0, 0], **TIGHT)
    assert not s.events
    assert s.x[:, -1] == pytest.approx([0.6 * excess, 0.8 * excess], rel=1e-8)


def test_a_block_at_rest_beyond_the_break_away_circle_slips_along_the_force():
    s = solve(hidden(), (18, 19), [0, 0, 0, 0], **TIGHT)
    assert s.success and len(s.events) == 0
    assert s["vx"][-1] == pytest.approx(0.85 * math.cos(0.3), abs=1e-12)
    assert s["vy"][-1] == pytest.approx(0.85 * math.sin(0.3), abs=1e-12)


STOPS = [2.1381845484922919, 4.4149357549058344, 16.2591192738651348, 16.5556925522136114]
PLACE = [1.0703152234846091, -0.1501620315342416]


def test_a_forced_oscillator_stops_and_goes(oscillator):
    s = solve(oscillator, (0, 30), [0.3, 0.1, 0.5, -0.4], **TIGHT)
    assert [e.kind for e in s.events] == 2 * ["stick", "slip by tangency"]
    assert [e.time for e in s.events] == pytest.approx(STOPS, abs=2e-12)
    assert s.x[:2, -1] == pytest.approx(PLACE, abs=1e-12)


def test_the_pair_is_refused(oscillator):
    # Behind an onset it lost digits in silence.
    with pytest.raises(ValueError, match="method 'rk' of a system with a disc"):
        solve(oscillator, (0, 30), [0.3, 0.1, 0.5, -0.4], method="rk")


@pytest.mark.parametrize("mixed", [[[0.8, -0.6], [0.6, 0.8]], [[1, 0.5], [0.2, 1]]])
def test_other_coordinates_are_the_same_motion(mixed):
    """v = B u with u in the place of v: rows of B that are not orthogonal as well."""
    B = sp.Matrix(mixed)
    lam = Disc("lam", tuple(B @ sp.Matrix([vx, vy])))
    force = sp.Matrix([1.6 * sp.cos(t / 4) - x - lam[0], sp.sin(t / 4) - y - lam[1]])
    slip = B @ sp.Matrix([vx, vy])
    other = System(dict(zip((x, y, vx, vy), (*slip, *(B.inv() @ force)), strict=True)), time=t)
    u = np.linalg.solve(np.array(mixed, float), [0.5, -0.4])
    s = solve(other, (0, 30), [0.3, 0.1, *u], **TIGHT)
    assert [e.kind for e in s.events] == 2 * ["stick", "slip by tangency"]
    assert [e.time for e in s.events] == pytest.approx(STOPS, abs=2e-12)
    assert s.x[:2, -1] == pytest.approx(PLACE, abs=1e-12)


def test_an_ellipse_of_friction_of_most_dissipation():
    """h = M v, force -M lambda, free: from (1, 1) it rests where integrals of Gauss's function say."""
    lam = Disc("lam", (0.3 * vx, 0.5 * vy))
    s = solve(System({x: vx, y: vy, vx: -0.3 * lam[0], vy: -0.5 * lam[1]}), (0, 5), [0, 0, 1, 1], **TIGHT)
    time, place = at_rest(s)
    assert time == pytest.approx(4.1287080133045543, abs=2e-12)
    assert place == pytest.approx([2.3068060142496791, 1.3559479823709407], abs=2e-12)


def test_an_ellipse_of_friction_along_the_slip():
    lam = Disc("lam", (vx, vy))
    s = solve(System({x: vx, y: vy, vx: -0.3 * lam[0], vy: -0.5 * lam[1]}), (0, 5), [0, 0, 1, 1], **TIGHT)
    time, place = at_rest(s)
    assert time == pytest.approx(3.962428079904422, abs=2e-12)
    assert place == pytest.approx([2.1007919375623388, 1.60947570824873], abs=2e-12)


def test_a_force_beyond_the_circle_moves_a_body_of_two_inertias_in_its_own_direction():
    """A(F - n) = c n with |n| = 1 and A = diag(1, 1/4)."""
    lam = Disc("lam", (vx, vy))
    s = solve(
        System({x: vx, y: vy, vx: 0.8 - lam[0], vy: (0.9 - lam[1]) / 4}), (0, 1e-3), [0, 0, 0, 0], **TIGHT
    )
    # F is constant: the way out is a line.
    c, n = 0.08358766501991, np.array([0.73828821, 0.67448537])
    assert s.x[2:, -1] == pytest.approx(1e-3 * c * n, abs=1e-11)


@pytest.mark.parametrize(
    ("angle", "rate"),
    [(-3.082747165291, -1.1001733897), (-1.427341676187, -0.3005189297), (-0.077034462765, -0.8997025491),
     (1.445530650653, -0.1996051315)],
)  # fmt: skip
def test_along_a_limit_direction_a_body_of_two_inertias_comes_to_rest_on_a_line(angle, rate):
    """G(n) = R n with A = diag(1, 1/4): nodes and saddles alike, as far as the digits of the angle carry."""
    lam = Disc("lam", (vx, vy))
    slow = System({x: vx, y: vy, vx: 0.1 - lam[0], vy: (0.2 - lam[1]) / 4})
    s = solve(slow, (0, 6), [0, 0, math.cos(angle), math.sin(angle)], **TIGHT)
    time, place = at_rest(s)
    assert time == pytest.approx(-1 / rate, rel=1e-9)
    assert place == pytest.approx([math.cos(angle) * time / 2, math.sin(angle) * time / 2], abs=1e-9)


def test_a_circular_force_drives_a_circle():
    """m = 1, k = 0.5, w = 1: radius sqrt(P^2 - mu^2)/|k - w^2| of the motion without stick."""
    lam = Disc("lam", (vx, vy))
    P, k = 1.25, 0.5
    radius = math.sqrt(P**2 - 1) / abs(k - 1)
    # z = R exp(i(t - a)): (k - 1) R + i = P exp(i a)
    a = math.atan2(1, (k - 1) * radius)
    forced = System(
        {x: vx, y: vy, vx: P * sp.cos(t) - k * x - lam[0], vy: P * sp.sin(t) - k * y - lam[1]}, time=t
    )
    start = [radius * math.cos(a), -radius * math.sin(a), radius * math.sin(a), radius * math.cos(a)]
    s = solve(forced, (0, 2 * math.pi), start, **TIGHT)
    assert len(s.events) == 0 and np.hypot(s["x"], s["y"]) == pytest.approx(radius, abs=1e-11)
    assert s.x[:, -1] == pytest.approx(start, abs=1e-11)


def test_what_holds_from_the_start_is_no_event(block):
    s = solve(block, (0, 1), [0, 0, 0, 0], parameters={"F1": 2}, **TIGHT)
    assert s.itinerary == ("slip (lam)",) and len(s.events) == 0


def turned(events=()):
    """Coordinates turned by 0.4: a block that has stopped has the velocity 0 but for rounding."""
    c, s = math.cos(0.4), math.sin(0.4)
    lam = Disc("lam", (c * vx - s * vy, s * vx + c * vy))
    push = (F1 - mu * lam[0], F2 - mu * lam[1])
    return System(
        {x: vx, y: vy, vx: c * push[0] + s * push[1], vy: c * push[1] - s * push[0]},
        events=events, parameters={F1: 0.5, F2: 0.2, mu: 1},
    )  # fmt: skip


def test_a_clock_leaves_at_rest_what_rests():
    count = Memory("count")
    ticking = turned([Event(every=0.5, update={count: count + 1}, name="clock")])
    s = solve(ticking, (0, 9), [0, 0, 0.6, -0.4], **TIGHT)
    assert [e.kind for e in s.events if e.switch == "lam"] == ["stick"] and s["count"][-1] >= 17


def test_a_run_goes_on_from_where_another_has_stopped():
    once = solve(turned(), (0, 9), [0, 0, 0.6, -0.4], **TIGHT)
    again = solve(turned(), (9, 18), once.x[:, -1], **TIGHT)
    assert once.itinerary[-1] == "stick (lam sliding)" and again.itinerary == ("stick (lam sliding)",)
    assert again.x[:2, -1] == pytest.approx(once.x[:2, -1], abs=1e-15)


def test_a_kick_moves_a_block_that_rests():
    kicked = turned([Event(at=5, update={vx: vx + 0.6, vy: vy - 0.4}, name="kick")])
    s = solve(kicked, (0, 10), [0, 0, 0.6, -0.4], **TIGHT)
    stops = [e.time for e in s.events if e.kind == "stick"]
    assert len(stops) == 2 and stops[1] - 5 == pytest.approx(stops[0], abs=1e-12)
    assert s.x[:2, -1] == pytest.approx(2 * s.x[:2, np.searchsorted(s.t, 4.9)], abs=1e-12)


def test_a_pass_through_rest_closer_than_rounding_goes_on(block):
    start = [0, 0, -math.cos(1e-13), math.sin(1e-13)]
    s = solve(block, (0, 2), start, parameters={"F1": 3}, **TIGHT)
    # mu |v| + F.v grows at the rate |F|^2 - mu^2 through it.
    assert s.success and np.hypot(s["vx"], s["vy"])[-1] + 3 * s["vx"][-1] == pytest.approx(14, abs=1e-11)


def test_turned_frames_have_the_same_events():
    forces, turn = sp.symbols("c0:4", real=True), sp.Symbol("turn", real=True)
    lam = Disc("lam", (vx, vy))
    along, across = forces[0] * sp.cos(forces[1] * t), forces[2] * sp.sin(forces[3] * t)
    shaken = System(
        {
            x: vx,
            y: vy,
            vx: sp.cos(turn) * along - sp.sin(turn) * across - x - lam[0] / 2,
            vy: sp.sin(turn) * along + sp.cos(turn) * across - y - lam[1] / 2,
        },
        time=t,
        parameters={turn: 0, **dict.fromkeys(forces, 1)},
    )
    draw = np.random.default_rng(3)
    for _ in range(30):
        given, angle = draw.uniform(0.3, 1.5, 4), draw.uniform(0, 2 * np.pi)
        start = draw.uniform(-1, 1, 4)
        rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        runs = [
            solve(shaken, (0, 20), s, parameters=dict(zip(forces, given)) | {turn: a}, **TIGHT)
            for s, a in ((start, 0), (np.concatenate([rotation @ start[:2], rotation @ start[2:]]), angle))
        ]
        assert runs[0].itinerary == runs[1].itinerary
        assert runs[0].event_times() == pytest.approx(runs[1].event_times(), abs=1e-10)


def test_how_near_to_rest_a_hidden_static_friction_catches():
    # Under F = 1.4 the slip is caught where r sin(phi) tan(phi/2)^(-1/F) is less than 3.96061 eps.
    lam, width, far = Disc("lam", (vx, vy)), 1e-4, 1.0
    pull = 1 + 3 * (1 - lam.square)
    pushed = System({vx: sp.Rational(7, 5) - pull * lam[0], vy: -pull * lam[1]}).smoothed(width)

    def caught(window):
        def excess(off):
            return far * math.sin(off) * math.tan(off / 2) ** (1 / 1.4) - window

        off = brentq(excess, 1e-12, 1.5, xtol=1e-15)
        run = solve(pushed, (0, 12), {vx: -math.cos(off), vy: math.sin(off)}, rtol=1e-9, atol=1e-13)
        return np.hypot(*run.x[:, -1]) < 50 * width

    assert caught(3.9604 * width) and not caught(3.9608 * width)


def test_lambda_at_the_instant_at_which_a_slip_begins():
    lam = Disc("lam", (vx, vy))
    pulled = System({vx: 4 * t / 5 - lam[0], vy: 3 * t / 5 - lam[1]}, time=t, outputs={"pull": lam[0]})
    run = solve(pulled, (0, 3), {vx: 0, vy: 0}, dense_output=True, **TIGHT)
    (slip,) = run.event_times("slip by tangency")
    for name in ("lam_x", "pull"):
        assert run(slip, name) == pytest.approx(0.8, abs=1e-12)


def test_the_last_moments_before_rest_are_there_for_whoever_asks(block):
    # (mu |v| + F.v)/(mu^2 - |F|^2) is the time that is left.
    given = {"F1": 1, "F2": 0.4, "mu": 1.3}
    start = [0, 0, 0.8, -1.1]
    plain = solve(block, (0, 20), start, parameters=given, **TIGHT)
    stop = plain.event_times("stick")[0]
    left = np.array([1e-3, 1e-4, 1e-5, 3e-6, 1e-6, 1e-7, 1e-8])
    dense = solve(block, (0, 20), start, parameters=given, dense_output=True, **TIGHT)
    asked = solve(block, (0, 20), start, parameters=given, t_eval=stop - left, **TIGHT)
    assert np.array_equal(dense.event_times(), plain.event_times()) and np.array_equal(dense.x, plain.x)
    assert np.array_equal(asked.event_times(), plain.event_times())
    for speed, push in ((dense(stop - left)[2:], dense(stop - left, "lam_x")), (asked.x[2:], asked["lam_x"])):
        size = np.hypot(*speed)
        told = (1.3 * size + speed[0] + 0.4 * speed[1]) / (1.3**2 - 1.16)
        assert told == pytest.approx(left, rel=1e-6, abs=1e-13)
        assert push == pytest.approx(speed[0] / size, abs=1e-9)


def test_a_disc_and_a_switch_at_rest_are_settled_together():
    """A block on a plate that rubs on the ground: whether one slips depends on the other, and the start is no event."""
    x, y, u, vx, vy, w = sp.symbols("x y u v_x v_y w", real=True)
    pull, drive = sp.symbols("pull drive", real=True)
    lam, s = Disc("lam", (vx - w, vy)), Switch("s", w)
    rates = {x: vx, y: vy, u: w, vx: pull - lam[0], vy: -lam[1], w: drive + lam[0] - 1.5 * s}
    system = System(rates, parameters={pull: 0.0, drive: 0.0})
    # Block and plate hold each other; the block slips on the plate that it holds; both go together.
    for given, speeds in (((-0.9, 1.8), (0, 0)), ((-1.1, 1.8), (-0.1, 0)), ((-0.5, 2.6), (0.3, 0.3))):
        solution = solve(system, (0, 1), [0] * 6, parameters=dict(zip((pull, drive), given, strict=True)))
        assert solution.success and not solution.events and not solution.ambiguities
        assert np.allclose(solution.x[[3, 5], -1], speeds, atol=1e-12)


@pytest.mark.parametrize("start", [(0, 0), (-0.25, 0.1), (0, 0.1)])
def test_what_a_switch_holds_a_disc_leaves_to_it_and_takes_over(start):
    """Two brakes along y: the switch gives way at the force 1, and the disc as the rest leaves its circle."""
    lam = Disc("lam", (vx, vy))
    force = 0.4 * sp.sin(t), 0.2 + t / 2
    brakes = System({vx: force[0] - lam[0] / 2, vy: force[1] - lam[1] / 2 - sp.sign(vy)}, time=t)
    run = solve(brakes, (0, 4), dict(zip((vx, vy), start, strict=True)), dense_output=True)
    assert run.success and [a.kind for a in run.ambiguities] == ["multipliers not unique"]
    gives = brentq(lambda s: (0.8 * math.sin(s)) ** 2 + (s - 1.6) ** 2 - 1, 1.6, 3)
    # A disc that slips leaves a switch beside it to its side, which has gone before.
    np.testing.assert_allclose(run.event_times(kind="slip"), [1.6, gives], atol=1e-9)
    assert np.abs(run(gives)).max() < 1e-12 and run["vy"][-1] > 0.1


@pytest.mark.parametrize(("jump", "slips"), [(0.5, False), (1.2, False), (2.0, True)])
def test_a_force_that_jumps_is_shared_anew_by_a_disc_and_a_switch(jump, slips):
    # Together they hold 3/2 along y; at t = 1 the force becomes 0.2 + jump.
    lam, more = Disc("lam", (vx, vy)), Memory("more", 0.0)
    strike = Event(at=1, update={more: more + jump})
    brakes = System({vx: -lam[0] / 2, vy: 0.2 + more - lam[1] / 2 - sp.sign(vy)}, time=t, events=[strike])
    run = solve(brakes, (0, 2), {vx: 0, vy: 0})
    assert run.success and run["vy"][-1] == pytest.approx(0.7 if slips else 0, abs=1e-9)


def test_a_slip_begins_where_the_sticks_beside_it_hold_as_they_will():
    """A block that is pulled askew off a plate which its friction and the ground hold: at once as in closed form."""
    x, y, u, vx, vy, w = sp.symbols("x y u v_x v_y w", real=True)
    lam, s = Disc("lam", (vx - w, vy)), Switch("s", w)
    rates = {x: vx, y: vy, u: w, vx: -0.9 - lam[0], vy: -0.9 - lam[1], w: 1.8 + lam[0] - 1.5 * s}
    solution = solve(System(rates), (0, 1), [0] * 6)
    aslant = np.sqrt(0.5)
    assert solution.success and not solution.events
    assert solution["lam_x"][0] == pytest.approx(-aslant, abs=1e-14)
    assert solution["s"][0] == pytest.approx((1.8 - aslant) / 1.5, abs=1e-14)
    assert solution.x[3:, -1] == pytest.approx([aslant - 0.9, aslant - 0.9, 0], abs=1e-12)


def test_a_switch_that_arrives_lets_a_disc_go_and_stays_for_that():
    """Were the block held on, it would take the plate through its rest; as it slips, the plate stops there."""
    u, w = sp.symbols("u w", real=True)
    lam, s = Disc("lam", (vx, vy)), Switch("s", w)
    rates = {u: w, vx: -1 + 1.4 * s - lam[0], vy: -lam[1], w: -0.3 - 1.5 * s + lam[0]}
    solution = solve(System(rates), (0, 2), [0, 0, 0, 1.4], **TIGHT)
    assert [(e.time, e.switch, e.kind) for e in solution.events] == [
        (pytest.approx(1, abs=1e-14), "s", "stick"),
        (pytest.approx(1, abs=1e-14), "lam", "slip by reset"),
    ]
    held = -1.3 / 1.5
    assert solution["s"][-1] == pytest.approx(held, abs=1e-13)
    assert solution.x[:, -1] == pytest.approx([0.7, 1.4 * held, 0, 0], abs=1e-12)


e, turn, push, grows, pull = sp.symbols("e turn push grows pull", real=True)


@pytest.fixture(scope="module")
def at_wall():
    """A body with friction mu in the plane at a wall that is turned, with a push onto it and a pull along it."""
    c, s = sp.cos(turn), sp.sin(turn)
    lam, wall = Disc("lam", (vx, vy)), Unilateral(c * x + s * y, restitution=e, name="wall")
    normal = wall.reaction - push + grows * t
    rates = {x: vx, y: vy, vx: normal * c - pull * s - mu * lam[0], vy: normal * s + pull * c - mu * lam[1]}
    values = {mu: 0.3, e: 0, turn: 0, push: 1, grows: 0, pull: 0}

    def run(span, place, speed, **given):
        given = values | {p: given[p.name] for p in values if p.name in given}
        axes = np.array(
            [[math.cos(given[turn]), math.sin(given[turn])], [-math.sin(given[turn]), math.cos(given[turn])]]
        )
        system = System(rates, time=t, parameters=values)
        start = np.concatenate([place @ axes, speed @ axes])
        done = solve(system, (0, span), start, parameters=given, max_steps=3000)
        assert done.success, done.message
        return done, axes @ done.x[:2, -1], axes @ done.x[2:, -1]

    return run


@pytest.mark.parametrize("turned", [0, 0.7, -1.1])
@pytest.mark.parametrize("along", [0, 0.1, -0.25, -0.5])
def test_a_body_stops_along_a_wall(at_wall, along, turned):
    """v' = pull - 0.3 until it stops after 1/(0.3 - pull); there it stays if |pull| < 0.3, else it goes back."""
    run, place, speed = at_wall(6, [0, 0], [0, 1], pull=along, turn=turned)
    stops, back = 1 / (0.3 - along), min(0, along + 0.3)
    assert run.events[0].time == pytest.approx(stops, rel=1e-9)
    assert place == pytest.approx([0, stops / 2 + back * (6 - stops) ** 2 / 2], abs=1e-8)
    assert speed == pytest.approx([0, back * (6 - stops)], abs=1e-8)


@pytest.mark.parametrize("rate", [0.2, 0.5])
def test_what_a_wall_has_held_friction_holds_when_it_lets_go(at_wall, rate):
    """The push ends at 1/rate, with 0.5 just as it stops, and pulls with 0.3, as friction holds, at 1.3/rate."""
    run, place, speed = at_wall(12, [0, 0], [0, 0.6], grows=rate)
    since = 12 - 1.3 / rate
    assert place == pytest.approx([rate * since**3 / 6, 0.6], abs=1e-8)
    assert speed == pytest.approx([rate * since**2 / 2, 0], abs=1e-8)


def bounced(strength, restitution, place, speed, along, span, h=5e-4):
    """The end of the same by time steps, an implicit one of the friction."""
    q, w = np.array(place, float), np.array(speed, float)
    for _ in range(round(span / h)):
        free = w + h * np.array([-1.0, along])
        if q[0] <= 0 and free[0] < 0:
            free[0] = -free[0] * restitution if w[0] < -8 * h else 0
        size = np.hypot(*free)
        w = free * max(0, 1 - h * strength / size) if size else free
        q = q + h * w
    return q, w


@pytest.mark.parametrize(
    ("strength", "restitution", "turned", "place", "speed", "along"),
    [
        (0.6, 0.5, 0, (0.5, 0), (0, 1), 0),
        (0.6, 0, 0.7, (0.5, 0), (0, 1), 0),
        (0.3, 0.8, 0, (0.5, 0), (0, 1), 0),
        (0.8, 0.5, -0.4, (0.3, 0), (0.5, 0.5), 0.1),
        (0.6, 0.5, 0, (0.5, 0), (0, 0.2), 0.7),
    ],
)
def test_bounces_die_out_with_the_slip(at_wall, strength, restitution, turned, place, speed, along):
    run, rests, goes = at_wall(5, place, speed, mu=strength, e=restitution, turn=turned, pull=along)
    q, w = bounced(strength, restitution, place, speed, along, 5)
    assert rests == pytest.approx(q, abs=1e-3) and goes == pytest.approx(w, abs=1e-3)
    assert rests[0] == pytest.approx(0, abs=1e-12)
