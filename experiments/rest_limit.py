"""S1: how strong a shaking does a stuck block survive, if its static friction has a memory?

    beta z' = 1 - lam^2 - z,   lam (1 + rho z) = F(t)/N,   F = q'' - k y0;   at rest while |lam| <= 1

Hypothesis: under q'' = A sin(omega t) rest survives up to A*(omega beta), which rises from N mu_s, the peak of what
slow shaking may have, to sqrt(2) N mu_s for rho >= 2 and N (1 + rho/2) for rho < 2, where the root mean square
counts. Rest is lost in a saddle-node of the periodic z, or where |lam| reaches 1, whichever comes first.

Derivation. Fast: z does not follow, so lam = F/(1 + rho z), z = 1 - <lam^2>, and a = lam_r (1 + rho (1 - lam_r^2))
for the root mean squares a of F and lam_r of lam: the cubic of slow shaking, with its fold mu_s at lam_s. A drive
with the peak c a reaches |lam| = 1 first where c lam_s > 1, at c a = N (1 + rho (1 - 1/c^2)); the sine's c = sqrt(2)
does so for rho < 2. Slow: near the peak of F the state passes the fold, x' = x^2 + a - t^2, which turns back up to a
= 1: A* = N mu_s + omega beta N sqrt(mu_s/(G_F G_zz)), with the derivatives G_F = 2 lam_s/(1 + rho z_s), G_zz = 6
rho^2 lam_s^2/(1 + rho z_s)^2 of beta z'.

Method: z' is a driven system of one state with an event at |lam| = 1. Its periodic orbit is followed over A
(pwsmooth.follow): the first fold, or the first touch of the event, is A*. Below omega beta = 0.04 or so the fold is
that of a canard explosion narrower in A than a rounding: A* is the value at which the branch stands still. Curves of
both in (rho, A) are followed at omega beta = 100. N = 1. Checks of their own: Runge-Kutta steps of the period map of
many z at once, A* where its largest P(z) - z vanishes (a touch of |lam| = 1 by SciPy's DOP853); runs of the whole
block, with its switch, a little below and above A*. Two tones and y0 are followed in the same way; noise (a new random
force every h, many seeds) is stepped by itself.

Error bars: A* is followed on two sections of the period; of noise, 95 % of a bootstrap over the seeds.

Changed after first runs: noise was at first expected to fall short by sqrt(h/beta) for both laws, which the arcsine
law did not do; its power 2/3, of a barrier at a saddle-node, was derived then.

Usage: python experiments/rest_limit.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar
from studytools import Claim, Study, claim, command, parts

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from pwsmooth import Event, Strobe, Switch, System, find_orbit, follow, solve
from pwsmooth.analysis.continuation import Steps
from pwsmooth.plotting import COLOUR, new_figure

t, y, v, z = sp.symbols("t y v z", real=True)
A, rho, b = sp.symbols("A rho b", positive=True)  # b = omega beta; times in 1/omega
y0 = sp.Symbol("y0", real=True)  # k y0
SHAPES = {
    "sin t": sp.sin(t),
    "sin t + sin(3t)/3": sp.sin(t) + sp.sin(3 * t) / 3,
    "sin t + sin 3t": sp.sin(t) + sp.sin(3 * t),
    "sin t + sin 2t": sp.sin(t) + sp.sin(2 * t),
}
ROUNDED = 2e-14  # of A: a hundred of its units in the last place
INDEPENDENT = {  # of an independent computation, (rho, omega beta): A*
    (3, 0.1): 1.88155, (3, 0.5): 2.24295, (3, 1): 2.41444, (3, 3): 2.50132, (1, 30): 1.49994, (1.5, 30): 1.74990,
    (2, 30): 1.99989, (3, 30): 2.51402, (5, 30): 3.57751,
}  # fmt: skip


@dataclass(frozen=True)
class Config:
    """rho, omega beta (log10), offsets k y0, what is checked, and the noise."""

    rho: tuple[float, ...] = (0.6, 1.0, 1.5, 2.0, 3.0, 6.0)
    log_b: tuple[float, float, int] = (-3.0, 2.0, 21)
    offsets: tuple[float, ...] = (0.0, 0.4, 0.8, 1.2, 1.6)
    plain: tuple[tuple[float, float], ...] = tuple(INDEPENDENT)
    block: tuple[tuple[float, float], ...] = ((1.0, 0.5), (1.0, 10.0), (3.0, 0.1), (3.0, 0.5), (3.0, 10.0))
    holds: tuple[float, ...] = (0.1, 0.03, 0.01)  # h/beta
    seeds: int = 48
    span: float = 100.0  # of the noise, in beta


def fold(rho):
    """(mu_s, lam_s)."""
    lam = math.sqrt((1 + rho) / (3 * rho))
    return (2 * rho * lam**3, lam) if lam < 1 else (1.0, 1.0)


def slow(rho, b):
    """A* of slow shaking to first order in omega beta."""
    mu, lam = fold(rho)
    stiff = 1 + rho * (1 - lam**2)
    return mu + b * math.sqrt(mu / (2 * lam / stiff * 6 * rho**2 * lam**2 / stiff**2))


def fast(rho, crest):
    """The peak at which rest is lost under fast shaking, of a drive with this ratio of peak to root mean square."""
    mu, lam = fold(rho)
    return crest * mu if crest * lam <= 1 else 1 + rho * (1 - 1 / crest**2)


def crest(shape, offset=0.0):
    """(peak, root mean square) of a drive, on a fine grid."""
    at = np.linspace(0, 2 * np.pi, 200_001)[:-1]
    values = sp.lambdify(t, shape)(at) - offset
    return float(np.abs(values).max()), float(np.sqrt(np.mean(values**2)))


# ---- continuation


def system(shape=SHAPES["sin t"], phase=0):
    lam = (A * shape.subs(t, t + phase) - y0) / (1 + rho * z)
    bound = Event(1 - lam**2, name="bound")
    return System(
        {z: (1 - lam**2 - z) / b}, time=t, parameters={A: 0.3, b: 1.0, rho: 3.0, y0: 0.0}, events=[bound]
    )


def limit(field, values, period, low, high):
    """(A*, how it is lost, z of the orbit nearest to it) by continuation from a small A to one at which nothing rests.

    Behind the fold the branch is followed back to the small A, no farther.
    """
    field = field.with_parameters({**values, A: low})
    transient = int(20 + 30 * float(field.parameters[b]))
    orbit = find_orbit(field, {z: 0.6}, seen=Strobe(period), transient=min(transient, 400))
    for most in (60, 120, 500):
        branch = follow(orbit, {A: high}, steps=Steps(max_points=most))
        narrow = (
            np.ptp(branch.values[-10:]) < ROUNDED
        )  # a canard explosion, over which A does not change any more
        if branch.specials or narrow or not branch.end.startswith("stopped"):
            break
    if branch.specials:
        first = branch.specials[0]
        how = "saddle-node" if first.kind == "fold" else "|lam| = 1"
        return float(first.parameter), how, float(first.point.x[0])
    if not narrow and not any(
        words in branch.end for words in ("trajectories from there do", "no orbit was found")
    ):
        raise RuntimeError(f"{values}: {branch.end}")
    last = branch.points[int(np.argmax(branch.values))]
    return float(branch.values.max()), "canard", float(last.x[0])


def sine_limit(rho_, b_, phase=0):
    """`limit` under sin t."""
    low, high = 0.97 * fold(rho_)[0], 1.1 * fast(rho_, math.sqrt(2))
    return limit(system(phase=phase), {rho: rho_, b: b_}, sp.pi, low, high)


def row(rho_, b_):
    """A* on two sections, half a turn of the force's peak apart."""
    found = [sine_limit(rho_, b_, phase) for phase in (0, 3 * sp.pi / 5)]
    return {"rho": rho_, "b": b_, "A": found[0][0], "how": found[0][1], "bar": abs(found[0][0] - found[1][0])}


