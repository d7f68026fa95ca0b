"""Diffusions on families: loops over their elements, with a source of each element or one of all.

Guards: noise/amplitudes.py, noise/lowering.py, noise/diffusion_path.py.
"""

import math
import warnings

import numpy as np
import pytest
import sympy as sp
from family_models import template_from

from pwsmooth import Diffusion, Event, Family, System, solve
from pwsmooth.codegen import compile_model
from pwsmooth.noise.diffusion_run import DiffusionRun
from pwsmooth.paths.event_driven import EventDriven
from pwsmooth.studies import ensemble

t, u = sp.symbols("t u", real=True)


@pytest.fixture(autouse=True)
def quiet():
    """That noise on a surface leaves no sticking is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


def blocks(n, periodic=False, law=sp.sign):
    """(family, place, velocity, System): blocks on a belt, linked by springs, of their own strength."""
    family = Family(n, periodic)
    x, v = family.symbols("x v")
    (mu,) = family.symbols("mu", positive=True)
    pull = family.neighbour(x, 1) + family.neighbour(x, -1) - 2 * x
    rates = {x: v, v: pull - x / 4 - mu * law(v - u) - v / 9}
    values = {mu: [0.3 + 0.01 * k for k in range(n)], u: 0.2}
    return family, x, v, System(rates, time=t, parameters=values)


def both(system, span, start, noise):
    """Paths with loops and written out, and the looped run's model."""
    run = DiffusionRun(system, noise)
    assert run.lowered.model.families is not None
    return [solve(each, span, start, noise=noise) for each in (system, system._written_out())]


def spread(n):
    return np.sin(np.arange(n)).tolist()


AMPLITUDES = {
    "constant": lambda x, v, mu: {v: 0.1},
    "its own parameter": lambda x, v, mu: {v: mu / 3},
    "of time": lambda x, v, mu: {v: sp.cos(t) / 9, x: sp.Rational(1, 20)},
    "of another state": lambda x, v, mu: {v: sp.sqrt(1 + x**2) / 9},
    "of its state": lambda x, v, mu: {v: sp.sqrt(1 + v**2) / 9},
    "one of all": lambda x, v, mu: {v: {"all": 0.1 + x**2 / 50}},
    "both": lambda x, v, mu: {v: {"v": 0.1, "all": mu / 9}, x: {"all": 0.02}},
}


@pytest.mark.parametrize("view", ["exact", "smoothed"])
@pytest.mark.parametrize("amplitude", AMPLITUDES)
@pytest.mark.parametrize("convention", ["ito", "stratonovich"])
def test_loops_are_the_elements_written_out(amplitude, view, convention):
    with template_from(1):
        family, x, v, system = blocks(4)
        if view == "smoothed":
            system = system.smoothed(0.02)
        (mu,) = family.symbols("mu", positive=True)
        noise = Diffusion(AMPLITUDES[amplitude](x, v, mu), 1 / 32, seed=4, convention=convention, finest=3)
        looped, written = both(system, (0, 1), {x: spread(4), v: 0.1}, noise)
    assert np.abs(looped.x - written.x).max() < 1e-12
    assert looped.cost == written.cost and len(looped.events) == len(written.events)


def test_noise_on_places_leaves_the_blocks_their_sticks():
    # The springs fluctuate; the blocks stick to the belt and are torn off.
    _, x, v, system = blocks(12, periodic=True)
    looped, written = both(system, (0, 6), {x: spread(12), v: 0.2}, Diffusion({x: 0.05}, 1 / 32, seed=2))
    assert len(looped.events) > 20 and any(e.kind == "stick" for e in looped.events)
    assert [(e.switch, e.kind) for e in looped.events] == [(e.switch, e.kind) for e in written.events]
    assert np.abs(looped.x - written.x).max() < 1e-11


