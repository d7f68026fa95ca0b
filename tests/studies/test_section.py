"""Sweeps, orbit diagrams and basins of autonomous systems, by their returns to a section; slow starts of basins.

Guards: studies/periodicity.py.
"""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from pwsmooth import Event, Outcome, Return, Strobe, System, basins, find_orbit, sweep
from pwsmooth.analysis.maps.poincare import RETURN
from pwsmooth.studies import Function, orbit_diagram
from pwsmooth.studies.attractors import UNSETTLED
from pwsmooth.studies.chunk import run_chunk, solve_point
from pwsmooth.studies.plan import NO_RETURN, read_plan

t, x, y, z, u = sp.symbols("t x y z u", real=True)
k, alpha = sp.symbols("k alpha", positive=True)
EPS = np.finfo(float).eps
RTOL = 1e-9  # of a sweep, unless more is asked for

# Friction that drives: about its centre -k or k an arc loses all but q of its amplitude, A = k + (A + k) q.
ZETA = 0.1
PERIOD = 2 * math.pi / math.sqrt(1 - ZETA**2)
Q = math.exp(-ZETA * PERIOD / 2)
ACTIVE = System({x: u, u: -x - 2 * ZETA * u + k * sp.sign(u)}, parameters={k: 1})
OUTSIDE = {"x": 3, "u": 0}

SLOPE = sp.Rational(-5, 7) * x + sp.Rational(-3, 14) * (sp.Abs(x + 1) - sp.Abs(x - 1))
CHUA = System(
    {x: alpha * (y - x - SLOPE), y: x - y + z, z: -sp.Rational(100, 7) * y}, parameters={alpha: sp.Float(8.1)}
)
SCROLL = {"x": 1.5, "y": 0.1, "z": -1.5}


def chua_returns(value, count):
    """States where y rises through 0, by SciPy: (count, 3)."""

    def rates(_, s):
        bent = -5 / 7 * s[0] - 3 / 14 * (abs(s[0] + 1) - abs(s[0] - 1))
        return [value * (s[1] - s[0] - bent), s[0] - s[1] + s[2], -100 / 7 * s[1]]

    def section(_, s):
        return s[1]

    section.direction = 1
    run = solve_ivp(
        rates, (0, 5 * count), list(SCROLL.values()), method="DOP853", rtol=1e-12, atol=1e-13, events=section,
        max_step=0.05,  # the corners at |x| = 1 are stepped over
    )  # fmt: skip
    return run.y_events[0][:count]


@pytest.mark.parametrize("section, direction", [(u, -1), (u, 1), (x, 1), (x - k, -1)])
def test_an_oscillator_driven_by_friction_has_its_closed_form_on_every_section(section, direction):
    found = sweep(
        ACTIVE, {"k": [0.5, 2.0]}, x0=OUTSIDE, seen=Return(section, direction=direction),
        measures=["period", "itinerary", "amplitude(x)", "counts"], units={"t": "s"},
    )  # fmt: skip
    # Errors of a turn, some RTOL of the states, die out by Q**2 a turn.
    bound = 10 * RTOL / (1 - Q**2)
    amplitude = (1 + Q) / (1 - Q) * found.k.values
    assert found.period.values.tolist() == [1, 1]
    np.testing.assert_allclose(found.period_time, PERIOD, rtol=bound)
    np.testing.assert_allclose(found.x_amplitude, amplitude, rtol=bound)
    assert set(found.itinerary.values) == {"R L"}
    assert found.events.values.tolist() == [40, 40]  # two crossings a turn, and the section is no event
    assert found.period_time.attrs["units"] == "s"


