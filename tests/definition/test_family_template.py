"""Families are lowered as one element: its code gives what the elements give if written out, and does not grow.

Guards: codegen/families/, definition/families/.
"""

import ctypes
import pickle

import numpy as np
import pytest
import sympy as sp
from family_models import MODELS, SLIDING, both, t, template_from

from pwsmooth import Event, Family, Switch, System, Unilateral, solve
from pwsmooth.codegen import compile_model
from pwsmooth.codegen.families.fields import FamilyFields
from pwsmooth.codegen.families.writing import write_family_jets
from pwsmooth.codegen.layout import Layout
from pwsmooth.definition.model import Model

EPS = np.finfo(float).eps


def pointers(*arrays):
    """Arrays with one more entry (an empty one has no address), and their addresses."""
    arrays = [np.append(np.asarray(a, float), 0.0) for a in arrays]
    return arrays, [a.ctypes.data for a in arrays]


def multipliers_in_order(template, written):
    """Number in the written-out model of every multiplier of the template: there those of one element come together,
    here those of one switch."""
    names = [[str(m.symbol) for m in system.model.multipliers] for system in (template, written)]
    if sorted(names[0]) == sorted(names[1]):
        return [names[1].index(name) for name in names[0]]
    lay = Layout(template.model.families.template)
    own = [f is not None for f in lay.multipliers]
    n = template.model.families.sizes[0] if template.model.families.sizes else 0
    if not any(own):
        return list(range(len(written.model.multipliers)))
    assert all(own)
    return [len(own) * i + b for b in range(len(own)) for i in range(n)]


def point(template, written, seed=1):
    """A random state, sides of the switches (in both orders) and the parameters."""
    rng = np.random.default_rng(seed)
    model = template.model
    x = rng.normal(size=len(model.states))
    x[len(x) - model.n_memory :] = rng.integers(0, 2, model.n_memory)
    order = multipliers_in_order(template, written)
    mult = rng.choice([-1.0, 1.0], len(order))
    there = np.zeros(len(order))
    there[order] = mult
    return x, mult, there, order, [float(template.parameters[q]) for q in model.parameters]


@pytest.mark.parametrize("name", MODELS)
def test_the_field_and_its_surfaces_are_those_of_the_elements_written_out(name):
    template, written, _, _ = both(name, 5)
    x, mult, there, order, p = point(template, written)
    results = []
    for system, lam in ((template, mult), (written, there)):
        code = compile_model(system.model)
        arrays, at = pointers(x, lam, p, np.empty(code.n), np.empty(code.m + code.ne), np.empty(code.m))
        kind = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_void_p] * 6)
        kind(code.fields)(0.37, *at)
        results.append([a[:-1] for a in arrays[3:5]])
    (dx, h), (dx_written, h_written) = results
    m = len(order)
    # Sums are added in another order: n terms, each at most as large as the largest number that occurs.
    scale = 50 * EPS * (1 + np.abs(dx_written).max())
    np.testing.assert_allclose(dx, dx_written, atol=scale, rtol=0)
    np.testing.assert_allclose(h, [*h_written[order], *h_written[m:]], atol=scale, rtol=0)


@pytest.mark.parametrize("name", MODELS)
def test_the_gradients_of_surfaces_are_those_of_the_elements_written_out(name):
    template, written, _, _ = both(name, 5)
    x, mult, there, order, p = point(template, written)
    dense = []
    for system, lam in ((template, mult), (written, there)):
        code = compile_model(system.model)
        row, col = code.pattern("DH")
        entries = code.pattern("G")[1]
        arrays, at = pointers(x, lam, p, np.empty(len(entries)), np.empty(len(col) + code.m + code.ne))
        kind = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_void_p] * 5)
        kind(code.linear)(0.37, *at)
        gradients = np.zeros((code.m + code.ne, code.n + 1))
        for i in range(code.m + code.ne):
            gradients[i, col[row[i] : row[i + 1]]] = arrays[4][row[i] : row[i + 1]]
        gradients[:, -1] = arrays[4][len(col) : -1]
        dense.append(gradients)
    m = len(order)
    np.testing.assert_allclose(
        dense[0], dense[1][[*order, *range(m, len(dense[1]))]], atol=1e3 * EPS, rtol=1e-13
    )


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("K", [1, 6, 12])
def test_the_taylor_coefficients_are_those_of_the_elements_written_out(name, K):
    template, written, _, _ = both(name, 5)
    x, mult, there, order, p = point(template, written)
    results = []
    for system, lam in ((template, mult), (written, there)):
        code = compile_model(system.model)
        count, own = code.nrows_slip
        rows = np.full((count + own, K + 5), np.nan)
        _, at = pointers(x, lam, p)
        kind = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_double, *[ctypes.c_void_p] * 3, *[ctypes.c_int64] * 2,
                                ctypes.c_void_p, ctypes.c_int64)  # fmt: skip
        assert kind(code.jet_slip)(0.37, *at, K, K + 5, rows.ctypes.data, count * (K + 5)) == 0
        surfaces = np.array([rows[r, : K + 1] if r >= 0 else np.zeros(K + 1) for r in code.surface_rows_slip])
        results.append((rows[: code.n, : K + 1], surfaces.reshape(-1, K + 1)))
    (states, h), (states_written, h_written) = results
    m = len(order)
    h_written = h_written[[*order, *range(m, len(h_written))]]
    for found, expected in ((states, states_written), (h, h_written)):
        # Order k is a sum of k products of lower orders: rounding grows with k, relative to the largest of an order.
        size = np.abs(states_written).max(axis=0) + (np.abs(expected).max(axis=0) if len(expected) else 0.0)
        assert np.all(np.abs(found - expected) <= 100 * (K + 1) * EPS * (1 + size))


