"""Branches of equilibria: folds, Hopf points and boundary equilibria at parameters that are known exactly.

Guards: analysis/continuation/equilibria/.
"""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from pwsmooth import Event, Return, Strobe, Switch, System, Unilateral, find_equilibrium, find_orbit, follow
from pwsmooth.analysis.continuation import Steps
from pwsmooth.analysis.continuation.equilibria.hopf import cycle_from
from pwsmooth.analysis.equilibria import equilibria

x, y, v, z = sp.symbols("x y v z", real=True)
a, F = sp.symbols("a F", real=True)
rho, beta = sp.symbols("rho beta", positive=True)
lam = Switch("lam", v)
# A zero is enclosed to 1e-14 of a step; what its test function is known to, some roundings over its slope.
LOCATED = 1e-11


def mu(lam, strength=3):
    """Friction coefficient with static friction as a hidden term: folds at lam = +-2/3, mu = +-16/9 for strength 3."""
    return lam * (1 + strength * (1 - lam**2))


def kinds(branch):
    return [b.kind for b in branch.specials]


# ---- smooth ones


def test_a_fold_is_found_and_passed():
    branch = follow(find_equilibrium(System({x: a - x**2}, parameters={a: 1}), {x: 1}), {a: -1})
    (fold,) = branch.specials
    assert fold.kind == "fold" and abs(fold.parameter) < LOCATED
    assert branch.x[0, 0] == 1 and branch.x[0, -1] == pytest.approx(-1, abs=1e-12) and branch.values[-1] == 1
    assert branch.stable.tolist() == (branch.x[0] > 0).tolist()
    assert branch.values == pytest.approx(branch.x[0] ** 2, abs=1e-12)


def test_a_branch_point_is_no_fold():
    branch = follow(find_equilibrium(System({x: a * x - x**3}, parameters={a: 1}), {x: 0}), {a: -1})
    assert kinds(branch) == ["branch point"] and abs(branch.specials[0].parameter) < LOCATED


@pytest.mark.parametrize("cubic", [-1.0, 0.5])
def test_a_hopf_point_has_frequency_and_lyapunov_coefficient_of_its_normal_form(cubic):
    # z' = (a + i w) z + 2 s z |z|^2 in coordinates of length 1, where |z|^2 = (x^2 + y^2)/2: l1 = 2 s/w
    w, r2 = 1.7, x**2 + y**2
    system = System(
        {x: a * x - w * y + cubic * x * r2, y: w * x + a * y + cubic * y * r2, z: x * y - z},
        parameters={a: -0.4},
    )
    (hopf,) = follow(find_equilibrium(system, {x: 0, y: 0, z: 0}), {a: 0.3}).specials
    assert hopf.kind == "Hopf" and abs(hopf.parameter) < LOCATED
    assert hopf.frequency == pytest.approx(w, abs=LOCATED)
    assert hopf.lyapunov == pytest.approx(2 * cubic / w, rel=1e-10)


def test_quadratic_terms_enter_the_lyapunov_coefficient_as_in_bautin_s_formula():
    # x' = -w y + f, y' = w x + g: 16 l = f_xxx + f_xyy + g_xxy + g_yyy + (f_xy (f_xx + f_yy) - g_xy (g_xx + g_yy)
    # - f_xx g_xx + f_yy g_yy)/w (Guckenheimer and Holmes 1983, sec. 3.4); in eigenvectors of length 1 l1 = 4 l/(2 w).
    rng = np.random.default_rng(3)
    for _ in range(5):
        w, c = rng.uniform(0.5, 2), rng.normal(size=(2, 7))
        f, g = (
            sum(n * m for n, m in zip(row, (x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3)))
            for row in c
        )
        system = System({x: a * x - w * y + f, y: w * x + a * y + g}, parameters={a: -0.1})
        (hopf,) = follow(find_equilibrium(system, {x: 0, y: 0}), {a: 0.1}).of_kind("Hopf")
        (fxx, fxy, fyy, fxxx, fxxy, fxyy, fyyy), (gxx, gxy, gyy, gxxx, gxxy, gxyy, gyyy) = c * [
            2,
            1,
            2,
            6,
            2,
            2,
            6,
        ]
        l = fxxx + fxyy + gxxy + gyyy + (fxy * (fxx + fyy) - gxy * (gxx + gyy) - fxx * gxx + fyy * gyy) / w
        assert hopf.lyapunov == pytest.approx(4 * l / 16 / (2 * w), rel=1e-9, abs=1e-9)


