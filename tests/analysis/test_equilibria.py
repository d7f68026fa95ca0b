"""Equilibria against closed forms and linear algebra: where they are, whether they are admissible and stable.

Guards: analysis/equilibria/.
"""

import math

import numpy as np
import pytest
import sympy as sp
from affine_equilibria import BEYOND, Affine

from pwsmooth import (
    Algebraic,
    Disc,
    Event,
    Family,
    Memory,
    Strobe,
    Switch,
    System,
    Unilateral,
    find_equilibrium,
    find_orbit,
    follow,
    solve,
)
from pwsmooth.analysis.equilibria import equilibria

t, x, y, u, v, z = sp.symbols("t x y u v z", real=True)
a, F = sp.symbols("a F", real=True)
rho, beta, k, eps = sp.symbols("rho beta k eps", positive=True)
lam = Switch("lam", v)
# Newton's last step is 1e-10 and converges quadratically: what is left are roundings of sums of order 1.
EXACT = 1e-12


def mu(lam, rho=3):
    """Friction coefficient with static friction as a hidden term."""
    return lam * (1 + rho * (1 - lam**2))


def roots_of_static_friction(force, rho):
    """The three lam with lam (1 + rho (1 - lam^2)) = force: Viete's trigonometric roots of the cubic."""
    size = 2 * math.sqrt((1 + rho) / (3 * rho))
    angle = math.acos(-1.5 * force / (1 + rho) * math.sqrt(3 * rho / (1 + rho))) / 3
    return sorted(size * math.cos(angle - 2 * math.pi * j / 3) for j in range(3))


def fold(rho):
    """(lam_s, mu_s) where d mu/d lam = 0."""
    lam_s = math.sqrt((1 + rho) / (3 * rho))
    return lam_s, lam_s * (1 + rho) * 2 / 3


# ---- against linear algebra


def test_a_centre_is_called_neutral_and_not_stable():
    # Eigenvalues i and -i: the linear part does not decide.
    centre = find_equilibrium(System({x: v, v: -x - a * v}, parameters={a: 0}), {x: 0.1, v: 0})
    assert not centre.stable and "neutral" in repr(centre)
    assert find_equilibrium(System({x: v, v: -x - a * v}, parameters={a: 1}), {x: 0.1, v: 0}).stable


@pytest.mark.parametrize(
    "block", [*range(3), *(pytest.param(block, marks=pytest.mark.thorough) for block in range(3, 8))]
)
def test_random_affine_systems_have_the_equilibria_of_linear_algebra(block):
    for seed in range(26 * block, 26 * block + 26):
        case = Affine(seed)
        found = [e for e in equilibria(case.system, case.box, virtual=True) if np.abs(e.mult).max() <= BEYOND]
        expected = case.solutions()
        assert len(found) == len(expected), seed
        for sides, at, lams, admissible, values, slope in expected:
            # Conditioned like the matrices: a few hundred at worst, so 1e-8 is far from both sides.
            (e,) = (
                e for e in found
                if e.sides == sides and np.allclose([*e.x, *e.mult], [*at, *lams], rtol=1e-8, atol=1e-8)
            )  # fmt: skip
            assert e.admissible == admissible, (seed, e)
            distances = np.abs(e.eigenvalues[:, None] - values[None])
            assert len(e.eigenvalues) == len(values) and np.all(
                distances.min(axis=1, initial=np.inf) < 1e-6 * (1 + abs(values).max(initial=0.0))
            )
            if len(slope) == 1 and abs(lams[sides.index(0)]) < 1:
                layer = (1 - lams[sides.index(0)] ** 2) ** 1.5 * slope[0]
                assert e.layer_eigenvalues[0] == pytest.approx(layer, rel=1e-6)


@pytest.mark.thorough
def test_a_stable_pseudo_equilibrium_is_where_runs_come_to_rest():
    # Of the random systems those of which it is told: the slow flow and the layer attract.
    seen = 0
    for seed in range(60):
        case = Affine(seed)
        for e in equilibria(case.system, case.box):
            if e.stable and e.kind == "pseudo-equilibrium" and e.eigenvalues.real.max(initial=-1.0) < -0.3:
                run = solve(case.system, (0, 60), list(e.x))
                beside = solve(case.system, (0, 60), list(e.x + 1e-6))
                # exp(-0.3*60) of 1e-6 is below the solver's tolerance.
                assert np.abs(run.x[:, -1] - e.x).max() < 1e-8 > np.abs(beside.x[:, -1] - e.x).max()
                seen += 1
    assert seen >= 5


