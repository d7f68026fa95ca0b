"""Periodic orbits and their multipliers against closed forms and differences of the Poincare map.

Guards: analysis/orbits/, analysis/maps/.
"""

import math

import numpy as np
import pytest
import sympy as sp
from friction_oscillator import coulomb, hidden, k, sigma, v, y, z

from pwsmooth import Return, Strobe, Switch, System
from pwsmooth.analysis.maps.sections import Section, Stroboscopic
from pwsmooth.analysis.orbits.finding import find_orbit, refine

T = 2 * sp.pi
MIRROR = {y: -y, v: -v}
STEP, DIFFERENCE = 1e-5, 1e-6  # see test_variations.py

t, x, u = sp.symbols("t x u", real=True)
omega, F = sp.symbols("omega F", positive=True)


def den_hartog(frequency, friction):
    """x'' + x = sin(omega t) - F sign(x')."""
    system = System(
        {x: u, u: sp.sin(omega * t) - x - F * sp.sign(u)},
        time=t,
        parameters={omega: frequency, F: friction},
    )
    return find_orbit(system, {x: 1, u: 0.5}, seen=Strobe(2 * sp.pi / omega, symmetry={x: -x, u: -u}))


def constants(frequency):
    """V, U and the friction at which sticking begins (den Hartog, Trans. ASME 53 (1931) APM-107)."""
    V = 1 / (1 - frequency**2)
    U = math.tan(math.pi / (2 * frequency)) / frequency
    return V, U, abs(V) / math.sqrt(U**2 + frequency**-4)


@pytest.mark.parametrize("frequency", [0.55, 0.7, 0.9, 1.2, 1.5, 2.0, 3.1])
@pytest.mark.parametrize("part", [0.2, 0.9])
def test_den_hartogs_amplitude(frequency, part):
    V, U, limit = constants(frequency)
    orbit = den_hartog(frequency, part * limit)
    assert orbit.success
    assert [kind for _, kind, _ in orbit.word] == ["crossing"]
    turning = orbit.solution().x[0][np.abs(orbit.solution().x[1]) == 0]
    assert np.abs(turning) == pytest.approx(math.sqrt(V**2 - (part * limit * U) ** 2), abs=1e-9)


@pytest.mark.parametrize("frequency", [0.55, 0.7, 1.2, 2.0])
def test_den_hartogs_multipliers_have_the_product_of_the_jumps_in_the_field(frequency):
    # Undamped and linear between crossings, so the determinant of D P is that of the saltation matrices: at each
    # crossing the acceleration after over that before, (f - F)/(f + F) with f = sin - x at the turning point.
    *_, limit = constants(frequency)
    friction = 0.6 * limit
    orbit = den_hartog(frequency, friction)
    run = orbit.solution(rtol=1e-12)
    crossing = run.events[0].time
    pull = abs(math.sin(frequency * crossing) - run.x[0, np.flatnonzero(run.t == crossing)[0]])
    ratio = (pull - friction) / (pull + friction)
    assert np.prod(orbit.multipliers).real == pytest.approx(ratio**2, rel=1e-8)


def differences_of(P, at):
    return np.array([(P(at + STEP * e) - P(at - STEP * e)) / (2 * STEP) for e in np.eye(len(at))]).T


@pytest.mark.parametrize(
    ("system", "start"),
    [
        (coulomb(), {y: 0.5, v: 0.3}),
        (hidden(), {y: 0.6, v: -1.07, z: 0}),
        (hidden().layered({z: sp.oo}), {y: 0.78, v: -1.03}),
        (hidden().smoothed(eps=0.1), {y: 0.5, v: 0.3, z: 0}),
    ],
    ids=["crossings", "relaxing", "slaved", "smoothed"],
)
def test_multipliers_are_those_of_differences_of_the_map(system, start):
    orbit = find_orbit(system, start, seen=Strobe(T), transient=30)
    assert orbit.success and orbit.stable
    numeric = np.linalg.eigvals(differences_of(orbit.map, orbit.x))
    assert np.sort(np.abs(orbit.multipliers)) == pytest.approx(np.sort(np.abs(numeric)), abs=DIFFERENCE)