@pytest.mark.parametrize("name", SLIDING)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_taylor_coefficients_with_solved_multipliers_are_those_of_the_elements_written_out(name, seed):
    template, written, _, _ = both(name, 5)
    K = 9
    x, mult, there, order, p = point(template, written, seed)
    rng = np.random.default_rng(seed)
    solvable = np.array(
        [m.kind == "algebraic" or m.regularity == "sliding" for m in template.model.multipliers]
    )
    always = np.array([m.kind == "algebraic" for m in template.model.multipliers])
    mask = (rng.integers(0, 2, len(mult)) * solvable) | always
    mult = np.where(mask, rng.uniform(-0.9, 0.9, len(mult)), mult)
    there[order] = mult
    masks = np.zeros((2, len(mask) + 1), np.int64)
    masks[0, :-1], masks[1, order] = mask, mask
    results = []
    for system, lam, on in ((template, mult, masks[0]), (written, there, masks[1])):
        code = compile_model(system.model)
        count, own = code.nrows_general
        rows = np.full((count + own, K + 5), np.nan)
        _, at = pointers(x, lam, p)
        kind = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_double, *[ctypes.c_void_p] * 4, *[ctypes.c_int64] * 2,
                                ctypes.c_void_p, ctypes.c_int64)  # fmt: skip
        assert (
            kind(code.jet_general)(0.37, *at, on.ctypes.data, K, K + 5, rows.ctypes.data, count * (K + 5)) == 0
        )
        unknowns = rows[code.mult_row0 : code.mult_row0 + code.m, : K + 1]
        results.append((rows[: code.n, : K + 1], unknowns, rows[code.surface_rows_general][:, : K + 1]))
    for a, b, numbers in zip(*results, (None, order, order), strict=True):
        b = b if numbers is None else b[numbers]
        kept = slice(None) if numbers is None else np.array(mask, bool)
        if numbers is order and a is results[0][2]:
            kept = np.array([m.surface is not None for m in template.model.multipliers])
        # Rounding of products of k orders and of the solved systems, whose condition is of the order of n.
        size = 1 + np.abs(results[1][0]).max(axis=0) + np.abs(results[1][1]).max(axis=0)
        assert np.all(np.abs(a - b)[kept] <= 1e4 * EPS * size)


@pytest.mark.parametrize("name", MODELS)
def test_a_run_is_that_of_the_elements_written_out(name):
    template, written, start, span = both(name, 5)
    times = np.linspace(*span, 201)
    a, b = (solve(system, span, start, t_eval=times, rtol=1e-10, atol=1e-12) for system in (template, written))
    assert a.outcome is b.outcome and a.cost == b.cost
    assert [(e.kind, e.switch) for e in a.events if " " in e.switch] == [
        (e.kind, e.switch) for e in b.events if " " in e.switch
    ]
    # What differs are roundings, and by them the ends of steps; a span of a few units does not blow them up.
    ends = [[e.time for e in run.events] for run in (a, b)]
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-10)
    np.testing.assert_allclose(a.x, b.x, rtol=0, atol=1e-9)
    for output in b.outputs:
        np.testing.assert_allclose(a[output], b[output], rtol=1e-7, atol=1e-8)
    assert a.outputs == b.outputs


@pytest.mark.parametrize("name", MODELS)
def test_the_generated_text_does_not_know_how_many_elements_there_are(name):
    texts = []
    for n in (9, 300):
        arguments, _, _ = MODELS[name](n)
        with template_from(1):
            model = System(**({"time": t} | arguments)).model
        texts.append(FamilyFields(model).write() | write_family_jets(model))
    # These write n itself into a mean, as a number.
    if name in ("mean_field", "implicit", "belt", "two_families"):
        assert [len(text.split("\n")) for text in texts[0].values()] == [
            len(text.split("\n")) for text in texts[1].values()
        ]
    else:
        assert texts[0] == texts[1]


