"""Branches of periodic orbits: bifurcations at parameters that are known exactly.

Guards: analysis/continuation/.
"""

import math

import numpy as np
import pytest
import sympy as sp
from friction_oscillator import coulomb, hidden, v, y, z
from friction_oscillator import omega as FREQUENCY

from pwsmooth import Event, Return, Strobe, System
from pwsmooth.analysis.continuation import Steps, branch_off, follow
from pwsmooth.analysis.continuation.problem import only_way
from pwsmooth.analysis.maps.sections import Section, Stroboscopic
from pwsmooth.analysis.orbits.finding import find_orbit, refine
from pwsmooth.analysis.orbits.fixed_points import TOLERANCE

t, x, u = sp.symbols("t x u", real=True)
a, b = sp.symbols("a b", real=True)
omega, F = sp.symbols("omega F", positive=True)
# The bracket of a change of itinerary is 1e-12 of the arc, an event is decided to some 1e-13: a thousand of these.
LOCATED = 1e-10


def mapped(update, start, value, **options):
    """A System whose stroboscopic map is given: states stand still between the jumps of a clock."""
    states = list(update)
    system = System(
        {s: 0 * s for s in states}, time=t, parameters={a: value}, events=[Event(every=1, update=update)]
    )
    return find_orbit(system, start, seen=Strobe(1, phase=0.5), **options)


# ---- smooth bifurcations


def test_a_fold_is_found_and_passed():
    # x -> a + x - x^2: fixed at +-sqrt(a)
    branch = follow(mapped({x: a + x - x**2}, {x: 0.9}, 0.8), {a: -0.2})
    assert [bif.kind for bif in branch.specials] == ["fold"]
    # The zero of the tangent's slope, sqrt(a) steep, is found to 1e-12: a to its square.
    assert branch.specials[0].parameter == pytest.approx(0, abs=LOCATED)
    assert branch.x[0, 0] > 0 > branch.x[0, -1]
    assert branch.values[-1] == 0.8 and "reached" in branch.end


@pytest.mark.parametrize("bound", [{"max_steps": 1}, {"max_steps": 30}, {"max_seconds": 1e-9}])
def test_a_branch_is_bounded_as_a_whole_and_goes_on_from_where_it_was_left(bound):
    orbit = mapped({x: a + x - x**2}, {x: 0.9}, 0.8)
    part = follow(orbit, {a: 0.2}, **bound)
    assert list(bound)[0] in part.end and part.values[-1] > 0.2
    rest = follow(part.points[-1], {a: 0.2})
    assert "reached" in rest.end and rest.x[0, -1] == pytest.approx(math.sqrt(0.2), abs=1e-12)
    with pytest.raises((ValueError, TypeError), match=f"`{list(bound)[0]}`"):
        follow(orbit, {a: 0.2}, **dict.fromkeys(bound, 0))


def test_a_flip_is_found_and_its_branch_is_the_two_cycle():
    branch = follow(mapped({x: a * x * (1 - x)}, {x: 0.6}, 2.8), {"a": 3.3})
    (flip,) = branch.specials
    assert flip.kind == "flip"
    assert flip.parameter == pytest.approx(3, abs=1e-9)
    assert not branch.stable[-1] and branch.stable[0]
    cycle = branch_off(flip, 0.02)
    c = cycle.system.parameters[a]
    assert cycle.success and cycle.stable and c > 3
    assert min(abs(cycle.x[0] - (c + 1 + s * math.sqrt((c - 3) * (c + 1))) / (2 * c)) for s in (1, -1)) < 1e-9
    assert cycle.multipliers == pytest.approx([4 + 2 * c - c**2], abs=1e-8)