def test_a_smoothed_view_is_measured_from_return_to_return_too():
    eps = 1e-3
    found = sweep(
        ACTIVE.smoothed(eps), {"k": [1.0]}, x0=OUTSIDE, seen=Return(x), transient=30, periods=6,
        measures=["period", "amplitude(x)"],
    )  # fmt: skip
    assert int(found.period[0]) == 1
    # The layer, of width eps, is crossed twice a turn at some speed of order 1.
    assert abs(float(found.period_time[0]) - PERIOD) < eps
    assert abs(float(found.x_amplitude[0]) - (1 + Q) / (1 - Q)) < eps


def test_compiled_measures_agree_with_those_of_the_solution():
    names = ["sticks", "itinerary", "period", "counts", "points", "extremes(x, u)", "statistics(x, u)"]
    belt = System({x: u, u: -x + 2 * sp.sign(k - u) / (1 + sp.Abs(u - k))}, parameters={k: 0.5})  # stick-slip
    short = {
        "max_step": 0.25
    }  # a step in a stick would go as far as the run may last, which is not the same for both
    plan, axes = read_plan(
        belt,
        {"k": [0.3, 0.5]},
        None,
        {"x": 0, "u": 0},
        names,
        None,
        None,
        Return(u, -1),
        5,
        4,
        None,
        None,
        short,
    )
    columns = axes.columns(0, axes.size)
    compiled = run_chunk(plan, columns)
    assert (compiled["stick_time"] > 0).all() and compiled["period"].tolist() == [1, 1]
    for i in range(axes.size):
        solution, window = solve_point(plan, columns, i, dense=True)
        assert solution.t[-1] == window.end == compiled["t_reached"][i]
        for measure in plan.measures:
            for key, value in measure.of(solution, window, plan.setting).items():
                if isinstance(value, str):
                    assert compiled[key][i] == value, key
                else:
                    # Sums and polynomials in another order: some 500 terms of size up to 5, each rounded.
                    np.testing.assert_allclose(compiled[key][i], value, rtol=0, atol=500 * 5 * EPS, err_msg=key)


def test_a_function_sees_the_run_to_the_last_return_and_the_times_of_all():
    def seen(solution, window):
        same = np.array_equal(solution.event_times(switch=RETURN)[-window.periods :], window.times[1:])
        return {"last": solution["x"][-1], "same": same}

    found = sweep(
        ACTIVE, {"k": [0.5, 2.0]}, x0=OUTSIDE, seen=Return(u), periods=3,
        measures=["points(x)", Function(seen, names=("last", "same"))],
    )  # fmt: skip
    assert found["last"].values.tolist() == found.x_points.values[:, -1].tolist()
    assert found["same"].values.all()


def test_returns_of_chuas_circuit_are_those_that_scipy_finds():
    periodic = orbit_diagram(CHUA, alpha, [8.1, 8.2], SCROLL, seen=Return(y), transient=60, keep=4, rtol=1e-11)
    for value, points in zip(periodic.values, periodic.points):
        expected = chua_returns(value, 66)
        gap = np.abs(points[:, None] - expected[None, -8:]).max(axis=2).min(axis=1)
        assert gap.max() < 1e-7  # SciPy's steps over the corners: its own error, 1e-8 with max_step halved
    chaotic = orbit_diagram(CHUA, alpha, [9.0], SCROLL, seen=Return(y), transient=0, keep=5, rtol=1e-11)
    np.testing.assert_allclose(chaotic.points[0], chua_returns(9.0, 6)[1:], rtol=0, atol=1e-7)


def test_carried_and_independent_diagrams_of_an_autonomous_system_agree():
    values = [8.0, 8.1, 8.2]
    apart = orbit_diagram(CHUA, alpha, values, SCROLL, seen=Return(y), keep=4)
    carried = orbit_diagram(CHUA, alpha, values, SCROLL, seen=Return(y), keep=4, carry=True)
    assert [len(set(row.round(6))) for row in apart["x"]] == [1, 1, 2]
    for one, other in zip(apart["x"], carried["x"]):
        assert np.sort(one) == pytest.approx(np.sort(other), abs=1e-7)


