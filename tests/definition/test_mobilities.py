"""Contacts of mechanisms whose mass matrix couples the accelerations: against the matrix inverted by hand.

Guards: definition/mobilities.py.
"""

import numpy as np
import pytest
import sympy as sp
from sympy.physics import mechanics as me

from pwsmooth import Algebraic, Event, Family, Switch, System, Unilateral, solve
from pwsmooth.analysis.maps.first_order import variations

TIGHT = {"rtol": 1e-10, "atol": 1e-12}
t, q1, q2, u1, u2, w, f = sp.symbols("t q1 q2 u1 u2 w f", real=True)
mu, e = sp.symbols("mu e", nonnegative=True)
HALF = sp.Rational(1, 2)


def both(M, F, q, u, contacts, parameters, **more):
    """A mechanism with its mass matrix, and with that inverted; contacts with what their points slip along."""
    F = list(F)
    for R, along in contacts:
        slip = sum(along.diff(a) * b for a, b in zip(q, u))
        friction = mu * Switch(f"lam_{R.name}", slip)
        F = [F[i] + R.reaction * (R.gap.diff(a) - friction * along.diff(a)) for i, a in enumerate(q)]
    rates, more = dict(zip(q, u)), {"time": t, "parameters": parameters} | more
    with_matrix = System(rates, mass_matrix=M, forcing=dict(zip(u, F)), **more)
    accelerations = map(sp.together, M.inv() * sp.Matrix(F))
    return with_matrix, System(rates | dict(zip(u, accelerations)), **more)


def double_pendulum(**more):
    """Two links of length and mass 1 beside a wall that they lean on and rub, pushed to and fro."""
    c, s, g = sp.cos(q1 - q2), sp.sin(q1 - q2), sp.Rational(981, 100)
    F = [
        -s * u2**2 - 2 * g * sp.sin(q1) + f * sp.cos(3 * t) - u1 / 5,
        s * u1**2 - g * sp.sin(q2) - (u2 - u1) / 5,
    ]
    wall = Unilateral(sp.sin(q1) + sp.sin(q2) - w, restitution=e, name="wall")
    values = {mu: 0.3, e: 0.5, w: 0.3, f: 3}
    height = -sp.cos(q1) - sp.cos(q2)
    return both(sp.Matrix([[2, c], [c, 1]]), F, (q1, q2), (u1, u2), [(wall, height)], values, **more)


def kinds(run):
    return [(event.kind, event.switch) for event in run.events]


@pytest.fixture(scope="module")
def pendulums():
    return double_pendulum()


@pytest.mark.parametrize("method", ["auto", "rk"])
@pytest.mark.parametrize(
    ("values", "seen"),
    [
        ({mu: 0, e: 0.5}, {"impact", "accumulation"}),
        ({mu: 0.3, e: 0, f: 2}, {"impact", "closed contact", "opening", "crossing"}),
        ({mu: 0.8, f: 12}, {"impact", "slip by reset"}),
        ({mu: 0.1, f: 4}, {"impact", "accumulation"}),  # impacts of 1e-8, which move a slip by roundings
        ({mu: 0.3, e: 0.3, f: 5}, {"impact", "opening"}),
    ],
)
def test_a_double_pendulum_meets_its_wall_as_with_the_matrix_inverted(pendulums, method, values, seen):
    start = {q1: 0.5, q2: 0.6, u1: 1, u2: 2}
    here, hand = (solve(s, (0, 8), start, parameters=values, method=method, **TIGHT) for s in pendulums)
    assert here.success and hand.success
    assert kinds(here) == kinds(hand)
    assert seen <= {kind for kind, _ in kinds(here)}
    assert np.abs(here.x[:, -1] - hand.x[:, -1]).max() < 1e-8


def test_what_a_run_shows_of_an_acceleration_has_the_reactions_in_it(pendulums):
    values = {mu: 0.3, e: 0, f: 2}
    run = solve(
        pendulums[0], (0, 3), {q1: 0.5, q2: 0.6, u1: 1, u2: 2}, parameters=values, dense_output=True, **TIGHT
    )
    closed = run.t[np.flatnonzero(run["wall"] > 0.1)]
    at = (closed[5] + closed[6]) / 2
    steps = at + 1e-5 * np.array([-1, 1])
    slope = np.diff(run(steps, "u1"))[0] / 2e-5
    assert abs(run(np.array([at]), "du1/dt")[0] - slope) < 1e-6 * (1 + abs(slope))
    assert abs(run(np.array([at]), "free du1/dt")[0] - slope) > 0.1


