"""Scenes in the plane against closed forms: incline, shaken plate, pulled block, oscillator, gripper, ball, stack.

Where a number is given, it comes from the closed form named there or, of the forced oscillator, from an integration in
18 digits in polar variables by other means.
"""

import math

import numpy as np
import pytest
import sympy as sp
from numba import njit
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk

from pwsmooth import Drive
from pwsmooth.laws.friction import (
    Contensou,
    Coulomb,
    LimitEllipsoid,
    LuGre,
    RollingResistance,
)
from pwsmooth.scenes import (
    billiard_ball,
    bristle_bot,
    caster,
    gripped_bar,
    incline,
    planar_oscillator,
    pulled_block,
    shaken_plate,
    spinning_disc,
    stacked_plates,
    t,
)

EXACT = {"rtol": 1e-12, "atol": 1e-14}
SLOPE = 0.5
PULL = math.sin(SLOPE)  # with g = 1


def on_incline(kappa, velocity, span=10.0):
    law = Coulomb(F_c=kappa * math.tan(SLOPE))
    return incline(law, slope=SLOPE, velocity=velocity, g=1.0, t_span=(0, span)).solve(**EXACT)


@pytest.mark.parametrize("kappa", [1.05, 1.5, 4.0])
def test_a_block_thrown_across_an_incline_stops_as_its_closed_form_says(kappa):
    run = on_incline(kappa, (0, 1), 100.0)
    assert run.event_times("stick")[0] * PULL == pytest.approx(kappa / (kappa**2 - 1), rel=1e-11)
    assert run["x"][-1] * PULL == pytest.approx(1 / (4 * (kappa**2 - 1)), rel=1e-10)
    assert run["y"][-1] * PULL == pytest.approx(2 * kappa / (4 * kappa**2 - 1), rel=1e-10)


def test_a_block_thrown_anyhow_stops_at_the_place_in_18_digits():
    law = Coulomb(F_c=1.05 * math.tan(SLOPE))
    throw = (2 * math.cos(2.5), 2 * math.sin(2.5))
    run = incline(law, slope=SLOPE, velocity=throw, g=1 / PULL, t_span=(0, 10)).solve(**EXACT)
    assert run.event_times("stick")[0] == pytest.approx(4.855734330791537, abs=1e-11)
    assert run.x[:2, -1] == pytest.approx([-0.395809755287294, 0.911823302389137], abs=1e-11)


def test_a_block_thrown_a_hair_off_uphill_comes_to_rest():
    throw = (-math.cos(1e-8), math.sin(1e-8))
    law = Coulomb(F_c=1.5 * math.tan(SLOPE))
    run = incline(law, slope=SLOPE, velocity=throw, g=1 / PULL, t_span=(0, 3)).solve(**EXACT)
    assert run.event_times("stick")[0] == pytest.approx(0.4, abs=1e-12)
    assert run["x"][-1] == pytest.approx(-0.2, abs=1e-12) and run["y"][-1] == pytest.approx(2.5e-9, abs=1e-13)


def test_a_body_on_a_plate_that_circles_goes_on_a_circle_behind_it():
    mu, omega, speed = 0.3, 5.0, 2.0
    plate = (-speed * sp.sin(omega * t), speed * sp.cos(omega * t))
    run = shaken_plate(Coulomb(F_c=mu), plate, g=9.81, t_span=(0, 60)).solve(**EXACT)
    v = complex(run["v_x"][-1], run["v_y"][-1])
    own = mu * 9.81 / omega
    assert abs(v) == pytest.approx(own, abs=1e-9)
    moving = 1j * speed * np.exp(1j * omega * 60)
    assert abs(np.angle(moving / v)) == pytest.approx(math.acos(own / speed), abs=1e-8)
    # A plate that friction can take along takes it along.
    held = shaken_plate(Coulomb(F_c=1.1), plate, g=9.81, t_span=(0, 10)).solve()
    assert held.itinerary[-1].startswith("stick")