def test_two_real_eigenvalues_of_opposite_sign_are_no_hopf_point():
    system = System({x: (1 + a) * x, y: -y}, parameters={a: -0.5})
    assert "Hopf" not in kinds(follow(find_equilibrium(system, {x: 0, y: 0}), {a: 0.5}))


# ---- a valve with an impact

y1, y2, y3 = sp.symbols("y1 y2 y3", real=True)
q, k, d, b, r = sp.symbols("q k d b r", positive=True)
VALVE = {k: 1.25, d: 10, b: 20}


def valve(**more):
    rates = {y1: y2, y2: -k * y2 - (y1 + d) + y3, y3: b * (q - y1 * sp.sqrt(y3))}
    if more:
        return System(rates, parameters={q: 9, **VALVE}, **more)
    seat = Unilateral(y1, restitution=r, name="R")
    rates[y2] += seat.reaction
    return System(rates, parameters={q: 9, **VALVE, r: 0.8})


def test_the_relief_valve_has_its_hopf_point():
    # Routh-Hurwitz of the cubic characteristic polynomial, solved for x = y1 by the project's issue 18: 16 digits.
    branch = follow(find_equilibrium(valve(), {y1: 2.5, y2: 0, y3: 12}), {q: 7})
    (hopf,) = branch.specials
    assert hopf.parameter == pytest.approx(8.491117635183327, abs=LOCATED)
    assert hopf.point.x == pytest.approx([2.4103132376866503, 0, 12.41031323768665], abs=LOCATED)
    assert hopf.frequency == pytest.approx(3.09070885, abs=5e-9)
    assert hopf.lyapunov < 0


def grazing_by_shooting():
    """(q, period) of the orbit of the smooth valve that touches y1 = 0: from the touch to the next, DOP853."""

    def rates(t, s, q):
        return [s[1], -1.25 * s[1] - (s[0] + 10) + s[2], 20 * (q - s[0] * math.sqrt(s[2]))]

    def back(unknowns):
        top, period, q = unknowns
        end = solve_ivp(rates, (0, period), [0, 0, top], method="DOP853", rtol=1e-13, atol=1e-13, args=(q,)).y[
            :, -1
        ]
        return end - [0, 0, top]

    _, period, q = fsolve(back, [46, 2.64, 7.6], xtol=1e-13)
    return q, period


def test_the_valve_s_cycle_grazes_its_seat_at_one_flow_by_two_routes():
    smooth = valve(events=[Event(y1, name="seat")])  # which only watches
    (hopf,) = follow(find_equilibrium(smooth, {y1: 2.5, y2: 0, y3: 12}), {q: 8}).of_kind("Hopf")
    cycle = cycle_from(hopf, 0.05)
    assert cycle.success and cycle.stable and 0 < hopf.parameter - cycle.system.parameters[q] < 1e-4
    branch = follow(cycle, {q: 7.4})
    touch = next(c for c in branch.specials if "seat" in str(c))
    other, period = grazing_by_shooting()
    assert touch.parameter == pytest.approx(other, abs=1e-9)
    assert touch.point.period == pytest.approx(period, abs=1e-7)
    # With impacts the branch of the cycle ends there: a square root leads away.
    real = follow(find_equilibrium(valve(), {y1: 2.5, y2: 0, y3: 12}), {q: 8})
    impacts = follow(cycle_from(real.specials[0], 0.05), {q: 7.4})
    assert impacts.values.min() == pytest.approx(other, abs=1e-5) and "impact" in impacts.end


# ---- boundary equilibria


