"""Primitives: what defines them is part of their identity, and nonsense is refused at the door."""

import pickle
import re

import pytest
import sympy as sp

from pwsmooth import Algebraic, Event, Memory, Switch, Unilateral

v, w, y = sp.symbols("v w y", real=True)


def test_switches_of_one_name_and_different_surfaces_are_different_symbols():
    assert Switch("lam", v) != Switch("lam", v + 1)
    assert Switch("lam", v) == Switch("lam", v)
    assert hash(Switch("lam", v)) == hash(Switch("lam", v))
    # sympy's caches key on equality: a product must not come back with the other surface.
    assert (2 * Switch("lam", w)).free_symbols == {Switch("lam", w)} != (2 * Switch("lam", v)).free_symbols


@pytest.mark.parametrize(
    "symbol",
    [Switch("lam", v**2 - 1), Memory("speed", 0.5, positive=True), Unilateral(y - v, restitution=0.5).reaction],
    ids=["switch", "memory", "reaction"],
)
def test_symbols_survive_pickling_with_all_that_defines_them(symbol):
    copy = pickle.loads(pickle.dumps(symbol))
    assert copy == symbol and hash(copy) == hash(symbol)
    for attribute in type(symbol).__slots__:
        assert getattr(copy, attribute) == getattr(symbol, attribute)


def test_a_memory_is_told_apart_by_its_initial_value():
    assert Memory("flag", 0) != Memory("flag", 1)
    assert Memory("flag", 0) != sp.Symbol("flag", real=True)


def test_srepr_shows_what_defines_a_symbol():
    assert sp.srepr(Switch("lam", v)) == "Switch('lam', Symbol('v', real=True))"
    assert sp.srepr(Memory("flag", 1)) == "Memory('flag', 1.0)"


def test_switches_and_memories_are_real_and_independent_of_the_state():
    lam = Switch("lam", v)
    assert lam.is_real and Memory("m", 0).is_real
    assert (v * lam).diff(v) == lam


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Switch("lam", 3), ValueError, "`surface` of Switch 'lam' is the constant 3"),
        (lambda: Switch("lam", v - v), ValueError, "`surface` of Switch 'lam' is the constant 0"),
        (lambda: Switch("lam", v > 0), TypeError, "no expression"),
        (lambda: Switch("lam", "v"), TypeError, "`surface` of Switch 'lam' is 'v'"),
        (lambda: Switch("", v), TypeError, "`name` of a Switch is ''"),
        (lambda: Memory("m", float("nan")), ValueError, "`initial` of Memory 'm' is nan"),
        (lambda: Memory("m", "zero"), TypeError, "`initial` of Memory 'm' is 'zero'"),
        (lambda: Unilateral(2), ValueError, "`gap` of Unilateral 'R' is the constant 2"),
        (lambda: Unilateral(y, restitution=1.1), ValueError, "`restitution` of Unilateral 'R' is 1.1"),
        (lambda: Unilateral(y, restitution=-0.1), ValueError, "give 0 <= e <= 1"),
        (lambda: Algebraic("a", v + 1), ValueError, "`residual` of Algebraic 'a' is v + 1"),
        (lambda: Event(), ValueError, "exactly one of `surface`, `every`, `at`; given: none"),
        (lambda: Event(v, every=1), ValueError, "given: surface, every"),
        (lambda: Event(v, direction=2), ValueError, "`direction` of an Event is 2"),
        (lambda: Event(every=1, direction=1), ValueError, "`direction` has no meaning"),
        (lambda: Event(sp.Integer(1)), ValueError, "`surface` of an Event is the constant 1"),
        (lambda: Event(every=0), ValueError, "`every` of an Event is 0; give a period > 0"),
        (lambda: Event(every=-1.5), ValueError, "`every` of an Event is -1.5"),
        (lambda: Event(at=[]), ValueError, "`at` of an Event is ()"),
        (lambda: Event(at=[1, sp.oo]), ValueError, "`at` of an Event is oo"),
        (lambda: Event(v, update=[(v, 0)]), TypeError, "`update` of an Event is [(v, 0)]"),
        (lambda: Event(v, update={v: sp.nan}), ValueError, "value of v is nan"),
        (lambda: Event(v, when=v), TypeError, "`when` of an Event is v"),
    ],
)
def test_bad_definitions_name_the_argument_and_the_value(make, error, message):
    with pytest.raises(error, match=re.escape(message)):
        make()


def test_an_event_keeps_what_it_was_given():
    speed = Memory("speed", 1)
    event = Event(y, direction=1, update={speed: w, "y": 0}, when=sp.Eq(speed, 1), terminal=True, name="stop")
    assert (event.surface, event.direction, event.terminal, event.name) == (y, 1, True, "stop")
    assert event.when == sp.Eq(speed, 1)
    assert dict(event.update) == {speed: w, "y": 0}
    assert Event(at=2).at == (2,) and Event(at=[1, 2]).at == (1, 2)


def test_the_reaction_knows_its_gap():
    floor = Unilateral(y, restitution=sp.Rational(1, 2), name="R_floor")
    assert floor.reaction.gap == y and floor.reaction.name == "R_floor"
    assert floor.reaction == Unilateral(y, restitution=sp.Rational(1, 2), name="R_floor").reaction


def test_an_algebraic_unknown_may_be_named():
    a = sp.Symbol("a", real=True)
    assert Algebraic("a", a + v).unknown == a
