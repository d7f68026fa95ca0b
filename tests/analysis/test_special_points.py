"""Names of special points are earned: folds, flips and grazings against what only looks like one.

Guards: analysis/continuation/.
"""

import math

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Event, Memory, Return, Strobe, System, find_equilibrium, find_orbit, follow
from pwsmooth.analysis.continuation import Steps, branch_off, cycle_from

t, x, y, z, u, v = sp.symbols("t x y z u v", real=True)
p = sp.Symbol("p", positive=True)
a, mu = sp.symbols("a mu", real=True)
# The bracket of a change of itinerary is 1e-12 of the arc, an event is decided to some 1e-13: a thousand of these.
LOCATED = 1e-10


@pytest.mark.parametrize("step", [0.002, 0.005, 0.02])
def test_a_peak_with_a_corner_that_comes_to_a_surface_is_a_corner_and_no_fold(step):
    # Where sin t changes its sign x has its peak tanh(pi/2) - 1/4; above it the multiplier is exp(-2 pi) for every a.
    system = System({x: -x + sp.sign(sp.sin(t)) + sp.sign(x - a) / 4}, time=t, parameters={a: 0.6})
    orbit = find_orbit(system, {x: 0}, seen=Strobe(2 * sp.pi, phase=0.25), transient=20)
    branch = follow(orbit, {a: 0.8}, steps=Steps(first=step, longest=5 * step))
    (corner,) = branch.specials
    assert corner.kind == "corner" and corner.parameter == pytest.approx(
        math.tanh(math.pi / 2) - 0.25, abs=LOCATED
    )
    assert branch.values[-1] == 0.8
    assert branch.points[-1].multipliers == pytest.approx([math.exp(-2 * math.pi)], rel=1e-8)


LEFT, RIGHT = np.array([[0.5, 1], [-0.3, 0]]), np.array([[-1.6, 1], [-0.4, 0]])


@pytest.mark.parametrize("way", [1, -1])
def test_multipliers_that_jump_at_a_border_are_no_flip(way):
    side = x < 0
    step = Event(every=1, update={
        x: sp.Piecewise((x / 2, side), (-1.6 * x, True)) + y + mu,
        y: sp.Piecewise((-0.3 * x, side), (-0.4 * x, True)),
    })  # fmt: skip
    form = System({x: 0 * x, y: 0 * y}, time=t, parameters={mu: 0.3 * way}, events=[step])
    branch = follow(find_orbit(form, {x: 0.1 * way, y: 0}, seen=Strobe(1, phase=0.5)), {mu: -0.3 * way})
    (border,) = branch.specials
    assert (
        border.kind == "border collision"
        and abs(border.parameter) < LOCATED
        and branch.values[-1] == -0.3 * way
    )
    for orbit, matrix in zip((border.point, border.beyond), (RIGHT, LEFT)[::way]):
        assert np.sort_complex(orbit.multipliers) == pytest.approx(
            np.sort_complex(np.linalg.eigvals(matrix)), abs=1e-9
        )


def test_a_branch_of_period_3_ends_where_its_map_jumps_and_does_not_shrink_onto_a_period_of_1():
    """Ice grows, v' = (1 - v)/30, and melts, v' = -v/8, in a season that is warm enough; between them a closed form."""
    v, vc, k = *sp.symbols("v v_c", positive=True), Memory("k", 1)
    f = sp.sin(2 * sp.pi * t / 41)
    events = [
        Event(f - 0.3, direction=1, when=v > vc, update={k: 2}),
        Event(f + 0.2, direction=-1, update={k: 1}),
    ]
    ice = System(
        {v: sp.Piecewise(((1 - v) / 30, k < 1.5), (-v / 8, True))},
        time=t,
        parameters={vc: 0.535},
        events=events,
    )
    branch = follow(find_orbit(ice, {v: 0.5}, seen=Strobe(41), transient=50), {vc: 0.5})
    up, down = 41 * math.asin(0.3) / (2 * math.pi), 41 * (math.pi + math.asin(0.2)) / (2 * math.pi)

    def grown(x, time):
        return 1 + (x - 1) * math.exp(-time / 30)

    def year(x, threshold):
        x = grown(x, up)
        x = x * math.exp((up - down) / 8) if x > threshold else grown(x, down - up)
        return grown(x, 41 - down)

    # The smallest threshold at which the year with the most ice but one has no melt.
    point = branch.x[0, -1]
    reached = []
    for _ in range(3):
        reached.append(grown(point, up))
        point = year(point, branch.values[-1])
    below = max(value for value in reached if value < branch.values[-1])
    assert branch.values[-1] == pytest.approx(below, abs=1e-4) and "jumps" in branch.end


