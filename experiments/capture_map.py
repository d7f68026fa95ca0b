"""E3: eps/beta: at which force is a slipping contact captured, and which orbits follow from that?

    u' = F - L(u)(1 + rho z),   z' = r (G(u) - z),   r = eps/beta        the layer, from u = -inf, z = 0

Part 1: the capture threshold F_c(r) as a separatrix (pwsmooth.analysis.sticking) and, independently, by bisection on
trajectories of the layer with SciPy's LSODA; the ratio r* at which it reaches mu_s; its law for small r.
Part 2: the attractors of the smoothed oscillator over (eps, beta), from a start near each kind of orbit, and
from the orbits at the neighbouring beta.

Expected: F_c rises from N to N mu_s = 16/9, which it reaches at a finite r*: 0.6453 (algebraic), 0.7625 (tanh), 0.9117
(erf). For small r the force passes where z has grown as much as the sigmoid's tail still lacks. Algebraic tail 1 - L =
1/(2 u^2): u' is about 1/(2 u^2), so z = 2 r u there, and rho z = 1/(2 u^2) gives u = (4 rho r)^(-1/3) and F_c - 1 of
order r^(2/3). Exponential tails: z is still 2 r u, u of order log(1/r), so F_c - 1 is of order r log(1/r).
Orbits: eps << beta captures in the linear region only, where one long stick a period is left (an asymmetric pair,
besides the slip-only orbit); eps of the order of beta captures in the nonlinear region: two equal sticks.

Usage: python experiments/capture_map.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from paper_figures import oscillator as osc
from pwsmooth.analysis.maps import Stroboscopic
from pwsmooth.analysis.orbits import refine
from pwsmooth.analysis.sticking import capture_threshold, critical_ratio
from pwsmooth.plotting import COLOUR, new_figure

SIGMOIDS = ("algebraic", "tanh", "erf")
# Starts near the two-stick orbit (eps = beta = 0.1, and slaved), one of the mirror pair, and the slip-only orbit.
STARTS = ((0.9087, -0.9735, 0.019), (0.7587, -1.0046, 0.0), (0.5664, -1.2524, 0.0), (0.6858, -0.8658, 0.0))
KINDS = ("two equal sticks", "one long stick", "slip only")


@dataclass(frozen=True)
class Config:
    """rho = 3, and the grids of r, eps and beta (log10)."""

    rho: float = 3.0
    log_r: tuple[float, float, int] = (-7.0, 0.5, 46)
    checked: tuple[float, ...] = (1e-3, 1e-2, 0.1, 0.3, 0.6)
    log_eps: tuple[float, float, int] = (-3.0, -1.0, 11)
    log_beta: tuple[float, float, int] = (-3.0, 0.0, 13)
    transient: int = 60


def grid(axis):
    return 10 ** np.linspace(*axis)


# ---- part 1


def captured(force, rho, r):
    """Whether a trajectory of the algebraic layer comes to rest; SciPy's LSODA, no use of equilibria or manifolds."""
    from scipy.integrate import solve_ivp

    def rates(_, w):
        # s = asinh u: the tail of the sigmoid fills many decades of u
        z = w[1]
        return [(force - math.tanh(w[0]) * (1 + rho * z)) / math.cosh(w[0]), r * (1 / math.cosh(w[0]) ** 2 - z)]

    def escaped(_, w):
        return w[0] - high

    escaped.terminal = True
    start = -math.asinh(10 + 60 * (force + 1) / r)
    # u beyond the largest saddle, from which u' > 0 for ever: F > 1 + (rho - 1/2)/u^2
    high = math.asinh(10 * math.sqrt((rho + 1) / max(force - 1, 1e-12)))
    run = solve_ivp(
        rates,
        (0, 400 / r),
        [start, 1 / math.cosh(start) ** 2],
        method="LSODA",
        rtol=1e-10,
        atol=1e-13,
        events=escaped,
    )
    return run.status == 0


def by_bisection(rho, r):
    low, high = 1.0, 2 * rho * ((1 + rho) / (3 * rho)) ** 1.5
    while high - low > 1e-7:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if captured(middle, rho, r) else (low, middle)
    return 0.5 * (low + high)


# ---- part 2


def attractor(step, x, transient):
    """The attracting orbit that a start leads to, or None."""
    x = np.array(x)
    for _ in range(3):
        if transient:
            x = step.iterate(x, 1, transient)[0]
        if not np.isfinite(x).all():
            return None
        orbit = refine(step, x)
        if orbit.success and orbit.stable and np.abs(orbit.x - x).max() < 0.1:
            return orbit
        if not transient:
            return None
    return None


