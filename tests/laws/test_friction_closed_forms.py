"""Friction laws under prescribed motion against their closed forms.

Guards: laws/friction/.
"""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth.laws import friction
from pwsmooth.scenes import prescribed_motion, t

RTOL = 1e-9  # solve's default
# Two decades for the steps of a run whose errors add up, none for the closed forms.
TIGHT = 100 * RTOL


def rig(law, span=(0, 4), **motion):
    return prescribed_motion(law, t_span=span, **motion)


def over_last_period(law, amplitude, periods=4, **options):
    """(largest force, loss) of the loop of the last period of x = A sin(2 pi t)."""
    scene = rig(law, (0, periods), position=amplitude * sp.sin(2 * sp.pi * t), work=True)
    run = scene.solve(dense_output=True, **options)
    assert run.success
    # The force turns where the velocity does, a quarter of a period after the start.
    force = run(np.nextafter(periods - 0.75, 0), "force")
    return float(force), float(run(periods, "work") - run(periods - 1, "work"))


def test_dahls_loop_has_the_height_and_the_loss_of_its_closed_form():
    # F_m = F_c tanh(sigma0 X/F_c), W = 4 X F_c - (4 F_c^2/sigma0) tanh(sigma0 X/F_c)
    law, X = friction.Dahl(sigma0=1e5, F_c=1.0), 3e-5
    height, loss = over_last_period(law, X)
    assert height == pytest.approx(math.tanh(3), rel=TIGHT)
    assert loss == pytest.approx(4 * X - 4e-5 * math.tanh(3), rel=TIGHT)
    assert (round(height, 7), round(loss * 1e5, 6)) == (0.9950548, 8.019781)  # the specification's digits


def test_dahls_path_from_any_force_is_an_exponential_of_the_distance():
    law = friction.Dahl(sigma0=1e5, F_c=2.0)
    run = rig(law, (0, 1), velocity=-3e-5 + 0 * t).solve(
        x0={"x": 0.0, "v": -3e-5, "z": 1.5e-5}, t_eval=[0.3, 1.0]
    )
    exact = [-2 + (1.5 + 2) * math.exp(-1e5 * 3e-5 * time / 2) for time in (0.3, 1.0)]
    assert run["force"] == pytest.approx(exact, rel=TIGHT)


@pytest.mark.parametrize("alpha", [1.5, 2.0])
def test_dahls_exponent_shapes_the_approach(alpha):
    # y = 1 - F/F_c falls as dy/dx = -(sigma0/F_c) y^alpha
    law = friction.Dahl(sigma0=1e5, F_c=1.0, alpha=alpha)
    run = rig(law, (0, 1), velocity=4e-5 + 0 * t).solve(t_eval=[0.5, 1.0])
    exact = [1 - (1 + (alpha - 1) * 4 * time) ** (-1 / (alpha - 1)) for time in (0.5, 1.0)]
    assert run["force"] == pytest.approx(exact, rel=TIGHT)


def same_force(law, other, tolerance=TIGHT):
    motion = dict(position=3e-5 * sp.sin(2 * sp.pi * t), span=(0, 2))
    times = np.linspace(0, 2, 101)
    one, two = (rig(each, **motion).solve(t_eval=times)["force"] for each in (law, other))
    assert np.abs(two).max() > 0.9
    assert one == pytest.approx(two, abs=tolerance)


def test_special_cases_are_dahls_law():
    dahl = friction.Dahl(sigma0=1e5, F_c=1.0)
    same_force(friction.BoucWen(k=1e5, A=1, beta=1e5, gamma=0, n=1), dahl)
    same_force(friction.BlimanSorineFirst(f_1=1.0, epsilon=1e-5), dahl)
    same_force(friction.ModifiedDahl(beta=1e5, F_c=1.0, slope=0.0), dahl)


def test_modified_dahl_follows_its_sloped_envelope():
    # On dx > 0: h = a x + b - a/beta + (h_0 - b + a/beta) exp(-beta x)
    law = friction.ModifiedDahl(beta=1e5, F_c=1.0, slope=2e4)
    run = rig(law, (0, 1), position=5e-5 * t).solve(t_eval=[1.0])
    assert run["force"][0] == pytest.approx(1.0 + 1 - 0.2 - 0.8 * math.exp(-5), rel=TIGHT)


