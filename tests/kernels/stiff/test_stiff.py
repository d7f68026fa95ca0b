"""The smoothed path: order, accuracy, layers that are never stepped over, events, failures.

Guards: kernels/stiff/.
"""

import dataclasses
import functools

import numpy as np
import pytest
import sympy as sp
from stiff_models import PERIOD, dense_relaxation, friction, slowed_chain, two_blocks, values

from pwsmooth.codegen.machine import units
from pwsmooth.codegen.machine.cache import load_kernels
from pwsmooth.codegen.stiff import functions as codegen
from pwsmooth.definition.model import EventSpec, Model
from pwsmooth.paths import stiff_steps as stiff
from pwsmooth.paths.budget import Budget
from pwsmooth.results.records import Outcome

t, x, y, v, k = sp.symbols("t x y v k", real=True)
START = (0.5, 0.3, 0.0)


def end(model, span, start, p, **options):
    run = stiff.integrate(model, span, start, p, **options)
    assert run.status == Outcome.FINISHED
    return run.x[:, -1]


# -- order and accuracy ----------------------------------------------------------------------------


@pytest.mark.parametrize(("method", "order", "steps"), [("radau5", 5, (40, 80)), ("radau9", 9, (12, 24)),
                                                        ("radau13", 13, (10, 16))])  # fmt: skip
def test_the_observed_order_is_the_declared_one(method, order, steps):
    forced = Model(t, (x, v), (), (v, sp.sin(2 * t) - 36 * x))
    exact = np.cos(24.0) - np.sin(24.0) / 96 + np.sin(8.0) / 32
    errors = []
    for n in steps:
        # Far looser than the error, so that the longest step rules; the problem is linear, Newton is exact.
        options = dict(method=method, rtol=1e-3, atol=1e9, first_step=4.0 / n, max_step=4.0 / n)
        errors.append(abs(end(forced, (0, 4.0), (1.0, 0.0), (), **options)[0] - exact))
    assert np.log(errors[0] / errors[1]) / np.log(steps[1] / steps[0]) == pytest.approx(order, abs=0.7)


@pytest.mark.parametrize(("eps", "beta", "maximum"), [(0.1, 0.1, 1.2808), (0.001, 0.001, 1.1615)])
def test_the_published_smoothed_orbits_are_met(eps, beta, maximum):
    # Independent values of the specification, to half a unit of the last digit.
    grid = np.linspace(150 * PERIOD, 151 * PERIOD, 2001)
    run = stiff.integrate(friction(), (0, grid[-1]), START, values(eps, beta), rtol=1e-8, t_eval=grid)
    assert run.x_eval[0].max() == pytest.approx(maximum, abs=0.5e-4 + 1e-5)


@functools.cache
def scipy_at_nine(sigmoid):
    p = values(1e-2, 1e-2)
    return stiff.integrate_scipy(friction(sigmoid), (0, 9.0), START, p, rtol=1e-10, atol=1e-11).y[:, -1]


@pytest.mark.parametrize("sigmoid", ["algebraic", "tanh", "erf"])
@pytest.mark.parametrize("method", ["auto", "radau5", "radau9", "radau13", "taylor"])
def test_the_tolerance_of_the_user_is_honoured(sigmoid, method):
    p = values(1e-2, 1e-2)
    reference = scipy_at_nine(sigmoid)
    for rtol in (1e-4, 1e-7):
        found = end(friction(sigmoid), (0, 9.0), START, p, rtol=rtol, atol=rtol, method=method)
        assert np.abs(found - reference).max() < 5 * rtol


def test_inside_the_steps_the_tolerance_holds_too():
    p, grid = values(1e-3, 1e-3), np.linspace(0, 12.0, 400)
    reference = stiff.integrate(friction(), (0, 12.0), START, p, rtol=1e-12, atol=1e-14, t_eval=grid).x_eval
    run = stiff.integrate(friction(), (0, 12.0), START, p, rtol=1e-7, atol=1e-7, t_eval=grid, dense=True)
    starts = np.array([d[0] for d in run.dense])
    for j, i in enumerate(np.clip(np.searchsorted(starts, grid, side="right") - 1, 0, None)):
        t0, h, c = run.dense[i]
        assert np.allclose(c @ ((grid[j] - t0) / h) ** np.arange(c.shape[1]), run.x_eval[:, j], atol=1e-12)
    assert np.abs(run.x_eval - reference).max() < 1e-6


