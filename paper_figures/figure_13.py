"""Figure 13: the friction characteristics of figures 11 and 12."""

import numpy as np

from paper_figures import kicked
from paper_figures import oscillator as osc
from paper_figures.claims import Claim
from paper_figures.drawing import phase_legend, smoothed_status
from paper_figures.sources import solid_friction
from pwsmooth.plotting import COLOUR, by_phase, new_figure

NAME = "13"
SHARES = "kicked"
TITLE = "Friction characteristics under small and under large noise"
CAPTION = """
Friction coefficient mu against v of figure 11 (i, kappa = eps/5) and of figure 12 (ii, kappa = 5 eps): one period
without noise (full: blue slip right, orange slip left, green |v| <= eps) and under uniform kicks (thin grey: one
period at all times; dots: the states just before each kick, over ten periods of one seed). The peaks that large
kicks miss just before a kick are reached right after one. v is on the scale of asinh(v/2 eps), linear about 0 and
logarithmic far from it; beyond the frame mu stays near +-1. Dashed: the static peaks mu_s = 16/9. Everything is
dimensionless (m = N = omega = 1).
"""
SMALL, LARGE = kicked.EPS / 5, 5 * kicked.EPS
PERIODS = 10


def characteristic(ax, orbit, kappa):
    """mu against v with and without noise."""
    times = np.linspace(0, osc.PERIOD, 100001)
    v, mu = orbit(times, "v"), orbit(times, "mu")
    asked = kicked.before_kicks(PERIODS)
    run = kicked.kicked_orbit(orbit, kappa, "uniform", 1, PERIODS, t_eval=asked, rtol=1e-6)
    ax.plot(run["v"] / kicked.EPS, run["mu"], ".", color=COLOUR["mark"], markersize=2.2, alpha=0.55, zorder=3,
            label="just before kicks")  # fmt: skip
    between = ((np.arange(kicked.KICKS)[:, None] + kicked.BETWEEN) * kicked.EVERY).ravel()
    run = kicked.kicked_orbit(orbit, kappa, "uniform", 1, 1, t_eval=between, rtol=1e-6)
    ax.plot(run["v"] / kicked.EPS, run["mu"], color="#BBBBBB", linewidth=0.4, zorder=1, label="all times")
    by_phase(ax, smoothed_status(v, kicked.EPS), v / kicked.EPS, mu, linewidth=1.5)
    for side in (1, -1):
        ax.axhline(side * osc.MU_S, color=COLOUR["mark"], linewidth=0.7, linestyle="--")
    ax.set_xscale("asinh", linear_width=2)  # smooth, where symlog would put kinks into the curves
    ax.set_xticks([-100, -10, -1, 0, 1, 10, 100], ["-100", "-10", "", "0", "", "10", "100"])
    ax.minorticks_off()
    ax.set(xlabel=r"$v/\varepsilon$", xlim=(-250, 250), ylim=(-4.2, 4.2))
    return ax


def claims(small, large):
    """What section 8 says of the figure, by both measures."""
    result = []
    for name, found, exhibits in (("(i) small", small, True), ("(ii) large", large, False)):
        shares, words = [], []
        for column, when in ((3, "at all times"), (2, "just before kicks")):
            text, _ = kicked.summary(found, column)
            reach = {law: np.mean(found[law][:, column] > 1.6) for law in kicked.LAWS}
            shares.append(reach)
            told = ", ".join(f"{100 * reach[law]:.0f} % ({law})" for law in kicked.LAWS)
            words.append(f"{when}: {text}; above 1.6, nine tenths of mu_s, in {told} of the half periods")
        always, sampled = shares
        good = min(always.values()) > 0.9 if exhibits else max(always.values()) < 0.1
        result.append(
            Claim(
                f"{name} noise: the characteristic, at all times, "
                + ("exhibits the static friction peaks" if exhibits else "misses the static friction peaks"),
                "peaks" if exhibits else "no peaks",
                "largest |mu| while |v| <= 2 eps, " + "; ".join(words),
                bool(good),
                "they are missed now and then"
                if exhibits
                else "it depends on when one looks: a kick in the layer raises |mu| to as much as 1 + 3 z, and only"
                f" just before the next one are the peaks missed ({100 * max(sampled.values()):.0f} % at most)",
                **solid_friction("section 8, figure 13"),
            )
        )
    return result


def draw(fast):
    """The two characteristics."""
    orbit = kicked.free_orbit()
    figure = new_figure(6.0, 3.6)
    left, right = figure.subplots(1, 2, sharey=True)
    for ax, kappa, title in (
        (left, SMALL, r"(i) $\kappa=\varepsilon/5$"),
        (right, LARGE, r"(ii) $\kappa=5\varepsilon$"),
    ):
        characteristic(ax, orbit, kappa).set_title(title)
    left.set_ylabel(r"$\mu$")
    left.axhline(osc.MU_S, color=COLOUR["mark"], linewidth=0.7, linestyle="--", label=r"$\pm\mu_s$")
    phase_legend(left).remove()
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3, markerscale=3)
    found = [kicked.statistics(kappa, *kicked.effort(fast)) for kappa in (SMALL, LARGE)]
    return figure, claims(*found)
