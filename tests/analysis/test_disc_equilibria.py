"""Equilibria of dry friction in the plane and in space: every slip and every stick, beside closed forms.

Guards: analysis/equilibria/disc_modes.py.
"""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from pwsmooth import Disc, Switch, System, find_equilibrium, follow, solve
from pwsmooth.analysis.equilibria import equilibria
from pwsmooth.analysis.global_objects import manifold

x, y, u, v, w = sp.symbols("x y u v w", real=True)
F, V, a = sp.symbols("F V a", real=True)
lam = Disc("lam", (u, v))
square = lam[0] ** 2 + lam[1] ** 2
BOX = {s: (-4, 4) for s in (x, y, u, v)}


def _draw(rng, d, k):
    """A block under a force, v' = F - C v - (1 + k (1 - |lambda|^2)) lambda, and its force and damping."""
    velocities = (u, v, w)[:d]
    disc = Disc("lam", velocities)
    force = rng.standard_normal(d)
    force *= rng.uniform(0.2, 2.0) / np.linalg.norm(force)
    root = rng.uniform(-1, 1, (d, d))
    C = root @ root.T + 0.3 * np.eye(d)
    size = sum(disc[i] ** 2 for i in range(d))
    rates = {
        velocities[i]: force[i]
        - sum(C[i, j] * velocities[j] for j in range(d))
        - disc[i] * (1 + k * (1 - size))
        for i in range(d)
    }
    return System(rates), force, C


def _expected(force, C, k):
    """(velocity, lambda) of all equilibria: (I + r C) n = F in slip, |lambda| (1 + k (1 - |lambda|^2)) = |F| else."""
    d, load = len(force), np.linalg.norm(force)
    found = []

    def excess(r):
        return np.linalg.norm(np.linalg.solve(np.eye(d) + r * C, force)) - 1

    if load > 1:
        r = brentq(excess, 0, 100, xtol=1e-15)
        n = np.linalg.solve(np.eye(d) + r * C, force)
        found.append((r * n, n))
    for size in np.roots([-k, 0, 1 + k, -load] if k else [1, -load]):
        if abs(size.imag) < 1e-12 and 0 < size.real < 1:
            found.append((np.zeros(d), size.real * force / load))
    return sorted(found, key=lambda pair: tuple(np.round(np.concatenate(pair), 6)))


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("k", [0, 2])
def test_all_equilibria_of_a_block_on_a_surface(d, k):
    rng = np.random.default_rng(10 * d + k)
    for _ in range(12):
        system, force, C = _draw(rng, d, k)
        found = [(e.x, e.mult[1:]) for e in equilibria(system, dict.fromkeys(system.states, (-20, 20)))]
        found.sort(key=lambda pair: tuple(np.round(np.concatenate(pair), 6)))
        expected = _expected(force, C, k)
        assert len(found) == len(expected)
        for got, wanted in zip(found, expected, strict=True):
            assert np.concatenate(got) == pytest.approx(np.concatenate(wanted), abs=1e-10)


def test_their_stability_is_that_of_the_smoothed_view():
    rng, eps, signs = np.random.default_rng(5), 1e-5, set()
    for _ in range(8):
        system, _, _ = _draw(rng, 2, 2)
        smooth = system.smoothed(eps)
        for e in equilibria(system, {u: (-9, 9), v: (-9, 9)}, starts=32):
            if e.held:
                near = find_equilibrium(smooth, e.x + eps * e.mult[1:] / np.sqrt(1 - e.mult[1:] @ e.mult[1:]))
                expected = e.layer_eigenvalues / eps
            else:
                near, expected = find_equilibrium(smooth, e.x), e.eigenvalues
            assert near.x == pytest.approx(e.x, abs=20 * eps)
            assert near.eigenvalues == pytest.approx(expected, rel=1e-3, abs=1e-3)
            signs.add((bool(e.held), e.stable))
    assert signs == {(True, True), (True, False), (False, True)}


def test_where_a_branch_sticks_folds_and_slips():
    block = System(
        {u: F - lam[0] * (1 + 3 * (1 - square)) - u / 2, v: -lam[1] * (1 + 3 * (1 - square)) - v / 2},
        parameters={F: 0.1},
    )
    branch = follow(find_equilibrium(block, {u: 0, v: 0}), {F: 3})
    fold, slip = branch.specials
    assert (fold.kind, slip.kind) == ("hidden fold", "boundary equilibrium: nonsmooth fold")
    assert fold.parameter == pytest.approx(16 / 9, abs=1e-9)  # the largest of l (4 - 3 l^2)
    assert slip.parameter == pytest.approx(1, abs=1e-9) and slip.note == "|lam| reaches 1: it slips"
    assert slip.beyond.held == () and branch.points[-1].x == pytest.approx([4, 0])

    skew = System({u: F - lam[0] - u / 2, v: sp.Rational(9, 10) - lam[1] - v / 2}, parameters={F: 1.2})
    branch = follow(find_equilibrium(skew, {u: 1, v: 0.7}), {F: -2})
    assert [b.kind for b in branch.specials] == ["boundary equilibrium: persistence"] * 2
    assert [b.parameter for b in branch.specials] == pytest.approx([0.19**0.5, -(0.19**0.5)], abs=1e-9)
    held = np.array([bool(e.held) for e in branch.points])
    assert np.all(np.abs(branch.values[held]) <= 0.19**0.5 + 1e-9) and held.sum() > 5


