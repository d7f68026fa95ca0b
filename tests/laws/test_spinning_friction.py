"""Contacts that slide and spin: Contensou's force and moment, the ellipsoid in their place, rolling and torsion.

References: elliptic integrals of SciPy; means over a rim; closed forms; for uniform discs 18-digit integrations with
mpmath, of the equations of Farkas et al., PRL 90 (2003) 248302.
"""

import functools

import numpy as np
import pytest
import sympy as sp
from reference.spinning import of_a_disc, of_a_ring
from scipy.integrate import solve_ivp

from pwsmooth import System, solve
from pwsmooth.laws.friction import Contensou, Coulomb, LimitEllipsoid, RollingResistance, TorsionalResistance
from pwsmooth.laws.friction.spinning import factors

x, y, turn, u, v, spin = sp.symbols("x y turn u v spin", real=True)
I, push_x, push_y, push_turn = sp.symbols("I push_x push_y push_turn", real=True)


@pytest.mark.parametrize(("shape", "exact", "error"), [("disc", of_a_disc, 2e-12), ("ring", of_a_ring, 3e-8)])
def test_force_and_moment_are_the_elliptic_integrals(shape, exact, error):
    B = sp.Symbol("B", positive=True)
    shown = sp.lambdify(B, factors(shape, B), "math")
    near = 10.0 ** -np.arange(1, 9)
    for ratio in (*np.geomspace(0.05, 20, 61), *(1 + near), *(1 - near)):
        share = 1 / (1 + ratio**2)
        phi, psi = shown(share)
        force, moment = exact(ratio)
        assert phi * ratio * np.sqrt(share) == pytest.approx(force, abs=error)
        assert psi * np.sqrt(share) == pytest.approx(moment, abs=error)


@functools.cache
def spinning(law):
    """A body of mass 1 and inertia I, F_c = R = 1, on its contact, which a force and a moment push."""
    contact = law.attach(velocity=(u, v, spin))
    F_x, F_y, M = contact.force
    rates = {x: u, y: v, turn: spin, u: push_x - F_x, v: push_y - F_y, spin: (push_turn - M) / I}
    return System(rates, parameters={I: 0.5, push_x: 0, push_y: 0, push_turn: 0} | contact.parameters)


def thrown(law, inertia, speed, rate, **options):
    start = dict.fromkeys((x, y, turn), 0.0) | {u: 0.6 * speed, v: 0.8 * speed, spin: rate}
    given = {"rtol": 1e-12, "dense_output": True, "parameters": {I: inertia}} | options
    run = solve(spinning(law), (0, 8), start, **given)
    (stop,) = run.event_times("stick")
    return run, stop


def ratio(run, time):
    return float(np.hypot(run(time, "u"), run(time, "v")) / run(time, "spin"))


END = 0.653001789205597639  # the root of F = 2 u M, by the elliptic integrals in 30 digits


def test_a_spinning_disc_stops_as_its_closed_form_says():
    run, stop = thrown(Contensou(), 0.5, 1.0, 0.25)
    assert stop == pytest.approx(1.0405289019957545, abs=1e-12)
    assert np.hypot(run["x"][-1], run["y"][-1]) == pytest.approx(0.5079062007600681, abs=1e-12)
    assert run["turn"][-1] == pytest.approx(0.1681178677743, abs=1e-12)
    # It keeps its direction.
    assert run["y"][-1] / run["x"][-1] == pytest.approx(4 / 3, abs=1e-12)


@pytest.mark.parametrize(("speed", "rate"), [(1.0, 0.25), (0.2, 1.0), (1.0, 1.5)])
def test_slide_and_spin_of_a_disc_end_together(speed, rate):
    run, stop = thrown(Contensou(), 0.5, speed, rate)
    far = [abs(ratio(run, stop - before) - END) for before in (1e-2, 1e-4, 1e-6)]
    assert far[0] > 5 * far[1] > 25 * far[2] and far[2] < 2e-3


