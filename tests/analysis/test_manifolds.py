"""Stable and unstable curves of saddles against closed forms, and against the basins that they separate.

Guards: analysis/global_objects/.
"""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import (
    Event,
    Return,
    Strobe,
    Switch,
    System,
    Unilateral,
    basins,
    find_equilibrium,
    find_orbit,
    follow,
)
from pwsmooth.analysis.global_objects import manifold
from pwsmooth.analysis.global_objects.arms import SMALLEST

t, x, y, v, z = sp.symbols("t x y v z", real=True)
A, w = sp.symbols("A w", positive=True)


def at_rest(states, update):
    """A map as a system: its states stand still between instants."""
    return System({s: 0 * s for s in states}, time=t, events=[Event(every=1, update=update)])


# ---- flows


def bent():
    """x' = x, y' = -y, and for x > 1 y' = -y + (x - 1)."""
    return System({x: x, y: -y + sp.Heaviside(x - 1) * (x - 1)})


def test_the_unstable_curve_of_a_piecewise_linear_saddle_is_exact():
    # dy/dx = (-y + x - 1)/x from (1, 0): y = x/2 - 1 + 1/(2 x).
    found = manifold(find_equilibrium(bent(), {x: 0, y: 0}), "unstable", length=4)
    beyond = next(arm for arm in found.arms if arm.points[0, -1] > 1).points
    beyond = beyond[:, beyond[0] > 1]
    assert beyond.shape[1] > 100
    assert np.abs(beyond[1] - (beyond[0] / 2 - 1 + 1 / (2 * beyond[0]))).max() < 1e-11


def test_a_crossing_is_met_where_the_curve_crosses():
    found = manifold(find_equilibrium(bent(), {x: 0, y: 0}), "unstable", length=4)
    (meeting,) = (m for arm in found.arms for m in arm.meetings)
    assert meeting.what == "crossing [sgn(x - 1)] (-1 to +1)"
    assert meeting.x == pytest.approx([1, 0], abs=1e-10)
    assert meeting.arclength == pytest.approx(1, abs=1e-9)


def test_the_stable_curve_of_a_piecewise_linear_saddle_is_exact_backward():
    # x' = -x and y' = y + (x - 1) for x > 1: backward from (1, 0), dy/dx = -(y + x - 1)/x, y = 1 - x/2 - 1/(2 x).
    system = System({x: -x, y: y + sp.Heaviside(x - 1) * (x - 1)})
    found = manifold(find_equilibrium(system, {x: 0, y: 0}), "stable", box={x: (-2, 4), y: (-2, 2)})
    beyond = next(arm for arm in found.arms if arm.points[0, -1] > 1).points
    beyond = beyond[:, beyond[0] > 1]
    assert beyond[0].max() > 3
    assert np.abs(beyond[1] - (1 - beyond[0] / 2 - 1 / (2 * beyond[0]))).max() < 1e-11


def pseudo_saddle():
    """On y = 0 the flow slides with x' = x; above x' = x + y, y' = -1, and below x' = x - y, y' = 1."""
    lam = Switch("lam", y)
    return find_equilibrium(System({x: x + lam * y, y: -lam}), {x: 0.1, y: 0})


def test_what_leaves_a_pseudo_saddle_slides_along_the_surface():
    found = manifold(pseudo_saddle(), "unstable", length=3)
    assert [arm.end for arm in found.arms] == ["reached the length 3."] * 2
    assert np.nanmax(np.abs(found.points[1])) < 1e-14
    assert sorted(arm.points[0, -1] for arm in found.arms) == pytest.approx(
        [-3, 3], abs=0.02
    )  # one spacing beyond


