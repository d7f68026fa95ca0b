"""Lifting: ordinary notation becomes switches and selections with the same values.

Guards: definition/reading.py, definition/regularity.py.
"""

import math
import random

import pytest
import sympy as sp

from pwsmooth import Memory, Switch, System, solve
from pwsmooth.definition.lifting import Lifting
from pwsmooth.definition.model import Select
from pwsmooth.definition.pointwise import value

x, y, v, z, d = sp.symbols("x y v z d", real=True)
STATES = (x, y, v, z, d)
p = sp.Symbol("p", positive=True)
q, t = sp.symbols("q t", real=True)
HALF = sp.Rational(1, 2)


def lift(expr, *switches, **options):
    lifting = Lifting(STATES, switches)
    return lifting(expr, **options), lifting.switches


def only(switches):
    (lam,) = switches
    return lam


# ---- one function


def test_sign_becomes_a_multiplier():
    lifted, switches = lift(p * sp.sign(v) * (1 + z))
    lam = only(switches)
    assert switches[lam] == v and lifted == p * lam * (1 + z)


def test_abs_max_and_min_select():
    for expr, h, above, below in [
        (sp.Abs(v), v, v, -v),
        (sp.Max(x, y), x - y, x, y),
        (sp.Min(x, y), x - y, y, x),
        (sp.Max(0, d), d, d, 0),
    ]:
        lifted, switches = lift(expr)
        lam = only(switches)
        assert switches[lam] == h and lifted == Select(lam, above, below)


def test_piecewise_selects_by_its_condition():
    lifted, switches = lift(sp.Piecewise((x, x > y), (z, True)))
    assert lifted == Select(only(switches), x, z)
    lifted, switches = lift(sp.Piecewise((x, x < y), (z, True)))
    assert lifted == Select(only(switches), z, x)


def test_the_three_cases_of_one_surface_are_one_selection():
    # The value on the surface itself belongs to the multiplier.
    lifted, switches = lift(sp.Piecewise((3, x > 0), (-2, x < 0), (7, True)))
    assert lifted == Select(only(switches), 3, -2)


def test_and_or_not_select_corner_by_corner():
    a, b = sp.symbols("a b")
    corner = sp.Piecewise((a, sp.And(x > 0, y > 0)), (b, True))
    lifted, switches = lift(corner)
    lam, mu = switches
    assert lifted == Select(lam, Select(mu, a, b), b)
    assert lift(sp.Piecewise((a, sp.Or(x > 0, y > 0)), (b, True)))[0] == Select(lam, a, Select(mu, a, b))
    away = sp.Piecewise((a, sp.Not(sp.And(x > 0, y > 0))), (b, True))
    assert lift(away)[0] == Select(lam, Select(mu, b, a), a)


# ---- surfaces


@pytest.mark.parametrize(
    ("first", "second", "orientation"),
    [
        (x - y, y - x, -1),
        (x - y, 2 * x - 2 * y, 1),
        (x - y, -x / 3 + y / 3, -1),
        (x - y, p * x - p * y, 1),
        (x - y, 0.1 * x - 0.1 * y, 1),
        (x * (x + 1) - y, x**2 + x - y, 1),
        ((x**2 - y) / (1 + z**2), (x**2 - y) * 3 / (1 + z**2), 1),
        (0.3 * x - 1, (0.1 * 3) * x - 1, 1),  # a rounding apart
    ],
)
def test_surfaces_equal_up_to_a_constant_factor_are_one_switch(first, second, orientation):
    lifting = Lifting(STATES)
    one, two = lifting(sp.sign(first)), lifting(sp.sign(second))
    assert two == orientation * one and len(lifting.switches) == 1


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (1e9, 2e9),
        (2592000, 2592060),  # a minute after 30 days, in seconds
        (1700000000.0, 1700000001.0),  # a second in Unix time
        (sp.Rational(2460000), sp.Rational(2460000) + sp.Rational(1, 10**6)),  # a Julian day and a part of it
        (0.3, 0.3 + 1e-14),
    ],
)
def test_thresholds_are_told_apart_however_large_they_are(first, second):
    lifting = Lifting(STATES)
    lifting(sp.sign(x - first) + sp.sign(x - second))
    assert len(lifting.switches) == 2


