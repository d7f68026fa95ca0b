"""Figure 11: small kicks, kappa = eps/5: nonlinear sticking persists."""

import numpy as np

from paper_figures import kicked
from paper_figures.claims import Claim
from paper_figures.sources import solid_friction
from pwsmooth.plotting import new_figure

NAME = "11"
SHARES = "kicked"
TITLE = "Small noise: nonlinear sticking persists"
CAPTION = """
Smoothed system, eps = beta = 0.001, rho = 3, k = 3.1, c = 0.1, N = 1, sigma = 2.4, omega = 1; after every 1/500 of
a period y and v are displaced at random by kappa = eps/5. Top left: y and v without noise (full) and with uniform
kicks (thin: 20 seeds, which coincide with it), over the regions of linear (dark) and nonlinear (light) sticking.
Bottom left: v in units of eps about one stick; stuck is |v| <= 2 eps here, for kicks move v by eps/5. Right: over
many seeds and both laws (uniform on [-kappa, kappa]; normal with standard deviation kappa), the share of half
periods in which nonlinear sticking lasts longer than the time below. The source prints no law and shows one run.
Everything is dimensionless (m = N = omega = 1).
"""
KAPPA = kicked.EPS / 5


def claims(orbit, noisy, found):
    """What section 8 says of the figure."""
    text, ratios = kicked.summary(found, 0)
    shortest = min(found[law][:, 0].min() for law in kicked.LAWS)
    distance = np.abs(noisy["y"] - orbit(noisy.t, "y")).max()
    return [
        Claim(
            "nonlinear sticking persists for kicks of size kappa = eps/5",
            "it persists",
            f"nonlinear stick time a half period: {text}; the shortest of all {shortest:.3f}",
            bool(min(ratios.values()) > 0.95 and shortest > 0.5 * found[None][:, 0].mean()),
            "the time is shortened",
            **solid_friction("section 8, figure 11"),
        ),
        Claim(
            "the noisy and noise-less trajectories closely coincide",
            "coincide",
            f"|y - y0| <= {distance:.4f} over a period, {100 * distance / np.abs(orbit['y']).max():.1f} % of the "
            f"amplitude; the kicks alone add up to kappa sqrt(500/3) = {KAPPA * np.sqrt(500 / 3):.4f}",
            # The oscillator's own response to a random walk of that size: a few times as much.
            bool(distance < 5 * KAPPA * np.sqrt(500 / 3)),
            "they are farther apart than the kicks add up to",
            **solid_friction("section 8, figure 11"),
        ),
    ]


def draw(fast):
    """The three panels."""
    orbit = kicked.free_orbit()
    found = kicked.statistics(KAPPA, *kicked.effort(fast))
    figure = new_figure(6.6, 4.8)
    noisy = kicked.panels(figure, orbit, KAPPA, found)
    return figure, claims(orbit, noisy, found)