def test_a_pseudo_saddle_is_reached_from_both_sides():
    # Backward in s: y = s, x' = -(x + y) from (0, 0): x = 1 - y - exp(-y) above; below the same in |y|.
    found = manifold(pseudo_saddle(), "stable", length=2)
    assert sorted(np.sign(arm.points[1, -1]) for arm in found.arms) == [-1, 1]
    height = np.abs(found.points[1])
    assert np.nanmax(np.abs(found.points[0] - (1 - height - np.exp(-height)))) < 1e-11


def test_a_stable_curve_ends_where_the_motion_forward_leaves_a_slide():
    # x' = 2 - x, u' = u with u = y - x^2/2: the stable curve of (2, 2) is u = 0, which touches y = 0 at 0. For x < 0
    # the surface attracts, and what slides there leaves at the fold x = 0, along the same curve.
    lam = Switch("lam", y)
    above = (2 - x, y - x**2 / 2 + x * (2 - x))
    field = [(1 + lam) / 2 * f + (1 - lam) / 2 * g for f, g in zip(above, (0, 1))]
    saddle = find_equilibrium(System(dict(zip((x, y), field))), {x: 2, y: 2})
    left, right = sorted(manifold(saddle, "stable", length=4).arms, key=lambda arm: arm.points[0, -1])
    assert right.end == "reached the length 4."
    assert "the past is not unique" in left.end
    assert left.points[:, -1] == pytest.approx([0, 0], abs=1e-6)
    assert np.abs(left.points[1] - left.points[0] ** 2 / 2).max() < 1e-11


@pytest.mark.thorough
def test_a_saddle_in_space_has_an_unstable_curve_and_no_stable_one():
    e = find_equilibrium(System({x: x, y: -y, z: -2 * z}), {x: 0, y: 0, z: 0})
    assert np.nanmax(np.abs(manifold(e, length=2).points[1:])) < 1e-12
    with pytest.raises(ValueError, match="stable manifold of dimension 2"):
        manifold(e, "stable", length=2)


# ---- maps

HENON = {x: 1 - sp.Rational(7, 5) * x**2 + y, y: sp.Rational(3, 10) * x}


def henon_series(m, x0, order=80):
    """Taylor coefficients of W with W(m s) = P(W(s)): (m^k + 2 a x0 - b/m^k) x_k = -a sum x_j x_(k-j)."""
    a, b = 1.4, 0.3
    c = np.zeros(order + 1)
    c[:2] = x0, 1.0
    for k in range(2, order + 1):
        c[k] = -a * (c[1:k] @ c[k - 1 : 0 : -1]) / (m**k + 2 * a * x0 - b / m**k)
    return c, b * c / m ** np.arange(order + 1)


@pytest.mark.parametrize("kind", ["unstable", "stable"])
def test_henons_manifolds_are_those_of_the_parametrisation(kind):
    saddle = find_orbit(at_rest((x, y), HENON), {x: 0.63, y: 0.19}, seen=Strobe(1))
    a, b = 1.4, 0.3
    x0 = (-(1 - b) + np.sqrt((1 - b) ** 2 + 4 * a)) / (2 * a)
    root = np.sqrt((a * x0) ** 2 + b)
    m = -a * x0 - root if kind == "unstable" else -a * x0 + root
    P, Q = (np.polynomial.Polynomial(c) for c in henon_series(m, x0))
    found = manifold(saddle, kind, length=1.0, spacing=0.02)
    for arm in found.arms:
        points = arm.points[:, 1::7]
        # The nearest point of the series, by Newton's method from the best of a grid.
        s = np.linspace(-2, 2, 40001)
        grid = np.array([P(s), Q(s)])
        for p in points.T:
            r = s[np.argmin(np.abs(grid - p[:, None]).max(axis=0))]
            for _ in range(4):
                off, slope = np.array([P(r), Q(r)]) - p, np.array([P.deriv()(r), Q.deriv()(r)])
                r -= off @ slope / (slope @ slope)
            assert np.abs(np.array([P(r), Q(r)]) - p).max() < 1e-10


