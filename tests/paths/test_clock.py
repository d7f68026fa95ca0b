"""Instants that are known are numbers: clocks, and the jumps of Mod, floor, frac and signs of a sine in time.

Right answers are closed forms, given beside each.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Memory, System, solve

t, x, y = sp.symbols("t x y", real=True)
T, d = sp.Symbol("T", positive=True), sp.Symbol("d", real=True)
n = Memory("n", 0)
EVERY_METHOD = pytest.mark.parametrize("method", ["auto", "rk", "stiff"])
ON = sp.Piecewise((1, sp.Mod(t, T) < d * T), (0, True))


def at_the_end_of_a_period(period, duty, k):
    """x of x' = on - x from 0 after k periods: the sum of the pulses."""
    return (np.exp(duty * period) - 1) / (np.exp(period) - 1) * (1 - np.exp(-k * period))


@EVERY_METHOD
@pytest.mark.parametrize("duty", [0, 1e-9, 0.3, 1 - 1e-13, 1])
def test_pulses_are_right_from_no_duty_to_full_duty(duty, method):
    system = System({x: ON - x}, time=t, parameters={T: 1, d: sp.Rational(1, 2)})
    for period in (1.2, 0.37, 0.1):
        run = solve(system, (0, 30 * period), {x: 0}, parameters={T: period, d: duty}, method=method)
        want = at_the_end_of_a_period(period, duty, 30)
        assert run["x"][-1] == pytest.approx(want, abs=1e-10, rel=1e-6)


def test_a_controller_that_saturates_is_on_all_the_time():
    # 2 (1 - exp(-t)) stays below 0.8 up to 0.5, where 5 (1 - x) > 1.
    duty = sp.Max(0, sp.Min(1, 5 * (1 - x)))
    heater = System(
        {x: 2 * sp.Piecewise((1, sp.frac(t / T) < duty), (0, True)) - x}, time=t, parameters={T: 0.05}
    )
    for period in (0.05, 0.03, 0.01):
        got = solve(heater, (0, 0.5), {x: 0}, parameters={T: period})["x"][-1]
        assert got == pytest.approx(2 * (1 - np.exp(-0.5)), abs=1e-9)


@EVERY_METHOD
def test_a_clock_and_the_jumps_of_mod_are_one_instant(method):
    system = System(
        {x: ON - x}, time=t, parameters={T: 0.37, d: 1 / 3}, events=[Event(every=T, update={n: n + 1})]
    )
    for period in (0.37, 0.1, 1.1):
        run = solve(system, (0, 100 * period), {x: 0}, parameters={T: period}, method=method)
        assert run.success and run["n"][-1] == 100
        assert run["x"][-1] == pytest.approx(at_the_end_of_a_period(period, 1 / 3, 100), abs=1e-9)


@EVERY_METHOD
def test_a_clock_ticks_where_a_sine_changes_its_sign(method):
    wave = System(
        {x: sp.sign(sp.sin(sp.pi * t / T))},
        time=t,
        parameters={T: 1},
        events=[Event(every=T, update={n: n + 1})],
    )
    for half in (1.0, 0.7, np.pi):
        run = solve(wave, (0, 100 * half), {x: 0}, parameters={T: half}, method=method)
        assert run.success and run["n"][-1] == 100 and run["x"][-1] == pytest.approx(0, abs=1e-9)


def test_narrow_pulses_keep_their_width():
    system = System(
        {x: sp.Piecewise((1 / d, sp.Mod(t, T) < d), (0, True))}, time=t, parameters={T: 24, d: 1e-8}
    )
    assert solve(system, (0, 200), {x: 0})["x"][-1] == pytest.approx(9, abs=1e-3)


def test_jumps_of_shifted_and_falling_ramps_are_known_too():
    # frac(a - t) < 1/4 over 8 periods, from any shift: two time units.
    shift = sp.Symbol("shift", real=True)
    for ramp in (
        sp.frac(t - shift),
        sp.frac(shift - t),
        sp.Mod(t + shift, 1),
        1 - sp.ceiling(t + shift) + t + shift,
    ):
        low = System(
            {x: sp.Piecewise((1, ramp < sp.Rational(1, 4)), (0, True))}, time=t, parameters={shift: 0.3}
        )
        for at in (0.0, 0.3, -1.7):
            for start in (0.0, 0.3, 5.7):
                run = solve(low, (start, start + 8), {x: 0}, parameters={shift: at})
                assert run["x"][-1] == pytest.approx(2, abs=1e-12)


