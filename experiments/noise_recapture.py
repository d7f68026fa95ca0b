"""S4: how strong must kicks be until static friction is gone, if what they knock loose may be caught again?

    u' = F - L(u)(1 + rho z),   z' = r (1 - L(u)^2 - z),   u -> u + kick every T,   L = u/sqrt(1 + u^2)

in units of the layer (u = v/eps, times in eps, r = eps/beta, N = 1), under a constant force F between N and N mu_s,
so that only kappa/eps and T/eps matter.

Hypothesis: the mean time until a stuck contact leaves is that of a Markov chain of two states, stuck and slipping:
one kick leads out if it passes the stable manifold of the layer's saddle, and a slipping contact that a kick leads
back into the layer is caught again while |F| < F_c(r). It is left as by a contact without static friction (rho = 0)
only from kappa ~ eps (T/eps)^a on; a is to be measured.

Expected of a: for T << eps the layer averages the kicks to a diffusion of intensity s^2 = sd^2/(eps T), which
decides with s of order 1: a = 1/2. For T >> eps a contact that is kicked to v < 0 comes back within T if |v| < (F +
N) T, and then it is caught; kicks beyond that never let it rest: a = 1.

Method: trajectories of the layer with kicks (pwsmooth.Kicks: uniform, normal, Laplace's) or a diffusion, until u =
20 + 4 kappa/eps. Their mean time, over that of rho = 0 with the same kicks, is R; the threshold is sd at R = 3/2,
interpolated in log sd. Beside them the chain: where a kick leads to within T, from a table of plain Runge-Kutta
steps, and the mean number of kicks from the linear equations of the chain on a grid of u; it knows of no trajectory
with noise.

Error bars: standard errors of the means; of a threshold, those of R over the slope of R.

Changed after first runs: the spacings of the two exponents (at T = 10 to 100 eps the local one is 0.7 to 0.8: the
asymptotic one begins beyond), the distance (20 for 50, beside 4 kappa), the cut-off (short spacings were cut off),
and the grid of the chain. A fixed 3/2 and another criterion differ in the factor of the threshold, not in the
exponent 1: for T >> eps only kappa/T is left.

Usage: python experiments/noise_recapture.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import noise_layer as layer
import numpy as np
import sympy as sp
from scipy.stats import laplace, norm, uniform
from studytools import Claim, Study, claim, command, part

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from pwsmooth import Diffusion, Event, Kicks, System, ensemble
from pwsmooth.analysis.capture import capture_threshold
from pwsmooth.plotting import COLOUR, new_figure

LAWS = {  # of standard deviation 1, and the size that Kicks takes for it
    "uniform": (uniform(-math.sqrt(3), 2 * math.sqrt(3)), math.sqrt(3)),
    "normal": (norm(), 1.0),
    "laplace": (laplace(scale=math.sqrt(0.5)), 1.0),
}
RATIO = 1.5  # of the mean times, at the threshold
LONGEST = 4000.0  # time of a trajectory
FEW, MANY = 0.3, 300.0  # spacings far below and far above the layer's own time


@dataclass(frozen=True)
class Config:
    """rho = 3; spacings and standard deviations of kicks in units of the layer."""

    force: float = 1.4
    spacings: tuple[float, ...] = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)
    count: int = 200  # trajectories of a mean
    ratios: tuple[float, ...] = (0.1, 0.01)  # r beside 1, normal kicks
    chain_spacing: float = 100.0
    chain: tuple[tuple[float, float], ...] = ((1.4, 1.0), (1.4, 0.1), (1.6, 0.1))  # (F, r)
    chain_sizes: tuple[float, ...] = (2.0, 3.0, 10.0, 30.0, 100.0, 300.0)
    chain_count: int = 400
    most: int = 4000  # kicks


def contact():
    u, z = sp.symbols("u z", real=True)
    force, rho, r, far = sp.symbols("force rho r far", positive=True)
    lam = u / sp.sqrt(1 + u**2)
    return System(
        {u: force - lam * (1 + rho * z), z: r * (1 / (1 + u**2) - z)},
        parameters={force: 1.4, rho: 3.0, r: 1.0, far: 20.0}, events=[Event(u - far, terminal=True)],
    )  # fmt: skip


CONTACT = contact()


def departures(force, rho, r, T, sd, law, count, most, seed):
    """Times until u = 20 + 4 kappa, cut off at `most` kicks or LONGEST; T = 0 is a diffusion of intensity sd."""
    stuck, _ = layer.roots(force)
    start = {"u": stuck, "z": 1 / (1 + stuck * stuck)}
    size = 0.0 if T == 0 else LAWS[law][1] * sd
    values = {"force": force, "rho": max(rho, 1e-12), "r": r, "far": 20 + 4 * size}
    if T == 0:
        noise = Diffusion({"u": sd}, step=1 / 8, seed=seed, finest=3)
        many = ensemble(CONTACT, (0, LONGEST), start, noise, count, parameters=values)
    else:
        noise = Kicks(size, T, on="u", law=law, seed=seed)
        many = ensemble(CONTACT, (0, max(most * T, LONGEST)), start, noise, count, parameters=values, rtol=1e-6)
    return many.end_time


# ---- the chain


def after(force, r, T, u, z):
    """(whether stuck, u) a time T after (u, z), for an array u, by Runge-Kutta steps."""
    stuck, _ = layer.roots(force)
    u, z = np.array(u, float), np.full(len(u), float(z))

    def rates(u, z):
        root = np.sqrt(1 + u * u)
        return force - u / root * (1 + layer.RHO * z), r * (1 / root**2 - z)

    steps = math.ceil(T / 0.1)
    h = T / steps
    for _ in range(steps):
        a1, b1 = rates(u, z)
        a2, b2 = rates(u + h / 2 * a1, z + h / 2 * b1)
        a3, b3 = rates(u + h / 2 * a2, z + h / 2 * b2)
        a4, b4 = rates(u + h * a3, z + h * b3)
        u, z = u + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), z + h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
    return (np.abs(u - stuck) < 0.5) & (z > 0.3), u


def chain_kicks(force, r, T, sd, law, caught=True):
    """Mean number of kicks from the stuck state until u = 20 + 4 kappa is passed; z is forgotten between two kicks.

    Without `caught` a contact that has once been led out never sticks again.
    """
    spread, size = LAWS[law]
    far = 20 + 4 * size * sd
    low = -12 * sd - 2.5 * T
    edges = np.unique(
        np.concatenate([np.linspace(low, far, 701), np.linspace(-20, 40, 401), np.linspace(0, 9, 451)])
    )
    middles = (edges[1:] + edges[:-1]) / 2
    stuck, _ = layer.roots(force)
    ways = [after(force, r, T, middles, z) for z in (1 / (1 + stuck * stuck), 0.0)]
    n = len(middles)  # states: the cells before a kick, and the stuck one

    def row(u, held, to):
        """Probabilities of the states before the next kick."""
        shares = np.diff(spread.cdf((edges - u) / sd))
        shares[0] += spread.cdf((edges[0] - u) / sd)
        result = np.zeros(n + 1)
        result[n] = shares[held].sum()
        moving = ~held & (to < far)
        np.add.at(result, np.clip(np.searchsorted(edges, to[moving]) - 1, 0, n - 1), shares[moving])
        return result

    held, to = ways[1]
    if not caught:
        held = np.zeros(n, bool)
        to = np.where(ways[1][0], far, to)
    matrix = np.array([row(u, held, to) for u in middles] + [row(stuck, *ways[0])])
    if matrix[n, n] > 1 - 1e-6:
        return math.inf
    return float(np.linalg.solve(np.eye(n + 1) - matrix, np.ones(n + 1))[n])


def chain(config):
    rows = []
    for force, r in config.chain:
        T = config.chain_spacing
        for law in LAWS if (force, r) == config.chain[0] else ("normal",):
            for sd in config.chain_sizes:
                predicted = chain_kicks(force, r, T, sd, law)
                if predicted > 0.1 * config.most:
                    continue
                times = departures(force, layer.RHO, r, T, sd, law, config.chain_count, config.most, 5)
                kicks = np.floor(times / T)
                rows.append({
                    "force": force, "r": r, "law": law, "sd": sd, "predicted": predicted,
                    "no recapture": chain_kicks(force, r, T, sd, law, caught=False), "kicks": kicks.mean(),
                    "error": kicks.std(ddof=1) / math.sqrt(len(kicks)), "cut": int((kicks >= config.most - 1).sum()),
                })  # fmt: skip
    return rows


# ---- the threshold


def threshold(T, r, law, config):
    """sd at which R is 3/2, with its standard error, and the values of R on the way."""
    sd = 6 * (math.sqrt(T) + T) if T else 3.0
    seen = []
    for k in range(40):
        n, most = config.count * (1 if T else 4), config.most  # diffusions are quick
        held = departures(config.force, layer.RHO, r, T, sd, law, n, most, 100 + k)
        free = departures(config.force, 0.0, r, T, sd, law, n, most, 100 + k)
        error = math.sqrt(sum((x.std(ddof=1) / x.mean()) ** 2 / n for x in (held, free)))
        seen.append([sd, held.mean() / free.mean(), error])
        if seen[-1][1] > 1.25 * RATIO and k > 1:
            break
        sd /= 1.35
    near = [s for s in seen if RATIO / 1.5 < s[1] < RATIO * 2.5] or seen[-2:]
    x, y, e = np.array(near).T
    fit, covariance = np.polyfit(np.log(x), np.log(np.log(np.maximum(y, 1.02))), 1), None
    slope = fit[0]
    at = math.exp((math.log(math.log(RATIO)) - fit[1]) / slope)
    covariance = float(np.mean(e)) / math.log(RATIO) / abs(slope) / math.sqrt(len(near))
    return {"T": T, "r": r, "law": law, "sd": at, "error": at * covariance, "seen": seen}


def run(config):
    data = {"force": config.force, "chain": part("chain", chain, config)}
    cases = [(T, 1.0, law) for law in LAWS for T in config.spacings]
    cases += [(T, r, "normal") for r in config.ratios for T in config.spacings]
    cases += [(0.0, 1.0, "diffusion")]
    data["thresholds"] = [part(f"threshold {case}", threshold, *case, config) for case in cases]
    data["captures"] = {f"{r:g}": capture_threshold(layer.RHO, r) for r in (1.0, *config.ratios)}
    return data


def exponents(data, law, r=1.0):
    """(a, standard error) of the spacings up to FEW, and from MANY on, by weighted straight lines."""
    mine = [x for x in data["thresholds"] if x["law"] == law and x["r"] == r]
    result = []
    for pick in (lambda T: T <= FEW, lambda T: T >= MANY):
        T, sd, e = np.array([[x["T"], x["sd"], x["error"] / x["sd"]] for x in mine if pick(x["T"])]).T
        weights = 1 / e**2
        X = np.log(T)
        centre = np.average(X, weights=weights)
        spread = (weights * (X - centre) ** 2).sum()
        result.append(
            (float((weights * (X - centre) * np.log(sd)).sum() / spread), float(1 / math.sqrt(spread)))
        )
    return result


def claims(data) -> list[Claim]:
    rows = data["chain"]
    off = [(abs(x["kicks"] - x["predicted"]) / max(x["error"], 1e-12), x) for x in rows if not x["cut"]]
    worst, at = max(off, key=lambda o: o[0])
    loose = [x for x in rows if x["predicted"] > 1.2 * x["no recapture"]]
    alone = min((abs(x["kicks"] - x["no recapture"]) / x["error"] for x in loose), default=0.0)
    result = [
        claim(
            "mean departure: the chain of kicks that lead out and kicks that lead back", "within 4 standard errors",
            f"{len(off)} cases; largest deviation {worst:.1f} (F = {at['force']:g}, r = {at['r']:g}, {at['law']}, sd = "
            f"{at['sd']:g}: {at['kicks']:.2f} +- {at['error']:.2f} kicks, chain {at['predicted']:.2f})",
            worst < 4, "what the layer remembers of earlier kicks is not negligible",
            origin="derived",
        ),
        claim(
            "recapture is what keeps the contact: without it the chain is refuted", "by more than 4 standard errors",
            f"where it matters by a fifth ({len(loose)} cases) by {alone:.1f} at least", len(loose) > 0 and alone > 4,
            "it is not needed",
        ),
    ]  # fmt: skip
    told, good = [], True
    for law in LAWS:
        (fast, fast_error), (slow, slow_error) = exponents(data, law)
        told.append(f"{law} {fast:.2f} +- {fast_error:.2f} and {slow:.2f} +- {slow_error:.2f}")
        good &= abs(fast - 0.5) < max(0.05, 2 * fast_error) and abs(slow - 1) < max(0.05, 2 * slow_error)
    result.append(
        claim(
            "as without static friction from kappa ~ eps (T/eps)^a on", "a = 1/2 for T << eps, 1 for T >> eps",
            f"T <= {FEW:g} eps and T >= {MANY:g} eps: {'; '.join(told)}", good, "other exponents",
        )
    )  # fmt: skip
    first = {
        x["law"]: x
        for x in data["thresholds"]
        if x["r"] == 1 and x["T"] == min(y["T"] for y in data["thresholds"] if y["T"])
    }
    (white,) = [x for x in data["thresholds"] if x["law"] == "diffusion" and x["r"] == 1]
    T = first["normal"]["T"]
    intensity = {law: (x["sd"] / math.sqrt(T), x["error"] / math.sqrt(T)) for law, x in first.items()}
    apart = max(abs(s - white["sd"]) / math.hypot(e, white["error"]) for s, e in intensity.values())
    result.append(
        claim(
            f"at T = {T:g} eps only the intensity sd/sqrt(eps T) counts, not the law",
            "that of a diffusion, within 3 standard errors",
            f"{', '.join(f'{law} {s:.3f} +- {e:.3f}' for law, (s, e) in intensity.items())}; diffusion "
            f"{white['sd']:.3f} +- {white['error']:.3f}",
            apart < 3, "single kicks are seen yet",
        )
    )  # fmt: skip
    rest = []
    for r in sorted({x["r"] for x in data["thresholds"]} - {1.0}, reverse=True):
        (fast, fe), (slow, se) = exponents(data, "normal", r)
        rest.append((r, fast, fe, slow, se))
    if rest:
        result.append(
            claim(
                "where |F| > F_c(r) nothing that arrives is caught: static friction goes at weaker kicks",
                "a lower threshold at r = 0.01, F_c = "
                + f"{data['captures'].get('0.01', math.nan):.3f} < F = {data['force']:g}, for T >= 30 eps",
                "; ".join(f"r = {r:g}: {_share(data, r):.2f} of that at r = 1" for r, *_ in rest)
                + f" (exponents {'; '.join(f'{x[1]:.2f} +- {x[2]:.2f}, {x[3]:.2f} +- {x[4]:.2f}' for x in rest)})",
                _share(data, min(x[0] for x in rest)) < 0.8,
                "z lasts for beta, longer than the excursions: what comes back is still strengthened, and caught",
            )
        )  # fmt: skip
    return result


def _share(data, r):
    """Threshold at r over that at 1, mean of logarithms over T >= 30."""
    at = {(x["r"], x["T"]): x["sd"] for x in data["thresholds"] if x["law"] == "normal" and x["T"] >= 30}
    return float(np.exp(np.mean([math.log(sd / at[1.0, T]) for (q, T), sd in at.items() if q == r])))


def verdict(data) -> str:
    chain_holds, recapture, exponent, *_ = (c.holds for c in claims(data))
    (fast, fe), (slow, se) = exponents(data, "normal")
    ratio = min(x["r"] for x in data["thresholds"])
    slower = ""
    if ratio < 1:
        slower = (
            f" That static friction would go sooner where arrivals are not caught (r = {ratio:g}) was wrong: its "
            f"memory outlasts what is knocked loose, and kicks have to be {_share(data, ratio):.1f} times as strong."
            if _share(data, ratio) > 1
            else f" Where arrivals are not caught (r = {ratio:g}) it goes sooner, as expected."
        )
    return (
        f"The chain {'held' if chain_holds and recapture else 'did not hold'} where the layer forgets between two "
        f"kicks. There is not one exponent a but two, {fast:.2f} +- {fe:.2f} for kicks that come faster than the layer "
        f"moves and {slow:.2f} +- {se:.2f} for rare ones (normal kicks)"
        + (", as expected of averaging and of recapture." if exponent else ", which is not what was expected.")
        + slower
    )


def draw(data):
    from matplotlib.ticker import NullFormatter

    figure = new_figure(11.0, 3.5)
    left, middle, right = figure.subplots(1, 3)
    colours = {"uniform": COLOUR["smoothed"], "normal": COLOUR["approximation"], "laplace": COLOUR["velocity"]}
    marks = dict(zip(sorted({(x["force"], x["r"]) for x in data["chain"]}), "os^"))
    for x in data["chain"]:
        left.errorbar(x["predicted"], x["kicks"], 2 * x["error"], fmt=marks[x["force"], x["r"]],
                      color=colours[x["law"]], markersize=4, fillstyle="none", linewidth=0.8)  # fmt: skip
    ends = [min(x["predicted"] for x in data["chain"]) / 1.3, max(x["predicted"] for x in data["chain"]) * 1.3]
    left.plot(ends, ends, color=COLOUR["mark"], linewidth=0.7, label="equal")
    for (force, r), mark in marks.items():
        left.plot(
            [],
            [],
            mark,
            color=COLOUR["mark"],
            markersize=4,
            fillstyle="none",
            label=f"F = {force:g}, r = {r:g}",
        )
    left.set(xscale="log", yscale="log", xlabel="kicks until it leaves, chain", ylabel="measured (2 standard errors)",
             title="Escape and recapture, $T = 100\\varepsilon$")  # fmt: skip
    for axis in (left.xaxis, left.yaxis):
        axis.set_minor_formatter(NullFormatter())
    left.legend(loc="upper left", fontsize=7)
    for law, colour in colours.items():
        x = [x for x in data["thresholds"] if x["law"] == law and x["r"] == 1]
        T, sd, e = np.array([[v["T"], v["sd"], v["error"]] for v in x]).T
        middle.errorbar(T, sd, 2 * e, fmt="o", color=colour, markersize=3.5, linewidth=0.8, label=law)
        for v in x:
            seen = np.array(v["seen"])
            if law == "normal" and v["T"] in (0.1, 3.0, 30.0, 1000.0):
                shade = {0.1: "right", 3.0: "stick", 30.0: "left", 1000.0: "exact"}[v["T"]]
                right.errorbar(seen[:, 0] / v["sd"], seen[:, 1], 2 * seen[:, 1] * seen[:, 2], fmt="-o",
                               color=COLOUR[shade], markersize=3, linewidth=0.8,
                               label=f"T = {v['T']:g} $\\varepsilon$")  # fmt: skip
    for r, mark in zip(sorted({x["r"] for x in data["thresholds"]} - {1.0}, reverse=True), ("s", "v")):
        x = [x for x in data["thresholds"] if x["law"] == "normal" and x["r"] == r]
        middle.plot([v["T"] for v in x], [v["sd"] for v in x], mark, color=colours["normal"], fillstyle="none",
                    markersize=4, label=f"normal, r = {r:g}")  # fmt: skip
    T = np.array(sorted({x["T"] for x in data["thresholds"] if x["T"]}))
    (white,) = [x for x in data["thresholds"] if x["law"] == "diffusion" and x["r"] == 1]
    middle.plot(T[T < 4], white["sd"] * np.sqrt(T[T < 4]), "-", color=COLOUR["exact"], linewidth=1,
                label="diffusion: $s^*\\sqrt{T}$")  # fmt: skip
    normal = {x["T"]: x for x in data["thresholds"] if x["law"] == "normal" and x["r"] == 1}
    last = normal[T[-1]]
    middle.plot(T[T > 1], last["sd"] * T[T > 1] / T[-1], ":", color=COLOUR["mark"], label="$\\propto T$")
    middle.set(xscale="log", yscale="log", xlabel="spacing $T/\\varepsilon$",
               ylabel="standard deviation$/\\varepsilon$", title="As without static friction from here on")  # fmt: skip
    middle.legend(loc="upper left", fontsize=6.5)
    right.axhline(RATIO, color=COLOUR["mark"], linewidth=0.7)
    right.axhline(1, color=COLOUR["mark"], linewidth=0.7)
    right.set(xscale="log", yscale="log", ylim=(0.8, 3), xlabel="standard deviation / threshold",
              ylabel="mean time over that of $\\rho$ = 0", title="Normal kicks")  # fmt: skip
    if right.get_legend_handles_labels()[0]:
        right.legend(fontsize=7)
    return figure


STUDY = Study(
    name="noise_recapture",
    question="S4: how strong must kicks be until static friction is gone, if what they knock loose may be caught "
    "again?",
    expected="A Markov chain of one-kick escapes and recaptures; as without static friction from kappa ~ eps (T/eps)^a "
    "on, a = 1/2 for T << eps and 1 for T >> eps.",
    full=Config(),
    fast=Config(
        spacings=(0.03, 0.3, 300.0, 3000.0), count=60, ratios=(), chain=((1.4, 1.0),), chain_sizes=(3.0, 100.0),
        chain_count=150,
    ),
    run=run,
    claims=claims,
    draw=draw,
    verdict=verdict,
)  # fmt: skip

if __name__ == "__main__":
    command(STUDY)
