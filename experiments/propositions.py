"""E4: the source's propositions 1 to 5 and its jump at a fold, as numerical checks with measured exponents.

Every proposition says that something tends to a limit as eps or beta -> 0. Here each is a sequence of solutions, and
the order is the slope of log(distance) over log(eps or beta) at its small end.

    1  slip:          z to O(beta, eps) of 0 where |v| >> eps             expected: z = Gamma = (eps/v)^2, order 2
    2  static mode:   z to O(beta) of gamma(lam) while sticking           expected: order 1
    3  manifolds:     |g| while sticking is O(eps), away from folds       expected: order 1 (g = v' + c v, v = eps u)
    4  sticking flow: the smoothed state to the sliding one               expected: 1 while it sticks, and 4/5 after
                      leaving by |lam| = 1 with the algebraic sigmoid (a tail 1/u^2 ends the stick)
    5  rest:          survives up to A = N mu_s (k y = 0) as beta -> 0; transversally attracting for |lam| < lam_s
                      expected: excess of A of order beta (a parabolic maximum passes a fold: x' = -a + t^2 + x^2 in
                      units beta); the eigenvalue's sign changes at lam_s = 2/3 + O(eps)
    6  jump:          delayed past the fold by O(eps^(2/3)) where eps/beta is fixed, and in the relaxing regime, where
                      the layer has no fold, by O(beta^(2/3))

Usage: python experiments/propositions.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from paper_figures import oscillator as osc
from pwsmooth import solve
from pwsmooth.paths.linearised import linearise
from pwsmooth.plotting import COLOUR, new_figure

MU_S, LAM_S = 16 / 9, 2 / 3
# A stick of the slaved orbit (spec, section 4): y, and a time inside it.
Y, BEGIN, END = -1.17358823, 1.9, 2.6
TIGHT = {"rtol": 1e-11, "atol": 1e-13}
FINE = {"rtol": 1e-9, "atol": 1e-13}


@dataclass(frozen=True)
class Config:
    """log10 ranges of eps and beta, and how many values."""

    log_eps: tuple[float, float, int] = (-2.0, -5.0, 7)
    log_beta: tuple[float, float, int] = (-1.5, -4.5, 7)


def grid(axis):
    return 10 ** np.linspace(*axis)


def force(t):
    """q'' - k y in the stick."""
    return -2.4 * np.sin(t) - 3.1 * Y


def resting(t, eps):
    """The state that sticks at equilibrium: v = eps u with F = lam (1 + 3 (1 - lam^2)), z = gamma."""
    lam = brentq(lambda x: x * (4 - 3 * x * x) - force(t), 0, LAM_S)
    return {"y": Y, "v": eps * lam / np.sqrt(1 - lam**2), "z": 1 - lam**2}


FOLD = brentq(lambda t: force(t) - MU_S, BEGIN, END)


def slip(eps):
    """Proposition 1: z after half a unit of time of slip at v of order 1, and v there; beta = eps."""
    run = solve(osc.oscillator(beta=eps).smoothed(eps=eps), (0, 0.5), {"y": 0, "v": 1.5, "z": 0.5}, **FINE)
    return run.x[2, -1], run.x[1, -1]


def static(beta):
    """Proposition 2: |z - gamma(lam)| in the middle of the stick, where lam still moves."""
    run = solve(osc.oscillator(beta=beta), (BEGIN, 2.1), resting(BEGIN, 0.0), **TIGHT)
    return abs(run.x[2, -1] - (1 - run.mult[0, -1] ** 2))


def manifold(eps):
    """Proposition 3: |g| = |q'' - k y - N Lambda (1 + rho z)| in the stick at beta = 0.1."""
    run = solve(osc.oscillator(beta=0.1).smoothed(eps=eps), (BEGIN, 2.1), resting(BEGIN, eps), **FINE)
    y, mu = run.x[0, -1], run["mu"][-1]
    return abs(-2.4 * np.sin(2.1) - 3.1 * y - mu)


def flow(eps, end):
    """Proposition 4: distance of the smoothed state from the sliding one, at beta = 0.1."""
    exact = solve(osc.oscillator(beta=0.1), (BEGIN, end), resting(BEGIN, 0.0), **TIGHT)
    smooth = solve(osc.oscillator(beta=0.1).smoothed(eps=eps), (BEGIN, end), resting(BEGIN, eps), **FINE)
    return np.abs(exact.x[[0, 2], -1] - smooth.x[[0, 2], -1]).max()


def rest_limit(beta):
    """Proposition 5: the largest A at which y = 0 rests for ever under q'' = A sin t."""

    def rests(A):
        system = osc.oscillator(beta=beta, sigma=A)
        # At beta = 1 the memory of z = 1 at the start takes some periods to go.
        run = solve(system, (0, (4 if beta < 0.1 else 40) * np.pi), {"y": 0, "v": 0, "z": 1}, rtol=1e-10)
        return not any(e.kind.startswith("slip") for e in run.events)

    low, high = 1.7, 3.0
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rests(middle) else (low, middle)
    return low


def saddle_begins(eps):
    """Proposition 5: lam at which the state at rest becomes a saddle (no drive, beta = eps)."""
    view = osc.oscillator(beta=eps, sigma=0.0).smoothed(eps=eps)
    line, p = linearise(view.model), np.array(view.parameter_values)

    def determinant(lam):
        y = -lam * (4 - 3 * lam**2) / 3.1
        x = np.array([[y], [eps * lam / np.sqrt(1 - lam**2)], [1 - lam**2]])
        block = line.blocks(np.zeros(1), x, np.zeros((0, 1)), p).f_w[0, 1:, 1:]
        return np.linalg.det(block) * eps**2

    return brentq(determinant, 0.5, 0.8, xtol=1e-14)


def jump_of_layer(eps):
    """Proposition 6: delay past the fold at eps/beta = 1, until lam = 0.95."""
    run = solve(
        osc.oscillator(beta=eps).smoothed(eps=eps), (BEGIN, END), resting(BEGIN, eps), dense_output=True, **FINE
    )
    level = eps * 0.95 / np.sqrt(1 - 0.95**2)
    k = int(np.flatnonzero(run.x[1] > level)[0])
    return brentq(lambda t: float(run(t, "v")) - level, run.t[k - 1], run.t[k], xtol=1e-14) - FOLD


def jump_of_memory(beta):
    """Proposition 6, relaxing regime: delay of the slip past the time at which F = N mu_s."""
    run = solve(osc.oscillator(beta=beta), (BEGIN, END + 0.2), resting(BEGIN, 0.0), **TIGHT)
    return run.event_times("slip")[0] - FOLD


def run(config):
    """All sequences."""
    eps, beta = grid(config.log_eps), grid(config.log_beta)
    slips = [slip(e) for e in eps]
    return {
        "eps": eps,
        "beta": beta,
        "slip": [z for z, _ in slips],
        "slip_over_gamma": [z / (e / v) ** 2 for e, (z, v) in zip(eps, slips)],
        "static": [static(b) for b in beta],
        "manifold": [manifold(e) for e in eps],
        "sticking": [flow(e, 2.1) for e in eps],
        "after": [flow(e, 3.6) for e in eps],
        "rest": [rest_limit(b) - MU_S for b in beta],
        "rest_printed": {str(b): rest_limit(b) for b in (0.01, 0.1, 0.5, 1.0)},
        "saddle": [abs(saddle_begins(e) - LAM_S) for e in eps],
        "jump_layer": [jump_of_layer(e) for e in eps],
        "jump_memory": [jump_of_memory(b) for b in beta],
    }


# name, over which variable, expected order, how near, what it is
SEQUENCES = (
    ("slip", "eps", 2, 0.05, "1: z while slipping"),
    ("static", "beta", 1, 0.05, "2: |z - gamma| while sticking"),
    ("manifold", "eps", 1, 0.05, "3: distance from the manifold"),
    ("sticking", "eps", 1, 0.05, "4: smoothed flow, while sticking"),
    ("after", "eps", 0.8, 0.05, "4: smoothed flow, after the stick"),
    ("rest", "beta", 1, 0.05, "5: A at rest beyond N mu_s"),
    ("saddle", "eps", 1, 0.05, "5: saddle begins, from lam_s"),
    ("jump_layer", "eps", 2 / 3, 0.05, "6: delay past the fold, eps/beta = 1"),
    ("jump_memory", "beta", 2 / 3, 0.05, "6: delay past the fold, relaxing"),
)


WORDS = {"mu_s": "$\\mu_s$", "lam_s": "$\\lambda_s$", "gamma": "$\\gamma$", "eps/beta": "$\\varepsilon/\\beta$"}


def order(data, name, over):
    """Slope at the small end: the last two values."""
    x, d = np.array(data[over], float), np.array(data[name], float)
    return float(np.log(d[-1] / d[-2]) / np.log(x[-1] / x[-2]))


def claims(data):
    """Expected orders beside measured ones, and the printed limits of rest."""
    result = [
        Claim.number(f"order of proposition {text}", expected, order(data, name, over), near, digits=3)
        for name, over, expected, near, text in SEQUENCES
    ]
    ratios = np.array(data["slip_over_gamma"])
    result.append(
        claim(
            "proposition 1: z tends to Gamma(v/eps)",
            "ratio 1",
            f"{ratios[-1]:.5f}",
            abs(ratios[-1] - 1) < 0.01,
            "off",
        )
    )
    # Printed to three decimals, some of them cut off and not rounded.
    printed = {"0.01": 1.788, "0.1": 1.881, "0.5": 2.243, "1.0": 2.415}
    for beta, value in printed.items():
        ours = data["rest_printed"][beta]
        result.append(Claim.number(f"rest survives up to A, beta = {beta}", value, ours, 1e-3, digits=5))
    return result


def draw(data):
    """One panel for the sequences in eps, one for those in beta."""
    figure = new_figure(9.4, 4.0)
    panels = dict(zip(("eps", "beta"), figure.subplots(1, 2)))
    colours = [
        COLOUR[k] for k in ("right", "left", "stick", "fast", "smoothed", "approximation", "velocity", "exact")
    ]
    for over, ax in panels.items():
        own = [s for s in SEQUENCES if s[1] == over]
        for colour, (name, _, expected, _, text) in zip(colours, own):
            x, d = np.array(data[over], float), np.array(data[name], float)
            ax.loglog(x, d, "o", color=colour, markersize=4)
            power = {2 / 3: "2/3", 0.8: "4/5"}.get(expected, f"{expected:g}")
            for word, sign in WORDS.items():
                text = text.replace(word, sign)
            label = f"{text}\n   expected {power}, measured {order(data, name, over):.3f}"
            ax.loglog(x, d[-1] * (x / x[-1]) ** expected, color=colour, linewidth=1, label=label)
        letter = {"eps": "\\varepsilon", "beta": "\\beta"}[over]
        ax.set(xlabel=f"${letter}$", ylabel="distance from the limit", title=f"As ${letter}$ falls")
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7, labelspacing=0.9)
    return figure


STUDY = Study(
    name="propositions",
    question="Do the source's propositions 1 to 5 and its jump at a fold hold, and with which orders?",
    expected="Orders 2, 1, 1, 1 (4/5 after the stick), 1 and 2/3.",
    full=Config(),
    fast=Config(log_eps=(-3.0, -4.0, 3), log_beta=(-2.5, -3.5, 3)),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
