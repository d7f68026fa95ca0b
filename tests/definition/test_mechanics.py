"""Mechanisms of sympy.physics.mechanics with dry joints, slips and stops: against equations written by hand.

Guards: definition/mechanics.py.
"""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from sympy.physics import mechanics as me

from pwsmooth import System, Unilateral, solve
from pwsmooth.analysis.orbits.recutting import longest_slip
from pwsmooth.laws.friction import Coulomb, Dahl, LuGre

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
t = me.dynamicsymbols._t


def two_links():
    """Two links as a System of joints, and its angles and speeds: rods of length 1 and mass 1, hanging."""
    wall, upper, lower = (me.RigidBody(name) for name in ("wall", "upper", "lower"))
    for body in (upper, lower):
        body.mass = sp.Integer(1)
        body.inertia = me.inertia(body.frame, 0, 0, sp.Rational(1, 12)), body.masscenter
    system = me.System.from_newtonian(wall)
    q1, q2, u1, u2 = me.dynamicsymbols("q1 q2 u1 u2")
    system.add_joints(
        me.PinJoint("shoulder", wall, upper, q1, u1, child_point=-upper.x / 2, joint_axis=wall.z),
        me.PinJoint("elbow", upper, lower, q2, u2, parent_point=upper.x / 2, child_point=-lower.x / 2,
                    joint_axis=upper.z),
    )  # fmt: skip
    system.apply_uniform_gravity(sp.Rational(981, 100) * wall.x)
    return system


def test_dry_joints_are_as_torques_written_by_hand():
    start = {"q1": 1.2, "q2": 0.3, "u1": 0, "u2": 0}
    arm = System.from_mechanics(two_links(), friction={"shoulder": Coulomb(F_c=0.4), "elbow": Coulomb(F_c=0.2)})
    q1, q2, u1, u2 = sp.symbols("q1 q2 u1 u2", real=True)
    # Of the angle q1 + q2 of the second link; inertia of a rod about its end is 1/3.
    c, s, g = sp.cos(q2), sp.sin(q2), sp.Rational(981, 100)
    M = sp.Matrix(
        [[sp.Rational(5, 3) + c, sp.Rational(1, 3) + c / 2], [sp.Rational(1, 3) + c / 2, sp.Rational(1, 3)]]
    )
    pull = g * sp.sin(q1 + q2) / 2
    F = [
        s * (u1 * u2 + u2**2 / 2) - sp.Rational(3, 2) * g * sp.sin(q1) - pull - sp.Rational(2, 5) * sp.sign(u1),
        -s * u1**2 / 2 - pull - sp.sign(u2) / 5,
    ]
    hand = System({q1: u1, q2: u2}, mass_matrix=M, forcing=dict(zip((u1, u2), F)))
    ends = [solve(system, (0, 6), start, t_eval=[6.0], **TIGHT) for system in (arm, hand)]
    assert np.allclose(ends[0].x, ends[1].x, atol=1e-9)
    assert len(ends[0].events) == len(ends[1].events) > 10


def test_the_energy_of_dry_joints_balances():
    q1, q2, u1, u2 = sp.symbols("q1 q2 u1 u2", real=True)
    arm = System.from_mechanics(
        two_links(), friction={"shoulder": Coulomb(F_c=0.4), "elbow": LuGre(sigma0=50, F_c=0.2, F_s=0.3)},
        outputs={"energy": u1**2 * (sp.Rational(5, 3) + sp.cos(q2)) / 2
                 + u1 * u2 * (sp.Rational(1, 3) + sp.cos(q2) / 2) + u2**2 / 6
                 - 9.81 * (1.5 * sp.cos(q1) + sp.cos(q1 + q2) / 2)},
    )  # fmt: skip
    run = solve(arm, (0, 4), {"q1": 1.2, "q2": 0.3, "u1": 0, "u2": 0, "z_elbow": 0}, dense_output=True, **TIGHT)

    def lost(a, b):
        nodes, weights = np.polynomial.legendre.leggauss(20)
        at = (a + b) / 2 + (b - a) / 2 * nodes
        power = run(at, "friction shoulder") * run(at, "u1") + run(at, "friction elbow") * run(at, "u2")
        return (b - a) / 2 * power @ weights

    times = np.unique(np.concatenate([run.t, *(np.linspace(s.start, s.end, 40) for s in run.segments)]))
    work = sum(lost(a, b) for a, b in zip(times, times[1:]) if b > a)
    assert work > 0.5
    assert abs(run["energy"][0] - run["energy"][-1] - work) < 1e-8


