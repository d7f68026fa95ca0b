"""Several contact points of one body: together they hold more than it can move, and only the motion is unique."""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq, minimize

from pwsmooth import Disc, Outcome, System, solve

t, x, y, a, u, v, w = sp.symbols("t x y a u v w", real=True)
TWO = ((-1.0, 0.0), (1.0, 0.0))
THREE = ((1.0, 0.0), (-0.5, 0.8), (-0.5, -0.8))
FOUR = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
INERTIA = 0.5


def body(points, load=(0, 0, 0), strengths=None, inertia=INERTIA):
    """A body of mass 1 on points that share friction of strength 1, under a force and a moment."""
    rates, moment = [load[0], load[1]], load[2]
    for k, (px, py) in enumerate(points):
        rx, ry = px * sp.cos(a) - py * sp.sin(a), px * sp.sin(a) + py * sp.cos(a)
        lam = Disc(f"lam{k}", (u - w * ry, v + w * rx))
        grip = 1 / len(points) if strengths is None else strengths[k]
        rates = [rate - grip * component for rate, component in zip(rates, lam, strict=True)]
        moment -= grip * (rx * lam[1] - ry * lam[0])
    return System({x: u, y: v, a: w, u: rates[0], v: rates[1], w: moment / inertia}, time=t)


@pytest.mark.parametrize("points", [TWO, THREE, FOUR])
@pytest.mark.parametrize("velocity", [(1, 0, 0), (1, 0.3, 0.7), (0.2, 0.1, 2), (0, 0, 1)])
def test_a_body_on_several_points_comes_to_rest_and_stays(points, velocity):
    solution = solve(body(points), (0, 10), [0, 0, 0, *velocity])
    assert solution.success and {event.kind for event in solution.events} == {"stick"}
    assert len(solution.events) == len(points) and np.abs(solution.x[3:, -1]).max() < 1e-13
    assert [ambiguity.kind for ambiguity in solution.ambiguities] == ["multipliers not unique"]


@pytest.mark.parametrize(("points", "lever"), [(TWO, 1.0), (FOUR, np.sqrt(2))])
def test_turning_ends_as_of_a_moment(points, lever):
    solution = solve(body(points), (0, 2), [0, 0, 0, 0, 0, 1], rtol=1e-12, atol=1e-13)
    assert solution.event_times("stick") == pytest.approx(INERTIA / lever, abs=1e-11)
    assert solution.x[2, -1] == pytest.approx(0.5 * INERTIA / lever, abs=1e-11)


@pytest.mark.parametrize(("place", "way"), [(0, 0.25), (1, 0.25), (2, 0.25 / INERTIA)])
def test_a_load_that_grows_moves_it_as_one(place, way):
    """Force along and across the line of two points, moment about their middle: they hold 1, and t/2 - 1 moves."""
    load = [0, 0, 0]
    load[place] = t / 2
    solution = solve(body(TWO, load), (0, 3), [0] * 6)
    assert solution.event_times("slip by tangency") == pytest.approx(2, abs=1e-11)
    speeds = np.zeros(3)
    speeds[place] = way
    assert solution.x[3:, -1] == pytest.approx(speeds, abs=1e-9)


def test_a_body_turns_about_the_point_that_holds():
    """The right one of two points carries F/2 + M and gives way at 1/2; about the left one it turns then."""
    solution = solve(body(TWO, (0, t / 2, sp.Rational(2, 5))), (0, 2), [0] * 6, rtol=1e-11, atol=1e-13)
    (event,) = solution.events
    assert (event.switch, event.kind) == ("lam1", "slip by tangency") and event.time == pytest.approx(
        1.2, abs=1e-11
    )
    angle, speeds = solution.x[2, -1], solution.x[3:, -1]
    left = -np.array([np.cos(angle), np.sin(angle)])
    assert speeds[2] > 0.1
    assert speeds[:2] == pytest.approx(speeds[2] * np.array([left[1], -left[0]]), abs=1e-11)