def test_the_orbit_is_the_published_one_and_lies_on_its_solution():
    orbit = find_orbit(hidden().layered({z: sp.oo}), {y: 0.78, v: -1.03}, seen=Strobe(T, symmetry=MIRROR))
    run = orbit.solution(rtol=1e-12)
    sticks = [s for s in run.segments if s.status == (0,)]
    # spec/solid_friction.md section 4, nine decimals
    assert [s.duration for s in sticks] == pytest.approx([0.539389027] * 2, abs=0.5e-9)
    assert [s.start for s in sticks] == pytest.approx([1.755610496, 4.897203149], abs=0.5e-9)
    assert run.x[:, -1] == pytest.approx(orbit.x, abs=1e-10)


def test_the_half_period_map_squared_is_the_map_of_the_whole_period():
    half = find_orbit(coulomb(), {y: 0.5, v: 0.3}, seen=Strobe(T, symmetry=MIRROR))
    whole = find_orbit(coulomb(), half.x0, seen=Strobe(T))
    assert half.symmetric and not whole.symmetric
    assert whole.x == pytest.approx(half.x, abs=1e-11)
    assert whole.jacobian == pytest.approx(half.jacobian @ half.jacobian, abs=1e-11)
    assert np.sort(np.abs(half.multipliers)) == pytest.approx(np.sort(np.abs(whole.multipliers)), abs=1e-11)


def test_an_unstable_orbit_is_found_that_no_transient_reaches():
    # sigma = 2.5 > 2.45: the symmetric orbit has lost its stability to the asymmetric pair.
    system = hidden(sigma=2.5).smoothed(eps=0.1)
    symmetric = find_orbit(system, {y: 0.91, v: -1.05, z: 0.015}, seen=Strobe(T, symmetry=MIRROR))
    attractor = find_orbit(system, symmetric.x + 0.01, seen=Strobe(T), transient=100)
    assert symmetric.success and not symmetric.stable
    assert attractor.success and attractor.stable
    assert np.abs(attractor.x - symmetric.x).max() > 0.01


def relay(delta):
    """x'' - 2 delta x' + x = -sign(x' ): an unstable spiral held by a relay; closed form in the test."""
    a = sp.Symbol("a", positive=True)
    return System({x: u, u: 2 * a * u - x - sp.sign(u)}, parameters={a: delta})


def test_an_autonomous_orbit_is_a_fixed_point_of_the_return_map():
    # Half a turn from x = -X at rest is one about x = -1: to -1 + (X - 1)*E with E = exp(delta pi/w) and
    # w = sqrt(1 - delta^2). So X -> (X - 1)*E - 1, twice a turn; fixed at X = (E + 1)/(E - 1).
    delta = 0.1
    E = math.exp(delta * math.pi / math.sqrt(1 - delta**2))
    orbit = find_orbit(relay(delta), {x: -15.0, u: 1.0}, seen=Return(u, direction=-1))
    assert orbit.success and not orbit.stable
    assert orbit.x[0] == pytest.approx((E + 1) / (E - 1), rel=1e-10)
    assert orbit.multipliers == pytest.approx([E**2], rel=1e-9)
    assert orbit.period == pytest.approx(2 * math.pi / math.sqrt(1 - delta**2), rel=1e-11)


@pytest.mark.parametrize("off", [2.0**-54, 2.0**-80, -(2.0**-54), 0.0])
def test_a_return_map_goes_on_from_a_rounding_off_its_section(off):
    # Van der Pol's oscillator, amplitude and period by SciPy's DOP853 at rtol 1e-12: 2.00861986, 6.66328686.
    P = Section(System({x: u, u: (1 - x**2) * u - x}), surface=u, direction=-1)
    image = P.image(np.array([2.00861986, off]))
    assert image.x[0] == pytest.approx(2.00861986, abs=1e-8)
    assert image.time == pytest.approx(6.66328686, abs=1e-7)


def belt_pull(slip, drop=3):
    """Of a belt on a body: dry friction that falls with the slip velocity."""
    return sp.sign(slip) * (sp.Rational(1, 10) + 1 / (1 + drop * sp.Abs(slip)) + slip**2 / 10)


