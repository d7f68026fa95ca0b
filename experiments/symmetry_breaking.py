"""E6: where does the two-stick orbit lose its symmetry as the drive grows (eps = beta = 0.1, rho = 3)?

The symmetric orbit is followed in sigma as a fixed point of the half-period map; its symmetry breaks where that map has
the multiplier -1. The asymmetric pair that is born there is followed from the eigenvector of that multiplier, and
both are checked against plain integration, which finds the attractors only.

Expected: between sigma = 2.4, where figure 8 of the source has a symmetric orbit, and 2.5, where it has none
(near 2.45); a supercritical pitchfork, so the pair is stable and its asymmetry grows with the square root of the
distance.

Usage: python experiments/symmetry_breaking.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from paper_figures import oscillator as osc
from pwsmooth import Strobe
from pwsmooth.analysis.continuation import Steps, branch_off, follow
from pwsmooth.analysis.maps import Stroboscopic
from pwsmooth.analysis.orbits import find_orbit
from pwsmooth.plotting import COLOUR, new_figure

MIRROR = {osc.y: -osc.y, osc.v: -osc.v}
PERIOD = 2 * sp.pi


@dataclass(frozen=True)
class Config:
    """Parameters of figure 8 of the source, and the range of the drive."""

    eps: float = 0.1
    beta: float = 0.1
    rho: float = 3.0
    sigma_from: float = 2.2
    sigma_to: float = 2.8
    tolerances: tuple[float, ...] = (1e-8, 1e-9, 1e-10)
    settled_at: tuple[float, ...] = (2.3, 2.36, 2.42, 2.48, 2.54, 2.6, 2.66, 2.72, 2.78)
    settled_periods: int = 600


def oscillator(config, sigma):
    system = osc.oscillator(rho=config.rho, beta=config.beta, sigma=sigma)
    return system.smoothed(eps=config.eps, sigmoid="algebraic")


def asymmetry(orbit):
    """Sum of the largest and the smallest y over a period: 0 for a symmetric orbit."""
    y = orbit.solution()(np.linspace(0, orbit.period, 2001)[:-1], "y")
    return float(y.max() + y.min())


def run(config):
    """The branches, the symmetry breaking at several tolerances, and where plain integration settles."""
    breaking = []
    for rtol in config.tolerances:
        system = oscillator(config, config.sigma_from)
        first = find_orbit(
            system,
            {osc.y: 0.5, osc.v: 0.3, osc.z: 0},
            seen=Strobe(PERIOD, symmetry=MIRROR),
            transient=30,
            rtol=rtol,
        )
        symmetric = follow(first, {"sigma": config.sigma_to})
        breaking.append(symmetric.of_kind("symmetry breaking")[0])
    pair = follow(branch_off(breaking[-1], 5e-3), {"sigma": config.sigma_to}, steps=Steps(longest=0.03))
    settled = []
    for sigma in config.settled_at:
        step = Stroboscopic(oscillator(config, sigma), PERIOD, options={"rtol": 1e-9})
        # A start off the symmetric orbit, so that an unstable one is left.
        x = step.iterate([0.95, -0.95, 0.0], 1, config.settled_periods)[0]
        run = step.over(x, 2 * np.pi)
        settled.append(float(run.x[0].max() + run.x[0].min()))
    return {
        "breaking": [{"rtol": r, "sigma": b.parameter} for r, b in zip(config.tolerances, breaking)],
        "symmetric": {
            "sigma": symmetric.values,
            "multiplier": [orbit.map_multipliers[0].real for orbit in symmetric.points],
        },
        "pair": {
            "sigma": pair.values,
            "multiplier": [orbit.multipliers[0].real for orbit in pair.points],
            "asymmetry": [abs(asymmetry(orbit)) for orbit in pair.points],
            "bifurcations": [str(b).split("\n")[0] for b in pair.specials],
        },
        "settled": {"sigma": config.settled_at, "asymmetry": np.abs(settled)},
    }


def exponent(data):
    """Slope of log asymmetry against log(sigma - sigma*) on the first orbits of the pair."""
    at = data["breaking"][-1]["sigma"]
    sigma, size = np.array(data["pair"]["sigma"]), np.array(data["pair"]["asymmetry"])
    near = (sigma - at > 1e-6) & (sigma - at < 0.02)
    return float(np.polyfit(np.log(sigma[near] - at), np.log(size[near]), 1)[0])


def claims(data):
    """What was expected beside what was found."""
    values = [b["sigma"] for b in data["breaking"]]
    spread = max(values) - min(values)
    power = exponent(data)
    settled = data["settled"]
    at = values[-1]
    right = all((a > 0.01) == (s > at) for s, a in zip(settled["sigma"], settled["asymmetry"]))
    return [
        claim(
            "the symmetric orbit loses its symmetry between 2.4 and 2.5",
            "near 2.45",
            f"sigma* = {at:.6f}; it moves by {spread:.1e} with rtol from {data['breaking'][0]['rtol']:g} to "
            f"{data['breaking'][-1]['rtol']:g}",
            2.4 < at < 2.5 and spread < 1e-4,
            "outside, or not located to 1e-4",
        ),
        Claim.number(
            "asymmetry grows as a power of sigma - sigma*", 0.5, power, 0.03, digits=3, origin="derived"
        ),
        claim(
            "the pair is stable where it begins: the pitchfork is supercritical",
            "stable",
            f"multiplier {data['pair']['multiplier'][0]:.4f} at sigma = {data['pair']['sigma'][0]:.5f}",
            abs(data["pair"]["multiplier"][0]) < 1 and data["pair"]["sigma"][0] > at,
            "it is unstable or goes the other way",
        ),
        claim(
            "plain integration settles on a symmetric orbit below sigma* and on an asymmetric one above",
            "all runs",
            f"{len(settled['sigma'])} runs" if right else f"asymmetries {settled['asymmetry']}",
            right,
            "a run settled on the other kind",
        ),
    ]


def draw(data):
    """Multipliers and asymmetry over sigma."""
    figure = new_figure(3.5, 6.2)
    left, right = figure.subplots(2, 1)
    at = data["breaking"][-1]["sigma"]
    symmetric, pair, settled = data["symmetric"], data["pair"], data["settled"]
    left.plot(
        symmetric["sigma"], np.square(symmetric["multiplier"]), color=COLOUR["exact"], label="symmetric orbit"
    )
    left.plot(pair["sigma"], pair["multiplier"], "-.", color=COLOUR["right"], label="asymmetric pair")
    left.axhline(1, color=COLOUR["mark"], linewidth=0.7)
    left.axvline(at, ymax=0.8, color=COLOUR["mark"], linewidth=0.7, linestyle=":")  # ends below the legend
    left.annotate(f"$\\sigma^*$ = {at:.5f}", (at, 1), (-6, 8), textcoords="offset points", ha="right")
    left.set(xlabel="drive amplitude $\\sigma$", ylabel="largest Floquet multiplier", title="Stability")
    left.legend(loc="upper left")
    sigma, size = np.append(at, pair["sigma"]), np.append(0.0, pair["asymmetry"])
    order = np.argsort(sigma)
    for sign in (1, -1):
        right.plot(
            sigma[order],
            sign * size[order],
            "-.",
            color=COLOUR["right"],
            label="asymmetric pair" if sign > 0 else None,
        )
    low, high = min(symmetric["sigma"]), max(symmetric["sigma"])
    right.plot([low, at], [0, 0], color=COLOUR["exact"], label="symmetric, stable")
    right.plot([at, high], [0, 0], color=COLOUR["exact"], linestyle="--", label="symmetric, unstable")
    right.plot(
        settled["sigma"],
        settled["asymmetry"],
        "o",
        color=COLOUR["smoothed"],
        markersize=4,
        label="plain integration",
    )
    right.set(xlabel="drive amplitude $\\sigma$", ylabel="max y + min y", title="Asymmetry")
    right.legend(loc="upper left")
    return figure


STUDY = Study(
    name="symmetry_breaking",
    question="Where does the two-stick orbit lose its symmetry as the drive grows (eps = beta = 0.1, rho = 3)?",
    expected="A supercritical pitchfork near sigma = 2.45.",
    full=Config(),
    fast=Config(tolerances=(1e-8, 1e-9), settled_at=(2.3, 2.7), settled_periods=300),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
