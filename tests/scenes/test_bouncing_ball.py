"""A ball on a vibrating table: closed forms of its orbits with one impact a period, and of chatter that ends in rest.

Units of gravity and of the table's frequency; the table is at Gamma sin t, Gamma its acceleration over that of gravity.
"""

import functools
import math

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from pwsmooth import Strobe, System, Unilateral, find_orbit, follow
from pwsmooth.analysis.continuation.conditions.chatter import fixed

t, x, v = sp.symbols("t x v", real=True)
G, e = sp.symbols("Gamma e", positive=True)
TABLE = Unilateral(x - G * sp.sin(t), restitution=e, name="table")
BALL = System({x: v, v: -1 + TABLE.reaction}, time=t, parameters={G: 1.2, e: 0.5})

CASES = [(0.5, 1), (0.8, 1), (0.8, 2), (0.95, 3)]


def fold(restitution, n):
    """Impacts every n periods at the phase phi: cos phi = pi n (1 - e)/((1 + e) Gamma), at most 1."""
    return math.pi * n * (1 - restitution) / (1 + restitution)


def flip(restitution, n):
    """The multipliers have the product e^2 and the sum 1 + e^2 - (1 + e)^2 Gamma sin phi (J. M. Luck, A. Mehta, Phys.

    Rev. E 48 (1993) 3988): one is -1 at Gamma sin phi = 2 (1 + e^2)/(1 + e)^2.
    """
    return math.hypot(fold(restitution, n), 2 * (1 + restitution**2) / (1 + restitution) ** 2)


@functools.cache
def bouncing(restitution, n):
    """The orbit with one impact in n periods, between its fold and its flip."""
    gamma = (fold(restitution, n) + flip(restitution, n)) / 2
    phi = math.acos(fold(restitution, n) / gamma)
    flown = 2 * math.pi * n - phi  # since the last impact, with the speed pi n
    start = {x: gamma * math.sin(phi) + math.pi * n * flown - flown**2 / 2, v: math.pi * n - flown}
    return (
        find_orbit(BALL.with_parameters({G: gamma, e: restitution}), start, seen=Strobe(2 * sp.pi), count=n),
        phi,
        gamma,
    )


@pytest.mark.parametrize("restitution, n", CASES)
def test_an_impact_every_n_periods_has_the_phase_and_speed_of_the_closed_form(restitution, n):
    orbit, phi, _ = bouncing(restitution, n)
    assert orbit.success
    (impact,) = orbit.runs()[0].events
    assert impact.time == pytest.approx(phi, abs=1e-12)


@pytest.mark.parametrize("restitution, n", CASES)
def test_its_multipliers_have_the_sum_and_the_product_of_the_closed_form(restitution, n):
    orbit, phi, gamma = bouncing(restitution, n)
    product, total = np.prod(orbit.multipliers).real, np.sum(orbit.multipliers).real
    assert product == pytest.approx(restitution**2, abs=1e-9)
    assert total == pytest.approx(1 + restitution**2 - (1 + restitution) ** 2 * gamma * math.sin(phi), abs=1e-9)


@pytest.mark.parametrize("restitution, n", CASES)
def test_its_fold_is_the_closed_form(restitution, n):
    orbit, _, gamma = bouncing(restitution, n)
    (found,) = follow(orbit, {G: 0.95 * fold(restitution, n)}).of_kind("fold")
    assert found.parameter == pytest.approx(fold(restitution, n), abs=1e-9)


@pytest.mark.parametrize("restitution, n", CASES)
def test_its_flip_is_the_closed_form(restitution, n):
    orbit, _, gamma = bouncing(restitution, n)
    (found,) = follow(orbit, {G: 1.01 * flip(restitution, n)}).of_kind("flip")
    assert found.parameter == pytest.approx(flip(restitution, n), abs=1e-9)


def bounces(gamma, restitution=0.5):
    """Phases of impacts after the lift-off, and where they accumulate: roots of the gap, from its own series in tau.

    None in the place of the limit where they come to no end before the next lift-off.
    """

    def gap(tau, at, speed):
        # w tau - tau^2/2 - Gamma (sin(at + tau) - sin at - tau cos at): small differences from the series.
        if tau < 0.3:
            derivative = [-math.sin(at), -math.cos(at), math.sin(at), math.cos(at)]
            rest = sum(derivative[k % 4] * tau ** (k + 2) / math.factorial(k + 2) for k in range(18))
        else:
            rest = math.sin(at + tau) - math.sin(at) - tau * math.cos(at)
        return speed * tau - tau * tau / 2 - gamma * rest

    at, speed, found = math.asin(1 / gamma), 0.0, []
    while True:
        press = 1 - gamma * math.sin(at)
        if at > 2 * math.pi + math.asin(1 / gamma):
            return found, None
        if found and 0 < speed < 1e-5 * press**2:
            # The rest is a geometric series, to the square of the speed; it ends long before the table falls away.
            return found, at + 2 * speed / press / (1 - restitution)
        high = 0.2 * speed if found else 1e-2
        while gap(high, at, speed) > 0:
            high *= 1.2
        tau = brentq(gap, high / 1.2, high, (at, speed), xtol=1e-16, rtol=1e-15)
        speed = -restitution * (speed - tau - gamma * (math.cos(at + tau) - math.cos(at)))
        at += tau
        found.append(at)