def test_one_orbit_has_one_period_and_multipliers_on_every_section_also_within_its_stick():
    block = System({x: u, u: -x + belt_pull(sp.Rational(1, 10) - u)})
    orbits = [
        find_orbit(block, {x: 1, u: 0}, seen=Return(section, direction=way), transient=20)
        # In the stick, at u = 1/10, x grows to 1.1; across it; while it slips.
        for section, way in ((x - 1, 1), (x - sp.Rational(1, 2), 1), (u, -1), (x, -1), (x, 1))
    ]
    assert all(orbit.success for orbit in orbits)
    assert orbits[0].x[1] == pytest.approx(0.1, abs=1e-12)  # it does stick there
    assert [orbit.period for orbit in orbits] == pytest.approx([orbits[0].period] * 5, rel=1e-9)
    # The stick annihilates what lies across the orbit; grazing its end costs half the digits at most.
    assert np.abs([orbit.multipliers for orbit in orbits]).max() < 1e-8


def test_popps_two_masses_have_one_orbit_on_five_sections_from_ten_starts():
    # Two masses, three springs, one belt (after Popp).
    w, q = sp.symbols("w q", real=True)
    belt, link = sp.Rational(42, 100), sp.Rational(6, 5)
    pulls = belt_pull(belt - u), sp.Rational(13, 10) * belt_pull(belt - q)
    masses = System({x: u, u: -x - link * (x - w) + pulls[0], w: q, q: -w - link * (w - x) + pulls[1]})
    sections = (x - w, 1), (u, -1), (q, 1), (w - sp.Rational(1, 2), 1), (u - q, -1)
    found = []
    for start in np.random.default_rng(0).normal(size=(10, 4)) * [1, 0.5, 1, 0.5]:
        for section, way in sections:
            orbit = find_orbit(masses, start, seen=Return(section, direction=way), transient=60)
            assert orbit.success, (section, start, orbit.message)
            found.append([orbit.period, *np.sort(np.abs(orbit.multipliers))[-2:]])
    assert np.array(found) == pytest.approx(np.tile(found[0], (len(found), 1)), abs=1e-7)


@pytest.mark.parametrize("off", [1e-16, -1e-16, 0.0])
@pytest.mark.parametrize("way", [1, -1])
def test_a_turn_that_takes_one_step_is_a_return_and_a_start_on_the_section_none(off, way):
    P = Section(System({x: u, u: -x}), surface=x - sp.Rational(1, 2), direction=way)
    image = P.image(np.array([0.5 + off, way * 0.75]))
    assert image.x == pytest.approx([0.5, way * 0.75], abs=1e-12)
    assert image.time == pytest.approx(2 * math.pi, abs=1e-12)


def test_the_word_of_several_returns_has_the_events_of_all_of_them():
    # From u = 0 falling to u = 0 rising and back: each half of the turn has one crossing of x = 0.
    block = System({x: u, u: -x - sp.sign(x) / 5 - u / 50 + sp.sign(u) / 10})
    once, twice = (Section(block, surface=x - 2 * u, count=count).image([1.0, 0.5]) for count in (1, 2))
    assert len(once.word) == 4 and len(twice.word) == 8
    assert twice.time == pytest.approx(sum(run.t[-1] for run in twice.runs))


def test_a_transient_that_fails_says_what_failed():
    from pwsmooth import Event

    damped = System({x: u, u: -x - u / 5})
    orbit = find_orbit(damped, {x: 2, u: 0}, seen=Return(x - sp.Rational(1, 2)), transient=50)
    assert not orbit.success and "does not cross the section x - 1/2 = 0 rising" in orbit.message
    assert "finished" not in orbit.message and "transient ended after" in orbit.message
    grows = System({x: x / 5 + 0 * t}, time=t, events=[Event(x - 2, terminal=True, name="wall")])
    P = Stroboscopic(grows, 1)
    orbit = find_orbit(grows, {x: 1}, seen=Strobe(1), transient=10)
    assert not orbit.success and "after 3 of 10" in orbit.message and "'wall' stopped it" in orbit.message
    # x = exp(t/5) reaches 2 at 3.47: the points after it are unknown, and not the one at which it stopped.
    assert P.iterate({x: 1}, 5)[:, 0] == pytest.approx(
        [math.exp(k / 5) for k in (1, 2, 3)] + [math.nan] * 2, nan_ok=True
    )
    assert np.isnan(P.iterate({x: 1}, 5, discard=4)).all()


