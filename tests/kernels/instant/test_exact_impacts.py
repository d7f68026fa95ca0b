"""A bouncing ball: elastic, and losing energy until it lies on the floor."""

import math

import numpy as np
import pytest

from pwsmooth import solve
from pwsmooth.compare.exact.catalogue import GRAVITY, TIGHT, ball, v, y

H0 = 1.0

FALL = math.sqrt(2 * H0 / GRAVITY)


def test_an_elastic_ball_keeps_its_energy_over_100_impacts():
    solution = solve(ball(1), (0, 200.5 * FALL), {y: H0, v: 0}, **TIGHT)
    assert [e.kind for e in solution.events] == 100 * ["impact"]
    energy = solution["v"] ** 2 / 2 + GRAVITY * solution["y"]
    assert np.max(np.abs(energy / (GRAVITY * H0) - 1)) < 1e-10
    # impacts at FALL, 3 FALL, 5 FALL, ...
    assert solution.event_times("impact") == pytest.approx(FALL * np.arange(1, 200, 2), abs=1e-9)


def test_a_ball_that_loses_energy_comes_to_rest_at_the_sum_of_its_bounces():
    # FALL (1 + 2 e/(1 - e)) = 19 FALL for e = 0.9
    solution = solve(ball(0.9), (0, 20 * FALL), {y: H0, v: 0}, **TIGHT)
    assert solution.success
    end = [e for e in solution.events if e.kind in ("accumulation", "closed contact")]
    assert end
    assert end[-1].time == pytest.approx(19 * FALL, abs=1e-9)
    impacts = solution.event_times("impact")
    expected = FALL * (1 + 2 * np.cumsum(0.9 ** np.arange(1, 11)))
    assert impacts[1:11] == pytest.approx(expected, abs=1e-9)


def test_the_ball_at_rest_lies_in_a_closed_contact_that_carries_its_weight():
    solution = solve(ball(0.9), (0, 100 * FALL), {y: H0, v: 0}, **TIGHT)
    assert solution["y"][-1] == 0.0
    assert abs(solution["v"][-1]) < 1e-15  # the closing projects the velocity onto the contact, to rounding
    assert solution["R"][-1] == pytest.approx(GRAVITY, abs=1e-12)
    assert solution.status[0, -1] == 0


def test_the_ball_never_goes_below_the_floor():
    solution = solve(ball(0.9), (0, 30 * FALL), {y: H0, v: 0}, dense_output=True)
    fine = solution(np.linspace(0, 30 * FALL, 20001), "y")
    assert fine.min() > -1e-12


def test_a_plastic_impact_closes_the_contact_at_once():
    solution = solve(ball(0), (0, 3 * FALL), {y: H0, v: 0}, **TIGHT)
    assert solution.events[0].time == pytest.approx(FALL, abs=1e-12)
    assert (solution["y"][-1], solution["v"][-1]) == pytest.approx((0.0, 0.0), abs=1e-15)
