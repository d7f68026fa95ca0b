"""Scenes of many elements: blocks on a belt, lattices that fire, clouds of sliders.

What they do is told by formulas, by another solver, or by a few lines that know nothing of events.
"""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from pwsmooth.families import Recorder
from pwsmooth.laws.friction import Coulomb, MaxwellSlip, StaticKinetic, VelocityWeakening
from pwsmooth.scenes import (
    block_lattice,
    block_train,
    element_cloud,
    firing_lattice,
    granular_chain,
    plate_stack,
    rate_state_train,
    t,
)

TIGHT = {"rtol": 1e-12, "atol": 1e-14}
V = 0.1
ROWS = {"train": lambda law, **more: block_train(law, n=150, **more),
        "lattice": lambda law, **more: block_lattice(law, shape=(10, 15), coupling=2.0, **more)}  # fmt: skip


def in_step(scene):
    """The start with all blocks at their places."""
    return {name: 0.0 if name.startswith("x") else value for name, value in scene.x0.items()}


@pytest.mark.parametrize("kind", ROWS)
def test_blocks_that_start_alike_slip_as_the_closed_form_of_one_says(kind):
    scene = ROWS[kind](StaticKinetic(F_c=1.0, F_s=1.5))
    run = scene.solve((0, 60), in_step(scene), record=Recorder(), **TIGHT)
    # It sticks until x = F_s; then x = F_c + A cos s + V sin s, until it has the speed of the belt again.
    A = 0.5
    period = 2 * A / V + 2 * np.pi - 2 * np.arctan(A / V)
    slips = 15 + period * np.arange(4)
    log = run.catalogue
    begins = log.t[log.came == 0].reshape(4, 150)
    np.testing.assert_allclose(begins, np.tile(slips[:, None], 150), rtol=0, atol=1e-10)
    assert len(log) == 8 * 150 and np.ptp(run.x[:150, -1]) < 1e-12


@pytest.mark.parametrize("kind", ROWS)
def test_a_slip_under_weakening_friction_lasts_as_scipy_says(kind):
    law = VelocityWeakening(F_c=1.0, F_s=1.2, v_w=0.3)
    scene = ROWS[kind](law)
    run = scene.solve((0, 20), in_step(scene), record=Recorder(), **TIGHT)

    def slip(_, y):
        return y[1], -y[0] + 1 / (1 + (V - y[1]) / 0.3)

    def back(_, y):
        return y[1] - V + 1e-300

    back.terminal, back.direction = True, 1
    begun = solve_ivp(slip, (0, 1e-3), [1.2, V], rtol=1e-13, atol=1e-15, method="DOP853")
    rest = solve_ivp(slip, (1e-3, 20), begun.y[:, -1], events=back, rtol=1e-13, atol=1e-15, method="DOP853")
    log = run.catalogue
    np.testing.assert_allclose(log.t[:150], 12.0, atol=1e-10)
    np.testing.assert_allclose(log.t[150:300], 12 + rest.t[-1], atol=1e-9)


@pytest.mark.parametrize("kind", ROWS)
def test_blocks_that_all_slip_swing_in_the_normal_modes_of_their_springs(kind):
    scene = ROWS[kind](Coulomb(), pull=2.0)
    if kind == "train":
        shape = np.cos(np.pi * 7 * (np.arange(150) + 0.5) / 150)
        w = np.sqrt(1 + 8 * np.sin(np.pi * 7 / 300) ** 2)
    else:
        i, j = np.divmod(np.arange(150), 15)
        shape = np.cos(np.pi * 3 * (i + 0.5) / 10) * np.cos(np.pi * 4 * (j + 0.5) / 15)
        w = np.sqrt(1 + 8 * (np.sin(np.pi * 3 / 20) ** 2 + np.sin(np.pi * 4 / 30) ** 2))
    start = {"x": 1 + 0.3 * shape, "v": 0.0}
    run = scene.solve((0, 50), start, t_eval=[0, 25, 50], **TIGHT)
    assert not len(run.events)
    for k, time in enumerate(run.t):
        np.testing.assert_allclose(run.x[:150, k], 1 + 0.3 * shape * np.cos(w * time), atol=1e-10)