@pytest.mark.parametrize("second", [x + y, x - 2 * y, x - y + 1, q * x - q * y, x - p * y])
def test_other_surfaces_are_other_switches(second):
    # q*(x - y): the sign of the factor q is not known.
    lifting = Lifting(STATES)
    lifting(sp.sign(x - y) + sp.sign(second))
    assert len(lifting.switches) == 2


def test_a_given_switch_and_lifted_notation_of_its_surface_are_one():
    lam = Switch("lam", -2 * v)
    lifted, switches = lift(lam + sp.Abs(v), lam)
    plain = only(switches)
    assert plain.name == "lam" and switches[plain] == -2 * v
    assert lifted == plain + Select(plain, -v, v)


def test_a_product_surface_is_taken_factor_by_factor():
    lifted, switches = lift(sp.sign(p * x * y**3 * z**2))
    assert set(switches.values()) == {x, y}
    assert lifted == sp.Mul(*switches)


def test_an_inner_switch_stands_in_the_outer_surface_by_its_status():
    _, switches = lift(sp.Max(sp.Abs(x) - 1, 0))
    inner, outer = switches
    assert switches[inner] == x and switches[outer] == Select(inner, x, -x) - 1


def test_a_clip_has_two_plain_surfaces():
    _, switches = lift(sp.Max(-p, sp.Min(p, x + y)))
    assert set(switches.values()) == {x + y - p, x + y + p}


def test_inside_a_branch_its_condition_holds():
    lifted, switches = lift(sp.Piecewise((sp.Abs(v) * sp.sign(v), v > 0), (z, True)))
    assert lifted == Select(only(switches), v, z)


def test_a_given_switch_inside_a_branch_stays_as_written():
    lam = Switch("lam", v)
    lifted, switches = lift(sp.Piecewise((1 - lam**2, v > 0), (0, True)), lam)
    mult = only(switches)
    assert lifted == Select(mult, 1 - mult**2, 0)


def test_products_of_one_surface_stay_as_written():
    lifted, switches = lift(sp.sign(v) ** 2 * (1 + z))
    assert lifted == only(switches) ** 2 * (1 + z)


# ---- laziness


@pytest.mark.parametrize(
    "force",
    [
        sp.Max(0, d) ** sp.Rational(3, 2),
        sp.Heaviside(d) * d**1.5,
        p * sp.Piecewise((1, d > 0), (0, True)) * d**1.5,
        sp.Piecewise((d**1.5, d > 0), (0, True)),
        (p * sp.Max(0, d)) ** 1.5,
        sp.log(1 + sp.Max(0, d)) / sp.log(2),
    ],
)
def test_off_the_surface_only_the_active_branch_is_evaluated(force):
    lifted, switches = lift(force)
    lam = only(switches)
    assert value(lifted, {d: -0.5, p: 2.0, lam: -1.0}) == 0
    assert value(lifted, {d: 0.5, p: 2.0, lam: 1.0}) > 0
    assert isinstance(lifted, Select) or lifted.has(Select)


def test_a_root_of_a_kink_is_taken_of_the_active_branch():
    # The series of (Select)**1.5 at 0 does not exist; that of each branch does.
    lifted, switches = lift(sp.Max(0, d) ** 1.5)
    assert lifted == Select(only(switches), d**1.5, 0)


# ---- constants, memories, instants


def test_conditions_on_memories_and_parameters_stay_piecewise():
    stuck = Memory("stuck", 1)
    flag = sp.Symbol("stuck", real=True)
    lifted, switches = lift(sp.Piecewise((v, sp.Eq(stuck, 1)), (sp.sign(v), True)))
    assert lifted == sp.Piecewise((v, sp.Eq(flag, 1)), (only(switches), True))
    lifted, switches = lift(sp.Abs(q) * v)
    assert not switches and lifted == v * sp.Piecewise((q, q > 0), (-q, True))