def test_an_update_at_a_tick_reads_a_function_of_time_from_there_on():
    # floor(3) = 3, whichever rate stands beside it.
    tick = Event(every=1, update={n: sp.floor(t)})
    for rate in (1, sp.floor(t), sp.floor(t / 2)):
        for method in ("auto", "stiff"):
            run = solve(System({x: rate}, time=t, events=[tick]), (0, 3.5), {x: 0}, method=method)
            assert run["n"][-1] == 3


@pytest.mark.parametrize("every", [0.1, 0.2, 0.6])
def test_the_tick_at_the_end_of_a_span_strikes_once_whatever_the_rounding(every):
    system = System({x: 1}, parameters={T: every}, events=[Event(every=T, update={n: n + 1})])
    for k in range(1, 13):
        end = round(k * every, 10)
        run = solve(system, (0, end), {x: 0})
        assert run["n"][-1] == k
        assert solve(system, (end, end + every / 2), run.x[:, -1])["n"][-1] == k


def test_derivatives_pass_jumps_that_are_known():
    # x(k T) for x' = on - x by the closed form, differenced by hand.
    system = System({x: ON - x}, time=t, parameters={T: 0.5, d: 0.3})
    run = solve(system, (0, 3.1), {x: 0}, by=["T", "d"])
    h = 1e-6
    for j, p in enumerate((T, d)):
        values = {T: 0.5, d: 0.3}
        ends = [
            solve(system, (0, 3.1), {x: 0}, parameters={p: values[p] + e}, rtol=1e-12)["x"][-1] for e in (-h, h)
        ]
        assert run.derivatives.end[0, j] == pytest.approx((ends[1] - ends[0]) / (2 * h), abs=1e-6)


# ---- at the start of a run


def test_instants_that_are_given_act_at_a_start():
    # Doses of 100 at 0, 12 and 24 that decay as exp(-t/10); so also from t = 12 on, and by a guard that holds there.
    want = 100 * np.exp([-3, -1.8, -0.6])
    dosed = System({x: -x / 10}, events=[Event(at=[0, 12, 24], update={x: x + 100}, name="dose")])
    struck = System({x: -x / 10 + sum(100 * sp.DiracDelta(t - k) for k in (0, 12, 24))}, time=t)
    for system in (dosed, struck):
        for method in ("auto", "rk"):
            run = solve(system, (0, 30), {x: 0}, method=method, t_eval=[0, 30])
            np.testing.assert_allclose(run["x"], [100, want.sum()], rtol=1e-9)
        assert solve(system, (12, 30), {x: 0})["x"][-1] == pytest.approx(want[1:].sum(), rel=1e-9)
        derived = solve(system, (0, 30), {x: 1}, by=["x"])
        assert derived.derivatives.end[0, 0] == pytest.approx(np.exp(-3), rel=1e-9)
    assert solve(dosed, (0, 30), {x: 0}).event_times(switch="dose").tolist() == [0, 12, 24]
    with pytest.raises(ValueError, match="event 'dose' happens at the start t = 0.*leave this instant out"):
        solve(dosed, (0, 30), {x: 0}, method="stiff")


def test_a_solution_is_continued_behind_what_happened_at_its_end():
    dosed = System({x: -x / 10, y: 1}, events=[Event(at=[0, 12, 24], update={x: x + 100, n: n + 1})])
    whole = solve(dosed, (0, 30), {x: 0, y: 0})
    parts = solve(dosed, (0, 12), {x: 0, y: 0})
    parts = solve(dosed, (12, 30), parts)
    np.testing.assert_allclose(parts.x[:, -1], whole.x[:, -1], rtol=1e-12)
    assert parts["n"][-1] == 3
    with pytest.raises(ValueError, match="ends at t = 30, and `t_span` begins at 12"):
        solve(dosed, (12, 40), parts)


def test_a_past_undoes_what_is_given_for_its_beginning():
    dosed = System({x: -x / 10}, events=[Event(at=[0, 12], update={x: x + 100})])
    later = solve(dosed, (0, 20), {x: 7}).x[:, -1]
    assert solve(dosed, (20, 0), later).x[0, 0] == pytest.approx(7, abs=1e-6)
