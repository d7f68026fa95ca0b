"""Impacts with dry friction: Coulomb's law in impulses, |P_t| <= mu P_n, against the slip that is left.

Closed forms, and for bodies with several contacts the conditions themselves: each impact is held against them.

Guards: kernels/instant/impacts.py.
"""

import numpy as np
import pytest
import scipy.optimize
import sympy as sp

from pwsmooth import Disc, Outcome, System, Unilateral, solve

x, y, u, v, w, a, va, b, vb, turn = sp.symbols("x y u v w a va b vb turn", real=True)
mu, e = sp.symbols("mu e", nonnegative=True)
k = sp.Symbol("k", real=True)


def falling(friction, **more):
    """A mass that falls by 0.8 with g = 10: it lands at t = 0.4 with speed 4."""
    N = Unilateral(y, restitution=e, name="floor").reaction
    rates = {y: w, w: -10 + N, **friction(N)}
    return System(rates, parameters={mu: 0.5, e: 0.0}, **more)


ALONG = falling(lambda N: {u: -mu * N * sp.sign(u)})


@pytest.mark.parametrize("method", ["taylor", "rk"])
@pytest.mark.parametrize("friction", [0.05, 0.5, 1.0])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("slip", [0.5, -0.5, 3.0, -9.0])
def test_a_slip_loses_no_more_than_it_has(slip, restitution, friction, method):
    given = {mu: friction, e: restitution}
    run = solve(ALONG, (0, 0.41), {y: 0.8, w: 0, u: slip}, parameters=given, method=method)
    left = max(0.0, abs(slip) - friction * 4 * (1 + restitution))
    at = np.searchsorted(run.t, run.events[0].time, side="right") - 1  # the last column of the landing
    assert run.success and run["u"][at] == pytest.approx(np.copysign(left, slip), abs=1e-12)
    assert (run["u"][at] == 0) == (left == 0)


def test_a_ball_with_spin_grips_the_floor():
    # Garwin: a solid ball, moment of inertia 2/5, whose point of contact slips with u + w: it stops, at 5/7 of u.
    N = Unilateral(y, restitution=e, name="floor").reaction
    T = -mu * N * sp.sign(u + turn)
    ball = System({y: w, w: -10 + N, u: T, turn: sp.Rational(5, 2) * T}, parameters={mu: 0.5, e: 0.8})
    run = solve(ball, (0, 0.41), {y: 0.8, w: 0, u: 0.8, turn: 0})
    assert run["u"][-1] == pytest.approx(0.8 * 5 / 7, abs=1e-12)
    assert run["u"][-1] + run["turn"][-1] == pytest.approx(0, abs=1e-14)


def test_a_slip_in_the_plane_loses_no_more_than_it_has():
    def plane(N):
        lam = Disc("lam", (u, va))
        return {u: -mu * N * lam[0], va: -mu * N * lam[1]}

    system = falling(plane)
    for size, left in ((1.0, 0.0), (3.0, 1.0)):
        run = solve(system, (0, 0.41), {y: 0.8, w: 0, u: 0.6 * size, va: 0.8 * size})
        at = np.searchsorted(run.t, run.events[0].time, side="right") - 1
        assert run.success and [run["u"][at], run["va"][at]] == pytest.approx(
            [0.6 * left, 0.8 * left], abs=1e-12
        )


@pytest.mark.parametrize("push", [0.8, 0.0, -0.8])
def test_an_impact_does_not_move_what_friction_holds(push):
    # A second mass lands on the load of a block that rests with a part of what friction can bear.
    ground, top = Unilateral(a, name="ground").reaction, Unilateral(b - a - 1, name="top").reaction
    rates = {a: va, b: vb, u: 10 * mu * k - mu * ground * sp.sign(u), va: -10 + ground - top, vb: -10 + top}
    pile = System(rates, parameters={mu: 0.25, k: 0.8})
    run = solve(pile, (0, 0.5), {a: 0, va: 0, b: 1.8, vb: 0, u: 0}, parameters={k: push})
    assert run.success and not run.ambiguities and not run["u"].any()


