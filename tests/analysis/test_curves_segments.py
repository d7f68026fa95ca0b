"""Curves of orbits whose deviations grow by more than a period can be shot over, against closed forms.

To each system a state y' = K (y - x) is added that nothing depends on: its multiplier is exp(K T), the others and the
curves are those of the system alone.
"""

import math

import numpy as np
import pytest
import sympy as sp
from test_continuation import a, b, t, u, x

from pwsmooth import Event, Strobe, System, Unilateral, find_orbit, follow

K = 25  # exp(25) = 7.2e10 over a period of 1
ON_CURVE = 1e-9  # as in test_curves.py
y = sp.Symbol("y", real=True)
A, w, F = sp.symbols("A w F", positive=True)


def mapped(update, start, values):
    """A map over a and b, beside a state that grows."""
    system = System(
        {**{s: 0 * s for s in update}, y: K * (y - x)}, time=t, parameters=dict(zip((a, b), values)),
        events=[Event(every=1, update=update)],
    )  # fmt: skip
    return find_orbit(system, {**start, y: start[x]}, seen=Strobe(1, phase=0.5))


def grown(curve, rate):
    """The least of the largest multipliers, each over exp(rate * period)."""
    return min(abs(orbit.multipliers).max() / math.exp(rate * orbit.period) for orbit in curve.points)


@pytest.mark.parametrize(
    "update, start, values, kind, to, ranges, exact",
    [
        ({x: a * x * (1 - x) - b * x}, {x: 0.6}, (2.8, 0), "flip", {a: 3.3}, {a: (1, 5), b: (-1, 1)},
         lambda p, q: p - q - 3),
        ({x: a + b * x - x**3}, {x: 1.2}, (0.5, 1.8), "fold", {a: -1}, {a: (-1, 1), b: (0, 2)},
         lambda p, q: 27 * p**2 - 4 * (q - 1) ** 3),
        ({x: a * x - b * u - x**3, u: x}, {x: 0.0, u: 0.0}, (0.3, 0.8), "torus", {b: 1.2}, {a: (-3, 3), b: (0, 2)},
         lambda p, q: q - 1),
        ({x: x + (a + b) * x - x**3}, {x: 0.0}, (-0.5, 0), "branch point", {a: 0.5}, {a: (-1, 1), b: (-1, 1)},
         lambda p, q: p + q),
    ],
)  # fmt: skip
def test_smooth_curves_go_on_beside_a_multiplier_of_1e11(update, start, values, kind, to, ranges, exact):
    found = follow(mapped(update, start, values), to).of_kind(kind)[0]
    curve = follow(found, ranges)
    assert len(curve.points) > 20 and np.abs(exact(*curve.values)).max() < ON_CURVE
    assert grown(curve, K) == pytest.approx(1, rel=1e-6)


def test_strong_resonances_are_found_beside_a_multiplier_of_1e11():
    # The determinant of Henon's map is -b: 4 a = 3 (1 - b)^2 meets it at a = 3, and the test function is its own.
    orbit = mapped({x: 1 - a * x**2 + u, u: b * x}, {x: 0.36, u: -0.32}, (2.5, -0.9))
    flips = follow(follow(orbit, {a: 2.9}).of_kind("flip")[0], {a: (2, 4), b: (-1.1, -0.8)})
    (double,) = flips.specials
    assert double.kind == "1:2 resonance" and list(double.values.values()) == pytest.approx([3, -1], abs=1e-8)


@pytest.mark.thorough
def test_a_stop_is_grazed_by_an_orbit_with_multipliers_up_to_1e19():
    stop = Unilateral(1 - x, restitution=sp.Rational(4, 5), name="stop")
    system = System(
        {x: u, u: A * sp.cos(w * t) - u / 10 - x - stop.reaction, y: 4 * (y - x)}, time=t,
        parameters={A: 0.7, w: 1.4},
    )  # fmt: skip
    orbit = find_orbit(system, {x: -0.5, u: 0, y: -0.5}, seen=Strobe(2 * sp.pi / w))
    curve = follow(orbit, {w: (0.55, 3), A: (0, 10)}, kind="grazing impact")
    frequency, amplitude = curve.values
    assert curve.ends == ("reached w = 0.55.", "reached w = 3.")
    assert np.abs(amplitude - np.sqrt((1 - frequency**2) ** 2 + frequency**2 / 100)).max() < ON_CURVE
    assert max(abs(orbit.multipliers).max() for orbit in curve.points) > 1e19