@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA", "DOP853"])
def test_scipy_agrees_on_surfaces_that_are_no_states(method):
    p, start = (1e-2, 3e-2), (0.0, 0.5, 0.2, -0.3)
    found = end(two_blocks(), (0, 6.0), start, p, rtol=1e-9, atol=1e-11)
    other = stiff.integrate_scipy(two_blocks(), (0, 6.0), start, p, method=method, rtol=1e-10, atol=1e-12)
    assert np.abs(found - other.y[:, -1]).max() < 1e-6


@pytest.mark.parametrize(
    ("model", "p"), [(slowed_chain(6), [1e-3]), (dense_relaxation(14), [1e3])], ids=["12", "dense"]
)
def test_larger_systems_run_whether_their_elimination_is_written_out_or_not(model, p):
    start = np.linspace(-0.5, 0.8, len(model.states))
    found = end(model, (0, 3.0), start, p, rtol=1e-8, atol=1e-10)
    other = stiff.integrate_scipy(model, (0, 3.0), start, p, rtol=1e-10, atol=1e-12)
    assert np.abs(found - other.y[:, -1]).max() < 1e-6


def test_a_model_with_kinks_runs_on_radau_alone():
    stop = Model(t, (x, v), (), (v, -sp.Max(x, 0) * 1e4 - v - 1))
    run = stiff.integrate(stop, (0, 2.0), (0.3, 0.0), (), rtol=1e-9)
    other = stiff.integrate_scipy(stop, (0, 2.0), (0.3, 0.0), (), rtol=1e-11, atol=1e-13)
    assert run.counters["taylor_steps"] == 0 and np.abs(run.x[:, -1] - other.y[:, -1]).max() < 1e-7


# -- layers ----------------------------------------------------------------------------------------

# Found among 18 000 random starts: the stages predicted from outside fell into the layer, and one Newton
# iteration that never looked at f there was taken for convergence.
UNSEEN_LAYER = {
    "p": [3.534738222282159, 8.660641710177789e-4, 1.5184034752673297, 0.1, 1.0, 1.389231148017657, 1.0, 1e-4],
    "start": (0.26354497903216445, 0.07355987252483098, 0.0),
    "t0": 0.7723589580290104,
}


@pytest.mark.parametrize("method", ["auto", "radau5", "radau9", "radau13"])
def test_f_is_looked_at_where_the_stages_end(method):
    p, t0 = UNSEEN_LAYER["p"], UNSEEN_LAYER["t0"]
    span = (t0, t0 + 1.5 * PERIOD)
    reference = end(friction("erf"), span, UNSEEN_LAYER["start"], p, rtol=1e-11, atol=1e-14)
    found = end(friction("erf"), span, UNSEEN_LAYER["start"], p, rtol=1e-3, atol=1e-6, method=method)
    assert np.abs(found - reference).max() < 0.01  # stepping over costs 0.42


@pytest.mark.parametrize("sigmoid", ["algebraic", "tanh", "erf"])
def test_no_sign_change_is_accepted_from_outside_the_layer(sigmoid):
    eps = 1e-5
    p, gate = values(eps, eps), load_kernels("stiff.gate")
    for rtol in (1e-3, 1e-6):
        v_path = stiff.integrate(friction(sigmoid), (0, 4 * PERIOD), START, p, rtol=rtol).x[1]
        before, after = v_path[:-1], v_path[1:]
        moved = np.where(before > 0, before - after, after - before)
        assert (moved <= gate.THETA * (np.abs(before) + gate.REACH * eps) * (1 + 1e-12)).all()
        assert (before * after < 0).any()


# From (1 + kappa*eps, -2) x dips to kappa*eps; in the layer a term of size 1 acts for a time of about sqrt(eps) on v.
DIP = Model(t, (x, v), (y, k), (v, 2 + 300 * sp.exp(-((x / y) ** 2))), smoothing=((x, y),))


@pytest.mark.parametrize("method", ["auto", "radau5", "radau9", "taylor"])
def test_no_step_towards_a_layer_is_longer_than_the_way_to_it_allows(method):
    # R2: 0.9 theta (|h| + C eps) / |dh/dt| with h = x and dh/dt = v, where |h| > C eps.
    eps, gate = 1e-5, load_kernels("stiff.gate")
    run = stiff.integrate(DIP, (0, 2.0), (1.0, -2.0), (eps, 0.0), rtol=1e-3, atol=1e-3, method=method)
    h, rate = run.x[:, :-1]
    towards = (h * rate < 0) & (np.abs(h) > gate.REACH * eps)
    limit = 0.9 * gate.THETA * (np.abs(h) + gate.REACH * eps)[towards] / np.abs(rate)[towards]
    length = np.diff(run.t)[towards]
    rounding = 2 * np.spacing(run.t[-1])
    assert len(length) > 10 and (length <= limit + rounding).all()