@pytest.mark.parametrize("place", ["surface", "update", "when", "gap"])
def test_a_return_map_refuses_time_wherever_it_stands(place):
    from pwsmooth import Event, Unilateral

    table = Unilateral(x - sp.sin(t), restitution=0.5, name="R")
    system = {
        "surface": lambda: System({x: u, u: -x - sp.sign(u - sp.sin(t))}, time=t),
        "update": lambda: System({x: u, u: -x}, time=t, events=[Event(x, update={u: sp.cos(t)})]),
        "when": lambda: System({x: u, u: -x}, time=t, events=[Event(x, when=t > 3, update={u: 1})]),
        "gap": lambda: System({x: u, u: -1 + table.reaction}, time=t),
    }[place]()
    with pytest.raises(ValueError, match="depends on time"):
        find_orbit(system, {x: 1, u: 1}, seen=Return(u))


def test_the_derivative_of_a_return_map_by_a_parameter():
    P = Section(relay(0.1), surface=u - x / 10, direction=-1)
    at = P([10.0, 1.0])
    found = P.image(at, ("a",))
    high, low = (P.with_parameters({"a": 0.1 + s}).image(at).x for s in (STEP, -STEP))
    assert found.by_parameter[:, 0] == pytest.approx((high - low) / (2 * STEP), rel=DIFFERENCE)


@pytest.mark.parametrize("phase", [0.0, 0.3])
def test_the_derivative_of_the_stroboscopic_map_when_the_period_changes(phase):
    P = Stroboscopic(coulomb(), 2 * sp.pi / sp.Symbol("omega", nonnegative=True), phase=phase)
    at = np.array([0.6, -0.8])
    found = P.image(at, ("omega", "sigma")).by_parameter
    for j, name in enumerate(("omega", "sigma")):
        value = {"omega": 1, "sigma": 2.4}[name]
        high, low = (P.with_parameters({name: value + s}).image(at).x for s in (STEP, -STEP))
        assert found[:, j] == pytest.approx((high - low) / (2 * STEP), abs=1e-5)


def test_a_period_two_orbit_is_recognised_in_the_transient():
    c = sp.Symbol("c")
    # x jumps by the logistic map at every unit of time and stays: c = 3.2 has the two-cycle of the textbook.
    from pwsmooth import Event

    system = System(
        {x: 0 * x}, time=t, parameters={c: 3.2}, events=[Event(every=1, update={x: c * x * (1 - x)})]
    )
    orbit = find_orbit(system, {x: 0.3}, seen=Strobe(1, phase=0.5), transient=200)
    assert orbit.map.count == 2 and orbit.period == 2
    # x = (c + 1 +- sqrt((c - 3)(c + 1)))/(2 c), multiplier 4 + 2 c - c^2
    values = [(4.2 + s * math.sqrt(0.2 * 4.2)) / 6.4 for s in (1, -1)]
    assert min(abs(orbit.x[0] - value) for value in values) < 1e-11
    assert orbit.multipliers == pytest.approx([4 + 6.4 - 3.2**2], abs=1e-9)


def test_an_orbit_that_repeats_sooner_than_asked_for_is_given_with_its_own_period():
    orbit = find_orbit(coulomb(), {y: 0.5, v: 0.3}, seen=Strobe(T), count=6)
    assert orbit.success and orbit.map.count == 1 and "after 1 of the 6" in orbit.message
    assert orbit.period == pytest.approx(2 * math.pi)
    turns = Section(relay(0.1), surface=u, direction=-1, count=2)
    assert refine(turns, [6.3, 0]).period == pytest.approx(2 * math.pi / math.sqrt(1 - 0.01), rel=1e-10)