def test_den_hartogs_line_is_followed_beside_multipliers_of_1e11_and_more():
    def limit(frequency):
        U = np.tan(math.pi / (2 * frequency)) / frequency
        return np.abs(1 / (1 - frequency**2)) / np.sqrt(U**2 + frequency**-4.0)  # den Hartog (1931)

    system = System(
        {x: u, u: sp.sin(w * t) - x - F * sp.sign(u), y: 4 * (y - x)}, time=t,
        parameters={w: 0.7, F: 0.8 * limit(0.7)},
    )  # fmt: skip
    orbit = find_orbit(
        system, {x: 1, u: 0.5, y: 1}, seen=Strobe(2 * sp.pi / w, symmetry={x: -x, u: -u, y: -y})
    )  # fmt: skip
    begins = follow(orbit, {F: 1.1 * limit(0.7)}).of_kind("crossing-sliding")[0]
    curve = follow(begins, {w: (0.52, 0.98), F: (0.01, 2)})
    assert len(curve.points) > 20
    assert np.abs(curve.values[1] - limit(curve.values[0])).max() < ON_CURVE
    assert (
        not curve.specials
    )  # a pair with the product 1 is no torus where it is real, as exp(4 T) and another one here


@pytest.mark.parametrize(
    "kind, force, to, exact",
    [
        ("grazing-sliding", b + a * sp.sin(t), 2.0, lambda q: math.sqrt(2) * q),
        ("adding-sliding", b * sp.cos(t) + a * sp.cos(2 * t), 1.2, lambda q: q),
    ],
)
def test_sticks_are_born_and_parted_along_the_exact_lines_beside_a_multiplier_of_1e11(kind, force, to, exact):
    # As in test_curves.py, where the lines are derived.
    system = System(
        {x: sp.Piecewise((force - x, x > 0), (5, True)), y: 4 * (y - x)}, time=t, parameters={a: 0.8, b: 1}
    )
    orbit = find_orbit(system, {x: 0.5, y: 0.5}, seen=Strobe(2 * sp.pi))
    curve = follow(follow(orbit, {a: to}).of_kind(kind)[0], {a: (0.2, 5), b: (0.5, 2)})
    p, q = curve.values
    assert len(p) > 20 and np.ptp(q) == 1.5
    assert np.abs(p - exact(q)).max() < ON_CURVE
    assert grown(curve, 4) == pytest.approx(1, rel=1e-6)


def test_folds_from_impact_to_impact_go_over_to_segments_where_deviations_grow():
    # exp(2 T) passes 1e4 on the way: the unknowns are the impact's own before, the points of segments behind it.
    from test_curves import fold_amplitude, grazing_amplitude, one_impact

    (m0, m1), M = one_impact(1.4)
    speed = 1.3 * m0 / (m0**2 + (0.8 + m1) ** 2 / 1.4**2)
    angle = math.atan2((0.8 + m1) * speed / 1.4, 1 - speed * m0)
    amplitude = math.hypot(1 - speed * m0, (0.8 + m1) * speed / 1.4) * grazing_amplitude(1.4)
    at = (angle + math.atan2(0.1 * 1.4, 1 - 1.4**2)) / 1.4
    stop = Unilateral(1 - x, restitution=sp.Rational(4, 5), name="stop")
    system = System(
        {x: u, u: A * sp.cos(w * t) - u / 10 - x - stop.reaction, y: 2 * (y - x)}, time=t,
        parameters={A: amplitude, w: 1.4},
    )  # fmt: skip
    # Just behind the impact, where the motion is that of a speed of 0.8 times the incoming one.
    phase = at * 1.4 / 2 / math.pi
    orbit = find_orbit(
        system, {x: 1 - 1e-12, u: -0.8 * speed, y: 0}, seen=Strobe(2 * sp.pi / w, phase=phase + 1e-9)
    )
    fold = follow(orbit, {A: 0.2}).of_kind("fold")[0]
    curve = follow(fold, {w: (1.3, 1.45), A: (0, 10)})
    cut = [one.segments is not None for one in curve.points]
    assert any(cut) and not all(cut)
    assert max(abs(p - fold_amplitude(q)) for q, p in curve.values.T) < ON_CURVE