@pytest.mark.parametrize("seed", range(12))
def test_cubic_planar_fields_have_the_pseudo_equilibria_of_a_polynomial(seed):
    # On y = 0 the fields are parallel where f+ g- = f- g+, a polynomial in x; opposite where g+ g- < 0.
    rng = np.random.default_rng([7, seed])
    above, below = rng.normal(size=(2, 2, 4))
    side = Switch("side", y)
    fields = [[sum(c * x**j for j, c in enumerate(row)) + y * x for row in one] for one in (above, below)]
    rates = [(p + m) / 2 + side * (p - m) / 2 for p, m in zip(*fields)]
    (f1, g1), (f2, g2) = ([np.polynomial.Polynomial(row) for row in one] for one in (above, below))
    roots = (f1 * g2 - f2 * g1).roots()
    at = [r for r in roots[abs(roots.imag) < 1e-9].real if abs(r) < 3 and g1(r) * g2(r) < 0]
    found = equilibria(System(dict(zip((x, y), rates))), {x: (-3, 3), y: (-3, 3)}, sides={side: 0})
    assert [e.x[0] for e in found] == pytest.approx(sorted(at), abs=1e-9)
    for e in found:
        assert (e.layer_eigenvalues[0].real < 0) == (g1(e.x[0]) < g2(e.x[0]))


# ---- several lambda on one surface


@pytest.mark.parametrize("strength", [0.8, 3.0, 20.0])
@pytest.mark.parametrize("part", [-0.7, 0.0, 0.3, 0.95])
def test_every_lambda_of_static_friction_is_found(strength, part):
    force = part * fold(strength)[1]
    system = System({v: F - mu(lam, rho) - v / 10}, parameters={F: force, rho: strength})
    found = equilibria(system, {v: (-50, 50)}, virtual=True, sides={lam: 0})
    assert sorted(e.mult[0] for e in found) == pytest.approx(
        roots_of_static_friction(force, strength), abs=1e-11
    )
    for e in found:
        # mu rises with lam where the layer attracts.
        attracts = 1 + strength - 3 * strength * e.mult[0] ** 2 > 0
        assert e.stability == ("stable" if attracts else "unstable")
        assert e.admissible == (abs(e.mult[0]) < 1) and ("beyond [-1, 1]" in e.virtual) == (abs(e.mult[0]) > 1)


def test_a_guess_of_lambda_chooses_among_several_and_without_one_it_is_the_stable_one():
    system = System({v: 1.2 - mu(lam)})
    _, low, high = roots_of_static_friction(1.2, 3)
    assert find_equilibrium(system, {v: 0, lam: 0.99}).mult[0] == pytest.approx(high, abs=EXACT)
    assert find_equilibrium(system, {v: 0}).mult[0] == pytest.approx(low, abs=EXACT)


def test_a_sticking_block_rests_in_a_set_and_a_start_in_it_stays():
    system = System({y: v, v: F - k * y - mu(lam) - v / 10}, parameters={F: 0.7, k: 2})
    e = find_equilibrium(system, {y: 0.5, v: 0})
    assert e.x.tolist() == [0.5, 0] and not e.isolated and e.stability == "stable set"
    assert mu(e.mult[0]) == pytest.approx(0.7 - 2 * 0.5, abs=EXACT)
    # lam is monotone in y along it: 2 dy = -mu'(lam) dlam
    dy, _, dlam = e.free_directions[0]
    assert 2 * dy == pytest.approx(-(4 - 9 * e.mult[0] ** 2) * dlam, abs=EXACT)
    inside = equilibria(system, {y: (-3, 3), v: (-1, 1)})
    assert {one.stability for one in inside} == {"stable set", "unstable"} and not any(
        o.isolated for o in inside
    )


