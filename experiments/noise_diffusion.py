"""E5 (ii): when does white noise destroy nonlinear sticking?

A diffusion D on the velocity acts in the layer all the time: in u = v/eps, tau = t/eps its intensity is s^2 = D^2/eps,
and nothing else of eps is left. Sticking ends when the noise has carried u over the saddle.

Part 1: the layer itself under a constant force (F = 1.4 N), in its own variables, where nothing is stiff: mean time
until u = 6 against s^2. With z slaved there is a potential: beside it its exact mean time (two integrals) and Kramers'
formula. With eps/beta = 1 there is none: measured only. (With z frozen there is no saddle: nothing is left.)
Part 2: the same contact as a smoothed system in v and z, at two eps: times in units of eps must fall on part 1.
Part 3: the oscillator with z slaved, and with eps = beta: time stuck beyond N relative to the noise-free one, beside
what the exact exit rates along the noise-free stick predict if nothing is captured again.

Expected: measured mean times agree with the integrals within sampling error, and with Kramers for s^2 well below the
barrier; scaling with D^2/eps exact at constant force. In the oscillator a stick lasts about 0.54/eps of the layer's
time, so that its curves for smaller eps lie at somewhat smaller D^2/eps: the logarithm of 1/eps.

Usage: python experiments/noise_diffusion.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import noise_layer as layer
import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from paper_figures import oscillator as osc
from pwsmooth import Diffusion, Event, Switch, System, solve
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.studies import ensemble

FAR = 6.0
EVERY = osc.PERIOD / 500
STICK = 0.539389027  # of the slaved orbit, and where it begins (computed apart)
BEGIN = 1.755610496


@dataclass(frozen=True)
class Config:
    """rho = 3, N = 1; s2 = D^2/eps."""

    force: float = 1.4
    s2: tuple[float, ...] = (0.13, 0.17, 0.22, 0.3, 0.45, 0.7, 1.0, 1.5)
    finite_s2: tuple[float, ...] = (0.3, 0.45, 0.7, 1.0, 1.5)  # of eps = beta, whose times are longer
    count: int = 200  # trajectories a point
    eps: tuple[float, ...] = (4e-3, 2.5e-4)
    checked: tuple[float, ...] = (0.3, 0.7, 1.5)  # s2 of part 2
    orbit_eps: tuple[float, ...] = (4e-3, 1e-3, 2.5e-4)
    orbit_s2: tuple[float, ...] = (0.003, 0.01, 0.03, 0.07, 0.15, 0.3, 1.0, 3.0)
    seeds: int = 6
    periods: int = 3  # a seed


# ---- part 1: the layer


def layer_system(force, slaved):
    """The layer in u (and z, eps = beta) with its end at u = FAR."""
    u, z = sp.symbols("u z", real=True)
    f = sp.Symbol("force", positive=True)
    lam = u / sp.sqrt(1 + u**2)
    if slaved:
        return System({u: f - lam * (1 + 3 * (1 - lam**2))}, parameters={f: force},
                      events=[Event(u - FAR, terminal=True)])  # fmt: skip
    return System({u: f - lam * (1 + 3 * z), z: 1 - lam**2 - z}, parameters={f: force},
                  events=[Event(u - FAR, terminal=True)])  # fmt: skip


def mean_and_error(times):
    return [float(times.mean()), float(times.std(ddof=1) / math.sqrt(len(times)))]


def exit_times(force, s2, slaved, count):
    """(mean, standard error) of the layer time until u = FAR."""
    stuck, _ = layer.roots(force)
    start = [stuck] if slaved else [stuck, 1 / (1 + stuck**2)]
    noise = Diffusion({"u": math.sqrt(s2)}, step=1 / 8, seed=21 + round(1000 * s2), finest=3)
    many = ensemble(layer_system(force, slaved), (0, 1e7), start, noise, count)
    if {o.name for o in many.outcomes} != {"TERMINATED"}:
        raise RuntimeError(f"not every trajectory ended: {set(many.outcomes)}")
    return mean_and_error(many.end_time)


# ---- part 2: the smoothed contact


def smoothed_exit_times(force, s2, eps, count):
    """The same in units of eps, from the smoothed system with eps = beta."""
    v, z = sp.symbols("v z", real=True)
    beta, f, far = sp.symbols("beta force far", positive=True)
    lam = Switch("lam", v)
    contact = System(
        {v: f - lam * (1 + 3 * z), z: (1 - lam**2 - z) / beta},
        parameters={beta: eps, f: force, far: FAR * eps},
        events=[Event(v - far, terminal=True)],
    ).smoothed(eps=eps)
    stuck, _ = layer.roots(force)
    noise = Diffusion({v: math.sqrt(s2 * eps)}, step=eps / 8, seed=round(1e5 * eps), finest=3)
    many = ensemble(contact, (0, 1e7 * eps), {v: stuck * eps, z: 1 / (1 + stuck**2)}, noise, count)
    return mean_and_error(many.end_time / eps)


# ---- part 3: the oscillator


def oscillator(eps, slaved):
    exact = osc.oscillator(beta=eps)
    return (exact.layered({osc.z: sp.oo}) if slaved else exact).smoothed(eps=eps)


def stick_times(view, start, eps, s2, periods, seed):
    """Time stuck beyond N of every half period."""
    times = EVERY * np.arange(1, 500 * periods + 1)
    span = (0, 500 * periods * EVERY)
    times[-1] = span[1]
    noise = Diffusion({"v": math.sqrt(s2 * eps)}, step=EVERY, seed=seed)
    run = solve(view, span, start, noise=noise, t_eval=times, max_steps=10**9)
    if not run.success:
        raise RuntimeError(run.message)
    force = np.abs(3.1 * run["y"] + 2.4 * np.sin(run.t))
    held = (np.abs(run["v"]) <= 4 * eps) & (force > 1)
    return held.reshape(2 * periods, 250).sum(axis=1) * EVERY


def relative_times(eps, slaved, config):
    """[mean, standard error] at every s2, relative to the noise-free orbit."""
    view = oscillator(eps, slaved)
    start = {osc.y: 0.78, osc.v: -1.03} | ({} if slaved else {osc.z: 0})
    orbit = osc.settled(view, start, periods=30)
    start = dict(zip(orbit.states, orbit.x[:, 0]))
    free = stick_times(view, start, eps, 0.0, 1, 0).mean()
    rows = []
    for s2 in config.orbit_s2:
        seeds = np.array(
            [
                stick_times(view, start, eps, s2, config.periods, seed).mean() / free
                for seed in range(config.seeds)
            ]
        )
        rows.append([float(seeds.mean()), float(seeds.std(ddof=1) / math.sqrt(len(seeds)))])
    return rows


def predicted(eps, s2):
    """Share of the slaved stick that is left if the first exit ends it: exact rates along F(t)."""
    t = np.linspace(0, STICK, 200)
    # The stick ends at the fold, F = mu_s; y is constant in it, so that F follows the drive.
    end = math.sin(BEGIN + STICK)
    force = layer.MU_S - 2.4 * (np.sin(BEGIN + t) - end) * np.sign(math.sin(BEGIN) - end)
    nodes = np.linspace(force.min(), layer.MU_S - 1e-3, 30)
    rates = [1 / layer.mean_exit_time(f, s2, FAR) for f in nodes]
    rate = np.exp(np.interp(force, nodes, np.log(np.maximum(rates, 1e-300))))
    hazard = np.concatenate([[0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))]) / eps
    return float(np.trapezoid(np.exp(-hazard), t) / STICK)


def run(config):
    force = config.force
    data = {
        "force": force,
        "s2": config.s2,
        "slaved": [exit_times(force, s2, True, config.count) for s2 in config.s2],
        "finite_s2": config.finite_s2,
        "finite": [exit_times(force, s2, False, config.count) for s2 in config.finite_s2],
        "exact": [layer.mean_exit_time(force, s2, FAR) for s2 in config.s2],
        "kramers": [layer.kramers(force, s2) for s2 in config.s2],
        "checked": config.checked,
        "smoothed": {
            f"{eps:g}": [smoothed_exit_times(force, s2, eps, config.count) for s2 in config.checked]
            for eps in config.eps
        },
        "orbit_s2": config.orbit_s2,
        "orbit": {f"{eps:g} | slaved": relative_times(eps, True, config) for eps in config.orbit_eps},
        "predicted": {f"{eps:g}": [predicted(eps, s2) for s2 in config.orbit_s2] for eps in config.orbit_eps},
    }
    data["orbit"]["0.001 | eps = beta"] = relative_times(1e-3, False, config)
    return data


def claims(data) -> list[Claim]:
    mean, error = np.array(data["slaved"]).T
    exact, asymptotic = np.array(data["exact"]), np.array(data["kramers"])
    deviation = (mean - exact) / error
    worst = int(np.abs(deviation).argmax())
    result = [
        claim(
            "slaved layer: mean exit times are those of the exact integrals",
            "within 4 standard errors",
            f"largest deviation {deviation[worst]:+.1f} at s^2 = {data['s2'][worst]:g} "
            f"({mean[worst]:.4g} +- {error[worst]:.2g}, exact {exact[worst]:.4g})",
            np.abs(deviation).max() < 4,
            "the scheme's bias is seen",
            origin="derived",
        ),
        claim(
            "Kramers' formula holds for weak noise",
            "ratio 1 + O(s^2)",
            f"exact/Kramers {exact[0] / asymptotic[0]:.3f} at s^2 = {data['s2'][0]:g}, "
            f"{exact[-1] / asymptotic[-1]:.3f} at {data['s2'][-1]:g}",
            abs(exact[0] / asymptotic[0] - 1) < 2 * data["s2"][0],
            "the barrier is too low for it",
            origin="derived",
        ),
    ]
    finite = dict(zip(data["finite_s2"], data["finite"], strict=True))
    parts, largest = [], 0.0
    for rows in data["smoothed"].values():
        for s2, (m, e) in zip(data["checked"], rows, strict=True):
            reference, own = finite[s2]
            largest = max(largest, abs(m - reference) / math.hypot(e, own))
            parts.append(f"{m:.4g}/{reference:.4g}")
    result.append(
        claim(
            "at constant force only D^2/eps matters: smoothed contacts in units of eps against the layer itself",
            "equal",
            f"{', '.join(parts)}; at most {largest:.1f} standard errors apart",
            largest < 4,
            "eps matters beyond its scaling",
        )
    )
    below = []
    for eps, line in data["predicted"].items():
        mean, error = np.array(data["orbit"][f"{eps} | slaved"]).T
        below.append(np.abs(mean - line).max())
    result.append(
        claim(
            "oscillator, z slaved: the time stuck beyond N is that of exits along the noise-free stick",
            "within 0.1 of the noise-free time",
            f"at most {', '.join(f'{b:.2f}' for b in below)} apart for eps = {', '.join(data['predicted'])}",
            max(below) < 0.1,
            "it is longer: states that have left are captured again, and the orbit shifts",
        )
    )
    return result


def draw(data):
    figure = new_figure(3.5, 6.6)
    left, right = figure.subplots(2, 1)
    s2 = np.array(data["s2"])
    left.plot(s2, data["exact"], color=COLOUR["exact"], label="z slaved: exact mean")
    left.plot(s2, data["kramers"], color=COLOUR["exact"], linestyle="--", linewidth=1.0, label="Kramers")
    layers = (
        ("slaved", data["s2"], COLOUR["smoothed"], "z slaved"),
        ("finite", data["finite_s2"], COLOUR["approximation"], r"$\varepsilon=\beta$, layer"),
    )
    for name, at, colour, label in layers:
        mean, error = np.array(data[name]).T
        left.errorbar(
            at,
            mean,
            error,
            fmt="o" if name == "slaved" else "^",
            color=colour,
            markersize=4,
            linewidth=0.9,
            label=label,
        )
    for mark, (eps, rows) in zip("sx", data["smoothed"].items(), strict=False):
        mean, error = np.array(rows).T
        left.errorbar(data["checked"], mean, error, fmt=mark, color=COLOUR["left"], markersize=6, linewidth=0.9,
                      markerfacecolor="none", label=rf"smoothed, $\varepsilon=\beta={eps}$")  # fmt: skip
    left.set(xscale="log", yscale="log", xlabel=r"$D^2/\varepsilon$", ylabel=r"mean exit time / $\varepsilon$")
    left.set_xticks([0.15, 0.3, 0.5, 1.0, 1.5], ["0.15", "0.3", "0.5", "1", "1.5"])
    left.minorticks_off()
    left.set_title(f"stuck under F = {data['force']:g} N")
    left.set_ylim(top=3 * left.get_ylim()[1])  # room for the legend above what is shown
    left.legend(fontsize=7, loc="upper right")
    s2 = np.array(data["orbit_s2"])
    colours = dict(
        zip(data["predicted"], (COLOUR["velocity"], COLOUR["smoothed"], COLOUR["stick"]), strict=False)
    )
    for (eps, colour), mark, dash in zip(colours.items(), "sov", ("--", "-", ":")):
        mean, error = np.array(data["orbit"][f"{eps} | slaved"]).T
        right.errorbar(s2, mean, error, fmt=mark, color=colour, markersize=4, linewidth=0.9,
                       label=rf"z slaved, $\varepsilon={eps}$")  # fmt: skip
        right.plot(s2, data["predicted"][eps], dash, color=colour, linewidth=1.1)
    mean, error = np.array(data["orbit"]["0.001 | eps = beta"]).T
    right.errorbar(s2, mean, error, fmt="^", color=COLOUR["approximation"], markersize=5, linewidth=0.9,
                   markerfacecolor="none", label=r"$\varepsilon=\beta=0.001$")  # fmt: skip
    right.plot([], [], color=COLOUR["mark"], linewidth=1.1, label="the first exit ends it")
    right.axhline(1, color=COLOUR["mark"], linewidth=0.5)
    right.set(xscale="log", ylim=(0, 1.1), xlabel=r"$D^2/\varepsilon$", ylabel="time stuck beyond N, relative")
    right.set_title("oscillator")
    right.legend(fontsize=7, loc="lower left")
    return figure


STUDY = Study(
    name="noise_diffusion",
    question="When does white noise destroy nonlinear sticking?",
    expected="A function of D^2/eps: exits over the layer's saddle, by Kramers' law where there is a potential.",
    full=Config(),
    fast=Config(
        s2=(0.3, 0.45, 1.0),
        count=100,
        eps=(1e-3,),
        checked=(0.45,),
        orbit_eps=(1e-3,),
        orbit_s2=(0.01, 0.1, 1.0),
        seeds=2,
        periods=2,
    ),  # fmt: skip
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
