"""Figure 8: the smoothed oscillator, characteristic, trajectory and time series of its periodic orbit."""

import numpy as np

from paper_figures import oscillator as osc
from paper_figures.claims import Claim
from paper_figures.drawing import layer_visits, three_panels
from paper_figures.sources import solid_friction
from pwsmooth.plotting import new_figure

NAME = "8"
TITLE = "Stick-slip oscillation of the smoothed system"
CAPTION = """
Smoothed system, eps = beta = 0.1, rho = 3, k = 3.1, c = 0.1, N = 1, sigma = 2.4, omega = 1. Top left:
friction characteristic against v - eps y. Right: the periodic orbit in (t, y, v). Bottom left: y and v, with
the regions of linear (dark) and nonlinear (light) sticking, which y leaves before |v| > eps: the force goes beyond N
mu_s in the layer. Green: |v| <= eps. Not reproduced: the source
describes one stick a period, for about pi/2, and one direct crossing. The printed parameters give a symmetric
orbit with two equal sticks; the kind that sticks once a period is what eps << beta gives (figure 9, right).
Everything is dimensionless (m = N = omega = 1).
"""
EPS = 0.1
START = {osc.y: 0.5, osc.v: 0.3, osc.z: 0}


def claims(orbit, relaxing):
    """What section 8 says of the figure."""
    visits, one = layer_visits(orbit, EPS), osc.sticks(relaxing)
    times = np.linspace(0, osc.PERIOD, 4001)
    y, v, mu = orbit(times, "y"), orbit(times, "v"), orbit(times, "mu")
    reached = _forces(orbit)
    symmetric = np.abs(y[:2001] + y[2000:]).max()
    return [
        Claim(
            "once per period it sticks, once it crosses directly",
            "one stick, one crossing",
            f"{len(visits)} equal stays in |v| <= eps, of {', '.join(f'{d:.3f}' for _, d in visits)}; "
            f"|y(t) + y(t + pi)| <= {symmetric:.1e}",
            sorted(d > 0.5 * max(d for _, d in visits) for _, d in visits) == [False, True],
            f"eps = beta gives the symmetric orbit; eps -> 0 at beta = 0.1 gives {len(one)} stick a period, "
            f"of {one[0].duration:.3f}, and a direct crossing",
            **solid_friction("section 8, figure 8"),
        ),
        Claim(
            "it sticks for a time interval of about pi/2",
            "1.57",
            f"{visits[0][1]:.3f} (|v| <= eps)",
            abs(visits[0][1] - np.pi / 2) < 0.1,
            f"neither kind of orbit does: {one[0].duration:.4f} is the longest stick, at eps -> 0",
            **solid_friction("section 8, figure 8"),
        ),
        Claim(
            "a stick-slip oscillation: sticking in the nonlinear region",
            "N < |k y - q''| <= N mu_s = 1.7778 while it sticks",
            f"while |v| <= eps |k y - q''| is {reached[0]:.4f} to {reached[1]:.4f} N",
            1 < reached[0] and reached[1] <= osc.MU_S,
            "it begins in the nonlinear region and ends beyond it: in a layer as wide as eps = 0.1 slip begins inside",
            **solid_friction("section 8, figure 8"),
        ),
        Claim(
            "beta is fast enough for spikes of static friction",
            "spikes",
            f"|mu| reaches {np.abs(mu).max():.4f}; |v| reaches {np.abs(v).max():.3f}",
            bool(np.abs(mu).max() > 1.2),
            "no spikes are seen",
            **solid_friction("section 8, figure 8"),
        ),
    ]


def _forces(orbit):
    """(least, largest) force on the friction while |v| <= eps."""
    times = np.linspace(0, osc.PERIOD, 20001)
    inside = np.abs(orbit(times, "v")) <= EPS
    force = np.abs(3.1 * orbit(times, "y") + 2.4 * np.sin(times))[inside]
    return float(force.min()), float(force.max())


def draw(fast):
    """The three panels."""
    periods = 100 if fast else 300  # the symmetric orbit attracts slowly: it is near its loss of symmetry
    orbit = osc.settled(osc.oscillator().smoothed(eps=EPS), START, periods=periods)
    relaxing = osc.settled(osc.oscillator(), osc.RELAXING_START, periods=periods)
    figure = new_figure(6.4, 4.6)
    three_panels(figure, orbit, EPS)
    return figure, claims(orbit, relaxing)
