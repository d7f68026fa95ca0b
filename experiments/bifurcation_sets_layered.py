"""E10: which orbits does a block have over the ratio r = eps/beta of its layer and the drive, and where do they change?

    y' = v,   v' = -sigma sin t - k y - c v - N lam (1 + rho z),   k = 3.1, c = 0.1, N = 1, rho = 3
    in the layer   u' = v',   z' = r (1 - lam^2 - z),   lam = L(u)

The layered view with a finite ratio (`layered({z: r})`). Its slow motion does not know of r, which only decides which
arrivals are captured: so the curves of folds and of broken symmetry are lines sigma = const, and they end on curves of
captures, of orbits that stick (above, in r, they are captured) and of orbits that pass (below, they pass).

The set: attractors on some lines r = const, followed over sigma with what branches off, and the curve of each
bifurcation over (r, sigma). Check: at random points, sweeps of many starts; each attractor, followed over either
parameter until it is stable no more, must be so up to a curve of the set or the border of the plane. Points nearer than
1e-3 (of sigma's range, and of that of log r) to a curve are left out. Orbits at rest are counted apart.

Expected: two sticks, one stick and slip only exist side by side between their captures; all curves of captures of an
itinerary that ends at r* = 0.6453 (capture.critical_ratio) meet the crossing-sliding of the slaved block there.

New: the plane was not drawn before. For r < r* sticking ends by capture, below r = 0.105 before the symmetry breaks;
and at one drive several of two sticks, one stick and slip only attract beside each other.

Usage: python experiments/bifurcation_sets_layered.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command, draw_set, part, parts

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from friction_oscillator import hidden, v, y, z

from pwsmooth import Strobe, find_orbit, follow, sweep
from pwsmooth.analysis.continuation import Steps, branch_off
from pwsmooth.analysis.maps import Stroboscopic
from pwsmooth.analysis.orbits import refine
from pwsmooth.analysis.sticking import critical_ratio
from pwsmooth.plotting import new_figure
from pwsmooth.studies import Period, Points, Work

DRIVE = 2 * sp.pi
MIRROR = {y: -y, v: -v}
NAMES = ("ratio_z", "sigma")


@dataclass(frozen=True)
class Config:
    """The plane, the lines on which the set begins, and the check."""

    ratios: tuple[float, float] = (0.03, 1.0)
    drives: tuple[float, float] = (1.0, 5.0)
    lines: tuple[float, ...] = (0.05, 0.12, 0.3, 0.55, 0.8)
    begins: tuple[float, ...] = (1.5, 2.2, 2.8, 3.4, 4.2)
    starts: int = 8  # at each of these
    points: int = 50
    tried: int = 100  # starts at each
    transient: int = 30
    near: float = 1e-3
    seed: int = 18


def scaled(at, config: Config) -> np.ndarray:
    """Points (2, n) of the plane in parts of its ranges: that of log r, that of sigma."""
    (a, b), (low, high) = config.ratios, config.drives
    r, sigma = np.asarray(at, float)
    return np.array([np.log(r / a) / np.log(b / a), (sigma - low) / (high - low)])


def distance(at, curves: list[dict], config: Config) -> float:
    """Of a point to the nearest curve."""
    point, best = scaled(np.asarray(at)[:, None], config), np.inf
    for curve in curves:
        line = scaled(curve["values"], config)
        way, to = np.diff(line, axis=1), point - line[:, :-1]
        length = np.maximum((way**2).sum(axis=0), 1e-300)
        part = np.clip((way * to).sum(axis=0) / length, 0, 1)
        best = min(best, float(np.sqrt(((to - part * way) ** 2).sum(axis=0)).min()))
    return best


# ---- the set


def attractors(at: dict, number: int, config: Config, random) -> tuple[list, Counter]:
    """Attracting orbits at a point, by trajectories from many starts, and what became of the others."""
    system = hidden().layered({z: 0.3}).with_parameters(at)
    starts = {"y": random.uniform(-2, 2, number), "v": random.uniform(-3, 3, number)}
    base, orbits, fates = Stroboscopic(system, DRIVE), [], Counter()
    for transient in (config.transient, 8 * config.transient):
        found = sweep(
            system, points=starts, x0={}, seen=Strobe(DRIVE), transient=transient, periods=12,
            work=Work(progress=False),
            measures=[Period(6, 1e-6), Points("y", "v", last=6)],
        )  # fmt: skip
        ends = np.stack([found["y_points"].values, found["v_points"].values], axis=-1)
        cycle = found["period"].values
        left = cycle <= 0
        for end, count in zip(ends[~left], cycle[~left].tolist()):
            known = [o for o in orbits if min(np.abs(p - end[-1]).max() for p in o[1]) < 1e-3]
            if known:
                fates[known[0][2]] += 1
                continue
            orbit = refine(replace(base, count=count), end[-count])
            if not orbit.success or np.abs(orbit.x - end[-count]).max() > 1e-2:
                fates["no orbit beside"] += 1
                continue
            fate = "rest" if not orbit.isolated else "orbit" if orbit.stable else "not attracting"
            fates[fate] += 1
            if fate != "rest":
                orbits.append((orbit, end[-count:], fate))
        if not left.any():
            break
        starts = {name: values[left] for name, values in starts.items()}
    fates["unsettled"] += int(left.sum())
    return [_symmetric(o) for o, _, fate in orbits if fate == "orbit"], fates


def _symmetric(orbit):
    """The orbit as one of the half-period map, if it is its own mirror image."""
    if orbit.map.count != 1:
        return orbit
    half = find_orbit(orbit.system, list(orbit.x), seen=Strobe(DRIVE, symmetry=MIRROR))
    orbit = half if half.success and np.abs(half.x - orbit.x).max() < 1e-6 else orbit
    # A section in a stick has several states of the layer to begin with; one in the longest slip has not.
    run = orbit.map.over(orbit.x, orbit.period)
    times = np.unique([run.t[0], *(e.time for e in run.events), run.t[-1]])
    middles = (times[1:] + times[:-1]) / 2
    slips = np.diff(times) * (run.status[0, np.searchsorted(run.t, middles) - 1] != 0)
    if orbit.x[1] != 0 or not slips.any():
        return orbit
    at = float(middles[np.argmax(slips)])
    turned = refine(orbit.map.at_phase(at / (2 * np.pi)), orbit.map.solved(orbit.x, at, orbit.system).x[:, -1])
    return turned if turned.success else orbit


def the_set(config: Config) -> dict:
    """Curves of the bifurcations that the attractors on the lines run into."""
    random, begun = np.random.default_rng(config.seed), time.perf_counter()
    curves: list[dict] = []
    lost: Counter = Counter()
    ranges = dict(zip(NAMES, (config.ratios, config.drives)))
    for ratio in config.lines:
        seen: list = []  # branches of this line
        for drive in config.begins:
            found, _ = attractors(dict(zip(NAMES, (ratio, drive))), config.starts, config, random)
            waiting = [(orbit, None) for orbit in found]
            while waiting and len(seen) < 60:
                orbit, kind = waiting.pop()
                if kind is None and any(_on(branch, orbit) for branch in seen):
                    continue
                for to in config.drives:
                    branch = follow(orbit, {"sigma": to}, steps=Steps(longest=0.05))
                    seen.append(branch)
                    for one in branch.specials:
                        new = _added(one, ratio, curves, ranges, lost, config)
                        if new and one.kind in ("flip", "symmetry breaking") and orbit.map.count < 4:
                            off = branch_off(one, 0.02)
                            waiting += [(off, one.kind)] if off.success else []
    return {"curves": curves, "lost": dict(lost), "seconds": round(time.perf_counter() - begun, 1)}


def _on(branch, orbit) -> bool:
    """Whether a branch has come by an orbit."""
    one = branch.points[0]
    if one.map.count != orbit.map.count or one.symmetric != orbit.symmetric:
        return False
    drive = float(orbit.system.parameters[next(p for p in orbit.system.parameters if p.name == "sigma")])
    passed = (branch.values[:-1] - drive) * (branch.values[1:] - drive) <= 0
    for k in np.flatnonzero(passed):
        span = branch.values[k + 1] - branch.values[k]
        part = (drive - branch.values[k]) / span if span else 0.0
        near = branch.x[:, k] + part * (branch.x[:, k + 1] - branch.x[:, k])
        size = np.abs(branch.x[:, k + 1] - branch.x[:, k]).max()
        if np.abs(near - orbit.x).max() < 0.3 * size + 1e-3:
            return True
    return False


def _added(one, ratio: float, curves: list[dict], ranges, lost: Counter, config: Config) -> bool:
    """Adds the curve of a bifurcation that lies on none so far; whether it did."""
    at = (ratio, one.parameter)
    same = [c for c in curves if c["kind"] == one.kind and c["called"] == _called(one.point)]
    if distance(at, same, config) < 5e-3 if same else False:
        return False
    if one.kind == "crossing-sliding" and ratio > critical_ratio(3):
        # The fold captures, and the layer's state says nothing: a line.
        line = [[critical_ratio(3), config.ratios[1]], [one.parameter] * 2]
        curves.append(
            {"kind": one.kind, "called": _called(one.point), "values": line, "ends": [], "points": []}
        )
        return False
    try:
        curve = follow(one, ranges, steps=Steps(longest=0.03))
    except ValueError as error:
        curve, said = None, str(error)
    if curve is None or len(curve.points) < 2:
        said = said if curve is None else curve.ends[0]
        lost[f"{one.kind}: {said[:100]}"] += 1
        return False
    curves.append({
        "kind": one.kind, "called": _called(one.point), "values": np.round(curve.values, 10), "ends": list(curve.ends),
        "points": [{"name": p.kind, "at": list(p.values.values())} for p in curve.specials],
    })  # fmt: skip
    return True


def _called(orbit) -> str:
    """What an orbit does in a period, in words."""
    word = Counter(kind for _, kind, _ in orbit.word)
    times = 2 if orbit.symmetric else 1
    sticks = word["stick"] * times
    what = {0: "slip only", 1: "one stick", 2: "two sticks"}.get(sticks, f"{sticks} sticks")
    how = (
        "symmetric"
        if orbit.symmetric
        else "asymmetric"
        if orbit.map.count == 1
        else f"period {orbit.map.count}"
    )
    return f"{what}, {how}"


# ---- the check


def borders(orbit, config: Config) -> list[tuple[str, tuple[float, float], str]]:
    """Where an orbit, followed over each parameter to both sides, is stable no more: the kind, the place, the words."""
    found = []
    values = {p.name: float(q) for p, q in orbit.system.parameters.items() if p.name in NAMES}
    for name, bounds in zip(NAMES, (config.ratios, config.drives)):
        for to in bounds:
            branch = follow(orbit, {name: to})
            stable = branch.stable
            last = int(np.argmin(stable)) if not stable.all() else len(stable)
            begin, end = branch.values[max(last - 1, 0)], branch.values[min(last, len(stable) - 1)]
            low, high = sorted((begin, end))
            width = abs(high - low) + 1e-9
            ends = [b for b in branch.specials if low - width <= b.parameter <= high + width]
            if last == len(stable):
                if branch.end.startswith("reached"):
                    continue
                ends = branch.specials[-1:]  # it ended, or turned, while it was stable
            kind = ends[-1].kind if ends else "end"
            at = ends[-1].parameter if ends else float(end)
            place = {**values, name: float(at)}
            if not bounds[0] <= at <= bounds[1]:
                continue  # a step beyond the border of the plane
            found.append((kind, (place["ratio_z"], place["sigma"]), branch.end))
    return found


def checked(curves: list[dict], config: Config) -> dict:
    """Random points of the plane, and whether the set admits the attractors there."""
    random, places, skipped = np.random.default_rng(config.seed + 1), [], 0
    (a, b), (low, high) = config.ratios, config.drives
    while len(places) < config.points:
        at = (float(a * (b / a) ** random.random()), float(low + (high - low) * random.random()))
        if distance(at, curves, config) < config.near:
            skipped += 1
        else:
            places.append(at)
    rows = parts({f"point {k}": (at_a_point, curves, at, k, config) for k, at in enumerate(places)})
    return {"points": rows, "skipped": skipped}


def at_a_point(curves: list[dict], at: tuple[float, float], number: int, config: Config) -> dict:
    """The attractors at a point, and where they end that is on no curve."""
    random = np.random.default_rng((config.seed, number))
    orbits, fates = attractors(dict(zip(NAMES, at)), config.tried, config, random)
    failures = []
    for orbit in orbits:
        for kind, place, words in borders(orbit, config):
            off = distance(place, curves, config)
            if off >= config.near:
                where = f"r = {place[0]:.6g}, sigma = {place[1]:.6g}, {off:.2g} from any curve"
                failures.append(f"{kind} of {_called(orbit)} at {where}: {words[:160]}")
    return {"at": at, "kinds": [_called(o) for o in orbits], "fates": dict(fates), "failures": failures}


def run(config: Config) -> dict:
    found = part("set", the_set, config)
    return found | {"check": checked(found["curves"], config)}


def claims(data: dict) -> list[Claim]:
    rows = data["check"]["points"]
    bad = [row for row in rows if row["failures"]]
    number = sum(len(row["kinds"]) for row in rows)
    meets = [p["at"] for c in data["curves"] for p in c["points"] if p["name"] == "capture + crossing-sliding"]
    off = max((abs(at[0] - critical_ratio(3)) for at in meets), default=np.nan)
    return [
        claim(
            "What attracts is bounded by curves of the set", "at every point",
            f"{len(rows) - len(bad)} of {len(rows)} points, {number} attracting orbits", not bad,
            "; ".join(text for row in bad for text in row["failures"])[:400],
        ),
        claim(
            "Captures end at the critical ratio of the layer", f"r* = {critical_ratio(3):.8f}",
            f"{len(meets)} ends, within {off:.1g}", len(meets) > 0 and off < 1e-7, "another ratio",
        ),
        claim(
            "Beside rest an orbit that sticks and one that passes attract at once",
            "between their captures",
            f"at {sum(len(set(row['kinds'])) > 1 for row in rows)} of {len(rows)} points",
            any(len(set(row["kinds"])) > 1 for row in rows),
            "nowhere",
        ),
    ]  # fmt: skip


def draw(data: dict):
    fig = new_figure(6.2, 5.2)
    ax = fig.subplots()
    curves = [(f"{c['kind']} ({c['called']})", c["values"]) for c in data["curves"]]
    draw_set(ax, curves, [p["at"] for c in data["curves"] for p in c["points"]], data["check"]["points"])
    ax.axvline(critical_ratio(3), color="#888888", linewidth=0.8, linestyle=":")
    ax.set(xscale="log", xlabel="ratio r = ε/β of the layer", ylabel="drive amplitude σ")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, fontsize=6.5)
    return fig


STUDY = Study(
    name="bifurcation_sets_layered",
    question="Which orbits does a block have over the ratio of its layer and the drive, and where do they change?",
    expected="lines of folds and of broken symmetry, which end on curves of captures; these end at the critical ratio",
    full=Config(),
    fast=Config(lines=(0.3,), begins=(2.6, 3.7), starts=4, points=3, tried=8),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