def test_the_symmetry_breaks_where_the_half_period_map_has_minus_one():
    # half a period: x -> a x - x^3, so N = -(a x - x^3): -1 at x = 0, a = 1
    system = System(
        {x: 0 * x},
        time=t,
        parameters={a: 0.7},
        events=[Event(every=sp.Rational(1, 2), update={x: a * x - x**3})],
    )
    orbit = find_orbit(system, {x: 0.0}, seen=Strobe(1, phase=0.25, symmetry={x: -x}))
    branch = follow(orbit, {a: 1.5})
    (broken,) = branch.specials
    assert broken.kind == "symmetry breaking"
    assert broken.parameter == pytest.approx(1, abs=1e-9)
    pair = branch_off(broken, 0.1)
    assert pair.success and not pair.symmetric
    # x = a x - x^3
    assert pair.x[0] ** 2 == pytest.approx(pair.system.parameters[a] - 1, abs=1e-9)
    image = branch_off(broken, -0.1)
    assert image.success and image.x[0] == pytest.approx(-pair.x[0], abs=1e-9)
    with pytest.raises(ValueError, match="`amplitude` is 0; give a number other than 0"):
        branch_off(broken, 0)


@pytest.mark.parametrize("sign", [1, -1])
def test_two_multipliers_that_leave_the_unit_circle_at_once_are_noticed(sign):
    # Two maps that know nothing of each other: no test function changes its sign.
    update = {s: sign * (1 + a) * s - s**3 for s in (x, u)}
    (found,) = follow(mapped(update, {x: 0, u: 0}, -0.5), {a: 0.3}).specials
    assert found.kind == ("branch point" if sign > 0 else "flip") and abs(found.parameter) <= found.uncertainty


def test_an_orbit_given_by_twice_the_forcings_period_ends_at_its_flip():
    update = {x: a * x * (1 - x)}
    system = System({x: 0 * x}, time=t, parameters={a: 3.2}, events=[Event(every=1, update=update)])
    orbit = find_orbit(system, {x: 0.51}, seen=Strobe(2, phase=0.25), transient=200)
    branch = follow(orbit, {a: 2.8})
    assert orbit.period == 2 and "shrink onto one of 1" in branch.end
    assert branch.specials[-1].parameter == pytest.approx(3, abs=1e-9)


def test_a_torus_begins_where_a_complex_pair_leaves_the_unit_circle():
    c, s = sp.Rational(3, 5), sp.Rational(4, 5)
    orbit = mapped({x: a * (c * x - s * u), u: a * (s * x + c * u) - u**3}, {x: 0, u: 0}, 0.8)
    branch = follow(orbit, {a: 1.3})
    assert [bif.kind for bif in branch.specials] == ["torus"]
    assert branch.specials[0].parameter == pytest.approx(1, abs=1e-9)


def test_a_branch_point_is_no_fold():
    # x -> x + a x - x^3: a pitchfork at a = 0, without a symmetry that the map is told of
    branch = follow(mapped({x: x + a * x - x**3}, {x: 0.0}, -0.5), {a: 0.5})
    assert [bif.kind for bif in branch.specials] == ["branch point"]
    assert branch.specials[0].parameter == pytest.approx(0, abs=1e-9)


def test_the_old_orbit_is_no_orbit_of_the_branch_that_begins_at_it():
    (flip,) = follow(mapped({x: a * x * (1 - x)}, {x: 0.6}, 2.8), {a: 3.3}).specials
    # Two-cycles have x <= 1: from beyond Newton's method comes to fixed points, which the doubled map has too.
    for amplitude in (0.45, 1, -0.6):
        lost = branch_off(flip, amplitude)
        assert not lost.success and "another `amplitude`" in lost.message, lost
    assert branch_off(flip, 0.02).success