@pytest.fixture(scope="module")
def chattering():
    """Rest on the table, flight, infinitely many bounces, rest: at Gamma = 1.2."""
    return find_orbit(BALL, {x: 0, v: 1.2}, seen=Strobe(2 * sp.pi), transient=2)


def test_the_ball_lifts_off_where_the_table_falls_as_fast(chattering):
    (run,) = chattering.runs()
    (opening,) = (event for event in run.events if event.kind == "opening")
    assert chattering.success
    assert opening.time == pytest.approx(math.asin(1 / 1.2), abs=1e-12)


def test_its_bounces_are_those_of_the_closed_form(chattering):
    (run,) = chattering.runs()
    times = [event.time for event in run.events if event.kind == "impact"]
    exact, _ = bounces(1.2)
    assert times[:12] == pytest.approx(exact[:12], abs=1e-9)


def test_its_bounces_accumulate_where_the_closed_form_does(chattering):
    (run,) = chattering.runs()
    (closed,) = (event for event in run.events if event.kind == "closed contact")
    assert closed.time == pytest.approx(bounces(1.2)[1], abs=1e-9)  # the series is good to 1e-5 squared


def test_an_orbit_that_rests_forgets_all(chattering):
    assert np.abs(chattering.multipliers).max() == 0 and chattering.stable


def test_a_branch_of_complete_chatter_begins_at_the_lift_off_and_has_nothing_else_on_it(chattering):
    branch = follow(chattering, {G: 0.9})
    (found,) = branch.specials  # the number of bounces that a run passes is no change
    assert found.kind == "lift-off"
    assert abs(found.parameter - 1) < found.uncertainty < 1e-7  # flights are as high as (Gamma - 1)^2


def test_complete_chatter_ends_where_that_of_the_closed_form_does(chattering):
    found = follow(chattering, {G: 1.62}).specials[0]
    assert found.kind == "end of complete chatter"
    low, high = 1.59, 1.60
    while high - low > 1e-11:
        middle = (low + high) / 2
        low, high = (low, middle) if bounces(middle)[1] is None else (middle, high)
    assert found.parameter == pytest.approx(low, abs=1e-9)


def test_beyond_it_the_ball_bounces_for_ever(chattering):
    branch = follow(chattering, {G: 1.62})
    beyond = [
        orbit for orbit in branch.points if orbit.system.parameters[G] > branch.specials[0].parameter + 1e-6
    ]
    assert beyond and all({kind for _, kind, _ in orbit.word} == {"impact"} for orbit in beyond)


@pytest.mark.thorough
def test_the_end_of_complete_chatter_is_followed_over_the_restitution(chattering):
    end = follow(chattering, {G: 1.6}).specials[0]
    curve = follow(end, {G: (1.02, 2.6), e: (0.1, 0.9)})
    assert curve.ends == ("reached e = 0.9.", "reached e = 0.1.")
    # Bounces by roots of the gap: they accumulate on one side, and come to no end on the other.
    for gamma, restitution in curve.values[:, ::20].T:
        assert bounces(gamma - 3e-8, restitution)[1] is not None
        assert bounces(gamma + 3e-8, restitution)[1] is None


def next_of(r, restitution):
    """w of the bounce behind one that ends at a part r of the time to the opening."""
    return restitution * (1 - r) * (1 + 2 * r) / (6 * r**2)


def test_the_last_bounces_of_complete_chatter_are_those_of_the_fixed_point():
    # With e = r^2 (2 + r)/(1 + 2 r) a bounce of w* = (1 - r)(2 + r)/6 is followed by one of w*, shorter by r.
    for r in (0.3, 0.66):
        w, grows, w_r, grows_r = fixed(r)
        restitution, later = r**2 * (2 + r) / (1 + 2 * r), r * (1 + 1e-6)
        # Of a bounce that begins at s = 1 before the contact opens, and ends at r: h = 0, and the next one's w.
        assert (1 - r) * (2 + r) / 6 == pytest.approx(next_of(r, restitution), rel=1e-14)
        slope = (next_of(later, restitution) - w) / ((1 - later) * (2 + later) / 6 - w)
        assert slope == pytest.approx(grows, rel=1e-5)
        beside = fixed(r + 1e-6)
        assert [w_r, grows_r] == pytest.approx(
            [(beside[k] - fixed(r - 1e-6)[k]) / 2e-6 for k in (0, 1)], rel=1e-8
        )