def test_a_layer_that_is_touched_tangentially_is_seen_at_the_loosest_tolerance():
    for eps in (1e-3, 1e-5, 1e-7):
        for kappa in (-1.5, 0.0, 1.0):
            start = (1 + kappa * eps, -2.0)
            reference = end(DIP, (0, 2.0), start, (eps, 0.0), rtol=1e-11, atol=1e-14)
            for method in ("auto", "radau9", "taylor"):
                found = end(DIP, (0, 2.0), start, (eps, 0.0), rtol=1e-3, atol=1e-3, method=method)
                kick = abs(reference[1] - 2.0)
                assert np.abs(found - reference).max() < 0.02 + 0.1 * kick


# -- events ----------------------------------------------------------------------------------------

BALL = Model(t, (y, v), (k,), (v, -sp.Rational(981, 100)),
             events=(EventSpec("bounce", surface=y, direction=-1, update=((1, -k * v),)),))  # fmt: skip


@pytest.mark.parametrize("method", ["auto", "radau5", "radau9", "radau13"])
def test_a_bouncing_ball_bounces_when_it_should(method):
    run = stiff.integrate(BALL, (0, 5.0), (1.0, 0.0), [0.9], rtol=1e-10, atol=1e-12, method=method)
    fall = np.sqrt(2 / 9.81)
    expected = [fall * (1 + 2 * sum(0.9**j for j in range(1, i + 1))) for i in range(len(run.events))]
    assert len(expected) == 8 and np.allclose([e[0] for e in run.events], expected, atol=1e-12, rtol=0)
    instant, index, before, after = run.events[2]
    assert index == 0 and after[1] == -0.9 * before[1]
    at = np.flatnonzero(run.t == instant)
    assert len(at) == 2 and (run.x[:, at] == np.column_stack([before, after])).all()


def test_events_of_time_keep_their_instants_and_surfaces_their_directions():
    events = (
        EventSpec("tick", every=k, update=((2, x + 1),)),
        EventSpec("rising", surface=y, direction=1),
        EventSpec("at", at=(sp.Integer(2), 20 * k), update=((2, x + 100),)),
        EventSpec("off", surface=y, when=x > 1e9, update=((2, sp.Integer(-1)),)),
        EventSpec("last", surface=v - sp.Rational(1, 2), direction=-1, when=t > 15, terminal=True),
    )
    turning = Model(t, (y, v, x), (k,), (v, -y, sp.S.Zero), n_memory=1, events=events)
    for method in ("auto", "radau9"):
        run = stiff.integrate(
            turning, (0, 100.0), (0.0, 1.0, 0.0), [0.7], rtol=1e-11, atol=1e-12, method=method
        )
        by_name = {e.name: [r[0] for r in run.events if r[1] == i] for i, e in enumerate(events)}
        last = 5 * np.pi + 4 * np.pi / 3
        assert run.status == Outcome.TERMINATED and run.t[-1] == pytest.approx(last, abs=1e-9)
        assert by_name["tick"] == [0.7 * i for i in range(1, 29)]
        assert by_name["at"] == [2.0, 14.0] and by_name["off"] == []
        assert np.allclose(by_name["rising"], [2 * np.pi, 4 * np.pi, 6 * np.pi], atol=1e-9)
        assert run.x[2, -1] == 28 + 200  # at t = 14 both act, and increments of one instant add up


def test_what_an_update_carries_through_zero_fires_at_the_same_instant():
    events = (EventSpec("first", surface=x - 1, direction=1, update=((1, y + 2),)),
              EventSpec("second", surface=y - 1, direction=1, update=((2, v + y),)))  # fmt: skip
    chain = Model(t, (x, y, v), (), (sp.S.One, sp.S.Zero, sp.S.Zero), n_memory=2, events=events)
    run = stiff.integrate(chain, (0, 2.0), (0.0, 0.0, 0.0), ())
    assert [e[:2] for e in run.events] == [(pytest.approx(1.0), 0), (pytest.approx(1.0), 1)]
    assert run.x[:, -1].tolist() == [2.0, 2.0, 2.0]


def test_events_that_call_each_other_for_ever_are_an_outcome():
    flips = (
        EventSpec("start", surface=x - 1, update=((1, -y),)),
        EventSpec("there", surface=y, update=((2, -v),)),
        EventSpec("back", surface=v, update=((1, -y),)),
    )
    loop = Model(t, (x, y, v), (), (sp.S.One, sp.S.Zero, sp.S.Zero), n_memory=2, events=flips)
    run = stiff.integrate(loop, (0, 2.0), (0.0, 1.0, 1.0), ())
    assert run.status == Outcome.EVENT_LOOP and run.t[-1] <= 1.0 and run.events == []