def automaton(shape, share, drive, leak, u, end):
    """(times, numbers fired, charges at the end) of a lattice that fires, one generation after the other."""
    u, now, found = u.reshape(shape).copy(), 0.0, []
    while True:
        top = u.max()
        wait = np.log((drive - leak * top) / (drive - leak)) / leak
        step = min(wait, end - now)
        u = drive / leak + (u - drive / leak) * np.exp(-leak * step)
        now += step
        if wait > step:
            return found, u.ravel()
        fires, size = u >= 1 - 1e-12, 0
        while fires.any():
            size += fires.sum()
            gift = np.pad(np.where(fires, share * u, 0.0), 1)
            u = np.where(fires, 0.0, u)
            u += gift[2:, 1:-1] + gift[:-2, 1:-1] + gift[1:-1, 2:] + gift[1:-1, :-2]
            fires = u >= 1
        found.append((now, size))


def test_a_lattice_fires_in_the_avalanches_of_an_automaton():
    scene = firing_lattice(shape=(12, 12), share=0.22, leak=0.2, seed=4)
    run = scene.solve((0, 30), t_eval=[0, 30], **TIGHT)
    start = np.array(list(scene.x0.values()))
    found, end = automaton((12, 12), 0.22, 1.0, 0.2, start, 30)
    times, sizes = np.array([at for at, _ in found]), [size for _, size in found]
    first = np.concatenate([[0], np.flatnonzero(np.diff(run.events.times) > 1e-9) + 1])
    np.testing.assert_allclose(run.events.times[first], times, rtol=0, atol=1e-10)
    assert np.diff([*first, len(run.events)]).tolist() == sizes and max(sizes) > 20
    np.testing.assert_allclose(run.x[:, -1], end, atol=1e-10)
    assert not run.ambiguities


def test_neighbours_that_are_full_at_once_by_themselves_give_to_each_other():
    scene = firing_lattice(shape=(12, 12), leak=0.2, share=0.22)
    full = {name: 0.9 if k in (5, 6) else 0.2 for k, name in enumerate(scene.x0)}
    run = scene.solve((0, 0.2), full, t_eval=[0, 0.2], **TIGHT)
    assert len(run.events) == 2 and not run.ambiguities
    # du/dt = 1 - u/5 from 0.22 on.
    left = 5 - (5 - 0.22) * np.exp(-(0.2 - run.events.times[0]) / 5)
    assert run.x[5:7, -1] == pytest.approx([left, left], abs=1e-11)
    with pytest.raises(ValueError, match="give less than 0.25"):
        firing_lattice(share=0.25)
    with pytest.raises(ValueError, match="give drive > leak"):
        firing_lattice(leak=1.0)


def test_a_cloud_of_sliders_keeps_masings_rules():
    n, A = 3000, 1.2
    strength = np.random.default_rng(2).weibull(1.5, n) / n
    law = MaxwellSlip(kappa=(1 / n,) * n, strength=tuple(strength))
    times = np.linspace(0, 3 * np.pi, 301)
    run = element_cloud(law, position=A * sp.sin(t)).solve((0, 3 * np.pi), t_eval=times, **TIGHT)
    x, peak = A * np.sin(times), law.virgin_curve([A])[0]
    back = peak - 2 * law.virgin_curve(np.maximum((A - x) / 2, 0))
    up = -peak + 2 * law.virgin_curve(np.maximum((A + x) / 2, 0))
    first, second = times <= np.pi / 2, times <= 3 * np.pi / 2
    third = times <= 5 * np.pi / 2
    expected = np.select([first, second, third], [law.virgin_curve(np.abs(x)), back, up], back)
    np.testing.assert_allclose(run["force"], expected, atol=1e-10)
    # Three ways on which sliders give way and hold again, and half of one. The turns are events of no element.
    turns = run.catalogue.element == 0
    assert len(run.events) - turns.sum() == 6 * np.sum(strength * n < A) + np.sum(2 * strength * n < A)
    np.testing.assert_allclose(run.catalogue.t[turns], np.pi * np.array([0.5, 1.5, 2.5]), rtol=1e-12)
    with pytest.raises(ValueError, match="`prescribed_motion` takes it"):
        element_cloud(Coulomb(), position=sp.sin(t))