def test_constraints_of_lagrange_are_multipliers():
    """A pendulum in Cartesian coordinates with a dry pivot: slip along it is the angle's rate."""
    x, y = me.dynamicsymbols("x y")
    L = (x.diff() ** 2 + y.diff() ** 2) / 2 - 9.81 * y
    lagrange = me.LagrangesMethod(L, [x, y], hol_coneqs=[x**2 + y**2 - 1])
    lagrange.form_lagranges_equations()
    turn = x * y.diff() - y * x.diff()
    free = System.from_mechanics(lagrange, friction={turn: Coulomb(F_c=0.5)})
    theta, w = sp.symbols("theta w", real=True)
    hand = System({theta: w, w: -sp.Rational(981, 100) * sp.sin(theta) - sp.sign(w) / 2})
    start = {"x": np.sin(1.0), "y": -np.cos(1.0), "x_dot": 0, "y_dot": 0}
    ours = solve(free, (0, 14), start, **TIGHT)
    theirs = solve(hand, (0, 14), {theta: 1.0, w: 0}, **TIGHT)
    assert np.arctan2(ours["x"][-1], -ours["y"][-1]) == pytest.approx(theirs["theta"][-1], abs=1e-8)
    assert ours.events[-1].kind == "stick"
    assert ours.events[-1].time == pytest.approx(theirs.events[-1].time, abs=1e-8)
    # At rest the rod bears the weight's part along it.
    assert abs(ours["lam1"][-1]) == pytest.approx(9.81 * np.cos(theirs["theta"][-1]) / 2, abs=1e-8)


def test_a_wheel_that_rolls_has_a_dependent_speed():
    """Kane's equations with x' = R w: rolling resistance and a pull, by hand (m + J/R^2) x'' = P - M_r/R."""
    x, phi, v, w = me.dynamicsymbols("x phi v w")
    m, J, R, P = sp.symbols("m J R P", positive=True)
    frame, centre = me.ReferenceFrame("N"), me.Point("C")
    centre.set_vel(frame, v * frame.x)
    wheel = frame.orientnew("W", "axis", [phi, frame.z])
    wheel.set_ang_vel(frame, w * frame.z)
    body = me.RigidBody("wheel", centre, wheel, m, (me.inertia(wheel, 0, 0, J), centre))
    for independent, dependent in ((v, w), (w, v)):
        kane = me.KanesMethod(
            frame, q_ind=[x, phi], u_ind=[independent], u_dependent=[dependent],
            kd_eqs=[x.diff() - v, phi.diff() - w], velocity_constraints=[v - R * w],
        )  # fmt: skip
        kane.kanes_equations([body], [(centre, P * frame.x)])
        values = {m: 2, J: 0.3, R: 0.5, P: 1.5}
        rolls = System.from_mechanics(kane, friction={"w": Coulomb(F_c=0.2)}, parameters=values)
        run = solve(rolls, (0, 2), {"x": 0, "phi": 0, "v": 0, "w": 0}, **TIGHT)
        a = (1.5 - 0.2 / 0.5) / (2 + 0.3 / 0.25)
        assert run["x"][-1] == pytest.approx(2 * a, rel=1e-10), str(dependent)
        assert run["phi"][-1] == pytest.approx(4 * a, rel=1e-10)


def falling_block():
    x, y = me.dynamicsymbols("x y")
    g = sp.Symbol("g", positive=True)
    lagrange = me.LagrangesMethod((x.diff() ** 2 + y.diff() ** 2) / 2 - g * y, [x, y])
    lagrange.form_lagranges_equations()
    return lagrange, x, y, g


def test_a_block_that_lands_slides_under_the_load_of_its_contact():
    lagrange, x, y, g = falling_block()
    floor = Unilateral(y, name="floor")
    block = System.from_mechanics(
        lagrange,
        contacts=[floor],
        friction={x.diff(): (Coulomb(F_c=0.3), floor.reaction)},
        parameters={g: 9.81},
    )
    run = solve(block, (0, 3), {"x": 0, "y": 1, "x_dot": 2, "y_dot": 0}, **TIGHT)
    lands = np.sqrt(2 / 9.81)
    left = 2 - 0.3 * 9.81 * lands  # what friction takes of the speed at the impact
    assert run.event_times("stick")[-1] == pytest.approx(lands + left / (0.3 * 9.81), abs=1e-9)
    assert run["x"][-1] == pytest.approx(2 * lands + left**2 / (2 * 0.3 * 9.81), abs=1e-9)