@pytest.mark.thorough
def test_the_curves_of_henons_saddle_cross_where_both_parametrisations_do():
    saddle = find_orbit(at_rest((x, y), HENON), {x: 0.63, y: 0.19}, seen=Strobe(1))
    a, b = 1.4, 0.3
    x0 = (-(1 - b) + np.sqrt((1 - b) ** 2 + 4 * a)) / (2 * a)
    root = np.sqrt((a * x0) ** 2 + b)
    series = [
        [np.polynomial.Polynomial(c) for c in henon_series(m, x0)] for m in (-a * x0 - root, -a * x0 + root)
    ]
    out, into = (
        manifold(saddle, kind, length=length, spacing=0.02) for kind, length in (("unstable", 4), ("stable", 3))
    )
    crossings = out.crossings(into)
    assert crossings.shape[1] >= 2
    s = np.linspace(-8, 8, 160001)
    grids = [np.array([one(s) for one in pair]) for pair in series]
    for point in crossings.T:
        r = [s[np.argmin(np.abs(grid - point[:, None]).max(axis=0))] for grid in grids]
        for _ in range(6):
            off = np.array([one(r[0]) - other(r[1]) for one, other in zip(*series)])
            slopes = [[one.deriv()(r[0]), -other.deriv()(r[1])] for one, other in zip(*series)]
            r = r - np.linalg.solve(slopes, off)
        exact = np.array([one(r[0]) for one in series[0]])
        assert (
            np.linalg.norm(exact) < 4 and np.abs(exact - point).max() < 5e-4
        )  # chords of 0.02, at sharp angles


def corner_map(tau_left, tau_right, delta):
    tau = sp.Piecewise((sp.Float(tau_left), x < 0), (sp.Float(tau_right), True))
    return at_rest((x, y), {x: tau * x + y + 1, y: -sp.Float(delta) * x})


def polygon(tau_left, tau_right, delta, m, saddle, images):
    """Images of the straight piece of the unstable curve from the saddle to x = 0, cut at x = 0 each time."""
    line = np.array([saddle, saddle + np.array([m, -delta]) * -saddle[0] / m])
    for _ in range(images):
        cut = [line[0]]
        for a, b in zip(line[:-1], line[1:]):
            if a[0] * b[0] < 0:
                cut.append(a + (b - a) * a[0] / (a[0] - b[0]))
            cut.append(b)
        px, py = np.array(cut).T
        line = np.array([np.where(px < 0, tau_left, tau_right) * px + py + 1, -delta * px]).T
    return line


@pytest.mark.thorough
def test_the_border_collision_normal_form_has_a_polygon_as_unstable_curve():
    # Banerjee, Yorke & Grebogi, Phys. Rev. Lett. 80 (1998) 3049, robust chaos: the saddle of the right side.
    tau_left, tau_right, delta = 1.7, -1.7, 0.5
    fixed = 1 / (1 - tau_right + delta)
    saddle = np.array([fixed, -delta * fixed])
    orbit = find_orbit(corner_map(tau_left, tau_right, delta), {x: fixed, y: -delta * fixed}, seen=Strobe(1))
    m = (tau_right - np.sqrt(tau_right**2 - 4 * delta)) / 2
    assert orbit.map_multipliers[0].real == pytest.approx(m, abs=1e-12)
    found = manifold(orbit, "unstable", length=6, spacing=0.05)
    exact = np.concatenate([polygon(tau_left, tau_right, delta, m, saddle, n) for n in (16, 17)])
    start, way = exact[:-1], np.diff(exact, axis=0)
    size = (way * way).sum(axis=1)
    way, start, size = way[size > 0], start[size > 0], size[size > 0]
    for p in np.hstack([arm.points for arm in found.arms]).T:
        part = np.clip(((p - start) * way).sum(axis=1) / size, 0, 1)
        assert np.linalg.norm(start + part[:, None] * way - p, axis=1).min() < 1e-9