def test_a_blow_passes_from_ball_to_ball_as_newtons_law_has_it():
    n, e, taper, gap = 60, 0.85, 0.8, 0.05
    scene = granular_chain(n=n, restitution=e, taper=taper, gap=gap)
    run = scene.solve((0, 4), record=Recorder(), **TIGHT)
    log = run.catalogue
    speeds = ((1 + e) / (1 + taper)) ** np.arange(n)
    first = [log.t[log.element == k].min() for k in range(1, n)]
    np.testing.assert_allclose(first, np.cumsum(gap / speeds[:-1]), rtol=0, atol=1e-11)
    assert run[f"v_{n}"][-1] == pytest.approx(speeds[-1], rel=1e-12)
    assert run["momentum"][-1] == pytest.approx(1.0, abs=1e-12) and run["energy"][-1] < 0.5


def test_a_cradle_of_springs_or_of_rigid_balls_hands_its_speed_on():
    for stiffness in (None, 2000.0):
        run = granular_chain(n=12, stiffness=stiffness, speed=0.7).solve((0, 3), t_eval=[0, 3], **TIGHT)
        assert run.x[12:, -1] == pytest.approx([0.0] * 11 + [0.7], abs=1e-11)
    with pytest.raises(ValueError, match="leave it or `stiffness` out"):
        granular_chain(stiffness=1.0, restitution=0.5)
    with pytest.raises(ValueError, match="give 0 to 1"):
        granular_chain(restitution=1.5)


@pytest.mark.parametrize("n", [5, 30])  # written out, and one for all
def test_plates_come_to_rest_from_above_in_a_clamp_and_from_below_by_their_weight(n):
    k = np.arange(1, n + 1)
    for clamp, weight, joints, times in (
        (2.0, 0.0, k[::-1], k * (k + 1) / 2 * 0.15 / 2.0),
        (0.0, 0.5, k, k * 0.15 / 0.5),
    ):
        scene = plate_stack(n=n, m=1.5, shear=0.1, clamp=clamp, weight=weight)
        run = scene.solve((0, 60), **TIGHT)
        assert [event.switch for event in run.events] == [f"joint_{i}" for i in joints]
        assert run.event_times("stick") == pytest.approx(times, rel=1e-11)
        # What is left of the speeds of the joints falls by what rubs at the top, or at each plate.
        assert run["slip"][0] == pytest.approx(0.1 * n) and np.abs(run.x[n:, -1]).max() < 1e-14
    with pytest.raises(ValueError, match="give friction"):
        plate_stack(clamp=0)


@pytest.mark.parametrize(("k", "grows"), [(1.05, False), (0.95, True)])
def test_creep_of_sliders_is_stable_above_the_critical_stiffness(k, grows):
    scene = rate_state_train(n=4, k=k, coupling=0.3)
    run = scene.solve((0, 120), {"log_rate": 1e-6, "log_state": 0.0})
    sizes = np.abs(run["log_rate_1"])
    assert (sizes[-20:].max() > sizes[:20].max()) == grows
    assert run.x[:4, -1] == pytest.approx(run.x[0, -1], abs=1e-12)


def test_sliders_slip_one_by_one_unless_their_springs_let_only_all_of_them():
    n = 6
    together = 0.8 / (4 * np.sin(np.pi / (2 * n)) ** 2)
    spans = []
    for coupling in (0.0, 2 * together):
        run = rate_state_train(n=n, coupling=coupling).solve((0, 1400))
        times = np.array([event.time for event in run.events])[-n:]
        spans.append(np.ptp(times))
    assert spans[0] > 0.1 and spans[1] < 1e-6
    with pytest.raises(ValueError, match=r"`a` is 0\.03, `b` 0\.02; give a < b"):
        rate_state_train(a=0.03)
