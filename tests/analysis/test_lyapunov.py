"""Lyapunov exponents: of periodic orbits, of a chaotic flow with an exact return map, of a chaotic oscillator."""

import math
import tracemalloc

import numpy as np
import pytest
import sympy as sp
from friction_oscillator import coulomb, hidden, v, y, z

from pwsmooth import Event, Memory, Strobe, System, Unilateral, follow, solve
from pwsmooth.analysis.lyapunov import largest_exponent, lyapunov_exponents
from pwsmooth.analysis.orbits.finding import find_orbit
from pwsmooth.studies import orbit_diagram

PERIOD = 2 * math.pi
t, x, u, w = sp.symbols("t x u w", real=True)


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
def test_on_a_periodic_orbit_they_are_the_logarithms_of_the_multipliers(system, start):
    orbit = find_orbit(system, start, seen=Strobe(2 * sp.pi), transient=30)
    found = lyapunov_exponents(system, orbit.x0, 10 * PERIOD, transient=5 * PERIOD, rtol=1e-11)
    # Five periods align the deviation but for |m2/m1|**5 < 1e-6 of it.
    assert found.exponents[0] == pytest.approx(math.log(abs(orbit.multipliers[0])) / PERIOD, abs=1e-6)


def test_a_direction_that_a_stick_takes_away_has_minus_infinity():
    slaved = hidden().layered({z: sp.oo})
    found = lyapunov_exponents(slaved, {y: 0.78, v: -1.03}, 20 * PERIOD, transient=10 * PERIOD, count=2)
    assert found.exponents[0] > -1
    assert found.exponents[1] == -math.inf


def folding_spiral(delta, frequency=1.0):
    """An unstable spiral about s = +-1, s taken anew at every turning point: x -> s (1 + E) - E x, s = sign x."""
    side = Memory("side", 1)
    square = frequency**2 + delta**2
    return System({x: u, u: 2 * delta * u - square * (x - side)}, events=[Event(u, update={side: sp.sign(x)})])


def test_a_chaotic_flow_whose_return_map_has_one_slope():
    # Half a turn takes pi/w and stretches by E = exp(delta pi/w) < 2: the exponent is delta, the flow's own 0,
    # and the memory, overwritten at every event, has none.
    delta = 0.15
    found = lyapunov_exponents(folding_spiral(delta), {x: 0.7, u: 0.0}, 2000, transient=50, count=3)
    assert found.outcome.success
    # Both ends of the run lie inside a turn, which changes the sum of logarithms by no more than some 2 delta pi.
    assert found.exponents[0] == pytest.approx(delta, abs=2 * math.pi * delta / 2000 * 2)
    assert found.exponents[1] == pytest.approx(0, abs=5 / 2000)
    assert found.exponents[2] == -math.inf


def test_the_pieces_of_a_long_run_make_no_difference():
    system, start = coulomb(), {y: 0.5, v: 0.3}
    whole = solve(system, (0, 1300), start, dense_output=True, rtol=1e-11)
    pieces = lyapunov_exponents(system, start, 1100, transient=200, rtol=1e-11)
    # One average begins at t = 200, the other with the first step after it: no step or jump grows by more than e.
    assert pieces.exponents[0] == pytest.approx(largest_exponent(whole, after=200), abs=1 / 1100)
    assert 0 < pieces.errors[0] < 0.01


@pytest.mark.parametrize(
    ("system", "start"),
    [(coulomb(), {y: 0.5, v: 0.3}), (hidden().layered({z: sp.oo}), {y: 0.78, v: -1.03})],
    ids=["crossings", "folds"],
)
def test_along_a_tape_and_by_factors_they_are_the_same(system, start):
    run = solve(system, (0, 100), start, dense_output=True, rtol=1e-12, atol=1e-14)
    along = largest_exponent(run, after=0)
    run.tape = None
    assert along == pytest.approx(largest_exponent(run, after=0), abs=1e-12)


def test_all_exponents_together_are_the_mean_divergence():
    # Impacts turn and shrink the momentum by 0.7, the volume by 0.49; between them it shrinks with 2 delta.
    wall = Unilateral(x + sp.Rational(3, 10), restitution=sp.Rational(7, 10), name="R")
    system = System({x: u, u: -x - u / 10 + sp.cos(sp.Rational(13, 10) * t) + wall.reaction}, time=t)
    found = lyapunov_exponents(system, {x: 0.1, u: -0.5}, 200, count=2)
    impacts = len(solve(system, (0, 200), {x: 0.1, u: -0.5}).event_times("impact"))
    assert impacts > 20
    assert found.exponents.sum() == pytest.approx(-0.1 + impacts * math.log(0.49) / 200, abs=1e-9)


