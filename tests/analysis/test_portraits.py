"""Portraits of switching surfaces against closed forms: two-folds, hidden folds, sliding flows, pseudo-equilibria.

Guards: analysis/global_objects/switching_surface.py.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Switch, System, Unilateral
from pwsmooth.analysis.global_objects import sliding_portrait
from pwsmooth.analysis.global_objects.portrait import REGIONS

t, x, y, z, v = sp.symbols("t x y z v", real=True)
lam = Switch("lam", z)
UP, DOWN = (1 + lam) / 2, (1 - lam) / 2


def two_fold(up, down):
    """Above (1, up, -y), below (down, 1, x): the normal form of Colombo and Jeffrey (2011)."""
    return System({x: UP + DOWN * down, y: UP * up + DOWN, z: -UP * y + DOWN * x})


@pytest.mark.parametrize(
    "up, down, kind",
    [(-0.5, -0.7, "visible-visible"), (0.5, -0.7, "visible-invisible"), (0.5, 0.7, "invisible-invisible")],
)
def test_a_two_fold_is_told_by_what_both_fields_do(up, down, kind):
    # d2z/dt2 = -up above, where a positive one leads away, and = down below, where a negative one does.
    found = sliding_portrait(two_fold(up, down), lam, {x: (-1, 1.3), y: (-1.1, 1)})
    (point,) = found.two_folds
    assert point.kind == kind
    assert np.abs(point.point).max() < 1e-12


@pytest.fixture(scope="module")
def portrait():
    return sliding_portrait(two_fold(-0.5, -0.7), lam, {x: (-1, 1.3), y: (-1.1, 1)})


def test_regions_of_a_two_fold_are_the_quadrants(portrait):
    X, Y = np.meshgrid(*portrait.axes)
    names = np.array(REGIONS)[portrait.regions]
    off = (np.abs(X) > 1e-9) & (np.abs(Y) > 1e-9)
    wanted = np.select(
        [(X > 0) & (Y > 0), (X < 0) & (Y < 0), X > 0], [REGIONS[2], REGIONS[3], REGIONS[0]], REGIONS[1]
    )
    assert np.array_equal(names[off], wanted[off])


def test_the_sliding_flow_is_filippovs(portrait):
    # lam = (x - y)/(x + y): x' = (x - 0.7 y)/(x + y), y' = (y - 0.5 x)/(x + y).
    X, Y = np.meshgrid(*portrait.axes)
    slides = X * Y > 1e-6
    X, Y = np.where(slides, (X, Y), 1.0)
    assert np.abs(portrait.lam[0] - (X - Y) / (X + Y))[slides].max() < 1e-12
    exact = np.array([X - 0.7 * Y, Y - 0.5 * X]) / (X + Y)
    assert np.abs(portrait.velocity[0] - exact)[:, slides].max() < 1e-12
    assert np.array_equal(portrait.attracts[0][slides], np.meshgrid(*portrait.axes)[0][slides] > 0)


def test_folds_are_the_axes(portrait):
    lines = {fold.side: fold for fold in portrait.folds}
    assert np.abs(lines[1].points[1]).max() < 1e-14 and np.abs(lines[-1].points[0]).max() < 1e-14
    assert lines[1].visible.all() and lines[-1].visible.all()


def test_a_fold_that_bends_is_met_to_rounding_and_changes_at_its_cusp():
    # Above z' = y - x^2 and x' = 1, y' = 0: d2z/dt2 = -2 x, visible for x < 0.
    bent = System({x: sp.Integer(1), y: sp.Integer(0), z: UP * (y - x**2) + DOWN})
    (fold,) = sliding_portrait(bent, lam, {x: (-1, 1.1), y: (-0.5, 1)}).folds
    assert fold.side == 1 and np.abs(fold.points[1] - fold.points[0] ** 2).max() < 1e-14
    clear = np.abs(fold.points[0]) > 1e-9
    assert np.array_equal(fold.visible[clear], (fold.points[0] < 0)[clear])


def friction(**more):
    slip = Switch("slip", v)
    return System({y: v, v: 2 * sp.sin(t) - 3 * y - slip * (1 + 3 * (1 - slip**2))}, time=t, **more), slip


def test_a_hidden_fold_of_friction_is_at_the_static_strength():
    # mu(lam) = 4 lam - 3 lam^3 is largest at lam = 2/3, 16/9.
    system, slip = friction()
    found = sliding_portrait(system, slip, {t: (0, 6.2), y: (-1.5, 1.5)})
    assert len(found.hidden_folds) == 2
    for line in found.hidden_folds:
        side = np.sign(line[2, 0])
        assert (
            np.abs(line[2] - side * 2 / 3).max() < 1e-7
        )  # a double root, by Newton's method for both equations
        assert np.abs(2 * np.sin(line[0]) - 3 * line[1] - side * 16 / 9).max() < 1e-12


def test_captured_regions_of_friction_lie_between_kinetic_and_static_strength():
    system, slip = friction()
    found = sliding_portrait(system, slip, {t: (0, 6.2), y: (-1.5, 1.5)})
    T, Y = np.meshgrid(*found.axes)
    force = 2 * np.sin(T) - 3 * Y
    clear = np.minimum(np.abs(np.abs(force) - 1), np.abs(np.abs(force) - 16 / 9)) > 1e-3
    wanted = np.select(
        [np.abs(force) < 1, (force > 0) & (force < 16 / 9), (force < 0) & (force > -16 / 9), force > 0],
        [2, 4, 5, 0],
        1,
    )
    assert np.array_equal(found.regions[clear], wanted[clear])


def test_a_captured_point_has_an_attracting_and_a_repelling_flow():
    system, slip = friction()
    found = sliding_portrait(system, slip, {t: (0, 6.2), y: (-1.5, 1.5)})
    captured = found.regions == 4
    assert (np.isfinite(found.lam[:2, captured]).sum(axis=0) == 2).all()
    assert found.attracts[0, captured].all() and not found.attracts[1, captured].any()


def test_a_driven_system_is_frozen_at_a_time():
    slip = Switch("slip", v - z / 2)
    system = System({y: v, v: 2 * sp.sin(t) - 3 * y - slip, z: -z}, time=t)
    found = sliding_portrait(system, slip, {y: (-1.5, 1.5), z: (-1, 1)}, at={t: 1.0})
    Y, Z = np.meshgrid(*found.axes)
    # d(v - z/2)/dt = 2 sin 1 - 3 y + z/2 - lam
    force = 2 * np.sin(1.0) - 3 * Y + Z / 2
    slides = np.abs(force) < 1 - 1e-9
    assert np.abs(found.lam[0] - force)[slides].max() < 1e-12
    assert np.abs(found.velocity[0, 0] - Z / 2)[slides].max() < 1e-12  # y' = v = z/2 on the surface


def test_pseudo_equilibria_are_those_of_the_sliding_flow():
    # On z = 0 lam = y: x' = y - x + 1/4, y' = -x: one at (0, -1/4), with the trace -1 and the determinant 1.
    held = System({x: lam - x + sp.Rational(1, 4), y: -x, z: y - lam})
    found = sliding_portrait(held, lam, {x: (-1, 1), y: (-0.9, 0.9)})
    (e,) = found.equilibria
    assert [e.x0[name] for name in ("x", "y")] == pytest.approx([0, -0.25], abs=1e-12)
    assert e.stable


def test_a_contact_that_would_be_closed_has_no_flow():
    stop = Unilateral(1 - x, restitution=0.5, name="stop")
    held = System({x: y, y: -x - stop.reaction, z: y - lam})
    found = sliding_portrait(held, lam, {x: (-1, 2), y: (-0.9, 0.9)})
    assert np.array_equal(found.regions == -1, np.meshgrid(*found.axes)[0] > 1)


def test_a_portrait_wants_two_coordinates():
    with pytest.raises(ValueError, match="give bounds of two coordinates"):
        sliding_portrait(two_fold(1, 1), lam, {x: (-1, 1)})


def test_a_portrait_of_a_driven_system_wants_a_time():
    slip = Switch("slip", v - z / 2)
    with pytest.raises(ValueError, match="depends on time"):
        sliding_portrait(System({y: v, v: sp.sin(t) - slip, z: -z}, time=t), slip, {y: (-1, 1), z: (-1, 1)})


def test_a_picture_has_the_names_of_the_coordinates(portrait):
    ax = portrait.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x", "y")


def test_a_dataset_has_regions_in_words_and_the_flows_by_name(portrait):
    data = portrait.to_dataset()
    here = data.sel(x=0.7, y=0.6, method="nearest")
    at = float(here.x), float(here.y)
    assert str(here.region.values) == "attracting sliding"
    assert float(here["dx/dt"][0]) == pytest.approx((at[0] - 0.7 * at[1]) / sum(at), abs=1e-12)
