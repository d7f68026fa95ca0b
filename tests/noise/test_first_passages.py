"""First passages under white noise: their means have closed forms, at steps far longer than a path takes to turn back.

Guards: kernels/noise/passage.py.
"""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad
from scipy.special import erf

from pwsmooth import Diffusion, Event, System, solve
from pwsmooth.studies import ensemble

v, w, n = sp.symbols("v w n", real=True)
mu = sp.Symbol("mu", real=True)
PATHS = 20_000
DRIFT = System({v: mu + 0 * v}, parameters={mu: 1}, events=[Event(v - 1, terminal=True)])


def lies_within_three_errors(paths, exact):
    assert abs(paths.end_time.mean() - exact) < 3 * paths.end_time.std() / len(paths.end_time) ** 0.5


def mean_passage(potential, square, start, threshold):
    """From `start` up to `threshold` in dv = -U'(v) dt + sqrt(square) dW, by the backward equation."""

    def below(y):
        return quad(lambda z: np.exp(2 * (potential(y) - potential(z)) / square), -8, y)[0]

    return quad(lambda y: 2 / square * below(y), start, threshold)[0]


@pytest.mark.parametrize("step", [1 / 4, 1 / 32])
@pytest.mark.parametrize("speed", [1, 2])
def test_a_drifting_path_arrives_as_wald_says(speed, step):
    drift = DRIFT.with_parameters({mu: speed})
    paths = ensemble(drift, (0, 64), {v: 0}, Diffusion({v: 1}, step, seed=speed), PATHS)
    lies_within_three_errors(paths, 1 / speed)
    assert np.abs(paths.end[:, 0] - 1).max() < 1e-12
    # Wald's distribution: the variance is that over the cube of the speed.
    assert paths.end_time.var() == pytest.approx(1 / speed**3, rel=0.1)


def test_a_well_is_left_over_its_barrier_as_often_as_the_backward_equation_says():
    square = 0.8
    well = System({v: v - v**3}, events=[Event(v - sp.Rational(1, 2), terminal=True)])
    paths = ensemble(well, (0, 1024), {v: -1}, Diffusion({v: square**0.5}, 1 / 4, seed=3), PATHS)
    lies_within_three_errors(paths, mean_passage(lambda y: y**4 / 4 - y**2 / 2, square, -1, 0.5))


def test_on_a_curved_surface_the_end_state_is_on_it():
    disc = System({v: -v, w: -2 * w}, events=[Event(v**2 + w**2 - 1, terminal=True)])
    noise = Diffusion({v: {"a": 1, "b": sp.Rational(1, 2)}, w: {"b": 1}}, 1 / 4, seed=1)
    paths = ensemble(disc, (0, 256), {v: 0, w: 0}, noise, 2000)
    assert np.abs((paths.end**2).sum(axis=1) - 1).max() < 1e-12


def test_a_neuron_fires_at_the_rate_of_siegert():
    level, size, end = 0.8, 0.5, 4096
    neuron = System(
        {v: sp.Rational(4, 5) - v, n: 0}, events=[Event(v - 1, direction=1, update={v: 0, n: n + 1})]
    )
    wait = np.sqrt(np.pi) * quad(lambda u: np.exp(u * u) * (1 + erf(u)), -level / size, (1 - level) / size)[0]
    run = solve(neuron, (0, end), {v: 0, n: 0}, noise=Diffusion({v: size}, 1 / 4, seed=2))
    fired = np.array([e.time for e in run.events])
    assert len(fired) == run["n"][-1]
    assert abs(np.diff(fired).mean() - wait) < 3 * np.diff(fired).std() / len(fired) ** 0.5


def test_what_lies_beyond_the_surface_already_does_not_arrive():
    # The path begins beyond: an event of the other direction is met only from the other side.
    above = System({v: 0 * v}, events=[Event(v, direction=1, terminal=True)])
    paths = ensemble(above, (0, 1), {v: 2}, Diffusion({v: sp.Rational(1, 10)}, 1 / 4, seed=1), 200)
    assert np.all(paths.end_time == 1)