def attractors(eps, betas, transient):
    """Kinds of the attracting orbits found at every beta, from the starts and from the orbits at both neighbours."""
    steps = [
        Stroboscopic(osc.oscillator(rho=3, beta=float(b)).smoothed(eps=eps), 2 * sp.pi, options={"rtol": 1e-8})
        for b in betas
    ]
    found = [{} for _ in steps]
    for j, step in enumerate(steps):
        for start in STARTS:
            orbit = attractor(step, start, transient)
            if orbit is not None:
                found[j].setdefault(kind(orbit, eps), orbit.x)
    for order in (range(1, len(steps)), range(len(steps) - 2, -1, -1)):
        for j in order:
            beside = found[j - 1] if order.step > 0 else found[j + 1]
            for which in [k for k in beside if k not in found[j]]:
                orbit = attractor(steps[j], beside[which], 0)
                if orbit is not None:
                    found[j].setdefault(kind(orbit, eps), orbit.x)
    return [sorted(kinds) for kinds in found]


def kind(orbit, eps):
    times = np.linspace(0, 2 * np.pi, 4001)[:-1]
    run = orbit.solution()
    y, v = run(times, "y"), run(times, "v")
    if abs(y.max() + y.min()) > 1e-3:
        return 1
    inside = np.mean(np.abs(v) <= eps) * 2 * np.pi / 2
    # Crossing |v| <= eps <= 0.1 at an acceleration above 1 takes 0.2 at most.
    return 0 if inside > 0.3 else 2


def run(config):
    """Thresholds, critical ratios, checks, and the attractors over (eps, beta)."""
    ratios = grid(config.log_r)
    thresholds = {s: [capture_threshold(config.rho, float(r), sigmoid=s) for r in ratios] for s in SIGMOIDS}
    eps, beta = grid(config.log_eps), grid(config.log_beta)
    kinds = [attractors(float(e), beta, config.transient) for e in eps]
    return {
        "r": ratios,
        "thresholds": thresholds,
        "critical": {s: critical_ratio(config.rho, sigmoid=s) for s in SIGMOIDS},
        "checked": [
            {"r": r, "separatrix": capture_threshold(config.rho, r), "bisection": by_bisection(config.rho, r)}
            for r in config.checked
        ],
        "eps": eps,
        "beta": beta,
        "kinds": kinds,
    }


def claims(data):
    """What was expected beside what was found."""
    r = np.array(data["r"])
    excess = np.array(data["thresholds"]["algebraic"]) - 1
    power = float(np.log(excess[1] / excess[0]) / np.log(r[1] / r[0]))
    off = max(abs(c["separatrix"] - c["bisection"]) for c in data["checked"])
    two, one = (np.array([[k in cell for cell in row] for row in data["kinds"]]) for k in (0, 1))
    ratio = np.array(data["eps"])[:, None] / np.array(data["beta"])
    slow = np.array(data["beta"])[None, :] < 0.11
    i, j = (int(np.argmin(np.abs(np.log(data[k]) - np.log(at)))) for k, at in (("eps", 1e-3), ("beta", 1e-2)))
    corner = data["kinds"][i][j]
    bands = [
        float(np.mean(kind[where]))
        for kind, where in ((two, ratio >= 0.999), (one, (ratio <= 0.011) & slow))
        if where.any()
    ]
    logs = np.array(data["thresholds"]["tanh"]) - 1
    scaled = logs[r < 1e-3] / (r * np.log(1 / r))[r < 1e-3]
    result = [
        claim(
            "separatrix and bisection on trajectories give one threshold", "< 1e-6", f"off by {off:.1e}", off < 1e-6,
            "they differ",
        ),
        Claim.number(f"exponent of F_c - 1 in r at r = {r[0]:.0e}, algebraic",
                     2 / 3, power, 0.01, digits=4, origin="derived"),
        claim(
            "tanh: (F_c - 1)/(r log 1/r) varies slowly", "bounded, no power",
            f"{scaled.min():.2f} to {scaled.max():.2f} over r = {r[0]:.0e} to 1e-3",
            scaled.max() / scaled.min() < 2, "it is no such law",
        ),
        claim(
            "both kinds attract at eps = 0.001, beta = 0.01", "both",
            " and ".join(KINDS[k] for k in corner), {0, 1} <= set(corner), "one of them was not found",
        ),
        claim(
            "two equal sticks attract wherever eps >= beta", "all", f"{100 * bands[0]:.0f} % of the grid points",
            bands[0] == 1, "elsewhere none was found",
        ),
        claim(
            "one long stick attracts wherever eps <= beta/100, beta <= 0.1", "all",
            f"{100 * bands[1]:.0f} % of the grid points", bands[1] == 1,
            "elsewhere none was found",
        ),
    ][: 4 + len(bands)]  # fmt: skip
    # By the strong stable manifold of the merged equilibria, at F = mu_s: a separate computation.
    for sigmoid, value in {"algebraic": 0.64529691, "tanh": 0.76249837, "erf": 0.91166731}.items():
        ours = data["critical"][sigmoid]
        result.append(
            Claim.number(f"critical ratio r*, {sigmoid}", value, ours, 1e-7, digits=8, origin="independent",
                         where="separatrix of the layer, computed apart")
        )  # fmt: skip
    return result