@pytest.mark.parametrize(("speed", "rate"), [(1.0, 0.5), (0.5, 1.0)])
def test_slide_and_spin_of_a_ring_become_one_speed(speed, rate):
    run, stop = thrown(Contensou(shape="ring"), 1.0, speed, rate)
    far = [abs(ratio(run, time) - 1) for time in (0, stop - 1e-2, stop - 1e-4)]
    assert far[0] >= 0.5 and max(far[1:]) < 1e-8


def on_the_rim(ratio, points=400_000):
    """<W cos^2/|v + omega x r|>/W of a ring, |v| = ratio W, by the mean of many points of its rim."""
    share, at = 1 / np.hypot(1, ratio), (np.arange(points) + 0.5) * 2 * np.pi / points
    return np.mean(np.cos(at) ** 2 / np.sqrt(1 - 2 * ratio * share**2 * np.sin(at)))


def test_what_a_tilted_ring_has_across_is_the_mean_over_its_rim():
    B = sp.Symbol("B", positive=True)
    shown = sp.lambdify(B, factors("across", B)[0], "math")
    for ratio in (*np.geomspace(0.02, 50, 31), 0.999, 1.001, 1 + 1e-5):
        assert shown(1 / (1 + ratio**2)) == pytest.approx(on_the_rim(ratio), abs=1e-11)


@pytest.mark.parametrize("tilt", [-0.5, 0.8])
@pytest.mark.parametrize(("rate", "end"), [(0.2, 0.6), (-0.3, 0.6), (2.0, 0.5)])
def test_a_tilted_ring_moves_as_the_points_of_its_rim_push_it(tilt, rate, end):
    """Against SciPy, with the force of 2048 points, each rubbing by what its place in front or behind gives it."""
    at, inertia = (np.arange(2048) + 0.5) * 2 * np.pi / 2048, 2.0

    def rates(time, q):
        speed = np.hypot(q[3], q[4])
        ahead = np.array([q[3], q[4]]) / speed
        slip = np.array([speed - q[5] * np.sin(at), q[5] * np.cos(at)])
        slip /= np.hypot(*slip)
        share = 1 + tilt * slip[0].mean() * np.cos(at)
        along, aside = (share * slip).mean(axis=1)
        moment = (share * (np.cos(at) * slip[1] - np.sin(at) * slip[0])).mean()
        force = along * ahead + aside * np.array([-ahead[1], ahead[0]])
        return [*q[3:], *-force, -moment / inertia]

    law = Contensou(shape="ring", tilt=tilt)
    start = [0, 0, 0, 0.6, 0.8, rate]
    told = solve_ivp(rates, (0, end), start, method="DOP853", rtol=1e-11, atol=1e-13)
    run = solve(spinning(law), (0, end), start, rtol=1e-12, parameters={I: inertia})
    assert run.x[:, -1] == pytest.approx(told.y[:, -1], abs=1e-11)


@pytest.mark.parametrize(
    ("given", "told"),
    [({"tilt": 0.1}, "is that of a ring"), ({"shape": "ring", "tilt": -1.1}, "between -1 and 1")],
)
def test_a_tilt_that_cannot_be_is_refused(given, told):
    with pytest.raises(ValueError, match=told):
        Contensou(**given)


def test_an_ellipsoid_gets_the_levels_but_not_the_end():
    worst, where = max(
        (abs(np.hypot(force, 1.5 * moment) - 1), s)
        for s in np.geomspace(0.1, 10, 400)
        for force, moment in [of_a_disc(s)]
    )
    assert worst == pytest.approx(0.066, abs=1e-3) and where == pytest.approx(0.77, abs=0.02)
    run, stop = thrown(LimitEllipsoid(), 0.5, 0.5, 1.0)
    ratios = [ratio(run, stop - before) for before in (1e-2, 1e-4, 1e-6, 1e-8)]
    assert all(after < 0.7 * before for before, after in zip(ratios, ratios[1:], strict=False))
    assert ratios[-1] < 0.1 * END