@pytest.mark.parametrize(("a", "b", "median"), [(3.0, 1.5, -5 / 6), (2.0, 1.0, -0.4246251370445)])
def test_fast_shaking_drives_a_body_at_the_geometric_median_of_the_plates_velocity(a, b, median):
    off = []
    for omega in (100.0, 200.0):
        plate = (a * sp.cos(omega * t) + b * sp.cos(2 * omega * t), 2 * sp.sin(omega * t))
        scene = shaken_plate(Coulomb(F_c=1.0), plate, period=2 * np.pi / omega, g=1.0, t_span=(0, 40))
        run = scene.solve(dense_output=True)
        last = 40 - 2 * np.pi / omega
        drift = [(run(40, q) - run(last, q)) / (40 - last) for q in ("x", "y")]
        off.append(np.hypot(drift[0] - median, drift[1]))
    assert off[1] < 0.6 / 200 and off[1] < 0.7 * off[0]


def test_a_conveyor_with_lift_moves_what_lies_on_it_forward():
    """Forward while the load is large: the drift changes its sign with the phase of the lift, and is 0 without."""
    drift = []
    for phase in (0, np.pi, None):
        omega, amplitude = 30.0, 0.25
        lift = 0 if phase is None else 6 * sp.cos(omega * t + phase)
        plate = (amplitude * sp.cos(omega * t), 0.1 * sp.sin(omega * t))
        scene = shaken_plate(Coulomb(F_c=0.3), plate, lift=lift, period=2 * np.pi / omega, t_span=(0, 20))
        run = scene.solve()
        drift.append(run["x"][-1] / 20)
    assert drift[0] > 0.05 and drift[1] == pytest.approx(-drift[0], abs=0.01) and abs(drift[2]) < 0.01


@pytest.mark.parametrize("across", [True, False])
def test_vibration_reduces_the_mean_friction_as_elliptic_integrals_say(across):
    s, amplitude, omega = 0.5, 1.0, 200.0
    moves = amplitude * sp.cos(omega * t)
    scene = pulled_block(
        Coulomb(), (s * amplitude * t, 0), plate=(0, moves) if across else (moves, 0), k=1.0, c=2.0,
        period=2 * np.pi / omega, t_span=(0, 30),
    )  # fmt: skip
    run = scene.solve(rtol=1e-9, dense_output=True)
    period = 2 * np.pi / omega
    times = 30 - 100 * period * (np.arange(20000) + 0.5) / 20000
    mean = np.mean(run(times, "pull_x"))
    exact = 2 / np.pi * (s / np.sqrt(1 + s**2) * ellipk(1 / (1 + s**2)) if across else math.asin(s))
    # The block itself shakes by F_c/(m omega).
    assert mean == pytest.approx(exact, abs=1 / omega**1.5)


@pytest.mark.parametrize("angle", [1.2, 1.5])
def test_a_light_block_follows_on_a_tractrix(angle):
    start = (-math.sin(angle), -math.cos(angle))
    after = 2 * math.atan(math.tan(angle / 2) * math.exp(-2))
    for m in (1e-2, 1e-3, 1e-4, 1e-5):
        run = pulled_block(Coulomb(), (0, t), start=start, m=m, t_span=(0, 2)).solve(rtol=1e-9)
        # It swings on its spring by (speed of the end) sqrt(m/k).
        assert run["x"][-1] == pytest.approx(-math.sin(after), abs=math.sqrt(m))
        assert run["y"][-1] == pytest.approx(2 - math.cos(after), abs=math.sqrt(m))


def test_a_forced_planar_oscillator_stops_and_starts_when_18_digits_say():
    force = (sp.Rational(8, 5) * sp.cos(t / 4), sp.sin(t / 4))
    scene = planar_oscillator(Coulomb(), force, start=(0.3, 0.1), velocity=(0.5, -0.4))
    run = scene.solve(rtol=1e-12)
    assert [e.kind for e in run.events] == ["stick", "slip by tangency"] * 2
    assert run.event_times() == pytest.approx(
        [2.1381845484922919, 4.4149357549058344, 16.2591192738651348, 16.5556925522136114], abs=1e-11
    )
    assert run.x[:2, -1] == pytest.approx([1.0703152234846091, -0.1501620315342416], abs=1e-11)