def test_a_block_on_a_moving_belt_slips_and_is_nowhere_stuck():
    belt = Switch("belt", v - 0.4)
    system = System({y: v, v: -2 * y - v / 10 - mu(belt)})
    (e,) = equilibria(system, {y: (-3, 3), v: (-1, 1)})
    assert e.kind == "regular" and e.x == pytest.approx([0.5, 0], abs=EXACT) and e.sides == (-1,)


def test_the_slow_flow_of_a_hidden_state_has_its_eigenvalue():
    # On v = 0 lam (1 + rho z) = F, so z' = (1 - lam^2 - z)/beta has the slope (2 rho lam^2/(1 + rho z) - 1)/beta.
    system = System(
        {v: F - lam * (1 + rho * z), z: (1 - lam**2 - z) / beta}, parameters={F: 1.2, rho: 3, beta: 0.1}
    )
    found = equilibria(system, {v: (-1, 1), z: (-2, 2)}, sides={lam: 0})
    assert len(found) == 2
    for e in found:
        slope = (6 * e.mult[0] ** 2 / (1 + 3 * e.x[1]) - 1) / 0.1
        assert e.eigenvalues == pytest.approx([slope], abs=1e-10)
        assert e.stable == (e.mult[0] < fold(3)[0])


# ---- contacts, unknowns, kinks


def test_a_rest_on_a_stop_has_a_reaction_and_is_virtual_where_it_would_pull():
    floor = Unilateral(y, restitution=0.5, name="R")
    system = System({y: v, v: a - 4 * y - v + floor.reaction}, parameters={a: -3})
    closed = find_equilibrium(system, {y: 1, v: 0})
    assert closed.kind == "rest on a contact" and closed.mult == pytest.approx([3], abs=EXACT) and closed.stable
    assert len(closed.eigenvalues) == 0  # gap and speed are held
    free = find_equilibrium(system.with_parameters({a: 2}), {y: 1, v: 0})
    assert free.kind == "regular" and free.x[0] == pytest.approx(0.5, abs=EXACT)
    pulled = find_equilibrium(system.with_parameters({a: 2}), {y: 0, v: 0}, sides={"R": 0}, virtual=True)
    assert pulled.virtual == "the reaction R is -2" and not pulled.admissible
    below = find_equilibrium(system, {y: 0, v: 0}, sides={"R": 1}, virtual=True)
    assert "the gap y of R is -0.75" == below.virtual
    refused = find_equilibrium(system, {y: 0, v: 0}, sides={"R": 1})
    assert not refused.success and "`virtual=True` gives it" in refused.message


def test_two_relays_hold_it_on_both_surfaces():
    system = System(
        {x: a - sp.sign(x) - sp.sign(u) / 2, u: 0.1 - sp.sign(u) + sp.sign(x) / 3}, parameters={a: 0.2}
    )
    (e,) = equilibria(system, {x: (-2, 2), u: (-2, 2)})
    # l + m/2 = 0.2, m - l/3 = 0.1
    assert e.mult == pytest.approx([0.15 / (7 / 6), 0.1 + 0.05 / (7 / 6)], abs=EXACT) and e.held == (
        "sgn(x)",
        "sgn(u)",
    )
    slopes = np.array([[-1, -1 / 2], [1 / 3, -1]]) * ((1 - e.mult**2) ** 1.5)[:, None]
    assert np.sort_complex(e.layer_eigenvalues) == pytest.approx(
        np.sort_complex(np.linalg.eigvals(slopes)), abs=EXACT
    )


def test_an_algebraic_unknown_is_solved_with_the_states():
    acc = sp.Symbol("acc", real=True)
    system = System(
        {x: v, v: acc}, algebraic=[Algebraic(acc, acc + acc**3 + v / 2 + sp.sinh(x) - a)], parameters={a: 2}
    )
    (e,) = equilibria(system, {x: (-3, 3), v: (-3, 3)})
    assert e.x == pytest.approx([math.asinh(2), 0], abs=EXACT) and e.kind == "regular"
    # acc has the slope -(v/2)_v and -cosh(x) there, as acc = 0: mu^2 + mu/2 + cosh = 0
    assert sorted(e.eigenvalues.imag) == pytest.approx(
        [-math.sqrt(math.sqrt(5) - 1 / 16), math.sqrt(math.sqrt(5) - 1 / 16)]
    )