def test_a_mixed_condition_puts_the_memory_outside():
    stuck = Memory("stuck", 1)
    lifted, switches = lift(sp.Piecewise((x, sp.And(v > 0, sp.Eq(stuck, 1))), (y, True)))
    flag = sp.Symbol("stuck", real=True)
    assert lifted == sp.Piecewise((Select(only(switches), x, y), sp.Eq(flag, 1)), (y, True))


def test_signs_may_be_compared():
    lifted, switches = lift(sp.Piecewise((1, sp.Ne(sp.sign(z), sp.sign(v))), (0, True)))
    by_surface = {h: lam for lam, h in switches.items()}
    a, b = by_surface[v], by_surface[z]
    for s in (1, -1):
        for r in (1, -1):
            assert lifted.subs({a: s, b: r}) == (s != r)


def test_instants_make_no_switches_of_their_own():
    lifting = Lifting(STATES)
    lam = lifting(sp.sign(v))
    assert lifting(sp.Abs(v) + sp.Abs(x), new_switches=False) == Select(lam, v, -v) + sp.Piecewise(
        (x, x > 0), (-x, True), evaluate=False
    )
    assert list(lifting.switches) == [lam]


def test_conditions_of_nested_functions_may_stand_at_instants():
    # A comparison of a clip is no surface of the field: it stays a condition, whose value is that of the notation.
    lifting = Lifting(STATES)
    over = lifting(
        sp.Piecewise((1, sp.Max(0, sp.Min(1, x)) > sp.Rational(1, 2)), (0, True)), new_switches=False
    )
    assert not lifting.switches
    for at, holds in ((0.4, 0), (0.6, 1), (2.0, 1), (-1.0, 0)):
        assert value(over, {x: at}) == holds


@pytest.mark.parametrize(
    "steps",
    [
        sp.Abs(sp.Piecewise((-1, x < 0), (1, True))),
        sp.Max(sp.Abs(sp.Piecewise((-1, x < 0), (1, True))), sp.Rational(1, 2)),
        sp.cos(sp.Piecewise((-sp.pi, x < 0), (sp.pi, True))) + 2,
        sp.Abs(sp.Heaviside(x) - sp.Heaviside(-x)),
    ],
)
def test_a_function_of_steps_that_is_the_same_on_both_sides_does_not_switch(steps):
    # Between the sides it is 1 as well: what the steps are made of does not stick there.
    assert lift(steps)[0] == 1


def test_what_has_a_value_on_the_surface_or_is_a_product_stays_hidden():
    # sign(v) is 0 at v = 0, and so is its absolute value.
    lam = Switch("lam", v)
    assert lift(sp.Abs(lam), lam)[0].free_symbols
    assert lift(sp.sign(v) ** 2)[0].free_symbols and lift(sp.Abs(sp.sign(v)))[0].free_symbols


# ---- refusals


def test_a_condition_that_holds_on_a_surface_only_is_refused():
    with pytest.raises(ValueError, match="holds only on a surface.*hidden"):
        lift(sp.Piecewise((1, sp.Eq(v, 0)), (0, True)))


def test_a_piecewise_with_a_gap_is_refused():
    with pytest.raises(ValueError, match="add a branch"):
        lift(sp.Piecewise((1, v > 1), (0, v < 0)))


def test_a_switch_on_a_memory_is_refused():
    with pytest.raises(ValueError, match="constant between events"):
        lift(Switch("lam", Memory("m", 1)) * v)


def test_an_impulse_inside_of_an_expression_is_refused():
    with pytest.raises(ValueError, match="DiracDelta cannot be lifted"):
        lift(sp.DiracDelta(x))


def test_two_switches_of_one_name_are_refused():
    with pytest.raises(ValueError, match="two switches are named 'lam', with the surfaces v and x"):
        lift(Switch("lam", v) + Switch("lam", x))


# ---- everything at once

_FUNCTIONS = {
    "Heaviside": lambda a, at_zero=0.5: float(a > 0) if a else at_zero,
    "sign": lambda a: (a > 0) - (a < 0),
}