@pytest.mark.parametrize("law", [Coulomb(F_c=0.6), LuGre(sigma0=1e4, sigma1=0.0, sigma2=0.0, F_c=0.6, F_s=0.6)])
def test_under_a_circular_force_the_mass_circles_or_rests(law):
    """Radius sqrt(P^2 - F_c^2)/|k - m omega^2|; bristles of stiffness sigma0 change it by their share."""
    omega = 2.0
    run = planar_oscillator(law, (sp.cos(omega * t), sp.sin(omega * t)), c=0.0, t_span=(0, 60)).solve()
    error = 1e-6 if isinstance(law, Coulomb) else 2e-3
    assert np.hypot(run["x"][-1], run["y"][-1]) == pytest.approx(0.8 / 3, abs=error)
    weak = planar_oscillator(
        Coulomb(F_c=1.2), (sp.cos(omega * t), sp.sin(omega * t)), start=(0.3, 0), t_span=(0, 20)
    )
    assert weak.solve().itinerary[-1].startswith("stick")


def test_a_bearing_under_a_record_of_two_components_is_that_under_the_function_it_was_taken_from():
    waves = (sp.sin(3 * t) * sp.exp(-t / 4), sp.cos(2 * t) * sp.exp(-t / 5))
    times = np.linspace(0, 10, 1001)
    record = [Drive(times, sp.lambdify(t, w, "numpy")(times)) for w in waves]
    runs = [planar_oscillator(Coulomb(F_c=0.3), force, t_span=(0, 10)).solve() for force in (waves, record)]
    assert [e.kind for e in runs[0].events] == [e.kind for e in runs[1].events]
    assert runs[0].x[:2, -1] == pytest.approx(runs[1].x[:2, -1], abs=1e-5)


def pads_bound(arm, pad):
    """Force of the grip at which a bar begins to slip, by the exact integrals: M = F arm on the limit surface."""
    from reference.spinning import of_a_disc

    ratio = brentq(lambda s: of_a_disc(s)[1] * pad.R - of_a_disc(s)[0] * arm, 1e-3, 50)
    return 9.81 / (pad.F_c * of_a_disc(ratio)[0])


@pytest.mark.parametrize("arm", [0.005, 0.02, 0.05])
def test_a_grip_that_loosens_holds_down_to_the_ellipsoid(arm):
    run = gripped_bar(LimitEllipsoid(F_c=0.5, R=0.03), 80 - 20 * t, arm=arm, t_span=(0, 3.2)).solve()
    assert run.events[0].kind == "slip by tangency"
    assert 80 - 20 * run.events[0].time == pytest.approx(9.81 / 0.5 * math.hypot(1, arm / 0.02), abs=1e-8)


def test_a_bar_that_slips_and_turns_in_a_grip_loses_what_friction_takes():
    run = gripped_bar(LimitEllipsoid(F_c=0.5, R=0.03), 40 - 20 * t, t_span=(0, 0.5)).solve(
        **EXACT, dense_output=True
    )
    times = np.linspace(0, 0.5, 20001)[1:]  # at 0 it stands, and its slip has no direction
    x, y, v_x, v_y, spin = (run(times, name) for name in ("x", "y", "v_x", "v_y", "spin"))
    energy = (v_x**2 + v_y**2) / 2 + 0.01 * spin**2 / 2 + 9.81 * y
    power = run(times, "friction_x") * (v_x + spin * y) + run(times, "friction_y") * (v_y - spin * x)
    power = power + run(times, "moment") * spin
    assert abs(y[-1]) > 0.02 and abs(spin[-1]) > 1
    lost = np.sum((power[1:] + power[:-1]) / 2) * times[0]
    assert energy[0] - energy[-1] == pytest.approx(lost, abs=1e-7)


def test_a_grip_holds_from_contensous_limit_surface_on():
    pad, arm = Contensou(F_c=0.5, R=0.03), 0.02
    for share, holds in ((1.01, True), (0.99, False)):
        run = gripped_bar(pad, share * pads_bound(arm, pad), arm=arm, t_span=(0, 0.1)).solve()
        assert (not run.x[3:, -1].any()) == holds


