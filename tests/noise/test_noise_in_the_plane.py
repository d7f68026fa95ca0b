"""Diffusions beside a disc: across its surface, where nothing sticks, and under noise that leaves it alone.

Guards: kernels/noise/discs.py.
"""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Diffusion, Disc, Drive, Switch, System, solve
from pwsmooth.studies import ensemble

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


# ---- noise that leaves the velocities alone


def driven(force, side, turn=0.0):
    """A block that `force` pulls along a line and `side` across it, seen from a frame that is turned."""
    c, s = math.cos(turn), math.sin(turn)
    return System(
        {x: u, y: v, u: c * force - s * side - x / 4 - lam[0], v: s * force + c * side - y / 4 - lam[1], f: -f / 5},
        time=t,
    )  # fmt: skip


f, p, q = sp.symbols("f p q", real=True)
DRIVE = Diffusion({f: 0.9}, 1 / 16, seed=1, level=3, finest=7)


def test_noise_elsewhere_leaves_rests_and_onsets_where_they_are():
    block = System(
        {x: u, y: v, u: 1.6 * sp.cos(t / 4) - x - lam[0], v: sp.sin(t / 4) / 2 - y - lam[1], f: -f}, time=t
    )
    start = {x: 0.3, y: 0.1, u: 0.5, v: -0.4, f: 0}
    exact = solve(block, (0, 32), start, rtol=1e-12, atol=1e-14)
    errors = []
    for level in (0, 2, 4):
        path = solve(block, (0, 32), start, noise=replace(DRIVE, level=level, finest=8))
        assert [e.kind for e in path.events] == [e.kind for e in exact.events] and len(path.events) == 6
        errors.append(max(abs(a.time - b.time) for a, b in zip(path.events, exact.events, strict=True)))
        assert np.all(path.x[2:4, path.status[0] == 0] == 0)
    assert errors[0] < 1e-3 and errors[1] < errors[0] / 2 and errors[2] < 2e-5


def test_under_a_noisy_drive_a_line_in_the_plane_is_that_of_a_switch():
    start = {x: 0, y: 0, u: 0.3, v: 0, f: 0}
    line = System({x: u, u: f - x / 4 - Switch("s", u), f: -f / 5}, time=t)
    for level, error in ((1, 5e-3), (4, 2e-4)):
        noise = replace(DRIVE, level=level, finest=4 + level)
        scalar = ensemble(line, (0, 32), {x: 0, u: 0.3, f: 0}, noise, 40).end
        plane = ensemble(driven(f, 0), (0, 32), start, noise, 40).end
        assert np.all(plane[:, [1, 3]] == 0)
        np.testing.assert_allclose(plane[:, [0, 2]], scalar[:, :2], atol=error)


def test_a_noisy_drive_knows_no_axes_and_its_path_is_one_for_all_steps():
    side, turn = 0.6 * sp.sin(t / 4), 0.7
    c, s = math.cos(turn), math.sin(turn)
    start = {x: 0, y: 0, u: 0.3, v: -0.2, f: 0}
    turned = {x: 0, y: 0, u: c * 0.3 + s * 0.2, v: s * 0.3 - c * 0.2, f: 0}
    ends = {
        level: ensemble(driven(f, side), (0, 16), start, replace(DRIVE, level=level, finest=4 + level), 40).end
        for level in (0, 2, 4, 6)
    }
    errors = [np.linalg.norm(ends[level][:, :2] - ends[6][:, :2], axis=1).mean() for level in (0, 2, 4)]
    assert errors[0] > 4 * errors[1] > 16 * errors[2]
    other = ensemble(driven(f, side, turn), (0, 16), turned, replace(DRIVE, level=4, finest=8), 40).end
    np.testing.assert_allclose(other[:, 0], c * ends[4][:, 0] - s * ends[4][:, 1], atol=1e-4)
    np.testing.assert_allclose(other[:, 1], s * ends[4][:, 0] + c * ends[4][:, 1], atol=1e-4)


