"""Integration backward in time: what can be undone is undone, and the rest is named.

Guards: definition/reversal.py, paths/backward.py.
"""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Diffusion, Drive, Event, Memory, Outcome, System, Unilateral, solve

t, x, v = sp.symbols("t x v", real=True)
A, W, K, F = sp.symbols("A W K F", real=True)
FALL = Unilateral(x, restitution=0.8, name="R")
count = Memory("count", 0)


@pytest.mark.parametrize(
    "system, span, start",
    [
        (System({x: v, v: -sp.sin(x) + sp.cos(2 * t) / 3}, time=t), (0, 10), {x: 1, v: 0}),
        (System({x: v, v: -x - sp.sign(x) - sp.sign(v) / 10 + 2 * sp.cos(t)}, time=t), (0, 10), {x: 3, v: 0.3}),
        (System({x: v, v: -1 + FALL.reaction}), (0, 5), {x: 1, v: 0}),
        (System({x: v, v: -x - sp.floor(x) / 3}), (0.5, 20), {x: 2.1, v: 0.3}),
        (
            System(
                {x: v, v: -x},
                events=[Event(x, direction=1, update={count: count + 1, v: v * sp.Rational(9, 10) + t / 50})],
                time=t,
            ),
            (0, 20),
            {x: 1, v: 0},
        ),
        (
            System({x: v, v: -x}, events=[Event(every=1.5, update={x: x / 2 + v, v: v - x / 5})]),
            (0, 21),  # begins and ends with the clock
            {x: 1, v: 0},
        ),
        (
            System({x: v, v: -x}, events=[Event(at=[1, 2.5], when=v > 0, update={v: v + 1})]),
            (0, 5),
            {x: -1, v: 0},
        ),
    ],
)
def test_a_run_forward_and_back_ends_where_it_began(system, span, start):
    forward = solve(system, span, start)
    back = solve(system, span[::-1], dict(zip(system.states, forward.x[:, -1], strict=True)))
    assert back.outcome is Outcome.FINISHED
    assert (back.t[0], back.t[-1]) == span
    assert np.allclose(back.x[:, 0], forward.x[:, 0], atol=1e-8)
    assert back.x[:, -1].tolist() == forward.x[:, -1].tolist()
    assert back.itinerary == forward.itinerary
    events = [[(e.switch, e.kind, e.note) for e in run.events] for run in (forward, back)]
    assert events[0] == events[1]
    assert np.allclose([e.time for e in forward.events], [e.time for e in back.events], atol=1e-8)


def test_wanted_times_come_in_the_order_of_time():
    swing = System({x: v, v: -x})
    times = [0.0, 0.5, 2.0, 3.0]
    back = solve(swing, (3, 0), {x: math.cos(3), v: -math.sin(3)}, t_eval=times)
    assert back.t.tolist() == times
    assert np.allclose(back["x"], np.cos(times), atol=1e-9)


def test_wanted_times_may_be_those_of_the_clock():
    kicked = System({x: v, v: -x}, events=[Event(every=1, update={v: v + 1})])
    forward = solve(kicked, (0, 3), {x: 1, v: 0}, t_eval=[0, 0.5, 1.5, 3])
    back = solve(kicked, (3, 0), forward.x[:, -1], t_eval=[0, 0.5, 1.5, 3])
    assert back.t.tolist() == [0, 0.5, 1.5, 3]
    assert np.allclose(back.x, forward.x, atol=1e-8)


def test_a_stick_is_not_undone():
    """300 random friction oscillators: the run goes back to the last exit from a stick, else to the start."""
    slider = System(
        {x: v, v: -K * x - F * sp.sign(v) + A * sp.cos(W * t)},
        time=t,
        parameters=dict.fromkeys((A, W, K, F), 1),
    )
    rng = np.random.default_rng(3)
    ends = 0
    for _ in range(300):
        values = {
            A: rng.uniform(0.5, 3),
            W: rng.uniform(0.3, 2),
            K: rng.uniform(0.2, 3),
            F: rng.uniform(0, 1.2),
        }
        length = rng.uniform(1, 20)
        forward = solve(slider, (0, length), {x: rng.normal(), v: rng.normal()}, parameters=values)
        exits = [e.time for e in forward.events if e.kind.startswith("slip by")]
        wanted = length if forward.status[0, -1] == 0 else exits[-1] if exits else 0.0
        back = solve(slider, (length, 0), forward.x[:, -1], parameters=values)
        # A state to 1e-9 tells the instant of a tangency to its root.
        assert back.t[0] == pytest.approx(wanted, abs=1e-4)
        assert (back.outcome is Outcome.IRREVERSIBLE) == (wanted > 0)
        if wanted > 0:
            ends += 1
            assert [e.switch for e in back.events if e.time == back.t[0]] == ["sgn(v)"]  # the end is told once
            assert "Here: t = " in back.message
    assert ends > 50


