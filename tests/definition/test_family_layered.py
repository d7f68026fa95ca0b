"""Layered views of families: states that are slaved to the layer leave a template, and with it loops over elements."""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Family, Switch, System, solve

t, u = sp.symbols("t u", real=True)


def blocks(n, periodic=False, fast=None, force=None, reads=False, events=()):
    """(place, velocity, fast state, System): blocks on a belt; `fast` is what z follows, `force` what it does."""
    family = Family(n, periodic)
    x, v, z = family.symbols("x v z")
    mu, beta, r = family.symbols("mu beta r", positive=True)
    lam = Switch("lam", v - u)
    fast, force = (e(x, v, z, lam, r) for e in (fast, force))
    pull = family.neighbour(x, 1) + family.neighbour(x, -1) - 2 * x
    pull += family.neighbour(z, 1) / 3 if reads else 0
    rates = {x: v, v: pull - x / 2 - mu * force, z: (fast - z) / beta}
    values = {mu: [0.6 + 0.01 * k for k in range(n)], r: 0.2, u: 0.2, beta: 0.01}
    values = {s: value for s, value in values.items() if s != r or fast.has(r) or force.has(r)}
    more = [Event(family.neighbour(x, 1) - x - 1 / 2, name="far")] if events else []
    return x, v, z, System(rates, time=t, parameters=values, events=more, outputs={"pull": family.sum(force)})


CASES = {
    "of lambda": dict(fast=lambda x, v, z, lam, r: lam, force=lambda x, v, z, lam, r: lam + r * z),
    "of the state": dict(
        fast=lambda x, v, z, lam, r: sp.tanh(x), force=lambda x, v, z, lam, r: lam * (1 + r * z**2)
    ),
    "read beside": dict(
        fast=lambda x, v, z, lam, r: sp.tanh(x),
        force=lambda x, v, z, lam, r: lam + 0 * r,
        reads=True,
        events=True,
    ),
}


def alike(looped, written):
    assert looped.success and len(looped.events) > 5
    assert sorted((e.switch, e.kind) for e in looped.events) == sorted(
        (e.switch, e.kind) for e in written.events
    )
    times = [np.sort([e.time for e in run.events]) for run in (looped, written)]
    assert np.abs(times[0] - times[1]).max() < 1e-10
    assert np.abs(looped.x - written.x).max() < 1e-10


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("periodic", [False, True])
def test_slaved_states_leave_loops(case, periodic):
    x, v, z, system = blocks(10, periodic, **CASES[case])
    view = system.layered({z: sp.oo})
    assert view.model.families is not None and len(view.states) == 20
    written = view._written_out()
    assert written.model.families is None and written.states == view.states
    start, wanted = {x: np.sin(np.arange(10)).tolist(), v: 0.1}, np.linspace(0, 5, 21)
    runs = [solve(each, (0, 5), start, t_eval=wanted, rtol=1e-11) for each in (view, written)]
    alike(*runs)
    for name in ("z_1", "z_4", "z_10", "pull"):
        assert np.abs(runs[0][name] - runs[1][name]).max() < 1e-9


def test_they_are_those_that_are_fast():
    x, v, z, system = blocks(10, **CASES["of lambda"])
    start = {x: np.sin(np.arange(10)).tolist(), v: 0.1}
    limit = solve(system.layered({z: sp.oo}), (0, 3), start, t_eval=[3]).x[:, -1]
    fast = [solve(system, (0, 3), start | {z: 0}, parameters={"beta": b}, t_eval=[3]) for b in (1e-2, 1e-3)]
    errors = [np.abs(run.x[:20, -1] - limit).max() for run in fast]
    assert errors[1] < errors[0] / 4 and errors[1] < 0.02


def test_static_friction_of_a_slaved_state_goes_by_neighbourhoods():
    # z -> r (1 - lam^2): the force lam (1 + z) has its peak inside of the layer.
    n = 110
    x, v, z, system = blocks(
        n, fast=lambda x, v, z, lam, r: r * (1 - lam**2), force=lambda x, v, z, lam, r: lam * (1 + z)
    )
    _, _, _, plain = blocks(
        n, fast=lambda x, v, z, lam, r: sp.S.Zero, force=lambda x, v, z, lam, r: lam * (1 + r * (1 - lam**2))
    )
    start = {x: np.sin(np.arange(n)).tolist(), v: 0.1}
    options = dict(t_eval=np.linspace(0, 2, 9), rtol=1e-11, local=True)
    looped = solve(system.layered({z: sp.oo}), (0, 2), start, **options)
    given = solve(plain, (0, 2), start | {z: 0}, **options)
    assert [(e.switch, e.kind) for e in looped.events] == [(e.switch, e.kind) for e in given.events]
    assert np.abs(looped.x - given.x[: 2 * n]).max() < 1e-11


def test_what_has_no_template_is_written_out_as_ever():
    x, v, z, system = blocks(9, **CASES["of lambda"])
    assert system.layered({z: 1}).model.families is None  # a layer with a motion of its own
    assert system.layered({"z_3": sp.oo}).model.families is None
    family = Family(9, True)
    y, w = family.symbols("y w")
    coupled = System({y: -sp.sign(y) - w, w: (family.neighbour(w, 1) / 2 + y - w) * 100})
    assert coupled.layered({w: sp.oo}).model.families is None
    run = solve(coupled.layered({w: sp.oo}), (0, 1), {y: 1.0})
    # All alike: w = 2 y, y' = -1 - 2 y until it comes to rest.
    assert run.events[0].time == pytest.approx(np.log(3) / 2, abs=1e-9)


def test_what_is_gone_is_told():
    x, v, z, system = blocks(9, **CASES["of lambda"])
    view = system.layered({z: sp.oo})
    with pytest.raises(ValueError, match="it is layered, z_1 = lam_1 in slow time"):
        solve(view, (0, 1), {x: 0, v: 0, z: 0})
    with pytest.raises(ValueError, match="`ratios`, that of 'z_1' is -1"):
        system.layered({z: -1})
    smooth = view.smoothed(0.01)
    start = {x: np.sin(np.arange(9)).tolist(), v: 0.1}
    ends = [solve(each, (0, 1), start, t_eval=[1]).x for each in (smooth, view._written_out().smoothed(0.01))]
    assert np.array_equal(*ends)


def test_a_time_constant_is_positive_in_every_element():
    x, v, z = Family(9).symbols("x v z")
    (beta,) = x.family.symbols("beta")
    rates = {x: v, v: -x - sp.sign(v) - z / 9, z: (sp.sign(v) - z) / beta}
    with pytest.raises(ValueError, match="`time_constant` beta_9 of 'z_9' is -0.1; give a number > 0"):
        System(rates, parameters={beta: [0.1] * 8 + [-0.1]}).layered({z: sp.oo})


def test_a_slaved_state_may_be_named_as_a_function_of_time():
    family, Z, tau = Family(9), sp.Symbol("Z", real=True), sp.Symbol("tau", positive=True)
    x, v = family.symbols("x v")
    system = System(
        {x: v, v: -x - sp.sign(v) - Z / 9, Z: (family.sum(x) - Z) / tau}, time=t, parameters={tau: 0.1}
    )
    views = [system.layered({name: sp.oo}) for name in (Z, "Z", sp.Function("Z")(t))]
    assert all(view.model.families is not None and len(view.states) == 18 for view in views)
    run = solve(views[2], (0, 1), {x: 1, v: 0})
    assert run["Z"] == pytest.approx(run.x[:9].sum(axis=0))