def test_a_branch_is_left_at_a_flip_by_an_orbit_just_beyond_it():
    # x -> 1 - a x^2; beside its flips the doubled orbit's multiplier has fallen from 1 by little.
    quadratic = System(
        {x: 0 * x}, time=t, parameters={a: 1.36}, events=[Event(every=1, update={x: 1 - a * x**2})]
    )
    orbit = find_orbit(quadratic, {x: 0.6}, seen=Strobe(1, phase=0.5), transient=400)
    for known in (1.3680989394, 1.3940461566, 1.3996312389):  # periods 4, 8, 16
        (flip,) = follow(orbit, {a: 1.42 if known > 1.399 else known + 1e-3}).of_kind("flip")[:1]
        assert flip.parameter == pytest.approx(known, abs=LOCATED)
        found = [branch_off(flip, amplitude) for amplitude in (0.003, 0.001, 0.0003, 0.0001, 0.00003)]
        orbit = next(one for one in found if one.success)
        for one in found:
            assert not one.success or 0 < one.multipliers[0].real < 1


def test_a_cycle_that_ends_at_a_saddle_is_a_homoclinic_orbit():
    # x'' = x - x^2 + v (x - a)/50: by Melnikov's integral at a = 6/7 to the first order in 1/50, the saddle being 0.
    loop = System({x: v, v: x - x**2 + (x - a) * v / 50}, parameters={a: 1.1})
    (hopf,) = follow(find_equilibrium(loop, {x: 1, v: 0}), {a: 0.9}).specials
    branch = follow(cycle_from(hopf, 0.05), {a: (0, 1.5)}, way=-1, steps=Steps(first=0.05))
    (end,) = branch.specials
    assert end.kind == "homoclinic orbit" and end.parameter == pytest.approx(6 / 7, abs=1 / 50**2)
    assert end.saddles[0].x == pytest.approx([0, 0], abs=LOCATED) and "saddle at x = 0" in branch.end


def test_a_cycle_beside_a_strongly_unstable_direction_is_found_in_segments():
    # The circle r^2 = mu, z = 0; its third multiplier is exp(16 pi) = 7e21.
    r2 = x**2 + y**2
    form = System({x: -y + x * (mu - r2), y: x + y * (mu - r2), z: 8 * z + r2 - mu}, parameters={mu: -0.2})
    (hopf,) = follow(find_equilibrium(form, {x: 0.01, y: 0, z: 0}), {mu: 0.2}).of_kind("Hopf")
    cycle = cycle_from(hopf, 0.1)
    assert cycle.success and cycle.period == pytest.approx(2 * math.pi, abs=1e-9)
    assert cycle.x == pytest.approx([*cycle.x[:2], 0], abs=1e-9)
    assert np.hypot(*cycle.x[:2]) ** 2 == pytest.approx(cycle.system.parameters[mu], abs=1e-9)
    largest, other = cycle.multipliers.real
    assert math.log(largest) == pytest.approx(16 * math.pi, rel=1e-6)
    assert math.log(other) == pytest.approx(-4 * math.pi * cycle.system.parameters[mu], rel=1e-5)


def test_a_section_may_move_with_the_parameter():
    vdp = System({x: v, v: (1 + p / 5) * (1 - x**2) * v - x}, parameters={p: 0.2})
    ends = []
    for section in (x - sp.Rational(1, 5), x - p):
        branch = follow(find_orbit(vdp, {x: 0.2, v: 2}, seen=Return(section), transient=30), {p: 0.9})
        ends.append(branch.points[-1].period)
        assert branch.values[-1] == 0.9 and len(branch.points) < 30
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)


def test_a_linear_hopf_point_is_degenerate():
    centre = System({x: u, u: -x + mu * u - sp.Max(0, x - 1)}, parameters={mu: -0.1})
    (hopf,) = follow(find_equilibrium(centre, {x: 0.1, u: 0}), {mu: 0.5}).of_kind("Hopf")
    assert hopf.lyapunov == 0 and "critical" not in str(hopf) and "degenerate" in str(hopf)