def test_bouc_wen_is_bounded_by_its_closed_form():
    law = friction.BoucWen(k=1e5, A=2.0, beta=3e9, gamma=2e9, n=2)
    run = rig(law, (0, 1), position=3e-4 * t).solve()
    assert run["z"][-1] == pytest.approx(math.sqrt(2 / 5e9), rel=TIGHT)


def test_bliman_sorines_peak_lies_where_its_closed_form_has_it():
    law = friction.BlimanSorine(f_1=2.5, f_2=1.0, eta=0.4, epsilon=1e-5)
    peak = 0.4e-5 / 0.6 * math.log(2.5 / (0.4 * 1.0))
    height = 2.5 * (1 - math.exp(-peak / 0.4e-5)) - 1.0 * (1 - math.exp(-peak / 1e-5))
    path = peak * np.array([0.99, 1.0, 1.01, 40.0])
    force = rig(law, (0, 41 * peak), position=t).solve(t_eval=path)["force"]
    assert force[1] == pytest.approx(height, rel=TIGHT)
    assert force[1] > max(force[0], force[2])
    assert force[3] == pytest.approx(1.5, rel=TIGHT)  # f_1 - f_2; the exponentials are gone


def test_xky_starts_as_a_spring_with_a_damper_and_saturates():
    # From rest at constant v: f = min(g, kappa v t + sigma v); then a -> g/kappa at the rate kappa/sigma.
    law, v = friction.XKY(kappa=1e5, sigma=300.0, F_c=1.0, F_s=1.0, sigma2=0.0), 1e-3
    times = np.array([0.0, 0.002, 0.005, 0.008, 0.02])
    run = rig(law, (0, 0.02), velocity=v + 0 * t).solve(t_eval=times)
    assert run["force"] == pytest.approx(np.minimum(1.0, 1e5 * v * times + 300 * v), rel=TIGHT)
    full = (1 - 0.3) / 100  # where it saturates, at kappa a = 0.7 N
    exact = 1e-5 * (1 - 0.3 * np.exp(-1e5 / 300 * (times[3:] - full)))
    assert run["a"][3:] == pytest.approx(exact, rel=TIGHT)


def test_gms_elements_in_slip_approach_their_strength_exponentially():
    # F_i = share s + (F_0 - share s) exp(-C t/s) at constant speed; from share F_s at v = 0+ ...
    law = friction.GMS(kappa=(2.5,), share=(1.0,), sigma=0.0, F_c=1.0, F_s=2.0, v_s=8.0, C=50.0)
    v, s = 20.0, 1 + math.exp(-((20 / 8) ** 2))
    begin = 0.9 * s
    times = np.array([0.001, 0.002, 0.05, 0.2])
    run = rig(law, (0, 0.2), velocity=v + 0 * t).solve(
        x0={"x": 0, "v": v, "z_1": begin / 2.5, "slip_1": 1}, t_eval=times
    )
    assert run["force"] == pytest.approx(s + (begin - s) * np.exp(-50 * times / s), rel=TIGHT)


# ---- steady sliding

SPEEDS = (1e-4, 5e-4, 1e-3, 2e-3, 5e-3, 0.1)
LUGRE_STEADY = (1.495065, 1.389600, 1.184340, 1.009958, 1.002000, 1.040000)  # the specification's table


@pytest.mark.parametrize(
    "law",
    [
        friction.LuGre(),
        friction.LuGreFadingDamping(),
        friction.Elastoplastic(),
        friction.XKY(),
        friction.StribeckFriction(),
    ],
)
def test_laws_with_a_stribeck_curve_settle_on_it(law):
    for speed, listed in zip(SPEEDS, LUGRE_STEADY):
        for side in (1, -1):
            # Forty bristle lengths, and forty relaxation times of the micro-damping.
            span = (0, max(40 * 1.5e-5 / speed, 40 * 316 / 1e5))
            force = rig(law, span, velocity=side * speed + 0 * t).solve()["force"][-1]
            assert force == pytest.approx(side * float(law.steady_force(speed)), rel=TIGHT)
            assert force == pytest.approx(side * listed, abs=5e-7)


