"""Figure 9: the friction characteristic of the smoothed oscillator as eps falls."""

import numpy as np

from paper_figures import oscillator as osc
from paper_figures.claims import Claim
from paper_figures.drawing import layer_visits, phase_legend, smoothed_characteristic
from paper_figures.sources import solid_friction
from pwsmooth.plotting import COLOUR, new_figure

NAME = "9"
TITLE = "Friction characteristic of the smoothed system as eps falls"
CAPTION = """
Characteristic against v - eps y along the periodic orbit, parameters of figure 8 except (i) eps = beta = 0.01
and (ii) eps = 0.01, beta = 0.1. Green: |v| <= eps; slip continues beyond the frame. Dotted: +-mu_s.
Reproduced: in (ii) the spike of the direct transition has shrunk away, that at the end of sticking has not.
Which branch keeps it depends on which orbit of the mirror pair is drawn. Everything is dimensionless (m = N =
omega = 1).
"""
CASES = (("(i)", 0.01, 0.01), ("(ii)", 0.01, 0.1))
START = {osc.y: 0.6, osc.v: -1.07, osc.z: 0}


def spikes(orbit, eps):
    """Largest |mu| on either side of mu = 0 in |v| <= 30 eps: (upper, lower)."""
    times = np.linspace(0, osc.PERIOD, 200001)
    near = np.abs(orbit(times, "v")) <= 30 * eps
    mu = orbit(times, "mu")[near]
    return mu.max(), -mu.min()


def claims(orbits):
    """What section 8 says of the figure."""
    (first, second) = (spikes(orbit, eps) for orbit, (_, eps, _) in zip(orbits, CASES))
    visits = [layer_visits(orbit, eps) for orbit, (_, eps, _) in zip(orbits, CASES)]
    return [
        Claim(
            "(i): as eps falls at eps = beta, spikes in both branches",
            "two spikes of mu_s = 1.7778",
            f"{first[0]:.4f} and {first[1]:.4f}",
            min(first) > 1.5 and max(first) < 1.1 * osc.MU_S,
            "a spike is missing or far off mu_s",
            **solid_friction("section 8, figure 9"),
        ),
        Claim(
            "(ii): with beta slower than eps one spike shrinks",
            "one spike shrinks",
            f"{max(second):.4f} and {min(second):.4f}",
            min(second) < 0.8 * min(first),
            "both spikes remain",
            **solid_friction("section 8, figure 9"),
        ),
        Claim(
            "(ii): the spike from stick to slip is unaffected",
            "same height as in (i)",
            f"{max(first):.4f} in (i), {max(second):.4f} in (ii)",
            abs(max(first) - max(second)) < 0.02,
            "z runs away while lam goes to 1, since eps << beta has no fold: the spike grows",
            **solid_friction("section 8, figure 9"),
        ),
        Claim(
            "(ii) crosses directly once a period",
            "one short transition",
            "stays in |v| <= eps of "
            + " and ".join(f"{d:.4f}" for _, d in sorted(visits[1], key=lambda v: v[1])),
            min(d for _, d in visits[1]) < 0.1 * max(d for _, d in visits[1]),
            "both stays are long",
            **solid_friction("section 8, figure 9"),
        ),
    ]


def draw(fast):
    """Both panels."""
    figure = new_figure(5.6, 3.1)
    panels = figure.subplots(1, 2, sharey=True)
    orbits = []
    for ax, (name, eps, beta) in zip(panels, CASES):
        view = osc.oscillator(beta=beta).smoothed(eps=eps)
        orbit = osc.settled(view, START, periods=40 if fast else 100)
        orbits.append(orbit)
        ax.set_xlim(-0.25, 0.25)
        ax.set_ylim(-2.5, 2.5)
        smoothed_characteristic(ax, orbit, eps, eps)
        for sign in (1, -1):
            ax.axhline(sign * osc.MU_S, color=COLOUR["mark"], linewidth=0.7, linestyle=":", zorder=0)
        ax.set_xlabel(r"$\bar v=v-\varepsilon y$")
        ax.set_title(rf"{name} $\varepsilon={eps:g},\ \beta={beta:g}$")
    panels[0].text(-0.245, osc.MU_S + 0.05, r"$\mu_s=\frac{16}{9}$", va="bottom")
    phase_legend(
        panels[0], loc="lower right", handlelength=1.4, frameon=True, facecolor="white", edgecolor="none"
    )
    panels[0].set_ylabel(r"$\mu$")
    return figure, claims(orbits)
