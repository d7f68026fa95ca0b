"""Painleve's rod: a rigid contact with friction that has no reaction, or two, or one without bound.

Of a rod of mass m, half-length l and moment of inertia m l^2/3, which leans by theta and slips with the sign lam,
    h'' = a N + b,   a = (1 + 3 cos theta (cos theta + mu lam sin theta))/m,   b = l omega^2 sin theta - g.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Outcome, Switch, System, Unilateral, solve

x, y, theta, u, w, omega = sp.symbols("x y theta u w omega", real=True)
mu, m, l, g = sp.symbols("mu m l g", positive=True)
gap, slip = y - l * sp.sin(theta), u + l * sp.sin(theta) * omega
VALUES = {mu: 1.6, m: 1.5, l: 0.7, g: 9.81}


def rod():
    N, lam = Unilateral(gap, name="N").reaction, Switch("lam", slip)
    T = -mu * N * lam
    turn = 3 * (-sp.cos(theta) * N + sp.sin(theta) * T) / (m * l)
    return System({x: u, y: w, theta: omega, u: T / m, w: N / m - g, omega: turn}, parameters=VALUES)


ROD = rod()


def start(angle, rate, v, height=0.0):
    up, aside = 0.7 * np.sin(angle), 0.7 * np.cos(angle)
    return {x: 0, y: up + height, theta: angle, u: v - up * rate, w: aside * rate, omega: rate}


def a(angle, lam=-1.0, friction=1.6):
    return (1 + 3 * np.cos(angle) * (np.cos(angle) + friction * lam * np.sin(angle))) / 1.5


def b(angle, rate):
    return 0.7 * rate**2 * np.sin(angle) - 9.81


def indeterminate(run):
    return [found.kind for found in run.ambiguities] == ["indeterminate contact"]


def test_the_closed_form_is_the_models():
    contact = next(mu_ for mu_ in ROD.model.multipliers if mu_.kind == "contact")
    lam = next(mu_ for mu_ in ROD.model.multipliers if mu_.kind == "switch").symbol
    N = contact.symbol
    closed = N * (1 + 3 * sp.cos(theta) * (sp.cos(theta) + mu * lam * sp.sin(theta))) / m
    closed += l * omega**2 * sp.sin(theta) - g
    plain = {
        s: sp.Symbol(s.name, positive=True)
        for s in contact.residual.free_symbols
        if s.name in ("mu", "m", "l", "g")
    }
    assert sp.simplify(contact.residual.xreplace(plain) - closed) == 0


@pytest.mark.parametrize("method", ["taylor", "rk"])
def test_every_start_is_given_its_name(method):
    random, seen = np.random.default_rng(20), {}
    for _ in range(120):
        angle, rate, friction = random.uniform(0.3, 1.5), random.uniform(0, 6), random.uniform(1.2, 2.5)
        v = -1.0 if random.random() < 0.8 else 1.0
        A, B = a(angle, np.sign(v), friction), b(angle, rate)
        if min(abs(A), abs(B)) < 1e-3:
            continue
        run = solve(ROD, (0, 1e-6), start(angle, rate, v), parameters={mu: friction}, method=method)
        expected = ("closed" if B < 0 else "open") if A > 0 else ("inconsistent" if B < 0 else "indeterminate")
        seen[expected] = seen.get(expected, 0) + 1
        assert (run.outcome is Outcome.INCONSISTENT_CONTACT) == (expected == "inconsistent")
        assert indeterminate(run) == (expected == "indeterminate")
        if expected in ("closed", "open"):
            assert f"(N) {expected}" in run.itinerary[0]
            assert run["N"][0] == pytest.approx(max(0.0, -B / A), rel=1e-12)
    assert len(seen) == 4 and min(seen.values()) >= 5


def test_an_indeterminate_contact_tells_its_continuations_and_stops_a_strict_run():
    run = solve(ROD, (0, 0.05), start(1.1, 4.5, -1.0))
    (found,) = run.ambiguities
    assert (found.time, found.switch, found.taken) == (0, "N", "part")
    assert found.continuations == ("part", "stay closed", "tangential impact")
    assert run.success and "open" in run.itinerary[-1]
    assert solve(ROD, (0, 0.05), start(1.1, 4.5, -1.0), strict=True).outcome is Outcome.AMBIGUITY


def test_a_rod_that_falls_into_the_paradox_has_no_impulse():
    run = solve(ROD, (0, 1), start(1.1, 0.0, -1.0, height=0.1))
    assert run.outcome is Outcome.INCONSISTENT_CONTACT
    assert run.t[-1] == pytest.approx(np.sqrt(0.2 / 9.81), abs=1e-12)
    assert "tangential impact" in run.message
    # Slipping to the other side it lands, with a > 0.
    assert solve(ROD, (0, 0.2), start(1.1, 0.0, 1.0, height=0.1)).events[0].kind == "impact"


@pytest.mark.parametrize("method", ["taylor", "rk"])
def test_a_rod_that_slides_jams_where_a_and_b_vanish(method):
    """Genot and Brogliato: of mu > 8/(3 sqrt 3), into the point with both 0, and with no bound on the reaction."""
    corner = np.arctan((3 * 1.6 - np.sqrt((3 * 1.6) ** 2 - 16)) / 2)  # the first zero of a
    for rate in (2.2, 2.5, 3.0):
        run = solve(ROD, (0, 1), start(0.5, rate, -6.0), method=method)
        assert run.outcome is Outcome.JAM
        assert run["theta"][-1] == pytest.approx(corner, abs=1e-5)
        assert run["omega"][-1] == pytest.approx(np.sqrt(9.81 / 0.7 / np.sin(corner)), abs=1e-3)
        assert 0 < a(run["theta"][-1]) < 1e-5 and run["N"][-1] > 20 * run["N"][0]


def test_less_friction_slides_through():
    """Below mu = 4/3 a is positive at every angle."""
    run = solve(ROD, (0, 0.3), start(0.5, 2.2, -6.0), parameters={mu: 1.3})
    assert run.success and not run.ambiguities
