"""Figure 12: large kicks, kappa = 5 eps: nonlinear sticking is broken up."""

import numpy as np

from paper_figures import kicked
from paper_figures.claims import Claim
from paper_figures.sources import solid_friction
from pwsmooth.plotting import new_figure

NAME = "12"
SHARES = "kicked"
TITLE = "Large noise: nonlinear sticking is broken up"
CAPTION = """
As figure 11 with kappa = 5 eps. The source says that such kicks destroy nonlinear sticking and that the system then
behaves as if rho = 0. What is seen: the unbroken nonlinear stick is lost, but the layer captures the kicked state again
and again, so that a part of the time stuck beyond N remains; less of it under normal kicks, whose standard deviation
at the same kappa is sqrt 3 times as large. Everything is dimensionless (m = N = omega = 1).
"""
KAPPA = 5 * kicked.EPS
LOST = 0.1  # of the noise-free value: what counts as lost


def claims(orbit, slip_only, found):
    """What section 8 says of the figure."""
    total, ratios = kicked.summary(found, 0)
    unbroken, _ = kicked.summary(found, 1)
    gone = {law: np.mean(found[law][:, 0] < LOST * found[None][:, 0].mean()) for law in kicked.LAWS}
    shares = ", ".join(f"{100 * gone[law]:.0f} % ({law})" for law in kicked.LAWS)
    return [
        Claim(
            "nonlinear sticking is destroyed by kicks of size kappa = 5 eps",
            "destroyed: the segment of sticking is removed",
            f"nonlinear stick time a half period: {total}; below a tenth of the noise-free time in {shares} of the "
            f"half periods; longest that no kick breaks: {unbroken}",
            bool(max(ratios.values()) < LOST),
            "it is reduced and not removed: after most kicks out of it the layer captures the state again as long as "
            "the force is not far beyond N",
            **solid_friction("section 8, figure 12"),
        ),
        Claim(
            "with sufficient noise the system behaves as if rho = 0",
            "as rho = 0",
            f"rho = 0 without noise: nonlinear stick time {slip_only[:, 0].mean():.4f}; rho = 3 at 5 eps: {total}",
            bool(max(ratios.values()) < LOST),
            "at 5 eps it is on the way there: the time stuck beyond N falls further with larger kicks (study E5)",
            **solid_friction("section 8, figure 12"),
        ),
    ]


def draw(fast):
    """The three panels."""
    orbit = kicked.free_orbit()
    found = kicked.statistics(KAPPA, *kicked.effort(fast))
    slip_only = kicked.half_periods(kicked.free_orbit(rho=0.0), 0.0, "uniform", 0, 1)
    figure = new_figure(6.6, 4.8)
    kicked.panels(figure, orbit, KAPPA, found)
    return figure, claims(orbit, slip_only, found)
