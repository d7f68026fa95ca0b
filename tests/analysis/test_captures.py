"""Capture thresholds of a layered view with a finite ratio: as ends of branches, and as curves in two parameters."""

import numpy as np
import pytest
import sympy as sp
from friction_oscillator import coulomb, hidden, omega, sigma, v, y, z
from scipy.optimize import brentq

from pwsmooth import Event, Strobe, Switch, System, find_orbit, follow, solve
from pwsmooth.analysis.continuation.conditions.captures import clearances
from pwsmooth.analysis.maps.holding import strength_of
from pwsmooth.analysis.sticking.capture import capture_threshold, critical_ratio
from pwsmooth.analysis.sticking.separatrix import frozen

RANGES = {"ratio_z": (1e-3, 2), "sigma": (0.5, 6)}
RATIO = 0.3


def symmetric(ratio, start, **values):
    """The orbit through a start, of the friction oscillator at rho = 3 and a ratio r = eps/beta."""
    layered = hidden().layered({z: ratio}).with_parameters(values)
    return find_orbit(layered, start, seen=Strobe(2 * sp.pi, symmetry={y: -y, v: -v}), transient=50)


@pytest.fixture(scope="module")
def sticking():
    return symmetric(RATIO, {y: 0.78, v: -1.03}, sigma=3.5)


@pytest.fixture(scope="module")
def slipping():
    return symmetric(RATIO, {y: 0.3, v: -1.9}, sigma=4.5)


@pytest.fixture(scope="module")
def thresholds(sticking, slipping):
    near = follow(slipping, {sigma: 3.8}).points[-1]  # with a saddle in the layer at its arrivals
    return [follow(orbit, RANGES, kind="capture") for orbit in (sticking, near)]


@pytest.mark.parametrize("ratio", [0.01, 0.3, 0.6])
def test_the_clearance_of_any_layer_vanishes_at_the_threshold_of_the_friction_law(ratio):
    # capture.py computes the same separatrix with the force as an unknown; its own test compares it with trajectories.
    model = hidden().layered({z: ratio}).model
    p = np.array(hidden().layered({z: ratio}).parameter_values, float)

    def clearance(force):
        layer = frozen(model, 0, 0.0, np.array([-force / 3.1, 0.0]), np.zeros(1), p, -1)
        return layer.clearance(layer.saddle())

    exact = capture_threshold(3, ratio)
    assert brentq(clearance, exact - 1e-3, exact + 5e-4, xtol=1e-13) == pytest.approx(exact, abs=1e-10)


def test_along_a_curve_of_captures_the_contact_arrives_with_the_threshold(thresholds):
    for curve in thresholds:
        assert len(curve.points) > 20
        for orbit, (ratio, drive) in list(zip(curve.points, curve.values.T))[::6]:
            # Of the arriving slip alone, which does not know of the layer: Coulomb friction has the same.
            first = orbit.map.start_time
            run = solve(coulomb(sigma=drive), (first, first + np.pi), list(orbit.x), rtol=1e-12, atol=1e-14)
            at = run.events[0].time
            place = run.x[0, np.searchsorted(run.t, at)]
            force = abs(drive * np.sin(at) + 3.1 * place)
            assert force == pytest.approx(capture_threshold(3, ratio), abs=1e-9)


def test_both_curves_end_where_the_ratio_lets_the_fold_capture(thresholds):
    ends = [curve.of_kind("capture + crossing-sliding")[0].values for curve in thresholds]
    for end in ends:
        assert end["ratio_z"] == pytest.approx(critical_ratio(3), abs=1e-8)
    assert ends[0]["sigma"] == pytest.approx(ends[1]["sigma"], abs=1e-7)
    # There is the crossing-sliding of the slaved view, which captures up to the fold.
    slaved = hidden().layered({z: sp.oo}).with_parameters({"sigma": 3.5})
    orbit = find_orbit(
        slaved, {y: 0.78, v: -1.03}, seen=Strobe(2 * sp.pi, symmetry={y: -y, v: -v}), transient=50
    )
    (crossing,) = follow(orbit, {sigma: 4.2}).of_kind("crossing-sliding")
    assert ends[0]["sigma"] == pytest.approx(crossing.parameter, abs=1e-7)


def test_branches_end_at_captures_on_the_curves(sticking, slipping, thresholds):
    for orbit, to, curve in ((sticking, 4.0, thresholds[0]), (slipping, 3.0, thresholds[1])):
        branch = follow(orbit, {sigma: to})
        found = branch.specials[-1]
        assert found.kind == "capture" and "just captured" in branch.end
        at = follow(found, {"ratio_z": (RATIO, 0.4), "sigma": (2, 5)}).values
        assert at[0].min() == pytest.approx(RATIO, abs=1e-9)
        assert curve.values[1].min() < found.parameter < curve.values[1].max()
        assert found.parameter == pytest.approx(at[1, np.argmin(at[0])], abs=2 * found.uncertainty)