def draw(data):
    """Threshold over r, its excess for small r, and the attractors over (eps, beta)."""
    from matplotlib.lines import Line2D

    figure = new_figure(7.0, 6.4)
    grid = figure.add_gridspec(2, 2, height_ratios=(1, 1.15))
    left, middle, right = (figure.add_subplot(place) for place in (grid[0, 0], grid[0, 1], grid[1, :]))
    styles = {"algebraic": "-", "tanh": "--", "erf": ":"}
    r = np.array(data["r"])
    for sigmoid, line in styles.items():
        F = np.array(data["thresholds"][sigmoid])
        left.semilogx(
            r, F, line, color=COLOUR["exact"], label=f"{sigmoid}, $r^*$ = {data['critical'][sigmoid]:.4f}"
        )
        middle.loglog(r, F - 1, line, color=COLOUR["exact"], label=sigmoid)
    checked = data["checked"]
    left.plot(
        [c["r"] for c in checked], [c["bisection"] for c in checked], "o", color=COLOUR["smoothed"], markersize=4,
        label="bisection on trajectories",
    )  # fmt: skip
    left.axhline(16 / 9, color=COLOUR["mark"], linewidth=0.7)
    left.annotate("$\\mu_s = 16/9$", (r[0], 16 / 9), (2, -11), textcoords="offset points", fontsize=8)
    left.set(
        xlabel="$r = \\varepsilon/\\beta$", ylabel="capture threshold $F_c/N$", title="Captured below the curve"
    )
    left.legend(loc="upper left", bbox_to_anchor=(0.0, 0.86), fontsize=7)
    scale = (np.array(data["thresholds"]["algebraic"])[0] - 1) / r[0] ** (2 / 3)
    small = r < 0.03
    middle.loglog(
        r[small], 1.6 * scale * r[small] ** (2 / 3), color=COLOUR["approximation"], label="$\\propto r^{2/3}$"
    )
    middle.loglog(
        r[small], 2 * r[small] * np.log(1 / r[small]), color=COLOUR["left"], label="$2\\,r\\,\\log(1/r)$"
    )
    middle.set(xlabel="$r = \\varepsilon/\\beta$", ylabel="$F_c/N - 1$", title="Small ratios")
    middle.legend(loc="lower right")
    eps, beta = np.array(data["eps"]), np.array(data["beta"])
    look = {0: ("s", COLOUR["stick"], 6.0), 1: ("o", COLOUR["right"], 4.5), 2: ("x", COLOUR["left"], 4.5)}
    for which, (marker, colour, size) in look.items():
        i, j = np.nonzero([[which in cell for cell in row] for row in data["kinds"]])
        filled = {"markerfacecolor": "none"} if which == 0 else {}
        # Side by side where a cell has several.
        right.loglog(
            eps[i] * 1.07 ** (which - 1),
            beta[j],
            marker,
            color=colour,
            markersize=size,
            linestyle="none",
            **filled,
        )
    ends = np.array([eps[0], eps[-1]])
    right.set(xlim=(eps[0] / 1.4, eps[-1] * 1.4), ylim=(beta[0] / 1.4, beta[-1] * 1.4))
    for ratio in (0.6453, 0.0016):
        right.loglog(ends, ends / ratio, color=COLOUR["mark"], linewidth=0.8)
    right.set(xlabel="$\\varepsilon$", ylabel="$\\beta$", title="Attractors found")
    handles = [
        Line2D(
            [], [], marker=m, color=c, linestyle="none", markersize=s, markerfacecolor="none" if k == 0 else c
        )
        for k, (m, c, s) in look.items()
    ]
    right.legend([*handles, Line2D([], [], color=COLOUR["mark"], linewidth=0.8)],
                 [*KINDS, "$\\varepsilon/\\beta$ = 0.645 and 0.0016"], loc="upper left",
                 bbox_to_anchor=(1.0, 1.0), fontsize=7.5)  # fmt: skip
    return figure


STUDY = Study(
    name="capture_map",
    question="eps/beta: at which force is a slipping contact captured, and which orbits follow from that?",
    expected="F_c rises from N as r^(2/3) (algebraic sigmoid) and reaches N mu_s at a finite r*; one long stick a "
    "period for eps << beta, two equal ones for eps of the order of beta, both in between.",
    full=Config(),
    fast=Config(log_r=(-7.0, 0.5, 12), checked=(0.1,), log_eps=(-3.0, -1.0, 2), log_beta=(-2.0, -1.0, 2)),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
