"""The unit of a state changes nothing of a branch: metres, micrometres, megametres.

Guards: analysis/continuation/.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Strobe, System, Unilateral, find_equilibrium, find_orbit, follow
from pwsmooth.analysis.continuation import branch_off, cycle_from

t, x, v, a, b = sp.symbols("t x v a b", real=True)
U = sp.Symbol("U", positive=True)
UNITS = pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
# The zero of a tangent or a multiplier is found to 1e-12 of the chord: a hundred of these.
LOCATED = 1e-10

QUADRATIC = System(
    {x: 0 * x},
    time=t,
    parameters={a: 0.5, b: 0.0, U: 1},
    events=[Event(every=1, update={x: U * (1 - a * (x / U) ** 2) + b * x})],
)


def at(unit, **start):
    system = QUADRATIC.with_parameters({U: unit, **{k: w for k, w in start.items() if k != "x"}})
    return find_orbit(system, {x: start["x"] * unit}, seen=Strobe(1, phase=0.5), transient=200)


@UNITS
def test_flips_and_the_branches_that_begin_there(unit):
    branch = follow(at(unit, x=0.6), {a: 1.3})
    (flip,) = branch.specials
    assert flip.kind == "flip" and flip.parameter == pytest.approx(0.75, abs=LOCATED)
    doubled = branch_off(flip, 0.01 * unit)
    assert doubled.success and doubled.system.parameters[a] - 0.75 == pytest.approx(5.6828e-05, rel=1e-3)
    (second,) = follow(doubled, {a: 1.3}).specials
    assert second.kind == "flip" and second.parameter == pytest.approx(1.25, abs=LOCATED)


@UNITS
def test_a_curve_of_flips(unit):
    # x = 1 - a x^2 + b x with the slope -1: 4 a = (1 + b) (3 - b)/... at b = 0 a = 3/4
    curve = follow(follow(at(unit, x=0.6), {a: 1}).specials[0], {a: (0.1, 2), b: (-0.5, 0.5)})
    p, q = curve.values
    assert len(p) > 10 and np.abs(4 * p - (1 + q) * (3 - q)).max() < 1e-8
    assert set(curve.ends) == {"reached b = -0.5.", "reached b = 0.5."}


@UNITS
def test_a_cycle_from_a_hopf_point(unit):
    r2 = (x**2 + v**2) / U**2
    ring = System({x: a * x - v - x * r2, v: x + a * v - v * r2}, parameters={a: -0.5, U: unit})
    (hopf,) = follow(find_equilibrium(ring, {x: 0.01 * unit, v: 0}), {a: 0.5}).specials
    cycle = cycle_from(hopf, 0.1 * unit)
    assert cycle.success and cycle.system.parameters[a] == pytest.approx(0.005, abs=1e-9)
    branch = follow(cycle, {a: 0.5})
    assert branch.end == "reached a = 0.5." and branch.specials == [] and len(branch.points) < 20
    assert abs(branch.x[0, -1]) == pytest.approx(unit * 0.5**0.5, rel=1e-9)


@UNITS
def test_folds_and_the_cusp_of_equilibria(unit):
    cubic = System({x: U * (a + b * (x / U) - (x / U) ** 3)}, parameters={a: 1, b: 1, U: unit})
    branch = follow(find_equilibrium(cubic, {x: 1.3 * unit}), {a: -1})
    assert [f.kind for f in branch.specials] == ["fold", "fold"]
    assert sorted(f.parameter for f in branch.specials) == pytest.approx(
        [-((4 / 27) ** 0.5), (4 / 27) ** 0.5], abs=LOCATED
    )
    curve = follow(branch.specials[0], {a: (-1, 1), b: (-1, 1)})
    assert [point.kind for point in curve.specials] == ["cusp"] and np.abs(
        27 * curve.values[0] ** 2 - 4 * curve.values[1] ** 3
    ).max() < 1e-8


@UNITS
def test_the_fold_of_an_impact_oscillator(unit):
    # The closed form of docs/from_continuation.md: 0.116443007
    stop = Unilateral(U - x, restitution=0.8, name="stop")
    hammer = System(
        {x: v, v: a * U * sp.cos(1.1 * t) - x - v / 10 - stop.reaction}, time=t, parameters={a: 0.13, U: unit}
    )
    orbit = find_orbit(hammer, {x: 0, v: 1.5 * unit}, seen=Strobe(2 * sp.pi / 1.1), transient=100)
    (fold,) = follow(orbit, {a: 0.1}).of_kind("fold")
    assert fold.parameter == pytest.approx(0.116443007, abs=1e-9)