def test_the_sign_of_the_clearance_tells_who_is_captured(sticking, slipping):
    ((_, _, above),) = clearances(sticking)
    assert above > 0
    near = follow(slipping, {sigma: 3.76}).points[-1]
    ((_, _, below),) = clearances(near)
    assert below < 0


def test_broken_symmetry_ends_where_its_contact_is_not_captured_any_more():
    orbit = symmetric(RATIO, {y: 0.78, v: -1.03}, sigma=2.8)
    (broken,) = follow(orbit, {sigma: 3.2}).of_kind("symmetry breaking")
    curve = follow(broken, {"ratio_z": (0.02, 1), "sigma": (0.5, 5)})
    (end,) = curve.of_kind("symmetry breaking + capture")
    assert np.ptp(curve.values[1]) < 1e-8  # the slow motion does not know of the ratio
    run = solve(coulomb(sigma=end.values["sigma"]), (0, np.pi), list(broken.point.x), rtol=1e-12, atol=1e-14)
    place = run.x[0, np.searchsorted(run.t, run.events[0].time)]
    force = abs(end.values["sigma"] * np.sin(run.events[0].time) + 3.1 * place)
    # The solver resolves the layer to some 1e-7 beside its threshold.
    assert capture_threshold(3, end.values["ratio_z"]) == pytest.approx(force, abs=1e-6)
    assert end.begins == ("capture",)


def test_without_a_hidden_term_there_is_no_threshold():
    orbit = find_orbit(
        coulomb(), {y: 0.78, v: -1.03}, seen=Strobe(2 * sp.pi, symmetry={y: -y, v: -v}), transient=50
    )
    with pytest.raises(ValueError, match="at no capture threshold"):
        follow(orbit, {"k": (2, 4), "sigma": (1, 6)}, kind="capture")


# ---- a layer without states: its fold decides


@pytest.mark.parametrize("first, to", [(1.75, 2.3), (2.3, 1.75)])
def test_a_contact_is_captured_where_the_fold_of_its_layer_holds_it(first, to):
    # Put to x = 1 every period it comes down to x = 0, with a force that is held if it is less than the largest mu.
    t, x = sp.symbols("t x", real=True)
    a, rho = sp.symbols("a rho", positive=True)
    lam = Switch("lam", x)
    falling = System(
        {x: -a * (2 + sp.cos(t - 0.2)) / 3 - lam * (1 + rho * (1 - lam**2))}, time=t, parameters={a: first, rho: 3},
        events=[Event(every=2 * sp.pi, update={x: 1})],
    )  # fmt: skip
    branch = follow(find_orbit(falling, {x: 1}, seen=Strobe(2 * sp.pi, phase=0.05)), {a: to})

    def exact(strength):
        fold = np.sqrt((1 + strength) / (3 * strength))
        most = fold * (1 + strength * (1 - fold**2))

        # x = 1 - t - a (2 t + sin(t - 0.2) + sin(0.2))/3 with a (2 + cos(t - 0.2))/3 = most
        def left(at):
            return 1 - at - most * (2 * at + np.sin(at - 0.2) + np.sin(0.2)) / (2 + np.cos(at - 0.2))

        return 3 * most / (2 + np.cos(brentq(left, 0, 1, xtol=1e-15) - 0.2))

    assert branch.specials[-1].kind == "capture" and "capture" in branch.end
    assert branch.specials[-1].parameter == pytest.approx(exact(3), abs=1e-5)  # as finely as a jump is enclosed
    assert len(branch.places) == len(branch.specials)  # where a diagram finds it
    curve = follow(branch.specials[-1], {rho: (1, 5), a: (0.5, 5)})
    strength, force = curve.values
    assert np.ptp(strength) == 4 and len(strength) > 10
    assert np.abs(force - [exact(one) for one in strength]).max() < 1e-9


def test_captures_end_where_what_is_held_is_let_go_at_once():
    # There the curve of crossing-sliding of the other contact meets them, and both orbits are the same.
    layered = hidden(omega=0.9051721488540027, sigma=4.3650245184496095).layered({z: sp.oo})
    orbit = find_orbit(layered, {y: 0.5, v: 0.3}, seen=Strobe(2 * sp.pi / omega), transient=100)
    capture = follow(orbit, {"omega": 0.4}).specials[-1]
    curve = follow(capture, {"omega": (0.4, 3), "sigma": (0.5, 5)})
    (end,) = curve.of_kind("capture + crossing-sliding")
    assert end.values["omega"] == pytest.approx(0.86061, abs=1e-4) and "reached sigma = 5." in curve.ends


def test_what_a_layer_could_hold_is_compiled_once():
    model = hidden().layered({z: sp.oo}).model
    strength = strength_of(model, "lam", 1)
    assert strength_of(model, "lam", 1) is strength
    assert strength._rate(model) is strength._rate(model) and strength._functions(model) is strength._functions(
        model
    )