@pytest.mark.parametrize("longest", [0.01, 0.1, 0.5])
def test_a_doubled_orbit_shrinks_onto_the_single_one_at_its_flip_and_the_branch_ends(longest):
    # Two-cycles of the logistic map live above 3, its four-cycles above 1 + sqrt 6.
    for begin, count, where in ((3.2, 2, 3), (3.5, 4, 1 + math.sqrt(6))):
        cycle = mapped({x: a * x * (1 - x)}, {x: 0.5}, begin, transient=400)
        assert cycle.map.count == count
        branch = follow(cycle, {a: 2.5}, steps=Steps(first=longest, longest=longest))
        (flip,) = branch.specials
        assert flip.kind == "flip" and flip.point.map.count == count // 2
        assert flip.parameter == pytest.approx(where, abs=1e-9)
        assert f"of {count} applications of the map shrink onto one of {count // 2}" in branch.end
        # The orbits of the branch are all true ones of that period.
        c = branch.values
        assert np.all(c > where)
        if count == 2:
            pair = [(c + 1 + s * np.sqrt((c - 3) * (c + 1))) / (2 * c) for s in (1, -1)]
            # An orbit is known to the tolerance of its return over the distance of its multiplier from 1.
            off = np.min(np.abs(branch.x[0] - pair), axis=0) * np.abs(1 - (4 + 2 * c - c**2))
            assert off.max() < 10 * TOLERANCE


def test_the_buck_converters_doubled_orbit_ends_at_its_flip():
    # Fossas & Olivar, IEEE Trans. CAS I 43 (1996): parameters. The flip by matrix exponentials, saltation matrix and
    # scipy's brentq: 24.51657282856.
    i, ramp, E = sp.symbols("i ramp E", real=True)
    L, C, R, T = sp.Rational(1, 50), sp.Rational(47, 10**6), 22, sp.Rational(4, 10**4)
    low, high = sp.Rational(19, 5), sp.Rational(41, 5)
    control = sp.Rational(42, 5) * (x - sp.Rational(113, 10))
    buck = System(
        {x: i / C - x / (R * C), i: (E * sp.Heaviside(ramp - control) - x) / L, ramp: (high - low) / T},
        time=t, parameters={E: 26.0}, events=[Event(every=T, update={ramp: low})],
    )  # fmt: skip
    orbit = find_orbit(buck, {x: 12.3, i: 0.6, ramp: 4}, seen=Strobe(T, phase=0.31), transient=1000)
    assert orbit.map.count == 2
    branch = follow(orbit, {E: 24.0})
    (flip,) = branch.specials
    assert flip.kind == "flip" and flip.parameter == pytest.approx(24.51657282856, abs=1e-8)
    assert flip.point.period == pytest.approx(4e-4) and branch.values.min() > flip.parameter


def test_a_period_that_does_not_follow_its_parameter_is_noticed():
    forced = System({x: u, u: sp.cos(omega * t) - x - u / 5}, time=t, parameters={omega: 1})
    fixed = follow(find_orbit(forced, {x: 0, u: 5}, seen=Strobe(2 * sp.pi)), {omega: 2})
    assert len(fixed.points) == 1 and "reads the time in another way" in fixed.end
    moving = follow(find_orbit(forced, {x: 0, u: 5}, seen=Strobe(2 * sp.pi / omega)), {omega: 2})
    w = moving.values
    assert moving.x[0] == pytest.approx((1 - w**2) / ((1 - w**2) ** 2 + w**2 / 25), abs=1e-9)


def test_an_isle_closes():
    # x -> x + (1/4 - a^2 - x^2)/2: fixed points on a circle
    branch = follow(mapped({x: x + (sp.Rational(1, 4) - a**2 - x**2) / 2}, {x: 0.5}, 0.0), {a: (-1, 1)})
    assert branch.ends == ("it closes.",) and np.abs(np.hypot(branch.values, branch.x[0]) - 0.5).max() < LOCATED
    assert sorted(fold.parameter for fold in branch.of_kind("fold")) == pytest.approx([-0.5, 0.5], abs=LOCATED)


# ---- tests of one's own


