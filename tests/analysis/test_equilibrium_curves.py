"""Curves of bifurcations of equilibria in two parameters against closed forms.

Guards: analysis/continuation/equilibria/curves.py, analysis/continuation/equilibria/conditions.py,
analysis/continuation/equilibria/problem.py.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Switch, System, Unilateral, find_equilibrium, follow
from pwsmooth.analysis.continuation import Steps
from pwsmooth.analysis.equilibria import equilibria

ON_CURVE = 1e-9  # as for orbits, in test_curves.py
x, y, v = sp.symbols("x y v", real=True)
a, b = sp.symbols("a b", real=True)
PLANE = {a: (-2, 1), b: (-1, 2)}


def test_a_fold_goes_around_its_cusp():
    cubic = System({x: a + b * x - x**3}, parameters={a: 1, b: 1})
    fold = follow(find_equilibrium(cubic, {x: 1.3}), {a: -1}, steps=Steps(first=0.1)).of_kind("fold")[0]
    curve = follow(fold, {a: (-1, 1), b: (-1, 1)})
    p, q = curve.values
    assert len(p) > 20 and np.abs(27 * p**2 - 4 * q**3).max() < ON_CURVE
    (cusp,) = curve.specials
    assert cusp.kind == "cusp" and list(cusp.values.values()) == pytest.approx([0, 0], abs=1e-8)
    assert curve.ends == ("reached b = 1.", "reached b = 1.") and curve.to_dataframe().shape[0] == len(p)


def test_a_hopf_curve_and_a_fold_lead_to_each_other_at_bogdanov_and_takens_point():
    # Equilibria x = -+sqrt(-a), trace b + x: Hopf where a = -b^2, b > 0; fold where a = 0.
    system = System({x: y, y: a + b * y + x**2 + x * y}, parameters={a: -1, b: 0.5})
    branch = follow(find_equilibrium(system, {x: -1, y: 0}), {b: 2})
    hopf = follow(branch.of_kind("Hopf")[0], PLANE)
    assert np.abs(hopf.values[0] + hopf.values[1] ** 2).max() < ON_CURVE and hopf.values[1].min() > -ON_CURVE
    (point,) = hopf.specials
    assert point.kind == "Bogdanov-Takens" and point.begins == ("fold",)
    assert list(point.values.values()) == pytest.approx([0, 0], abs=1e-8)
    folds = follow(point, PLANE)
    assert folds.kind == "fold" and np.abs(folds.values[0]).max() < ON_CURVE and np.ptp(folds.values[1]) == 3
    other = follow(find_equilibrium(system.with_parameters({a: -0.5, b: 1.5}), {x: 0.7, y: 0}), {a: 0.5})
    again = follow(other.of_kind("fold")[0], PLANE).of_kind("Bogdanov-Takens")[0]
    assert again.begins == ("Hopf",) and list(again.values.values()) == pytest.approx([0, 0], abs=1e-8)
    back = follow(again, PLANE)
    assert back.kind == "Hopf" and back.values[1].min() > -ON_CURVE and back.values[1].max() > 1.4


def test_hopf_points_change_their_criticality_where_the_cubic_term_does():
    # r' = r (a + b r^2 - r^4)
    r2 = x**2 + y**2
    growth = a + b * r2 - r2**2
    system = System({x: x * growth - y, y: y * growth + x}, parameters={a: -0.1, b: 0.5})
    branch = follow(find_equilibrium(system, {x: 0, y: 0}), {a: 0.5})
    curve = follow(branch.of_kind("Hopf")[0], {a: (-1, 1), b: (-1, 1)})
    (point,) = curve.specials
    assert point.kind == "generalised Hopf" and np.abs(curve.values[0]).max() < ON_CURVE
    assert point.values["b"] == pytest.approx(0, abs=1e-8)


def test_boundary_equilibria_meet_the_fold_where_it_crosses_the_surface():
    # x' = a - x^2 above x = b: sqrt(a) meets b where a = b^2, b > 0, and the fold a = 0 meets it at b = 0.
    system = System({x: sp.Piecewise((a - x**2, x > b), (5, True)), y: -y}, parameters={a: 0.5, b: 0.2})
    (regular,) = (e for e in equilibria(system, {x: (-3, 3), y: (-1, 1)}) if e.kind == "regular")
    ranges = {a: (-1, 2), b: (-1, 1)}
    curve = follow(regular, ranges, kind="boundary equilibrium")
    p, q = curve.values
    assert len(p) > 20 and np.abs(p - q**2).max() < ON_CURVE and np.ptp(q) == 2
    (meet,) = curve.of_kind("boundary equilibrium + fold")
    assert meet.begins == ("fold",) and list(meet.values.values()) == pytest.approx([0, 0], abs=1e-8)
    folds = follow(meet, ranges)
    # x = 0 lies above the surface where b < 0.
    assert (
        np.abs(folds.values[0]).max() < ON_CURVE
        and folds.values[1].max() < 1e-8
        and folds.values[1].min() == -1
    )
    assert folds.ends[0].startswith("it begins") or folds.ends[1].startswith("it begins")


def test_a_fold_ends_where_it_comes_to_a_surface():
    system = System({x: sp.Piecewise((a - x**2, x > b), (5, True)), y: -y}, parameters={a: 0.5, b: -0.5})
    (regular,) = (e for e in equilibria(system, {x: (0.1, 3), y: (-1, 1)}) if e.kind == "regular")
    folds = follow(follow(regular, {a: -1}).of_kind("fold")[0], {a: (-1, 2), b: (-1, 1)})
    (end,) = folds.specials
    assert end.kind == "fold + boundary equilibrium" and end.begins == ("boundary equilibrium",)
    assert list(end.values.values()) == pytest.approx([0, 0], abs=1e-8) and folds.admissible.all()
    border = follow(end, {a: (-1, 2), b: (-1, 1)})
    assert np.abs(border.values[0] - border.values[1] ** 2).max() < ON_CURVE


def test_a_hidden_fold_is_followed_over_the_strength_of_static_friction():
    # mu = lam (1 + b (1 - lam^2)) has the maximum 2 b ((1 + b)/(3 b))^(3/2), and its fold reaches lam = 1 at b = 1/2.
    lam = Switch("lam", v)
    pulled = System({v: a - lam * (1 + b * (1 - lam**2)) - v / 10}, parameters={a: 1.2, b: 3})
    branch = follow(find_equilibrium(pulled, {v: 0, "lam": 0.3}), {a: 2.5})
    curve = follow(branch.of_kind("hidden fold")[0], {a: (0, 3), b: (0.1, 5)})
    p, q = curve.values
    assert len(p) > 10 and np.abs(p - 2 * q * ((1 + q) / (3 * q)) ** 1.5).max() < ON_CURVE
    (end,) = curve.of_kind("hidden fold + boundary equilibrium")
    assert list(end.values.values()) == pytest.approx([1, 0.5], abs=1e-8)


def test_a_contact_opens_along_the_line_of_its_reaction():
    # A weight on a spring, pulled by a: it leaves the floor where a = 2 b.
    floor = Unilateral(y, restitution=0.5, name="R")
    system = System({y: v, v: a - 2 * b - y - v / 5 + floor.reaction}, parameters={a: 0.5, b: 1})
    rest = find_equilibrium(system, {y: 0, v: 0})
    curve = follow(rest, {a: (0, 3), b: (0.5, 1.2)}, kind="boundary equilibrium")
    assert len(curve.points) > 5 and np.abs(curve.values[0] - 2 * curve.values[1]).max() < ON_CURVE


def test_hopf_points_of_the_relief_valve_are_followed():
    # The valve of issue 18 at k = 1.25: q = 8.491117635183327.
    y1, y2, y3 = sp.symbols("y1 y2 y3", real=True)
    q, k = sp.symbols("q k", positive=True)
    valve = System(
        {y1: y2, y2: -k * y2 - (y1 + 10) + y3, y3: 20 * (q - y1 * sp.sqrt(y3))}, parameters={q: 9, k: 1.25}
    )
    (hopf,) = follow(find_equilibrium(valve, {y1: 2.5, y2: 0, y3: 12}), {q: 8}).specials
    curve = follow(hopf, {q: (3, 12), k: (0.8, 1.6)})
    at = [follow(hopf, {q: (3, 12), k: pair}) for pair in ((1.25, 1.6), (1.0, 1.25))]
    assert min(abs(c.values[0, j] - 8.491117635183327) for c in at for j in (0, -1)) < 1e-9

    def trace_condition(y, damping):
        # x^3 + c2 x^2 + c1 x + c0 of the Jacobian at (y, 0, y + 10): a pair on the axis where c2 c1 = c0
        r = np.sqrt(y + 10)
        c = 10 * y / r
        return (damping + c) * (1 + damping * c) - (c + 20 * r)

    for p, damping in curve.values.T[::5]:
        roots = np.roots([1, 10, 0, -(p**2)])  # y^2 (y + 10) = q^2
        y = roots[(abs(roots.imag) < 1e-9) & (roots.real > 0)].real[0]
        assert trace_condition(y, damping) == pytest.approx(0, abs=1e-7)


def test_a_start_that_is_followed_nowhere_says_what_is():
    system = System({x: a + b * x - x**3}, parameters={a: 1, b: 1})
    rest = find_equilibrium(system, {x: 1.3})
    with pytest.raises(ValueError, match="`kind` is missing: `start` is an equilibrium"):
        follow(rest, {a: (-1, 1), b: (-1, 1)})
    with pytest.raises(ValueError, match="no switch or contact"):
        follow(rest, {a: (-1, 1), b: (-1, 1)}, kind="boundary equilibrium")