def clocked(rate, **kept):
    """x' = rate - x with a memory m that a clock changes at every unit of time."""
    from pwsmooth import Event, Memory

    m = Memory("m", 0)
    return System({x: rate(m) - x}, time=t, events=[Event(every=1, update={m: kept["to"](m)})])


@pytest.mark.parametrize(
    ("system", "period", "culprit", "remedy"),
    [
        (clocked(lambda m: t - m, to=lambda m: t), 1, "m is", "memory goes on"),
        (System({x: sp.cos(t) - x}, time=t), 3, "x is", "reads the time"),
        (System({x: sp.cos(2 * sp.pi * t) - x + t / 10**7}, time=t), 1, "x is", "reads the time"),
    ],
    ids=["ramp", "other period", "slow drift"],
)
@pytest.mark.parametrize("phase", [0.0, 0.25])
def test_what_does_not_return_after_one_more_period_is_no_orbit(system, period, culprit, remedy, phase):
    orbit = find_orbit(system, {x: 0}, seen=Strobe(period, phase=phase))
    assert not orbit.success
    assert culprit in orbit.message and remedy in orbit.message


def test_a_symmetry_that_an_event_breaks_is_no_symmetry_of_the_orbit():
    from pwsmooth import Event

    # The field has it, the kick once a period has not.
    kicked = System(
        {x: u, u: sp.cos(t) - x - u / 5},
        time=t,
        events=[Event(every=2 * sp.pi, update={u: u + sp.Rational(1, 10)})],
    )
    orbit = find_orbit(kicked, {x: 0, u: 5}, seen=Strobe(T, phase=0.2, symmetry={x: -x, u: -u}))
    assert not orbit.success
    assert find_orbit(kicked, {x: 0, u: 5}, seen=Strobe(T, phase=0.2)).success


def test_a_memory_that_repeats_does_no_harm():
    alternating = clocked(lambda m: m, to=lambda m: 1 - m)
    orbit = find_orbit(alternating, {x: 0}, seen=Strobe(2, phase=0.25))
    # m = 0 and then 1: x falls and rises by turns, x(1) = x(2)/e, x(2) = 1 - (1 - x(1))/e.
    low = (1 - math.exp(-1)) / (math.exp(1) - math.exp(-1))
    assert orbit.success
    run = orbit.solution()
    assert run.x[0].min() == pytest.approx(low, abs=1e-9)


def test_an_orbit_among_others_is_said_not_to_be_isolated():
    stuck = System({x: u, u: sp.sin(t) / 2 - x - sp.sign(u)}, time=t)
    orbit = find_orbit(stuck, {x: 0.2, u: 0}, seen=Strobe(T))
    assert orbit.success and not orbit.isolated and not orbit.stable
    assert (
        orbit.x == pytest.approx([0.2, 0]) and "not isolated" in orbit.message and "not isolated" in repr(orbit)
    )
    # x'' + x = cos 2t: every orbit of period 2 pi closes.
    free = find_orbit(System({x: u, u: sp.cos(2 * t) - x}, time=t), {x: 0.4, u: 0}, seen=Strobe(T))
    assert free.success and not free.isolated and "not isolated" in free.message
    centre = find_orbit(System({x: u, u: sp.cos(t) - 2 * x}, time=t), {x: 0.4, u: 0}, seen=Strobe(T))
    assert centre.isolated and not centre.stable and "neutral" in repr(centre)
    assert den_hartog(2.0, 0.1).isolated


def test_what_is_not_found_is_said_and_raises_nothing():
    blows_up = System({x: 1 + x**2})
    orbit = refine(Stroboscopic(blows_up, 4.0), {x: 0})
    assert not orbit.success and "did not return" in orbit.message
    drifts = System({x: 1 + 0 * x}, time=t)
    orbit = find_orbit(drifts, {x: 0}, seen=Strobe(1))
    assert not orbit.success and "transient" in orbit.message
    never = find_orbit(relay(0.1), {x: 1, u: 1}, seen=Return(u - 1e6))
    assert not never.success and "no return" in never.message