def hammer(amplitude):
    stop = Unilateral(1 - x, restitution=sp.Rational(4, 5), name="stop")
    return System(
        {x: v, v: A * sp.cos(sp.Rational(11, 10) * t) - v / 10 - x - stop.reaction},
        time=t,
        parameters={A: amplitude},
    )


PERIOD = 2 * sp.pi / sp.Rational(11, 10)


@pytest.fixture(scope="module")
def hammered():
    """Between fold and grazing: the quiet orbit, the one with an impact, and the saddle of the fold."""
    hit = find_orbit(hammer(0.18), {x: 0.5, v: 2}, seen=Strobe(PERIOD), transient=300)
    quiet = find_orbit(hammer(0.18), {x: -0.5, v: 0}, seen=Strobe(PERIOD))
    return quiet, hit, follow(hit, {A: 0.1}).points[-1]


def test_the_saddle_of_an_impact_oscillator_has_the_basins_on_both_sides_of_its_stable_curve(hammered):
    quiet, hit, saddle = hammered
    found = manifold(saddle, "stable", length=12)
    tried = 0
    for arm in found.arms:
        points = arm.points
        for k in np.linspace(10, points.shape[1] - 5, 12).astype(int):
            along = points[:, k + 1] - points[:, k - 1]
            if not (np.isfinite(along).all() and np.isfinite(points[:, k]).all()):
                continue
            across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
            sides = []
            for off in (1e-8, -1e-8):
                end = saddle.map.iterate(points[:, k] + off * across, 150)[-1]
                sides.append([np.linalg.norm(end - orbit.x) < 1e-6 for orbit in (quiet, hit)])
            assert sorted(sides) == [[False, True], [True, False]]
            tried += 1
    assert tried > 20


@pytest.mark.thorough
def test_the_boundary_between_cells_of_basins_is_the_stable_curve(hammered):
    _, _, saddle = hammered
    found = manifold(saddle, "stable", length=12, spacing=0.005)
    rows, columns = np.linspace(-1, 0.8, 7), np.linspace(-2.5, 2.5, 21)
    cells = basins(hammer(0.18), {x: rows, v: columns}, Strobe(PERIOD), transient=150)
    assert len(cells.attractors) == 2
    P, stop = saddle.map, [orbit.x for orbit in cells.attractors]

    def label(point):
        return int(np.argmin([np.linalg.norm(P.iterate(point, 150)[-1] - at) for at in stop]))

    boundary = []
    for i, k in zip(*np.nonzero(np.diff(cells.labels, axis=1))):
        low, high, name = columns[k], columns[k + 1], cells.labels[i, k]
        while high - low > 1e-9:
            middle = (low + high) / 2
            low, high = (middle, high) if label([rows[i], middle]) == name else (low, middle)
        boundary.append([rows[i], low])
    assert len(boundary) >= 8
    assert max(off_the_curve(found, np.array(point)) for point in boundary) < 1e-8


def off_the_curve(found, point):
    """Distance of a point from the quartic through the five points of the curve about it, across the curve."""
    arm = min(found.arms, key=lambda arm: np.nanmin(np.linalg.norm(arm.points.T - point, axis=1)))
    k = int(np.nanargmin(np.linalg.norm(arm.points.T - point, axis=1)))
    near = arm.points[:, k - 2 : k + 3]
    along = near[:, 3] - near[:, 1]
    frame = np.array([along, [-along[1], along[0]]]) / np.linalg.norm(along)
    u, w = frame @ (near - point[:, None])
    return abs(np.polynomial.Polynomial.fit(u, w, len(u) - 1)(0.0))


def test_an_itinerary_changes_where_the_unstable_curve_leaves_the_stop(hammered):
    *_, saddle = hammered
    found = manifold(saddle, "unstable", length=1)
    (meeting,) = (m for arm in found.arms for m in arm.meetings)
    assert meeting.what == "1 impact [stop] fewer"
    # Just there the preimage's trajectory touches the stop.
    (arm,) = (arm for arm in found.arms if arm.meetings)
    spots = np.searchsorted(arm.arclength, meeting.arclength)
    assert np.linalg.norm(arm.points[:, spots] - arm.points[:, spots - 1]) < SMALLEST * 1 / 200