def test_an_impact_without_rebound_is_not_undone():
    R = Unilateral(x, restitution=0, name="R")
    lifted = System({x: v, v: -1 + R.reaction + 2 * sp.Heaviside(t - 3)}, time=t)
    back = solve(lifted, (5, 0), solve(lifted, (0, 5), {x: 1, v: 0}).x[:, -1])
    assert back.outcome is Outcome.IRREVERSIBLE
    assert back.t[0] == pytest.approx(3, abs=1e-6)
    assert [e.switch for e in back.events if e.time == back.t[0]] == ["R"]


def test_a_memory_that_is_set_is_not_undone():
    latch = System({x: v, v: -x}, events=[Event(x - 0.5, direction=1, update={count: v}, name="latch")])
    back = solve(latch, (20, 0), solve(latch, (0, 20), {x: 1, v: 0}).x[:, -1])
    assert back.outcome is Outcome.IRREVERSIBLE
    assert [e.switch for e in back.events if e.time == back.t[0]] == ["latch"]
    assert back.t[0] == pytest.approx(2 * math.pi * 3 - math.pi / 3, abs=1e-8)


def test_the_last_instant_is_among_the_wanted_times():
    latch = System({x: v, v: -x}, events=[Event(x - 0.5, direction=1, update={count: v}, name="latch")])
    back = solve(latch, (20, 0), {x: math.cos(20), v: -math.sin(20)}, t_eval=[1, 18, 19])
    assert back.t.tolist() == pytest.approx([2 * math.pi * 3 - math.pi / 3, 18, 19], abs=1e-8)
    assert np.allclose(back["x"], np.cos(back.t), atol=1e-8)


@pytest.mark.parametrize(
    "make, said",
    [
        (lambda: solve(System({x: -sp.sign(x)}).smoothed(1e-3), (1, 0), {x: 1}), "smoothed view"),
        (lambda: solve(System({x: -x}), (1, 0), {x: 1}, dense_output=True), "no `dense_output`"),
        (
            lambda: solve(System({x: -x}), (1, 0), {x: 1}, noise=Diffusion({x: 1}, step=0.1, seed=1)),
            "no `noise`",
        ),
        (
            lambda: solve(System({x: -v}, drives={v: Drive([0, 1], [0, 1], "line")}), (1, 0), {x: 1}),
            "drive 'v'",
        ),
        (
            lambda: solve(System({x: 1}, events=[Event(x - 1, update={x: 0})]), (1, 0), {x: 1}),
            "cannot be undone",
        ),
        (
            lambda: solve(System({x: 1}, events=[Event(x - 1, update={x: x**3})]), (1, 0), {x: 1}),
            "cannot be undone",
        ),
        (lambda: solve(System({x: -x}), (1, 1), {x: 1}), "times that differ"),
    ],
)
def test_what_has_no_reverse_is_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()


# ---- what is returned leads forward to the start


def test_a_past_that_passes_where_an_event_would_have_acted_is_none():
    # The relay moves its own threshold: between its switchings the motion backward comes to where it would switch.
    x, v = sp.symbols("x v", real=True)
    q, m = Memory("q", 1), Memory("m", 1)
    relay = System({x: v, v: -v - x + m}, events=[Event(x - q, update={m: -m, q: -q})])
    end = solve(relay, (0, 5), {x: 0, v: 1}).x[:, -1]
    back = solve(relay, (5, 0), end)
    if back.success:
        np.testing.assert_allclose(solve(relay, (0, 5), back.x[:, 0]).x[:, -1], end, atol=1e-6)
    else:
        assert back.outcome.name == "IRREVERSIBLE"


def test_the_event_with_which_a_run_ends_is_undone_first():
    # x' = v from 0.5 reaches 1 (v -> -1), then 0 at t = 1.5, where the terminal event makes v = 1.
    x, v = sp.symbols("x v", real=True)
    ends = [Event(x - 1, update={v: -v}, name="top"), Event(x, update={v: -v}, terminal=True, name="floor")]
    walk = System({x: v, v: 0}, events=ends)
    there = solve(walk, (0, 9), {x: 0.5, v: 1})
    back = solve(walk, (there.t[-1], 0), there.x[:, -1])
    np.testing.assert_allclose(back.x[:, 0], [0.5, 1], atol=1e-9)
    np.testing.assert_allclose(back.x[:, -1], [0, 1], atol=1e-12)
    assert [e.switch for e in back.events] == ["top", "floor"]


def test_a_past_that_begins_on_the_surface_of_an_event_begins_behind_it():
    # Forward a start on a surface is no event: from (1, -1) x falls to 0.5 within 0.5, and so it does backward.
    x, v = sp.symbols("x v", real=True)
    walk = System({x: v, v: 0}, events=[Event(x - 1, update={v: -v}, name="top")])
    back = solve(walk, (0.5, 0), {x: 0.5, v: -1})
    np.testing.assert_allclose(back.x[:, 0], [1, -1], atol=1e-9)
