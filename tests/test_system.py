"""System: one definition, its lowered model, its views, and what it refuses."""

import doctest
import importlib
import math
import pickle
import re
import subprocess
import sys

import pytest
import sympy as sp

from pwsmooth import Algebraic, Event, Memory, Switch, System, Unilateral
from pwsmooth.model import Select
from pwsmooth.pointwise import draw

t, x, y, v, z = sp.symbols("t x y v z", real=True)
rho, beta, k, c, N, sigma, omega = sp.symbols("rho beta k c N sigma omega", nonnegative=True)
lam = Switch("lam", v)
PARAMETERS = {rho: 3, beta: 0.1, k: 3.1, c: 0.1, N: 1, sigma: 2.4, omega: 1}
RATES = {
    y: v,
    v: -sigma * sp.sin(omega * t) - k * y - c * v - N * lam * (1 + rho * z),
    z: (1 - lam**2 - z) / beta,
}


def oscillator(**changes):
    options = {"time": t, "parameters": PARAMETERS, "outputs": {"mu": lam * (1 + rho * z)}} | changes
    return System(options.pop("rates", RATES), **options)


def regularity(system):
    return {m.symbol.name: m.regularity for m in system.model.multipliers if m.kind == "switch"}


# ---- the lowered model


def test_the_model_is_the_definition_in_plain_symbols():
    model = oscillator().model
    mult = model.multipliers[0]
    assert model.states == (y, v, z) and model.time == t and model.parameters == tuple(PARAMETERS)
    assert mult.symbol == sp.Symbol("lam", real=True) and type(mult.symbol) is sp.Symbol
    assert mult.surface == v and mult.residual == model.rhs[1] and mult.regularity == "sliding"
    assert model.outputs == (("mu", mult.symbol * (1 + rho * z)),)


def test_names_may_be_given_as_strings():
    named = System(
        {"y": v, "v": RATES[v], "z": RATES[z]},
        time="t",
        parameters={p.name: value for p, value in PARAMETERS.items()},
        outputs={"mu": lam * (1 + rho * z)},
    )
    assert named.model == oscillator().model
    assert named.layered({"z": sp.oo}).model == oscillator().layered({z: sp.oo}).model
    assert named.smoothed({"lam": 1e-3}).model == oscillator().smoothed({lam: 1e-3}).model


def test_models_are_equal_hashable_and_written_alike_in_another_process():
    code = (
        "import pickle, sys, sympy as sp; from tests.test_system import oscillator, gms; "
        "systems = [oscillator(), oscillator().layered({'z': 2}), oscillator().smoothed(1e-3), gms()]; "
        "sys.stdout.buffer.write(pickle.dumps([(s.model, repr(s.model)) for s in systems]))"
    )
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    here = [oscillator(), oscillator().layered({z: 2}), oscillator().smoothed(1e-3), gms()]
    for system, (model, written) in zip(here, pickle.loads(other.stdout), strict=True):
        assert model == system.model and hash(model) == hash(system.model)
        assert written == repr(system.model)


def test_random_points_are_a_function_of_names_alone():
    first = [draw(x, k) for k in range(3)]
    draw.cache_clear()
    assert [draw(x, k) for k in range(3)] == first and len(set(first)) == 3


def test_systems_and_views_survive_pickling():
    for system in (oscillator(), oscillator().layered({z: 0.5}), oscillator().smoothed(1e-3)):
        copy = pickle.loads(pickle.dumps(system))
        assert copy.model == system.model and copy.parameters == system.parameters
        assert copy.with_parameters({"N": 2}).parameters[N] == 2


def test_with_parameters_changes_values_and_derives_nothing():
    system = oscillator()
    other = system.with_parameters({"sigma": 1.2})
    assert other.model is system.model and other.parameters[sigma] == 1.2 and system.parameters[sigma] == 2.4
    assert other.smoothed(1e-3).model is system.smoothed(1e-2).model
    assert system.layered({z: 2}).model is other.layered({z: 3}).model


def test_parameter_values_follow_the_order_of_the_model():
    view = oscillator().smoothed(1e-3)
    assert view.parameter_values == tuple(view.parameters[p] for p in view.model.parameters)
    assert view.parameter_values[-1] == 1e-3


# ---- hidden terms


def test_hidden_terms_are_what_vanishes_off_the_surface():
    ((where, mult, term),) = oscillator().hidden_terms
    assert (where, mult.name) == ("z", "lam") and sp.expand(term - (1 - mult**2) / beta) == 0


def test_a_term_nonlinear_in_lambda_is_hidden_only_if_it_acts_on_the_surface():
    assert System({y: v, v: -k * y - lam * sp.Abs(v)}, parameters={k: 1}).hidden_terms == ()