def test_a_kink_without_a_jump_of_the_jacobian_decides_and_one_with_it_does_so_by_half_turns():
    soft = find_equilibrium(System({x: v, v: -x - v - v * sp.Abs(v)}), {x: 0.3, v: 0})
    assert soft.stable and soft.border
    hard = find_equilibrium(System({x: v, v: -x - v - sp.Abs(x) / 2}), {x: 0.3, v: 0})
    # x'' + x' + k x with k = 3/2 and 1/2: half turns take pi/sqrt(k - 1/4), at the rate -1/2
    halves = math.pi / math.sqrt(5 / 4) + math.pi / 0.5
    assert hard.stable and hard.border
    assert hard.eigenvalues == pytest.approx([-0.5 + 2j * math.pi / halves, -0.5 - 2j * math.pi / halves])
    three = find_equilibrium(System({x: v, v: -x - v - sp.Abs(x) / 2, z: x - z}), {x: 0.3, v: 0, z: 0})
    assert three.stability == "undecided" and "kink" in three.linear.undecided


def test_a_common_zero_of_two_fields_is_isolated():
    # Foci -1 +- i and -2 +- 3 i, which every orbit joins across x = 0
    switched = System(
        {x: sp.Piecewise((a * x - v, x < 0), (-2 * x - 3 * v, True)),
         v: sp.Piecewise((x + a * v, x < 0), (3 * x - 2 * v, True))}, parameters={a: -1},
    )  # fmt: skip
    zero = find_equilibrium(switched, {x: 0.1, v: 0.1})
    assert zero.isolated and zero.stable and zero.x.tolist() == [0, 0]
    assert len(equilibria(switched, {x: (-1, 1), v: (-1, 1)})) == 1
    # Half turns multiply by exp(pi a) and exp(-2 pi/3).
    branch = follow(zero, {a: 1})
    (hopf,) = branch.specials
    assert hopf.kind == "Hopf" and hopf.parameter == pytest.approx(2 / 3, abs=1e-9) and hopf.lyapunov is None
    assert branch.stable[0] and not branch.stable[-1]


def test_second_order_sliding_is_found_and_its_stability_left_open():
    e = find_equilibrium(System({x: v, v: 0.3 - sp.sign(x) - v}), {x: 0.1, v: 0})
    assert e.mult == pytest.approx([0.3], abs=EXACT) and e.stability == "undecided"
    # A surface with a kink in it, and a multiplier that dh/dt has lost there.
    bang = find_equilibrium(System({x: v, v: -sp.sign(x + v * sp.Abs(v))}), {x: 0.1, v: 0})
    assert bang.x.tolist() == [0, 0] and bang.stability == "undecided"


def test_a_bound_is_a_border_and_no_stability_is_told_there():
    e = find_equilibrium(System({x: 1 - sp.sign(x)}), {x: 0.0}, sides={"sgn(x)": 0})
    assert e.admissible and "on its bound" in e.border and e.stability == "undecided"


def test_memories_stay_at_their_values():
    level = Memory("level", 1)
    system = System({x: level - x}, events=[Event(x - 9, update={level: 0})])
    assert find_equilibrium(system, {x: 0}).x.tolist() == [1, 1]
    assert find_equilibrium(system, {x: 0, level: 2}).x.tolist() == [2, 2]


def test_a_chain_of_blocks_with_too_many_modes_to_try_them_all_is_found_from_its_start():
    blocks = Family(8)
    yi, vi = blocks.symbols("y v")
    system = System({yi: vi, vi: a - yi - vi / 10 - sp.sign(vi)}, parameters={a: 0.5})
    start = [0.1] * 7 + [5.0] + [0.0] * 8
    e = find_equilibrium(system, start)
    assert (
        e.admissible
        and e.x == pytest.approx([0.1] * 7 + [1.5] + [0] * 8, abs=EXACT)
        and len(e.free_directions) == 7
    )
    with pytest.raises(ValueError, match="combinations of sides"):
        equilibria(system, {"y": (-1, 1), "v": (-1, 1)})
    held = equilibria(
        system, {"y": (-1, 1), "v": (-1, 1)}, sides=dict.fromkeys((f"sgn(v_{i})" for i in range(1, 9)), 0)
    )
    assert [e.stability for e in held] == ["stable set"]