def test_zeros_of_one_s_own_tests_are_special_points_in_their_order():
    # x -> a x (1 - x): a multiplier 2 - a, and a flip at 3
    tests = {"half": lambda orbit: orbit.multipliers[0].real + 0.5, "never": lambda orbit: 1.0}
    branch = follow(mapped({x: a * x * (1 - x)}, {x: 0.6}, 2.3), {a: 3.3}, tests=tests)
    assert [special.kind for special in branch.specials] == ["half", "flip"]
    assert branch.specials[0].parameter == pytest.approx(2.5, abs=LOCATED)
    assert branch.tests["half"] == pytest.approx(2.5 - branch.values, abs=1e-8) and set(branch.tests) == {
        *tests
    }
    assert follow(branch.specials[0].point, {a: 2.6}).end == "reached a = 2.6."


def test_along_a_curve_they_are_located_too():
    # 4 a = (1 + b)(3 - b), x = (1 + b)/2
    step = Event(every=1, update={x: a - x**2 + b * x})
    system = System({x: 0 * x}, time=t, parameters={a: 0.5, b: 0}, events=[step])
    (flip,) = follow(find_orbit(system, {x: 0.3}, seen=Strobe(1, phase=0.5)), {a: 1}).of_kind("flip")
    (found,) = follow(
        flip, {a: (-1, 2), b: (-1, 1)}, tests={"x = 0.6": lambda orbit: orbit.x[0] - 0.6}
    ).specials
    assert found.kind == "x = 0.6" and list(found.values.values()) == pytest.approx([0.84, 0.2], abs=1e-9)


def test_a_test_that_jumps_has_no_zero_and_one_without_a_number_is_refused():
    start = mapped({x: a * x * (1 - x)}, {x: 0.6}, 2.3)
    jumps = follow(
        start, {a: 2.9}, tests={"jump": lambda orbit: math.copysign(1, orbit.system.parameters[a] - 2.6)}
    )
    assert jumps.specials == []
    with pytest.raises(
        TypeError, match="`tests` of 'words' gave 'no number'; give a function that returns a number"
    ):
        follow(start, {a: 2.9}, tests={"words": lambda orbit: "no number"})
    with pytest.raises(TypeError, match="`tests` has 'x'"):
        follow(start, {a: 2.9}, tests={"x": 1})


# ---- changes of itinerary


@pytest.mark.parametrize("frequency", [0.55, 0.7, 0.9, 1.5, 2.0, 3.1])
def test_den_hartogs_oscillator_begins_to_stick_by_crossing_sliding(frequency):
    V, U = 1 / (1 - frequency**2), math.tan(math.pi / (2 * frequency)) / frequency
    limit = abs(V) / math.sqrt(U**2 + frequency**-4)  # den Hartog (1931)
    system = System(
        {x: u, u: sp.sin(omega * t) - x - F * sp.sign(u)},
        time=t,
        parameters={omega: frequency, F: 0.8 * limit},
    )
    orbit = find_orbit(system, {x: 1, u: 0.5}, seen=Strobe(2 * sp.pi / omega, symmetry={x: -x, u: -u}))
    branch = follow(orbit, {F: 1.1 * limit})
    (begins,) = branch.specials
    assert begins.kind == "crossing-sliding"
    assert begins.parameter == pytest.approx(limit, abs=LOCATED)
    assert [kind for _, kind, _ in begins.beyond.word] == ["stick", "slip by tangency"]


def held_from_below(force, parameters):
    """x' = force(t) - x above x = 0, and up from below: x slides while the force is negative."""
    return System({x: sp.Piecewise((force - x, x > 0), (5, True))}, time=t, parameters=parameters)