class Normal:
    """x' = N x + M a where C x + D a > 0, and E more where it is < 0: random, with the determinant criterion."""

    def __init__(self, seed):
        rng = np.random.default_rng([5, seed])
        self.n = n = int(rng.integers(2, 5))
        self.N, self.M, self.E = rng.normal(size=(n, n)), rng.normal(size=n), rng.normal(size=n)
        self.C, self.D = rng.normal(size=n), rng.normal()
        states = sp.symbols(f"x1:{n + 1}", real=True)
        column = sp.Matrix(states)
        self.switch = Switch("s", (sp.Matrix(self.C).T @ column)[0] + self.D * a)
        rates = sp.Matrix(self.N) @ column + sp.Matrix(self.M) * a + sp.Matrix(self.E) * (1 - self.switch) / 2
        self.speed = self.D - self.C @ np.linalg.solve(self.N, self.M)  # of h along the regular branch
        self.side = math.copysign(1.0, self.speed)  # of a, where the regular equilibrium is admissible
        self.system = System(dict(zip(states, rates)), parameters={a: self.side})
        self.criterion = self.C @ np.linalg.solve(self.N, self.E)

    def regular(self, value):
        return -np.linalg.solve(self.N, self.M) * value

    def pseudo(self, value):
        part = self.speed * value / self.criterion  # of E, from 0 to 1
        return self.regular(value) - np.linalg.solve(self.N, self.E) * part, 1 - 2 * part


@pytest.mark.parametrize("seed", range(24))
def test_a_boundary_equilibrium_is_classified_as_the_determinants_say(seed):
    case = Normal(seed)
    start = find_equilibrium(case.system, case.regular(case.side), sides={"s": 1})
    branch = follow(start, {a: -case.side})
    first = branch.specials[0]
    assert abs(first.parameter) < LOCATED
    kind = "nonsmooth fold" if case.criterion > 0 else "persistence"
    assert first.kind == f"boundary equilibrium: {kind}"
    sign = 1 if case.criterion > 0 else -1
    pseudo = [e for e in branch.points if e.sides == (0,)]
    assert len(pseudo) > 1
    for e in pseudo:
        value = e.system.parameters[a]
        at, held = case.pseudo(value)
        assert value * case.side * sign >= -LOCATED
        assert np.allclose([*e.x, *e.mult], [*at, held], rtol=1e-9, atol=1e-9) and e.admissible


def test_an_isle_of_equilibria_closes():
    branch = follow(
        find_equilibrium(System({x: 0.25 - a**2 - x**2}, parameters={a: 0}), {x: 0.5}), {a: (-1, 1)}
    )
    assert branch.ends == ("it closes.",) and kinds(branch) == ["fold", "fold"]


def test_virtual_equilibria_are_followed_on_request_and_called_so():
    case = Normal(1)
    start = find_equilibrium(case.system, case.regular(case.side), sides={"s": 1})
    branch = follow(start, {a: -case.side}, virtual=True)
    assert branch.end.startswith("reached") and branch.values[-1] == -case.side
    assert (~branch.admissible).tolist() == (branch.values * case.side < -LOCATED).tolist()
    assert branch.specials[0].kind.startswith("boundary equilibrium: ")
    for e in branch.points:
        assert e.x == pytest.approx(case.regular(e.system.parameters[a]), abs=1e-10)
    # And back from there: the admissible part begins where it ended.
    back = follow(branch.points[-1], {a: case.side})
    assert back.end.startswith("reached") and back.admissible[-1] and abs(back.specials[0].parameter) < LOCATED


@pytest.mark.parametrize("stiffness, kind", [(1.0, "persistence"), (-1.0, "nonsmooth fold")])
def test_a_contact_closes_with_its_class(stiffness, kind):
    # Free: y = a/k. Closed: R = -a. On a spring that pulls back they follow each other, on one that pushes away they
    # exist together.
    stop = Unilateral(y, restitution=0.5, name="R")
    system = System({y: v, v: a - stiffness * y - v + stop.reaction}, parameters={a: stiffness})
    branch = follow(find_equilibrium(system, {y: 1, v: 0}, sides={"R": 1}), {a: -stiffness})
    (closing,) = branch.specials
    assert closing.kind == f"boundary equilibrium: {kind}" and abs(closing.parameter) < LOCATED
    assert "closes" in closing.note
    last = branch.points[-1]
    assert (
        last.held == ("R",)
        and last.mult[0] == pytest.approx(-branch.values[-1], abs=1e-12)
        and last.mult[0] == pytest.approx(1, abs=1e-12)
    )


