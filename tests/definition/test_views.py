"""Views of one definition: layered and smoothed.

Guards: definition/views.py.
"""

import re

import pytest
import sympy as sp
from front_models import PARAMETERS, RATES, beta, lam, lugre, oscillator, rho, t, v, y, z

from pwsmooth import Event, Switch, System, Unilateral
from pwsmooth.definition.model import Select


def test_a_slaved_state_is_no_state_and_its_time_constant_drops_out():
    view = oscillator().layered({z: sp.oo})
    (mult,) = view.model.multipliers
    assert view.states == (y, v) and beta not in view.parameters and "beta drops out" in repr(view)
    assert sp.expand(mult.residual - RATES[v].subs({lam: mult.symbol, z: 1 - mult.symbol**2})) == 0
    assert mult.hidden
    (layer,) = view.model.layer_states
    assert (layer.symbol, layer.ratio) == (z, sp.oo)
    assert layer.rate == 1 - mult.symbol**2 - z and layer.equilibrium == 1 - mult.symbol**2
    assert view.model.layer_residuals == (oscillator().model.multipliers[0].residual,)
    assert view.model.outputs[0][1] == mult.symbol * (1 + rho * (1 - mult.symbol**2))


def test_a_finite_ratio_is_a_parameter_and_zero_is_two_stage():
    view = oscillator().layered({z: 0.5}, sigmoid="tanh")
    ratio = view.model.layer_states[0].ratio
    assert view.parameters[ratio] == 0.5 and view.model.sigmoid == "tanh"
    assert oscillator().layered({z: 0}).model.layer_states[0].ratio == 0


def test_widths_of_layers_are_relative_to_the_first():
    system = System({y: v, v: -2 * sp.sign(y) - sp.sign(v)})
    view = system.layered({}, eps_ratio={"sgn(v)": 2, "sgn(y)": 20})
    assert dict(zip((m.symbol.name for m in view.model.multipliers), view.model.eps_ratio, strict=True)) == {
        "sgn(v)": 1.0, "sgn(y)": 10.0
    }  # fmt: skip
    assert system.model.eps_ratio == (1.0, 1.0)


def test_a_time_constant_used_elsewhere_stays():
    view = oscillator(rates=RATES | {y: v + beta}).layered({z: sp.oo})
    assert beta in view.parameters and "drops out" not in repr(view)


def test_a_numeric_time_constant_is_found():
    parameters = {p: 1 for p in PARAMETERS if p != beta}
    system = oscillator(rates=RATES | {z: 50 * (1 - lam**2 - z)}, parameters=parameters)
    assert system.layered({z: 1}).model.layer_states[0].rate == 1 - sp.Symbol("lam", real=True) ** 2 - z


def test_a_time_constant_that_is_not_unique_asks_for_one():
    tau = sp.Symbol("tau", positive=True)
    rates = RATES | {z: (1 - lam**2 - z) / (beta * tau)}
    system = oscillator(rates=rates, parameters=PARAMETERS | {tau: 1})
    with pytest.raises(ValueError, match=re.escape("time constant of z is not unique: beta, tau")):
        system.layered({z: sp.oo})
    (layer,) = system.layered({z: 1}, time_constant={z: beta * tau}).model.layer_states
    assert layer.rate == 1 - z - sp.Symbol("lam", real=True) ** 2
    with pytest.raises(ValueError, match="y has no time constant"):
        oscillator().layered({y: sp.oo})


def test_an_equilibrium_that_is_not_unique_is_refused():
    with pytest.raises(ValueError, match="equilibrium of z is not unique: 2 solutions"):
        oscillator(rates=RATES | {z: (1 - z**2 * lam) / beta}).layered({z: sp.oo})


def test_coupled_layered_states_come_to_their_common_equilibrium():
    w = sp.Symbol("w", real=True)
    rates = RATES | {z: (1 - lam**2 - z + w) / beta, w: (z - 3 * w) / beta}
    view = oscillator(rates=rates).layered({z: sp.oo, w: sp.oo})
    mult = sp.Symbol("lam", real=True)
    equilibrium = {s.symbol: s.equilibrium for s in view.model.layer_states}
    assert sp.expand(equilibrium[z] - sp.Rational(3, 2) * (1 - mult**2)) == 0
    assert sp.expand(equilibrium[w] - (1 - mult**2) / 2) == 0