@pytest.mark.parametrize(
    ("seen", "text"),
    [
        (lambda: T, "`seen` is 2"),
        (lambda: Strobe(-1), "`period` is -1"),
        (lambda: Return(v, direction=0), "`direction` of Return is 0"),
        (lambda: Return(v, longest=0), "`longest` of Return is 0"),
        (lambda: Strobe(T, symmetry={y: -y, v: v}), "does not have it"),
        (lambda: Strobe(T, symmetry={y: -(y**2)}), "linear expressions"),
        (lambda: Strobe(2 * sp.pi / sp.Symbol("nu")), "nu is no parameter"),
        (lambda: Return(v), "depends on time"),
    ],
)
def test_bad_input_is_refused_with_a_remedy(seen, text):
    with pytest.raises((ValueError, TypeError), match=text):
        find_orbit(coulomb(), {y: 0.5, v: 0.3}, seen())


def test_parameters_of_the_orbit_travel_with_it():
    orbit = find_orbit(coulomb(sigma=2.0), {y: 0.5, v: 0.3}, seen=Strobe(T, symmetry=MIRROR))
    assert orbit.system.parameters[sigma] == 2.0
    assert orbit.map.with_parameters({k: 3.0}).system.parameters[k] == 3.0


def test_an_orbit_that_begins_in_a_stick_stays_on_the_surface():
    """A forced block on a belt, strobed in a stick of its orbit of period 5: from v = -1e-27 it would slip."""
    lam = Switch("lam", u)
    friction = lam * (1 + 3 * (1 - lam**2))
    block = System(
        {x: u + 0.5, u: sp.cos(omega * t) - x - 0.05 * (u + 0.5) - friction}, time=t, parameters={omega: 0.45}
    )
    map_ = Stroboscopic(block, 2 * sp.pi / omega, count=5)
    for offset in range(-8, 9):
        orbit = refine(map_, {x: 2.4173321 + offset * 1e-10, u: 0})
        assert orbit.success and orbit.x[1] == 0


# ---- what is no orbit, in any unit


UNITS = [1.0, 1e-6, 1e6]
unit = sp.Symbol("unit", positive=True)
rough = sp.Symbol("rough", integer=True, positive=True)


@pytest.mark.parametrize("size", UNITS)
@pytest.mark.parametrize("transient", [0, 50])
@pytest.mark.parametrize("power", [1, 3, 5, 7])
def test_a_spiral_into_a_rest_is_no_orbit(power, transient, size):
    # The energy falls strictly: by a part that vanishes with the amplitude, as a power of it.
    loss = u / 10 if power == 1 else (u / unit) ** (power - 1) * u
    spiral = System({x: u, u: -x - loss}, parameters={} if power == 1 else {unit: size})
    orbit = find_orbit(spiral, {x: size, u: 0}, seen=Return(u, direction=-1), transient=transient)
    assert not orbit.success and not orbit.stable
    assert "rest" in orbit.message


def test_a_transient_that_ends_in_a_rest_says_so():
    spiral = System({x: u, u: 1 - x - u / 5})
    orbit = find_orbit(spiral, {x: 2, u: 0}, seen=Return(u, direction=-1), transient=100)
    assert not orbit.success and "comes to rest" in orbit.message and orbit.x == pytest.approx([1, 0])


@pytest.mark.parametrize("size", UNITS)
def test_relays_whose_turns_shrink_by_a_part_that_vanishes_have_no_orbit(size):
    # The return map is x/(1 + 4 x/unit): 1/x grows by the same with each turn.
    relays = System({x: -x - unit * sp.sign(u), u: -u + unit * sp.sign(x)}, parameters={unit: size})
    for transient in (0, 20):
        orbit = find_orbit(relays, {x: size, u: 0}, seen=Return(u), transient=transient)
        assert not orbit.success and "rest" in orbit.message