# ---- smoothed and layered views


ARCTAN = 2 / sp.pi * sp.atan(sp.Symbol("u"))


@pytest.mark.parametrize("family", ["algebraic", "tanh", "erf", ARCTAN])
@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_eigenvalues_of_smoothed_views_tend_to_those_of_the_flow_and_of_the_layer(family, ratio):
    system = System(
        {y: -y + lam / 2, v: F + y / 4 - lam * (1 + rho * z), z: (1 - lam**2 - z) / beta},
        parameters={F: 1.1, rho: 3, beta: 0.1},
    ).layered({z: ratio}, sigmoid=family)
    exact = equilibria(system, {y: (-2, 2), v: (-9, 9)}, sides={lam: 0}, starts=16)
    assert [e.stability for e in exact] == ["stable", "unstable"]
    for width in (1e-3, 1e-5):
        smooth = system.smoothed(width, sigmoid=family)
        near = equilibria(smooth, {y: (-2, 2), v: (-0.1, 0.1), z: (-2, 2)}, starts=16)
        assert len(near) == 2
        for e in exact:
            s = min(near, key=lambda s: abs(s.x[0] - e.x[0]))
            assert s.stable == e.stable and s.kind == "regular"
            slow, fast = np.split(s.eigenvalues[np.argsort(np.abs(s.eigenvalues))], [1])
            # Both are off by O(eps), with factors that the slope of the sigmoid sets.
            assert slow == pytest.approx(e.eigenvalues, abs=100 * width)
            assert np.sort_complex(fast * width) == pytest.approx(
                np.sort_complex(e.layer_eigenvalues), abs=100 * width
            )


def test_a_two_stage_layer_is_the_limit_of_small_ratios():
    system = System(
        {v: F - lam * (1 + rho * z), z: (1 - lam**2 - z) / beta}, parameters={F: 1.2, rho: 3, beta: 0.1}
    )
    limit = equilibria(system.layered({z: 0}), {v: (-1, 1)}, starts=32)
    near = equilibria(system.layered({z: 1e-6}), {v: (-1, 1)}, starts=32)
    for e, s in zip(limit, near, strict=True):
        values = s.layer_eigenvalues[np.argsort(np.abs(s.layer_eigenvalues))] / [1e-6, 1]
        assert np.sort(values.real) == pytest.approx(np.sort(e.layer_eigenvalues.real), rel=1e-3)
        assert s.stability == e.stability


def test_the_limit_of_a_fast_state_is_stable_as_the_hidden_term_is():
    system = System(
        {v: F - lam * (1 + rho * z), z: (1 - lam**2 - z) / beta}, parameters={F: 1.2, rho: 3, beta: 0.1}
    )
    for e in equilibria(system.layered({z: sp.oo}), {v: (-1, 1)}):
        # Lambda' dg/dlam of the algebraic sigmoid
        assert e.layer_eigenvalues == pytest.approx(
            [-((1 - e.mult[0] ** 2) ** 1.5) * (4 - 9 * e.mult[0] ** 2)], abs=1e-10
        )


# ---- doors


@pytest.mark.parametrize(
    "system, named",
    [
        (System({x: sp.cos(t) - x}, time=t), "the rate of x"),
        (System({x: -x}, time=t, events=[Event(every=1, update={x: x + 1}, name="tick")]), "the event 'tick'"),
        (System({x: -sp.sign(x - t)}, time=t), "a surface"),
    ],
)
def test_what_depends_on_time_is_refused_by_name_with_the_remedy(system, named):
    for call in (lambda: find_equilibrium(system, {x: 0}), lambda: equilibria(system, {x: (-1, 1)})):
        with pytest.raises(ValueError, match=f"`system` depends on time .*{named}.*find_orbit"):
            call()
    if named != "a surface":
        assert find_orbit(system, {x: 0}, seen=Strobe(2 * sp.pi if "rate" in named else 1, phase=0.5)).success


