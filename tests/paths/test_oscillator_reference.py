"""The closed-form reference itself: it must be right before anything is measured against it."""

import math

import mpmath as mp
import numpy as np
import pytest
from reference.coulomb_oscillator import (
    CROSSING,
    KIND_NAMES,
    SLIP,
    STICK,
    ensemble,
    solve_closed_form,
    trajectory,
)
from reference.relaxing import relaxing_orbit, segments_of

TWO_PI = 2 * math.pi


def mu_s(rho):
    """Static friction coefficient of gamma = 1 - lam^2, rho > 1/2."""
    return 2 * rho * ((1 + rho) / (3 * rho)) ** 1.5


def slip_velocity(t, v0, *, k, sigma, c, N, omega, y0):
    """v and v' of the right slip phase from (y0, v0) at t = 0, in mpmath's precision."""
    k, sigma, c, N, omega, y0 = (mp.mpf(a) for a in (k, sigma, c, N, omega, y0))
    a = c / 2
    w = mp.sqrt(k - a * a)
    det = (k - omega**2) ** 2 + (c * omega) ** 2
    A, B = -sigma * (k - omega**2) / det, sigma * c * omega / det
    C = y0 + N / k - B
    S = (v0 - A * omega + a * C) / w

    def y(t):
        wave = mp.exp(-a * t) * (C * mp.cos(w * t) + S * mp.sin(w * t))
        return wave - N / k + A * mp.sin(omega * t) + B * mp.cos(omega * t)

    return mp.diff(y, t, 1), mp.diff(y, t, 2)


def test_grazing_is_decided_within_a_relative_1e_13_of_the_grazing_start():
    case = dict(k=4.5, sigma=5.2, c=0.1, N=1.0, omega=5.0, y0=-0.8)
    with mp.workdps(40):
        touch, v0 = mp.findroot(lambda t, v0: slip_velocity(t, v0, **case), (0.63, 1.7))
        v0, touch = float(v0), float(touch)
    for sign in (+1, -1):
        times, kinds, _ = solve_closed_form(**case, v0=v0 * (1 + sign * 1e-13), t_end=10.0)
        assert (times[0] > touch + 0.5) == (sign > 0)
        if sign < 0:  # a dip 3e-14 deep: it ends and restarts the slip within its width
            assert abs(times[0] - touch) < 1e-6


def test_event_times_agree_with_mpmath_to_rounding():
    case = dict(k=3.1, sigma=2.4, c=0.1, N=1.0, omega=1.0, y0=0.5)
    times, _, _ = solve_closed_form(**case, v0=0.3)
    with mp.workdps(40):
        exact = mp.findroot(lambda t: slip_velocity(t, mp.mpf(0.3), **case)[0], times[0])
        assert abs(times[0] - exact) < 4e-16


def test_no_event_is_missed_or_invented_when_the_grid_is_shifted():
    # Restarting in the middle of a segment moves every interval of the scan: the events must not notice.
    rng = np.random.default_rng(3)
    nothing = np.empty(0), np.empty(0, np.int64)
    for _ in range(2000):
        k, sigma = rng.uniform(1.5, 5), rng.uniform(0.6, 3)
        y0, v0 = rng.uniform(-2, 2, 2)
        cut = rng.uniform(1, 20)
        orbit = k, sigma, 0.1, 1.0, 1.0, 1.0, 1.0
        whole = trajectory(*orbit, 0.0, y0, v0, 40.0, *nothing)
        first = trajectory(*orbit, 0.0, y0, v0, cut, *nothing)
        rest = trajectory(*orbit, cut, *first[1:], 40.0, *nothing)
        assert first[0] + rest[0] == whole[0]
        assert rest[1:] == pytest.approx(whole[1:], abs=1e-12)


