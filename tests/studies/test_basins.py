"""Basins of attraction and orbit diagrams.

Guards: studies/attractors.py, studies/orbits.py.
"""

import math

import numpy as np
import pytest
import sympy as sp
from friction_oscillator import hidden, z

from pwsmooth import Event, Return, Strobe, System
from pwsmooth.studies.attraction import basins, orbit_diagram
from pwsmooth.studies.attractors import UNSETTLED

t, x = sp.symbols("t x", real=True)
c = sp.Symbol("c", real=True)


def jumping(update, **parameters):
    """x jumps once a unit of time, at phase 1/(2 pi), well away from the strobes."""
    values = {c: parameters["c"]} if parameters else {}
    clock = Event(sp.sin(2 * sp.pi * t - 1), direction=1, update={x: update})
    return System({x: 0 * x}, time=t, parameters=values, events=[clock])


def test_the_basins_of_a_cubic_map_have_the_known_boundary():
    # x -> x + (x - x^3)/2: fixed at -1, 0, 1; 0 repels and separates, and the starts lie within |x| < 1.5.
    starts = np.linspace(-1.45, 1.45, 30)
    found = basins(jumping(x + (x - x**3) / 2), {"x": starts}, Strobe(1), transient=60)
    assert len(found.attractors) == 2
    ends = np.array([found.attractors[k].x[0] for k in found.labels])
    assert ends == pytest.approx(np.sign(starts), abs=1e-11)
    assert found.shares.sum() == 1


def test_a_two_cycle_is_one_attractor_whichever_of_its_points_a_start_ends_on():
    found = basins(jumping(c * x * (1 - x), c=3.2), {"x": np.linspace(0.1, 0.9, 17)}, Strobe(1), transient=200)
    (cycle,) = found.attractors
    assert cycle.map.count == 2
    assert np.all(found.labels == 0)


def test_starts_that_do_not_become_periodic_are_left_without_a_label():
    found = basins(jumping(c * x * (1 - x), c=3.9), {"x": [0.3, 0.4]}, Strobe(1), transient=100)
    assert found.labels.tolist() == [UNSETTLED, UNSETTLED] and not found.attractors


def test_the_relaxing_oscillator_has_its_three_attractors():
    # The asymmetric pair and the slip-only orbit of rho = 0, which takes a few of a hundred starts
    # (spec/solid_friction.md section 4: 3-8 % of random starts).
    grid = {"y": np.linspace(-2, 2, 12), "v": np.linspace(-3, 3, 12)}
    found = basins(hidden(), grid, Strobe(2 * sp.pi), x0={z: 0}, transient=150)
    assert len(found.attractors) == 3
    kinds = [{kind for _, kind, _ in orbit.word} for orbit in found.attractors]
    assert kinds.count({"crossing"}) == 1
    assert 0 < found.shares[kinds.index({"crossing"})] < 0.2
    pair = [orbit for orbit, kind in zip(found.attractors, kinds) if "stick" in kind]
    # Mirror images: (y, v, t) -> (-y, -v, t + pi)
    half = pair[0].solution(rtol=1e-12)(math.pi)
    assert -half[:2] == pytest.approx(pair[1].x[:2], abs=1e-9)


def test_an_orbit_diagram_and_its_hysteresis():
    # x -> x + (c + x - x^3)/2 has two fixed points, one after the other lost at a fold |c| = 2/(3 sqrt 3).
    system = jumping(x + (c + x - x**3) / 2, c=0.0)
    there = np.linspace(-0.6, 0.6, 25)
    up = orbit_diagram(system, c, there, {x: -1}, Strobe(1), carry=True, keep=2)
    down = orbit_diagram(system, c, there[::-1], {x: 1}, Strobe(1), carry=True, keep=2)
    fold = 2 / (3 * math.sqrt(3))
    assert np.array_equal(up["x"][:, -1] > 0, there > fold)
    assert np.array_equal(down["x"][:, -1] < 0, there[::-1] < -fold)


def test_independent_runs_of_an_orbit_diagram_agree_with_carried_ones():
    system = jumping(c * x * (1 - x), c=3.0)
    values = [2.5, 3.2, 3.5]
    apart = orbit_diagram(system, "c", values, {x: 0.3}, Strobe(1), transient=400, keep=8)
    carried = orbit_diagram(system, "c", values, {x: 0.3}, Strobe(1), transient=400, keep=8, carry=True)
    for one, other in zip(apart["x"], carried["x"]):
        assert np.sort(one) == pytest.approx(np.sort(other), abs=1e-9)
    assert [len(set(row.round(6))) for row in apart["x"]] == [1, 2, 4]


@pytest.mark.parametrize("transient", [120, 150])
def test_starts_still_on_their_way_by_turns_are_led_to_the_single_orbit(transient):
    # The multiplier of the fixed point is 2 - c = -0.95: what is left alternates, and to `tol` returns by twos.
    system = jumping(c * x * (1 - x), c=2.95)
    found = basins(system, {"x": np.linspace(0.1, 0.9, 17)}, Strobe(1), transient=transient)
    (point,) = found.attractors
    assert point.map.count == 1 and point.x == pytest.approx([1 - 1 / 2.95], abs=1e-11)
    assert np.all(found.labels == 0)


