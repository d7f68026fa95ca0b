"""Families: an element written once is n elements, with neighbours and sums."""

import pickle
import re

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Algebraic, Event, Family, Memory, Switch, System, Unilateral, solve
from pwsmooth.definition import lowering

t, x, v, s = sp.symbols("t x v s", real=True)
u = sp.Symbol("u", positive=True)
RING = Family(2, periodic=True)


def parallel(n=3):
    """A mass on n Maxwell-slip elements."""
    elements = Family(n)
    (f,) = elements.symbols("f")
    kappa, strength = elements.symbols("kappa strength", positive=True)
    slope = kappa * v * sp.Heaviside(strength - f * sp.sign(v))
    return System(
        {x: v, v: u * sp.sin(t) - elements.sum(f), f: slope},
        time=t,
        parameters={u: 1, kappa: [2.5 / i for i in range(1, n + 1)], strength: 0.2},
        outputs={"force": elements.sum(f), "share": f / elements.sum(f)},
    )


def chain(n=4, **options):
    """Blocks y_i coupled by springs, on a belt of speed u."""
    blocks = Family(n, **options)
    y, w = blocks.symbols("y w")
    pull = blocks.neighbour(y, 1) - 2 * y + blocks.neighbour(y, -1)
    return System({y: w, w: pull - y - Switch("lam", w - u)}, parameters={u: 0.1})


def test_a_family_is_the_same_model_as_its_elements_written_by_hand():
    f1, f2 = sp.symbols("f_1 f_2", real=True)
    k1, k2, s1, s2 = sp.symbols("kappa_1 kappa_2 strength_1 strength_2", positive=True)
    by_hand = System(
        {
            x: v,
            v: u * sp.sin(t) - f1 - f2,
            f1: k1 * v * sp.Heaviside(s1 - f1 * sp.sign(v)),
            f2: k2 * v * sp.Heaviside(s2 - f2 * sp.sign(v)),
        },
        time=t,
        parameters={u: 1, k1: 2.5, k2: 1.25, s1: 0.2, s2: 0.2},
        outputs={"force": f1 + f2, "share_1": f1 / (f1 + f2), "share_2": f2 / (f1 + f2)},
    )
    assert parallel(2).model == by_hand.model and parallel(2).parameters == by_hand.parameters


def test_the_ends_of_a_chain_are_free_by_default():
    y1, y2, y3, y4 = sp.symbols("y_1:5", real=True)
    rates = chain().model.rhs[4:]
    springs = [sp.expand(r.xreplace({m.symbol: sp.S.Zero for m in chain().model.multipliers})) for r in rates]
    assert springs[0] == sp.expand(y2 - y1 - y1) and springs[3] == sp.expand(y3 - y4 - y4)
    assert springs[1] == sp.expand(y3 - 2 * y2 + y1 - y2)
    # Springs between the blocks are internal forces.
    assert sp.expand(sum(springs) + y1 + y2 + y3 + y4) == 0


def test_a_periodic_chain_closes():
    y1, y2, y4 = sp.symbols("y_1 y_2 y_4", real=True)
    first = chain(periodic=True).model.rhs[4]
    assert sp.expand(first.subs(sp.Symbol("lam_1", real=True), 0)) == sp.expand(y2 - 3 * y1 + y4)


def test_what_stands_outside_may_be_given():
    blocks = Family(2)
    (y,) = blocks.symbols("y")
    system = System({y: blocks.neighbour(y, 1, outside=s * y), s: 0})
    y1, y2 = sp.symbols("y_1 y_2", real=True)
    assert system.model.rhs == (y2, s * y2, 0)


def test_every_element_has_its_own_switch_of_the_same_class():
    multipliers = chain().model.multipliers
    assert [m.symbol.name for m in multipliers] == ["lam_1", "lam_2", "lam_3", "lam_4"]
    assert {m.regularity for m in multipliers} == {"sliding"}
    assert [m.surface for m in multipliers] == [w - u for w in sp.symbols("w_1:5", real=True)]


def test_elements_are_classified_once(monkeypatch):
    calls = []
    original = lowering.classify
    monkeypatch.setattr(lowering, "classify", lambda *args: calls.append(args) or original(*args))
    chain(12)
    assert len(calls) == 1