def test_a_kink_is_passed_or_folds():
    fold = follow(find_equilibrium(System({x: a - sp.Abs(x)}, parameters={a: 1}), {x: 1}), {a: -1})
    assert kinds(fold) == ["boundary equilibrium: nonsmooth fold"] and fold.x[0, -1] == pytest.approx(
        -1, abs=1e-12
    )
    bent = follow(find_equilibrium(System({x: a - x - sp.Abs(x) / 2}, parameters={a: 1}), {x: 1}), {a: -1})
    assert kinds(bent) == ["boundary equilibrium: persistence"] and bent.x[0, -1] == pytest.approx(
        -2, abs=1e-12
    )


def test_a_relay_s_equilibrium_goes_through_its_surface():
    relay = System({x: a - sp.sign(x) - x}, parameters={a: -3})
    branch = follow(find_equilibrium(relay, {x: -2}), {a: 3})
    assert kinds(branch) == ["boundary equilibrium: persistence"] * 2
    assert [c.parameter for c in branch.specials] == pytest.approx([-1, 1], abs=LOCATED)
    values = np.where(abs(branch.values) > 1, branch.values - np.sign(branch.values), 0)
    assert branch.x[0] == pytest.approx(values, abs=1e-12)


# ---- hidden terms and sliding


def test_a_pulled_block_goes_from_stick_over_the_hidden_fold_to_slip():
    pulled = System({v: F - mu(lam) - v / 10}, parameters={F: 0.5})
    branch = follow(find_equilibrium(pulled, {v: 0}), {F: 3})
    assert kinds(branch) == ["hidden fold", "boundary equilibrium: nonsmooth fold"]
    hidden, border = branch.specials
    assert hidden.parameter == pytest.approx(16 / 9, abs=LOCATED)
    assert hidden.point.mult[0] == pytest.approx(2 / 3, abs=1e-9)  # to the root of what F is known to
    assert border.parameter == pytest.approx(1, abs=LOCATED) and border.beyond.kind == "regular"
    assert branch.x[0, -1] == pytest.approx(20, abs=1e-9)  # v = 10 (F - 1)
    repelling = (branch.mult[0] > 2 / 3) & (branch.mult[0] < 1)
    assert not branch.stable[repelling].any() and branch.stable[~repelling][:-1].sum() >= 10


def test_the_set_in_which_a_block_sticks_is_followed_along_a_state_to_its_ends():
    # k y = F - mu(lam): from y = 0.35 over the folds at (F -+ 16/9)/k to lam = -+1
    block = System({y: v, v: 0.7 - 2 * y - mu(lam) - v / 10})
    for direction in (1, -1):
        e = find_equilibrium(block, {y: 0.35, v: 0})
        branch = follow(e, {y: direction * 5.0})
        assert kinds(branch) == ["hidden fold", "end of the set"]
        hidden, end = branch.specials
        assert hidden.parameter == pytest.approx((0.7 + direction * 16 / 9) / 2, abs=LOCATED)
        assert end.parameter == pytest.approx((0.7 + direction) / 2, abs=LOCATED)
        assert 2 * branch.values == pytest.approx([0.7 - mu(l) for l in branch.mult[0]], abs=1e-11)
    with pytest.raises(
        ValueError, match="one of a set of equilibria of dimension 1.*along one of the states y, v"
    ):
        follow(find_equilibrium(System({y: v, v: F - y - mu(lam)}, parameters={F: 0}), {y: 0, v: 0}), {F: 1})
    with pytest.raises(ValueError, match="`over` names the state v, which is the same"):
        follow(e, {v: 1})


def test_a_hidden_state_turns_the_hidden_fold_into_a_fold():
    system = System(
        {v: F - lam * (1 + rho * z), z: (1 - lam**2 - z) / beta}, parameters={F: 0.5, rho: 3, beta: 0.1}
    )
    branch = follow(find_equilibrium(system, {v: 0, z: 0.9}), {F: 2})
    assert kinds(branch)[0] == "fold" and branch.specials[0].parameter == pytest.approx(16 / 9, abs=LOCATED)
    assert branch.stable[0] and not branch.stable[-2]