def test_the_code_is_that_of_one_element_whatever_their_number():
    keys = set()
    for n in (8, 50, 3000):
        _, _, v, system = blocks(n)
        run = DiffusionRun(system.smoothed(0.02), Diffusion({v: 0.1}, 1 / 32))
        keys.add(compile_model(run.lowered.model)._key)
    assert len(keys) == 1


def test_many_elements_have_the_law_of_one():
    # dx = -2 x dt + 0.7 dW in 20 000 elements: each is a path of its own.
    (x,) = Family(20_000).symbols("x")
    run = solve(System({x: -2 * x}), (0, 1), {x: 1.0}, noise=Diffusion({x: 0.7}, 1 / 32, seed=1), t_eval=[1])
    end, mean = run.x[:, -1], math.exp(-2)
    for sample, expected in ((end, mean), ((end - mean) ** 2, 0.7**2 / 4 * (1 - math.exp(-4)))):
        assert abs(sample.mean() - expected) < 5 * sample.std() / math.sqrt(len(sample))
    assert abs(np.corrcoef(end[1:], end[:-1])[0, 1]) < 5 / math.sqrt(len(end))


def test_one_source_moves_all_elements_alike():
    (x,) = Family(50).symbols("x")
    path = solve(System({x: -2 * x}), (0, 1), {x: 1.0}, noise=Diffusion({x: {"all": 0.7}}, 1 / 32, seed=1))
    alone = sp.Symbol("alone", real=True)
    one = solve(
        System({alone: -2 * alone}), (0, 1), {alone: 1.0}, noise=Diffusion({alone: 0.7}, 1 / 32, seed=1)
    )
    assert np.ptp(path.x[:, -1]) == 0 and path.x[0, -1] == one.x[0, -1]


def test_what_elements_do_together_is_looped():
    # Blocks under one beam, whose place feels them all; amplitudes that read the beam; a latch in each.
    n = 10
    family = Family(n)
    x, v = family.symbols("x v")
    on = family.memory("on", 1)
    X, V = sp.symbols("X V", real=True)
    push = family.sum(sp.sin(x) + v / 5) / n
    rates = {x: v, v: X - x - sp.sign(v) * (1 + on) / 5, X: V, V: -X - V / 9 + push**2 - push}
    events = [Event(x - 0.3, update={on: 0}, name="off"), Event(x + 0.3, update={on: 1}, name="on")]
    system = System(rates, time=t, events=events)
    start = {x: spread(n), v: 0, X: 0.2, V: 0}
    for amplitude in ({v: 0.1}, {v: 0.1, V: 0.2}, {v: {"all": 0.1 * (1 + X**2)}, V: {"all": 0.2}}):
        noise = Diffusion(amplitude, 1 / 32, seed=3, finest=3)
        for each in (system, system.smoothed(0.02)):
            looped, written = both(each, (0, 2), start, noise)
            assert len(looped.events) > 0
            assert np.abs(looped.x - written.x).max() < 1e-9


def test_neighbours_by_a_table():
    n = 12
    family = Family(n)
    x, v = family.symbols("x v")
    over = family.lattice((3, 4)).sum
    noise = Diffusion({v: 0.1}, 1 / 64, seed=3)
    for shape in (lambda d: d, sp.sin):
        rates = {x: v, v: over(lambda at, shape=shape: shape(at(x) - x)) - x - sp.sign(v) / 5}
        looped, written = both(System(rates, time=t).smoothed(0.05), (0, 1), {x: spread(n), v: 0}, noise)
        assert np.abs(looped.x - written.x).max() < 1e-10


def test_an_ensemble_of_a_family():
    _, x, v, system = blocks(9)
    view, start = system.smoothed(0.02), {x: spread(9), v: 0.1}
    ends = [ensemble(each, (0, 1), start, Diffusion({v: 0.1}, 1 / 32, seed=5), 6).end
            for each in (view, view._written_out())]  # fmt: skip
    assert np.abs(ends[0] - ends[1]).max() < 1e-12


