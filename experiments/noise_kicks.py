"""E5 (i): when do random kicks destroy nonlinear sticking?

Kicks of size kappa come every 1/500 of a period, far apart in the layer's own time: the layer forgets each before the
next. So leaving it is an event of one kick, and all should depend on kappa/eps alone.

Part 1: a contact stuck under a constant force F = 1.4 N, kicked in v until it leaves (v > 10 eps): escapes a kick
against kappa/eps for three eps, beside the probability that one kick passes the stable manifold of the layer's saddle.
Part 2: the oscillator of figures 11 to 13: the time it is stuck beyond N, relative to the noise-free one, against
kappa/eps for three eps and both laws, against the standard deviation, and with kicks in z too; beside what one-kick
escapes along the noise-free stick predict if nothing is captured again.

Expected: the curves of different eps fall on one where 2 pi/500 is many eps; uniform kicks smaller than the way to
the manifold never lead out; normal ones do, rarely; at equal standard deviation the laws nearly agree for large kicks
and differ where only tails lead out; kicks in z of size kappa << 1 change nothing.

Usage: python experiments/noise_kicks.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import noise_layer as layer
import numpy as np
import sympy as sp
from scipy.stats import norm
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from paper_figures import oscillator as osc
from pwsmooth import Event, Kicks, Switch, System, solve
from pwsmooth.plotting import COLOUR, new_figure

LAWS = ("uniform", "normal")
EVERY = osc.PERIOD / 500


@dataclass(frozen=True)
class Config:
    """rho = 3, beta = eps, N = 1; sizes of kicks in units of eps."""

    force: float = 1.4
    eps: tuple[float, ...] = (4e-3, 1e-3, 2.5e-4)
    sizes: tuple[float, ...] = (0.2, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0)
    kicks: int = 5000  # a point of part 1
    escapes: int = 150  # at most
    seeds: int = 6
    periods: int = 6  # a seed


# ---- part 1: constant force


def escapes_a_kick(eps, size, law, config):
    """(escapes, kicks) of a contact stuck under the constant force."""
    v, z = sp.symbols("v z", real=True)
    beta, force, far = sp.symbols("beta force far", positive=True)
    lam = Switch("lam", v)
    contact = System(
        {v: force - lam * (1 + 3 * z), z: (1 - lam**2 - z) / beta},
        parameters={beta: eps, force: config.force, far: 10 * eps},
        events=[Event(v - far, terminal=True)],
    ).smoothed(eps=eps)
    stuck, _ = layer.roots(config.force)
    start = {v: stuck * eps, z: 1 / (1 + stuck**2)}
    escapes = kicks = trajectory = 0
    while kicks < config.kicks and escapes < config.escapes:
        noise = Kicks(size * eps, EVERY, on="v", law=law, seed=11, trajectory=trajectory)
        span = (0, (config.kicks - kicks + 0.999) * EVERY)
        run = solve(contact, span, start, noise=noise, rtol=1e-6, t_eval=[span[1]])
        kicks += int(round(run.t[-1] / EVERY - 0.5 * (run.t[-1] == span[1])))
        escapes += run.outcome.name == "TERMINATED"
        trajectory += 1
    return escapes, kicks


# ---- part 2: the oscillator


def settled(eps):
    """Noise-free orbit: its view and its state at t = 0."""
    view = osc.oscillator(beta=eps).smoothed(eps=eps)
    orbit = osc.settled(view, {osc.y: 0.78, osc.v: -1.03, osc.z: 0}, periods=30)
    return view, dict(zip(orbit.states, orbit.x[:, 0]))


def times_before_kicks(periods):
    return (np.arange(500 * periods) + 0.999) * EVERY


def stick_times(view, start, eps, periods, noise=None):
    """Time stuck beyond N of every half period; and the forces of the first stick."""
    times = times_before_kicks(periods)
    run = solve(view, (0, periods * osc.PERIOD), start, noise=noise, t_eval=times, rtol=1e-6)
    if not run.success:
        raise RuntimeError(run.message)
    force = np.abs(3.1 * run["y"] + 2.4 * np.sin(times))
    held = (np.abs(run["v"]) <= 2 * eps) & (force > 1)
    first = np.flatnonzero(held)
    first = first[: np.argmax(np.append(np.diff(first) > 1, True)) + 1]
    return held.reshape(2 * periods, 250).sum(axis=1) * EVERY, force[first]


def relative_times(view, start, eps, free, size, law, on, config):
    """(mean, standard error) of the stick time of a half period, relative to the noise-free one."""
    found = []
    for seed in range(config.seeds):
        noise = Kicks(size * eps, EVERY, on=on, law=law, seed=seed)
        found.append(stick_times(view, start, eps, config.periods, noise)[0] / free)
    seeds = np.array([f.mean() for f in found])
    return [float(seeds.mean()), float(seeds.std(ddof=1) / math.sqrt(len(seeds)))]


def predicted(forces, size, law):
    """Share of the noise-free stick that is left if the first kick that leads out ends it."""
    nodes = np.linspace(1.02, layer.MU_S - 1e-3, 9)
    ways = np.interp(forces, nodes, [layer.way_out(f) for f in nodes], right=0.0)
    out = np.clip(0.5 * (1 - ways / size), 0, 0.5) if law == "uniform" else norm.sf(ways / size)
    return float(np.cumprod(1 - out).mean())


def run(config):
    data = {"force": config.force, "sizes": config.sizes, "way_out": layer.way_out(config.force)}
    data["one_kick"] = {law: [layer.one_kick(config.force, k, law) for k in config.sizes] for law in LAWS}
    data["escapes"] = {
        f"{eps:g}": {law: [escapes_a_kick(eps, k, law, config) for k in config.sizes] for law in LAWS}
        for eps in config.eps
    }
    data["sticks"], data["free"] = {}, {}
    for eps in config.eps:
        view, start = settled(eps)
        free, forces = stick_times(view, start, eps, 1)
        data["free"][f"{eps:g}"] = float(free.mean())
        ons = {"y, v": ("y", "v")} | ({"y, v, z": ("y", "v", "z")} if eps == 1e-3 else {})
        for name, on in ons.items():
            data["sticks"][f"{eps:g} | {name}"] = {
                law: [relative_times(view, start, eps, free.mean(), k, law, on, config) for k in config.sizes]
                for law in LAWS
            }
        if eps == 1e-3:
            data["predicted"] = {law: [predicted(forces, k, law) for k in config.sizes] for law in LAWS}
    return data


def claims(data) -> list[Claim]:
    sizes = np.array(data["sizes"])
    below = sizes < data["way_out"]
    result = []
    counts = [data["escapes"][eps]["uniform"][i] for eps in ("0.001", "0.00025") for i in np.flatnonzero(below)]
    result.append(
        claim(
            "uniform kicks smaller than the way to the saddle's manifold never lead out, at a constant force",
            f"0 escapes for kappa < {data['way_out']:.3f} eps",
            f"{sum(c[0] for c in counts)} escapes in {sum(c[1] for c in counts)} kicks (eps = 0.001, 0.00025)",
            sum(c[0] for c in counts) == 0,
            "kicks add up before the layer has forgotten them",
        )
    )
    worst, where = 0.0, ""
    for law in LAWS:
        for i in np.flatnonzero(~below):
            p = data["one_kick"][law][i]
            escapes, kicks = data["escapes"]["0.00025"][law][i]
            deviation = (escapes / kicks - p) / math.sqrt(p * (1 - p) / kicks)
            if abs(deviation) > abs(worst):
                worst, where = (
                    deviation,
                    f"{law}, kappa = {sizes[i]:g} eps: {escapes / kicks:.4f}, one kick {p:.4f}",
                )
    result.append(
        claim(
            "escapes a kick are those of one kick (eps = 0.00025, 50 layer times between kicks)",
            "within 4 standard errors",
            f"largest deviation {worst:+.1f} standard errors ({where})",
            abs(worst) < 4,
            "the kick that leads back, or a second one, is not negligible",
        )
    )
    small, large = (np.array(data["sticks"][f"{eps} | y, v"][law])[:, 0] for law in ("uniform",) for eps in
                    ("0.00025", "0.001"))  # fmt: skip
    gap = np.abs(small - large).max()
    result.append(
        claim(
            "the oscillator's curves for different eps fall on one in kappa/eps",
            "equal curves as eps -> 0",
            f"eps = 0.001 and 0.00025, uniform: at most {gap:.3f} apart",
            gap < 0.1,
            "the layers do not forget their kicks alike",
        )
    )
    z, plain = (np.array(data["sticks"][f"0.001 | {name}"]["uniform"]) for name in ("y, v, z", "y, v"))
    error = np.sqrt(z[:, 1] ** 2 + plain[:, 1] ** 2)
    deviation = np.abs((z - plain)[:, 0] / error).max()
    result.append(
        claim(
            "kicks in z too give similar dynamics",
            "similar",
            f"at most {np.abs((z - plain)[:, 0]).max():.3f} apart, {deviation:.1f} standard errors",
            deviation < 4,
            "kicks in z matter",
        )
    )
    fifth, five = (list(sizes).index(k) for k in (0.2, 5.0))
    kept = [data["sticks"]["0.001 | y, v"][law] for law in LAWS]
    result.append(
        claim(
            "nonlinear sticking is kept at kappa = eps/5 and lost at 5 eps",
            "1 and 0",
            "; ".join(
                f"{law} {k[fifth][0]:.3f} and {k[five][0]:.3f}" for law, k in zip(LAWS, kept, strict=True)
            ),
            all(k[fifth][0] > 0.9 and k[five][0] < 0.1 for k in kept),
            "a part of it is left at 5 eps, because kicked states are captured again",
        )
    )
    return result


def draw(data):
    figure = new_figure(3.5, 8.6)
    left, middle, right = figure.subplots(3, 1)
    sizes = np.array(data["sizes"])
    colour = {"uniform": COLOUR["smoothed"], "normal": COLOUR["approximation"]}
    # Open for one law and full for the other, dashed and full lines: told apart in grey.
    fill, dash = {"uniform": "none", "normal": None}, {"uniform": "--", "normal": "-"}
    marks = dict(zip(data["escapes"], ("^", "o", "s"), strict=False))
    for law in LAWS:
        fine = np.geomspace(0.2, 12, 300)
        line = [layer.one_kick(data["force"], k, law) for k in fine]
        left.plot(fine, np.where(np.array(line) > 0, line, np.nan), dash[law], color=colour[law])
        for eps, mark in marks.items():
            rate = np.array([a / b if a else np.nan for a, b in data["escapes"][eps][law]])
            left.plot(sizes, rate, mark, color=colour[law], markersize=4, markerfacecolor=fill[law])
    left.axvline(data["way_out"], color=COLOUR["mark"], linewidth=0.7, linestyle="--")
    left.text(
        data["way_out"] * 0.95, 1.3e-4, "way to the saddle's manifold", rotation=90, ha="right", va="bottom",
        fontsize=7,
    )  # fmt: skip
    left.set(xscale="log", yscale="log", ylim=(1e-4, 0.7), xlim=(0.18, 12), xlabel=r"$\kappa/\varepsilon$",
             ylabel="escapes a kick")  # fmt: skip
    left.set_title(f"stuck under F = {data['force']:g} N")
    for law in LAWS:
        for eps, mark in marks.items():
            mean, error = np.array(data["sticks"][f"{eps} | y, v"][law]).T
            middle.errorbar(sizes, mean, error, fmt=mark, color=colour[law], markersize=4,
                            markerfacecolor=fill[law], linewidth=0.8)  # fmt: skip
            scale = 1 / math.sqrt(3) if law == "uniform" else 1.0
            if eps == "0.001":
                right.errorbar(scale * sizes, mean, error, fmt=dash[law] + "o", color=colour[law], markersize=4,
                               linewidth=0.9, markerfacecolor=fill[law])  # fmt: skip
                mean, error = np.array(data["sticks"]["0.001 | y, v, z"][law]).T
                right.errorbar(scale * sizes, mean, error, fmt="x", color=colour[law], markersize=5,
                               linewidth=0.8)  # fmt: skip
        middle.plot(sizes, data["predicted"][law], dash[law], color=colour[law], linewidth=1.1)
    for ax in (middle, right):
        ax.axhline(1, color=COLOUR["mark"], linewidth=0.5)
        ax.set(xscale="log", ylim=(0, 1.12))
    for size, text in ((0.2, "fig. 11"), (5.0, "fig. 12")):
        middle.axvline(size, color=COLOUR["mark"], linewidth=0.6, linestyle=":")
        middle.text(size * 1.04, 1.05, text, fontsize=7)
    middle.set(xlabel=r"$\kappa/\varepsilon$", ylabel="time stuck beyond N, relative", xlim=(0.18, 12))
    middle.set_title("oscillator")
    right.set(xlabel=r"standard deviation$/\varepsilon$", xlim=(0.1, 12))
    right.set_title(r"by deviation, $\varepsilon=0.001$")
    for law in LAWS:
        middle.plot([], [], dash[law], color=colour[law], label=f"{law}: one kick ends it")
        middle.plot(
            [], [], "o", color=colour[law], markerfacecolor=fill[law], markersize=4, label=f"{law}: runs"
        )
    for eps, mark in marks.items():
        middle.plot([], [], mark, color=COLOUR["mark"], markerfacecolor="none", markersize=4,
                    label=rf"$\varepsilon=\beta={eps}$")  # fmt: skip
    middle.plot([], [], "x", color=COLOUR["mark"], markersize=5, label="below: z kicked too")
    figure.legend(*middle.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=7)
    return figure


STUDY = Study(
    name="noise_kicks",
    question="When do random kicks destroy nonlinear sticking?",
    expected="A function of kappa/eps: kicks are forgotten one by one, and one that passes the layer's saddle ends it.",
    full=Config(),
    fast=Config(eps=(1e-3, 2.5e-4), sizes=(0.2, 1.0, 2.0, 5.0), kicks=1500, escapes=60, seeds=2, periods=3),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