def line(rho_, log_b):
    return [row(rho_, float(x)) for x in 10 ** np.linspace(*log_b)]


def shaped(name, rho_):
    """A drive of several tones."""
    peak, mean = crest(SHAPES[name])
    law = fast(rho_, peak / mean)
    low, high = 0.97 * fold(rho_)[0] / peak, 1.1 * law / peak
    found = limit(system(SHAPES[name]), {rho: rho_, b: 100.0}, 2 * sp.pi, low, high)
    return {
        "shape": name, "rho": rho_, "crest": peak / mean, "peak": found[0] * peak, "how": found[1], "law": law,
    }  # fmt: skip


def offset_by(rho_, offset):
    """The sine beside an offset."""
    law = offset_law(rho_, offset)
    low = 0.97 * (fold(rho_)[0] - offset)
    found = limit(system(), {rho: rho_, b: 100.0, y0: offset}, 2 * sp.pi, low, 1.1 * law)
    return {"rho": rho_, "offset": offset, "A": found[0], "how": found[1], "law": law}


def curves():
    """The fold and the touch of |lam| = 1 over (rho, A) at omega beta = 100."""
    field = system().with_parameters({b: 100.0, A: 0.9})
    orbit = find_orbit(field, {z: 0.6}, seen=Strobe(sp.pi), transient=2000)
    folds = follow(orbit, {A: 6.0}, steps=Steps(max_points=60)).of_kind("fold")[0]
    ranges = {rho: (0.55, 6.5), A: (0.5, 8.0)}
    kept = {}
    for name, start, more in (
        ("saddle-node", folds, {}),
        ("|lam| = 1", orbit, {"kind": "grazing of an event", "switch": "bound"}),
    ):
        curve = follow(start, ranges, steps=Steps(longest=0.1), **more)
        kept[name] = {"values": curve.values, "points": [list(p.values.values()) for p in curve.points]}
    return kept


