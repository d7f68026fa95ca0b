"""Figure 1: three switching characteristics, made by the models here."""

import math

import numpy as np
import sympy as sp

from paper_figures import oscillator as osc
from paper_figures.claims import Claim
from paper_figures.sources import solid_friction
from pwsmooth import System, solve
from pwsmooth.analysis.sticking import fold
from pwsmooth.plotting import COLOUR, direction_arrows, new_figure

NAME = "1"
TITLE = "Switching characteristics for friction"
CAPTION = """
(i) Coulomb: mu = lam, set-valued at v = 0 (rho = 0). (ii) Static friction: mu = lam (1 + rho gamma(lam)), rho
= 3, whose values on v = 0 reach mu_s = 16/9. (iii) Smoothed with memory, eps = 0.02, beta = 0.1: mu along a
prescribed motion v = sin t against v - eps y; full: rising speed, dashed: falling. Its speed dependence comes
from the memory (the Stribeck speed is beta |v'|, marked), the model has none of its own. Computed, not drawn by hand.
Qualified: (iii) tends to (ii) only if beta/eps -> 0 as well, see the claims. Everything is dimensionless (m =
N = omega = 1).
"""
EPS, BETA = 0.02, 0.1


def prescribed(eps, beta, *, amplitude=1.0):
    """One period of the smoothed model under v = amplitude*sin(t), after a period in which z settles."""
    view = System(
        {osc.y: osc.v, osc.v: amplitude * sp.cos(osc.t), osc.z: (osc.GAMMA - osc.z) / osc.beta},
        time=osc.t,
        parameters={osc.beta: beta},
        outputs={"mu": osc.lam * (1 + 3 * osc.z)},
    ).smoothed(eps=eps)
    start = {osc.y: -amplitude, osc.v: 0.0, osc.z: 0.0}
    return solve(view, (0, 4 * math.pi), start, dense_output=True)


def peak(eps, beta):
    """Largest mu on the rising branch."""
    run = prescribed(eps, beta)
    near = 2 * math.pi + np.concatenate([-np.geomspace(1e-6, 1, 20000)[::-1], np.geomspace(1e-6, 1, 20000)])
    return float(run(near, "mu").max())


def claims():
    """The caption on how the three are related."""
    mu_s = float(fold(osc.GAMMA, osc.lam, 3).mu_s)
    fast, equal, slow = peak(1e-3, 1e-6), peak(1e-3, 1e-3), peak(1e-3, 0.1)
    off = max(abs(top - mu_s) for top in (fast, equal, slow))
    return [
        Claim(
            "(iii) tends to (ii) as beta, eps -> 0",
            f"mu_s = {mu_s:.4f}",
            f"peak {fast:.4f} for beta = eps/1000, {equal:.4f} for beta = eps, {slow:.4f} for beta = 100 eps "
            "(eps = 0.001, v' = 1)",
            off < 0.01 * mu_s,
            "the limits do not commute: the passage takes eps/|v'|; the peak is mu_s only if beta << eps, 1 if "
            "beta >> eps, and between these it is higher than mu_s, for z lags behind lam",
            **solid_friction("figure 1, caption"),
        ),
        Claim(
            "(i) is regained as mu_s -> mu_k",
            "1",
            f"mu_s = {fold(osc.GAMMA, osc.lam, sp.Rational(1, 2)).mu_s} for every rho <= 1/2, "
            f"{float(fold(osc.GAMMA, osc.lam, sp.Rational(6, 10)).mu_s):.4f} at rho = 0.6",
            fold(osc.GAMMA, osc.lam, sp.Rational(1, 2)).mu_s == 1,
            "the fold does not vanish",
            **solid_friction("figure 1, caption"),
        ),
    ]


def _set_valued(ax, rho):
    lam = np.linspace(-1, 1, 401)
    mu = lam * (1 + rho * (1 - lam**2))
    ax.plot([-0.5, 0], [-1, -1], color=COLOUR["left"], label="slip left")
    ax.plot([0, 0.5], [1, 1], color=COLOUR["right"], label="slip right")
    ax.plot(0 * lam, mu, color=COLOUR["stick"], linewidth=2.4, label=r"$v=0$; in (iii) $|v|\leq\varepsilon$")
    return ax


def draw(fast):
    """The three panels."""
    figure = new_figure(5.6, 2.7)
    coulomb, static, memory = figure.subplots(1, 3, sharey=True)
    _set_valued(coulomb, 0)
    _set_valued(static, 3)
    run = prescribed(EPS, BETA)
    for first, dash in ((1.5, "-"), (2.5, "--")):
        times = np.linspace(first * math.pi, (first + 1) * math.pi, 8001)
        v, mu = run(times, "v"), run(times, "mu")
        shown = v - EPS * run(times, "y")
        for side, name in ((v < -EPS, "left"), (np.abs(v) <= EPS, "stick"), (v > EPS, "right")):
            width = 2.4 if name == "stick" else 1.4
            memory.plot(np.where(side, shown, np.nan), mu, dash, color=COLOUR[name], linewidth=width)
        memory.set(xlim=(-0.5, 0.5), ylim=(-2.05, 2.05))
        direction_arrows(memory, shown, mu, (0.3, 0.8))
    for ax, label in ((coulomb, r"$v$"), (static, r"$v$"), (memory, r"$\bar v=v-\varepsilon y$")):
        ax.axhline(0, color=COLOUR["mark"], linewidth=0.5, zorder=0)
        ax.set_xlabel(label)
        ax.set(xlim=(-0.5, 0.5), xticks=(-0.5, 0, 0.5), yticks=(-2, -1, 0, 1, 2))
    for ax in (static, memory):
        for sign in (1, -1):
            ax.axhline(sign * osc.MU_S, color=COLOUR["mark"], linewidth=0.7, linestyle=":", zorder=0)
        ax.text(-0.48, osc.MU_S - 0.06, r"$\mu_s$", va="top")
    static.text(-0.48, -0.94, r"$-\mu_k$", va="bottom")
    # The two scales of (iii), from the places where each acts: the passage, and the decay of the peak.
    for at, width, text in ((-1.4, 2 * EPS, r"$2\varepsilon$"), (0.6, BETA, r"$\beta|\dot v|$")):
        low = -width / 2 if at < 0 else 0.1
        memory.plot([low, low + width], [at, at], "|-", color=COLOUR["mark"], linewidth=1.0, markersize=6)
        memory.text(low + width + 0.03, at, text, va="center")
    coulomb.set_title(r"(i) Coulomb, $\rho=0$", fontsize=8.5)
    static.set_title(r"(ii) static, $\rho=3$", fontsize=8.5)
    memory.set_title(rf"(iii) $\varepsilon={EPS:g},\ \beta={BETA:g}$", fontsize=8.5)
    coulomb.set_ylabel(r"$\mu$")
    figure.legend(*coulomb.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure, claims()