def test_derivatives_go_through_impacts_and_closed_contacts_of_a_mechanism(pendulums):
    start, by = {q1: 0.5, q2: 0.6, u1: 1, u2: 2}, ["q1", "u1", e, w, f]
    here, hand = (solve(s, (0, 8), start, parameters={mu: 0, e: 0.5}, by=by, **TIGHT) for s in pendulums)
    assert {"impact", "closed contact"} <= {event.kind for event in here.events}
    assert np.abs(here.derivatives.end - hand.derivatives.end).max() < 1e-7 * np.abs(hand.derivatives.end).max()
    # The one of a stored solution knows of the mobilities, too: through the first impacts.
    rest = {"parameters": {mu: 0, e: 0.5}, "dense_output": True} | TIGHT
    flows = [variations(solve(s, (0, 1.5), start, **rest)).matrix for s in pendulums]
    assert np.abs(flows[0] - flows[1]).max() < 1e-6 * np.abs(flows[1]).max()


def test_a_rod_comes_to_rest_on_both_of_its_ends():
    """In the coordinates of one end, which couple them all."""
    x, y, v, s = sp.symbols("x y v s", real=True)
    q, u = (x, y, q1), (v, s, u1)
    J = sp.Matrix([x + sp.cos(q1) / 2, y + sp.sin(q1) / 2]).jacobian(q)
    M = sp.simplify(J.T * J + sp.diag(0, 0, sp.Rational(1, 12)))
    centripetal = sp.Matrix([-sp.cos(q1) / 2, -sp.sin(q1) / 2]) * u1**2
    F = -J.T * (centripetal + sp.Matrix([0, sp.Rational(981, 100)]))
    ends = [(Unilateral(y, name="A"), x), (Unilateral(y + sp.sin(q1), name="B"), x + sp.cos(q1))]
    here, hand = (
        solve(system, (0, 4), {x: 0, y: 0.5, q1: 0.4, v: 1, s: 0, u1: 0.5}, **TIGHT)
        for system in both(M, F, q, u, ends, {mu: 0.1})
    )
    assert here.success and kinds(here) == kinds(hand)
    assert np.abs(here.x[:, -1] - hand.x[:, -1]).max() < 1e-9
    assert np.abs(here.x[1:, -1]).max() < 1e-12
    assert here["A"][-1] == pytest.approx(9.81 / 2, rel=1e-9) == here["B"][-1]


@pytest.mark.parametrize(
    ("inertia", "width", "height"),
    [((4 + 0.25) / 12, 0.5, 1.0), (0.1, 2 * np.sin(0.3), np.cos(0.3))],  # a block, a rimless wheel of spokes 1
)
def test_a_body_rocks_from_one_foot_to_the_other(inertia, width, height):
    """In the coordinates of one foot. Angular momentum about the other stays (Housner 1963, McGeer 1990)."""
    x, y, v, s = sp.symbols("x y v s", real=True)
    I, d, h = sp.symbols("I d h", positive=True)
    c, n = sp.cos(q1), sp.sin(q1)
    J = sp.Matrix([x + d * c / 2 - h * n, y + d * n / 2 + h * c]).jacobian((x, y, q1))
    M = sp.simplify(J.T * J + sp.diag(0, 0, I))
    centripetal = sp.Matrix([-d * c / 2 + h * n, -d * n / 2 - h * c]) * u1**2
    F = -J.T * (centripetal + sp.Matrix([0, sp.Rational(981, 100)]))
    feet = [(Unilateral(y, name="A"), x), (Unilateral(y + d * n, name="B"), x + d * c)]
    system, _ = both(M, F, (x, y, q1), (v, s, u1), feet, {mu: 0.6, I: 1, d: 1, h: 1})
    values = {I: inertia, d: width, h: height}
    run = solve(system, (0, 0.52), {x: 0, y: 0, q1: 0.05, v: 0, s: 0, u1: 0}, parameters=values, **TIGHT)
    impact = run.event_times("impact")[0]
    before, after = np.searchsorted(run.t, impact), np.searchsorted(run.t, impact, side="right") - 1
    arm = height**2 + width**2 / 4
    ratio = (inertia + height**2 - width**2 / 4) / (inertia + arm)
    turning = run["u1"]
    assert turning[after] == pytest.approx(ratio * turning[before], rel=1e-9)
    # It has turned back there, which brings the foot in the air to rest for a moment.
    assert run.success and turning[-1] * turning[after] < 0 and run["A"][-1] == 0 and run["B"][-1] > 0
    assert run["y"][-1] + width * np.sin(run["q1"][-1]) == pytest.approx(0, abs=1e-12)