class FourBar:
    """Cranks of length 1 and 2, a coupler of 2 between their tips (its inertia lumped there), ground 2."""

    def __init__(self, **friction):
        a, b = me.dynamicsymbols("a b")
        L = (a.diff() ** 2 + 4 * b.diff() ** 2) / 2 - 3 * (sp.sin(a) + sp.sin(b))
        closes = (2 + 2 * sp.cos(b) - sp.cos(a)) ** 2 + (2 * sp.sin(b) - sp.sin(a)) ** 2 - 4
        lagrange = me.LagrangesMethod(L, [a, b], hol_coneqs=[closes])
        lagrange.form_lagranges_equations()
        laws = {name: Coulomb(F_c=force) for name, force in friction.items()}
        self.system, self.friction = System.from_mechanics(lagrange, friction=laws), friction
        A, B, p, q = sp.symbols("A B p q", real=True)
        self.closes = closes.subs({a: A, b: B})
        drift = sp.hessian(self.closes, (A, B))
        bend = (sp.Matrix([[p, q]]) * drift * sp.Matrix([p, q]))[0]
        weights = -3 * sp.cos(A), -3 * sp.cos(B)
        self.numbers = sp.lambdify((A, B, p, q), [self.closes.diff(A), self.closes.diff(B), bend, *weights])
        self.other = float(sp.nsolve(self.closes.subs(A, 1.0), B, 1.2))

    def start(self, speed):
        """States at a = 1."""
        ga, gb, *_ = self.numbers(1.0, self.other, 0, 0)
        return [1.0, self.other, speed, -speed * ga / gb]

    def rates(self, _, s):
        """For SciPy; friction by the signs of the speeds."""
        ga, gb, c, one, two = self.numbers(*s)
        one -= self.friction.get("a", 0) * np.sign(s[2])
        two -= self.friction.get("b", 0) * np.sign(s[3])
        lam = -(ga * one + gb * two / 4 + c) / (ga**2 + gb**2 / 4)
        return [s[2], s[3], one + lam * ga, (two + lam * gb) / 4]

    def solve(self, end, speed):
        """By the package."""
        start = dict(zip(("a", "b", "a_dot", "b_dot"), self.start(speed), strict=True))
        return solve(self.system, (0, end), start, **TIGHT)


def test_a_four_bar_linkage_with_a_dry_joint_agrees_with_scipy():
    bars = FourBar(a=0.3)
    run = bars.solve(0.6, 1.5)
    reference = solve_ivp(bars.rates, (0, 0.6), bars.start(1.5), method="DOP853", rtol=1e-12, atol=1e-13)
    assert np.abs(reference.y[2]).min() > 0.05  # nothing switches on the way
    assert np.allclose(run.x[:4, -1], reference.y[:, -1], atol=1e-9)


def test_two_dry_joints_of_a_four_bar_linkage_come_to_rest_together():
    bars = FourBar(a=1.2, b=1.4)
    run = bars.solve(3, 1.5)

    def stops(_, s):
        return s[2]

    stops.terminal = True
    reference = solve_ivp(
        bars.rates, (0, 3), bars.start(1.5), method="DOP853", rtol=1e-12, atol=1e-13, events=stops
    )
    assert [e.kind for e in run.events] == ["stick", "stick"] and run.success
    assert run.event_times() == pytest.approx(reference.t[-1], abs=1e-10)
    assert run.x[:2, -1] == pytest.approx(reference.y[:2, -1], abs=1e-10)
    assert np.abs(run.x[2:4, -1]).max() < 1e-13


@pytest.mark.parametrize(("beyond", "held"), [(0.999, False), (1.001, True)])
def test_two_dry_joints_of_a_four_bar_linkage_hold_as_much_as_both(beyond, held):
    ga, gb, _, one, two = FourBar().numbers(*FourBar().start(0)[:2], 0, 0)
    ratio = -ga / gb
    joint = beyond * abs(one + ratio * two) / (1 + abs(ratio))  # of equal strength: virtual work
    run = FourBar(a=joint, b=joint).solve(0.5, 0)
    assert run.success and bool(np.abs(run.x[2:4, -1]).max() < 1e-13) is held


def test_what_is_no_mechanism_or_no_velocity_is_refused():
    lagrange, x, _, g = falling_block()
    with pytest.raises(TypeError, match="give a KanesMethod"):
        System.from_mechanics("pendulum")
    fresh = me.LagrangesMethod(x.diff() ** 2 / 2, [x])
    with pytest.raises(ValueError, match=r"call its form_lagranges_equations\(\) first"):
        System.from_mechanics(fresh)
    for key, match in (
        ("hinge", "no joint, coordinate or speed; there are x, y"),
        (x, "no velocity: none of the speeds"),
    ):
        with pytest.raises(ValueError, match=match):
            System.from_mechanics(lagrange, friction={key: Coulomb()}, parameters={g: 9.81})
    with pytest.raises(TypeError, match="give a law"):
        System.from_mechanics(lagrange, friction={"x": 0.3}, parameters={g: 9.81})


