"""What a System refuses, with the value and the remedy."""

import re

import pytest
import sympy as sp
from front_models import PARAMETERS, ball, beta, gms, k, lam, oscillator, rho, t, v, x, z

from pwsmooth import Event, Family, Switch, System


def test_initial_states_are_named_or_positional_and_memories_have_defaults():
    system = gms()
    assert system.initial_state({x: 1, "v": 2, z: 3}) == [1, 2, 3, 1]
    assert system.initial_state({"x": 1, "v": 2, "z": 3, "stuck": 0}) == [1, 2, 3, 0]
    assert system.initial_state([1, 2, 3]) == [1, 2, 3, 1]
    assert system.initial_state((1, 2, 3, 0)) == [1, 2, 3, 0]


@pytest.mark.parametrize(
    ("x0", "error", "message"),
    [
        ({"y": 0, "v": 0, "w": 1}, ValueError, "`x0` names 'w', which is no state of this system; its"),
        ({"y": 0, "v": 0, "z": 1}, ValueError, "`x0` names 'z', which is no state of this view: it is layered"),
        ({"y": 0}, ValueError, "`x0` has no value for v"),
        ([1, 2, 3], ValueError, "`x0` has 3 values; this view has 2 states (y, v)"),
        ([1, float("nan")], ValueError, "`x0`, value of 'v' is nan"),
        ({"y": sp.oo, "v": 0}, ValueError, "`x0`, value of 'y' is oo"),
        ({"y": "one", "v": 0}, TypeError, "`x0`, value of 'y' is 'one'"),
        (3, TypeError, "`x0` is 3"),
    ],
)
def test_bad_initial_states_are_refused(x0, error, message):
    with pytest.raises(error, match=re.escape(message)):
        oscillator().layered({z: sp.oo}).initial_state(x0)


def decay(value):
    tau = sp.Symbol("tau", real=True)
    return System({v: -Switch("lam", v) * (1 + z), z: (1 - z) / tau}, parameters={tau: value})


