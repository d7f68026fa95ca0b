"""Figure 4: equilibria of the fast transition, y = (q'' - N mu(lam))/k with mu = lam (1 + rho gamma(lam)).

The attracting branch d mu/d lam > 0 ends in folds at lam = +-lam_s if rho > 1/2, and at lam = +-1 otherwise.
"""

import math

import numpy as np
import sympy as sp
from scipy.optimize import minimize_scalar

from paper_figures.claims import Claim
from paper_figures.sources import solid_friction
from pwsmooth.analysis.sticking import fold
from pwsmooth.plotting import COLOUR, LINEAR_SHADE, NONLINEAR_SHADE, new_figure

NAME = "4"
TITLE = "Sticking equilibria and their folds"
CAPTION = """
The graph y = (q'' - N mu(lam))/k at q'' = 0, k = 3.1, N = 1 with gamma = 1 - lam^2. Full: attracting in the
fast transition; dashed: repelling. Left, rho = 3: folds at lam = +-2/3. Right, rho = 0.4 < 1/2: no fold
inside, the extreme values lie at lam = +-1. Shaded: displacements of linear (dark) and nonlinear (light)
sticking.
"""
K, N = 3.1, 1.0
LAM, RHO = sp.Symbol("lam", real=True), sp.Symbol("rho", positive=True)
GAMMA = 1 - LAM**2


def displacement(lam, rho):
    """y at q'' = 0."""
    return -N * lam * (1 + rho * (1 - lam**2)) / K


def greatest(rho):
    """(lam, mu) of the largest mu on [0, 1], by a search."""
    found = minimize_scalar(
        lambda x: -x * (1 + rho * (1 - x * x)), bounds=(0, 1), method="bounded", options={"xatol": 1e-12}
    )
    return float(found.x), -float(found.fun)


def claims():
    """Eqs. (16), (17) and the closed forms for gamma = 1 - lam**2."""
    three = fold(GAMMA, LAM, 3)
    strengths = (0.6, 1.0, 3.0, 10.0)
    highest = [greatest(rho) for rho in strengths]  # by search, without the closed form
    at = [math.sqrt((1 + rho) / (3 * rho)) for rho in strengths]
    high = [2 * rho * x**3 for rho, x in zip(strengths, at)]
    off = [
        max(abs(found[i] - value) for found, value in zip(highest, printed))
        for i, printed in enumerate((at, high))
    ]
    low = [greatest(rho) for rho in (0.1, 0.4, 0.5)]
    slope = sp.diff(GAMMA, LAM).subs(LAM, three.lam_s)
    lam_s = float(three.lam_s)
    place = lam_s / math.sqrt(1 - lam_s**2)  # v/eps of the algebraic sigmoid
    by_speed = 3 * 2 * place / (1 + place**2) ** 2 * lam_s**2 / 1e-3  # -rho (d gamma/dv) lam_s^2 at eps = 0.001
    zeta = np.linspace(-1, 1, 2001)
    growth = -N * (1 + 3 * (1 - 3 * zeta**2))  # d lam'/d lam at rho = 3
    repelled = zeta[(growth > 0) & (np.abs(zeta) < max(1, lam_s))]
    kept = growth[np.abs(zeta) < min(1, lam_s)].max()
    return [
        Claim(
            "lam_s = sqrt((1 + rho)/(3 rho)); at rho = 3",
            "2/3",
            f"{three.lam_s}; a search for the largest mu at rho = 0.6, 1, 3, 10 is off by {off[0]:.1e}",
            three.lam_s == sp.Rational(2, 3) and off[0] < 1e-6,  # a maximum is found to the root of rounding
            "the fold lies elsewhere",
            **solid_friction("section 5, (16)"),
        ),
        Claim(
            "mu_s = 2 rho ((1 + rho)/(3 rho))^(3/2) for rho > 1/2; at rho = 3",
            "16/9",
            f"{three.mu_s}; largest mu by search at rho = 0.6, 1, 3, 10: off by {off[1]:.1e}",
            three.mu_s == sp.Rational(16, 9) and off[1] < 1e-12,
            "the closed form differs",
            **solid_friction("section 5, (17)"),
        ),
        Claim(
            "(17): mu_s = -rho (d gamma/dv) lam_s^2",
            f"mu_s = {three.mu_s}",
            f"{by_speed:.4f} with the algebraic sigmoid at eps = 0.001, of order 1/eps; with the derivative by lam "
            f"{-3 * slope * three.lam_s**2}",
            abs(by_speed - float(three.mu_s)) < 1e-3,
            "d gamma/dv is infinite on v = 0; with d gamma/d lam the formula is the fold's height",
            **solid_friction("(17)"),
        ),
        Claim(
            "for rho <= 1/2 the extreme values lie at lam = +-1",
            "mu_s = 1",
            "largest mu by search at rho = 0.1, 0.4, 0.5: "
            + ", ".join(f"{mu:.6f} at lam = {x:.4f}" for x, mu in low),
            all(abs(mu - 1) < 1e-7 and x > 0.999 for x, mu in low),
            "a fold lies inside",
            **solid_friction("section 5, (17)"),
        ),
        Claim(
            "appendix B: attracting for |zeta| < max(1, lam_s)",
            "max(1, lam_s)",
            f"at rho = 3 d lam'/d lam is {growth.max():.3g} at |zeta| = {abs(zeta[np.argmax(growth)]):.3g}, repelling "
            + (f"from {np.abs(repelled).min():.3f} on" if repelled.size else "nowhere")
            + f"; for |zeta| < min(1, lam_s) it is {kept:.1e} at most",
            not repelled.size,
            "the source's own proof gives min: for lam_s < 1 the branch beyond the fold is of saddle type",
            **solid_friction("appendix B, proposition 5"),
        ),
    ]