def test_grazing_sliding_at_the_exact_amplitude():
    # Above the surface x = 1 + (a/sqrt 2) sin(t - pi/4), which touches 0 at a = sqrt 2 with x' = 0.
    system = held_from_below(1 + a * sp.sin(t), {a: 1.1})
    orbit = find_orbit(system, {x: 0.5}, seen=Strobe(2 * sp.pi))
    branch = follow(orbit, {a: 2.0})
    (grazing,) = branch.specials
    assert grazing.kind == "grazing-sliding"
    assert grazing.parameter == pytest.approx(math.sqrt(2), abs=LOCATED)
    # The smooth orbit has the multiplier exp(-2 pi), the one that slides has none left.
    assert grazing.point.multipliers == pytest.approx([math.exp(-2 * math.pi)], abs=1e-12)
    assert grazing.beyond.multipliers == pytest.approx([0], abs=1e-15)


@pytest.mark.parametrize("push", [20, 400])
def test_a_corner_is_located_where_both_sides_meet(push):
    # What u gains in the slide makes x lower in the next: with this push the orbits that slide lie before sqrt(2) too.
    system = System(
        {
            x: sp.Piecewise((1 + a * sp.sin(t) - x - u, x > 0), (5, True)),
            u: sp.Piecewise((-u / 10, x > 0), (push - u / 10, True)),
        },
        time=t,
        parameters={a: 1.1},
    )
    branch = follow(find_orbit(system, {x: 0.5, u: 0}, seen=Strobe(2 * sp.pi)), {a: 2.0})
    (corner,) = branch.specials
    assert corner.kind == "grazing-sliding" and branch.values[-1] == 1.1 and branch.values.max() < 1.42
    assert corner.parameter == pytest.approx(math.sqrt(2), abs=LOCATED)
    assert corner.uncertainty < 1e-9 and abs(corner.beyond.multipliers[1]) < 1e-12


def test_adding_sliding_at_the_exact_force():
    # cos t + a cos 2t has a maximum at t = pi, inside the stick, which is a - 1.
    system = held_from_below(sp.cos(t) + a * sp.cos(2 * t), {a: 0.8})
    orbit = find_orbit(system, {x: 0.5}, seen=Strobe(2 * sp.pi))
    (adding,) = follow(orbit, {a: 1.2}).specials
    assert adding.kind == "adding-sliding"
    assert adding.parameter == pytest.approx(1, abs=LOCATED)


def test_switching_sliding_at_the_exact_phase():
    # Put to x = 1 at t = 2 pi k it lands one unit later, while the field below turns upwards at phase a.
    system = System(
        {x: sp.Piecewise((-1, x > 0), (sp.sin(t - a), True))}, time=t, parameters={a: 0.7},
        events=[Event(every=2 * sp.pi, update={x: 1})],
    )  # fmt: skip
    orbit = find_orbit(system, {x: 0.6}, seen=Strobe(2 * sp.pi, phase=0.5 / 2 / math.pi))
    (switching,) = follow(orbit, {a: 1.3}).specials
    assert switching.kind == "switching-sliding"
    assert switching.parameter == pytest.approx(1, abs=LOCATED)


def test_a_grazing_impact_is_named():
    from pwsmooth import Unilateral

    # x'' + x'/5 + x = cos 2t reaches 1/|1 - 4 + 0.4 i|; the wall stands at a.
    wall = Unilateral(a - x, restitution=0.8, name="R")
    system = System(
        {x: u, u: sp.cos(2 * t) - x - sp.Rational(1, 5) * u - wall.reaction}, time=t, parameters={a: 0.5}
    )
    reach = 1 / abs(1 - 4 + 0.4j)
    orbit = find_orbit(system, {x: 0.1, u: 0.0}, seen=Strobe(sp.pi, phase=0.1))
    branch = follow(orbit, {a: 0.9 * reach}, steps=Steps(max_points=60))
    first = branch.specials[0]
    assert first.kind == "grazing impact"
    assert first.parameter == pytest.approx(reach, abs=LOCATED)


