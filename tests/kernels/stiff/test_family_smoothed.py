"""Implicit steps of families, in smoothed views and between events: loops over elements, and a sparse elimination.

Guards: kernels/stiff/sparse.py.
"""

import itertools
import time

import numpy as np
import pytest
import sympy as sp
from family_models import template_from

from pwsmooth import Disc, Event, Family, Kicks, System, solve
from pwsmooth.codegen.machine.units import unit_address
from pwsmooth.codegen.stiff import linear
from pwsmooth.codegen.stiff.elements import FamilyStiff, FamilyTaylor
from pwsmooth.laws.friction import LuGre
from pwsmooth.paths.stiff_events import switched_by_events
from tests.fuzz import assemblies
from tests.fuzz.layers import Functions

t, u = sp.symbols("t u", real=True)


def train(n, periodic=False, outside=None):
    """Blocks in a row on a belt, each with a strength of its own."""
    family = Family(n, periodic=periodic)
    x, v = family.symbols("x v")
    (F,) = family.symbols("F", positive=True)
    step = {} if outside is None else {"outside": outside}
    pull = family.neighbour(x, 1, **step) + family.neighbour(x, -1) - 2 * x
    rates = {x: v, v: 2 * pull - x - F * sp.sign(v - sp.Rational(1, 10)) + sp.cos(t) / 5}
    values = {F: np.linspace(0.2, 0.5, n).tolist()} | ({outside: 0.3} if outside is not None else {})
    start = {x: np.sin(np.arange(n)).tolist(), v: np.cos(2.0 * np.arange(n)).tolist()}
    return System(rates, time=t, parameters=values), start


def oscillators(n):
    """Bodies that rub one platform: every one feels the sum over all."""
    family = Family(n)
    y, w = family.symbols("y w")
    (F,) = family.symbols("F", positive=True)
    X, V = sp.symbols("X V", real=True)
    rub = family.sum(F * sp.sign(V - w)) / n
    rates = {y: w, w: -y - w / 5 + F * sp.sign(V - w), X: V, V: -X - rub - rub**2 / 3 + sp.cos(t)}
    start = {y: np.sin(np.arange(n)).tolist(), w: 0.3, X: 0.1, V: 0.5}
    return System(rates, time=t, parameters={F: np.linspace(0.3, 0.9, n).tolist()}), start


@pytest.mark.parametrize("make", [train, oscillators])
@pytest.mark.parametrize("sigmoid", ["algebraic", "tanh", "erf"])
@pytest.mark.parametrize("method", ["auto", "radau5", "radau13", "taylor"])
def test_loops_over_elements_are_the_view_that_is_written_out(make, sigmoid, method):
    with template_from(1):
        system, start = make(4)
        view = system.smoothed(1e-2, sigmoid)
    written = view._written_out()
    assert view.model.families is not None and written.model.families is None
    options = dict(rtol=1e-9, method=method)
    looped = solve(view, (0, 4), start, **options)
    expected = solve(written, (0, 4), start, **(options | {"method": "radau13", "rtol": 1e-11}))
    assert looped.success and np.abs(looped.x[:, -1] - expected.x[:, -1]).max() < 2e-8


def test_texts_do_not_depend_on_the_number_of_elements():
    few, many = (FamilyStiff(train(n)[0].smoothed(1e-3).model).texts() for n in (9, 900))
    assert few == many
    assert (
        FamilyTaylor(train(9)[0].smoothed(1e-3).model).write()
        == FamilyTaylor(train(900)[0].smoothed(1e-3).model).write()
    )


def test_a_thousand_blocks_run_with_a_width_and_strengths_that_change():
    n = 1000
    system, start = train(n)
    view = system.smoothed(1e-3)
    one = solve(view, (0, 0.3), start, rtol=1e-7)
    wider = solve(view, (0, 0.3), start, rtol=1e-7, parameters={"eps": 1e-2, "F": 0.1})
    other, start = train(n)
    again = solve(other.with_parameters({"F": 0.1}).smoothed(1e-2), (0, 0.3), start, rtol=1e-7)
    assert one.success and wider.success and np.array_equal(wider.x[:, -1], again.x[:, -1])
    assert np.abs(one.x[:, -1] - wider.x[:, -1]).max() > 1e-3