def test_a_sliding_hopf_point_has_its_cycle_on_the_surface():
    r2 = x**2 + y**2
    system = System({x: a * x - y - x * r2, y: x + a * y - y * r2, z: x / 5 - sp.sign(z)}, parameters={a: -0.3})
    branch = follow(find_equilibrium(system, {x: 0, y: 0, z: 0}), {a: 0.4})
    (hopf,) = branch.specials
    assert hopf.kind == "sliding Hopf" and abs(hopf.parameter) < LOCATED
    assert hopf.frequency == pytest.approx(1, abs=LOCATED) and hopf.lyapunov is None
    cycle = cycle_from(hopf, 0.2)
    # The radius is the square root of a; the amplitude goes along an eigenvector of length 1.
    assert cycle.success and cycle.stable and cycle.system.parameters[a] == pytest.approx(0.02, abs=1e-9)
    assert np.abs(cycle.solution()["z"]).max() < 1e-12


def test_a_pseudo_hopf_point_is_where_two_invisible_folds_meet():
    # y' = -(x - a) above, -(x + a) below: sliding between x = -|a| and |a|, which repels for a > 0
    s = Switch("s", y)
    branch = follow(find_equilibrium(System({x: s, y: -x + s * a}, parameters={a: -1}), {x: 0.1, y: 0}), {a: 1})
    assert kinds(branch) == ["pseudo-Hopf"] and abs(branch.specials[0].parameter) < LOCATED
    assert branch.stable[0] and not branch.stable[-1]
    # The other way round on both sides: visible, and no cycle.
    seen = follow(find_equilibrium(System({x: -s, y: -x + s * a}, parameters={a: -1}), {x: 0.1, y: 0}), {a: 1})
    assert kinds(seen) == ["two-fold"] and "both visible" in seen.specials[0].note


def test_the_surface_of_an_event_is_marked():
    system = System({x: a - x}, parameters={a: 0}, events=[Event(x - 1, name="gate")])
    branch = follow(find_equilibrium(system, {x: 0}), {a: 2})
    assert kinds(branch) == ["surface of an event"] and branch.specials[0].parameter == pytest.approx(
        1, abs=LOCATED
    )


# ---- cycles


@pytest.mark.parametrize("amplitude", [1e-3, 0.1, 0.6])
def test_a_cycle_from_a_hopf_point_is_that_of_the_normal_form_and_goes_on(amplitude):
    r2 = x**2 + y**2
    ring = System({x: a * x - 2 * y - x * r2, y: 2 * x + a * y - y * r2}, parameters={a: -0.5})
    (hopf,) = follow(find_equilibrium(ring, {x: 0, y: 0}), {a: 0.5}).specials
    cycle = cycle_from(hopf, amplitude)
    value = cycle.system.parameters[a]
    assert cycle.success and value == pytest.approx(amplitude**2 / 2, abs=1e-8)
    assert np.linalg.norm(cycle.x) == pytest.approx(math.sqrt(value), abs=1e-7)
    assert cycle.period == pytest.approx(math.pi, abs=1e-9)
    assert cycle.multipliers[0].real == pytest.approx(math.exp(-2 * value * math.pi), abs=1e-7)
    again = find_orbit(cycle.system, cycle.x0, seen=Return(cycle.map.surface))
    assert again.success and again.x == pytest.approx(cycle.x, abs=1e-8)
    onward = follow(cycle, {a: 0.8})
    assert np.linalg.norm(onward.x[:, -1]) == pytest.approx(math.sqrt(0.8), abs=1e-9)


def test_a_cycle_begins_at_no_fold():
    (fold,) = follow(find_equilibrium(System({x: a - x**2}, parameters={a: 1}), {x: 1}), {a: -1}).specials
    with pytest.raises(ValueError, match="`hopf` is a fold; cycles begin at a Hopf"):
        cycle_from(fold)


# ---- the branch itself