@pytest.mark.parametrize(
    "more, message",
    [
        ({"sides": {"lam": 2}}, "`sides` of lam is 2; choose one of 1, -1, 0"),
        ({"sides": {"nu": 1}}, "`sides` names 'nu'"),
        ({"box": {v: (1, -1)}}, "`box` of v is .1, -1.; give the lowest first"),
        ({"box": {}}, "`box` has no bounds for v"),
        ({"starts": 0}, "`starts`"),
    ],
)
def test_bad_arguments_are_refused_by_name(more, message):
    with pytest.raises(ValueError, match=message):
        equilibria(System({v: 1.2 - mu(lam)}), **{"box": {v: (-1, 1)}, **more})


def test_it_says_what_it_is_in_short():
    text = repr(find_equilibrium(System({x: 0.5 - sp.sign(x)}), {x: 1}))
    assert text.splitlines()[0] == "Equilibrium: pseudo-equilibrium, stable" and "sgn(x) = 0.5" in text
    lost = find_equilibrium(System({x: 1 + x**2 - sp.sign(x - 5)}), {x: 1})
    assert not lost.success and not lost.admissible and not lost.stable and np.isnan(lost.eigenvalues).all()
    assert "No equilibrium: Newton's method converged in no mode" in repr(
        find_equilibrium(System({x: 1 + x**2}), {x: 1})
    )


def test_sizes_of_micrometres_and_stiff_contacts_are_told_apart():
    # A mass pressed onto a Hertzian contact, in SI units: K d^(3/2) = F, and a stop 2 nm below.
    d, w = sp.symbols("d w", real=True)
    stop = Unilateral(4e-6 + 2e-9 - d, restitution=0.5, name="R")
    press = System(
        {d: w, w: F - 1e10 * sp.Max(0, d) ** sp.Rational(3, 2) - 10 * w - stop.reaction}, parameters={F: 80}
    )
    (free,) = equilibria(press, {d: (0, 1e-5), w: (-1, 1)}, starts=32)
    assert free.x[0] == pytest.approx(4e-6, rel=1e-9) and free.kind == "regular" and not free.border
    (held,) = equilibria(press.with_parameters({F: 80.1}), {d: (0, 1e-5), w: (-1, 1)}, starts=32)
    push = 80.1 - 1e10 * (4e-6 + 2e-9) ** 1.5  # 80.1 N less 80.06 N
    assert (
        held.kind == "rest on a contact"
        and held.multipliers["R"] == pytest.approx(push, abs=1e-8)
        and held.stable
    )


def test_an_equilibrium_within_rounding_below_the_zero_of_a_nonnegative_state_is_found():
    level, a, b = sp.Symbol("level", nonnegative=True), *sp.symbols("a b", real=True)
    tank = System({level: a - b - level}, parameters={a: 0.3, b: 0.1 + 0.2})  # at -5.6e-17
    (one,) = equilibria(tank, {level: (0, 2)})
    assert abs(one.x[0]) < 1e-15 and find_equilibrium(tank, {level: 0.1}).success
    assert solve(tank, (0, 1), one.x).success


def test_a_start_just_beyond_the_end_of_a_set_is_led_to_its_end():
    """A run that creeps to the end of a set stops a little beyond it, and no other equilibrium is as near."""
    beyond = np.random.default_rng(3).uniform(1e-10, 1e-3, 20)
    x, v, y, w = sp.symbols("x v y w", real=True)
    block = System({x: v, v: 1 - 2 * x - Switch("lam", v) - v / 10})
    disc = Disc("lam", (v, w))
    plate = System({x: v, y: w, v: 1 - 2 * x - disc[0] - v / 10, w: -3 * y - disc[1] - w / 10})
    for far in beyond:
        end = find_equilibrium(block, {x: 1 + far, v: 0})
        assert end.x == pytest.approx([1, 0], abs=1e-12) and end.multipliers["lam"] == -1
        end = find_equilibrium(plate, {x: 0.5 + 0.3 * (1 + far), y: -0.8 / 3 * (1 + far), v: 0, w: 0})
        assert end.x == pytest.approx([0.8, -0.8 / 3, 0, 0], abs=far) and end.held == ("lam",)
        assert np.linalg.norm(end.mult[1:]) == pytest.approx(1, abs=1e-9)