def slider_crank(far, near):
    """A crank of length 1/2, a rod of length 1, a slider of mass 2 on a spring: by Lagrange with the multipliers of the
    loop, and by the angle of the crank alone."""
    th, ph, X = me.dynamicsymbols("th ph X")
    x, y = sp.cos(th) / 2 + sp.cos(ph) / 2, sp.sin(th) / 2 - sp.sin(ph) / 2
    T = th.diff() ** 2 / 2 + (x.diff() ** 2 + y.diff() ** 2) / 2 + ph.diff() ** 2 / 24 + X.diff() ** 2
    loop = [sp.cos(th) / 2 + sp.cos(ph) - X, sp.sin(th) / 2 - sp.sin(ph)]
    lagrange = me.LagrangesMethod(T - sp.Rational(5, 2) * (X - 1) ** 2, [th, ph, X], hol_coneqs=loop)
    lagrange.form_lagranges_equations()

    def stops(place):
        gaps = {"far": far - place, "near": place - near}
        return [Unilateral(gap, restitution=e, name=name) for name, gap in gaps.items()]

    a, om = sp.symbols("th th_dot", real=True)
    b = sp.asin(sp.sin(a) / 2)
    place = sp.cos(a) / 2 + sp.cos(b)
    x, y = sp.cos(a) / 2 + sp.cos(b) / 2, sp.sin(a) / 2 - sp.sin(b) / 2
    inertia = 1 + x.diff(a) ** 2 + y.diff(a) ** 2 + b.diff(a) ** 2 / 12 + 2 * place.diff(a) ** 2
    alone = stops(place)
    force = sum(R.reaction * R.gap.diff(a) for R in alone) - 5 * (place - 1) * place.diff(a)
    hand = System({a: om, om: (force - inertia.diff(a) * om**2 / 2) / inertia}, parameters={e: 0.5})
    start = {a: 1.2, om: -3.0}
    whole = {name: float(v.subs(start)) for name, v in (
        ("th", a), ("ph", b), ("X", place), ("th_dot", om), ("ph_dot", b.diff(a) * om), ("X_dot", place.diff(a) * om)
    )}  # fmt: skip
    return (System.from_mechanics(lagrange, contacts=stops(X), parameters={e: 0.5}), whole), (hand, start)


def test_a_slider_crank_between_stops_is_as_in_one_coordinate():
    pairs = slider_crank(sp.Rational(13, 10), sp.Rational(3, 4))
    for restitution in (0.5, 0, 1):
        here, hand = (solve(s, (0, 6), start, parameters={e: restitution}, **TIGHT) for s, start in pairs)
        assert here.success and kinds(here) == kinds(hand)
        assert len(here.event_times("impact")) >= 2
        assert abs(here["th"][-1] - hand["th"][-1]) < 1e-8, restitution
        assert abs(here["th_dot"][-1] - hand["th_dot"][-1]) < 1e-8, restitution


def test_two_masses_of_which_one_meets_a_stop():
    """By Kane's method; a closed form: the second mass, at rest, feels nothing of the stop."""
    x, y, u, v = me.dynamicsymbols("x y u v")
    N, O = me.ReferenceFrame("N"), me.Point("O")
    O.set_vel(N, 0)
    P, Q = O.locatenew("P", x * N.x), O.locatenew("Q", (x + y) * N.x)
    P.set_vel(N, u * N.x)
    Q.set_vel(N, (u + v) * N.x)
    kane = me.KanesMethod(N, [x, y], [u, v], kd_eqs=[u - x.diff(), v - y.diff()])
    kane.kanes_equations([me.Particle("p", P, 1), me.Particle("q", Q, 1)], [(P, 0 * N.x)])
    stop = Unilateral(x, restitution=HALF, name="stop")
    system = System.from_mechanics(kane, contacts=[stop])
    run = solve(system, (0, 0.5), {"x": 1, "y": 0, "u": -4, "v": 4})
    assert run.x[:, -1] == pytest.approx([0.5, 0.5, 2, -2], abs=1e-12)


