"""The multistate law and GMS against the numbers of their reconstruction, and what a multistate law costs.

The listed numbers are an independent fixed-step computation's (backward Euler or Runge-Kutta), to the digits given.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth.laws.friction import GMS, MaxwellSlip, MultistateXKY
from pwsmooth.scenes import prescribed_motion, t

TURN = 2 * sp.pi * t


def test_the_multistate_law_is_a_lagging_filter_of_the_stribeck_curve_while_all_elements_slide():
    # f = s(t), tau_d ds/dt = g(v) - s: at constant v after a jump of s the deviation decays with tau_d.
    law = MultistateXKY(kappa=(2.5, 1.0), share=(0.5, 0.5), sigma=0.01, tau_d=0.05)
    scene = prescribed_motion(law, velocity=20.0, t_span=(0, 0.5))
    g = 1 + np.exp(-((20 / 8) ** 2))
    start = {**scene.x0, "s": 1.8, "a_1": 0.9 / 2.5, "a_2": 0.9}
    times = np.array([0.02, 0.1, 0.3])
    force = scene.solve(x0=start, t_eval=times)["force"]
    assert force == pytest.approx(g + (1.8 - g) * np.exp(-times / 0.05), rel=1e-8)


def test_presliding_counts_change_when_the_reconstruction_says():
    velocity = 10 * sp.cos(TURN)
    listed = {
        GMS: [0.2500] * 10 + [0.3187, 0.3458, 0.3663, 0.3837],
        MultistateXKY: [0.2181, 0.2213, 0.2247, 0.2282, 0.2319, 0.2357, 0.2394, 0.2429, 0.2459, 0.2483,
                        0.3163, 0.3405, 0.3579, 0.3717, 0.3834, 0.3936],
    }  # fmt: skip
    for law, instants in listed.items():
        run = prescribed_motion(law(), velocity=velocity, t_span=(0, 0.398)).solve(dense_output=True)
        times = np.unique([e.time for e in run.events if e.time > 0.2])
        change = np.round(run(times + 1e-9, "presliding") - run(times - 1e-9, "presliding")).astype(int)
        found = np.repeat(times, np.abs(change))
        assert found == pytest.approx(instants, abs=6e-5)  # half a digit, and half a step of 0.1 ms


@pytest.mark.parametrize(
    ("lag", "low", "high", "area"), [(0.02, 1.0001, 1.9901, 2.605), (0.08, 1.0037, 1.9425, 8.297)]
)
def test_the_lags_loop_has_the_listed_extremes_and_area(lag, low, high, area):
    scene = prescribed_motion(MultistateXKY(tau_d=lag), velocity=12.5 * (1 - sp.cos(TURN)), t_span=(0, 2))
    run = scene.solve(dense_output=True)
    times = np.linspace(1, 2, 20001)
    force, v, count = (run(times, name) for name in ("force", "velocity", "presliding"))
    sliding = np.round(count) == 0
    assert (force[sliding].min(), force.max()) == pytest.approx((low, high), abs=1e-4)
    assert abs(np.trapezoid(force, v)) == pytest.approx(area, rel=1e-3)
    assert np.interp(10, v[:10001], force[:10001]) > np.interp(10, v[:9999:-1], force[:9999:-1])


def test_the_multistate_laws_force_is_continuous_and_gms_jumps_by_sigma_v():
    for sigma in (0.001, 0.03):
        motion = dict(velocity=10 * sp.cos(TURN), t_span=(0, 0.6))
        for law, jumping in ((GMS, True), (MultistateXKY, False)):
            run = prescribed_motion(law(sigma=sigma), **motion).solve()
            at = np.unique([e.time for e in run.events if e.switch.startswith("slip") or not jumping])
            first, last = np.searchsorted(run.t, at), np.searchsorted(run.t, at, side="right") - 1
            jump = np.abs(run["force"][last] - run["force"][first])
            expected = sigma * np.abs(10 * np.cos(2 * np.pi * at)) if jumping else np.zeros(at.size)
            # Where it slips |kappa z| equals the threshold to solve's tolerance, times C/kappa sigma.
            assert at.size >= 10 and jump == pytest.approx(expected, abs=1e-6)


def test_many_elements_lose_what_their_closed_form_says():
    n = 40
    law = MaxwellSlip(kappa=tuple(2.5 / i for i in range(1, n + 1)), strength=(0.02,) * n)
    run = prescribed_motion(law, position=0.3 * sp.sin(TURN), t_span=(0, 2), work=True).solve(t_eval=[1, 2])
    assert np.diff(run["work"])[0] == pytest.approx(law.loss(0.3), rel=1e-8)
