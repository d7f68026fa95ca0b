"""Orbits shot over in segments: as single ones where these can be had, and against closed forms where not."""

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from friction_oscillator import coulomb, hidden, v, y, z

from pwsmooth import Event, Return, Strobe, System, Unilateral
from pwsmooth.analysis.continuation import branch_off, follow
from pwsmooth.analysis.maps.multipliers import cyclic_multipliers, within_roundings
from pwsmooth.analysis.maps.segments import Shooting, cut
from pwsmooth.analysis.orbits.finding import find_orbit
from pwsmooth.analysis.orbits.fixed_points import TOLERANCE
from tests.fuzz import orbits as planted
from tests.fuzz.judging import WRONG
from tests.reference.rest import rest_limit

t, x, u, w = sp.symbols("t x u w", real=True)
a, k = sp.symbols("a k", real=True)
MIRROR = {y: -y, v: -v}
FORCED = Strobe(2 * sp.pi)


def companion(rates, update=None, **options):
    """A system beside which w grows by exp(20) in a unit of time, fed by x: its orbits are those without w."""
    events = [] if update is None else [Event(every=1, update=update)]
    return System({**rates, w: 20 * w - x}, time=t, events=events, **options)


# ---- multipliers


@pytest.mark.parametrize("seed", range(8))
def test_multipliers_of_a_product_are_found_where_the_product_has_lost_them(seed):
    # A_k = Q_k T_k Q_k-1^T: the multipliers are the products of the diagonals, of sizes 1e12 to 1e-12.
    rng = np.random.default_rng(seed)
    N, n = 7, 5
    Q = [np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(N)]
    sizes = np.array([50.0, 6.0, 1.0, 1.0, 1 / 50])
    matrices, exact = [], np.ones(n, complex)
    for j in range(N):
        diagonal = sizes * rng.uniform(0.5, 2.0, n) * rng.choice([-1, 1], n)
        T = np.diag(diagonal) + np.triu(rng.normal(size=(n, n)), 1)
        angle = rng.uniform(0, 3)
        # A pair of complex ones in the middle.
        r = abs(diagonal[2])
        T[2:4, 2:4] = r * np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        exact *= [*diagonal[:2], r * np.exp(1j * angle), r * np.exp(-1j * angle), diagonal[4]]
        matrices.append(Q[j] @ T @ Q[j - 1].T)
    found = cyclic_multipliers(matrices)
    off = [np.abs(found - one).min() / abs(one) for one in exact]
    assert max(off) < N * 1e-15 * max(np.linalg.cond(A) for A in matrices)
    product = np.linalg.eigvals(np.linalg.multi_dot(matrices[::-1]))
    assert np.abs(product - exact[-1]).min() > 1e-3 * abs(exact[-1])


def test_what_a_stick_takes_away_is_a_multiplier_of_zero():
    rng = np.random.default_rng(1)
    matrices = [rng.normal(size=(3, 3)) for _ in range(4)]
    matrices[2][1] = 0.0
    assert abs(cyclic_multipliers(matrices)[-1]) < 1e-13


@pytest.mark.parametrize("rate", [2, 4, 10])
def test_both_multipliers_of_a_saddle_are_known(rate):
    # x'' = k^2 x + cos t has the orbit -cos t/(1 + k^2), with the multipliers exp(+-2 pi k).
    saddle = System({x: u, u: k**2 * x + sp.cos(t)}, time=t, parameters={k: rate})
    orbit = find_orbit(saddle, {x: -0.3, u: 0}, FORCED)
    assert orbit.success and orbit.x == pytest.approx([-1 / (1 + rate**2), 0], abs=10 * TOLERANCE)
    exact = np.exp([2 * math.pi * rate, -2 * math.pi * rate])
    assert orbit.multipliers.real == pytest.approx(exact, rel=1e-9, abs=0)
    assert f"in {len(orbit.segments)} segments" in repr(orbit)