def test_laws_of_several_velocities_keep_their_own_names():
    lagrange, x, y, g = falling_block()
    both = {x.diff() + y.diff(): Dahl(F_c=0.3), x.diff() - y.diff(): Dahl(F_c=0.2)}
    block = System.from_mechanics(lagrange, friction=both, parameters={g: 9.81})
    assert [str(s) for s in block.states] == ["x", "y", "x_dot", "y_dot", "z_1", "z_2"]
    assert {str(p): value for p, value in block.parameters.items()}.items() >= {
        "F_c_1": 0.3,
        "F_c_2": 0.2,
    }.items()
    for friction, values in (
        ({"x": Dahl(), x.diff(): Dahl()}, {}),
        ({x.diff() + y.diff(): Dahl()}, {sp.Symbol("F_c", positive=True): 2}),
    ):
        with pytest.raises(ValueError, match="brings (z_x|F_c), which the mechanism or another law has"):
            System.from_mechanics(lagrange, friction=friction, parameters={g: 9.81, **values})


def test_what_has_no_inertia_is_refused():
    x, y = me.dynamicsymbols("x y")
    lagrange = me.LagrangesMethod((x.diff() + y.diff()) ** 2 / 2 - y**2, [x, y])
    lagrange.form_lagranges_equations()
    with pytest.raises(ValueError, match="singular mass matrix, of rank 1 for 2 unknowns"):
        System.from_mechanics(lagrange)


def test_accelerations_that_are_unknowns_are_no_sticks():
    """The same block by a mass matrix and by hand: shaded where it sticks alone."""
    x, y, v, w, F = sp.symbols("x y v w F", real=True)
    f = [F * sp.sin(t) - 2 * x + y - sp.sign(v) - v / 5, x - 2 * y - w / 5]
    M = sp.Matrix([[2, sp.Rational(1, 2)], [sp.Rational(1, 2), 1]])
    a = M.LUsolve(sp.Matrix(f))
    pair = [
        System({x: v, y: w}, mass_matrix=M, forcing={v: f[0], w: f[1]}, time=t, parameters={F: 2.5}),
        System({x: v, y: w, v: a[0], w: a[1]}, time=t, parameters={F: 2.5}),
    ]
    runs = [solve(system, (0, 20), [0, 0, 0, 0], dense_output=True, **TIGHT) for system in pair]
    shades = [len(run.plot(["x"])[0].patches) for run in runs]
    assert shades == [3, 3]
    middle, length = zip(*(longest_slip(run) for run in runs))
    assert length[0] > 1 and (middle[0], length[0]) == pytest.approx((middle[1], length[1]), abs=1e-9)


def test_constraints_that_are_nonlinear_in_velocities_are_refused():
    """Appell and Hamel's: the vertical speed is that of the horizontal one."""
    x, y, z = me.dynamicsymbols("x y z")
    speeds = x.diff() ** 2 + y.diff() ** 2
    lagrange = me.LagrangesMethod(
        (speeds + z.diff() ** 2) / 2 - z, [x, y, z], nonhol_coneqs=[z.diff() ** 2 - speeds]
    )
    lagrange.form_lagranges_equations()
    with pytest.raises(ValueError, match="nonlinear in the velocities: of nonholonomic ones rolling"):
        System.from_mechanics(lagrange)


def test_a_knife_edge_is_linear_in_velocities_and_runs():
    """x' sin(a) = y' cos(a): on a slope it goes to and fro, x = (g/(2 w^2)) sin(w t)^2 (Neimark & Fufaev 1972)."""
    x, y, a = me.dynamicsymbols("x y a")
    lagrange = me.LagrangesMethod(
        (x.diff() ** 2 + y.diff() ** 2 + a.diff() ** 2) / 2 + x, [x, y, a],
        nonhol_coneqs=[x.diff() * sp.sin(a) - y.diff() * sp.cos(a)],
    )  # fmt: skip
    lagrange.form_lagranges_equations()
    start = {"x": 0, "y": 0, "a": 0, "x_dot": 0, "y_dot": 0, "a_dot": 1.5}
    run = solve(System.from_mechanics(lagrange), (0, 4), start, **TIGHT)
    assert run["x"][-1] == pytest.approx(np.sin(6) ** 2 / 4.5, abs=1e-9)


def test_loops_that_kanes_equations_do_not_keep_are_refused():
    x, y, u, w = me.dynamicsymbols("x y u w")
    frame, point = me.ReferenceFrame("N"), me.Point("P")
    point.set_vel(frame, u * frame.x + w * frame.y)
    kane = me.KanesMethod(
        frame, q_ind=[x], u_ind=[u, w], q_dependent=[y], kd_eqs=[x.diff() - u, y.diff() - w],
        configuration_constraints=[x**2 + y**2 - 1],
    )  # fmt: skip
    kane.kanes_equations([me.Particle("bead", point, sp.Integer(1))], [])
    with pytest.raises(ValueError, match="closes 1 loops by configuration_constraints and keeps 0 of them"):
        System.from_mechanics(kane)