def ticking(period):
    T = sp.Symbol("T", real=True)
    return System({x: -x}, parameters={T: period}, events=[Event(every=T, update={x: 1})])


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: System({}), ValueError, "`rates` is empty"),
        (lambda: System([(x, 1), ("x", 2)]), ValueError, "`rates` lists the state 'x' twice"),
        (lambda: System({x: "1"}), TypeError, "the rate of x is '1'"),
        (lambda: System({x: sp.nan}), ValueError, "the rate of x is nan"),
        (lambda: System({x: x > 0}), TypeError, "the rate of x is x > 0"),
        (lambda: System({x: sp.Function("f")(x)}), ValueError, "contains f(x)"),
        (lambda: System({lam: 1, v: lam}), ValueError, "gives a rate to 'lam', a Switch"),
        (lambda: System({x: -x * k}), ValueError, "the system uses k, without a rate or a value"),
        (lambda: System({x: sp.sin(t)}), ValueError, "If t is time, say time=t"),
        (lambda: System({x: -x}, parameters={"q": 1}), ValueError, "names 'q', which stands nowhere"),
        (lambda: System({x: -x}, parameters={x: 1}), ValueError, "gives a value to 'x', which is a state"),
        (
            lambda: oscillator(parameters=PARAMETERS | {beta: -0.1}),
            ValueError,
            "'beta' is -0.1; beta must be >= 0",
        ),
        (lambda: oscillator(parameters=PARAMETERS | {rho: float("nan")}), ValueError, "value of 'rho' is nan"),
        (lambda: oscillator(parameters=PARAMETERS | {rho: [1, 2]}), TypeError, "value of 'rho' is [1, 2]"),
        (lambda: System({x: -sp.Symbol("x")}), ValueError, "two different symbols are named 'x'"),
        (lambda: System({v: -lam, x: Switch("lam", x)}), ValueError, "two switches are named 'lam'"),
        (lambda: System({v: -Switch("v", v)}), ValueError, "two different symbols are named 'v'"),
        (lambda: System({x: -sp.Dummy("x")}), TypeError, "rate of x is -_x, no expression"),
        (lambda: System({v: Switch("lam", k)}, parameters={k: 1}), ValueError, "no state, no time stands"),
        (lambda: System({v: 1}, time=v), ValueError, "`time` is v, which is a state"),
        (lambda: System({v: 1}, events=[v]), TypeError, "`events` contains v"),
        (lambda: System({v: 1}, events=[Event(v, update={"w": 0})]), ValueError, "'w', which is no state or"),
        (lambda: System({v: 1}, events=[Event(every=v)]), ValueError, "of event 'event 1' depend on v"),
        (lambda: System({v: 1}, algebraic=[v]), TypeError, "`algebraic` contains v"),
        (lambda: System({v: 1}, contacts=[v]), TypeError, "`contacts` contains v"),
        (lambda: oscillator(parameters=PARAMETERS | {beta: 0}), ValueError, "the rate of 'z' divides by beta"),
        (lambda: oscillator().with_parameters({"beta": 0}), ValueError, "system.layered({z: sympy.oo})"),
        (lambda: decay(-0.1).layered({z: 1}), ValueError, "`time_constant` tau of 'z' is -0.1"),
        (lambda: ticking(0), ValueError, "`every` of event 'event 1' is T = 0"),
        (lambda: ball(1.5), ValueError, "the restitution e of contact 'R' is 1.5"),
        (lambda: ball(0.5).with_parameters({"e": -1}), ValueError, "the restitution e of contact 'R' is -1"),
        (lambda: oscillator(convention="sum"), ValueError, "`convention` is 'sum'"),
        (lambda: oscillator().with_parameters({"q": 1}), ValueError, "names 'q', which is no parameter"),
        (lambda: oscillator().with_parameters({"N": -1}), ValueError, "value of 'N' is -1"),
        (lambda: oscillator().smoothed(0), ValueError, "`eps` is 0; give a number > 0"),
        (lambda: oscillator().smoothed(-1e-3), ValueError, "`eps` is -0.001"),
        (lambda: oscillator().smoothed({"mu": 1}), ValueError, "`eps` names 'mu', which is no switch"),
        (lambda: oscillator().smoothed(1e-3, "step"), ValueError, "`sigmoid` is 'step'"),
        (lambda: oscillator().smoothed(1e-3).with_parameters({"eps": 0}), ValueError, "value of 'eps' is 0"),
        (lambda: oscillator().layered({z: -1}), ValueError, "`ratios`, that of 'z' is -1"),
        (lambda: oscillator().layered({"w": 1}), ValueError, "`ratios` names 'w', which is no state"),
        (lambda: oscillator().layered(None), TypeError, "`ratios` is None; give a dict of states to ratios"),
        (lambda: oscillator().layered({z: 1}, eps_ratio=3), TypeError, "`eps_ratio` is 3; give a dict"),
        (lambda: oscillator().layered({z: 1}, time_constant=5), TypeError, "`time_constant` is 5; give a dict"),
        (
            lambda: oscillator().layered({z: 1}, time_constant={z: "q"}),
            ValueError,
            "names 'q', which is no par",
        ),
        (
            lambda: oscillator().layered({z: 1}, time_constant={z: None}),
            TypeError,
            "`time_constant` of z is None",
        ),
        (lambda: oscillator().with_parameters(3), TypeError, "`parameters` is 3; give a dict"),
        (lambda: oscillator().layered({z: 1}, eps_ratio={lam: 0}), ValueError, "`eps_ratio` of lam is 0"),
        (lambda: oscillator().smoothed(1e-3).layered({z: 1}), ValueError, "`layered` of a smoothed view"),
        (lambda: System({x: -x}).smoothed(1e-3), ValueError, "no switches"),
    ],
)
def test_bad_definitions_are_refused_with_the_value_and_the_remedy(make, error, message):
    with pytest.raises(error, match=re.escape(message)):
        make()


def test_changed_values_are_looked_at_without_walking_through_expressions(monkeypatch):
    blocks = Family(4)
    q, tau = *blocks.symbols("q"), *blocks.symbols("tau", nonnegative=True)
    chain = System({q: -q / tau + blocks.neighbour(q, 1)}, parameters={tau: [1, 2, 3, 4]})
    clock = sp.Symbol("T", positive=True)
    ticks = System({x: -k * x}, parameters={k: 0, clock: 2}, events=[Event(every=clock / 2, update={x: 1})])
    mapped = [
        (chain, {"tau_2": 5}, {"tau_3": 0}),
        (ticks, {clock: 3}, {clock: 0}),
        (oscillator(), {rho: 0}, {beta: 0}),
    ]

    def change():
        for system, good, bad in mapped:
            system.with_parameters(good)
            with pytest.raises(ValueError, match="divides by|value of 'T' is 0"):
                system.with_parameters(bad)

    def walked(self, *_, **__):
        raise AssertionError(f"{self} was walked through")

    change()
    for name in ("atoms", "subs", "replace"):
        monkeypatch.setattr(sp.Basic, name, walked)
    change()