def test_kinds_alternate_as_the_law_demands():
    rng = np.random.default_rng(4)
    n = 2000
    times, kinds = np.empty((n, 200)), np.zeros((n, 200), np.int64)
    counts, final = np.zeros(n, np.int64), np.empty((n, 2))
    k, sigma = rng.uniform(1.5, 5, n), rng.uniform(0.6, 3, n)
    y0, v0 = rng.uniform(-2, 2, (2, n))
    ensemble(k, sigma, 0.1, 1.0, 1.0, 1.0, 1.0, y0, v0, 20 * TWO_PI, times, kinds, counts, final)
    for i in range(n):
        sequence = kinds[i, : counts[i]]
        assert np.all(np.diff(times[i, : counts[i]]) > 0)
        after_stick = sequence[1:][sequence[:-1] == STICK]
        assert np.all(after_stick == SLIP)
        assert np.all(sequence[:-1][sequence[1:] == SLIP] == STICK)
        assert set(sequence) <= {CROSSING, STICK, SLIP}


def test_the_two_independent_references_agree_where_the_hidden_term_is_absent():
    times, kinds, state = solve_closed_form(3.1, 1.2, y0=0.6, v0=-1.07, t_end=30.0)
    events, end = relaxing_orbit(0.1, rho=0.0, sigma=1.2, t_end=30.0)
    assert [kind for _, kind in events] == [KIND_NAMES[kind] for kind in kinds]
    assert [time for time, _ in events] == pytest.approx(times, abs=1e-11)
    assert end[:2] == pytest.approx(state, abs=1e-11)


@pytest.mark.parametrize(
    ("thresholds", "stick", "start", "slips"),
    [
        (dict(capture=mu_s(3), static=mu_s(3)), 0.539389027, 1.755610496, (2.602203627,)),
        (dict(capture=mu_s(2), static=mu_s(2)), 0.350778709, 1.789548342, (2.790813945,)),
        (dict(capture=mu_s(1), static=mu_s(1)), 0.070676656, 1.813524584, (3.070915998,)),
        (dict(capture=1.0, static=mu_s(3)), 0.778356050, 1.741745156, (2.474350118, 3.030479140)),
    ],
    ids=["slaved rho=3", "slaved rho=2", "slaved rho=1", "two-stage rho=3"],
)
def test_published_orbits_in_the_limits_of_small_beta(thresholds, stick, start, slips):
    begin = dict(y0=0.6, v0=-1.07) if len(slips) == 2 else dict(y0=0.78, v0=-1.03)
    times, kinds, _ = solve_closed_form(3.1, 2.4, **thresholds, **begin, t_end=400 * TWO_PI, room=4000)
    cycle = segments_of([(t, KIND_NAMES[kind]) for t, kind in zip(times, kinds, strict=True)])[-4:]
    durations = {
        kind: [d for k, d, _ in cycle if k == kind] for kind in ("stick", "slip by tangency", "crossing")
    }
    phases = [phase for kind, _, phase in cycle if kind == "stick"]
    assert durations["stick"] == pytest.approx([stick] * len(durations["stick"]), abs=0.5e-9)
    assert durations["slip by tangency"][0] == pytest.approx(slips[0], abs=0.5e-9)
    assert durations["crossing"] == pytest.approx(slips[1:], abs=0.5e-9)
    assert min(abs(phase - start) for phase in phases) < 0.5e-9


@pytest.mark.parametrize(
    ("beta", "periods", "stick", "start", "slips"),
    [
        (0.1, 60, 1.179049648, 1.612048372, (2.291769134, 2.812366526)),
        (0.01, 40, 0.888623966, 1.716272629, (2.407164737, 2.987396603)),
        (0.001, 30, 0.804906892, 1.736283187, (2.457046934, 3.021231481)),
    ],
)
def test_published_relaxing_orbits(beta, periods, stick, start, slips):
    events, _ = relaxing_orbit(beta, t_end=periods * TWO_PI)
    cycle = segments_of(events)[-3:]
    found = {kind: (duration, phase) for kind, duration, phase in cycle}
    assert found["stick"] == pytest.approx((stick, start), abs=0.5e-9)
    assert found["slip by tangency"][0] == pytest.approx(slips[0], abs=0.5e-9)
    assert found["crossing"][0] == pytest.approx(slips[1], abs=0.5e-9)