def test_a_pure_slide_and_a_pure_spin_are_coulombs():
    for law, moment in ((Contensou(), 2 / 3), (Contensou(shape="ring"), 1), (LimitEllipsoid(), 2 / 3)):
        _, stop = thrown(law, 0.5, 0.5, 0.0)
        assert stop == pytest.approx(0.5, abs=1e-9)
        run, stop = thrown(law, 0.5, 0.0, 1.0)
        assert stop == pytest.approx(0.5 / moment, abs=1e-9) and not run.x[:2, -1].any()


def test_a_force_and_a_moment_within_the_limit_surface_hold_it():
    """On the surface at u = 1 force and moment are 8/(3 pi) and 8/(9 pi): 0.99 of both hold, 1.01 do not."""
    force, moment = of_a_disc(1.0)
    for share, holds in ((0.99, True), (1.01, False)):
        push = {push_x: share * force * 0.6, push_y: share * force * 0.8, push_turn: share * moment}
        run = solve(spinning(Contensou()), (0, 1), [0.0] * 6, parameters=push)
        assert (not run.x[3:, -1].any()) == holds


def test_three_components_stop_after_the_closed_form():
    F, mu, first = np.array([0.2, -0.1, 0.15]), 0.5, np.array([0.3, 0.5, -0.4])
    law = Coulomb(F_c=mu).attach(velocity=(u, v, spin))
    places = dict(zip((x, y, turn), (u, v, spin), strict=True))
    rates = places | {s: f - g for s, f, g in zip((u, v, spin), F, law.force, strict=True)}
    run = solve(System(rates, parameters=law.parameters), (0, 3), dict.fromkeys(places, 0.0)
                | dict(zip((u, v, spin), first, strict=True)), rtol=1e-12, atol=1e-14)  # fmt: skip
    assert run.event_times("stick")[0] == pytest.approx(1.710159947004360, abs=1e-12)
    assert run.x[:3, -1] == pytest.approx([0.32345096, 0.29878062, -0.20020611], abs=1e-8)


@pytest.mark.parametrize(("pressure", "arm"), [("uniform", 2 / 3), ("Hertz", 3 * np.pi / 16), ("ring", 1.0)])
def test_a_top_spins_down_under_its_torsional_moment(pressure, arm):
    """The moment is the integral of p r over the contact, and the spin falls linearly."""
    moment = TorsionalResistance(F_c=2.0, R=0.5, pressure=pressure).attach(velocity=spin)
    top = System({turn: spin, spin: -moment.force}, parameters=moment.parameters)
    run = solve(top, (0, 8), {turn: 0, spin: 3})
    assert run.event_times("stick")[0] == pytest.approx(3 / arm, abs=1e-10)
    radii = (np.arange(200000) + 0.5) / 200000
    if pressure != "ring":
        p = np.sqrt(1 - radii**2) if pressure == "Hertz" else np.ones_like(radii)
        assert np.sum(p * radii**2) / np.sum(p * radii) == pytest.approx(arm, abs=1e-6)


def test_rolling_resistance_holds_a_ball_on_a_slope_up_to_its_arm():
    for slope, stays in ((0.0099, True), (0.0101, False)):
        law = RollingResistance(M_c=0.01).attach(velocity=(u, v), normal=1.0)
        pull = (slope * 0.6, slope * 0.8)
        ball = System({u: pull[0] - law.force[0], v: pull[1] - law.force[1]}, parameters=law.parameters)
        run = solve(ball, (0, 5), {u: 0, v: 0})
        assert (not run.x[:, -1].any()) == stays
        if not stays:
            assert run["v"][-1] / run["u"][-1] == pytest.approx(4 / 3)


def test_a_contact_that_spins_needs_the_three_components():
    for law in (Contensou(), LimitEllipsoid()):
        with pytest.raises(ValueError, match=r"`velocity` of .* give \(v_x, v_y, omega\)"):
            law.attach(velocity=(u, v))
