"""Points of codimension 2 and the curves that begin there, against closed forms.

Guards: analysis/continuation/special.py, analysis/continuation/curves/emanating.py,
analysis/continuation/curves/starts.py.
"""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import fsolve
from test_continuation import a, b, u, x
from test_curves import (
    DAMPED,
    ON_CURVE,
    A,
    fold_amplitude,
    grazing_amplitude,
    hammer,
    map_in_two,
    only,
    symmetric,
    w,
)

from pwsmooth import Strobe, find_orbit, follow


def test_a_fold_of_the_doubled_orbit_begins_at_the_degenerate_flip():
    # x -> -((1 + a) x - b x^3 + x^5) has 2-cycles +-x where a - b x^2 + x^4 = 0, with a fold where a = b^2/4, b > 0.
    orbit = map_in_two({x: -(1 + a) * x + b * x**3 - x**5}, {x: 0.0}, (-0.1, 0.5))
    ranges = {a: (-1, 1), b: (-2, 2)}
    flips = follow(orbit, ranges, kind="flip")
    (point,) = flips.specials
    assert point.kind == "degenerate flip" and point.begins == ("fold",)
    assert list(point.values.values()) == pytest.approx([0, 0], abs=1e-8)
    folds = follow(point, ranges)
    p, q = folds.values
    assert len(p) > 10 and q.min() < 0.05 and q.max() == 2
    assert np.abs(4 * p - q**2).max() < ON_CURVE
    assert folds.ends[0].startswith("it begins near")


def test_quadratic_terms_count_in_the_flips_normal_form():
    # x -> -(1 + a) x + b x^2 - x^3: at a = 0 the coefficient is b^2 - 1.
    orbit = map_in_two({x: -(1 + a) * x + b * x**2 - x**3}, {x: 0.0}, (-0.1, 0.3))
    ranges = {a: (-0.5, 0.5), b: (-2, 2)}
    flips = follow(orbit, ranges, kind="flip")
    assert [p.kind for p in flips.specials] == ["degenerate flip"] * 2
    assert sorted(p.values["b"] for p in flips.specials) == pytest.approx([-1, 1], abs=1e-8)
    folds = follow(flips.specials[0], ranges)

    def two_cycle(unknown, at):
        y, z, p = unknown  # y -> z -> y, with the product of the slopes 1
        f, df = (lambda s: -(1 + p) * s + at * s**2 - s**3), (lambda s: -(1 + p) + 2 * at * s - 3 * s**2)
        return f(y) - z, f(z) - y, df(y) * df(z) - 1

    for k in range(3, len(folds.points), 5):
        p, q = folds.values[:, k]
        y = folds.x[0, k]
        z = -(1 + p) * y + q * y**2 - y**3
        assert fsolve(two_cycle, [y, z, p * 1.001], args=(q,), xtol=1e-12)[2] == pytest.approx(p, abs=ON_CURVE)


def test_a_torus_begins_at_either_strong_resonance():
    # Henon's map with the determinant -b = 1, from a = -1 (resonance 1:1) to a = 3 (1:2).
    update, ranges = {x: 1 - a * x**2 + u, u: b * x}, {a: (-2, 4), b: (-1.1, -0.8)}
    near = (
        map_in_two(update, {x: 0.36, u: -0.32}, (2.5, -0.9)),
        map_in_two(update, {x: 0.63, u: -0.57}, (-0.5, -0.9)),
    )
    flips = follow(only(follow(near[0], {a: 2.9}), "flip"), ranges)
    folds = follow(only(follow(near[1], {a: -0.95}), "fold"), ranges)
    for curve, back in ((flips, "flip"), (folds, "fold")):
        (double,) = curve.specials
        assert double.begins == ("torus",)
        torus = follow(double, ranges)
        p, q = torus.values
        assert np.abs(q + 1).max() < ON_CURVE and [p.min(), p.max()] == pytest.approx([-1, 3], abs=1e-8)
        assert any(end.startswith("it begins at") for end in torus.ends)
        (other,) = (point for point in torus.specials if point.begins)
        assert other.begins == ({"flip": "fold", "fold": "flip"}[back],)
    assert {point.kind: point.values["a"] for point in torus.specials} == pytest.approx(
        {"1:2 resonance": 3, "1:3 resonance": 1.25, "1:4 resonance": 0}, abs=1e-8
    )


def test_a_flip_passes_where_a_fold_meets_it():
    orbit = map_in_two({x: a + x - x**2, u: (b + a) * u * (1 - u)}, {x: 0.9, u: 0.6}, (0.8, 2.0))
    ranges = {a: (-1, 1), b: (1.5, 3.5)}
    folds = follow(only(follow(orbit, {a: -0.2}), "fold"), ranges)
    flips = follow(folds.of_kind("fold + flip")[0], ranges)
    p, q = flips.values  # with a + b = 3, while the fixed point x = sqrt(a) exists
    assert np.abs(p + q - 3).max() < ON_CURVE and p.max() > 0.5