def test_a_long_run_keeps_no_more_than_its_growth():
    system, start = coulomb(), {y: 0.5, v: 0.3}

    def peak(time):
        tracemalloc.start()
        lyapunov_exponents(system, start, time)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    short, long = 20_000, 80_000
    steps = [solve(system, (0, time), start).cost["steps"] for time in (short, long)]
    peak(long)  # what is called often is optimised here
    # Of a step its time and the logarithm, 16 bytes, and these once more while they are put together and binned. On a
    # tape it takes 160: two entries, of five integers and five numbers each.
    assert peak(long) - peak(short) < 100 * (steps[1] - steps[0])


def test_a_run_under_a_record_begins_where_the_record_is():
    times = np.linspace(0, 30, 301)
    force = np.random.default_rng(3).normal(size=301)
    driven = System({x: u, u: w - x - x**3}, drives={w: (times, force)})
    begin, start = 7.03, {x: 0.3, u: 0.0}
    found = lyapunov_exponents(driven, start, 20, start_time=begin)
    run = solve(driven, (begin, begin + 20), start, dense_output=True)
    assert found.exponents[0] == pytest.approx(largest_exponent(run, after=begin), abs=1e-9)


def test_a_failed_run_gives_the_average_of_what_was_reached():
    blows_up = System({x: x**2})
    found = lyapunov_exponents(blows_up, {x: 1}, 5)
    assert not found.outcome.success
    assert found.time == pytest.approx(1, abs=1e-3)


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match="`time`"):
        lyapunov_exponents(coulomb(), {y: 0, v: 0}, -1)
    with pytest.raises(ValueError, match="`count`"):
        lyapunov_exponents(coulomb(), {y: 0, v: 0}, 1, count=3)
    with pytest.raises(ValueError, match="dense_output=True"):
        largest_exponent(solve(coulomb(), (0, 1), {y: 0.5, v: 0.3}))
    assert math.isnan(largest_exponent(solve(coulomb(), (0, 1), {y: 0.5, v: 0.3}, dense_output=True), after=2))
    assert np.isfinite(largest_exponent(solve(coulomb(), (0, 9), {y: 0.5, v: 0.3}, dense_output=True)))


def test_where_there_is_no_derivative_the_exponents_say_so():
    meeting = System({x: -2 - sp.sign(x), u: -2 - sp.sign(u)})
    found = lyapunov_exponents(meeting, {x: 1, u: 1}, 1.0, count=2)
    assert len(found.degenerate) == 1 and "corner" in found.degenerate[0]
    assert not lyapunov_exponents(meeting, {x: 1, u: 0.5}, 1.0).degenerate


# ---- along branches


def test_exponents_along_a_branch_are_those_of_the_linear_flow():
    # x'' + c x' + x = cos t, overdamped: the exponents -c/2 +- sqrt(c^2/4 - 1).
    c = sp.Symbol("c", positive=True)
    oscillator = System({x: u, u: sp.cos(t) - x - c * u}, time=t, parameters={c: 3})
    branch = follow(find_orbit(oscillator, {x: 0, u: 0}, seen=Strobe(2 * sp.pi)), {c: 2.5})
    root = np.sqrt(branch.values**2 / 4 - 1)
    assert branch.exponents == pytest.approx(np.array([root, -root]) - branch.values / 2, abs=1e-8)
    assert branch.to_dataframe()["largest_exponent"].to_numpy() == pytest.approx(branch.exponents[0], abs=0)


def test_an_orbit_that_sticks_has_an_exponent_minus_infinity():
    driven = System({x: u, u: sp.sin(t / 3) - x - sp.sign(u) * 0.3}, time=t)
    orbit = find_orbit(driven, {x: 0.5, u: 0.5}, seen=Strobe(6 * sp.pi), transient=20)
    assert any(kind == "stick" for _, kind, _ in orbit.word)
    assert np.isneginf(orbit.exponents[-1])


def test_exponents_of_an_orbit_diagram_are_those_of_the_logistic_map():
    # At c = 4 the exponent is log 2, at 2.5 log|2 - c| of the fixed point (once a unit of time).
    c = sp.Symbol("c", real=True)
    logistic = System(
        {x: 0 * x}, time=t, parameters={c: 3}, events=[Event(every=1, update={x: c * x * (1 - x)})]
    )
    shown = orbit_diagram(logistic, c, [2.5, 4.0], {x: 0.3}, Strobe(1), keep=4)
    found = shown.exponents(4000.0)[:, 0]
    assert found[0] == pytest.approx(np.log(0.5), abs=1e-6)
    assert found[1] == pytest.approx(
        np.log(2), abs=0.02
    )  # the mean over 4000 steps scatters by some 1/sqrt(4000)