def test_the_jacobian_of_elements_under_a_sum_is_sparse_and_right():
    n = 50
    view = oscillators(n)[0].smoothed(1e-1)
    made = Functions(view)
    of, x = made.of, np.random.default_rng(1).uniform(-0.1, 0.1, 2 * n + 2)
    assert of.unknowns == of.n + 1 and len(of.pattern[0]) < 12 * n
    entries = np.zeros(len(of.pattern[0]))
    made.call("jacobian", 0.3, x, made.p, entries)
    columns = []
    for k in range(of.n):
        ends = []
        for side in (1e-6, -1e-6):
            f, moved = np.zeros(of.n), x.copy()
            moved[k] += side
            made.call("rates1", 0.3, moved, made.p, f)
            ends.append(f)
        columns.append((ends[0] - ends[1]) / 2e-6)
    J = of.matrix(entries)
    assert np.abs(J - np.array(columns).T).max() < 1e-6 * np.abs(J).max()


@pytest.mark.parametrize("seed", range(6))
def test_the_plan_eliminates_any_pattern(seed):
    import ctypes

    r = np.random.default_rng(seed)
    n, sums = int(r.integers(1, 60)), int(r.integers(0, 4))
    size, count = n + sums, int(r.integers(1, 6 * n))
    rows, columns = r.integers(0, size, count), r.integers(0, size, count)
    J = r.normal(size=count)
    strict = (rows < n) | (columns < rows)  # sums read those before them
    rows, columns, J = rows[strict], columns[strict], np.ascontiguousarray(J[strict])
    plan = linear.plan(n, size, rows, columns)
    mu = np.concatenate([r.uniform(9, 20, 4), r.uniform(-5, 5, 4)])
    right = r.normal(size=(n, 8))
    lu, solved = np.full(linear.length(plan), np.nan), right.copy()
    kinds = [ctypes.c_void_p] * 4
    pointers = [a.ctypes.data for a in (plan, J, mu, lu, solved)]
    ctypes.CFUNCTYPE(None, *kinds)(unit_address("sparse_factor"))(*pointers[:4])
    ctypes.CFUNCTYPE(None, *kinds[:3])(unit_address("sparse_solve"))(pointers[0], *pointers[3:])
    whole = np.zeros((size, size))
    np.add.at(whole, (rows, columns), J)
    for lane in range(4):
        diagonal = np.append(np.full(n, mu[lane] + 1j * mu[4 + lane]), np.ones(sums))
        b = np.append(right[:, lane] + 1j * right[:, 4 + lane], np.zeros(sums))
        expected = np.linalg.solve(np.diag(diagonal) - whole, b)[:n]
        assert np.allclose(solved[:, lane] + 1j * solved[:, 4 + lane], expected, rtol=1e-9, atol=1e-11)


def test_scipys_solvers_kicks_and_samples_take_it():
    with template_from(1):
        system, start = train(5)
        view = system.smoothed(1e-2)
    ours = solve(view, (0, 2), start, rtol=1e-10, t_eval=[0.5, 2.0])
    theirs = solve(view, (0, 2), start, rtol=1e-9, atol=1e-11, method="Radau")
    assert np.abs(ours.x[:, -1] - theirs.x[:, -1]).max() < 1e-6
    kicks = Kicks(1e-3, every=0.1, on=("v",), seed=3)
    runs = [solve(v, (0, 1), start, noise=kicks, rtol=1e-9).x[:, -1] for v in (view, view._written_out())]
    assert np.abs(runs[0] - runs[1]).max() < 1e-7