def test_systems_of_two_sizes_share_machine_code_and_not_their_sizes():
    runs = {}
    for n in (9, 30):
        template, _, start, span = both("slip_stick", n)
        runs[n] = template, solve(template, span, start)
    keys = {compile_model(system.model)._key for system, _ in runs.values()}
    assert len(keys) == 1
    # n equal shares of the same strength reach it at their own times, from the stiffest to the softest.
    for n, (_, run) in runs.items():
        assert run["slipping"].max() == n
    again = solve(runs[9][0], (0, 1.2), {"z": 0})
    np.testing.assert_array_equal(again.x, runs[9][1].x)


def test_n_equal_elements_are_one_of_n_times_the_strength():
    # Bristles in parallel that are all alike: f = n (s0 z + s1 z'), the same as one element with n s0, n s1, n F.
    n = 40
    template, _, start, _ = both("bristles", n)
    names = {"s0": 50.0 / n, "s1": 2.0 / n, "Fc": 1.0 / n, "Fs": 1.5 / n}
    many = solve(template.with_parameters(names), (0, 2), start, rtol=1e-11, atol=1e-13)
    single, _, begin, _ = both("bristles", 1)
    one = {key: n * value for key, value in names.items()}
    few = solve(single.with_parameters(one), (0, 2), begin, rtol=1e-11, atol=1e-13)
    assert abs(many["v"][-1] - few["v"][-1]) <= 1e-9
    assert abs(many["z_40"][-1] - few["z_1"][-1]) <= 1e-9


def test_a_changed_model_is_written_out():
    from dataclasses import replace

    template, written, _, _ = both("slip_stick", 9)
    changed = replace(template.model, outputs=())
    assert (
        changed.families is None and changed.rhs == written.model.rhs and changed.events == written.model.events
    )
    assert changed.multipliers == written.model.multipliers
    plain = replace(written.model, outputs=(), eps_ratio=())
    assert type(changed) is Model and changed == plain and hash(changed) == hash(plain)


def test_an_equal_looped_model_stays_one():
    from dataclasses import replace

    template, _, _, _ = both("slip_stick", 9)
    same, read = replace(template.model), pickle.loads(pickle.dumps(template.model))
    for model in (same, read):
        assert (
            model.families == template.model.families
            and model == template.model
            and hash(model) == hash(template.model)
        )
    assert both("slip_stick", 8)[0].model != template.model


def test_events_of_elements_have_instants_of_their_own():
    blocks = Family(9)
    y, w = blocks.symbols("y w")
    later = Event(at=[blocks.index / 2, 4.7], update={w: w + 1}, name="kick")
    runs = []
    for least in (1, 10**9):
        with template_from(least):
            system = System({y: w, w: -y}, events=[later])
        assert (system.model.families is None) == (least > 1)
        runs.append(solve(system, (0, 5), {y: 1, w: 0}, t_eval=[1, 3, 5]))
    looped, written = runs
    np.testing.assert_allclose(looped.x, written.x, rtol=0, atol=1e-11)
    assert [str(e) for e in looped.events] == [str(e) for e in written.events] and len(looped.events) == 18


def test_what_has_no_looped_form_is_written_out():
    blocks = Family(9)
    y, w = blocks.symbols("y w")
    table = blocks.links([[k % 9 + 1] for k in range(1, 10)])
    balls = Unilateral(table.neighbour(y, 1) - y, restitution=0.5, name="R")
    for arguments in (
        {"rates": {y: w, w: -balls.reaction}, "contacts": [balls]},
        {"rates": {y: w, w: table.sum(lambda at: sp.sign(at(w) - w)) - w}},
        {
            "rates": {
                y: w,
                w: (1 + y**2) * (rub := Switch("s", blocks.neighbour(w, 1) - w)) - blocks.neighbour(rub, -1),
            }
        },
        {"rates": {y: w, w: -sp.sign(y)}},
    ):
        model = System(**arguments).model
        assert model.families is None and len(model.states) == 18


def test_a_wrong_value_of_one_element_is_named():
    tau = sp.Symbol("tau", nonnegative=True)
    elements = Family(9)
    (z,) = elements.symbols("z")
    (T,) = elements.symbols("T", nonnegative=True)
    values = [1.0] * 9
    values[4] = 0.0
    with pytest.raises(ValueError, match=r"z_5.*divides by T_5"):
        System({z: (tau - z) / T}, parameters={T: values, tau: 1})
    with pytest.raises(ValueError, match="gives 3 values to T, which has 9 elements"):
        System({z: (tau - z) / T}, parameters={T: [1, 2, 3], tau: 1})
    system = System({z: (tau - z) / T}, parameters={T: 1.0, tau: 1})
    with pytest.raises(ValueError, match="no value for z_9"):
        solve(system, (0, 1), {f"z_{i}": 0 for i in range(1, 9)})