def test_a_caster_rolls_into_line_up_to_the_speed_at_which_the_ground_holds_it():
    """tan(swivel/2) falls as exp(-V t/l); the ground holds V^2 sin(a)/l (I sin(a)/r^2, J cos(a)/l^2) of mu N."""
    swivel, trail, radius, wheel, inertia, load = 2.0, 0.06, 0.05, 0.001, 0.004, 80.0
    values = dict(swivel=swivel, trail=trail, radius=radius, wheel=wheel, inertia=inertia, load=load)
    # While it rolls every angle down to 0 comes by: what the ground has to hold is largest somewhere on the way.
    a = np.linspace(0, swivel, 20001)
    held = np.sin(a) / trail * np.hypot(wheel * np.sin(a) / radius**2, inertia * np.cos(a) / trail**2)
    fastest = math.sqrt(0.5 * load / held.max())
    run = caster(Coulomb(F_c=0.5), speed=0.999 * fastest, t_span=(0, 0.5), **values).solve(**EXACT)
    assert run.itinerary == ("stick (lam sliding)",)
    falls = np.tan(run["swivel"][-1] / 2) / math.tan(swivel / 2)
    assert math.log(falls) == pytest.approx(-0.999 * fastest * 0.5 / trail, rel=1e-10)
    assert np.abs([run["slip_along"], run["slip_aside"]]).max() < 1e-13
    faster = caster(Coulomb(F_c=0.5), speed=1.001 * fastest, t_span=(0, 0.5), **values).solve(**EXACT)
    assert faster.itinerary[:2] == ("stick (lam sliding)", "slip (lam)") and faster.success


def test_a_caster_that_skids_begins_to_slip_again_and_again_at_every_tolerance():
    """Its surfaces are no states: what is known of h/|h| when a slip begins is a rounding over |h|."""
    runs = [caster(Coulomb(F_c=0.5), speed=3.0).solve(rtol=rtol, atol=1e-12) for rtol in (1e-9, 1e-12)]
    assert [e.kind for e in runs[0].events] == [e.kind for e in runs[1].events]
    assert runs[1].success and len(runs[1].event_times("slip by tangency")) == 1
    assert runs[0].x[:, -1] == pytest.approx(runs[1].x[:, -1], abs=1e-7)


def test_a_ball_slides_on_a_parabola_and_rolls_after():
    mu, g, v, w, R = 0.2, 9.81, np.array([1.0, 0.5]), np.array([3.0, -2.0]), 0.4
    inertia = 0.4 * R**2
    run = billiard_ball(Coulomb(F_c=mu), velocity=v, spins=w, radius=R, inertia=inertia).solve(**EXACT)
    slip = v + R * np.array([-w[1], w[0]])
    direction, stop = slip / np.hypot(*slip), 2 / 7 * np.hypot(*slip) / (mu * g)
    assert run.event_times("stick")[0] == pytest.approx(stop, abs=1e-12)
    assert run.x[2:4, -1] == pytest.approx(v - 2 / 7 * slip, abs=1e-12)
    place = v * stop - mu * g * direction * stop**2 / 2 + (v - 2 / 7 * slip) * (2 - stop)
    assert run.x[:2, -1] == pytest.approx(place, abs=1e-12)


def test_rolling_resistance_stops_a_ball_that_rolls():
    """At the deceleration M_c g/(R (1 + 2/5)), straight on."""
    scene = billiard_ball(Coulomb(F_c=0.2), velocity=(0.6, 0.8), spins=(-0.8, 0.6), rolling=RollingResistance(M_c=0.02),
                          t_span=(0, 10))  # fmt: skip
    run = scene.solve()
    far = 1 / (2 * 0.02 * 9.81 / 1.4)
    assert (
        run.x[:2, -1] == pytest.approx([0.6 * far, 0.8 * far], abs=1e-9) and np.abs(run.x[2:, -1]).max() < 1e-20
    )


def test_two_plates_in_a_row_move_as_on_a_line():
    """Along a line, at an angle: the block drags the plate over the ground, both stop, then the plate stops with it."""
    mu, ground, g, (m, M), v = 0.5, 0.1, 9.81, (2.0, 1.0), 3.0
    a_b, a_p = -mu * g, (mu * m - ground * (m + M)) * g / M
    together = v / (a_p - a_b)
    speed = a_p * together
    stop = together + speed / (ground * g)
    scene = stacked_plates(Coulomb(F_c=mu), Coulomb(F_c=ground), masses=(m, M), block=(0.6 * v, 0.8 * v))
    run = scene.solve(**EXACT)
    sticks = run.event_times("stick")
    assert sticks[-2:] == pytest.approx([together, stop], abs=1e-11)
    way = v * together + a_b * together**2 / 2 + speed**2 / (2 * ground * g)
    assert run.x[:2, -1] == pytest.approx([0.6 * way, 0.8 * way], abs=1e-11)