def test_lifted_products_are_hidden_terms():
    system = System({x: -sp.sign(x), y: 2 * sp.sign(x) ** 2 - 1})
    ((where, mult, term),) = system.hidden_terms
    assert where == "y" and term == 2 * mult**2 - 2


def test_the_repr_lists_hidden_terms_and_classes():
    text = repr(oscillator())
    assert "lam = sign(v)   (sliding)" in text
    assert "-lam**2/beta + 1/beta   in z'" in text


def test_filippovs_convention_takes_the_convex_combination():
    hidden = Switch("lam", x)
    rates = {x: -hidden, y: 2 * hidden**2 - 1}
    mult = sp.Symbol("lam", real=True)
    assert System(rates).model.rhs == (-mult, 2 * mult**2 - 1)
    assert System(rates, convention="filippov").model.rhs == (-mult, 1)


def test_a_residual_nonlinear_in_its_multiplier_is_marked_hidden():
    hidden = Switch("lam", x)
    cubic = System({x: y / 10 + hidden - 2 * hidden**3, y: -hidden}).model.multipliers[0]
    assert cubic.hidden and cubic.residual == y / 10 + cubic.symbol - 2 * cubic.symbol**3
    assert not System({x: -hidden, y: 2 * hidden**2 - 1}).model.multipliers[0].hidden


# ---- classes of switches


def lugre():
    F_c, F_s, s0, s1, s2, v_s, u = sp.symbols("F_c F_s sigma_0 sigma_1 sigma_2 v_s u", positive=True)
    zdot = v - s0 * sp.Abs(v) / (F_c + (F_s - F_c) * sp.exp(-((v / v_s) ** 2))) * z
    values = {s0: 1e5, s1: 316.23, s2: 0.4, F_c: 1, F_s: 1.5, v_s: 1e-3, u: 1}
    return System({x: v, v: u - s0 * z - s1 * zdot - s2 * v, z: zdot}, parameters=values)


def elastoplastic():
    F_c, F_s, s0, v_s, z_ba, z_max = sp.symbols("F_c F_s sigma_0 v_s z_ba z_max", positive=True)
    size, middle, width = sp.Abs(z), (z_max + z_ba) / 2, z_max - z_ba
    alpha = sp.Piecewise(
        (0, sp.Or(sp.Ne(sp.sign(z), sp.sign(v)), size <= z_ba)),
        ((1 + sp.sin(sp.pi * (size - middle) / width)) / 2, size < z_max),
        (1, True),
    )
    g = F_c + (F_s - F_c) * sp.exp(-((v / v_s) ** 2))
    values = {F_c: 1, F_s: 1.5, s0: 1e5, v_s: 1e-3, z_ba: 13e-6, z_max: 15e-6}
    return System({v: -s0 * z, z: v * (1 - alpha * sp.sign(v) * z * s0 / g)}, parameters=values)


def test_the_speed_in_lugre_is_a_kink():
    assert regularity(lugre()) == {"sgn(v)": "kink"}


def test_every_surface_of_the_elastoplastic_law_is_a_kink():
    classes = regularity(elastoplastic())
    assert set(classes.values()) == {"kink"}
    assert {s.surface for s in elastoplastic().switches} >= {v, z}


def test_friction_slides_and_position_surfaces_cross():
    system = System({y: v, v: -2 * sp.sign(y) - sp.sign(v)})
    assert regularity(system) == {"sgn(v)": "sliding", "sgn(y)": "crossing"}


def test_a_switch_of_time_crosses():
    assert regularity(System({x: sp.sign(sp.sin(t)) - x}, time=t)) == {"sgn(sin(t))": "crossing"}


def test_a_hidden_term_alone_makes_no_kink():
    # f(+1) = f(-1), but f(0) differs: the layer has something to decide.
    system = System({x: 1 - Switch("lam", x) ** 2, y: x})
    assert regularity(system) == {"lam": "sliding"}


def test_a_jump_that_vanishes_for_the_given_value_only_is_still_a_jump():
    assert regularity(oscillator(parameters=PARAMETERS | {N: 0})) == {"lam": "sliding"}


def test_two_notations_of_one_surface_slide_together():
    # x' = -2 if x > y else 2;  y' = -3 if y > x else 1.5
    system = System({x: sp.Piecewise((-2, x > y), (2, True)), y: sp.Piecewise((-3, y > x), (1.5, True))})
    (mult,) = system.model.multipliers
    assert mult.surface == x - y and mult.regularity == "sliding"
    slope = mult.residual.subs({mult.symbol: 1}), mult.residual.subs({mult.symbol: -1})
    assert slope == (-3.5, 5)