def test_it_gives_way_where_no_forces_hold_it():
    """Against a search for the forces whose largest share of its bound is least."""

    def share(time):
        load = np.array([time / 2, 0.1, 0.2])
        columns = np.array([[[1, 0, -py], [0, 1, px]] for px, py in THREE]).reshape(-1, 3).T / 3
        found = minimize(
            lambda z: z[-1],
            np.r_[np.linalg.lstsq(columns, load, rcond=None)[0], 2.0],
            method="SLSQP",
            constraints=[
                {"type": "eq", "fun": lambda z: columns @ z[:-1] - load},
                {"type": "ineq", "fun": lambda z: z[-1] ** 2 - (z[:-1].reshape(3, 2) ** 2).sum(axis=1)},
            ],
            options={"ftol": 1e-14, "maxiter": 500},
        )
        return found.x[-1] - 1

    solution = solve(body(THREE, (t / 2, 0.1, 0.2)), (0, 3), [0] * 6)
    assert solution.success and len(solution.events) == 3
    assert solution.events[0].time == pytest.approx(brentq(share, 1.5, 2.5, xtol=1e-12), abs=1e-7)


@pytest.mark.parametrize("rtol", [1e-7, 1e-9, 1e-11])
def test_it_gives_way_at_the_same_time_at_every_tolerance(rtol):
    """Of a load that grows from 0 it is 1/max_w load.w / sum_k strength_k |velocity of point k in the motion w|."""
    points, strengths = ((-1.965, -1.13), (1.463, -0.245), (1.911, -0.361)), (0.518, 0.071, 0.317)
    load = np.array([0.05, 0.3, 0.45])

    def held(motion):
        speeds = [np.hypot(motion[0] - motion[2] * py, motion[1] + motion[2] * px) for px, py in points]
        return -(load @ motion) / np.dot(strengths, speeds)

    starts = np.random.default_rng(1).normal(size=(12, 3))
    tight = {"xatol": 1e-13, "fatol": 1e-15, "maxiter": 4000}
    expected = -1 / min(minimize(held, w_0, method="Nelder-Mead", options=tight).fun for w_0 in starts)
    system = body(points, [float(value) * t for value in load], strengths)
    solution = solve(system, (0, 1.2 * expected), [0] * 6, rtol=rtol, atol=1e-2 * rtol)
    assert solution.success
    assert solution.event_times("slip by tangency")[0] == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize(
    "seed", [*range(3), *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(3, 12))]
)
def test_random_bodies_beside_their_smoothed_view(seed):
    random = np.random.default_rng([11, seed])
    count = int(random.integers(2, 6))
    points, strengths = random.normal(size=(count, 2)), random.uniform(0.2, 2, count) / count
    waves = [
        sp.Float(p) * sp.sin(sp.Float(q) * t + sp.Float(r)) for p, q, r in random.uniform(0.5, 1.5, (3, 3))
    ]
    system = body(points.tolist(), waves, strengths.tolist(), float(random.uniform(0.3, 1.5)))
    start = [0, 0, 0, *random.normal(size=3)]
    exact = solve(system, (0, 6), start, max_steps=20_000)
    smoothed = solve(system.smoothed(1e-5), (0, 6), start, rtol=1e-8, atol=1e-10)
    assert smoothed.success
    assert exact.success or exact.outcome == Outcome.STEP_UNDERFLOW  # docs/limits.md
    if exact.success:
        assert exact.x[:, -1] == pytest.approx(smoothed.x[:, -1], abs=2e-3)


def test_forces_that_are_not_unique_are_said():
    solution = solve(body(FOUR), (0, 10), [0, 0, 0, 1, 0, 0], strict=True)
    assert solution.outcome == Outcome.AMBIGUITY and solution.t[-1] == pytest.approx(1, abs=1e-8)
