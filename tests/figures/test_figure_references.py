"""The numbers that figures are held against, computed anew by programs that share nothing with the package."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from paper_figures import figure_02, figure_4_08, figure_4_09, figure_4_10, figure_4_11, figure_c2, figure_c5
from paper_figures import figure_lugre as lugre
from tests.reference import bristles, free_flight, kicked, presliding, rest

TURN = 2 * np.pi


def test_the_multistate_laws_losses_and_largest_forces():
    for sigma, losses in figure_4_08.LOSS.items():
        for A, listed, largest in zip(figure_4_08.AMPLITUDES, losses, figure_4_08.LARGEST):
            speed = lambda t, A=A: A * np.pi / 2 * np.cos(np.pi / 2 * t)  # noqa: E731
            times, force, _, work = presliding.multistate(speed, 8.0, sigma=sigma)
            late = times >= 4 - 1e-9
            assert work[-1] - work[late][0] == pytest.approx(listed, abs=6e-7)
            if sigma == 0.01:
                assert np.abs(force[late]).max() == pytest.approx(largest, abs=6e-7)


@pytest.mark.parametrize("tau_d", [0.02, 0.08])
def test_the_multistate_laws_lag(tau_d):
    speed = lambda t: 12.5 * (1 - np.cos(TURN * t))  # noqa: E731
    times, force, count, _ = presliding.multistate(speed, 2.0, tau_d=tau_d, step=1e-4)
    late = times >= 1 - 1e-9
    area = abs(np.trapezoid(force[late], speed(times)[late]))
    found = force[late & (count == 0)].min(), force[late].max(), area
    assert found == pytest.approx(figure_4_09.LISTED[tau_d], abs=1e-6)
    times, force, _, _ = presliding.multistate(lambda t: 10 * np.sin(TURN * t), 2.0, tau_d=tau_d, step=1e-4)
    assert force[times >= 1].max() == pytest.approx(figure_4_10.LISTED[tau_d], abs=1e-6)


def test_the_transitions_of_gms_and_of_the_multistate_law():
    speed = lambda t: 10 * np.cos(TURN * t)  # noqa: E731
    times, _, count, _ = presliding.multistate(speed, 0.4, step=1e-5)
    changes = times[1:][np.diff(count) != 0]
    # Seen within a step of 0.01 ms.
    assert changes[changes > 0.2] == pytest.approx(figure_4_11.NEW_TIMES, abs=1.1e-5)
    for sigma, listed in figure_4_11.RANGE.items():
        largest, changes = presliding.gms(speed, 1.2, sigma=sigma)
        assert largest == pytest.approx(listed, abs=2e-6)
        assert changes[(changes > 0.2) & (changes < 0.4)] == pytest.approx(figure_4_11.GMS_TIMES, abs=6e-6)


def test_lugres_scenes():
    x, _ = bristles.driven(
        bristles.lugre, lambda t, x, v: bristles.ramps(t), np.array([0, *lugre.WHEN]), max_step=0.01
    )
    assert 1e6 * x[1:] == pytest.approx(lugre.DISPLACED, abs=1e-4)
    times = np.linspace(0, 35, 350_001)
    _, v = bristles.driven(bristles.lugre, lambda t, x, v: 2 * (0.1 * t - x), times, max_step=0.01)
    starts = times[1:][(v[1:] >= 0.05) & (v[:-1] < 0.05)]
    assert (np.diff(starts)[-1], v.max()) == pytest.approx(lugre.STICK_SLIP, abs=1.1e-4)
    x = bristles.hunting(np.linspace(0, 100, 50_001))[25_000:]
    assert (x.min(), x.max()) == pytest.approx(lugre.HUNTING, abs=1e-4)


def test_drift_and_its_absence():
    cyclic = lambda t, x, v: 0.75 + 0.5 * np.sin(TURN * t)  # noqa: E731
    run = {law: bristles.driven(getattr(bristles, law), cyclic, np.arange(21.0), max_step=1e-3)[0]
           for law in ("lugre", "elastoplastic", "xky")}  # fmt: skip
    assert 1e6 * np.diff(run["lugre"])[-1] == pytest.approx(lugre.DRIFT, abs=1e-3)
    for law in ("elastoplastic", "xky"):
        assert 1e6 * run[law][-1] == pytest.approx(lugre.STILL, abs=1e-4)


@pytest.mark.parametrize("law", ["R1", "Hunt-Crossley"])
def test_the_falling_balls_first_contact(law):
    K, beta, gamma, b = 1e5, 0.005, 1000.0, 0.3

    def force(p, v, a):
        return (
            K * max(0.0, p + beta * gamma * (p - a)) ** 1.5
            if law == "R1"
            else K * max(p, 0) ** 1.5 * (1 + b * v)
        )

    def rate(t, s):
        p, v, a = s
        return [v, 9.81 - force(p, v, a), max(-gamma * a / (1 + gamma * beta), gamma * (p - a))]

    def lost(t, s):
        return s[0] + beta * gamma * (s[0] - s[2]) if law == "R1" else s[0]

    fall = math.sqrt(0.2 / 9.81)
    lost.terminal, lost.direction = True, -1
    run = solve_ivp(
        rate, (0, 0.1), [0, 9.81 * fall, 0], "DOP853", events=lost, rtol=1e-12, atol=1e-15, max_step=1e-4
    )
    off, place = fall + run.t_events[0][0], run.y_events[0][0][0]
    assert (off, place) == pytest.approx(figure_c2.LIFT_OFF[law], abs=6e-7)


@pytest.mark.parametrize("clearance", [0.5e-3, 1e-3])
def test_the_slider_cranks_first_impact(clearance):
    assert free_flight.first_impact(clearance) == pytest.approx(figure_c5.FIRST[clearance], abs=1e-13)


@pytest.mark.parametrize("beta", [0.5, 1.0, 3.0])  # 0.1 takes 10 s
def test_the_ends_of_rest(beta, monkeypatch):
    monkeypatch.syspath_prepend("experiments")
    from propositions import LISTED

    assert rest.rest_limit(beta) == pytest.approx(LISTED[beta], abs=1e-7)


@pytest.mark.parametrize("law", ["uniform", "normal"])
def test_large_kicks_miss_the_static_peaks_only_just_before_the_next(law):
    always, before = kicked.largest_mu(5e-3, law)
    # 120 half periods; over 500 it is 97 % and 89 % at all times.
    assert np.mean(always > 1.6) > 0.8 and np.mean(before > 1.6) < 0.1


def test_mixed_phases_and_their_peaks_are_those_of_the_integral():
    from mpmath import mp, quad

    def integral(f, *ends):
        return float(quad(lambda k: mp.exp(-k * k / 2) * f(k), [*ends]))

    for kind, phase in (
        ("cos", lambda r1, r2: lambda k: mp.cos(r1 * k) * mp.cos(r2 * k)),
        ("sin", lambda r1, r2: lambda k: mp.cos(r1 * k) * (mp.sin(r2 * k) / k if k else r2)),
    ):
        for rates in ((1.5, 0.25), (2.0, 1.0), (1.0, 0.75)):
            u = math.pi / (2 * rates[0])
            exact = integral(phase(*rates), 0, u) / integral(phase(*rates), 0, 2, 4, 8, 12)
            assert float(figure_02.mixed_phase(kind, rates, u)) == pytest.approx(exact, abs=1e-12)
    # The border by another route: where the rest of the integral beyond the first zero is 1 % of the whole.
    f = lambda r1: lambda k: math.exp(-k * k / 2) * math.cos(r1 * k) * math.cos(0.5 * k)  # noqa: E731

    def excess(r1):
        from scipy.integrate import quad as plain

        whole, first = plain(f(r1), 0, 12)[0], plain(f(r1), 0, math.pi / (2 * r1))[0]
        return first / whole - 1.01

    assert figure_02.border("cos", 0.5, 1.01) == pytest.approx(brentq(excess, 0.6, 1.5), abs=1e-6)