@pytest.mark.parametrize("case", range(12))
def test_a_random_unstable_orbit_has_its_multipliers(case):
    # The long mode is `python -m tests.fuzz.orbits --cases 200`.
    verdict, _ = planted.play(case // 2, bool(case % 2), (0.5, 1.5, 3.0, 5.0)[case // 2 % 4])
    assert verdict.kind != WRONG


# ---- the same orbits as in one piece


def wall(restitution):
    stop = Unilateral(x, name="wall", restitution=restitution)
    return System({x: u, u: -1 + 1.2 * sp.cos(t) - u / 5 + stop.reaction}, time=t)


SAME = {
    "stick, hidden term": (hidden(), {y: 0.5, v: 0.3, z: 0}, FORCED),
    "half period": (coulomb(sigma=1.4), {y: 0.5, v: 0.3}, Strobe(2 * sp.pi, symmetry=MIRROR)),
    "complete chatter": (wall(0.5), {x: 0.5, u: 0}, Strobe(2 * sp.pi, phase=0.3)),
    "return map": (System({x: u, u: u / 5 - x - sp.sign(u)}), {x: 6.3, u: 0.1}, Return(u, direction=-1)),
    "smoothed": (hidden().smoothed(1e-3), {y: 0.5, v: 0.3, z: 0}, FORCED),
}  # fmt: skip


@pytest.mark.parametrize("name", SAME)
def test_segments_change_nothing(name):
    system, start, how = SAME[name]
    one = find_orbit(system, start, how, transient=0 if name == "return map" else 30)
    cut = find_orbit(system, 1.001 * one.x, how, segments=5)
    assert one.success and cut.success and len(cut.segments) == 5
    assert cut.word == one.word and cut.period == pytest.approx(one.period, rel=1e-10)
    # Smoothed views are solved to 1e-10.
    slack = 1e-8 if name == "smoothed" else 100 * TOLERANCE
    assert cut.x == pytest.approx(one.x, abs=slack)
    assert np.sort(np.abs(cut.multipliers)) == pytest.approx(np.sort(np.abs(one.multipliers)), abs=slack)


# ---- branches


def test_a_canard_is_followed_around_its_end():
    """Along a hidden term deviations grow within the stick: segments begin there too.

    One piece ends at sigma = 3.2458, where its multiplier has grown to 1e4.
    """
    orbit = find_orbit(hidden(), {y: 0.5, v: 0.3, z: 0}, FORCED, transient=30)
    branch = follow(orbit, {"sigma": 4})
    assert branch.end == "reached sigma = 2.4." and [b.kind for b in branch.specials] == ["fold"]
    largest = max(branch.points, key=lambda one: abs(one.multipliers[0]))
    assert abs(largest.multipliers[0]) > 1e6 and largest.segments.held
    # The other path of the package, over each segment.
    map_, nodes = replace(largest.map, options={"method": "rk"}), largest.segments.nodes
    other = [map_.leg(node, leg).x for node, leg in zip(nodes, Shooting(map_, largest.segments.cuts).legs)]
    assert np.array(other) == pytest.approx(np.roll(nodes, -1, axis=0), abs=1e-8)


@pytest.mark.parametrize("drive", [1, pytest.param(0.5, marks=pytest.mark.thorough)])
def test_rest_ends_in_a_fold_and_goes_over_to_slips_through_its_canard(drive):
    """Multipliers of 1 and less, and a growth of 1e7 and more on the way: one piece drowns in its roundings.

    Stuck at y = 0 the block's symmetric orbit has the multiplier -1 everywhere. The touch of |lam| = 1, behind the
    fold, is no jump: what comes to the end of the layer slips and is back at once.
    """
    orbit = find_orbit(
        hidden(omega=drive, sigma=0.6), {y: 0, v: 0, z: 0.9}, seen=Strobe(2 * sp.pi / drive, symmetry=MIRROR)
    )
    branch = follow(orbit, {"sigma": 3})
    first, second = branch.specials[:2]
    assert branch.end == "reached sigma = 3." and (first.kind, second.kind) == ("fold", "adding-sliding")
    assert first.parameter == pytest.approx(rest_limit(0.1 * drive, 1.8, 1.95), abs=2e-8)
    assert first.parameter - 1e-7 < second.parameter < first.parameter
    assert len(branch.of_kind("fold")) == 2 and len(branch.of_kind("adding-sliding")) == 1


def test_a_multiplier_of_minus_one_keeps_its_digits_where_another_state_answers_by_1e10():
    grows = [np.array([[1.0, 0, 0], [0, 0, 0], [30.0, 0, a]]) for a in (1e-5, 1e-5, *[1e2] * 4)]
    grows[-1][0, 0] = -1.0
    assert np.abs(cyclic_multipliers(grows) + 1).min() < 1e-12
    # What roundings leave of a zero, times the growth, is how far it is known.
    grows[0][0, 2] = 1e-17
    assert within_roundings(grows, -1) and not within_roundings(grows, 1)


def test_bifurcations_are_found_beside_a_multiplier_of_1e8():
    logistic = companion({x: 0 * x}, {x: a * x * (1 - x)}, parameters={a: 2.8})
    branch = follow(find_orbit(logistic, {x: 0.6, w: 0.03}, seen=Strobe(1, phase=0.5)), {a: 3.3})
    (flip,) = branch.specials
    assert flip.kind == "flip" and flip.parameter == pytest.approx(3, abs=1e-9)
    assert abs(flip.point.multipliers[0]) == pytest.approx(math.exp(20), rel=1e-9)
    double = branch_off(flip, 0.02)
    assert double.success and double.map.count == 2
    (second,) = follow(double, {a: 3.5}).specials
    assert second.kind == "flip" and second.parameter == pytest.approx(1 + math.sqrt(6), abs=1e-9)
    # And back: it ends where it began.
    back = follow(double, {a: 2.9})
    assert "shrink onto one of 1" in back.end and back.specials[-1].parameter == pytest.approx(3, abs=1e-9)


def test_the_symmetry_breaks_beside_a_multiplier_of_1e54_as_without_it():
    rates = {x: u, u: -u / 5 - x**3 + a * sp.cos(t)}
    found = []
    for system, start, mirror in (
        (System(rates, time=t, parameters={a: 1.5}), {x: 1, u: 0}, {x: -x, u: -u}),
        (companion(rates, parameters={a: 1.5}), {x: 1, u: 0, w: 0.05}, {x: -x, u: -u, w: -w}),
    ):
        branch = follow(find_orbit(system, start, Strobe(2 * sp.pi, symmetry=mirror)), {a: 3})
        (breaking,) = branch.of_kind("symmetry breaking")
        lopsided = branch_off(breaking, 0.02)
        assert lopsided.success and not lopsided.symmetric
        found.append((breaking.parameter, *lopsided.multipliers[-2:].real))
    assert abs(lopsided.multipliers[0]) == pytest.approx(math.exp(40 * math.pi), rel=1e-8)
    # Eigenvectors of either sign: orbits on either side, at the same distance in another norm.
    assert found[0][0] == pytest.approx(found[1][0], abs=1e-9)
    assert found[0][1:] == pytest.approx(found[1][1:], abs=1e-3)


def test_any_orbit_of_a_branch_is_followed_over_another_parameter():
    saddle = System({x: u, u: k**2 * x + a * sp.cos(t)}, time=t, parameters={k: 1, a: 1})
    branch = follow(find_orbit(saddle, {x: -0.5, u: 0}, FORCED), {k: 5})
    middle = branch.points[len(branch.points) // 2]
    onward = follow(middle, {a: 3})
    rate = middle.system.parameters[k]
    assert onward.end == "reached a = 3." and rate not in (1, 5)
    assert onward.x[0] == pytest.approx(-onward.values / (1 + rate**2), abs=100 * TOLERANCE)


def test_a_cycle_of_an_autonomous_system_is_followed_on_its_section():
    # r' = k r (r^2 - 1): the cycle r = 1 has the multiplier exp(4 pi k).
    square = x**2 + u**2 - 1
    system = System({x: k * x * square - u, u: k * u * square + x}, parameters={k: 0.2})
    branch = follow(find_orbit(system, {x: 1.0, u: 0}, seen=Return(u)), {k: 4})
    assert branch.end == "reached k = 4." and len(branch.points[-1].segments) > 3
    exact = np.exp(4 * math.pi * branch.values)
    assert [one.multipliers[0].real for one in branch.points] == pytest.approx(exact, rel=1e-9)


@pytest.mark.thorough
def test_turns_of_a_pendulum_are_the_same_however_many_it_has_made():
    # Upside down and shaken; a hundred turns further its angle has roundings of 1e-13, which grow a thousandfold.
    pendulum = System({x: u, u: k**2 * sp.sin(x) - u / 10 + sp.cos(t)}, time=t, parameters={k: 4})
    branches = []
    for turned in (0, 200 * math.pi):
        orbit = find_orbit(pendulum, {x: turned - 0.06, u: 0}, FORCED)
        branches.append(follow(orbit, {k: 6}))
    one, other = branches
    assert other.end == "reached k = 6." and len(one.values) == len(other.values)
    assert other.x[0] - 200 * math.pi == pytest.approx(one.x[0], abs=TOLERANCE * 200 * math.pi)
    # exp(-period/10), the determinant, is the product of both.
    for branch, slack in ((one, 1e-9), (other, 1e-7)):
        products = [np.prod(found.multipliers).real for found in branch.points]
        assert products == pytest.approx([math.exp(-2 * math.pi / 10)] * len(products), rel=slack)


def test_bad_numbers_of_segments_are_refused():
    with pytest.raises(ValueError, match="`segments`"):
        find_orbit(coulomb(), {y: 0.5, v: 0.3}, FORCED, segments=0)


@pytest.mark.parametrize("rate", [2.6, 2.8, 3.0, 3.2, 3.4, 3.6])
def test_segments_that_are_cut_anew_do_not_begin_where_an_event_has_come_near(rate):
    # x' = rate x + cos t, and a kink where x passes 0: an old segment begins 1e-9 of the period behind that.
    kinked = System({x: rate * x + sp.cos(t) + sp.Abs(x) / 10}, time=t)
    orbit = find_orbit(kinked, {x: 0}, FORCED)
    times = [e.time / orbit.period for one in orbit.runs() for e in one.events if e.kind == "crossing"]
    assert times
    for at in times:
        # The growth up to there is as much as one segment has: there a new one would begin.
        shooting = Shooting(orbit.map, ((at + 1e-9,),))
        X = np.append(orbit.x, orbit.map.over(orbit.x, (at + 1e-9) * orbit.period).x[0, -1])
        cuts, *_ = cut(shooting, X, shooting.image(X, ()))
        assert cuts[0] and min(abs(place - other) for place in cuts[0] for other in times) > 2.9e-3
