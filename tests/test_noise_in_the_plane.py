"""Diffusions across the surface of a disc: stationary laws, creep, one path for all steps, hidden terms."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Diffusion, Disc, Switch, System, ensemble, solve

t, x, y, u, v, w = sp.symbols("t x y u v w", real=True)
lam = Disc("lam", (u, v))
PLANE = System({x: u, y: v, u: -x - lam[0] + 0.7 * sp.cos(t), v: -2 * y - lam[1]}, time=t)
START = {x: 0.3, y: 0.2, u: 0.4, v: -0.2}
NOISE = Diffusion({u: 0.5, v: 0.3}, 1 / 16, seed=3, finest=2)

pytestmark = pytest.mark.filterwarnings("ignore:the diffusion acts on the surface")


@pytest.mark.parametrize(("dimensions", "share"), [(2, 0.0), (2, 0.5), (3, 0.5)])
def test_a_block_that_noise_shakes_creeps_under_any_force(dimensions, share):
    # dv = (F - mu v/|v|) dt + s dW is the gradient of U = mu |v| - F.v: density exp(-a (|v| - f.v)), a = 2 mu/s^2,
    # f = F/mu < 1. In d dimensions <v> = (d + 1) f/(1 - f^2)/a, and without a force <|v|> = d/a.
    mu, s = 2.0, 1.0
    velocity = (u, v, w)[:dimensions]
    disc = Disc("lam", velocity)
    rates = {component: -mu * disc[k] for k, component in enumerate(velocity)}
    rates[u] += share * mu
    noise = Diffusion(dict.fromkeys(velocity, s), 1 / 32, seed=2, finest=5)
    many = ensemble(System(rates), (0, 6 + 12 * share), dict.fromkeys(velocity, 0.0), noise, 2000)
    speeds, along = np.linalg.norm(many.end[:, :dimensions], axis=1), many.end[:, 0]

    def far(sample, expected):  # in standard errors
        return abs(sample.mean() - expected) / (sample.std() / math.sqrt(len(sample)))

    a = 2 * mu / s**2
    assert far(along, (dimensions + 1) * share / (1 - share**2) / a) < 4
    assert share or far(speeds, dimensions / a) < 4


def test_a_path_is_one_for_all_steps():
    ends = [
        ensemble(PLANE, (0, 2), START, replace(NOISE, level=level, finest=2 + level), 200).end
        for level in (0, 2, 4, 8)
    ]
    errors = [np.linalg.norm(end - ends[-1], axis=1).mean() for end in ends[:-1]]
    # Steps a quarter as long, and beside the surface a sixteenth: between order 1/2 and 1 in their length.
    assert errors[0] > 2 * errors[1] > 4 * errors[2] and errors[2] < 1e-4


def test_on_a_line_it_is_the_path_of_a_switch():
    noise = Diffusion({u: 0.5}, 1 / 16, seed=3, level=6, finest=8)
    line = System({x: u, u: -x - Switch("l", u) + 0.7 * sp.cos(t)}, time=t)
    scalar = ensemble(line, (0, 2), {x: 0.3, u: 0.4}, noise, 50).end
    plane = ensemble(PLANE, (0, 2), {x: 0.3, y: 0, u: 0.4, v: 0}, noise, 50).end
    assert np.all(plane[:, [1, 3]] == 0)
    np.testing.assert_allclose(plane[:, [0, 2]], scalar[:, :2], atol=2e-4)


def test_lambda_is_the_direction_of_slip_and_a_start_at_rest_leaves_at_once():
    path = solve(PLANE, (0, 3), START | {u: 0, v: 0}, noise=NOISE)
    velocity = np.array([path["u"], path["v"]])
    assert path.success and path.itinerary == ("slip (lam)",)
    assert np.all(path["lam_x"][:1] == 0) and np.hypot(*velocity)[1:].min() > 0
    np.testing.assert_allclose(
        [path["lam_x"][1:], path["lam_y"][1:]], velocity[:, 1:] / np.hypot(*velocity[:, 1:]), atol=1e-15
    )


def test_hidden_terms_never_act():
    hidden = [-lam[k] * (1 + 3 * (1 - lam.square)) for k in (0, 1)]
    other = System({x: u, y: v, u: -x + hidden[0] + 0.7 * sp.cos(t), v: -2 * y + hidden[1]}, time=t)
    runs = [solve(system, (0, 3), START, noise=NOISE) for system in (PLANE, other)]
    np.testing.assert_allclose(runs[0]["v"], runs[1]["v"], rtol=1e-12)


def test_that_it_does_not_stick_is_said():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(
            UserWarning, match=r"acts on the surface h \. h = 0 of lam: at eps = 0 .* does not stick"
        ):
            solve(PLANE, (0, 1), START, noise=NOISE)


def test_noise_that_leaves_a_disc_in_stick_is_refused():
    with pytest.raises(ValueError, match="the noise leaves the surfaces of the disc lam alone"):
        solve(PLANE, (0, 1), START, noise=Diffusion({x: 0.1}, 1 / 16))