def test_a_layered_state_may_not_move_its_own_surface_or_be_reset():
    with pytest.raises(ValueError, match="the surface of lam is v \\+ z"):
        System({v: -Switch("lam", v + z), z: (1 - z) / beta}, parameters={beta: 1}).layered({z: 1})
    with pytest.raises(ValueError, match="event 'reset' updates"):
        oscillator(events=[Event(y, update={z: 0}, name="reset")]).layered({z: 1})


def test_events_of_a_layered_view_count_its_own_states():
    rates = {z: RATES[z], y: v, v: RATES[v]}
    view = oscillator(rates=rates, events=[Event(y, update={v: -v})]).layered({z: 1})
    assert view.states == (y, v) and view.model.events[0].update == ((1, -v),)


@pytest.mark.parametrize("sigmoid", ["algebraic", "tanh", "erf"])
def test_the_smoothed_field_tends_to_the_switched_one(sigmoid):
    system = oscillator()
    smooth = system.smoothed(1e-3, sigmoid).model
    (h, eps), point = smooth.smoothing[0], {t: 0.3, y: 0.2, z: 0.4}
    values = dict(zip(smooth.parameters, system.smoothed(1e-3, sigmoid).parameter_values, strict=True))
    for side in (1, -1):
        for exact, stand_in in zip(system.model.rhs, smooth.rhs, strict=True):
            there = {**point, v: side * 0.5}
            limit = exact.subs({sp.Symbol("lam", real=True): side}).subs({**there, **values})
            # The algebraic sigmoid is the slowest: 1 - Lambda^2 = eps^2/h^2 = 4e-6, divided by beta = 0.1.
            assert abs(stand_in.subs({**values, **there}) - limit) < 5e-5
    assert h == v and smooth.multipliers == () and values[eps] == 1e-3


def test_each_switch_may_have_its_own_width():
    system = System({y: v, v: -2 * sp.sign(y) - sp.sign(v)})
    view = system.smoothed({"sgn(y)": 1e-2, "sgn(v)": 1e-4})
    assert {h: view.parameters[eps] for h, eps in view.model.smoothing} == {v: 1e-4, y: 1e-2}
    with pytest.raises(ValueError, match="`eps` has no width for sgn\\(y\\)"):
        system.smoothed({"sgn(v)": 1e-4})


def test_smoothed_kinks_stay_analytic():
    smooth = lugre().smoothed(1e-4).model
    assert not smooth.rhs[2].has(sp.Piecewise, sp.Abs, Select)


def test_a_jump_with_a_missing_branch_cannot_be_smoothed():
    with pytest.raises(ValueError, match="nothing to blend"):
        System({y: v, v: -1 + sp.Heaviside(y) * (1 + sp.sqrt(y))}).smoothed(1e-3)


def test_contacts_remain_in_a_smoothed_view():
    floor = Unilateral(y, restitution=0.5)
    model = System({y: v, v: -1 - sp.sign(v) + floor.reaction}).smoothed(1e-3).model
    (contact,) = model.multipliers
    assert contact.kind == "contact" and contact.residual == model.rhs[1]


def test_smoothed_views_of_layered_ones():
    system = oscillator()
    slaved = system.layered({z: sp.oo}).smoothed(1e-3)
    assert slaved.states == (y, v)
    finite = system.layered({z: 2}).smoothed(1e-3)
    eps, ratio = finite.model.smoothing[0][1], sp.Symbol("ratio_z", positive=True)
    # beta = eps/r
    direct = system.smoothed(1e-3).model.rhs[2].subs(beta, eps / ratio)
    assert sp.simplify(finite.model.rhs[2] - direct) == 0 and finite.parameters[ratio] == 2
    with pytest.raises(ValueError, match="two-stage"):
        system.layered({z: 0}).smoothed(1e-3)