def bodies(n, contacts, dimension):
    """Velocities v with n inverse masses, gaps G q, friction of each contact against its slips H v."""
    q, v = sp.symbols(f"q:{n}", real=True), sp.symbols(f"v:{n}", real=True)
    G = sp.Matrix(contacts, n, sp.symbols(f"g:{contacts * n}", real=True))
    H = sp.Matrix(contacts * dimension, n, sp.symbols(f"h:{contacts * dimension * n}", real=True))
    light = sp.symbols(f"light:{n}", positive=True)
    rough, back = (
        sp.symbols(f"rough:{contacts}", nonnegative=True),
        sp.symbols(f"back:{contacts}", nonnegative=True),
    )
    force, gaps = sp.zeros(n, 1), G * sp.Matrix(q)
    for c in range(contacts):
        N = Unilateral(gaps[c], restitution=back[c], name=f"N{c}").reaction
        rows = H[c * dimension : (c + 1) * dimension, :]
        slips = rows * sp.Matrix(v)
        lam = [sp.sign(slips[0])] if dimension == 1 else Disc(f"lam{c}", tuple(slips))
        force += N * (G[c, :].T - rough[c] * rows.T * sp.Matrix([lam[i] for i in range(dimension)]))
    rates = dict(zip(q, v, strict=True)) | {s: m * f for s, m, f in zip(v, light, force, strict=True)}
    symbols = (*G, *H, *light, *rough, *back)
    outputs = {f"force{i}": force[i] for i in range(n)}
    system = System(rates, parameters=dict.fromkeys(symbols, 0.5), outputs=outputs)
    return system, symbols


def drawn(random, n, contacts, dimension, redundant):
    """Values of the parameters, and speeds with which all contacts that approach close at t = 1."""
    G, H = random.normal(size=(contacts, n)), random.normal(size=(contacts * dimension, n))
    if redundant:
        H = np.tile(H[:dimension], (contacts, 1))
    light, rough = random.uniform(0.3, 3, n), random.uniform(0, 0.5, contacts)
    back = random.uniform(0, 1, contacts) * (random.random() < 0.5)
    v = random.normal(size=n)
    for row in (
        *(r for r in H if random.random() < 0.3),
        *(r for r in G if contacts > 1 and random.random() < 0.3),
    ):
        v -= row * (row @ v) / (row @ row)
    return G, H, light, rough, back, v


def breaks_the_law(before, after, G, H, light, rough, back, dimension):
    """By how much the speeds break the law, in the best impulses: a linear problem."""
    u, up, slip, contacts = G @ before, G @ after, (H @ after).reshape(-1, dimension), len(G)
    aim = np.where(u < -1e-9, -back * u, 0.0)
    moves = np.linalg.norm(slip, axis=1) > 1e-9
    columns, rows = [], []  # of impulses p_c, then of those of friction that sticks
    for c in range(contacts):
        along = slip[c] / np.linalg.norm(slip[c]) if moves[c] else np.zeros(dimension)
        columns.append(light * (G[c] - rough[c] * along @ H[c * dimension : (c + 1) * dimension]))
    sticks = [(c, i) for c in range(contacts) if not moves[c] for i in range(dimension)]
    columns += [-light * H[c * dimension + i] for c, i in sticks]
    A, count = np.array(columns).T, len(columns)
    bounds = [(0, None) if abs(up[c] - aim[c]) < 1e-8 else (0, 0) for c in range(contacts)]
    for place, (c, _) in enumerate(sticks):
        for sign in (1, -1):
            row = np.zeros(count)
            row[contacts + place], row[c] = sign, -rough[c]
            rows.append(row)
    n, none = len(light), np.zeros((len(rows), 2 * len(light)))
    limits = {"A_ub": np.hstack([rows, none]), "b_ub": np.zeros(len(rows))} if rows else {}
    found = scipy.optimize.linprog(
        np.r_[np.zeros(count), np.ones(2 * n)],
        A_eq=np.hstack([A, np.eye(n), -np.eye(n)]),
        b_eq=after - before,
        bounds=bounds + [(None, None)] * len(sticks) + [(0, None)] * 2 * n,
        **limits,
    )
    return max(found.fun, (aim - up).max())