def test_units_of_mass_and_length_change_nothing(pendulums):
    """Masses of 1e-9 and 1e9: forces and reactions scale along."""
    m = sp.Symbol("m", positive=True)
    c, s = sp.cos(q1 - q2), sp.sin(q1 - q2)
    wall = Unilateral(sp.sin(q1) + sp.sin(q2) - w, restitution=e, name="wall")
    F = [m * (-s * u2**2 - 20 * sp.sin(q1)) + wall.reaction * sp.cos(q1),
         m * (s * u1**2 - 10 * sp.sin(q2)) + wall.reaction * sp.cos(q2)]  # fmt: skip
    system = System(
        {q1: u1, q2: u2}, mass_matrix=m * sp.Matrix([[2, c], [c, 1]]), forcing=dict(zip((u1, u2), F)),
        parameters={m: 1, e: 0.5, w: 0.3},
    )  # fmt: skip
    runs = [
        solve(system, (0, 6), {q1: 0.5, q2: 0.6, u1: 1, u2: 2}, parameters={m: mass}) for mass in (1, 1e-9, 1e9)
    ]
    for run in runs[1:]:
        assert kinds(run) == kinds(runs[0])
        assert np.abs(run.x[:, -1] - runs[0].x[:, -1]).max() < 1e-6


def test_an_event_may_read_an_acceleration_that_follows_a_reaction():
    """Two masses tied by M = [[2, 1], [1, 1]], pressed against a stop by a force that turns: du/dt = 0 there."""
    a, b, x, u = (sp.Symbol(name, real=True) for name in ("a", "b", "x", "u"))
    stop = Unilateral(x, name="stop")
    rates = {x: u, q1: u1, u: a, u1: b}
    unknowns = [Algebraic(a, 2 * a + b - (t - 1) - stop.reaction), Algebraic(b, a + b)]
    pushed = Event(a - 1, direction=1, name="fast")
    run = solve(System(rates, algebraic=unknowns, events=[pushed], time=t), (0, 3), {x: 0, u: 0, q1: 0, u1: 0})
    assert run["a"][0] == 0.0
    assert run["free a"][0] == pytest.approx(-1)
    assert run["stop"][0] == pytest.approx(1)
    assert run.event_times("opening") == pytest.approx([1.0])
    assert run.event_times(switch="fast") == pytest.approx([2.0])


def test_a_friction_whose_load_is_an_unknown_is_refused_beside_a_contact():
    x, y, v, s, a, N = sp.symbols("x y v s a N", real=True)
    stop = Unilateral(x, name="stop")
    guide = [Algebraic(a, a + N * sp.sign(v) / 10 - stop.reaction), Algebraic(N, N - 2 * a - 10)]
    with pytest.raises(
        ValueError, match=r"acts? through the unknown N.*depends on .*an impact would change it"
    ):
        System({x: v, v: a}, algebraic=guide)
    # Without the feedback, or with the factor of a place, there is a law.
    mass = 2 + sp.sign(x - 1)
    System({x: v, v: a}, algebraic=[Algebraic(a, a * mass - stop.reaction - N), Algebraic(N, N + v**3 + N**3)])


def test_a_family_of_mechanisms_with_contacts_is_that_of_one():
    links = Family(9)
    x, v, y, s, a, b = links.symbols("x v y s a b")
    stop = Unilateral(x, restitution=0.5, name="stop")
    unknowns = [Algebraic(a, 2 * a + b + 1 - stop.reaction), Algebraic(b, a + b)]
    many = System({x: v, y: s, v: a, s: b}, algebraic=unknowns, contacts=[stop])
    run = solve(many, (0, 3), {x: 1, v: 0, y: 0, s: 0})
    assert np.ptp(run.x[:9, -1]) == 0.0
