"""How many sliders does a multistate law need to be that of a continuum of sliders?

    f = (1/n) sum_i f_i,   each f_i a spring of stiffness 1 before a slider that gives way at L_i

Hypothesis: with strengths at the middles of n equal shares of their distribution the force is off by n^-2 at most,
after any motion; with strengths drawn at random by n^-1/2.

Derivation. The first loading is Phi(x) = integral of min(x, L(q)) over the shares q from 0 to 1. Middles of shares are
the midpoint rule, of order 2, also beside the corner at L(q) = x: that lies in one cell, where the rule is off by
L' n^-2/8 at most. Draws are Monte Carlo. After a reversal at (x_r, f_r) Masing's rule gives f_r -+ 2 Phi(|x - x_r|/2),
of elements and continuum alike: every reversal adds twice an error of the same kind, while amplitudes fall.

Method: sliders of which each event costs its own (`element_cloud`), strengths of an exponential distribution, Phi =
1 - exp(-x), under a motion whose amplitudes fall, x = A exp(-t/20) sin t; the force beside Masing's at 400 instants.

Usage: python experiments/continuum.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from pwsmooth.laws.friction import MaxwellSlip
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.scenes import element_cloud, t


@dataclass(frozen=True)
class Config:
    """Numbers of sliders, random clouds of each, and the motion."""

    numbers: tuple[int, ...] = (10, 30, 100, 300, 1000, 3000, 10_000, 30_000, 100_000)
    draws: int = 8
    most_drawn: int = 10_000
    amplitude: float = 3.0
    end: float = 40.0
    columns: int = 401


def motion(config):
    return config.amplitude * sp.exp(-t / 20) * sp.sin(t)


def masing(config, times):
    """The force of the continuum: the branch that begins at the last reversal."""
    x = config.amplitude * np.exp(-times / 20) * np.sin(times)
    turns = np.arctan(20.0) + np.pi * np.arange(20)

    def virgin(way):
        return -np.expm1(-way)

    force, x_r, f_r, sign = virgin(x), 0.0, 0.0, 1.0
    for k, turn in enumerate(turns):
        end = config.amplitude * np.exp(-turn / 20) * np.sin(turn)
        f_r = sign * virgin(abs(end)) if k == 0 else f_r + sign * 2 * virgin(abs(end - x_r) / 2)
        x_r, sign = end, -sign
        later = times > turn
        force[later] = f_r + sign * 2 * virgin(np.abs(x[later] - x_r) / 2)
    return force


def measured(config, strengths):
    """The largest deviation from the continuum."""
    n = len(strengths)
    law = MaxwellSlip(kappa=(1 / n,) * n, strength=tuple((strengths / n).tolist()))
    times = np.linspace(0, config.end, config.columns)
    run = element_cloud(law, position=motion(config)).solve(
        (0, config.end), t_eval=times, rtol=1e-12, atol=1e-15
    )
    return float(np.abs(run["force"] - masing(config, times)).max())


def run(config: Config) -> dict:
    rows = []
    for n in config.numbers:
        off = measured(config, -np.log1p(-(np.arange(n) + 0.5) / n))
        rows.append({"n": n, "way": "middles", "off": [off]})
        if n <= config.most_drawn:
            drawn = [np.random.default_rng(seed).exponential(size=n) for seed in range(config.draws)]
            rows.append({"n": n, "way": "drawn", "off": [measured(config, strengths) for strengths in drawn]})
    return {"rows": rows}


def slope(rows):
    """(order, its error) of the deviation in 1/n."""
    n = np.log(np.repeat([r["n"] for r in rows], [len(r["off"]) for r in rows]))
    off = np.log(np.concatenate([r["off"] for r in rows]))
    (order, _), covariance = np.polyfit(n, off, 1, cov=True)
    return -order, float(np.sqrt(covariance[0, 0]))


def needed(rows, allowed=1e-3):
    """From how many sliders on the deviation is no larger, along the fitted line."""
    order, _ = slope(rows)
    level = np.mean([np.log(r["off"]).mean() + order * np.log(r["n"]) for r in rows])
    return float(np.exp((level - np.log(allowed)) / order))


def split(data):
    return {way: [r for r in data["rows"] if r["way"] == way] for way in ("middles", "drawn")}


def claims(data: dict) -> list[Claim]:
    (middles, e_m), (drawn, e_d) = (slope(rows) for rows in split(data).values())
    return [
        claim("Strengths at the middles of equal shares: order 2", "2", f"{middles:.3f} +- {e_m:.3f}",
              abs(middles - 2) < 3 * e_m + 0.05, "another order", origin="derived"),
        claim("Strengths drawn at random: order 1/2", "0.5", f"{drawn:.3f} +- {e_d:.3f}",
              abs(drawn - 0.5) < 3 * e_d, "another order", origin="derived"),
    ]  # fmt: skip


def verdict(data: dict) -> str:
    few, many = (needed(rows) for rows in split(data).values())
    return (
        f"For a thousandth of the strength {few:.0f} sliders at the middles do, or {many:.1g} that are drawn."
    )


def draw(data: dict):
    figure = new_figure(3.5, 2.8)
    ax = figure.subplots()
    for rows, name, label in zip(
        split(data).values(),
        ("with events", "left"),
        ("middles of equal shares", "drawn at random"),
        strict=True,
    ):
        for r in rows:
            ax.loglog(
                [r["n"]] * len(r["off"]), r["off"], "o", color=COLOUR[name], markersize=3, fillstyle="none"
            )
        n = np.array([r["n"] for r in rows], float)
        order, _ = slope(rows)
        level = np.exp(np.mean([np.log(r["off"]).mean() + order * np.log(r["n"]) for r in rows]))
        ax.loglog(
            n, level * n**-order, color=COLOUR[name], linewidth=0.8, label=f"{label}: $n^{{-{order:.2f}}}$"
        )
    ax.set(xlabel="sliders n", ylabel="largest deviation of the force")
    ax.legend()
    return figure


STUDY = Study(
    name="continuum",
    question="How many sliders does a multistate law need to be that of a continuum of sliders?",
    expected="the deviation falls as n^-2 where strengths are spread evenly, as n^-1/2 where they are drawn",
    full=Config(),
    fast=Config(numbers=(10, 30, 100, 300, 1000), draws=4),
    run=run,
    claims=claims,
    draw=draw,
    verdict=verdict,
)

if __name__ == "__main__":
    command(STUDY)