@pytest.mark.parametrize("carry", [False, True])
def test_an_orbit_diagram_says_why_points_are_missing(carry):
    # x = exp(c t) meets the wall at 2, and x' = 1 + c x^2 its pole.
    stopped = System(
        {x: c * x + 0 * t}, time=t, parameters={c: 0.1}, events=[Event(x - 2, terminal=True, name="wall")]
    )
    shown = orbit_diagram(stopped, c, [0.01, 0.1], {x: 1}, Strobe(1), transient=2, keep=5, carry=carry)
    assert np.isfinite(shown["x"][0]).all() and shown.reasons[0] == ""
    assert np.isnan(shown["x"][1, -1]) and "terminal event" in shown.reasons[1]
    blown = System({x: 1 + c * x**2 + 0 * t}, time=t, parameters={c: 1.0})
    shown = orbit_diagram(blown, c, [1.0], {x: 0}, Strobe(1), transient=2, keep=5, carry=carry)
    assert np.isnan(shown["x"]).all() and "singularity" in shown.reasons[0]


def test_a_parameter_among_the_axes_has_the_attractors_of_each_of_its_values():
    # x -> c x (1 - x) has the fixed point 1 - 1/c; a start hangs on the axes by an expression as well.
    y = sp.Symbol("y", real=True)
    clock = Event(sp.sin(2 * sp.pi * t - 1), direction=1, update={x: c * x * (1 - x), y: y / 2})
    system = System({x: 0 * x, y: 0 * y}, time=t, parameters={c: 2.0}, events=[clock])
    found = basins(system, {x: [0.2, 0.4], c: [2.0, 2.5, 2.8]}, Strobe(1), x0={y: 2 * x + c}, transient=60)
    assert found.labels.shape == (2, 3) and len(found.attractors) == 3
    for row in found.labels:
        ends = [found.attractors[k] for k in row]
        assert [orbit.system.parameters[c] for orbit in ends] == [2.0, 2.5, 2.8]
        assert [orbit.x[0] for orbit in ends] == pytest.approx(
            [1 - 1 / value for value in (2.0, 2.5, 2.8)], abs=1e-9
        )
    with pytest.raises(ValueError, match="'y' has no axis"):
        basins(system, {x: [0.2], c: [2.0]}, Strobe(1), x0={y: y + x})
    with pytest.raises(ValueError, match="`axes` has no state"):
        basins(system, {c: [2.0]}, Strobe(1), x0={x: 0.2, y: 0})


x_, v_ = sp.symbols("x v", real=True)
RATES = [
    ({x_: v_, v_: sp.Rational(3, 2) - sp.sin(x_) - v_ / 5}, 5.0, "running: x by 47.12 in 1 on average"),
    ({x_: v_, v_: sp.cos(t) / 4 - x_ - sp.sign(v_) - v_ / 5}, 0.0, "rest"),
    ({x_: v_, v_: x_ - x_**3 - v_ / 4 + sp.cos(t) * 2 / 5}, 0.0, "chaotic"),
    ({x_: v_, v_: -x_ - v_ / 5 + sp.cos(t)}, 0.0, "orbit of period 1"),
]


@pytest.mark.parametrize("rates, speed, kind", RATES, ids=[kind.split(":")[0] for *_, kind in RATES])
def test_what_a_start_comes_to_has_its_name(rates, speed, kind):
    found = basins(System(rates, time=t), {x_: [0.2], v_: [speed]}, Strobe(2 * sp.pi), transient=60)
    assert found.kinds.shape == (1, 1) and found.kinds[0, 0].startswith(kind)


@pytest.mark.parametrize("loss", [v_ / 5, sp.sign(v_) / 5, v_**3], ids=["spiral", "dry", "slow spiral"])
def test_what_comes_to_rest_before_its_section_is_no_orbit(loss):
    found = basins(
        System({x_: v_, v_: -x_ - loss}), {x_: [1.0, 2.0]}, seen=Return(v_), x0={v_: 0}, transient=20
    )
    assert (found.labels == UNSETTLED).all() and not found.attractors
    assert found.kinds.tolist() == ["rest"] * 2


@pytest.mark.parametrize("size, time", [(1, 1), (1e-6, 1), (1e6, 1), (1, 1e-6), (1, 1e6)])
def test_basins_are_the_same_in_any_unit(size, time):
    # Two wells, driven: both orbits attract.
    U, W = sp.symbols("U W", positive=True)
    rates = {x_: v_ / W, v_: (x_ - x_**3 / U**2 - v_ / 4 + U * sp.cos(t / W) / 5) / W}
    wells = System(rates, time=t, parameters={U: size, W: time})
    grid = {x_: np.array([-1.5, -0.75, 0.75, 1.4]) * size, v_: np.array([-0.7, 0.1]) * size}
    found = basins(wells, grid, Strobe(2 * sp.pi * W), transient=60)
    ends = sorted(orbit.x[0] / size for orbit in found.attractors)
    assert (found.labels >= 0).all() and ends == pytest.approx([-0.790050635, 1.197065362], abs=1e-8)


@pytest.mark.parametrize("phase", [0.0, 0.25])
def test_exponents_of_an_orbit_diagram_begin_at_its_phase(phase):
    # x' = (cos t - a) x + sin t: over half a period from t0 the mean of cos t - a is -a - 2 sin(t0)/pi.
    system = System({x: (sp.cos(t) - c) * x + sp.sin(t)}, time=t, parameters={c: 0.5})
    shown = orbit_diagram(system, c, [0.5, 1.0], {x: 0.3}, Strobe(2 * sp.pi, phase=phase), transient=5, keep=1)
    exact = [-a - 2 * math.sin(2 * math.pi * phase) / math.pi for a in (0.5, 1.0)]
    assert shown.exponents(math.pi)[:, 0] == pytest.approx(exact, abs=1e-8)
