"""Curves of bifurcations in two parameters against closed forms."""

import math

import numpy as np
import pytest
import sympy as sp
from test_continuation import a, b, t, u, x

from pwsmooth import Event, System, find_orbit, follow, follow_curve

# Orbits are known to 1e-11 and multipliers to some digits less; the issue asks for this.
ON_CURVE = 1e-9


def map_in_two(update, start, values):
    """As `mapped`, over a and b."""
    system = System(
        {s: 0 * s for s in update}, time=t, parameters=dict(zip((a, b), values)),
        events=[Event(every=1, update=update)],
    )  # fmt: skip
    return find_orbit(system, start, period=1, phase=0.5)


def only(branch, kind):
    return branch.of_kind(kind)[0]


# ---- smooth ones


def test_flips_of_the_logistic_map_lie_on_their_curve():
    # x -> a x (1 - x) - b x, fixed at 1 - (1 + b)/a with the multiplier 2 - a + b
    orbit = map_in_two({x: a * x * (1 - x) - b * x}, {x: 0.6}, (2.8, 0))
    curve = follow_curve(only(follow(orbit, a, to=3.3), "flip"), {a: (1, 5), b: (-1, 1)})
    p, q = curve.values
    assert np.abs(p - q - 3).max() < ON_CURVE
    assert curve.ends == ("reached b = -1.", "reached b = 1.")


def test_flips_and_folds_of_henons_map_lie_on_their_curves_with_both_strong_resonances():
    # x -> 1 - a x^2 + y, y -> b x: 4 a = 3 (1 - b)^2 and 4 a = -(1 - b)^2; the determinant is -b
    orbit = map_in_two({x: 1 - a * x**2 + u, u: b * x}, {x: 0.6, u: 0.2}, (0.1, 0.3))
    ranges = {a: (-3, 5), b: (-1.5, 0.6)}
    flips = follow_curve(only(follow(orbit, a, to=0.6), "flip"), ranges)
    folds = follow_curve(only(follow(orbit, a, to=-0.3, most=60), "fold"), ranges)
    for curve, factor, name in ((flips, 3, "1:2 resonance"), (folds, -1, "1:1 resonance")):
        p, q = curve.values
        assert len(p) > 20 and np.abs(4 * p - factor * (1 - q) ** 2).max() < 4 * ON_CURVE
        (double,) = curve.points
        assert double.name == name and list(double.values.values()) == pytest.approx([factor, -1], abs=1e-8)


def test_a_fold_goes_around_its_cusp():
    # x -> a + b x - x^3: 27 a^2 = 4 (b - 1)^3
    orbit = map_in_two({x: a + b * x - x**3}, {x: 1.2}, (0.5, 1.8))
    curve = follow_curve(only(follow(orbit, a, to=-1), "fold"), {a: (-1, 1), b: (0, 2)})
    p, q = curve.values
    assert np.abs(27 * p**2 - 4 * (q - 1) ** 3).max() < ON_CURVE
    assert p.min() < -0.3 and p.max() > 0.3
    (cusp,) = curve.points
    assert cusp.name == "cusp" and list(cusp.values.values()) == pytest.approx([0, 1], abs=1e-8)


def test_resonances_of_a_torus_are_where_the_trace_says():
    # (x, u) -> (a x - b u - x^3, x): fixed at 0 with trace a and determinant b, so the torus is b = 1.
    orbit = map_in_two({x: a * x - b * u - x**3, u: x}, {x: 0.0, u: 0.0}, (0.3, 0.8))
    curve = follow_curve(only(follow(orbit, b, to=1.2), "torus"), {a: (-3, 3), b: (0, 2)})
    assert np.abs(curve.values[1] - 1).max() < ON_CURVE
    assert {p.name: p.values["a"] for p in curve.points} == pytest.approx(
        {"1:1 resonance": 2, "1:2 resonance": -2, "1:3 resonance": -1, "1:4 resonance": 0}, abs=1e-8
    )
    assert all("no torus is born" in end for end in curve.ends)