@pytest.mark.parametrize("coupling", [0, sp.Rational(1, 5)])
def test_a_change_of_order_is_a_bifurcation_only_between_events_that_know_of_each_other(coupling):
    # Exchanging x and u is a change of the sign of a: at a = 0 both cross at once.
    pair = System(
        {x: sp.cos(t) - x + coupling * sp.sign(u), u: sp.cos(t - a) - u + coupling * sp.sign(x)},
        time=t, parameters={a: -0.3},
    )  # fmt: skip
    kinks = System(
        {x: sp.cos(t) - x + sp.Abs(x) / 3, u: sp.cos(t - a) - u + sp.Abs(u) / 3}, time=t, parameters={a: -0.3}
    )
    system = pair if coupling else kinks
    orbit = find_orbit(system, {x: 0, u: 0}, seen=Strobe(2 * sp.pi), transient=20)
    found = follow(orbit, {a: 0.5}).specials
    if not coupling:
        assert not found
        return
    order = found[0]
    assert order.kind == "change of order" and order.parameter == pytest.approx(0, abs=LOCATED)
    assert {letter.switch for letter in order.change.before} == {"sgn(x)", "sgn(u)"}
    assert [letter.switch for letter in order.change.before] == [
        letter.switch for letter in order.change.after
    ][::-1]


# ---- how branches end


def test_a_family_of_orbits_is_no_branch():
    free = System({x: u, u: a * sp.cos(2 * t) - x}, time=t, parameters={a: 1})
    branch = follow(find_orbit(free, {x: 0.4, u: 0}, seen=Strobe(2 * sp.pi)), {a: 2})
    assert len(branch.points) == 1 and "not isolated" in branch.end


def test_a_branch_ends_where_the_map_jumps_and_says_so():
    # Two-stage limit: the slip-only orbit is captured, with the whole stick, once |F| at its crossing falls to N.
    # The same |F| = N is where the oscillator without the hidden term begins to stick, continuously.
    mirror = {y: -y, v: -v}
    free = find_orbit(coulomb(), {y: 0.5, v: 0.3}, seen=Strobe(2 * sp.pi, symmetry=mirror))
    continuous = follow(free, {"sigma": 2.0}).of_kind("crossing-sliding")[0]
    sudden = refine(Stroboscopic(hidden().layered({z: 0}), 2 * sp.pi, symmetry=mirror), free.x)
    branch = follow(sudden, {"sigma": 2.0})
    assert "jumps" in branch.end
    assert branch.values[-1] == pytest.approx(continuous.parameter, abs=1e-5)  # ends within its shortest steps
    assert all([kind for _, kind, _ in orbit.word] == ["crossing"] for orbit in branch.points)


def test_a_step_does_not_lead_to_another_part_of_the_branch():
    # Static friction with a memory: from here to a larger frequency the branch turns at 0.9723, and comes back below
    # itself. A step along its tangent of 0.1 has a solution there, and both tangents point the same way.
    orbit = find_orbit(
        hidden(omega=0.752542372881356, sigma=4),
        {y: -1, v: 1, z: 0},
        seen=Strobe(2 * sp.pi / FREQUENCY),
        transient=200,
    )
    branch = follow(orbit, {"omega": (0.4, 3)}, way=1, steps=Steps(first=0.005, max_points=40))
    kinds = [one.kind for one in branch.specials]
    assert kinds[:2] == ["switching-sliding", "fold"]
    # Until it turns, the orbits of this branch attract: so trajectories find them, and none beyond.
    turn = branch.specials[1].parameter
    for frequency, found in ((turn - 1e-4, True), (turn + 1e-4, False)):
        start = dict(zip("yvz", branch.points[branch.places[1] - 1].x))
        there = find_orbit(
            hidden(omega=frequency, sigma=4), start,
            seen=Strobe(2 * sp.pi / FREQUENCY, phase=branch.points[branch.places[1] - 1].map.phase), transient=400,
            count=1,
        )  # fmt: skip
        assert (not _is_symmetric(there)) == found