def test_what_one_element_does_not_tell_is_written_out():
    _, x, v, system = blocks(9)
    view, start = system.smoothed(0.02), {x: spread(9), v: 0.1}
    rows = sp.zeros(18, 1)
    rows[11] = 0.1
    by_name, by_row = (
        solve(view, (0, 1), start, noise=Diffusion(amplitude, 1 / 32, seed=5)).x
        for amplitude in ({"v_3": {"source 1": 0.1}}, rows)
    )
    assert np.array_equal(by_name, by_row)


@pytest.mark.parametrize(
    ("amplitude", "message"),
    [
        (lambda x, v, f: {"w": 0.1}, "`amplitude` names 'w'"),
        (lambda x, v, f: {v: sp.Symbol("q")}, "`amplitude` contains q, which is nothing of this view"),
        (lambda x, v, f: {v: sp.Abs(x) / 9}, "no derivative by the states"),
        (lambda x, v, f: {v: {"all": v}, x: {"other": v}}, "does not commute"),
    ],
)
def test_mistakes_are_told_as_ever(amplitude, message):
    family, x, v, system = blocks(9)
    with pytest.raises(ValueError, match=message):
        solve(system.smoothed(0.02), (0, 1), {x: 0, v: 0}, noise=Diffusion(amplitude(x, v, family), 1 / 32))


def test_at_an_end_of_a_chain_the_noise_of_what_stands_beyond_it_acts():
    # h = v_i - v_{i+1} varies by 2 a^2 a unit of time; at the end v_{i+1} is c v_i + w: by (1 - c)^2 a^2 + b^2.
    a, b, c = 0.1, 0.3, sp.Symbol("c", real=True)
    w = sp.Symbol("w", real=True)
    with template_from(1):
        family = Family(4)
        (v,) = family.symbols("v")
        rates = {v: -sp.sign(v - family.neighbour(v, 1, outside=c * v + w)), w: -w}
        system = System(rates, parameters={c: -0.5})
    run = DiffusionRun(system, Diffusion({v: a, w: b}, 1 / 32))
    (variance,) = run.lowered.spreads
    numbers = {s: run.values.get(s) for s in variance.free_symbols}
    (beyond,) = (s for s, number in numbers.items() if number is None)
    found = [variance.subs(numbers | {beyond: k}) for k in (0, 1)]
    np.testing.assert_allclose(np.array(found, float), [2 * a**2, 1.5**2 * a**2 + b**2], rtol=1e-14)


def test_buffers_of_a_large_family_grow_with_it_alone(monkeypatch):
    # What may happen at the end of one step has room of its own: with room for the points the buffers grew as n^2.
    def grow(*_):
        raise AssertionError("the first buffers do not do")

    monkeypatch.setattr(EventDriven, "larger", grow)
    n = 2000
    _, x, v, system = blocks(n)
    run = solve(system, (0, 0.01), {x: 0, v: [0.3 + k / n for k in range(n)]}, local=False)
    assert run.success and len(run.t) < 60


def test_a_surface_that_reads_a_sum_keeps_its_residual():
    # The sums of the noise are beside those of the residual, d/dt of a summand that depends on time among them.
    n = 10
    family = Family(n)
    (x,) = family.symbols("x")
    V, Z = sp.symbols("V Z", real=True)
    mean = family.sum(x * sp.cos(t)) / n
    rates = {x: -x + Z * sp.sin(x), V: sp.sin(3 * t) - 2 * sp.sign(V - mean), Z: -Z * mean}
    start = {x: np.linspace(0.2, 1, n).tolist(), V: 0.3, Z: 0.5}
    for convention in ("ito", "stratonovich"):
        noise = Diffusion({Z: (1 + Z**2) / 9}, 1 / 64, seed=1, convention=convention)
        looped, written = both(System(rates, time=t), (0, 3), start, noise)
        assert len(looped.events) > 0 and np.abs(looped.x - written.x).max() < 1e-12