def test_an_unstable_curve_ends_in_the_point_that_attracts_it(hammered):
    quiet, hit, saddle = hammered
    found = manifold(saddle, "unstable", length=100)
    for arm in found.arms:
        assert arm.end.startswith("it comes to an end")
        assert min(np.linalg.norm(arm.points[:, -1] - orbit.x) for orbit in (quiet, hit)) < 1e-3


def test_a_manifold_wants_a_saddle():
    stable = find_orbit(at_rest((x,), {x: x / 2}), {x: 0}, seen=Strobe(1))
    with pytest.raises(ValueError, match="no single one outside the unit circle"):
        manifold(stable, "unstable", length=1)


def test_a_manifold_wants_an_end():
    with pytest.raises(ValueError, match="neither `length` nor `box`"):
        manifold(find_equilibrium(bent(), {x: 0, y: 0}))


def test_a_curve_that_jumps_says_so():
    # The unstable curve y = 0 of (2 x, y/2) is torn where x passes 1: everything beyond is lifted by 1.
    torn = at_rest((x, y), {x: 2 * x, y: y / 2 + sp.Heaviside(x - 1)})
    found = manifold(find_orbit(torn, {x: 0, y: 0}, seen=Strobe(1)), box={x: (-3, 3)}, spacing=0.02)
    (right,) = (arm for arm in found.arms if arm.jumps)
    at = int(np.flatnonzero(np.isnan(right.points[0]))[0])
    assert right.points[:, at - 1] == pytest.approx([2, 0], abs=1e-7)
    assert right.points[:, at + 1] == pytest.approx([2, 1], abs=1e-7)


def test_a_picture_shows_both_arms():
    drawn = manifold(find_equilibrium(bent(), {x: 0, y: 0}), length=1).plot()
    assert np.nanmax(drawn.lines[0].get_xdata()) >= 1 and np.nanmin(drawn.lines[0].get_xdata()) <= -1


# ---- sticking, and sections


def test_the_stable_curve_of_an_orbit_that_sticks_separates_its_mirrored_neighbours():
    # Past its symmetry breaking the two-stick orbit of the friction oscillator is a saddle with the multiplier 0.
    sigma = sp.Symbol("sigma", positive=True)
    lam = Switch("lam", v)
    mu = lam * (1 + 3 * (1 - lam**2))
    block = System({x: v, v: -sigma * sp.sin(t) - 3.1 * x - 0.1 * v - mu}, time=t, parameters={sigma: 3.4})
    saddle = find_orbit(block, {x: 0.7508, v: -1.5075}, seen=Strobe(2 * sp.pi, symmetry={x: -x, v: -v}))
    assert saddle.success and not saddle.stable and abs(saddle.map_multipliers[1]) < 1e-12
    found = manifold(saddle, "stable", length=1)
    assert found.points.shape[1] > 100
    whole = find_orbit(block, saddle.x0, seen=Strobe(2 * sp.pi)).map
    for arm in found.arms:
        for k in (20, 50, 70):
            along = arm.points[:, k + 1] - arm.points[:, k - 1]
            across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
            ends = [whole.iterate(arm.points[:, k] + off * across, 200)[-1] for off in (1e-8, -1e-8)]
            # Attractors on both sides of the saddle, mirror images of each other in half a period.
            assert np.linalg.norm(ends[0] - ends[1]) > 0.05
            assert np.linalg.norm(whole(ends[0]) - ends[0]) < 1e-6


