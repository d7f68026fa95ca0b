"""The slider-crank with a clearance joint: first impacts, the ideal limit, energy, and other laws in the same joint.

Guards: scenes/journal.py.
"""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from pwsmooth.laws.contact import (
    Hertz,
    HertzImpact,
    LiuImpact,
    ResidualIndentation,
    RigidImpact,
    composite_modulus,
    journal_stiffness,
)
from pwsmooth.laws.friction import BoucWen, Coulomb, Dahl, Elastoplastic, LuGre, ModifiedCoulomb
from pwsmooth.scenes import IdealSliderCrank, slider_crank

E = composite_modulus(207e9, 0.3)
FIRST = {
    # clearance: time (s), speed (m/s), angle of the normal (rad). Specification, 11 digits; no contact law enters.
    0.25e-3: (4.422960035e-3, 0.112918955713, -0.012819),
    0.5e-3: (6.25854533558e-3, 0.159420958298, -0.018133),
    1e-3: (8.86094991305e-3, 0.224689975104, -0.025655),
}
# Second and third impact (s, m/s) and largest |acceleration| in the first (m/s^2): specification.
LATER = [
    (0.25e-3, "wang-liu-ma", 0.9, (0.0123797, 0.091879), (0.0147196, 0.074868), 2142),
    (0.25e-3, "lankarani-nikravesh", 0.9, (0.0125428, 0.093002), (0.0148054, 0.077388), 1983),
    (0.5e-3, "wang-liu-ma", 0.9, (0.0174043, 0.122623), (0.0203423, 0.104895), 2814),
    (0.5e-3, "lankarani-nikravesh", 0.9, (0.0176207, 0.123506), (0.0204762, 0.107868), 2587),
    (0.5e-3, "wang-liu-ma", 0.5, (0.0123746, 0.073577), (0.0153529, 0.033272), 2778),
]


@functools.cache
def mechanism(name):
    """The scene with Wang, Liu and Ma's law, or Lankarani and Nikravesh's, at the default clearance."""
    return slider_crank(HertzImpact() if name == "lankarani-nikravesh" else LiuImpact(eta=name, clearance=5e-4))


def joint(clearance, name="wang-liu-ma", c_r=0.9):
    """Its scene with this clearance, steel, and this restitution: to derive the equations again takes seconds."""
    scene = mechanism(name)
    law = {"K": journal_stiffness(E, 0.01, 0.01 - clearance)}
    if name != "lankarani-nikravesh":
        law = {"E_star": E, "clearance": clearance}
    system = scene.system.with_parameters({"c": clearance, "c_r": c_r} | law)
    return replace(scene, system=system, atol=scene.atol | dict.fromkeys(("e_x", "e_y"), 1e-10 * clearance))


def touch_downs(solution):
    """(times, latched speeds, columns) of all impacts."""
    times = solution.event_times("reset", "touch-down")
    columns = np.searchsorted(solution.t, times)  # the state before
    return times, solution["speed"][columns + 1], columns


@pytest.mark.parametrize("clearance", FIRST)
def test_the_first_impact_has_the_digits_of_an_independent_computation(clearance):
    solution = joint(clearance).solve((0, 0.01), rtol=1e-12)
    times, speeds, columns = touch_downs(solution)
    when, speed, angle = FIRST[clearance]
    # half a unit of the last printed digit
    assert times[0] == pytest.approx(when, abs=5.1e-13 if clearance == 0.25e-3 else 5.1e-15)
    assert speeds[0] == pytest.approx(speed, abs=5.1e-13)
    assert math.atan2(solution["e_y"][columns[0]], solution["e_x"][columns[0]]) == pytest.approx(
        angle, abs=6e-7
    )


@pytest.mark.parametrize("clearance, name, c_r, second, third, peak", LATER)
def test_later_impacts_and_the_peak_acceleration(clearance, name, c_r, second, third, peak):
    solution = joint(clearance, name, c_r).solve((0, 0.021), rtol=1e-10, dense_output=True)
    times, speeds, _ = touch_downs(solution)
    assert (times[1], speeds[1]) == pytest.approx(second, abs=6e-7)
    assert (times[2], speeds[2]) == pytest.approx(third, abs=6e-7)
    fine = np.linspace(times[0], solution.event_times("reset", "lift-off")[0], 4001)
    assert np.abs(solution(fine, "acceleration")).max() == pytest.approx(peak, rel=5e-3)