def test_a_hopf_point_of_weakening_friction_is_that_on_a_line():
    size = sp.sqrt((u - V) ** 2 + v**2)
    belt = Disc("m", (u - V, v))
    weak = sp.Rational(6, 10) + sp.Rational(4, 10) * sp.exp(-size)
    plane = System(
        {x: u, y: v, u: -x - belt[0] * weak - u / 5, v: -4 * y - belt[1] * weak - v / 5}, parameters={V: 1}
    )
    single = Switch("s", u - V)
    line = System({x: u, u: -x - single * weak.subs(v, 0) - u / 5}, parameters={V: 1})
    for system in (plane, line):
        branch = follow(find_equilibrium(system, {s: 0.5 if s is x else 0 for s in system.states}), {V: -1})
        hopf, border = branch.specials
        assert (hopf.kind, border.kind) == ("Hopf", "boundary equilibrium")
        assert hopf.parameter == pytest.approx(np.log(2), abs=1e-9)
        assert (hopf.frequency, hopf.lyapunov) == pytest.approx((1, 0.025))
        assert border.parameter == pytest.approx(0, abs=1e-9) and "no single equilibrium" in border.note


def test_a_block_between_springs_rests_in_a_set():
    block = System({x: u, y: v, u: 1 - 2 * x - lam[0] - u / 10, v: -y - lam[1] - v / 10})
    rest = find_equilibrium(block, {x: 0.3, y: 0.2, u: 0, v: 0})
    assert rest.x[:2] == pytest.approx([0.3, 0.2]) and rest.mult == pytest.approx([0.2, 0.4, -0.2])
    assert rest.stability == "stable set" and rest.free_directions.shape == (2, 7)
    assert (rest.kind, rest.held) == ("pseudo-equilibrium", ("lam",))
    # And the motion from there comes to rest within the set.
    run = solve(block, (0, 40), {x: 1.1, y: 0, u: 0, v: 0})
    there = find_equilibrium(block, run.x[:, -1])
    assert there.x == pytest.approx(run.x[:, -1], abs=1e-9) and there.held == ("lam",)


def test_what_slips_the_wrong_way_or_is_held_too_firmly_is_virtual():
    block = System({u: F - lam[0] - u / 2, v: 0.4 - lam[1] - v / 2}, parameters={F: 0.3})
    slip, against = (e for e in equilibria(block, {u: (-4, 4), v: (-4, 4)}, virtual=True) if not e.held)
    assert slip.x == pytest.approx([-0.6, -0.8]) and slip.virtual == "the speed of slip along lam is -1"
    assert against.x == pytest.approx([1.8, 2.4]) and against.virtual == "the speed of slip along lam is -3"
    held = find_equilibrium(block.with_parameters({F: 3}), {u: 0, v: 0}, sides={"lam": 0}, virtual=True)
    assert held.virtual == "|lam| is 3.02655, beyond 1"


def test_two_plates_on_each_other():
    low, high = Disc("low", (u, v)), Disc("high", (x - u, y - v))
    plates = System({
        u: -low[0] + high[0] / 2, v: -low[1] + high[1] / 2, x: F - high[0] / 2 - x / 4, y: -high[1] / 2 - y / 4
    }, parameters={F: 0.8})  # fmt: skip
    (held,) = equilibria(plates.with_parameters({F: 0.4}), BOX, starts=32)
    assert set(held.held) == {"low", "high"} and held.multipliers["high_x"] == pytest.approx(0.8)
    (slid,) = equilibria(plates, BOX, starts=32)
    assert slid.held == ("low",) and slid.x0["x"] == pytest.approx(1.2) and slid.multipliers["low_x"] == 0.5


def test_a_drag_at_rest_has_an_equilibrium():
    along = lam[0] * u + lam[1] * v
    for speed in (along, sp.sqrt(u**2 + v**2)):
        drag = System({x: u, y: v, u: -x - speed * u - u / 5, v: -y - speed * v - v / 5})
        rest = find_equilibrium(drag, {x: 0.3, y: 0.2, u: 0, v: 0})
        assert rest.x == pytest.approx(0, abs=1e-12) and rest.stability == "stable" and rest.isolated
        assert np.sort(rest.eigenvalues.real) == pytest.approx(-0.1)
        assert len(equilibria(drag, BOX, starts=32)) == 1
        kink = System({x: u, y: v, u: -x - speed / 5 - u / 5, v: -y - v / 5})
        (rest,) = equilibria(kink, BOX, starts=32)
        assert rest.stability == "undecided" and "Jacobian jumps" in rest.linear.undecided