# ---- checks of their own


def plain_limit(rho_, b_):
    """A* without the package."""
    if (3 * rho_ - 1 - rho_) / (3 * rho_) < 0.5 - 1e-9:  # lam_s^2 > 1/2: |lam| = 1 comes first where b is large
        return brentq(lambda a: _largest(a, rho_, b_) - 1, 0.9 * fast(rho_, math.sqrt(2)), fast(rho_, math.sqrt(2)),
                      xtol=1e-9)  # fmt: skip
    low, high = fold(rho_)[0], math.sqrt(2) * fold(rho_)[0] + 1e-3
    return brentq(lambda a: _gap(a, rho_, b_), low, high, xtol=1e-8)


def _rate(s, height, a, rho_, b_):
    return (1 - (a * np.sin(s) / (1 + rho_ * height)) ** 2 - height) / b_


def _largest(a, rho_, b_):
    """The largest |lam| of the periodic z, by DOP853."""

    def over(begin, dense=False):
        return solve_ivp(_rate, (0, math.pi), [begin], args=(a, rho_, b_), method="DOP853", rtol=1e-12, atol=1e-14,
                         dense_output=dense)  # fmt: skip

    begin = brentq(lambda s: over(s).y[0, -1] - s, 1 - fold(rho_)[1] ** 2, 0.95)
    run = over(begin, True)
    peak = minimize_scalar(
        lambda s: -a * math.sin(s) / (1 + rho_ * float(run.sol(s)[0])), bounds=(1, 2.2), method="bounded",
        options={"xatol": 1e-10},
    )  # fmt: skip
    return -peak.fun


def _gap(a, rho_, b_, steps=2000):
    """The largest P(z) - z over z, from soon after the peak of the force to the next, by Runge-Kutta steps."""
    begin, h = 0.6 * math.pi, math.pi / steps
    low, high = 0.02, 0.98
    for _ in range(3):
        first = np.linspace(low, high, 200)
        height = first.copy()
        for k in range(steps):
            s = begin + k * h
            k1 = _rate(s, height, a, rho_, b_)
            k2 = _rate(s + h / 2, height + h / 2 * k1, a, rho_, b_)
            k3 = _rate(s + h / 2, height + h / 2 * k2, a, rho_, b_)
            k4 = _rate(s + h, height + h * k3, a, rho_, b_)
            height = height + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            height = np.where(height > 0, height, -0.1)  # what has come so low is lost
        gap = height - first
        at = int(np.argmax(gap))
        low, high = first[max(at - 1, 0)], first[min(at + 1, 199)]
    return float(gap.max())


