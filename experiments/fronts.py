"""How fast does a front of switchings run along a chain, and where does it stop?

    v_i' = D (v_(i+1) - 2 v_i + v_(i-1)) - v_i + H(v_i - a):   elements behind are near 1, those ahead near 0

Hypothesis: the speed is that of the closed form, to rounding, and ever smaller towards the threshold a_p at which the
front is pinned, as 1/|ln(a_p - a)|: slower than any power. Beyond a_p nothing moves at all.

Derivation. The chain is linear between its switchings, with the response G_j(t) = exp(-(1 + 2 D) t) I_j(2 D t) of an
element to a pulse j links away. In a front of speed c element j behind has switched j/c ago, and the one that switches
now is at a:

    a = sum over j >= 1 of the integral of G_j from 0 to j/c.

With c = 0 that is the sum of the static responses, a_p = 1/2 - 1/(2 sqrt(1 + 4 D)), and a_p - a is that of the
integrals from j/c on, of which exp(-j/c) is left: a_p - a ~ exp(-1/c), c ~ 1/|ln(a_p - a)|. The same speed solves
a = 1/2 - (1/pi) integral of c/((1 + 4 D sin^2(k/2))^2 + c^2 k^2) over k from 0 to infinity, which is printed for
bistable chains; here it is a check of the sum.

Method: families whose events are local (`solve`); the speed is that between two elements far from the start. What is
pinned is run for long.

New: speeds to ten digits down to a_p - a = 1e-6, and the constant of the logarithm.

Usage: python experiments/fronts.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ive
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from pwsmooth import Family, System, solve
from pwsmooth.plotting import COLOUR, new_figure

D, a = sp.symbols("D a", positive=True)


@dataclass(frozen=True)
class Config:
    """Couplings, thresholds below the pinned one (log10 of the distance), and the chain."""

    couplings: tuple[float, ...] = (0.5, 1.0, 4.0)
    log_distance: tuple[float, float, int] = (-6.0, -0.8, 27)
    elements: int = 240
    first: int = 90
    last: int = 170
    rtol: float = 1e-12
    long: float = 2000.0  # time in which what is pinned does not move
    beyond: tuple[float, ...] = (1e-6, 1e-3, 1e-1)  # thresholds above the pinned one


def pinned(coupling):
    """The smallest threshold at which the front stands."""
    return 0.5 - 0.5 / math.sqrt(1 + 4 * coupling)


def distance(coupling, c):
    """How far the threshold of a front of speed c is below the pinned one."""
    total = 0.0
    for j in range(1, 10_000):
        tail = quad(
            lambda t, j=j: math.exp(-t) * ive(j, 2 * coupling * t), j / c, j / c + 40, epsabs=0, limit=200
        )[0]
        total += tail
        if j > 3 * c and tail < 1e-15 * total:
            break
    return total


def speed(coupling, gap):
    """The c whose front has a threshold that far below the pinned one."""
    return brentq(lambda c: math.log(distance(coupling, c) / gap), 0.02, 20.0, xtol=1e-13, rtol=1e-13)


def printed(coupling, c):
    """The threshold by the integral over wave numbers, period by period."""
    total = 0.0
    for m in range(4000):
        total += quad(
            lambda k: c / ((1 + 4 * coupling * math.sin(k / 2) ** 2) ** 2 + (c * k) ** 2),
            2 * math.pi * m,
            2 * math.pi * (m + 1),
        )[0]
    beyond = 2 * math.pi * 4000
    tail = 1 / (c * beyond)  # of 1/(c k^2), the mean of what is left
    return 0.5 - (total + tail) / math.pi


def chain(config):
    blocks = Family(config.elements)
    (v,) = blocks.symbols("v")
    spread = blocks.neighbour(v, 1) - 2 * v + blocks.neighbour(v, -1)
    system = System({v: D * spread - v + sp.Heaviside(v - a)}, parameters={D: 1.0, a: 0.2})
    return system, {v: np.where(np.arange(config.elements) < 30, 1.0, 0.0)}


def measured(system, start, coupling, threshold, expected, config):
    """The speed between two elements of the chain."""
    end = (config.last + 30) / expected + 40
    driven = system.with_parameters({D: coupling, a: threshold})
    run = solve(driven, (0, end), start, t_eval=[0, end], rtol=config.rtol, atol=1e-14)
    log = run.catalogue
    at = dict(zip(log.element.tolist(), log.t.tolist(), strict=True))
    return (config.last - config.first) / (at[config.last] - at[config.first])


def run(config: Config) -> dict:
    system, start = chain(config)
    rows = []
    for coupling in config.couplings:
        for gap in 10 ** np.linspace(*config.log_distance):
            if gap >= 0.95 * pinned(coupling):
                continue
            c = speed(coupling, gap)
            found = measured(system, start, coupling, pinned(coupling) - gap, c, config)
            rows.append({"D": coupling, "gap": gap, "speed": found, "exact": c})
    still = []
    for coupling in config.couplings:
        for more in config.beyond:
            held = system.with_parameters({D: coupling, a: pinned(coupling) + more})
            ends = solve(held, (0, config.long), start, t_eval=[0, config.long], rtol=config.rtol)
            still.append({"D": coupling, "more": more, "events": int((ends.catalogue.element > 40).sum())})
    check = [
        {"D": 1.0, "speed": c, "a": pinned(1.0) - distance(1.0, c), "printed": printed(1.0, c)}
        for c in (0.527544201, 0.907986526)
    ]
    return {"rows": rows, "still": still, "printed": check}


def claims(data: dict) -> list[Claim]:
    rows = data["rows"]
    off = max(abs(r["speed"] / r["exact"] - 1) for r in rows)
    # The constant in front of the logarithm: c |ln(gap)| has corrections of order c.
    slopes = []
    for coupling in sorted({r["D"] for r in rows}):
        near = sorted((r for r in rows if r["D"] == coupling), key=lambda r: r["gap"])[:2]
        slopes.append((1 / near[0]["speed"] - 1 / near[1]["speed"]) / math.log(near[1]["gap"] / near[0]["gap"]))
    moved = sum(r["events"] for r in data["still"])
    apart = max(abs(r["a"] - r["printed"]) for r in data["printed"])
    return [
        claim(
            "The front has the speed of the closed form", "1e-9 of it", f"within {off:.1e} of it, {len(rows)} fronts",
            off < 1e-9, "the largest deviation is more", origin="derived",
        ),
        claim(
            "Near the pinned threshold 1/c grows by 1 for each e of the distance", "1",
            f"{min(slopes):.3f} to {max(slopes):.3f}", all(abs(s - 1) < 0.1 for s in slopes),
            "the slope of 1/c in ln(a_p - a) is another", origin="derived",
        ),
        claim(
            "Beyond it nothing moves", "no events", f"{moved} events", moved == 0, "elements switched",
            origin="derived",
        ),
        claim(
            "The integral over wave numbers is the sum over elements", "1e-7", f"{apart:.1e} apart", apart < 1e-7,
            "they differ by more", origin="printed", where="bistable chains",
        ),
    ]  # fmt: skip


def draw(data: dict):
    figure = new_figure(7.0, 2.9)
    left, right = figure.subplots(1, 2)
    names = ("right", "left", "stick")
    for coupling, name in zip(sorted({r["D"] for r in data["rows"]}), names, strict=False):
        own = sorted((r for r in data["rows"] if r["D"] == coupling), key=lambda r: r["gap"])
        gap, exact, found = (np.array([r[k] for r in own]) for k in ("gap", "exact", "speed"))
        left.semilogx(gap, exact, color=COLOUR[name], label=f"D = {coupling:g}")
        left.semilogx(gap, found, "o", color=COLOUR[name], markersize=3, fillstyle="none")
        right.loglog(gap, np.maximum(np.abs(found / exact - 1), 1e-16), ".", color=COLOUR[name])
    left.set(xlabel="distance of the threshold from pinned", ylabel="speed of the front (elements a time)")
    right.set(xlabel="distance of the threshold from pinned", ylabel="relative deviation")
    left.legend()
    return figure


STUDY = Study(
    name="fronts",
    question="How fast does a front of switchings run along a chain, and where does it stop?",
    expected="the speed of the closed form, down to where it is pinned, as the inverse of a logarithm",
    full=Config(),
    fast=Config(couplings=(1.0,), log_distance=(-4.0, -1.0, 4), long=200.0),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