def test_sides_of_a_disc_are_asked_for():
    block = System({u: 1.2 - lam[0] * (1 + 3 * (1 - square)) - u, v: -lam[1] - v})
    assert [e.held for e in equilibria(block, {u: (-2, 2), v: (-2, 2)}, sides={"lam": 1})] == [()]
    with pytest.raises(ValueError, match=r"`sides` of lam is -1; a disc slips \(1\) or is held \(0\)"):
        find_equilibrium(block, {u: 1, v: 0}, sides={"lam": -1})


def test_in_the_plane_of_two_forces_slip_begins_on_circles():
    box = {F: (-3, 3), a: (-3, 3)}
    plain = System({u: F - lam[0] - u / 2, v: a - lam[1] - v / 2}, parameters={F: 0.1, a: 0.3})
    fold = 1 + 3 * (1 - square)
    static = System({u: F - lam[0] * fold - u / 2, v: a - lam[1] * fold - v / 2}, parameters={F: 0.1, a: 0.3})
    for block, kind, radius in ((plain, "boundary equilibrium", 1), (static, "hidden fold", 16 / 9)):
        first = follow(find_equilibrium(block, {u: 0, v: 0}), {F: 2}).specials[0]
        curve = follow(first, box)
        assert curve.kind == kind and curve.ends == ("it closes.",)
        assert np.hypot(*np.array(curve.values)) == pytest.approx(radius, abs=1e-10)


@pytest.mark.parametrize("seed", [0, 3])
def test_where_runs_end_there_is_an_equilibrium(seed):
    """Two blocks and a relay, each pulling at the others: the event-driven loop is the judge."""
    rng = np.random.default_rng(seed)
    velocities = sp.symbols("v_1:6", real=True)
    places = sp.symbols("z_1:6", real=True)
    discs = Disc("a", velocities[:2]), Disc("b", velocities[2:4])
    lams = [*discs[0].components, *discs[1].components, Switch("s", velocities[4])]
    root = rng.normal(size=(5, 5))
    C, force, springs = root @ root.T / 5 + 0.4 * np.eye(5), rng.normal(size=5), rng.uniform(0.5, 2, 5)
    rates = dict(zip(places, velocities)) | {
        velocities[i]: force[i]
        - springs[i] * places[i]
        - lams[i] / 2
        - sum(C[i, j] * velocities[j] for j in range(5))
        for i in range(5)
    }
    system = System(rates)
    for _ in range(3):
        run = solve(system, (0, 200), rng.normal(size=10) * 2)
        end = run.x[:, -1]
        rest = find_equilibrium(system, end)
        assert rest.x == pytest.approx(end, abs=1e-5) and {"a", "b"} <= set(rest.held)
        assert rest.free_directions.shape[0] == 4 + ("s" in rest.held)
        stays = solve(system, (0, 20), rest.x)
        assert stays.x[:, -1] == pytest.approx(rest.x, abs=1e-9)


def test_curves_from_a_saddle_in_slip():
    saddle = find_equilibrium(System({u: 0.5 - lam[0] + u / 2, v: -lam[1] - v}), {u: 1.1, v: 0.1})
    assert saddle.x == pytest.approx([1, 0]) and saddle.eigenvalues == pytest.approx([0.5, -2])
    arms = manifold(saddle, "unstable", length=3).arms
    ends = sorted((arm.points[:, -1] for arm in arms), key=lambda p: p[0])
    assert ends[0] == pytest.approx([0, 0], abs=1e-9) and ends[1][0] > 2
    with pytest.raises(
        ValueError, match="curves that run backward or across a surface of a system with a disc"
    ):
        manifold(saddle, "stable", length=3)


def test_on_a_belt_slip_ends_along_lines():
    belt = Disc("m", (u - V, v))
    system = System({u: F - belt[0] - u / 2, v: -belt[1] - v}, parameters={F: 3, V: 1})
    first = follow(find_equilibrium(system, {u: 4, v: 0}), {F: 0}).specials[0]
    assert first.parameter == pytest.approx(1.5, abs=1e-9) and first.note == "the slip of m ends: it is held"
    curve = follow(first, {F: (0, 3), V: (-2, 2)})
    forces, speeds = np.array(curve.values)
    assert forces == pytest.approx(1 + speeds / 2, abs=1e-9) and np.ptp(speeds) > 3
    assert not curve.specials and len(curve.points) < 200