# -- the run itself --------------------------------------------------------------------------------


def test_the_bits_do_not_depend_on_the_chunks(monkeypatch):
    p = values(1e-3, 1e-3)
    whole = stiff.integrate(friction(), (0, 10.0), START, p, rtol=1e-6, dense=True)
    monkeypatch.setattr(stiff, "_CHUNK", 7)
    pieces = stiff.integrate(friction(), (0, 10.0), START, p, rtol=1e-6, dense=True)
    assert (whole.t == pieces.t).all() and (whole.x == pieces.x).all() and len(whole.t) > 50
    assert all((a[2] == b[2]).all() for a, b in zip(whole.dense, pieces.dense, strict=True))


def test_failures_are_outcomes_with_what_was_reached():
    bounded = stiff.integrate(friction(), (0, 50.0), START, values(1e-4, 1e-4), spending=Budget(40))
    assert bounded.status == Outcome.TOO_MANY_STEPS and 0 < bounded.t[-1] < 50
    explosion = Model(t, (x,), (), (x**2,))
    run = stiff.integrate(explosion, (0, 2.0), (1.0,), (), rtol=1e-8)
    assert run.status in (Outcome.STEP_UNDERFLOW, Outcome.NOT_FINITE) and run.t[-1] == pytest.approx(
        1.0, abs=1e-6
    )
    root = Model(t, (x,), (), (-1 - sp.sqrt(x),))
    for method in ("auto", "radau9"):
        run = stiff.integrate(root, (0, 2.0), (0.5,), (), method=method)
        assert run.status in (Outcome.STEP_UNDERFLOW, Outcome.NOT_FINITE) and np.isfinite(run.x).all()


@pytest.mark.parametrize("method", ["radau5", "radau9", "radau13"])
@pytest.mark.parametrize(("model", "start", "p"), [
    (friction(), START, values(1e-2, 1e-2)), (friction("erf"), START, values(1e-3, 1e-1)),
    (two_blocks(), (0.0, 0.5, 0.2, -0.3), (1e-2, 3e-2)),
], ids=["friction", "erf", "two blocks"])  # fmt: skip
def test_the_attempt_written_out_and_the_general_one_agree(monkeypatch, model, start, p, method):
    # A few steps: later, rounding tips a decision between two iterations now and then.
    options = dict(rtol=1e-7, atol=1e-7, method=method)
    fast = stiff.integrate(model, (0, 6.0), start, p, spending=Budget(20), **options)
    compiled = codegen.compile_stiff(model)
    assert compiled.written_out
    plain = dataclasses.replace(compiled, written_out=False)
    monkeypatch.setattr(codegen, "compile_stiff", lambda model: plain)
    general = stiff.integrate(model, (0, 6.0), start, p, spending=Budget(20), **options)
    assert fast.counters == general.counters
    # Lengths of steps come from error estimates, in which what cancels leaves about 1e-8 of relative rounding.
    assert np.allclose(fast.t, general.t, rtol=1e-6) and np.allclose(fast.x, general.x, rtol=1e-6, atol=1e-9)


def test_stages_are_predicted_well_enough_that_an_iteration_or_two_suffice():
    pendulum = Model(t, (x, v), (), (v, -sp.sin(x)))
    for method in ("radau5", "radau9", "radau13"):
        cost = stiff.integrate(pendulum, (0, 20.0), (1.0, 0.0), (), rtol=1e-8, method=method).counters
        assert cost["newton"] < 2.6 * (cost["steps"] + cost["rejected"])


def test_a_second_model_costs_the_core_nothing():
    before = units.stiff_loop()
    end(two_blocks("algebraic"), (0, 1.0), (0.0, 0.5, 0.2, -0.3), (1e-2, 1e-2))
    assert units.stiff_loop() is before


def test_bad_methods_are_refused_with_what_there_is():
    with pytest.raises(ValueError, match="'rk45'.*auto, radau5"):
        stiff.integrate(friction(), (0, 1), START, values(1, 1), method="rk45")
    with pytest.raises(ValueError, match="recurrence"):
        stiff.integrate(Model(t, (x,), (), (-sp.Max(x, 0),)), (0, 1), (1.0,), (), method="taylor")
    with pytest.raises(ValueError, match="without events"):
        stiff.integrate_scipy(BALL, (0, 1), (1.0, 0.0), [0.9])
    with pytest.raises(ValueError, match="'Euler'"):
        stiff.integrate_scipy(friction(), (0, 1), START, values(1, 1), method="Euler")