def test_the_wall_of_an_impact_can_be_the_section():
    wall = Event(1 - x, direction=-1, update={u: -u / 2})
    excited = System({x: u, u: -x + u / 5}, events=[wall])
    found = sweep(
        excited, {"u": [0.0, 0.1]}, x0={"x": 0.5}, seen=Return(x - 1), measures=["period", "points(x, u)"]
    )
    orbit = find_orbit(excited, {x: 0.5, u: 0}, seen=Return(x), transient=50)
    np.testing.assert_allclose(found.period_time, orbit.period, rtol=100 * RTOL)
    assert np.abs(found.x_points - 1).max() < 1e-12 and (found.u_points < 0).all()  # after the impact


def test_an_orbit_that_does_not_come_back_costs_no_other_one():
    # It spirals into the origin from within |x| < 1 and is driven beyond.
    spiral = System({x: u, u: -x - u * sp.sign(1 - x**2 - u**2) / 4})
    found = sweep(
        spiral, {"x": [0.5, 1.5]}, x0={"u": 0}, seen=Return(u - sp.Rational(1, 10), longest=20), transient=0,
        periods=2, measures=["period", "amplitude(x)"],
    )  # fmt: skip
    assert found.outcome.values.tolist() == [NO_RETURN, Outcome.FINISHED]
    words = dict(zip(found.outcome.flag_values, found.outcome.flag_meanings.split()))
    assert words[NO_RETURN] == "no_return_to_the_section"
    assert np.isnan(found.x_amplitude[0]) and np.isfinite(found.x_amplitude[1])
    ended = System({x: u, u: -x}, events=[Event(u + x - 2, terminal=True)])
    found = sweep(ended, {"x": [1.0, 3.0]}, x0={"u": 0}, seen=Return(u), measures=["period", "amplitude(x)"])
    assert found.outcome.values.tolist() == [Outcome.FINISHED, Outcome.TERMINATED]
    assert np.isnan(found.x_amplitude[1]) and int(found.period[1]) == -1


def test_basins_of_limit_cycles_have_the_known_boundary_at_every_phase():
    # r' = -r (r^2 - 1)(r^2 - 4)(r^2 - 9)/20, phase' = 1: cycles at 1 and 3, and 2 separates.
    r2 = x**2 + y**2
    growth = -(r2 - 1) * (r2 - 4) * (r2 - 9) / 20
    cycles = System({x: growth * x - y, y: growth * y + x})
    grid = np.linspace(-3.9, 3.9, 14)
    found = basins(cycles, {x: grid, y: grid}, seen=Return(y), transient=20)
    assert len(found.attractors) == 2 and (found.labels >= 0).all() and not any(found.reasons.ravel())
    radius = np.array([np.hypot(*orbit.x) for orbit in found.attractors])
    assert radius[found.labels] == pytest.approx(
        np.where(np.hypot(*np.meshgrid(grid, grid)) > 2, 3, 1), abs=1e-11
    )
    assert [orbit.period for orbit in found.attractors] == pytest.approx([2 * math.pi] * 2, abs=1e-10)


def test_mirrored_starts_of_chuas_circuit_lead_to_mirrored_attractors():
    grid = {x: [-2.5, -1.5, 1.5, 2.5], y: [-0.1, 0.1], z: [-1.5, 1.5]}
    found = basins(CHUA, grid, seen=Return(y), transient=100)
    assert len(found.attractors) == 2 and (found.labels >= 0).all()
    assert np.array_equal(found.labels[::-1, ::-1, ::-1], 1 - found.labels)


def impacting(zeta):
    """x'' + 2 zeta x' + x = cos(14/5 t) before a wall at 1 with restitution 4/5, and its drive's period."""
    wall = Event(1 - x, direction=-1, update={u: -sp.Rational(4, 5) * u})
    return System({x: u, u: sp.cos(14 * t / 5) - 2 * zeta * u - x}, time=t, events=[wall]), 2 * sp.pi * 5 / 14