def block_rests(rho_, b_):
    """Whether the whole block, started at rest on the periodic z, still rests a little below and above A*."""
    at = sine_limit(rho_, b_)
    return {"rho": rho_, "b": b_, "rests": [_rests(factor, rho_, b_, at) for factor in (1 - 1e-3, 1 + 1e-3)]}


def _rests(factor, rho_, b_, row_):
    k, beta = sp.symbols("k beta", positive=True)
    lam = Switch("lam", v)
    block = System(
        {y: v, v: A * sp.sin(t) - k * y - lam * (1 + rho * z), z: (1 - lam**2 - z) / beta}, time=t,
        parameters={A: factor * row_[0], k: 3.1, rho: rho_, beta: b_},
    )  # fmt: skip
    run = solve(block, (0, 400 * max(1.0, b_)), {y: 0, v: 0, z: row_[2]}, rtol=1e-10)
    return not any(e.kind.startswith("slip") for e in run.events)


def noise_limits(law, hold, config, rho_=3.0):
    """Of every seed the largest peak that is survived for the span."""
    steps = round(config.span / hold)
    random = np.random.default_rng([19, round(1e4 * hold), len(law)])
    force = np.abs(
        random.uniform(-1, 1, (steps, config.seeds))
        if law == "uniform"
        else np.cos(random.uniform(0, np.pi, (steps, config.seeds)))
    )
    low, high = np.full(config.seeds, 1.0), np.full(config.seeds, 4.0)
    inner = max(1, math.ceil(hold / 0.02))
    h = hold / inner
    for _ in range(18):
        peak = 0.5 * (low + high)
        height = np.ones(config.seeds)
        alive = np.ones(config.seeds, bool)
        for k in range(steps):
            f = peak * force[k]
            for _ in range(inner):
                half = height + 0.5 * h * (1 - (f / (1 + rho_ * height)) ** 2 - height)
                height = height + h * (1 - (f / (1 + rho_ * half)) ** 2 - half)
                height = np.maximum(height, 0.0)
            alive &= f <= 1 + rho_ * height
        low, high = np.where(alive, peak, low), np.where(alive, high, peak)
    return 0.5 * (low + high)


# ---- the study


def run(config):
    noises = [
        (law, c, h) for law, c in (("uniform", math.sqrt(3)), ("arcsine", math.sqrt(2))) for h in config.holds
    ]
    offsets = [(q, offset) for q in (1.0, 3.0) for offset in config.offsets if offset < fold(q)[0]]
    groups = {
        "rows": {f"rho {q:g}": (line, q, config.log_b) for q in config.rho},
        "plain": {f"plain {q} {x}": (plain_limit, q, x) for q, x in config.plain},
        "noise": {f"noise {law} {h}": (noise_limits, law, h, config) for law, _, h in noises},
        "block": {f"block {q} {x}": (block_rests, q, x) for q, x in config.block},
        "shapes": {f"shape {name} {q}": (shaped, name, q) for name in SHAPES for q in (1.0, 3.0)},
        "offsets": {f"offset {q} {offset}": (offset_by, q, offset) for q, offset in offsets},
        "curves": {"curves": (curves,)},
    }
    found = iter(parts({name: job for group in groups.values() for name, job in group.items()}))
    data = {name: [next(found) for _ in group] for name, group in groups.items()}
    data["curves"] = data["curves"][0]
    data["plain"] = [
        {"rho": q, "b": x, "plain": there, "followed": sine_limit(q, x)[0], "other": INDEPENDENT.get((q, x))}
        for (q, x), there in zip(config.plain, data["plain"])
    ]
    data["noise"] = [
        {"law": law, "hold": h, "crest": c, "peaks": peaks, "limit": fast(3.0, c)}
        for (law, c, h), peaks in zip(noises, data["noise"])
    ]
    return data