def test_two_plates_that_slide_askew_are_as_by_another_integrator():
    mu, ground, g = 0.3, 0.2, 9.81
    scene = stacked_plates(Coulomb(F_c=mu), Coulomb(F_c=ground), block=(1.0, 0.5), plate=(-0.5, 1.0))
    run = scene.solve(rtol=1e-12)

    def rates(_, q):
        u, w = q[4:6] - q[6:8], q[6:8]
        f, b = mu * g * u / np.hypot(*u), 2 * ground * g * w / np.hypot(*w)
        return [*q[4:], *-f, *(f - b)]

    first = run.event_times("stick")[0]
    other = solve_ivp(
        rates, (0, 0.999 * first), [0, 0, 0, 0, 1.0, 0.5, -0.5, 1.0], method="DOP853", rtol=1e-12, atol=1e-13
    )
    again = scene.solve(t_eval=[0.999 * first], rtol=1e-12)
    assert again.x[:, -1] == pytest.approx(other.y[:, -1], abs=1e-9)
    assert run.itinerary[-1].count("stick") == 2 and not run.x[4:, -1].any()


@njit
def time_stepping(n, end, mu, lean, stroke, omega):
    """How far a bristle-bot gets, by Moreau's scheme with n steps."""
    h, v, x = end / n, 0.0, 0.0
    for k in range(n):
        tips = math.tan(lean) * stroke * omega * math.cos(omega * (k + 1) * h)
        most = mu * h * (9.81 - stroke * omega**2 * math.sin(omega * (k + 0.5) * h))
        v -= min(max(v - tips, -most), most)
        x += h * v
    return x


@pytest.mark.parametrize("omega", [60.0, 90.0])
def test_a_bristle_bot_gets_as_far_as_by_time_stepping_and_into_any_direction(omega):
    far = bristle_bot(Coulomb(F_c=0.3), omega=omega, t_span=(0, 5)).solve()["x"][-1]
    steps = [time_stepping(n, 5.0, 0.3, 0.5, 1e-3, omega) for n in (500_000, 1_000_000)]
    assert far == pytest.approx(steps[1], abs=5 * abs(steps[1] - steps[0]) + 1e-9)
    assert (far > 0.1) == (omega == 90.0)  # the slower one is held most of the time
    back = bristle_bot(Coulomb(F_c=0.3), lean=-0.5, omega=omega).solve()
    assert back["x"][-1] == pytest.approx(-far, abs=1e-9)
    turned = bristle_bot(Coulomb(F_c=0.3), heading=0.7, omega=omega).solve()
    assert turned.x[:2, -1] == pytest.approx([far * math.cos(0.7), far * math.sin(0.7)], abs=1e-8)


def test_what_scenes_refuse_says_why():
    for make, words in (
        (lambda: shaken_plate(Coulomb(), (t, 0), lift=-12 * sp.cos(t)), "leave the plate"),
        (lambda: shaken_plate(Coulomb(), (t,)), "`plate` has 1 components"),
        (lambda: incline(Coulomb(), slope=2.0), "below pi/2"),
        (lambda: bristle_bot(Coulomb(), lean=2.0), "below pi/2"),
        (lambda: bristle_bot(Coulomb(), omega=120.0), "leave the plate"),
        (lambda: spinning_disc(Coulomb()), "knows no spin"),
        (lambda: spinning_disc(Contensou(), push=(0, 0)), "`push` has 2 components"),
        (lambda: gripped_bar(Coulomb(), 1), "knows no spin"),
        (lambda: stacked_plates(Coulomb(), Coulomb(), masses=(1, 0)), "give two positive ones"),
        (lambda: pulled_block(Coulomb(), (sp.floor(t), 0)), "`path` jumps"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=words):
            make()