@pytest.mark.parametrize("section", [sp.sin(x), sp.cos(x) - sp.Rational(1, 2), sp.sin(x / 2)])
def test_a_state_that_runs_on_is_an_orbit_where_it_is_named_an_angle(section):
    rates = {x: u, u: sp.Rational(3, 2) - sp.sin(x) - u / 5 - sp.sign(u) / 10}
    orbit = find_orbit(System(rates), {x: 0, u: 5}, seen=Return(section), transient=30)
    assert not orbit.success and "x runs on, by " in orbit.message
    turns = 2 if section == sp.sin(x / 2) else 1
    orbit = find_orbit(
        System(rates), {x: 0, u: 5}, seen=Return(section), transient=10, angles={x: turns * 2 * math.pi}
    )
    assert orbit.success and orbit.stable and orbit.winding == {"x": 1}
    assert orbit.period == pytest.approx(turns * 0.897785, abs=turns * 1e-5)  # a plain run's, of one turn
    if turns == 2:
        with pytest.raises(ValueError, match="the section .* is another one after it"):
            find_orbit(System(rates), {x: 0, u: 5}, seen=Return(section), angles={x: 2 * math.pi})


def test_a_driven_rotation_has_its_winding_number():
    # x'' + x'/5 + sin x = 3 cos(t)/2 + 9/10 turns on in step with its drive from this start.
    rates = {x: u, u: sp.Rational(9, 10) + sp.cos(t) / 2 - sp.sin(x) / 2 - 9 * u / 10}
    orbit = find_orbit(
        System(rates, time=t), {x: 0, u: 1}, seen=Strobe(T), transient=60, angles={x: 2 * math.pi}
    )
    run = orbit.solution()
    assert orbit.success and orbit.winding == {"x": round(run.x[0, -1] - run.x[0, 0]) // 6}
    assert run.x[0, -1] - run.x[0, 0] == pytest.approx(2 * math.pi * orbit.winding["x"], abs=1e-8)


@pytest.mark.parametrize("size", [1e-9, *UNITS])
def test_a_relay_loop_has_the_period_of_its_closed_form_in_any_unit(size):
    # 1/(s + 1)^3 and a relay: half the period h solves c (1 + exp(A h))^-1 (exp(A h) - 1) A^-1 b = 0, by SciPy.
    from scipy.linalg import expm
    from scipy.optimize import brentq

    A, b = np.array([[-1.0, 0, 0], [1, -1, 0], [0, 1, -1]]), np.array([1.0, 0, 0])

    def off(h):
        return np.linalg.solve(np.eye(3) + expm(A * h), (expm(A * h) - np.eye(3)) @ np.linalg.solve(A, b))[2]

    w = sp.Symbol("w", real=True)
    relay_loop = System({x: -x - unit * sp.sign(w), u: -u + x, w: -w + u}, parameters={unit: size})
    start = {x: 0.3 * size, u: 0.1 * size, w: 0.0}
    orbit = find_orbit(relay_loop, start, seen=Return(w, direction=1), transient=3)
    assert orbit.success and orbit.stable
    assert orbit.period == pytest.approx(2 * brentq(off, 1, 3, xtol=1e-13), rel=1e-10)


def test_a_slow_motion_is_waited_for_as_its_steps_count_the_time():
    slow = System({x: u / 10**8, u: ((1 - x**2) * u - x) / 10**8})
    orbit = find_orbit(slow, {x: 1, u: 0}, seen=Return(u, direction=-1), transient=3)
    assert orbit.success and orbit.period == pytest.approx(6.66328686e8, rel=1e-8)  # DOP853, see above


def test_a_population_far_below_the_usual_tolerance_is_followed_exactly():
    # Lotka and Volterra: x exp(-x) y exp(-y) stays; the least x on the way, by that invariant, is 2.3e-14.
    populations = System({x: x * (1 - u), u: u * (x - 1)})
    orbit = find_orbit(populations, {x: 1, u: 35.0}, seen=Return(x - 1, direction=-1))
    assert orbit.success
    run = orbit.solution(rtol=1e-12)
    kept = np.log(run.x[0]) - run.x[0] + np.log(run.x[1]) - run.x[1]
    assert run.x[0].min() < 1e-12 and np.ptp(kept) < 1e-9
    with pytest.warns(UserWarning, match="`atol` is 1e-14, and [xu] falls to"):
        find_orbit(populations, {x: 1, u: 30.0}, seen=Return(x - 1, direction=-1), atol=1e-14)


# ---- two surfaces at one instant


def rooms(coupling):
    """Two equal rooms with a thermostat each."""
    from pwsmooth import Event, Memory

    heats, k = [Memory("q1", 1), Memory("q2", 1)], sp.Symbol("k", real=True)
    events = [
        Event(room - at, direction=way, update={heat: on}, name=f"{room}{on}")
        for room, heat in zip((x, u), heats)
        for at, way, on in ((19, -1, 1), (21, 1, 0))
    ]
    rates = {
        room: (4 - room) / 8 + 5 * heat + k * (other - room) for room, other, heat in zip((x, u), (u, x), heats)
    }
    return System(rates, parameters={k: coupling}, events=events)


@pytest.mark.parametrize("coupling", [0.0, -0.01, 0.01])
def test_rooms_in_step_have_the_multiplier_of_their_lag(coupling):
    from pwsmooth import solve

    orbit = find_orbit(rooms(coupling), {x: 19.9, u: 19.9}, seen=Return(x - 20))
    run = solve(rooms(coupling), (0, 40), {x: 19.9, u: 19.9 + 1e-4})
    lags = run.event_times(switch="x1")[:15] - run.event_times(switch="u1")[:15]
    growth = (lags[12] / lags[2]) ** 0.1
    assert abs(orbit.multipliers[0]) == pytest.approx(growth, abs=1e-4)
    assert orbit.success and orbit.stable == (coupling > 0)


def test_an_orbit_through_a_corner_of_the_map_is_not_called_stable():
    # Both switches are met at once, at x = u = 0; which comes first decides about the size of a kick in v.
    w = sp.Symbol("w", real=True)
    first = sp.Heaviside(x) * (1 - sp.Heaviside(u))
    both = System({x: sp.cos(t) - x / 5, u: sp.cos(t) - u / 5, w: first - w}, time=t)
    orbit = find_orbit(both, {x: 0, u: 0, w: 0}, seen=Strobe(T, phase=0.3), transient=20)
    assert orbit.success and not orbit.stable and orbit.corner


# ---- what the motion keeps


@pytest.mark.parametrize("size", UNITS)
def test_a_rod_in_cartesian_coordinates_has_the_multipliers_of_its_angle_and_two_of_one(size):
    # A driven pendulum: x^2 + y^2 and its rate are kept; the angle alone has the same orbit.
    y, w, q = sp.symbols("y w q", real=True)
    pull = {x: -3 * u / 10 - y * sp.cos(t) / 2, y: -3 * w / 10 - unit + x * sp.cos(t) / 2}
    tension = (u**2 + w**2 + x * pull[x] + y * pull[y]) / (x**2 + y**2)
    rod = System(
        {x: u, y: w, u: pull[x] - tension * x, w: pull[y] - tension * y}, time=t, parameters={unit: size}
    )
    orbit = find_orbit(rod, {x: 0, y: -size, u: 0, w: 0}, seen=Strobe(T), transient=40)
    angle = System({q: u, u: -sp.sin(q) - 3 * u / 10 + sp.cos(t) / 2}, time=t)
    plain = find_orbit(angle, {q: 0, u: 0}, seen=Strobe(T), transient=40)
    assert orbit.success and orbit.stable and len(orbit.integrals) == 2 and "keeps 2" in orbit.message
    mu = orbit.multipliers
    assert (np.sort(np.abs(mu))[-2:] == 1).all()
    assert np.sort_complex(mu[np.abs(mu) < 0.9]) == pytest.approx(np.sort_complex(plain.multipliers), abs=1e-7)


def test_a_slider_that_never_slips_has_a_multiplier_of_one_that_stability_leaves_out():
    y, w = sp.symbols("y w", real=True)
    slider = System({x: u, u: sp.cos(t) / 5 - x - u / 5 - y, y: 0 * y}, time=t)
    orbit = find_orbit(slider, {x: 0, u: 0, y: 0.1}, seen=Strobe(T), transient=40)
    assert orbit.success and orbit.stable and not orbit.isolated and abs(orbit.multipliers[0]) == 1
    kept = find_orbit(System({x: u, u: sp.cos(2 * t) - x}, time=t), {x: 0.4, u: 0}, seen=Strobe(T))
    assert len(kept.integrals) == 2 and not kept.stable  # nothing is left that would die down