def test_the_stable_curve_of_an_orbit_that_sticks_ends_where_the_map_jumps():
    # Beside a trajectory that is just captured into a stick, static friction lets others pass.
    lam = Switch("lam", v)
    mu = lam * (1 + 3 * (1 - lam**2))
    block = System({x: v, v: -3.4 * sp.sin(t) - 3.1 * x - 0.1 * v - mu}, time=t)
    saddle = find_orbit(block, {x: 0.7508, v: -1.5075}, seen=Strobe(2 * sp.pi, symmetry={x: -x, v: -v}))
    found = manifold(saddle, "stable", length=10)
    arm = next(arm for arm in found.arms if "after 1 application:" in arm.end)
    assert arm.end.startswith("the map jumps there")
    last = arm.points[:, -1]
    ahead = last + 1e-4 * (last - arm.points[:, -2]) / np.linalg.norm(last - arm.points[:, -2])
    assert np.linalg.norm(saddle.map(last) - saddle.x) < 1e-5
    assert np.linalg.norm(saddle.map(ahead) - saddle.x) > 0.05


def ring():
    """Circles of radius 1 and 3 attract in x, y; that of radius 2 is a saddle cycle, as z decays."""
    r2 = x**2 + y**2
    growth = (1 - r2) * (4 - r2) * (9 - r2) / 200
    cycle = System({x: growth * x - y, y: growth * y + x, z: -z / 5})
    return find_orbit(cycle, {x: 2, y: 0, z: 0}, seen=Return(y))


def test_the_stable_curve_of_a_cycle_on_its_section_is_found_by_preimages():
    found = manifold(ring(), "stable", box={z: (-3, 3)}, spacing=0.1)
    assert all(arm.end == "left the box." for arm in found.arms)
    assert np.nanmax(np.abs(found.points[0] - 2)) < 1e-9  # the cylinder r = 2


def test_the_unstable_curve_of_a_cycle_ends_in_the_cycles_beside_it():
    found = manifold(ring(), "unstable", length=3, spacing=0.05)
    assert sorted(arm.points[0, -1] for arm in found.arms) == pytest.approx([1, 3], abs=1e-2)
    assert np.nanmax(np.abs(found.points[1:])) < 1e-10


@pytest.mark.parametrize("kind", ["unstable", "stable"])
def test_half_a_period_of_a_symmetric_orbit_gives_the_same_curve(kind):
    duffing = System({x: v, v: -v / 10 + x - x**3 + sp.cos(t) / 20}, time=t)
    half = find_orbit(duffing, {x: 0, v: 0}, seen=Strobe(2 * sp.pi, symmetry={x: -x, v: -v}))
    full = find_orbit(duffing, half.x0, seen=Strobe(2 * sp.pi))
    one, other = manifold(half, kind, length=2), manifold(full, kind, length=2.2, spacing=0.002)
    points = one.points[:, np.isfinite(one.points[0])]
    # A chord is off its arc by 0.002^2/8 of the curvature, which is below 5 here.
    assert other.distance(points[:, ::9]).max() < 3e-6


def test_the_unstable_curve_of_a_falling_pendulum_hits_a_stop_as_the_hyperbolas_say():
    # x'' = x and a stop at 1 with e = 1/2: v^2 - x^2 = 1/4^k - 1 after k impacts, each at v = 1/2^(k - 1).
    stop = Unilateral(1 - x, restitution=0.5, name="stop")
    rest = find_equilibrium(System({x: v, v: x - stop.reaction}), {x: 0, v: 0})
    found = manifold(rest, "unstable", length=3)
    (arm,) = (arm for arm in found.arms if arm.meetings)
    assert [meeting.what for meeting in arm.meetings] == ["impact [stop]"] * 3
    edges = np.flatnonzero(np.isnan(arm.points[0]))
    for k, piece in enumerate(np.split(arm.points, edges, axis=1)):
        energy = (piece[1] ** 2 - piece[0] ** 2)[np.isfinite(piece[0])]
        assert np.abs(energy - (0.25**k - 1) * (k > 0)).max() < 1e-11
    before = [arm.points[1, edge - 1] for edge in edges]
    assert before == pytest.approx([1, 0.5, 0.25], abs=1e-10)