def test_implicit_steps_and_noise_are_of_the_whole_system():
    (system, start), (stiff, begin) = train(9), bristles(9)
    for view, x0, options in ((system.smoothed(1e-2), start, {}), (stiff, begin, {"method": "stiff"})):
        with pytest.raises(ValueError, match="takes the whole system; leave `local` out"):
            solve(view, (0, 1), x0, local=True, **options)


def test_setting_up_does_not_grow_with_the_number_of_elements():
    # As a count of what is derived, not as a time: the expressions are those of one element.
    before = time.process_time()
    view = train(100_000)[0].smoothed(1e-3)
    assert len(view.model.families.template.model.rhs) == 2
    assert time.process_time() - before < 30
    assert len(view.parameters) == 100_001 and view.parameters["eps"] == 1e-3


def test_a_parameter_that_stands_beyond_an_end_alone_has_its_value():
    system, start = train(9, outside=u)
    assert system.model.families is not None and u in system.parameters
    ends = [solve(s, (0, 2), start, parameters={"u": 0.7}).x[:, -1] for s in (system, system._written_out())]
    assert np.abs(ends[0] - ends[1]).max() < 1e-9
    smooth = [
        solve(system.smoothed(1e-2), (0, 2), start, parameters={"u": value}).x[8, -1] for value in (0.7, 0.1)
    ]
    assert abs(smooth[0] - smooth[1]) > 1e-2


def test_a_parameter_that_an_element_at_an_end_lacks_may_be_given():
    family = Family(5)
    (w,) = family.symbols("w")
    F, g = family.symbols("F g", positive=True)
    rates = {w: F * sp.sign(family.neighbour(w, 1) - w) - g * sp.sign(w - family.neighbour(w, -1)) + sp.cos(t)}
    system = System(rates, time=t, parameters={F: 0.3, g: [0.1, 0.2, 0.3, 0.4, 0.5]})
    assert "g_1" not in {p.name for p in system.parameters}
    with pytest.raises(ValueError, match="'h', which stands nowhere"):
        System(rates, time=t, parameters={F: 0.3, g: 0.1, sp.Symbol("h"): 1})


def pucks(n, of=Disc):
    """Bodies on a plane, in a row of springs, each with friction in two directions."""
    family = Family(n)
    x, y, vx, vy = family.symbols("x y vx vy")
    (F,) = family.symbols("F", positive=True)
    size = sp.sqrt(vx**2 + vy**2)
    a, b = Disc("lam", (vx, vy)) if of is Disc else (vx / size, vy / size)
    pull = family.neighbour(x, 1) + family.neighbour(x, -1) - 2 * x
    rates = {x: vx, y: vy, vx: pull - F * a, vy: sp.cos(t) - y - F * b}
    start = {x: np.sin(np.arange(n)).tolist(), y: 0, vx: 0.3, vy: 0.1}
    return System(rates, time=t, parameters={F: np.linspace(0.1, 1.2, n).tolist()}), start


@pytest.mark.parametrize("of", [Disc, None], ids=["Disc", "v/|v|"])
def test_elements_have_discs(of):
    n = 6
    with template_from(1):
        system, start = pucks(n, of)
    whole = solve(system, (0, 3), start, rtol=1e-11)
    names = ("x", "y", "vx", "vy")
    one = [sp.symbols([f"{name}_{k + 1}" for name in names], real=True) for k in range(n)]
    rates, values = {}, np.linspace(0.1, 1.2, n)
    for k, (x, y, vx, vy) in enumerate(one):
        lam = Disc(f"puck_{k + 1}", (vx, vy))
        before, after = one[max(0, k - 1)][0], one[min(n - 1, k + 1)][0]
        rates |= {
            x: vx,
            y: vy,
            vx: before + after - 2 * x - values[k] * lam[0],
            vy: sp.cos(t) - y - values[k] * lam[1],
        }
    plain = System(rates, time=t)
    given = {f"{name.name}_{k + 1}": value for name, values in start.items()
             for k, value in enumerate(np.broadcast_to(values, n).tolist())}  # fmt: skip
    expected = solve(plain, (0, 3), given, rtol=1e-11)
    order = [plain.states.index(s) for s in system.states]
    assert whole.success and len(whole.events) == len(expected.events) > 4
    assert np.abs(whole.x[:, -1] - expected.x[order, -1]).max() < 1e-9