@pytest.mark.parametrize(
    ("n", "contacts", "dimension", "redundant"),
    [(3, 1, 1, False), (4, 2, 1, False), (6, 3, 1, False), (4, 2, 1, True), (5, 1, 2, False), (6, 2, 2, False)],
)
def test_every_impact_obeys_the_law(n, contacts, dimension, redundant):
    system, symbols = bodies(n, contacts, dimension)
    random, seen = np.random.default_rng(contacts), 0
    for _ in range(60):
        *tables, v = drawn(random, n, contacts, dimension, redundant)
        speeds = tables[0] @ v
        if not speeds.min() < -1e-2 or (speeds > 1e-12).any():
            continue
        values = np.concatenate([np.ravel(table) for table in tables])
        run = solve(system, (0, 1 + 1e-9), [*-v, *v], parameters=dict(zip(symbols, values, strict=True)))
        assert run.outcome is Outcome.FINISHED, run.message
        assert breaks_the_law(v, run.x[n:, -1], *tables, dimension) < 1e-7
        # What the impacts say of their impulses is the change of momentum. Those that act together say the same.
        rounds = {tuple(event.impulse.items()) for event in run.events if event.kind == "impact"}
        gained = sum(np.array([dict(r)[f"force{i}"] for i in range(n)]) for r in rounds)
        assert gained == pytest.approx((run.x[n:, -1] - v) / tables[2], abs=1e-8)
        seen += 1
    assert seen >= 8


@pytest.mark.parametrize("restitution", [0, 0.5])
@pytest.mark.parametrize("strength", [0.1, 0.6])
def test_friction_that_is_not_in_the_push_does_nothing_in_an_impact(strength, restitution):
    # Also where the impact ends that part of the slip which is along the push.
    lam, wall = Disc("lam", (u, w)), Unilateral(x, restitution=e, name="wall")
    rates = {x: u, y: w, u: -1 - mu * lam[0] + wall.reaction, w: -mu * lam[1]}
    given = {mu: strength, e: restitution}
    run = solve(System(rates, parameters={mu: 1, e: 0}), (0, 1.2), {x: 0.5, y: 0, u: 0, w: 1}, parameters=given)
    at = np.searchsorted(run.t, run.event_times("impact")[0])
    assert run.success and run["w"][at] == run["w"][at + 1] > 0.4
    assert run["u"][at + 1] == pytest.approx(-restitution * run["u"][at], abs=1e-14)


def test_a_pile_tells_the_impulses_of_all_that_touch():
    # A mass of 2 lands with speed 4 on one of 3 that lies on the ground: 8 in one, through the other, into the ground.
    ground, top = Unilateral(a, name="ground").reaction, Unilateral(b - a, name="top").reaction
    pile = System({a: va, b: vb, va: -10 + (ground - top) / 3, vb: -10 + top / 2})
    run = solve(pile, (0, 0.5), {a: 0, va: 0, b: 0.8, vb: 0})
    (landing,) = [event for event in run.events if event.kind == "impact"]
    assert landing.switch == "top" and landing.impulse == pytest.approx({"ground": 8, "top": 8})
    assert all(event.impulse is None for event in run.events if event.kind != "impact")


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_impulses_are_in_the_unit_of_the_reaction_and_go_back_in_time(unit):
    N = Unilateral(y, restitution=e, name="floor").reaction
    ball = System({y: w, w: -10 * k + N / 2}, parameters={e: 0.5, k: 1.0}, outputs={"twice": 2 * N})
    run = solve(ball, (0, 0.7), {y: 0.8 * unit, w: 0}, parameters={k: unit}, t_eval=[0.1, 0.7])
    assert [event.impulse["floor"] for event in run.events] == pytest.approx([12 * unit])
    assert run.events[0].impulse["twice"] == 2 * run.events[0].impulse["floor"]
    back = solve(ball, (0.7, 0), run.x[:, -1], parameters={k: unit})
    assert [event.impulse["floor"] for event in back.events] == pytest.approx([12 * unit], rel=1e-6)


def test_impacts_that_follow_at_one_instant_tell_their_sum():
    # A heavy body drives a light one to a wall: what the wall gives is the change of momentum of both.
    A, B = Unilateral(x, restitution=1, name="A"), Unilateral(y - x, restitution=1, name="B")
    squeeze = System({x: v, y: w, v: A.reaction - B.reaction, w: B.reaction / 10_000})
    run = solve(squeeze, (0, 1), {x: 1e-15, y: 2e-15, v: 0, w: -1})
    rounds = {(event.time, *event.impulse.items()) for event in run.events if event.kind == "impact"}
    total = sum(dict(r[1:]).get("A", 0.0) for r in rounds)
    assert total == pytest.approx(run["v"][-1] + 10_000 * run["w"][-1] + 10_000, rel=1e-9)