def offset_law(rho_, offset):
    """A of the root mean square's law beside an offset k y0."""

    def excess(a):
        peak, mean = a + offset, math.sqrt(a * a / 2 + offset**2)
        return peak - fast(rho_, peak / mean)

    return brentq(excess, 1e-9, 20.0)


def extrapolated(mine, power):
    """Median peak for h -> 0, linear in h^power, with the 95 % interval of a bootstrap over the seeds.

    Near a bound that the force may not touch the fluctuations of z, of order sqrt(h/beta), are lost; near a saddle-node
    its barrier, of order (A* - A)^(3/2), over their square is.
    """
    random, x = np.random.default_rng(1), np.array([n["hold"] for n in mine]) ** power
    peaks = np.array([n["peaks"] for n in mine])
    picks = random.integers(0, peaks.shape[1], (2000, *peaks.shape))
    medians = np.median(np.take_along_axis(peaks[None], picks, axis=2), axis=2)
    ends = np.polyfit(x, medians.T, 1)[1]
    low, high = np.percentile(ends, [2.5, 97.5])
    return float(np.polyfit(x, np.median(peaks, axis=1), 1)[1]), float(low), float(high)


def claims(data) -> list[Claim]:
    rows = [r for line in data["rows"] for r in line]
    slowest = [(r["A"] - slow(r["rho"], r["b"])) / r["b"] for r in rows if r["b"] < 0.011 and r["rho"] >= 1]
    fastest = [(r["A"] / fast(r["rho"], math.sqrt(2)) - 1, r) for r in rows if r["b"] > 9]
    scaled = max(abs(x) * r["b"] for x, r in fastest)
    end = [abs(x) for x, r in fastest if r["b"] > 99]
    how = {
        q: {r["how"] for r in rows if r["rho"] == q and r["b"] > 9} for q in sorted({r["rho"] for r in rows})
    }
    meets = [p for c in data["curves"].values() for p in c["points"]]
    falls = [
        line[i]["rho"]
        for line in data["rows"]
        for i in range(len(line) - 1)
        if line[i + 1]["A"] < line[i]["A"] - 1e-6
    ]
    plain = data["plain"]
    off = max(abs(c["plain"] - c["followed"]) for c in plain)
    others = [(abs(c["other"] - c["followed"]), c) for c in plain if c["other"]]
    worst = max(others, key=lambda o: o[0])
    kept = [r["rests"] == [True, False] for r in data["block"]]
    shaped = [abs(s["peak"] / s["law"] - 1) for s in data["shapes"]]
    moved = [abs(s["A"] / s["law"] - 1) for s in data["offsets"]]
    result = [
        claim(
            "fast shaking: A* tends to sqrt(2) N mu_s (rho >= 2) or N (1 + rho/2) (rho < 2)",
            "ratio 1 as omega beta grows",
            f"off by {max(end):.1e} at most at omega beta = 100, by {scaled:.2g}/(omega beta) from 10 on",
            max(end) < 1e-3, "another limit",
            origin="derived",
        ),
        claim(
            "slow shaking: A* = N mu_s + omega beta N sqrt(mu_s/(G_F G_zz))", "to first order in omega beta",
            f"for omega beta <= 0.01 off by {max(map(abs, slowest)):.3f} omega beta at most (rho >= 1)",
            max(map(abs, slowest)) < 0.05, "another slope",
            origin="derived",
        ),
        claim(
            "A* rises with omega beta throughout", "at every rho", "it does" if not falls else f"not at rho {falls}",
            not falls, "it falls",
        ),
        claim(
            "rest is lost in a saddle-node for rho > 2 and at |lam| = 1 for rho < 2 (fast shaking)",
            "both at once at rho = 2",
            "; ".join(f"rho = {q:g}: {', '.join(sorted(h))}" for q, h in how.items())
            + f"; the curves meet at rho = {', '.join(f'{p[0]:.5f}' for p in meets)}",
            all(h == ({"|lam| = 1"} if q < 2 else {"saddle-node"}) for q, h in how.items() if q != 2)
            and len(meets) == 2 and max(abs(p[0] - 2) for p in meets) < 1e-3,
            "another border",
        ),
        claim(
            "continuation and the plain period map give one A*", "within 1e-6",
            f"{len(plain)} cases, off by {off:.1e} at most; the bars of all {len(rows)} values are below "
            f"{max(r['bar'] for r in rows):.1e}",
            off < 1e-6, "they differ",
            origin="independent",
        ),
        claim(
            "values of an independent computation", "all within 1e-5 of A*",
            f"largest difference {worst[0]:.1e} (rho = {worst[1]['rho']:g}, omega beta = {worst[1]['b']:g}: "
            f"{worst[1]['other']:.5f} there, {worst[1]['followed']:.6f} here, plain map {worst[1]['plain']:.6f})",
            worst[0] < 1e-5, "the plain map decides for ours",
            origin="independent",
        ),
        claim(
            "the whole block rests at 0.999 A* and slips at 1.001 A*", "in every case",
            f"{sum(kept)} of {len(kept)}", all(kept), "it does not",
        ),
        claim(
            "any drive: the peak is c N mu_s or, where c lam_s > 1, N (1 + rho (1 - 1/c^2)), c = peak/root mean square",
            "ratio 1 at omega beta = 100",
            f"{len(shaped)} drives of one or two tones, c = {min(s['crest'] for s in data['shapes']):.3f} to "
            f"{max(s['crest'] for s in data['shapes']):.3f}: off by {max(shaped):.1e} at most",
            max(shaped) < 1e-3, "the form of the drive matters",
            origin="derived",
        ),
        claim(
            "beside an offset k y0 the mean square is A^2/2 + (k y0)^2", "ratio 1 at omega beta = 100",
            f"{len(moved)} offsets: off by {max(moved):.1e} at most", max(moved) < 1e-3, "another law",
            origin="derived",
        ),
    ]  # fmt: skip
    for law, power in (("uniform", 1 / 2), ("arcsine", 2 / 3)):
        mine = [n for n in data["noise"] if n["law"] == law]
        found, low, high = extrapolated(mine, power)
        shown = ", ".join(f"{np.median(n['peaks']):.4f} (h = {n['hold']:g} beta)" for n in mine)
        result.append(
            claim(
                f"noise with {law} values, renewed every h: the same law as h/beta falls", f"{mine[0]['limit']:.4f}",
                f"{found:.4f} (95 %: {low:.4f} to {high:.4f}) for h -> 0 as h^{power:.2g}; medians {shown}",
                low <= mine[0]["limit"] <= high, "the interval misses it: this power of h is not all there is",
            )
        )  # fmt: skip
    return result


