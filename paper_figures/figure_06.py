"""Figure 6: transitions of the discontinuous oscillator: one trajectory crosses, one sticks on B."""

import numpy as np
import sympy as sp

from paper_figures import oscillator as osc
from paper_figures.blown_up import dress, fold_shadows, manifold, orbit_in_layer, slip_planes
from paper_figures.claims import Claim
from paper_figures.sources import solid_friction
from pwsmooth import solve
from pwsmooth.plotting import new_figure

NAME = "6"
TITLE = "A crossing and a sticking trajectory of the discontinuous system"
CAPTION = """
Two trajectories of the event-driven solver, z slaved, rho = 3, in the picture of figure 5. (i) arrives
outside the nonlinear sticking region and crosses through the fast system (double arrow); (ii) arrives inside,
collapses to B, moves along it to the fold at lam = 2/3, and leaves through the fast system. Grey on the floor: their
shadows, with those of the folds (dotted); (i) passes below B. Reproduced, with
real orbits. Everything is dimensionless (m = N = omega = 1).
"""
SPAN, HEIGHTS, REACH = (0.9, 2.9), (-1.75, 0.6), 1.0


def trajectories():
    """(crossing, sticking): a start too far out to be captured, and the settled orbit."""
    view = osc.oscillator().layered({osc.z: sp.oo})
    crossing = solve(view, (0.95, 2.2), {osc.y: -1.25, osc.v: -0.9}, dense_output=True)
    return crossing, osc.settled(view, osc.SLAVED_START, periods=20)


def claims(crossing, sticking):
    """What section 6 says of the two trajectories."""
    times = crossing.event_times("crossing")
    at = times[(times > SPAN[0]) & (times < SPAN[1])][0]
    force = abs(3.1 * crossing(at, "y") + 2.4 * np.sin(at))
    stick = osc.sticks(sticking)[0]
    arrival = abs(3.1 * sticking(stick.start, "y") + 2.4 * np.sin(stick.start))
    end = abs(3.1 * sticking(stick.end, "y") + 2.4 * np.sin(stick.end))
    at_end = sticking(np.nextafter(stick.end, 0), "lam")
    return [
        Claim(
            "trajectory (i): outside (19) it transitions through the fast system",
            "|k y - q''| > N mu_s",
            f"crosses at |k y - q''| = {force:.5f}",
            bool(force > osc.MU_S),
            "it crosses inside the region",
            **solid_friction("section 6, figure 6"),
        ),
        Claim(
            "trajectory (ii): inside (19) the fast system collapses to B and sticking ensues",
            "|k y - q''| <= N mu_s",
            f"sticks from |k y - q''| = {arrival:.5f}",
            bool(arrival <= osc.MU_S),
            "it sticks outside the region",
            **solid_friction("section 6, figure 6"),
        ),
        Claim(
            "sticking continues while (19) is satisfied, to the extremum of B",
            "|k y - q''| = 16/9 at lam = 2/3",
            f"leaves at |k y - q''| = {end:.9f}, lam = {at_end:.6f}",
            bool(abs(end - osc.MU_S) < 1e-9 and abs(abs(at_end) - 2 / 3) < 1e-4),
            "it leaves elsewhere",
            **solid_friction("section 6, figure 6"),
        ),
    ]


def draw(fast):
    """The backdrop of figure 5 with both trajectories."""
    crossing, sticking = trajectories()
    figure = new_figure(5.8, 4.4)
    ax = figure.add_subplot(projection="3d", computed_zorder=False)
    slip_planes(ax, SPAN, HEIGHTS)
    manifold(ax, SPAN)
    fold_shadows(ax, SPAN, HEIGHTS[0])
    for orbit, name in ((crossing, "(i)"), (sticking, "(ii)")):
        orbit_in_layer(ax, orbit, SPAN, REACH, floor=HEIGHTS[0])
        at = orbit.events[0].time
        ax.text(-0.75, at, float(orbit(at, "y")) + 0.1, name, fontsize=10, zorder=9)
    dress(ax, SPAN, HEIGHTS, REACH, ([1.5, 2], ["1.5", "2"]))
    return figure, claims(crossing, sticking)
