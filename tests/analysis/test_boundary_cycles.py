"""Cycles that are born at boundary equilibria of planar systems, against their piecewise-linear motion.

Guards: analysis/equilibria/boundary_cycles.py.
"""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Return, System, find_orbit, follow
from pwsmooth.analysis.equilibria import equilibria

x, y, a, g = sp.symbols("x y a g", real=True)


def focus(growth, time=1):
    """A focus at (0, a) above y = 0 with eigenvalues growth +- i; below, the motion goes up at the speed 1."""
    return System(
        {x: time * sp.Piecewise((g * x - (y - a), y > 0), (0, True)),
         y: time * sp.Piecewise((x + g * (y - a), y > 0), (1, True))},
        parameters={a: 0.5, g: growth},
    )  # fmt: skip


def boundary(system):
    (regular,) = (e for e in equilibria(system, {x: (-3, 3), y: (-3, 3)}) if e.kind == "regular")
    return next(b for b in follow(regular, {a: -0.5}).specials if b.kind.startswith("boundary"))


def lands_before_rest(growth):
    """In closed form: whether the turn from the fold (growth, 0) about (0, 1) lands right of the pseudo-equilibrium.

    x + i (y - 1) = (growth - i) exp((growth + i) t); with no drift sliding is x' = growth x + 1, at rest at -1/growth.
    """
    t = np.linspace(1e-6, 2 * math.pi, 400001)
    path = (growth - 1j) * np.exp((growth + 1j) * t)
    k = np.flatnonzero((path.imag[:-1] > -1) & (path.imag[1:] <= -1))[0]
    return path.real[k] > -1 / growth


@pytest.mark.parametrize("growth", [0.05, 0.15, 0.2, 0.25, 0.3, 0.6])
def test_a_sliding_cycle_is_born_if_the_turn_lands_before_the_pseudo_equilibrium(growth):
    found = boundary(focus(growth))
    assert found.parameter == pytest.approx(0, abs=1e-9)
    assert found.cycle == ("attracting" if lands_before_rest(growth) else "")
    assert ("with an attracting cycle" if lands_before_rest(growth) else "without a cycle") in str(found)


def test_both_answers_occur():
    assert lands_before_rest(0.05) and not lands_before_rest(0.6)


def test_the_cycle_that_is_told_of_is_there_and_shrinks_in_proportion():
    system = focus(0.1)
    assert boundary(system).cycle == "attracting"
    sizes = []
    for value in (0.4, 0.1):
        cycle = find_orbit(
            system.with_parameters({a: value}), {x: 0, y: 2 * value}, seen=Return(y - value, direction=-1), transient=20
        )  # fmt: skip
        assert cycle.success and cycle.stable and any(kind == "stick" for _, kind, _ in cycle.word)
        sizes.append(np.abs(cycle.x[0]) / value)
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-8)  # the motion scales


def test_a_stable_focus_has_no_cycle_and_backward_in_time_a_repelling_one():
    assert boundary(focus(-0.1)).cycle == ""
    assert boundary(focus(0.1, time=-1)).cycle == "repelling"


def test_a_node_and_other_states_beside_are_not_taken_for_foci():
    node = System(
        {x: sp.Piecewise((2 * x, y > 0), (0, True)), y: sp.Piecewise((y - a, y > 0), (1, True))},
        parameters={a: 0.5},
    )
    assert boundary(node).cycle == ""
    z = sp.Symbol("z", real=True)
    more = System(
        {x: sp.Piecewise((x / 10 - (y - a), y > 0), (0, True)), y: sp.Piecewise((x + (y - a) / 10, y > 0), (1, True)),
         z: -z}, parameters={a: 0.5},
    )  # fmt: skip
    (regular,) = (e for e in equilibria(more, {x: (-3, 3), y: (-3, 3), z: (-1, 1)}) if e.kind == "regular")
    found = next(b for b in follow(regular, {a: -0.5}).specials if b.kind.startswith("boundary"))
    assert found.cycle is None