def verdict(data) -> str:
    good = [c.holds for c in claims(data)]
    said = "held" if good[0] and good[2] and good[3] else "did not hold"
    more = (
        " It holds for any drive that is fast beside the memory, with sqrt(2) replaced by peak over root mean square."
        if good[7] and good[8]
        else ""
    )
    return f"The hypothesis {said}, with the slope of A* at slow shaking in closed form.{more}"


def draw(data):
    figure = new_figure(3.5, 8.6)
    left, middle, right = figure.subplots(3, 1)
    colours = [COLOUR[k] for k in ("velocity", "left", "approximation", "exact", "right", "stick")]
    dashes = (":", "-", "-.", (0, (8, 2)), "--", (0, (5, 1, 1, 1, 1, 1)))
    for line, colour, dash in zip(data["rows"], colours, dashes):
        q, x = line[0]["rho"], np.array([r["b"] for r in line])
        mu = fold(q)[0]
        scaled = np.array([r["A"] for r in line]) / mu
        left.semilogx(x, scaled, color=colour, linewidth=1, linestyle=dash)
        for how, mark in (("saddle-node", "o"), ("|lam| = 1", "x"), ("canard", ".")):
            at = [i for i, r in enumerate(line) if r["how"] == how]
            left.plot(x[at], scaled[at], mark, color=colour, markersize=3.5, fillstyle="none")
        ends = x[x < 0.2]
        left.plot(ends, [slow(q, s) / mu for s in ends], ":", color=colour, linewidth=2, alpha=0.5)
        left.plot(x[-3:] * 1.7, [fast(q, math.sqrt(2)) / mu] * 3, "-", color=colour, linewidth=2.4, alpha=0.5)
        left.plot([], [], color=colour, linestyle=dash, label=f"$\\rho$ = {q:g}")
    for mark, label in (("o", "saddle-node"), ("x", "$|\\lambda|$ = 1"), (".", "canard")):
        left.plot([], [], mark, color=COLOUR["mark"], markersize=4, fillstyle="none", label=label)
    left.set(xlabel="$\\omega\\beta$", ylabel="$A^*/(N\\mu_s)$", title="Largest shaking survived")
    left.legend(loc="upper left", fontsize=7, ncols=2)
    left.set_ylim(0.98, 1.75)
    look = {"saddle-node": ("-", "right"), "|lam| = 1": ("--", "left")}
    for name, curve in data["curves"].items():
        style, colour = look[name]
        values = np.array(curve["values"])
        middle.plot(*values, style, color=COLOUR[colour], label=name.replace("|lam|", "$|\\lambda|$"))
        for point in curve["points"]:
            middle.plot(*point, "o", color=COLOUR["mark"], fillstyle="none", markersize=6)
    strengths = np.linspace(0.55, 6.5, 60)
    middle.plot(strengths, [fold(q)[0] for q in strengths], ":", color=COLOUR["mark"], label="slow: $\\mu_s$")
    middle.set(xlabel="$\\rho$", ylabel="$A/N$", title="Both ways, $\\omega\\beta$ = 100")
    middle.legend(fontsize=7)
    crests = np.linspace(1, 2, 101)
    for q, colour, dash in ((1.0, "left", "--"), (3.0, "right", "-")):
        right.plot(
            crests, [fast(q, c) for c in crests], dash, color=COLOUR[colour], label=f"law, $\\rho$ = {q:g}"
        )
        mine = [s for s in data["shapes"] if s["rho"] == q]
        right.plot([s["crest"] for s in mine], [s["peak"] for s in mine], "o", color=COLOUR[colour], markersize=4,
                   fillstyle="none", label="tones, $\\omega\\beta$ = 100" if q == 3 else None)  # fmt: skip
    marks = ("v", "s", "^")
    for i, n in enumerate(data["noise"]):
        low, mid, high = np.percentile(n["peaks"], [25, 50, 75])
        right.errorbar(n["crest"], mid, [[mid - low], [high - mid]], fmt=marks[i % 3], color=COLOUR["smoothed"],
                       markersize=4,
                       label=f"noise, h = {n['hold']:g} $\\beta$" if n["law"] == "arcsine" else None)  # fmt: skip
    right.set(
        xlabel="peak / root mean square of the drive", ylabel="largest peak survived, $/N$", title="Any drive"
    )
    right.legend(fontsize=7, loc="upper left")
    right.set_ylim(None, 4.6)
    return figure


STUDY = Study(
    name="rest_limit",
    question="S1: how strong a shaking does a stuck block survive, if its static friction has a memory?",
    expected="The root mean square replaces the peak as omega beta grows: from N mu_s to sqrt(2) N mu_s (rho >= 2) or "
    "N (1 + rho/2); lost in a saddle-node or where |lam| reaches 1.",
    full=Config(),
    fast=Config(
        rho=(1.0, 3.0), log_b=(-3.0, 2.0, 6), offsets=(0.8,), plain=((1, 30), (3, 0.5)), block=((3.0, 0.5),),
        holds=(0.1, 0.03), seeds=48, span=100.0,
    ),
    run=run,
    claims=claims,
    draw=draw,
    verdict=verdict,
)  # fmt: skip

if __name__ == "__main__":
    command(STUDY)