def test_points_of_a_stable_curve_that_preimages_find_come_to_the_saddle():
    # Of the border-collision normal form, whose multipliers are negative: two preimages at a time.
    delta, tau = 0.5, -1.7
    fixed = 1 / (1 - tau + delta)
    orbit = find_orbit(corner_map(1.7, tau, delta), {x: fixed, y: -delta * fixed}, seen=Strobe(1))
    found = manifold(orbit, "stable", length=1.5, spacing=0.2)
    for arm in found.arms:
        end = orbit.map.iterate(arm.points[:, -1], 16)[-1]
        # 1.5*0.378^16 along the curve, and its error of 1e-12 times 1.32^16 across it
        assert np.abs(end - orbit.x).max() < 2 * 1.5 * 0.3783**16 + 1e-9


def test_a_pseudo_saddle_on_a_repelling_surface_is_left_to_both_sides_and_reached_along_it():
    # The pseudo-saddle above in reversed time: x = 1 - |y| - exp(-|y|) leads away, and the slide x' = -x arrives.
    lam = Switch("lam", y)
    held = find_equilibrium(System({x: -x - lam * y, y: lam}), {x: 0.1, y: 0})
    out, into = (manifold(held, kind, length=2).points for kind in ("unstable", "stable"))
    assert np.nanmin(out[1]) < -1 and np.nanmax(out[1]) > 1
    assert np.nanmax(np.abs(out[0] - (1 - np.abs(out[1]) - np.exp(-np.abs(out[1]))))) < 1e-11
    assert np.nanmax(np.abs(into[1])) < 1e-14 and np.nanmin(into[0]) < -1.9 and np.nanmax(into[0]) > 1.9


def test_the_stable_curve_of_a_smoothed_saddle_separates_its_mirrored_neighbours():
    # A view has no runs backward, and its layer contracts: the curve is a level set of the map.
    lam = Switch("lam", v)
    mu = lam * (1 + 3 * (1 - lam**2))
    block = System({x: v, v: -3.4 * sp.sin(t) - 3.1 * x - 0.1 * v - mu}, time=t).smoothed(eps=0.05)
    saddle = find_orbit(block, {x: 0.7977, v: -1.5866}, seen=Strobe(2 * sp.pi, symmetry={x: -x, v: -v}))
    assert saddle.success and abs(saddle.map_multipliers[0]) > 1
    found = manifold(saddle, "stable", length=0.4, spacing=0.05)
    assert [arm.end for arm in found.arms] == ["reached the length 0.4."] * 2
    whole = find_orbit(block, saddle.x0, seen=Strobe(2 * sp.pi)).map
    for arm in found.arms:
        along = arm.points[:, -1] - arm.points[:, -2]
        across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
        ends = [whole.iterate(arm.points[:, -1] + off * across, 80)[-1] for off in (1e-7, -1e-7)]
        assert np.linalg.norm(ends[0] - ends[1]) > 0.05


def test_a_table_has_the_points_of_both_arms():
    found = manifold(find_equilibrium(bent(), {x: 0, y: 0}), length=1)
    table = found.to_dataframe()
    assert list(table.columns) == ["arm", "arclength", "x", "y"]
    second = table[table["arm"] == 1]
    assert np.array_equal(second[["x", "y"]].to_numpy().T, found.arms[1].points, equal_nan=True)


def test_a_manifold_ends_where_its_steps_are_used_up():
    saddle = find_orbit(at_rest((x, y), HENON), {x: 0.63, y: 0.19}, seen=Strobe(1))
    found = manifold(saddle, length=20, max_steps=300)
    assert any("max_steps" in arm.end for arm in found.arms)
    assert all(0 < arm.length < 20 for arm in found.arms[:1])