@pytest.mark.parametrize(("hidden", "reach", "kind"), [(0, 1, "slip by tangency"), (3, 16 / 9, "slip by fold")])
def test_a_stick_under_a_wandering_force_ends_on_the_circle(hidden, reach, kind):
    # A force that is Brownian motion in the plane leaves the circle of radius R after R^2/(2 s^2) in the mean.
    s, count = 0.7, 400
    friction = [component * (1 + hidden * (1 - lam.square)) for component in (lam[0], lam[1])]
    block = System({x: u, y: v, u: p - friction[0], v: q - friction[1], p: 0, q: 0}, time=t)
    noise = Diffusion({p: {"a": s}, q: {"b": s}}, 1 / 16, seed=7, finest=8)
    times = []
    for k in range(count):
        path = solve(block, (0, 32), dict.fromkeys((x, y, u, v, p, q), 0.0), noise=replace(noise, trajectory=k))
        first = path.events[0]
        assert first.kind == kind and path.success
        at = np.searchsorted(path.t, first.time)
        assert math.hypot(path["p"][at], path["q"][at]) == pytest.approx(reach, abs=2e-5)
        times.append(first.time)
    assert abs(np.mean(times) - reach**2 / (2 * s**2)) < 3.5 * np.std(times) / math.sqrt(count)


@pytest.mark.parametrize("hidden", [(0.0, 0.0), (1.2, 0.6)])
def test_two_coupled_blocks_move_as_event_driven_under_the_same_record(hidden):
    # The force of a path, taken at short intervals and joined by lines, drives a run that knows nothing of diffusions.
    z, w2 = sp.symbols("z0:2", real=True), sp.symbols("w0:2", real=True)
    a, b = Disc("a", (u, v)), Disc("b", w2)
    k, l = (1 + h * (1 - disc.square) for h, disc in zip(hidden, (a, b)))
    rates = {
        x: u, y: v, u: f - x / 2 - 0.9 * k * a[0] + 0.4 * (z[0] - x), v: p - y / 3 - 0.9 * k * a[1] + 0.4 * (z[1] - y),
        z[0]: w2[0], z[1]: w2[1], w2[0]: f / 2 - z[0] / 2 - 0.8 * l * b[0] + 0.4 * (x - z[0]),
        w2[1]: p - z[1] / 4 - 0.8 * l * b[1] + 0.4 * (y - z[1]),
    }  # fmt: skip
    step = 1 / 256
    times = np.arange(0, 16 + step / 2, step)
    start = dict.fromkeys(rates, 0.0)
    noise = Diffusion({f: {"a": 0.8}, p: {"b": 0.7}}, step, seed=4)
    path = solve(
        System(rates | {f: -f / 4, p: -p / 3}, time=t), (0, 16), start | {f: 0, p: 0}, noise=noise, t_eval=times
    )
    record = {force: Drive(times, path[str(force)], kind="line") for force in (f, p)}
    other = solve(System(rates, time=t, drives=record), (0, 16), start, t_eval=times)
    assert path.success and other.success and len(other.events) > 5 and not path.ambiguities
    assert np.abs(other.x).max() > 1 and np.abs(path.x[:8] - other.x[:8]).max() < 0.02


def test_one_path_and_an_ensemble_of_it_are_the_same_bits():
    start = {x: 0.0, y: 0.0, u: 0.3, v: -0.2, f: 0.0}
    system = driven(f, 0.6 * sp.sin(t / 4))
    path = solve(system, (0, 8), start, noise=DRIVE)
    assert len(path.events) > 2
    np.testing.assert_array_equal(path.x[:, -1], ensemble(system, (0, 8), start, DRIVE, 1).end[0])


def test_noise_along_the_curved_surface_of_a_disc_is_refused():
    curved = Disc("lam", (u + x**2, v))
    block = System({x: u, u: -curved[0], v: -curved[1]}, time=t)
    with pytest.raises(ValueError, match="acts along the curved surface"):
        solve(
            block, (0, 1), {x: 0.1, u: 0.2, v: 0}, noise=Diffusion({x: {"w": 0.1}, u: {"w": -0.2 * x}}, 1 / 16)
        )