@pytest.mark.thorough
def test_folds_of_impacting_orbits_begin_at_degenerate_grazing_and_lead_back():
    ranges = {w: (0.55, 3), A: (0, 10)}
    quiet = hammer.with_parameters({A: 0.8 * grazing_amplitude(1.4)})
    orbit = find_orbit(quiet, {x: -0.5, u: 0}, seen=Strobe(2 * sp.pi / w))
    grazing = follow(orbit, ranges, kind="grazing impact")
    third, second, first = grazing.of_kind("degenerate grazing")
    assert all(point.begins == ("fold",) for point in grazing.specials)
    short, long = follow(third, ranges), follow(second, ranges)
    for folds in (short, long):
        assert len(folds.points) > 10 and folds.admissible.all()
        assert max(abs(p - fold_amplitude(q)) for q, p in folds.values.T) < ON_CURVE
    (end,) = long.specials
    assert end.kind == "fold + grazing impact" and end.begins == ("grazing impact",)
    assert list(end.values.values()) == pytest.approx(list(first.values.values()), abs=1e-7)
    again = follow(end, ranges)
    frequency, amplitude = again.values
    assert np.ptp(frequency) == pytest.approx(2.45)
    assert np.abs(amplitude - grazing_amplitude(frequency)).max() < 1e-10
    assert DAMPED * 2 == pytest.approx(end.values["w"], abs=ON_CURVE)


@pytest.fixture(scope="module")
def grazing():
    quiet = hammer.with_parameters({A: 0.8 * grazing_amplitude(1.4)})
    orbit = find_orbit(quiet, {x: -0.5, u: 0}, seen=Strobe(2 * sp.pi / w))
    return follow(orbit, {w: (0.55, 3), A: (0, 10)}, kind="grazing impact")


def test_grazing_is_degenerate_for_several_periods_where_the_free_motion_is_back_in_phase(grazing):
    # m0 of m periods is sin(m T damped frequency) but for a factor: 0 at 2 m/n of the damped frequency.
    for m in (2, 3):
        found = [point.values["w"] for point in grazing.of_kind(f"degenerate grazing, period {m}")]
        exact = [2 * m * DAMPED / n for n in range(1, 30) if n % m and 0.55 < 2 * m * DAMPED / n < 3]
        assert found == pytest.approx(exact[::-1], abs=ON_CURVE)


@pytest.mark.parametrize("m, n", [(2, 5), (3, 7)])
def test_folds_of_orbits_with_one_impact_in_several_periods_begin_there(grazing, m, n):
    points = grazing.of_kind(f"degenerate grazing, period {m}")
    point = min(points, key=lambda one: abs(one.values["w"] - 2 * m * DAMPED / n))
    folds = follow(point, {w: (0.55, 3), A: (0, 10)})
    assert len(folds.points) > 20 and folds.admissible.all()
    assert max(abs(p - fold_amplitude(q, m)) for q, p in folds.values.T) < ON_CURVE
    # Of their orbits the exact map is the one of m periods, with one impact in all.
    middle = folds.points[len(folds.points) // 2]
    assert middle.map.count == m and [kind for _, kind, _ in middle.word] == ["impact"]


@pytest.fixture(scope="module")
def slaved():
    """(system, ranges, curve of symmetry breaking) of the friction oscillator with a slaved hidden term."""
    from friction_oscillator import hidden, z

    system, ranges = hidden().layered({z: sp.oo}), {"rho": (0, 6), "sigma": (1, 6)}
    first = only(follow(symmetric(system), {"sigma": 3.4}), "symmetry breaking")
    return system, ranges, follow(first, ranges)


def test_each_of_two_curves_of_the_friction_oscillator_leads_to_the_other(slaved):
    system, ranges, broken = slaved
    (one,) = broken.of_kind("symmetry breaking + crossing-sliding")
    crossed = follow(one, ranges)
    (other,) = follow(only(follow(symmetric(system), {"rho": 0.3}), "crossing-sliding"), ranges).specials
    assert crossed.kind == "crossing-sliding" and np.ptp(crossed.values[1, crossed.values[0] < 0.5]) < ON_CURVE
    back = follow(other, ranges)
    assert back.kind == "symmetry breaking"
    end = back.of_kind("symmetry breaking + crossing-sliding")[0]
    assert list(end.values.values()) == pytest.approx(list(one.values.values()), abs=2e-9)


def test_asymmetric_orbits_of_the_friction_oscillator_fold_from_a_degenerate_symmetry_breaking_on(slaved):
    _, ranges, broken = slaved
    (point,) = broken.of_kind("degenerate symmetry breaking")
    folds = follow(point, ranges)
    assert len(folds.points) > 5
    # An independent route: branches of asymmetric orbits over sigma turn there.
    k = len(folds.points) // 2
    middle = folds.points[k]
    assert not middle.symmetric and abs(middle.multipliers - 1).min() < 1e-8
    rho_, sigma_ = folds.values[:, k]
    start = only_asymmetric(middle, sigma_)
    turns = [
        f.parameter for to in (sigma_ - 0.2, sigma_ + 0.2) for f in follow(start, {"sigma": to}).of_kind("fold")
    ]
    assert min(abs(turn - sigma_) for turn in turns) < 1e-8


def only_asymmetric(orbit, value):
    """The asymmetric orbit beside a fold, on the side on which there is one."""
    from pwsmooth.analysis.orbits.finding import refine

    for off in (1e-3, -1e-3):
        found = refine(orbit.map.with_parameters({"sigma": value + off}), orbit.x)
        if found.success and np.abs(found.x - orbit.x).max() < 0.2:
            half = found.map.over(found.x, found.period / 2).x[:, -1]
            if np.abs(half + found.x).max() > 1e-3:
                return found
    raise AssertionError("no asymmetric orbit beside the fold")


def test_a_point_at_which_nothing_begins_says_so():
    orbit = map_in_two({x: a + b * x - x**3}, {x: 1.2}, (0.5, 1.8))
    ranges = {a: (-1, 1), b: (0, 2)}
    (cusp,) = follow(only(follow(orbit, {a: -1}), "fold"), ranges).specials
    assert cusp.begins == ()
    with pytest.raises(ValueError, match="at which no other curve begins"):
        follow(cusp, ranges)