def test_a_surface_is_met_at_its_own_size():
    # A journal touches its bearing at a clearance of 1e-4; states of size 1 never lie on that circle.
    clearance, K = sp.symbols("clearance K", positive=True)
    depth = sp.sqrt(x**2 + y**2) - clearance
    push = sp.Piecewise((K * depth**1.5, depth > 0), (0, True))
    u, w = sp.symbols("u w", real=True)
    rates = {x: u, y: w, u: -push * x / (depth + clearance), w: -1 - push * y / (depth + clearance)}
    system = System(rates, parameters={clearance: 1e-4, K: 1e11})
    assert set(regularity(system).values()) == {"kink"}


def test_a_quadratic_surface_has_its_gradient_in_the_residual():
    w = 2 * sp.pi
    inside = x**2 + y**2 < 1
    system = System({
        x: sp.Piecewise((x - w * y, inside), (x + w * y, True)),
        y: sp.Piecewise((w * x + y, inside), (-w * x + y, True)),
    })  # fmt: skip
    (mult,) = system.model.multipliers
    # Both rotations grow at the same rate: nothing slides, everything crosses.
    assert mult.regularity == "crossing"
    assert sp.expand(mult.residual.subs(mult.symbol, 1) - 2 * (x**2 + y**2)) == 0


# ---- contacts


def test_a_ball_on_a_floor_has_newtons_impact_and_a_closed_contact():
    floor = Unilateral(y, restitution=0.9)
    model = System({y: v, v: -9.81 + floor.reaction}).model
    (contact,) = model.multipliers
    assert contact.kind == "contact" and contact.surface == y
    assert contact.residual == contact.symbol - 9.81  # R = g at rest
    assert contact.impact == (y, -0.9 * v)


def test_an_impact_distributes_the_impulse_over_the_masses():
    # Two bodies of masses 1 and 3 that collide elastically at x = y; momentum is kept.
    m, M, u, w = (*sp.symbols("m M", positive=True), *sp.symbols("u w", real=True))
    contact = Unilateral(x - y, restitution=1)
    R = contact.reaction
    model = System({x: u, y: w, u: R / m, w: -R / M}, parameters={m: 1, M: 3}).model
    after = model.multipliers[0].impact
    values = {u: -2, w: 1, m: 1, M: 3}
    before, behind = (-2, 1), (after[2].subs(values), after[3].subs(values))
    assert behind[0] + 3 * behind[1] == before[0] + 3 * before[1]
    assert behind[0] - behind[1] == -(before[0] - before[1])


def test_a_moving_floor_is_met_with_the_relative_speed():
    contact = Unilateral(y - sp.sin(t), restitution=sp.Rational(1, 2))
    after = System({y: v, v: -1 + contact.reaction}, time=t).model.multipliers[0].impact
    assert sp.expand(after[1] - sp.cos(t) + (v - sp.cos(t)) / 2) == 0


def test_a_reaction_that_acts_on_nothing_is_refused():
    floor = Unilateral(y)
    with pytest.raises(ValueError, match="stands in no rate"):
        System({y: v, v: -1}, contacts=[floor])
    with pytest.raises(ValueError, match="second derivative"):
        System({y: v, v: -1, x: floor.reaction})
    with pytest.raises(ValueError, match="first derivative"):
        System({y: v + floor.reaction, v: -1})


# ---- the three hard models


def gms():
    """A generalised Maxwell-slip element on a mass: a flag, guards, the order of event and switch."""
    kappa, C, share, F_c, F_s, v_s, damping = sp.symbols("kappa C share F_c F_s v_s damping", positive=True)
    stuck = Memory("stuck", 1)
    s = F_c + (F_s - F_c) * sp.exp(-((v / v_s) ** 2))
    zdot = sp.Piecewise((v, sp.Eq(stuck, 1)), (C / kappa * (share * sp.sign(v) - kappa * z / s), True))
    force = kappa * z + damping * zdot
    return System(
        {x: v, v: 2 * sp.cos(t) - force, z: zdot},
        time=t,
        parameters={kappa: 2.5, C: 50, share: 0.1, F_c: 1, F_s: 2, v_s: 8, damping: 0.01},
        outputs={"force": force},
        events=[
            Event(sp.Abs(kappa * z) - share * s, direction=1, update={stuck: 0}, name="slip",
                  when=sp.And(sp.Eq(stuck, 1), z * v > 0)),
            Event(v, when=sp.Eq(stuck, 0), update={stuck: 1}, name="stick"),
        ],
    )  # fmt: skip