@pytest.mark.parametrize(
    ("law", "speed", "span"),
    [
        (friction.Coulomb(sigma2=3.0), 0.2, 1.0),
        (friction.StaticKinetic(sigma2=3.0), 0.2, 1.0),
        (friction.HiddenStatic(), 0.2, 4.0),
        (friction.ModifiedCoulomb(), 4e-4, 1.0),
        (friction.ModifiedCoulomb(), 4e-3, 1.0),
        (friction.ModifiedCoulomb(), 4e-5, 1.0),
        (friction.Dahl(), 1e-3, 0.4),
        (friction.BlimanSorine(), 1e-3, 0.4),
        (friction.BlimanSorineFirst(), 1e-3, 0.4),
        (friction.MaxwellSlip(), 10.0, 0.4),
        (friction.GMS(sigma2=0.01), 10.0, 2.0),
        (friction.MultistateXKY(sigma2=0.01), 10.0, 1.0),
        (friction.Wojewoda(), 0.1, 1.0),
    ],
)
def test_every_law_settles_on_its_steady_curve(law, speed, span):
    for side in (1, -1):
        force = rig(law, (0, span), velocity=side * speed + 0 * t).solve()["force"][-1]
        assert force == pytest.approx(float(law.steady_force(side * speed)), rel=TIGHT)


# ---- Maxwell-slip and Masing


def test_maxwell_slip_loses_what_its_closed_form_says():
    law = friction.MaxwellSlip()
    for amplitude in (0.25, 0.5, 0.75, 1.0):
        height, loss = over_last_period(law, amplitude)
        assert height == pytest.approx(float(law.virgin_curve(amplitude)), rel=TIGHT)
        assert loss == pytest.approx(law.loss(amplitude), rel=TIGHT)
    # the specification's quasi-static numbers
    assert [round(law.loss(A), 4) for A in (0.25, 0.5, 0.75, 1.0)] == [0.2160, 1.0560, 2.5200, 4.4800]


def test_an_amplitude_that_just_reaches_a_sliders_limit_is_no_trap():
    # The element of 1.5 um gives way exactly where the motion turns, again and again.
    for kappa in (1.0, 1 + 1e-15, 1 - 1e-15):
        law = friction.MaxwellSlip(kappa=(1e4 * kappa, 2e4), strength=(0.15, 0.15))
        for rtol in (1e-7, 1e-9, 1e-11):
            height, loss = over_last_period(law, 1.5e-5, periods=8, rtol=rtol)
            assert height == pytest.approx(0.3, rel=100 * rtol)
            assert loss == pytest.approx(4 * 0.15 * 0.75e-5, rel=100 * rtol)


def test_masings_rule_doubles_the_virgin_curve_and_inner_loops_return_to_their_point():
    law = friction.MaxwellSlip()
    # 0 -> 0.9 -> -0.3 -> 0.4 -> -0.3 -> -0.7: an inner loop between -0.3 and 0.4, then the outer branch again.
    corners = (0.0, 0.9, -0.3, 0.4, -0.3, -0.7)
    swings = [(sp.nsimplify(a), sp.nsimplify(b), i) for i, (a, b) in enumerate(zip(corners, corners[1:]))]
    parts = [((a + b) / 2 + (a - b) / 2 * sp.cos(sp.pi * (t - i)), t < i + 1) for a, b, i in swings]
    position = sp.Piecewise(*parts, (corners[-1], True))
    force = rig(law, (0, 5), position=position).solve(t_eval=[1, 2, 3, 4, 5])["force"]
    virgin = law.virgin_curve
    assert force[0] == pytest.approx(virgin(0.9), abs=TIGHT)
    assert force[1] == pytest.approx(virgin(0.9) - 2 * virgin(0.6), abs=TIGHT)
    assert force[2] == pytest.approx(force[1] + 2 * virgin(0.35), abs=TIGHT)
    assert force[3] == pytest.approx(force[1], abs=TIGHT)  # the inner loop closes
    assert force[4] == pytest.approx(virgin(0.9) - 2 * virgin(0.8), abs=TIGHT)  # and is forgotten


def test_elements_are_found_from_a_virgin_curve():
    x, force = [0.1, 0.4, 1.0], [1.0, 2.0, 2.5]
    law = friction.MaxwellSlip.from_virgin_curve(x, force)
    assert law.virgin_curve(np.array([0.05, *x, 3.0])) == pytest.approx([0.5, *force, 2.5], rel=1e-14)


def test_masings_law_is_a_spring_beside_one_slider():
    law = friction.Masing(k=1e4, k_0=1e5, alpha=1.0)
    height, loss = over_last_period(law, 3e-5)
    assert height == pytest.approx(0.3 + 1, rel=TIGHT)
    assert loss == pytest.approx(4 * (3e-5 - 1e-5), rel=TIGHT)