def test_memories_events_contacts_and_unknowns_are_copied():
    elements = Family(2)
    y, w, a = elements.symbols("y w a")
    stuck = elements.memory("stuck", 1)
    floor = Unilateral(y, restitution=0.5, name="R")
    system = System(
        {y: w, w: a + floor.reaction - sp.Piecewise((1, sp.Eq(stuck, 1)), (0, True))},
        events=[Event(w, update={stuck: 0, w: w + 1}, name="slip")],
        contacts=[floor],
        algebraic=[Algebraic(a, a + y)],
    )
    model = system.model
    assert [e.name for e in model.events] == ["slip 1", "slip 2"]
    assert model.events[1].update == ((5, sp.S.Zero), (3, model.states[3] + 1))
    assert [m.symbol.name for m in model.multipliers] == ["R_1", "R_2", "a_1", "a_2"]
    assert list(system.initial_memory.values()) == [1.0, 1.0]
    assert system.initial_state({"y": [1, 2], "w": 0, "stuck": [0, 1]}) == [1, 2, 0, 0, 0, 1]


def test_values_are_given_by_element_or_once_for_all():
    system = parallel()
    assert [system.parameters[p] for p in system.parameters if p.name.startswith("strength")] == [0.2] * 3
    other = system.with_parameters({"kappa": [1, 2, 3], "strength_2": 5})
    values = {p.name: value for p, value in other.parameters.items()}
    assert values["kappa_3"] == 3 and values["strength_2"] == 5
    assert system.initial_state({"x": 0, "v": 0, "f": [1, 2, 3]}) == [0, 0, 1, 2, 3]
    widths = {"lam": [1e-3, 1e-3, 1e-3, 1e-4]}
    assert list(chain().smoothed(widths).parameters.values())[-1] == 1e-4


def test_the_index_of_an_element_is_a_number():
    elements = Family(3)
    (f,) = elements.symbols("f")
    assert System({f: -elements.index * f}).model.rhs[2] == -3 * sp.Symbol("f_3", real=True)


def test_equal_members_that_were_made_twice_compare_as_equal():
    """sympy does so when it sorts what stands in a sum."""
    chain = Family(4)
    (x,) = chain.symbols("x")
    floor = Unilateral(x, restitution=0.5, name="R")
    for member in (x, chain.memory("m"), floor.reaction):
        first, second = (chain.neighbour(member, -1) for _ in range(2))
        assert first is not second and first == second and first.compare(second) == 0


def test_members_survive_pickling_and_keep_their_offset():
    blocks = Family(4)
    (y,) = blocks.symbols("y")
    for symbol in (y, blocks.neighbour(y, 2), blocks.memory("m", 1)):
        assert pickle.loads(pickle.dumps(symbol)) == symbol
    assert blocks.neighbour(y, 1) != y and Family(5).symbols("y")[0] != y


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Family(0), "`n` of Family is 0"),
        (lambda: System({x: Family(2).symbols("f")[0]}), "outside of its rates take a sum"),
        (lambda: parallel().with_parameters({"kappa": [1, 2]}), "gives 2 values to kappa, which has 3 elements"),
        (lambda: System({Family(2).symbols("f")[0]: Family(3).symbols("g")[0]}), "members of several families"),
        (lambda: RING.neighbour(RING.symbols("f")[0], 1, outside=0), "no ends"),
    ],
)  # fmt: skip
def test_misuse_is_refused(make, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        make()


def test_a_plain_memory_may_stand_in_an_element():
    (f,) = Family(2).symbols("f")
    system = System({f: -f * Memory("gain", 2)})
    assert system.model.n_memory == 1


def test_a_member_and_its_neighbours_are_printed_in_one_order_in_every_process():
    # They have one name; what sympy does not tell apart it sorts by hashes, which no two processes share.
    ring = Family(3, periodic=True)
    (y,) = ring.symbols("y")
    beside = [ring.neighbour(y, k) for k in (2, -1, 1)]
    assert [str(s) for s in sorted([y, *beside], key=sp.default_sort_key)] == ["y[-1]", "y", "y[+1]", "y[+2]"]


@pytest.mark.parametrize("n", [3, 12, 20_000])
def test_an_array_without_axes_is_one_number_for_all(n):
    (x,) = Family(n).symbols("x")
    (k,) = x.family.symbols("k")
    run = solve(System({x: -k * x}, parameters={k: np.array(2.0)}), (0, 1), {x: np.array(1.0)}, t_eval=[1])
    assert np.abs(run.x - np.exp(-2)).max() < 1e-8
