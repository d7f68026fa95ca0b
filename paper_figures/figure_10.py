"""Figure 10: as figure 8 without the hidden term: slip only."""

import numpy as np

from paper_figures import oscillator as osc
from paper_figures.claims import Claim
from paper_figures.drawing import layer_visits, three_panels
from paper_figures.sources import solid_friction
from pwsmooth.plotting import new_figure

NAME = "10"
TITLE = "Without static friction the smoothed system only slips"
CAPTION = """
As figure 8 with rho = 0 (eps = beta = 0.1): an oscillation of left and right slip, which passes through the
region where rho = 3 would stick (light) without sticking. Green: |v| <= eps, which it crosses without rest.
At v = 0 this orbit is just inside the linear region, its limit eps -> 0 (1.04 N) is in the nonlinear one.
Everything is dimensionless (m = N = omega = 1).
"""
EPS = 0.1
START = {osc.y: 0.5, osc.v: 0.3, osc.z: 0}


def claims(orbit, exact):
    """What section 8 says of the figure."""
    times = np.linspace(0, osc.PERIOD, 20001)
    y, v = orbit(times, "y"), orbit(times, "v")
    force = np.abs(3.1 * y + 2.4 * np.sin(times))
    crossing = force[np.flatnonzero(np.diff(np.sign(v)))]
    acceleration = np.abs(np.gradient(v, times))[np.abs(v) <= EPS].min()
    stays = ", ".join(f"{duration:.3f}" for _, duration in layer_visits(orbit, EPS))
    limit = [abs(3.1 * exact(at, "y") + 2.4 * np.sin(at)) for at in exact.event_times("crossing")]
    return [
        Claim(
            "left and rightward slip only",
            "no stick",
            f"|v'| >= {acceleration:.3f} while |v| <= eps; stays there of {stays}; event-driven: "
            f"{len(limit)} crossings, {len(osc.sticks(exact))} sticks",
            bool(acceleration > 0.3 and not osc.sticks(exact)),
            "it rests in the layer",
            **solid_friction("section 8, figure 10"),
        ),
        Claim(
            "it pierces the nonlinear sticking region without sticking",
            "N < |k y - q''| <= N mu_s at v = 0",
            f"|k y - q''| = {crossing.max():.4f} N at v = 0 with eps = 0.1, {max(limit):.5f} N as eps -> 0",
            bool(np.all((crossing > 1) & (crossing <= osc.MU_S))),
            "at eps = 0.1 it passes v = 0 just inside the linear region, in a layer too wide to rest in; the "
            "limit eps -> 0 passes through the nonlinear region as said",
            **solid_friction("section 8, figure 10"),
        ),
        Claim(
            "rho changes the global dynamics: stick with rho = 3, none with rho = 0",
            "different orbits",
            f"max y = {y.max():.4f} here, 1.2808 in figure 8",
            abs(y.max() - 1.2808) > 0.01,
            "the orbits are the same",
            **solid_friction("section 8, figure 10"),
        ),
    ]


def draw(fast):
    """The three panels."""
    periods = 40 if fast else 80
    orbit = osc.settled(osc.oscillator(rho=0).smoothed(eps=EPS), START, periods=periods)
    exact = osc.settled(osc.oscillator(rho=0), START, periods=periods)
    figure = new_figure(6.4, 4.6)
    three_panels(figure, orbit, EPS, nonlinear_label="nonlinear (for ρ = 3)")
    return figure, claims(orbit, exact)