def test_a_fold_meets_a_flip():
    # Two maps that do not know of each other: fold at a = 0, flip at b = 3.
    orbit = map_in_two({x: a + x - x**2, u: (b + a) * u * (1 - u)}, {x: 0.9, u: 0.6}, (0.8, 2.0))
    fold = only(follow(orbit, a, to=-0.2), "fold")
    curve = follow_curve(fold, {a: (-1, 1), b: (1.5, 3.5)})
    (both,) = curve.of_kind("fold + flip")
    assert both.values["b"] == pytest.approx(3, abs=1e-8) and both.values["a"] == pytest.approx(0, abs=1e-9)


def test_branch_points_that_a_symmetry_keeps_are_followed():
    # x -> x + (a + b) x - x^3
    orbit = map_in_two({x: x + (a + b) * x - x**3}, {x: 0.0}, (-0.5, 0))
    curve = follow_curve(only(follow(orbit, a, to=0.5), "branch point"), {a: (-1, 1), b: (-1, 1)})
    assert len(curve.orbits) > 20 and np.abs(curve.values.sum(axis=0)).max() < ON_CURVE


def test_a_closed_curve_closes():
    # flip where a^2 + b^2 = 1
    orbit = map_in_two({x: -(a**2 + b**2) * x + x**2}, {x: 0.0}, (0.8, 0.1))
    curve = follow_curve(only(follow(orbit, a, to=1.2), "flip"), {a: (-2, 2), b: (-2, 2)})
    assert curve.ends == ("it closes.",)
    assert np.abs(np.hypot(*curve.values) - 1).max() < ON_CURVE
    assert np.ptp(np.arctan2(*curve.values)) > 6


def test_an_orbit_near_to_a_flip_is_enough_with_its_kind():
    orbit = map_in_two(
        {x: a * x * (1 - x) - b * x}, {x: 0.6}, (2.95, 0)
    )  # fmt: skip
    curve = follow_curve(orbit, {a: (2, 5), b: (-1, 1)}, kind="flip")
    assert np.abs(curve.values[0] - curve.values[1] - 3).max() < ON_CURVE
    with pytest.raises(ValueError, match="`kind` is missing"):
        follow_curve(orbit, {a: (2, 5), b: (-1, 1)})
    with pytest.raises(ValueError, match="give two parameters"):
        follow_curve(orbit, {a: (2, 5)}, kind="flip")
    with pytest.raises(ValueError, match="leaves out the start"):
        follow_curve(orbit, {a: (2, 2.5), b: (-1, 1)}, kind="flip")


def test_the_symmetry_breaks_along_a_curve_that_branches_agree_with():
    from friction_oscillator import hidden, rho, sigma, v, y, z

    slaved = hidden().layered({z: sp.oo})
    orbit = find_orbit(slaved, {y: 0.78, v: -1.03}, period=2 * sp.pi, symmetry={y: -y, v: -v}, transient=50)
    broken = only(follow(orbit, sigma, to=3.4), "symmetry breaking")
    curve = follow_curve(broken, {rho: (1, 5), sigma: (1, 6)})
    assert len(curve.orbits) > 10
    for k in range(2, len(curve.orbits), 5):
        there = curve.orbits[k]
        at = curve.values[1, k]
        first = find_orbit(
            there.system.with_parameters({sigma: at - 0.01}), there.x, period=2 * sp.pi, phase=there.map.phase,
            symmetry={y: -y, v: -v},
        )  # fmt: skip
        (again,) = follow(first, sigma, to=at + 0.01).of_kind("symmetry breaking")
        assert again.parameter == pytest.approx(at, abs=ON_CURVE)


def test_bounds_are_kept_and_told():
    orbit = map_in_two({x: a * x * (1 - x) - b * x}, {x: 0.6}, (2.8, 0))
    flip = only(follow(orbit, a, to=3.3), "flip")
    curve = follow_curve(flip, {a: (2, 5), b: (-1, 1)}, max_steps=30)
    assert any("`max_steps`" in end for end in curve.ends)
    table = follow_curve(flip, {a: (2, 5), b: (-1, 1)}).to_dataframe()
    assert list(table)[:4] == ["a", "b", "x", "period"] and math.isclose(table["period"].iloc[0], 1)