def _is_symmetric(orbit):
    """Whether an orbit of the friction oscillator is its own mirror image half a period later."""
    half = orbit.map.over(orbit.x, orbit.period / 2).x[:2, -1]
    return bool(np.abs(half + orbit.x[:2]).max() < 1e-4)


def test_a_step_that_jumps_to_another_branch_is_shortened():
    # Slaved, over rho at sigma = 4.3, around the fold at 3.4279: a step led from the asymmetric orbit to another, and
    # the change between them was looked for where neither is.
    orbit = find_orbit(
        hidden(rho=4.06779661, sigma=4.3).layered({z: sp.oo}),
        {y: 0.5, v: 0.3},
        seen=Strobe(2 * sp.pi),
        transient=400,
    )
    branch = follow(orbit, {"rho": (0, 5)}, way=-1, steps=Steps(first=0.005, longest=0.1, max_points=30))
    assert branch.specials[0].kind == "fold"
    assert all(one.kind != "jump of the orbit" and 0 <= one.parameter <= 5 for one in branch.specials)


def test_slips_that_grow_as_a_square_root_are_no_jump():
    # Coulomb friction and a little more: below sigma = 1 the block rests, and beyond it slips for 4.2 sqrt(sigma - 1).
    orbit = find_orbit(
        hidden(rho=0.25, sigma=1.4).layered({z: sp.oo}), {y: 0.5, v: 0.3},
        seen=Strobe(2 * sp.pi, symmetry={y: -y, v: -v}), transient=50,
    )  # fmt: skip
    (last,) = follow(orbit, {"sigma": (0.5, 5.2)}, way=-1, steps=Steps(first=0.005, longest=0.1)).specials
    assert last.kind == "adding-sliding" and last.parameter == pytest.approx(1, abs=1e-8)


def test_an_unstable_orbit_that_is_a_rounding_off_after_two_periods_repeats():
    # Beside the end of its branch what a period is off by grows by 1e4 in the next one: that is no other period.
    orbit = find_orbit(
        hidden(rho=1.2, sigma=2).layered({z: sp.oo}), {y: 0.78, v: -1.03},
        seen=Strobe(2 * sp.pi, symmetry={y: -y, v: -v}), transient=50,
    )  # fmt: skip
    branch = follow(orbit, {"sigma": 0.5})
    assert branch.end.startswith("adding-sliding")
    assert np.abs(branch.points[-1].map_multipliers).max() > 1e4


@pytest.mark.parametrize("across", [False, True])
def test_the_way_on_is_the_null_vector(across):
    rng = np.random.default_rng(7)
    for n in (2, 30, 93):
        DF = rng.normal(size=(n, n + 1))
        exact = np.linalg.svd(DF)[2][-1]
        direction = rng.normal(size=n + 1)
        if across:
            direction -= (direction @ exact) * exact
        found, alone = only_way(DF, direction, 1e-8)
        assert alone and abs(abs(found @ exact) - 1) < 1e-12
        assert across or found @ direction > 0
    assert not only_way(np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.array([0.0, 1.0, 0.0]), 1e-8)[1]


def test_a_branch_goes_on_when_its_section_comes_to_lie_in_a_stick():
    # rho = 0: sticks grow with falling drive and pass over t = 0; at a drive below N everything is at rest.
    orbit = find_orbit(coulomb(sigma=2.2), {y: 0.5, v: 0.3}, seen=Strobe(2 * sp.pi, phase=0.31), transient=20)
    branch = follow(orbit, {"sigma": 1.2})
    assert {"jump of the orbit", "change of itinerary"}.isdisjoint(bif.kind for bif in branch.specials)
    assert branch.values[-1] == 1.2
    phases = [o.map.phase for o in branch.points]
    assert len(set(phases)) > 1