def test_a_revolution_has_the_same_impacts_at_every_tolerance_and_none_is_detected_late():
    scene = joint(0.5e-3)
    runs = [scene.solve(rtol=rtol) for rtol in (1e-8, 1e-10, 1e-12)]
    times = [touch_downs(run)[0] for run in runs]
    assert {len(t) for t in times} == {len(times[0])}
    for run in runs:
        assert run.success
        _, speeds, columns = touch_downs(run)
        deepest = run["indentation"].max()
        # Detection is exact: the indentation there is the rounding of e.e - c^2.
        assert np.abs(run["indentation"][columns]).max() < 1e-9 * deepest
        assert run["normal"].min() >= 0
        assert speeds.min() > 0


def test_the_joint_tends_to_the_ideal_one_with_its_clearance():
    ideal = IdealSliderCrank()
    for clearance in (1e-3, 0.25e-3):
        solution = joint(clearance).solve()
        gap = solution["x"] - ideal.position(2 * math.pi * 200 / 60 * solution.t)
        # The journal is in its bearing: off by the clearance, and by the rod's turn times the same.
        assert 0.5 * clearance < np.abs(gap).max() < 1.05 * clearance


def test_the_ideal_mechanism_is_its_own_derivative_and_has_the_checked_accelerations():
    ideal = IdealSliderCrank()
    assert ideal.acceleration(0.0) == pytest.approx(-25.588, abs=5e-4)
    assert ideal.acceleration(math.pi) == pytest.approx(18.277, abs=5e-4)
    phi, h = np.linspace(0.1, 6, 13), 1e-5
    slope = ideal.omega * (ideal.position(phi + h) - ideal.position(phi - h)) / (2 * h)
    assert slope == pytest.approx(ideal.velocity(phi), abs=1e-8)
    slope = ideal.omega * (ideal.velocity(phi + h) - ideal.velocity(phi - h)) / (2 * h)
    assert slope == pytest.approx(ideal.acceleration(phi), abs=1e-6)


def test_the_driving_torque_does_the_work_that_the_energy_gains():
    # Elastic and frictionless: dE/dt = omega T in flight and in contact; independent of how the equations were made.
    scene = slider_crank(Hertz(K=journal_stiffness(E, 0.01, 0.0095)), None)
    solution = scene.solve((0, 0.0075), rtol=1e-12, dense_output=True)
    assert len(solution.event_times("reset", "lift-off")) == 1
    omega, h = 2 * math.pi * 200 / 60, 2e-7
    events = np.array([e.time for e in solution.events])
    times = np.concatenate(
        [np.linspace(1e-3, 0.0074, 60), *(a + np.linspace(1e-6, 1.9e-4, 40) for a in events[:1])]
    )
    times = times[np.abs(times[:, None] - events).min(axis=1) > 2 * h]
    assert (solution(times, "normal") > 0).sum() > 20
    slope = (solution(times + h, "energy") - solution(times - h, "energy")) / (2 * h)
    power = omega * solution(times, "torque")
    # h^2/6 E''' with a contact that lasts 2e-4 s: (h pi/2e-4)^2/6 of the power, and the rounding of E over h
    bound = 1e-5 * np.abs(power).max() + 1e-15 * solution["energy"].max() / h
    assert slope == pytest.approx(power, abs=bound)


def test_the_ideal_torque_is_that_of_the_joint_between_its_impacts():
    # Mean over a revolution: both mechanisms come back, so that the work is what impacts and friction take, >= 0.
    phi = np.linspace(0, 2 * np.pi, 2001)[:-1]
    assert abs(np.mean(IdealSliderCrank().torque(phi))) < 1e-12


def test_the_rigid_law_meets_the_wall_at_the_same_instant_and_comes_to_rest_on_it():
    solution = slider_crank(RigidImpact(e=0.5), None, clearance=0.5e-3).solve(rtol=1e-10)
    assert solution.success
    assert solution.event_times("impact")[0] == pytest.approx(FIRST[0.5e-3][0], abs=1e-13)
    assert len(solution.event_times("closed contact")) > 0
    closed = solution.status[solution.multipliers.index("R")] == 0
    assert np.abs(solution["indentation"][closed]).max() < 1e-12
    assert solution["indentation"].max() < 1e-12


