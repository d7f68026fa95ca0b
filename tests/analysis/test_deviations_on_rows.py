"""Deviations on the polynomials that a run has kept, beside those whose series flow.py makes again.

Guards: codegen/machine/columns.py, codegen/jacobian.py, kernels/tangent/growth.py, kernels/tangent/flow.py.
"""

import dataclasses

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Switch, System, Unilateral, solve
from pwsmooth.paths.derivatives.growth import growth

t, x, v, z, u, w = sp.symbols("t x v z u w", real=True)
a, b = sp.symbols("a b", positive=True)


def hidden():
    """Sticks, hidden folds, and a memory of the multiplier."""
    lam = Switch("lam", v)
    rates = {x: v, v: -a * sp.sin(t) - x - v / 10 - lam * (1 + z), z: 10 * (b * (1 - lam**2) - z)}
    return System(rates, time=t, parameters={a: 2.4, b: 3}), {x: 0.5, v: 0.3, z: 0}, 30


def coupled():
    """Two switches that slide together, each in the other's rate, with products of states."""
    one, two = Switch("one", v), Switch("two", w)
    rates = {
        x: v,
        v: sp.sin(2 * t) - x + u * x / 4 - one - two / 4,
        u: w,
        w: sp.cos(t) - u * (1 + v**2) - b * two - a * one / 5,
    }
    return System(rates, time=t, parameters={a: 1, b: 0.6}), {x: 0.5, v: 0.3, u: 0.1, w: 0.2}, 20


def contact():
    """Impacts and a closed contact, which is held by an acceleration."""
    stop = Unilateral(x, restitution=0, name="stop")
    rates = {x: v, v: a * sp.cos(t) - 1 + stop.reaction, u: v * u - b * u}
    return System(rates, time=t, parameters={a: 1.5, b: 0.6}), {x: 1, v: 0, u: 1}, 20


CASES = {case.__name__: case for case in (hidden, coupled, contact)}


@pytest.fixture(params=[*CASES])
def tapes(request):
    system, start, end = CASES[request.param]()
    run = solve(system, (0, end), start, by=[*start, a, b], rtol=1e-10, atol=1e-12)
    return run.tape, dataclasses.replace(run.tape, dense=None), run


def both(tapes, columns, times=None, tolerance=1.0):
    rng = np.random.default_rng(3)
    n, count = len(tapes[0].model.states), len(tapes[0].p)
    start, seeds = rng.normal(size=(n, columns)), rng.normal(size=(count, columns))
    tapes = [dataclasses.replace(tape, rtol=tape.rtol * tolerance) for tape in tapes[:2]]
    return [tape.deviations(start, seeds, times) for tape in tapes]


@pytest.mark.parametrize("columns", [1, 6, 19])
def test_programs_of_columns_agree_with_the_series_of_jacobians(tapes, columns):
    times = np.linspace(0, tapes[0].values[-1, 0], 301)
    on_rows, again = both(tapes, columns, times)
    for name in ("end", "at_point", "at_sample", "instant_dt", "instant_w"):
        one, other = getattr(on_rows, name), getattr(again, name)
        assert np.abs(one - other).max() <= 1e-11 * np.abs(other).max(), name


def test_steps_that_are_split_agree(tapes):
    """At a tolerance that no step as a whole keeps polynomials are taken around places inside of a step."""
    finer = both(tapes, 6, tolerance=1e-6)
    for one, other in zip(finer, both(tapes, 6)):
        assert np.abs(one.end - other.end).max() <= 1e-8 * np.abs(other.end).max()
    assert np.abs(finer[0].end - finer[1].end).max() <= 1e-11 * np.abs(finer[1].end).max()


@pytest.mark.parametrize("count", [1, 2])
def test_growth_agrees(tapes, count):
    frame = np.linalg.qr(np.random.default_rng(4).normal(size=(len(tapes[0].model.states), count)))[0]
    on_rows, again = (growth(tape, frame) for tape in tapes[:2])
    finite = np.isfinite(again.log) & (again.log > -20)  # what is annihilated is left as roundings
    assert on_rows.t == pytest.approx(again.t, rel=1e-14)
    assert on_rows.log[finite].sum() == pytest.approx(again.log[finite].sum(), rel=1e-9)


def test_slopes_of_a_cost_agree(tapes):
    from pwsmooth.paths.derivatives.tangents import Readings

    n, m = len(tapes[0].model.states), len(tapes[0].model.multipliers)
    cost = Readings(np.ones(n), np.empty(0), np.empty((0, n + m)), np.empty(0, int), np.empty((0, 2 * n + 1)))
    on_rows, again = (tape.pull_back(cost) for tape in tapes[:2])
    assert on_rows.start == pytest.approx(again.start, rel=1e-10, abs=1e-10)
    assert on_rows.parameters == pytest.approx(again.parameters, rel=1e-10, abs=1e-10)


def test_a_run_too_long_for_rows_makes_them_again(monkeypatch):
    """Buffers that would grow beyond a bound are given up in the middle of the run."""
    from pwsmooth.paths import event_driven

    c = sp.Symbol("c", positive=True)  # another model, so that nothing is ready
    swing = System({x: v, v: c * sp.cos(t) - x**3 - sp.sign(v) / 2}, time=t, parameters={c: 1.2})
    run = swing, (0, 800), {x: 1, v: 0}
    kept = solve(*run, by=[c], rtol=1e-9)
    assert kept.tape.dense is not None and len(kept.tape.dense) > 1024
    monkeypatch.setattr(event_driven, "_MOST_ROWS", 8 * 3 * 23 * 1500)
    short = solve(*run, by=[c], rtol=1.0000001e-9)
    assert short.tape.dense is None
    assert short.derivatives.end == pytest.approx(kept.derivatives.end, rel=1e-5)
