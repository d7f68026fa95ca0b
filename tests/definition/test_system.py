"""System: one definition, its lowered model, classes of switches, contacts and hidden terms."""

import doctest
import importlib
import math
import pickle
import subprocess
import sys
from pathlib import Path

import pytest
import sympy as sp
from front_models import (
    PARAMETERS,
    RATES,
    N,
    beta,
    elastoplastic,
    gms,
    hertz,
    k,
    lam,
    lugre,
    oscillator,
    regularity,
    rho,
    sigma,
    t,
    v,
    x,
    y,
    z,
)

from pwsmooth import Algebraic, Memory, Switch, System, Unilateral, solve
from pwsmooth.definition.model import Select
from pwsmooth.definition.pointwise import draw

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
        "import pickle, sys, sympy as sp; from front_models import oscillator, gms; "
        "systems = [oscillator(), oscillator().layered({'z': 2}), oscillator().smoothed(1e-3), gms()]; "
        "sys.stdout.buffer.write(pickle.dumps([(s.model, repr(s.model)) for s in systems]))"
    )
    other = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, check=True, cwd=Path(__file__).parents[1]
    )
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


def test_the_repr_says_so_where_filippovs_convention_stands_in_place_of_hidden_terms():
    lam = Switch("lam", x)
    rates = {x: -lam * (2 - lam**2)}
    assert "convex combination" in repr(System(rates, convention="filippov"))
    assert "convex combination" not in repr(System(rates)) and "hidden terms" in repr(System(rates))


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


@pytest.mark.parametrize(
    "name", ["definition.families.family", "definition.primitives", "definition.sigmoids", "system"]
)
def test_the_examples_of_the_docstrings_run(name):
    outcome = doctest.testmod(importlib.import_module(f"pwsmooth.{name}"))
    assert outcome.attempted > 0 and outcome.failed == 0


def test_import_is_cheap():
    code = (
        "import sys, pwsmooth; from pwsmooth import System, Switch; "
        "print([m for m in ('numba', 'matplotlib', 'scipy', 'xarray') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def test_a_pulse_in_seconds_after_thirty_days_is_there():
    y, at = sp.symbols("y at", real=True)
    for begin, width in ((2592000, 60), (1700000000, 3600)):
        pulse = System({y: sp.Piecewise((1, (at > begin) & (at < begin + width)), (0, True))}, time=at)
        assert solve(pulse, (begin - 1000, begin + 10000), {y: 0})["y"][-1] == pytest.approx(width, abs=1e-5)