def test_a_smoothed_view_of_discs_is_looped():
    with template_from(1):
        system, start = pucks(3)
        view = system.smoothed(1e-3)
    runs = [solve(v, (0, 3), start, rtol=1e-9) for v in (view, view._written_out())]
    assert view.model.families is not None
    assert np.abs(runs[0].x[:, -1] - runs[1].x[:, -1]).max() < 1e-7


def test_a_layer_around_a_surface_that_reads_a_sum_is_written_out():
    family = Family(4)
    x, v = family.symbols("x v")
    mean = family.sum(v) / 4
    with template_from(1):
        system = System({x: v, v: -x - sp.sign(v - mean) / 3 + sp.cos(t)}, time=t)
        view = system.smoothed(1e-2)
    assert view.model.families is None
    assert solve(view, (0, 1), {x: np.sin(np.arange(4)).tolist(), v: 0.2}).success


# ---- method="stiff": implicit steps between exact events


def bristles(n):
    """Blocks in a row on a belt, each on stiff bristles."""
    family = Family(n)
    x, v = family.symbols("x v")
    pull = family.neighbour(x, 1) + family.neighbour(x, -1) - 2 * x
    law = LuGre(F_c=0.4, F_s=0.6, v_s=0.05, sigma0=1e6, sigma1=1e3, sigma2=0.1)
    law = law.attach(velocity=v - sp.Rational(1, 10), position=x - t / 10, time=t)
    rates = {x: v, v: pull - x - law.force, **dict(law.rates)}
    start = {x: (0.3 * np.sin(np.arange(n))).tolist(), v: 0.0} | dict.fromkeys(dict(law.rates), 0.0)
    return System(rates, time=t, parameters=law.parameters), start


def test_stiff_bristles_of_a_family_are_looped_and_meet_the_same_events():
    with template_from(1):
        system, start = bristles(5)
    assert switched_by_events(system.model).families is not None
    runs = [solve(s, (0, 1), start, method="stiff", rtol=1e-9) for s in (system, system._written_out())]
    exact = solve(system, (0, 1), start, method="taylor", rtol=1e-9)
    names = [[(e.switch, e.kind, e.note) for e in run.events] for run in (*runs, exact)]
    assert sorted(names[0]) == sorted(names[1]) == sorted(names[2]) and len(names[0]) > 5
    assert np.abs(runs[0].x[:, -1] - runs[1].x[:, -1]).max() < 1e-9
    assert np.abs(runs[0].x[:, -1] - exact.x[:, -1]).max() < 1e-7
    assert runs[0].cost["steps"] < exact.cost["steps"] / 30


@pytest.mark.parametrize("kind", ["kink", "memory", "fire", "bounce", "parallel"])
@pytest.mark.parametrize("seed", [1, 2])
def test_events_and_switches_of_elements_between_implicit_steps(kind, seed):
    first = assemblies.KINDS.index(kind) + len(assemblies.KINDS) * 100 * seed
    models = map(assemblies.structure, itertools.count(first, len(assemblies.KINDS)))
    model = next(M for M in models if M.n <= 12)
    with assemblies.templates():
        system = System(**model.arguments)
    one = assemblies.case(model, seed)
    assert switched_by_events(system.model).families is not None
    options = dict(parameters=one.p, t_eval=one.instants, rtol=1e-10, atol=1e-12)
    stiff, exact = (
        solve(system, (0, one.instants[-1]), one.start, method=m, **options) for m in ("stiff", "auto")
    )
    assert sorted((e.switch, e.kind) for e in stiff.events) == sorted((e.switch, e.kind) for e in exact.events)
    assert np.abs(stiff.x - exact.x).max() < 1e-7 * (1 + np.abs(exact.x).max())