def test_a_branch_goes_on_when_a_stick_comes_to_end_on_its_section():
    # At sigma = 1.19 the stick ends where the period does: from v = -1e-17 there the map begins in slip, the motion
    # that goes on does not, and what the map repeats is no orbit.
    orbit = find_orbit(
        hidden(rho=0.9243369560655162, sigma=2.6968907901978216).layered({z: sp.oo}), {y: 0.5, v: 0.3},
        seen=Strobe(2 * sp.pi), transient=100,
    )  # fmt: skip
    branch = follow(orbit, {"sigma": 0.5})
    assert branch.values.min() < 1.1


def test_an_autonomous_orbit_is_followed_on_its_section():
    # x'' - 2 a x' + x = -sign x': fixed at X = (E + 1)/(E - 1), E = exp(a pi/sqrt(1 - a^2))
    relay = System({x: u, u: 2 * a * u - x - sp.sign(u)}, parameters={a: 0.1})
    orbit = find_orbit(relay, {x: 6.3, u: 0.1}, seen=Return(u, direction=-1))
    branch = follow(orbit, {a: 0.25})
    E = np.exp(branch.values * np.pi / np.sqrt(1 - branch.values**2))
    assert branch.x[0] == pytest.approx((E + 1) / (E - 1), rel=1e-9)
    assert isinstance(branch.points[-1].map, Section)


def test_bad_input_is_refused():
    orbit = find_orbit(coulomb(), {y: 0.5, v: 0.3}, seen=Strobe(2 * sp.pi))
    with pytest.raises(ValueError, match="already is"):
        follow(orbit, {"sigma": 2.4})
    with pytest.raises(ValueError, match="'nonsense'"):
        follow(orbit, {"nonsense": 2.5})
    with pytest.raises(TypeError, match="give an orbit or an equilibrium"):
        follow({y: 1}, {"sigma": 2.5})
    with pytest.raises(ValueError, match="did not converge"):
        follow(refine(Stroboscopic(System({x: 1 + x**2}), 4.0), {x: 0}), {"sigma": 2})


def test_a_branch_goes_on_where_one_piece_is_too_long_to_be_shot_over():
    # x' = a x + cos t has the orbit (sin t - a cos t)/(1 + a^2) for every a; its multiplier is exp(2 pi a).
    t, x, a = sp.symbols("t x a", real=True)
    system = System({x: a * x + sp.cos(t)}, time=t, parameters={a: 1})
    branch = follow(
        find_orbit(system, {x: -0.5}, seen=Strobe(2 * sp.pi)), {a: 6}, steps=Steps(first=0.1, longest=0.3)
    )
    q = branch.values
    assert q[-1] == 6 and branch.x[0] == pytest.approx(-q / (1 + q**2), abs=10 * TOLERANCE)
    largest = [orbit.multipliers[0].real for orbit in branch.points]
    assert largest == pytest.approx(np.exp(2 * math.pi * q), rel=1e-10)  # to 2e16, each segment to some 1e-13


def test_a_branch_over_the_frequency_does_not_depend_on_where_its_section_stands():
    """Backlash: the section moves on the way, by the period at that parameter and not by the first one's."""
    w = sp.Symbol("w", real=True)
    teeth = sp.Piecewise((x - 1, x > 1), (x + 1, x < -1), (0, True))
    gears = System({x: w, w: 0.1 + 0.05 * sp.cos(omega * t) - 0.1 * w - teeth}, time=t, parameters={omega: 1.5})
    found = []
    for phase, longest in ((0.25, 0.1), (0.75, 0.1), (0, 0.03)):
        orbit = find_orbit(gears, {x: 1.1, w: 0}, seen=Strobe(2 * sp.pi / omega, phase=phase), transient=100)
        branch = follow(orbit, {omega: 0.4}, steps=Steps(longest=longest))
        found.append([(bif.kind, bif.parameter) for bif in branch.specials])
    assert len(found[0]) == 4
    for other in found[1:]:
        assert [kind for kind, _ in other] == [kind for kind, _ in found[0]]
        assert np.allclose([at for _, at in other], [at for _, at in found[0]], atol=1e-6)
