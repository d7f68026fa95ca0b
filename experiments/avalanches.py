"""How often are small and large slips of a train of blocks, and does it depend on the layer of friction?

    x_i'' = kc (x_(i+1) - 2 x_i + x_(i-1)) - x_i - lam (1 + rho z)/(1 + |x_i' - V| 2 alpha),    on a belt of speed V

with the two levels 1 + sigma at rest and 1 at the beginning of a slip. In the layer the static part is z = 1 - lam^2 at
once (two levels), or a hidden state that comes to it within the time beta, beta z' = 1 - lam^2 - z.

Hypothesis: the sizes M of small avalanches (sums of the slips' lengths) have a density M^-(1 + b). The exponent b
depends on the rate alpha at which friction weakens; it does not depend on the layer as long as beta is much shorter
than the slip of one block, and does where it is as long.

Derivation. A slip of one block lasts about pi/w, w^2 = 1 + 2 kc. What is weaker than at rest during a slip is weaker by
sigma if beta w << 1, whatever the layer; with beta w >> 1 the static part stands during the whole slip, only 1/(1 + 2
alpha |v|) weakens, and small slips hardly take their neighbours along. The smallest avalanche is a slip of one block
between blocks that stick, an initial value problem that SciPy solves.

Method: exact event-driven runs of the whole train, avalanches from the catalogue of events; b by maximum likelihood
of a power law that is cut off at both ends, in a range that is fixed beforehand: from 4 to 100 times the smallest slip
of two levels. Its error is the larger one of that of the likelihood and of what four quarters of the run tell, as
avalanches follow each other. The first fifth of a run, which knows its start, is left out.

Found: with two levels the exponent hardly depends on the weakening; behind slow layers (beta = 1 and 10) it does, one
falls and one rises with the rate. The layer changes it most where it is as slow as a slip: there it is larger. This
last claim was added after the first results.

New, as far as we know: that layers are compared, with the same two levels of force.

Usage: python experiments/avalanches.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from studytools import Claim, Study, claim, command, parts

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from pwsmooth import Family, Switch, System, solve
from pwsmooth.families import Recorder
from pwsmooth.laws.friction import StaticKinetic
from pwsmooth.plotting import COLOUR, new_figure

V, kc, rho, alpha, beta = sp.symbols("V kc rho alpha beta", positive=True)


@dataclass(frozen=True)
class Config:
    """The train, weakening rates, and relaxation times of the layer (0: two levels)."""

    elements: int = 400
    end: float = 5000.0
    speed: float = 0.01
    coupling: float = 25.0
    sigma: float = 0.1
    rates: tuple[float, ...] = (0.5, 1.0, 2.0)
    layers: tuple[float, ...] = (0.0, 0.01, 0.1, 1.0, 10.0)
    range: tuple[float, float] = (4.0, 100.0)  # of the fit, in smallest slips of two levels
    rtol: float = 1e-9
    shown: float = 400.0  # time of the space-time picture


def train(config, relaxing):
    blocks = Family(config.elements, periodic=True)
    x, v, z = blocks.symbols("x v z")
    lam = Switch("lam", v - V)
    static = z if relaxing else 1 - lam**2
    pull = blocks.neighbour(x, 1) - 2 * x + blocks.neighbour(x, -1)
    friction = lam * (1 + rho * static) / (1 + 2 * alpha * sp.Abs(v - V))
    rates = {x: v, v: kc * pull - x - friction}
    strength = float(StaticKinetic.rho(SimpleNamespace(F_s=1 + config.sigma, F_c=1.0)))
    values = {V: config.speed, kc: config.coupling, rho: strength, alpha: 1.0}
    start = {x: np.random.default_rng(1).uniform(-0.3, 0.3, config.elements), v: config.speed}
    if relaxing:
        rates, values, start = rates | {z: (1 - lam**2 - z) / beta}, values | {beta: 1.0}, start | {z: 1.0}
    return System(rates, parameters=values), start


def exponent(sizes, low, high):
    """(b, its error, number) of a density M^-(1 + b) from low to high, by maximum likelihood."""
    logs = np.log(sizes[(sizes >= low) & (sizes < high)] / low)
    width = math.log(high / low)
    b = (
        brentq(lambda b: 1 / b - width / math.expm1(b * width) - logs.mean(), -20, 20)
        if len(logs) > 2
        else math.nan
    )
    # Fisher's information of one number: the variance of the logarithms.
    spread = 1 / b**2 - (width / (2 * math.sinh(b * width / 2))) ** 2
    return b, 1 / math.sqrt(spread * len(logs)), len(logs)


def one_slip(config, rate):
    """The length of a slip of one block between blocks that stick."""
    w2 = 1 + 2 * config.coupling

    def slip(t, y):
        return y[1], 1 + config.sigma + config.speed * t - w2 * y[0] - 1 / (1 + 2 * rate * y[1])

    def ends(t, y):
        return y[1] if t > 1e-6 else 1.0

    ends.terminal = True
    return solve_ivp(slip, (0, 10), (0, 0), events=ends, rtol=1e-12, atol=1e-15, method="DOP853").y[0, -1]


def measured(config, rate, relaxation):
    """Sizes of avalanches of a run, and a window of its slips."""
    system, start = train(config, relaxation > 0)
    driven = system.with_parameters({alpha: rate} | ({beta: relaxation} if relaxation else {}))
    run = solve(driven, (0, config.end), start, record=Recorder(), rtol=config.rtol)
    if not run.success:
        raise RuntimeError(str(run.outcome))
    found = run.catalogue.avalanches(drift=config.speed)
    late = found.start > config.end / 5
    slips = run.catalogue.slips(drift=config.speed)
    seen = slips.start > config.end - config.shown
    return {
        "alpha": rate, "beta": relaxation, "events": len(run.events), "sizes": found.moment[late],
        "largest": int(found.area[late].max()),
        "slips": [slips.start[seen], slips.end[seen], slips.element[seen]],
    }  # fmt: skip


def run(config: Config) -> dict:
    cases = {
        f"alpha {rate:g}, beta {relaxation:g}": (measured, config, rate, relaxation)
        for rate in config.rates
        for relaxation in config.layers
    }
    runs = parts(cases, workers=1)
    rows, smallest, picture = [], {}, []
    for found in runs:
        sizes = np.array(found.pop("sizes"))
        slips = found.pop("slips")
        if found["beta"] == 0 and found["alpha"] == config.rates[len(config.rates) // 2]:
            picture = slips
        single = smallest.setdefault(found["alpha"], one_slip(config, found["alpha"]))
        low, high = (c * single for c in config.range)
        b, error, number = exponent(sizes, low, high)
        quarters = [exponent(part, low, high)[0] for part in np.array_split(sizes, 4)]
        error = max(error, float(np.std(quarters, ddof=1)) / 2)
        edges = np.geomspace(0.5 * single, 2e5 * single, 57)
        count, _ = np.histogram(sizes, edges)
        rows.append(found | {
            "b": b, "error": error, "number": number, "avalanches": len(sizes), "smallest": sizes.min(),
            "single": single, "edges": edges, "count": count,
        })  # fmt: skip
    return {
        "rows": rows,
        "slips": picture,
        "range": config.range,
        "frequency": math.sqrt(1 + 2 * config.coupling),
    }


def apart(row, other):
    """Difference of two exponents in their common error."""
    return abs(row["b"] - other["b"]) / math.hypot(row["error"], other["error"])


def claims(data: dict) -> list[Claim]:
    rows, w = data["rows"], data["frequency"]
    two = {r["alpha"]: r for r in rows if r["beta"] == 0}
    fast = [r for r in rows if 0 < r["beta"] * w < 0.2]
    slow = [r for r in rows if r["beta"] * w > 5]
    off = max(abs(r["smallest"] / r["single"] - 1) for r in two.values())
    alike = [r for r in rows if 0.2 <= r["beta"] * w <= 2]
    near, far = [apart(r, two[r["alpha"]]) for r in fast], [apart(r, two[r["alpha"]]) for r in slow]
    larger = min(apart(r, two[r["alpha"]]) * np.sign(r["b"] - two[r["alpha"]]["b"]) for r in alike)
    rates = sorted(two)
    along = max(apart(two[a], two[b]) for a in rates for b in rates)
    return [
        claim(
            "The smallest avalanche is the slip of one block", "1e-6 of it", f"within {off:.1e}", off < 1e-6,
            "it is another", origin="independent",
        ),
        claim(
            "The exponent depends on the rate at which friction weakens", "more than 3 errors",
            f"{along:.1f} errors between rates", along > 3, "no more than that",
        ),
        claim(
            "A layer much faster than a slip changes no exponent", "at most 3 errors", f"{max(near):.1f} errors",
            max(near) <= 3, "an exponent moves",
        ),
        claim(
            "A layer slower than a slip does", "more than 3 errors", f"{min(far):.1f} to {max(far):.1f} errors",
            min(far) > 3, "some exponent stays",
        ),
        claim(
            "A layer as slow as a slip makes the exponent larger", "more than 3 errors, found first",
            f"{larger:.1f} errors or more", larger > 3, "not by that much",
        ),
    ]  # fmt: skip


def verdict(data: dict) -> str:
    rows = {(r["alpha"], r["beta"]): r for r in data["rows"]}
    middle = sorted({a for a, _ in rows})[len({a for a, _ in rows}) // 2]
    told = ", ".join(
        f"{rows[middle, b]['b']:.2f}({rows[middle, b]['error']:.2f}) at beta = {b:g}"
        for b in sorted({b for _, b in rows})
    )
    return f"At alpha = {middle:g} the exponent b is {told}."


def draw(data: dict):
    from matplotlib.collections import LineCollection

    figure = new_figure(7.0, 5.4)
    top, bottom = figure.subfigures(2, 1, height_ratios=(1, 1.1))
    space = top.subplots()
    start, end, element = (np.array(column) for column in data["slips"])
    lines = np.stack([np.stack([start, element], 1), np.stack([np.maximum(end, start + 0.4), element], 1)], 1)
    space.add_collection(LineCollection(lines, colors=COLOUR["with events"], linewidths=0.7))
    space.set(xlim=(start.min(), start.max()), ylim=(0, element.max() + 1), xlabel="time t", ylabel="block")
    left, right = bottom.subplots(1, 2)
    rows = data["rows"]
    layers = sorted({r["beta"] for r in rows})
    names = ("with events", "left", "stick", "fast", "velocity")
    rates = sorted({r["alpha"] for r in rows})
    middle = rates[len(rates) // 2]
    for k, (layer, name) in enumerate(zip(layers, names, strict=False)):
        label = f"beta = {layer:g}" if layer else "two levels"
        (one,) = (r for r in rows if r["beta"] == layer and r["alpha"] == middle)
        edges, count = np.array(one["edges"]), np.array(one["count"])
        density = count / np.diff(edges) / one["avalanches"]
        seen = count > 0
        left.loglog(np.sqrt(edges[1:] * edges[:-1])[seen], density[seen], ".-", color=COLOUR[name], markersize=3,
                    linewidth=0.6, label=label)  # fmt: skip
        own = sorted((r for r in rows if r["beta"] == layer), key=lambda r: r["alpha"])
        right.errorbar(
            [r["alpha"] * 1.04 ** (k - 2) for r in own], [r["b"] for r in own], [r["error"] for r in own],
            fmt="o-", color=COLOUR[name], markersize=3, linewidth=0.8, capsize=2, label=label,
        )  # fmt: skip
    for cut in data["range"]:
        left.axvline(cut * one["single"], color=COLOUR["mark"], linewidth=0.6, linestyle=":")
    left.set(xlabel=f"size M of an avalanche, alpha = {middle:g}", ylabel="density")
    right.set(xlabel="weakening rate alpha", ylabel="exponent b", xscale="log")
    right.set_xticks(rates, [f"{rate:g}" for rate in rates])
    right.minorticks_off()
    left.legend(loc="lower left")
    return figure


STUDY = Study(
    name="avalanches",
    question="How often are small and large slips of a train of blocks, and does it depend on the layer of friction?",
    expected="a power law whose exponent depends on weakening, and on the layer only if that is slower than a slip",
    full=Config(),
    fast=Config(elements=200, end=1500.0, rates=(0.5,), layers=(0.0, 0.02, 0.1, 10.0), shown=100.0),
    run=run,
    claims=claims,
    draw=draw,
    verdict=verdict,
)

if __name__ == "__main__":
    command(STUDY)