def _expression(rng, depth):
    def part():
        return _expression(rng, depth - 1)

    if depth == 0:
        linear = sum(rng.choice([-2, -1, 0, 1, sp.Rational(1, 2)]) * s for s in (x, y, z))
        return rng.choice([linear + rng.choice([0, 1, p]), x, y, z**2, sp.Integer(rng.randint(-2, 2))])
    build = [
        lambda: sp.sign(part()),
        lambda: sp.Abs(part()),
        lambda: sp.Max(part(), part()),
        lambda: sp.Min(part(), part(), part()),
        lambda: sp.Heaviside(part()),
        lambda: sp.Piecewise(*((part(), _condition(rng, depth - 1)) for _ in range(2)), (part(), True)),
        lambda: part() * part(),
        lambda: part() + part(),
        lambda: sp.cos(part()),
        lambda: sp.Max(-1, sp.Min(1, part())),
    ]
    return rng.choice(build)()


def _condition(rng, depth):
    kind = rng.choice(["and", "or", "not", ">", "<="] if depth > 0 else [">", "<="])
    if kind == "not":
        return sp.Not(_condition(rng, depth - 1))
    if kind in ("and", "or"):
        return {"and": sp.And, "or": sp.Or}[kind](_condition(rng, depth - 1), _condition(rng, depth - 1))
    a, b = _expression(rng, max(depth - 1, 0)), _expression(rng, 0)
    return a > b if kind == ">" else a <= b


@pytest.mark.parametrize("seed", range(60))
def test_lifted_nests_have_the_values_of_the_notation(seed):
    rng = random.Random(seed)
    expr = _expression(rng, 3)
    lifting = Lifting((x, y, z))
    lifted = lifting(expr)
    assert not lifted.has(sp.Abs, sp.sign, sp.Max, sp.Min, sp.Heaviside)
    reference = sp.lambdify((x, y, z, p), expr, modules=[_FUNCTIONS, "math"])
    for _ in range(6):
        point = {s: rng.uniform(-2, 2) for s in (x, y, z)} | {p: rng.uniform(0.5, 2)}
        expected = float(reference(*point.values()))
        for lam, h in lifting.switches.items():
            point[lam] = math.copysign(1.0, value(h, point))
        if all(abs(value(h, point)) > 1e-12 for h in lifting.switches.values()):
            assert value(lifted, point) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("strength", "stops"),
    [
        (sp.Piecewise((HALF, t > 5), (0, True)), 6),
        (sp.Piecewise((HALF, (t > 5) & (y > 4)), (0, True)), 6),
        (sp.Piecewise((HALF, (y > 50) & (y < 53)), (0, True)), 51),
        (sp.Max(0, y - 10), 11),
    ],
    ids=["from an instant on", "from an instant on, beyond a place", "on a rough patch", "ever more"],
)
def test_friction_that_acts_in_a_part_of_time_or_space_holds_there(strength, stops):
    """Points of size 1 on v = 0 do not come where it acts."""
    run = solve(System({y: v, v: -strength * sp.sign(v)}, time=t), (0, 80), {y: 0, v: 1})
    assert run.success and run["v"][-1] == 0
    assert run["y"][-1] == pytest.approx(stops, abs=1e-8)


def test_what_is_continuous_wherever_it_is_met_stays_a_kink():
    tent = sp.Piecewise((0, y > 1), (0, y < -1), (1 - sp.Abs(y), True))
    found = System({y: 1 + tent * sp.Heaviside(z - 7), z: 1}).model.multipliers
    assert [m.regularity for m in found if m.surface.has(y)] == 3 * ["kink"]


def test_limiters_in_a_row_are_read_in_time():
    # Each stands in the surfaces of all that follow: what is known of the sides of others is not worked out in vain.
    states, signal, rates = sp.symbols("y1:7", real=True), sp.sin(t), {}
    for state in states:
        signal = rates[state] = sp.Max(-1, sp.Min(1, 3 * (signal - state)))
    system = System(rates, time=t)
    assert len(system.switches) == 12 and {m.regularity for m in system.model.multipliers} == {"kink"}