def test_memories_of_a_chain_and_of_a_ring_are_not_the_same():
    found = []
    for periodic in (False, True):
        family = Family(3, periodic=periodic)
        (v,) = family.symbols("v")
        count = family.memory("count", 0)
        event = Event(v - 1, direction=1, update={v: 0, count: count + 1}, name="fire")
        found += [dict(event.update)[count].free_symbols.pop().family.periodic]
    assert found == [False, True]


@pytest.mark.parametrize("make", [train, oscillators, pucks])
def test_smoothed_switches_of_elements_are_outputs(make):
    with template_from(1):
        system, start = make(4)
        view = system.smoothed(1e-2)
    runs = [solve(v, (0, 2), start, rtol=1e-10, t_eval=[1.0, 2.0]) for v in (view, view._written_out())]
    names = runs[1].outputs
    assert len(names) >= 4 and set(runs[0].outputs) == set(names)
    for name in names:
        assert runs[0][name] == pytest.approx(runs[1][name], abs=1e-7)


def test_a_member_named_eps_keeps_its_name():
    family = Family(8)
    x, v = family.symbols("x v")
    (eps,) = family.symbols("eps", positive=True)
    view = System({x: v, v: -x - eps * sp.sign(v)}, parameters={eps: 0.3}).smoothed(1e-2)
    assert view.model.families is not None and view.parameters[view.model.parameters[-1]] == 1e-2
    assert [p.name for p in view.parameters][-2:] == ["eps_8", "eps_"]


def test_an_event_at_a_sum_over_all_elements_is_met_by_implicit_steps():
    n = 9
    family = Family(n)
    (v,) = family.symbols("v")
    total = family.sum(v)
    event = Event(total - 4, direction=1, update={v: v / 2}, name="full")
    system = System({v: 1 - v / 10 + sp.Abs(v) / 50}, time=t, events=[event])
    start = {v: np.linspace(0, 0.3, n).tolist()}
    stiff, exact = (solve(system, (0, 3), start, method=m, rtol=1e-10) for m in ("stiff", "auto"))
    assert switched_by_events(system.model).families is not None and len(exact.events) > 5
    assert [e.switch for e in stiff.events] == [e.switch for e in exact.events]
    assert np.allclose([e.time for e in stiff.events], [e.time for e in exact.events], rtol=0, atol=1e-8)
    assert np.abs(stiff.x[:, -1] - exact.x[:, -1]).max() < 1e-7


@pytest.mark.parametrize("own", [False, True], ids=["one width", "a width an element"])
def test_a_flat_function_in_a_sum_tells_the_strip_around_the_surface_of_all(own):
    """exp(-(V/w)^2) stands in a sum alone: a step must not pass over the strip around V = 0 that it changes in."""
    n = 9
    family = Family(n)
    (z,) = family.symbols("z")
    w = family.symbols("w", positive=True)[0] if own else sp.Symbol("w", positive=True)
    X, V = sp.symbols("X V", real=True)
    bump = family.sum((1 + z) * sp.exp(-((V / w) ** 2)) * sp.Abs(V)) * 1000 / n
    rates = {z: -z + sp.Abs(V), X: V, V: -X - bump * V}
    widths = np.linspace(1e-3, 2e-3, n).tolist() if own else 1e-3
    system = System(rates, parameters={w: widths})
    stiff = switched_by_events(system.model)
    # One surface of all has one width: that of elements is the least of theirs, and they are written out.
    assert stiff.smoothing and (stiff.families is None) == own
    start = {z: 0.1, X: 1.0, V: 0.0}
    ends = [solve(system, (0, 8), start, method=m, rtol=1e-9).x[:, -1] for m in ("stiff", "auto")]
    assert np.abs(ends[0] - ends[1]).max() < 1e-6