def _panel(ax, rho):
    lam = np.linspace(-1, 1, 801)
    y = displacement(lam, rho)
    attracting = np.gradient(y, lam) < 0
    top = float(np.max(np.abs(y)))
    ax.axhspan(-top, top, color=NONLINEAR_SHADE, linewidth=0, zorder=0)
    ax.axhspan(-N / K, N / K, color=LINEAR_SHADE, linewidth=0, zorder=0)
    ax.plot(lam, np.where(attracting, y, np.nan), color=COLOUR["stick"], linewidth=2, label="attracting")
    if not attracting.all():
        ax.plot(
            lam, np.where(attracting, np.nan, y), "--", color=COLOUR["stick"], linewidth=1.6, label="repelling"
        )
        lam_s = float(fold(GAMMA, LAM, sp.nsimplify(rho)).lam_s)
        for sign in (1, -1):
            ax.plot(sign * lam_s, displacement(sign * lam_s, rho), "o", color=COLOUR["mark"], markersize=5)
            ax.vlines(
                sign * lam_s,
                -0.78,
                displacement(sign * lam_s, rho),
                colors=COLOUR["mark"],
                linewidth=0.7,
                linestyles=":",
            )
            name = r"$\lambda_s=\frac{2}{3}$" if sign > 0 else r"$-\lambda_s$"
            ax.text(sign * lam_s + 0.03, -0.76, name, ha="left")
    ax.axhline(0, color=COLOUR["mark"], linewidth=0.5)
    ax.text(0.98, N / K - 0.02, "linear sticking", va="top", ha="right", fontsize=8)
    if top > 1.01 * N / K:
        ax.text(0.98, top - 0.02, "nonlinear sticking", va="top", ha="right", fontsize=8)
    ax.set(xlim=(-1, 1), ylim=(-0.8, 0.8), xticks=(-1, 0, 1), xlabel=r"$\lambda$")
    return ax


def draw(fast):
    """Both panels."""
    figure = new_figure(5.4, 3.2)
    left, right = figure.subplots(1, 2, sharey=True)
    _panel(left, 3).set_title(r"(i) $\rho=3$: folds at $\pm\lambda_s$")
    _panel(right, 0.4).set_title(r"(ii) $\rho=0.4$: extremes at $\pm1$")
    left.set_ylabel(r"$y=(\ddot q-N\mu(\lambda))/k$  at $\ddot q=0$")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=2, handlelength=2.4)
    return figure, claims()