def test_a_gms_element_keeps_its_flag_and_its_guards():
    system = gms()
    model = system.model
    flag = sp.Symbol("stuck", real=True)
    assert model.states == (x, v, z, flag) and model.n_memory == 1 and model.rhs[3] == 0
    slip, stick = model.events
    assert slip.update == ((3, sp.S.Zero),) and stick.update == ((3, sp.S.One),)
    assert slip.when == sp.And(sp.Eq(flag, 1), v * z > 0) and slip.direction == 1
    # The threshold contains |z|: the switch of z stands in the event's surface, by its status.
    assert any(s.args[1] == z for s in slip.surface.atoms(Select))
    # In slip the element pushes with sign(v); in stick it follows v, whatever the side.
    rate, mult = model.rhs[2], sp.Symbol("sgn(v)", real=True)
    assert rate.subs({flag: 1}) == v
    C, share, kappa = sp.symbols("C share kappa", positive=True)
    assert sp.expand(rate.subs({flag: 0, mult: 1}) - rate.subs({flag: 0, mult: -1})) == 2 * C * share / kappa
    assert regularity(system) == {"sgn(v)": "sliding", "sgn(z)": "kink"}
    assert system.initial_memory == {Memory("stuck", 1): 1.0}
    assert system.hidden_terms == ()


def hertz():
    """Hertz contact with a damping factor from the impact speed, latched at touch-down."""
    K, eta, m = sp.symbols("K eta m", positive=True)
    speed = Memory("speed", 1.0, positive=True)
    force = sp.Piecewise((K * y**1.5 * (1 + eta * v / speed), y > 0), (0, True))
    return System(
        {y: v, v: 9.81 - force / m},
        parameters={K: 1e11, eta: 0.4, m: 1},
        outputs={"force": force},
        events=[Event(y, direction=1, update={speed: sp.Max(v, 1e-6)}, name="touch-down")],
    )


def test_a_hertz_contact_latches_its_speed_and_is_a_kink():
    system = hertz()
    model = system.model
    assert regularity(system) == {"sgn(y)": "kink"}
    assert model.events[0].update[0][0] == 2 and model.states[2].name == "speed"
    (selection,) = model.rhs[1].atoms(Select)
    mult = model.multipliers[0].symbol
    assert selection.args[0] == mult and selection.args[2] == 0 and selection.args[1].has(y**1.5)
    assert model.rhs[1].xreplace({mult: -sp.S.One}) == 9.81


def test_a_hertz_contact_stays_a_selection_when_smoothed():
    smooth = hertz().smoothed(1e-6).model
    assert not smooth.multipliers and smooth.smoothing == ((y, sp.Symbol("eps", positive=True)),)
    assert smooth.rhs[1].subs({y: -1, v: 1}) == 9.81


def test_an_elastoplastic_nest_has_the_lifted_values():
    system = elastoplastic()
    point = {v: 1e-3, z: 14e-6} | system.parameters
    for mult in system.model.multipliers:  # the inner switches first
        point[mult.symbol] = sp.sign(mult.surface.subs(point))
    # |z| is halfway between z_ba and z_max: alpha = 1/2; v = v_s
    g = 1 + 0.5 * math.exp(-1)
    expected = 1e-3 * (1 - 0.5 * 14e-6 * 1e5 / g)
    assert float(system.model.rhs[1].subs(point)) == pytest.approx(expected, rel=1e-12)


# ---- algebraic unknowns


def test_friction_that_depends_on_the_acceleration_keeps_its_surface_by_itself():
    a = sp.Symbol("a", real=True)
    law = Algebraic(a, a + 2 * sp.sign(a) * sp.exp(-sp.Abs(v)) + sp.sign(v) + x)
    system = System({x: v, v: a}, algebraic=[law])
    by_name = {m.symbol.name: m for m in system.model.multipliers}
    assert by_name["a"].kind == "algebraic" and by_name["a"].surface is None
    assert by_name["sgn(a)"].surface == a and by_name["sgn(a)"].residual == a
    # v' = a, and a depends on sign(v) through its residual: relative degree 1.
    assert by_name["sgn(v)"].regularity == "sliding" and by_name["sgn(v)"].residual == a


# ---- views


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


# ---- initial states


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


# ---- bad input at the door


def decay(value):
    tau = sp.Symbol("tau", real=True)
    return System({v: -Switch("lam", v) * (1 + z), z: (1 - z) / tau}, parameters={tau: value})


def ticking(period):
    T = sp.Symbol("T", real=True)
    return System({x: -x}, parameters={T: period}, events=[Event(every=T, update={x: 1})])