@pytest.mark.parametrize("weak", [100, 2000])
def test_the_slow_orbit_without_impacts_has_its_basin(weak):
    zeta, w = sp.Rational(1, weak), 2.8
    system, period = impacting(zeta)
    axes = {"x": np.linspace(-3, 0.95, 9), "u": np.linspace(-3, 3, 8)}
    found = basins(system, axes, Strobe(period), transient=60)
    assert (found.labels >= 0).all() and len(found.attractors) == 2
    (free,) = [n for n, orbit in enumerate(found.attractors) if not orbit.word]
    response = 1 / (1 - w**2 + 2j * float(zeta) * w)  # of exp(i w t)
    # Newton's method ends at 1e-11 of the return, and 1 - multiplier is some 2 zeta.
    assert found.attractors[free].x == pytest.approx([response.real, -w * response.imag], abs=1e-11 * weak)
    # Whoever has no impact for so long that the free motion has decayed has none any more.
    settled = sweep(system, axes, seen=Strobe(period), transient=4 * weak, periods=20, measures=["counts"])
    assert np.array_equal(found.labels == free, settled.events.values == 0)


def test_every_start_without_an_attractor_has_its_reason():
    logistic = System(
        {x: 0 * x}, time=t, parameters={k: 3.9}, events=[Event(every=1, update={x: k * x * (1 - x)})]
    )
    chaotic = basins(logistic, {x: [0.3, 0.4]}, Strobe(1), transient=50)
    assert [reason.split(":")[0] for reason in chaotic.reasons] == ["unsettled"] * 2
    resting = basins(System({x: u, u: -x - u}), {x: [1.0]}, x0={u: 0}, seen=Return(u - 1), transient=5)
    assert resting.labels.tolist() == [UNSETTLED] and resting.reasons[0].startswith("no return")
    swinging = basins(System({x: u, u: -x}), {x: [1.0, 2.0]}, x0={u: 0}, seen=Return(u), transient=5)
    assert swinging.labels.tolist() == [UNSETTLED] * 2 and "a multiplier of size 1" in swinging.reasons[0]


@pytest.mark.parametrize(
    "change, words",
    [
        (dict(seen=Return(x - t)), ["`section` is -t + x", "t is no state", "x, u"]),
        (dict(seen=Return(x - sp.Symbol("w"))), ["`section`", "w is no state or parameter"]),
        (dict(seen=Return("x - w")), ["`section`", "'w'"]),
        (dict(seen=Return(k)), ["`section` is k", "states x, u"]),
        (dict(seen=Return(1)), ["`section` is 1", "states x, u"]),
        (dict(seen=u), ["`seen` is u", "Return(section)"]),
    ],
)
@pytest.mark.parametrize("door", ["sweep", "basins", "orbit_diagram", "carried"])
def test_refusals_name_the_argument_and_the_remedy(door, change, words):
    doors = {
        "sweep": lambda: sweep(ACTIVE, {"k": [1.0]}, x0=OUTSIDE, measures="period", **change),
        "basins": lambda: basins(ACTIVE, {x: [1.0]}, x0={u: 0}, **change),
        "orbit_diagram": lambda: orbit_diagram(ACTIVE, k, [1.0], OUTSIDE, **change),
        "carried": lambda: orbit_diagram(ACTIVE, k, [1.0], OUTSIDE, carry=True, **change),
    }
    with pytest.raises((ValueError, TypeError)) as caught:
        doors[door]()
    for word in words:
        assert word in str(caught.value)


def test_a_system_with_a_drive_has_no_section():
    system, _ = impacting(sp.Rational(1, 100))
    for call in (
        lambda: sweep(system, {"x": [0.0]}, x0={u: 0}, seen=Return(u), measures="period"),
        lambda: basins(system, {x: [0.0]}, x0={u: 0}, seen=Return(u)),
    ):
        with pytest.raises(ValueError, match=r"depends on time.*Give Strobe\(period\)"):
            call()