def test_a_branch_is_bounded_and_says_why_it_ends():
    start = find_equilibrium(System({x: a - x**2}, parameters={a: 1}), {x: 1})
    assert "`max_points`" in follow(start, {a: -1}, steps=Steps(max_points=3)).end
    assert "`max_seconds` are used up" in follow(start, {a: -1}, max_seconds=1e-9).end
    with pytest.raises(ValueError, match="`virtual` is for equilibria"):
        follow(
            find_orbit(System({x: sp.cos(z) - x}, time=z), {x: 0}, seen=Strobe(2 * sp.pi)),
            {a: 1},
            virtual=True,
        )
    with pytest.raises(ValueError, match="`over` names 'nu'"):
        follow(start, {"nu": 1})


def test_a_branch_is_a_table_and_a_picture():
    pulled = System({v: F - mu(lam) - v / 10}, parameters={F: 0.5})
    branch = follow(find_equilibrium(pulled, {v: 0}), {F: 1.5}, virtual=True)
    table = branch.to_dataframe()
    assert list(table) == ["F", "v", "stable", "lam", "stability", "virtual", "rightmost_eigenvalue"]
    assert len(table) == len(branch.points)
    ax = branch.plot(lam)
    assert ax.get_xlabel() == "F" and ax.get_ylabel() == "lam" and ax.get_legend() is None
    assert ax.lines[0].get_ydata() == pytest.approx(branch.mult[0])
    with pytest.raises(ValueError, match="`name` names 'nu', which is no state or multiplier"):
        branch.plot("nu")
    assert all(
        part in repr(branch) for part in ("Branch: 13 equilibria", "F from 0.5 to 1.5", "reached F = 1.5.")
    )


def test_equilibria_of_a_box_agree_with_the_branch_through_it():
    pulled = System({v: F - mu(lam) - v / 10}, parameters={F: 0.5})
    branch = follow(find_equilibrium(pulled, {v: 0}), {F: 3})
    found = equilibria(pulled.with_parameters({F: 1.5}), {v: (-50, 50)})
    passed = [e for e in found if e.admissible]
    assert len(passed) == 3  # stuck, stuck and repelling, slipping: the branch has all
    for e in passed:
        near = min(branch.points, key=lambda o: abs(o.system.parameters[F] - 1.5) + abs(o.mult[0] - e.mult[0]))
        assert near.stable == e.stable


def test_a_range_is_followed_both_ways():
    bent = System({x: a + x - x**3}, parameters={a: 0})
    start = find_equilibrium(bent, {x: 1})
    whole = follow(start, {a: (-1, 1)})
    down, up = (follow(start, {a: (-1, 1)}, way=way) for way in (-1, 1))
    assert whole.points[len(down.points) - 1] is start
    np.testing.assert_array_equal(whole.values, [*down.values[:0:-1], *up.values])
    assert [b.parameter for b in whole.specials] == [b.parameter for b in down.specials[::-1]]
    assert whole.end == f"{down.end} {up.end}" and up.values[-1] == 1


@pytest.mark.parametrize(
    "over, more, words",
    [
        ({a: (1, 2)}, {}, "`over` of a goes from 1 to 2, and the start is at 0"),
        ({a: 0}, {}, "`over` of a is 0, where the start already is"),
        ({a: 1}, {"way": 1}, "`way` is for a range"),
        ({a: (0, 1)}, {"way": -1}, "`way` is -1, and the start is at this end"),
        ({}, {}, "`over` names none"),
        ({a: 1}, {"kind": "fold"}, "`kind` is for curves over two parameters"),
        ({a: (0, 1), F: (0, 1)}, {"way": 1}, "`way` is for one parameter"),
    ],
)
def test_where_it_is_followed_is_checked(over, more, words):
    start = find_equilibrium(System({x: a + F - x**3 - x}, parameters={a: 0, F: 0}), {x: 0})
    with pytest.raises(ValueError, match=words):
        follow(start, over, **more)


def test_a_bifurcation_is_followed_over_two_parameters():
    (fold,) = follow(find_equilibrium(System({x: a - x**2}, parameters={a: 1}), {x: 1}), {a: -1}).specials
    with pytest.raises(TypeError, match="`start` is .*, which is followed over two parameters"):
        follow(fold, {a: 1})