def test_a_hundred_revolutions_at_a_loose_tolerance_lose_no_lift_off():
    """A lift-off is the event's, the flag's and the force's at once, also where their series differ by a rounding."""
    for order in (9, 16):
        solution = joint(0.5e-3).solve((0, 30), rtol=1e-6, order=order)
        assert solution.success
        down, up = (solution.event_times("reset", name) for name in ("touch-down", "lift-off"))
        assert len(down) > 1000
        assert 0 <= len(down) - len(up) <= 1 and np.all(up >= down[: len(up)])


@pytest.mark.parametrize("law", [LuGre(F_c=0.1, F_s=0.15), Dahl(F_c=0.1)])
def test_bristles_act_in_the_joint(law):
    scene = slider_crank(tangential=law)
    runs = [scene.solve((0, 0.1), rtol=rtol) for rtol in (1e-9, 1e-11)]
    assert all(run.success for run in runs)
    first, second = (touch_downs(run)[0] for run in runs)
    assert len(first) == len(second) > 5
    assert first[:5] == pytest.approx(second[:5], abs=1e-8)
    # Per unit of load: no bristle force without contact.
    assert np.all(runs[0]["friction"][runs[0]["normal"] == 0] == 0)
    assert np.abs(runs[0]["friction"]).max() > 1.0


@pytest.mark.thorough
def test_bristles_that_saturate_in_the_joint_are_those_of_small_steps():
    """In slip z comes to z_max, a kink, within a rounding of which it stays; every touch-down begins with z = 0."""
    scene = slider_crank(tangential=Elastoplastic())
    runs = [scene.solve(rtol=1e-8), scene.solve(rtol=1e-11), scene.solve(rtol=1e-11, method="rk")]
    assert all(run.success for run in runs)
    first, *others = (touch_downs(run)[0] for run in runs)
    assert len(first) >= 30
    for other in others:
        assert first == pytest.approx(other, abs=1e-8)
    for run in runs:
        down = [run.x[run.states.index("z"), run.t == instant][-1] for instant in touch_downs(run)[0]]
        assert np.all(np.array(down) == 0.0)
    assert np.sum(np.abs(np.abs(runs[0]["z"]) - 1e-5) < 1e-14) > 20  # F_c/sigma0


def test_rigid_impacts_with_coulomb_friction_are_no_hundred_thousand_terms():
    scene = slider_crank(RigidImpact(e=0.5), Coulomb(F_c=0.01))
    impact = next(m.impact for m in scene.system.model.multipliers if m.kind == "contact")
    assert sum(sp.count_ops(e) for e in impact) < 10_000
    solution = scene.solve((0, 0.03), rtol=1e-10)
    assert solution.event_times("impact")[0] == pytest.approx(FIRST[0.5e-3][0], abs=1e-13)
    assert np.abs(solution["indentation"]).max() < 2 * 0.5e-3 and solution["indentation"].max() < 1e-12


def test_residual_indentation_comes_back_to_a_wall_that_its_force_begins_at():
    """p* has decayed to 1e-17 m by the next touch-down: wall, force and its event lie within roundings."""
    solution = slider_crank(ResidualIndentation(K=5e10, beta=1e-5, gamma=1e6)).solve((0, 0.1), rtol=1e-8)
    assert solution.success
    assert len(solution.event_times("reset", "touch-down")) > 20
    assert solution["normal"].min() >= 0.0


@pytest.mark.parametrize(
    "options, text",
    [
        (dict(clearance=-1e-4), "`clearance` is -0.0001"),
        (dict(clearance=0.0), "`clearance` is 0;"),
        (dict(clearance=0.02), "journal's radius"),
        (dict(c_r=0.0), "`c_r` of LiuImpact is 0"),
        (dict(c_r=1.5), "`c_r` of LiuImpact is 1.5"),
        (dict(slider_mass=0), "`slider_mass` is 0"),
        (dict(start=(5e-4, 0)), "on or inside its wall"),
        (dict(rod=0.05), "longer than crank"),
        (dict(normal=LiuImpact(clearance=1e-3)), "the joint 0.0005"),
        (dict(tangential="coulomb"), "`tangential`, if no law, is 'coulomb'"),
        (dict(tangential=BoucWen()), "needs the position"),
    ],
)
def test_bad_input_is_refused_at_the_door(options, text):
    with pytest.raises(ValueError, match=text):
        slider_crank(**options)


def test_the_friction_law_is_per_unit_of_load():
    with pytest.raises(ValueError, match="v_1 > v_0"):
        slider_crank(tangential=ModifiedCoulomb(F_c=0.01, v_0=1e-3, v_1=1e-3))