def ball(restitution):
    e = sp.Symbol("e", real=True)
    return System({y: v, v: -1 + Unilateral(y, restitution=e).reaction}, parameters={e: restitution})


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
        (lambda: oscillator(parameters=PARAMETERS | {beta: -0.1}), ValueError, "'beta' is -0.1, but its"),
        (lambda: oscillator(parameters=PARAMETERS | {rho: float("nan")}), ValueError, "parameter 'rho' is nan"),
        (lambda: oscillator(parameters=PARAMETERS | {rho: [1, 2]}), TypeError, "parameter 'rho' is [1, 2]"),
        (lambda: System({x: -sp.Symbol("x")}), ValueError, "two different symbols are named 'x'"),
        (lambda: System({v: -lam, x: Switch("lam", x)}), ValueError, "two switches are named 'lam'"),
        (lambda: System({v: -Switch("v", v)}), ValueError, "two different symbols are named 'v'"),
        (lambda: System({x: -sp.Dummy("x")}), TypeError, "is a Dummy"),
        (lambda: System({v: Switch("lam", k)}, parameters={k: 1}), ValueError, "no state, no time stands"),
        (lambda: System({v: 1}, time=v), ValueError, "`time` is v, which is a state"),
        (lambda: System({v: 1}, events=[v]), TypeError, "`events` contains v"),
        (lambda: System({v: 1}, events=[Event(v, update={"w": 0})]), ValueError, "'w', which is no state or"),
        (lambda: System({v: 1}, events=[Event(every=v)]), ValueError, "of event 'event 1' depend on v"),
        (lambda: System({v: 1}, algebraic=[v]), TypeError, "`algebraic` contains v"),
        (lambda: System({v: 1}, contacts=[v]), TypeError, "`contacts` contains v"),
        (lambda: oscillator(parameters=PARAMETERS | {beta: 0}), ValueError, "the rate of 'z' divides by beta"),
        (lambda: oscillator().with_parameters({"beta": 0}), ValueError, "system.layered({z: sympy.oo})"),
        (lambda: decay(-0.1).layered({z: 1}), ValueError, "the time constant tau of 'z' is -0.1"),
        (lambda: ticking(0), ValueError, "`every` of event 'event 1' is T = 0"),
        (lambda: ball(1.5), ValueError, "the restitution e of contact 'R' is 1.5"),
        (lambda: ball(0.5).with_parameters({"e": -1}), ValueError, "the restitution e of contact 'R' is -1"),
        (lambda: oscillator(convention="sum"), ValueError, "`convention` is 'sum'"),
        (lambda: oscillator().with_parameters({"q": 1}), ValueError, "names 'q', which is no parameter"),
        (lambda: oscillator().with_parameters({"N": -1}), ValueError, "parameter 'N' is -1"),
        (lambda: oscillator().smoothed(0), ValueError, "`eps` is 0; give a number > 0"),
        (lambda: oscillator().smoothed(-1e-3), ValueError, "`eps` is -0.001"),
        (lambda: oscillator().smoothed({"mu": 1}), ValueError, "`eps` names 'mu', which is no switch"),
        (lambda: oscillator().smoothed(1e-3, "step"), ValueError, "`sigmoid` is 'step'"),
        (lambda: oscillator().smoothed(1e-3).with_parameters({"eps": 0}), ValueError, "parameter 'eps' is 0"),
        (lambda: oscillator().layered({z: -1}), ValueError, "the ratio of 'z' is -1"),
        (lambda: oscillator().layered({"w": 1}), ValueError, "`layered` names 'w', which is no state"),
        (lambda: oscillator().layered({z: 1}, eps_ratio={lam: 0}), ValueError, "`eps_ratio` of lam is 0"),
        (lambda: oscillator().smoothed(1e-3).layered({z: 1}), ValueError, "`layered` of a smoothed view"),
        (lambda: System({x: -x}).smoothed(1e-3), ValueError, "no switches"),
    ],
)
def test_bad_definitions_are_refused_with_the_value_and_the_remedy(make, error, message):
    with pytest.raises(error, match=re.escape(message)):
        make()


@pytest.mark.parametrize("name", ["family", "primitives", "sigmoids", "system"])
def test_the_examples_of_the_docstrings_run(name):
    outcome = doctest.testmod(importlib.import_module(f"pwsmooth.{name}"))
    assert outcome.attempted > 0 and outcome.failed == 0


def test_import_is_cheap():
    code = (
        "import sys, pwsmooth; from pwsmooth import System, Switch; "
        "print([m for m in ('numba', 'matplotlib', 'scipy', 'xarray') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"
