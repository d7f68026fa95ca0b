"""E9: which orbits does a block on a shaken plate have, over drive and static friction, and where do they change?

    y' = v,   v' = -sigma sin(omega t) - k y - c v - N lam (1 + rho z),   k = 3.1, c = 0.1, N = 1

Bifurcation sets by one call each (`pwsmooth.diagram`), of the slaved limit, beta << eps (z = 1 - lam^2: static
friction answers at once), over (omega, sigma) at rho = 3 and over (rho, sigma) at omega = 1. The hidden term stays: it
is what folds the layer, and with it sticks end at a fold. And of the relaxing limit, eps << beta (0.1 z' = 1 - lam^2 -
z, z a state of the motion, none of the layer), over (omega, sigma) at rho = 3. Sticks are canards there: on the way
through them branches have multipliers up to 1e28 while the drive changes by 1e-8.

Check: at random points of each plane a sweep of many starts finds the attractors there by brute force. A set admits an
attractor if the orbit, followed over either parameter until it turns back, jumps or loses its stability, is so up to a
curve of the set or to the border of the plane. Points nearer than 1e-3 (of the ranges) to a curve are left out. A block
at rest is in a set of orbits: slaved, it needs |F| < N mu_s; these ends are counted apart, the last place of such a set
among them, and so are trajectories that do not settle. A symmetric orbit is followed by its half-period map, in which
what happens at both of its contacts happens once.

Expected: rest, two sticks (symmetric), slip only, and asymmetric orbits between; every border of what attracts is a
curve of the set; each within 10 minutes on two cores.

New, as these planes were not drawn before: the curve on which the symmetric orbit sticks less (crossing-sliding)
carries the others. From (omega, sigma) = (1.174944, 2.493826) on its symmetry breaks; folds leave it at omega =
0.909187, 1.906970 and 2.103362, and one has a cusp at (2.078333, 1.530048). At omega = 1 the curve of broken symmetry
begins at (rho, sigma) = (1.460385, 2.790978) and leads to more static friction. Where the layer could hold more and
more the map jumps: curves of captures, of orbits of one and of two periods, end at (0.860610, 4.130876), where what is
just held is let go at once and crossing-sliding is continuous. A block at rest begins to move where its stick parts, at
sigma = 1 for rho below 1/2. There, at (1/2, 1), begin the folds of the moving block and the curve on which its unstable
orbit ends, whose stick is only just let go (adding-sliding): both lead to rho = 5, and the latter over all frequencies.
At slow drives an asymmetric orbit ends where a slip comes to rest for a moment (grazing-sliding).

In the relaxing limit three times as many curves: where the symmetric orbit loses its symmetry between omega = 0.8 and
1.6 at sigma below 1.7, loops of flips and folds of orbits of one and of two periods lie within each other, with 13
cusps; the largest loop of flips has its 1:2 resonances at (0.86257, 1.62588) and (1.36019, 1.28115). Folds meet broken
symmetry at (1.673964, 1.303756) and (1.136164, 1.191961). Its orbits of four periods and more are not followed.

Usage: python experiments/bifurcation_sets.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import os
import sys
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command, draw_set, part, parts

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from friction_oscillator import hidden, omega, v, y, z

from pwsmooth import Strobe, diagram, follow, sweep
from pwsmooth.analysis.continuation import Steps
from pwsmooth.analysis.maps import Stroboscopic
from pwsmooth.analysis.orbits import refine
from pwsmooth.diagrams.line import Line
from pwsmooth.plotting import new_figure
from pwsmooth.studies import Period, Points, Work

DRIVE = 2 * sp.pi / omega
MIRROR = {y: -y, v: -v}
SETS = {  # name -> (view, parameters, ranges, lines)
    "slaved over (omega, sigma)": ("slaved", "omega sigma", ((0.4, 3), (0.5, 5)), "drive"),
    "slaved over (rho, sigma)": ("slaved", "rho sigma", ((0, 5), (0.5, 5)), "static"),
    "relaxing over (omega, sigma)": ("relaxing", "omega sigma", ((0.4, 3), (0.5, 5)), "drive"),
}


@dataclass(frozen=True)
class Config:
    """Which planes, the lines of each, starts, and the check."""

    planes: tuple[str, ...] = tuple(SETS)
    drive: tuple[tuple[float, ...], tuple[float, ...]] = (
        (0.5, 0.75, 1, 1.25, 1.5, 2, 2.5),
        (1.4, 2, 3, 4, 4.6),
    )
    static: tuple[tuple[float, ...], tuple[float, ...]] = (
        (0.25, 0.75, 1.2, 2, 3, 4.5),
        (1.5, 2, 2.7, 3.5, 4.3),
    )
    starts: tuple[tuple[float, float], ...] = ((0.5, 0.3), (-1, 1), (1.5, -0.5))
    values: int = 60
    longest: int = 2  # periods of the orbits whose branches are followed
    workers: int = 2
    points: int = 50
    tried: int = 100  # starts at each
    transient: int = 400
    near: float = 1e-3
    seed: int = 18
    beta: float = 0.1


def system_of(view: str, config: Config):
    """The block of a view, at rho = 3 and omega = 1."""
    return hidden(rho=3).layered({z: sp.oo}) if view == "slaved" else hidden(rho=3, beta=config.beta)


def start_of(view: str, pair) -> dict:
    return {y: pair[0], v: pair[1]} | ({} if view == "slaved" else {z: 0.0})


def the_set(name: str, config: Config, store=None):
    """The set of a plane, and the seconds that it took; with a store a run that was killed goes on."""
    view, parameters, ranges, lines = SETS[name]
    held = dict(zip(parameters.split(), getattr(config, lines)))
    begun, spent = time.perf_counter(), sum(os.times()[:4])
    found = diagram(
        system_of(view, config), dict(zip(parameters.split(), ranges)), [start_of(view, s) for s in config.starts],
        Strobe(DRIVE, symmetry=MIRROR),
        lines=held, values=config.values, max_count=config.longest,
        work=Work(workers=config.workers, store=store, progress=False),
        steps=Steps(longest=0.1, max_points=1000),
    )  # fmt: skip
    return found, {"wall": time.perf_counter() - begun, "processor": sum(os.times()[:4]) - spent}


# ---- the check


def attractors_at(view: str, at: dict, config: Config, random) -> tuple[list, dict[str, int]]:
    """Attracting orbits at a point of the plane, by trajectories from many starts, and what became of the others."""
    system = system_of(view, config).with_parameters(at)
    starts = {"y": random.uniform(-2, 2, config.tried), "v": random.uniform(-3, 3, config.tried)}
    more = {} if view == "slaved" else {"z": 0.0}
    points, cycle = [], []
    for transient in (config.transient, 10 * config.transient):
        found = sweep(
            system, points=starts, x0=more, seen=Strobe(DRIVE), transient=transient, periods=32,
            work=Work(progress=False),
            measures=[Period(16, 1e-6), Points(*map(str, system.states), last=16)],
        )  # fmt: skip
        points = np.stack([found[f"{s}_points"].values for s in system.states], axis=-1)
        cycle = found["period"].values
        if (cycle > 0).all():
            break
    orbits, fates = [], Counter()
    base = Stroboscopic(system, DRIVE)
    for end, count in zip(points, cycle.tolist()):
        if count <= 0:
            fates["unsettled"] += 1
            continue
        known = [o for o in orbits if min(np.abs(p - end[-1]).max() for p in o[1]) < 1e-4]
        if known:
            fates[known[0][2]] += 1
            continue
        # Of a symmetric one the half-period map has each event once.
        half = refine(replace(base, symmetry=MIRROR), end[-count])
        whole = refine(replace(base, count=count), end[-count])
        orbit = half if half.success and np.abs(half.x - end[-count]).max() < 1e-4 else whole
        if not orbit.success or np.abs(orbit.x - end[-count]).max() > 1e-3:
            fates["no orbit beside"] += 1
            continue
        # The last place of a rest is one where the block would just move: isolated to one side, and at rest.
        still = max(float(np.ptp(run.x[0])) for run in orbit.runs()) < 1e-9
        fate = "rest" if still or not orbit.isolated else "orbit" if orbit.stable else "not attracting"
        fates[fate] += 1
        if fate != "rest":  # those are a continuum
            orbits.append((orbit, end[-count:], fate))
    return [o for o, _, fate in orbits if fate == "orbit"], fates


SMOOTH = ("fold", "flip", "symmetry breaking", "branch point", "torus")


def borders(orbit, names, ranges) -> list[tuple[str, dict, str]]:
    """Where an orbit, followed over each parameter to both sides, is stable no more: the kind, the place, the words."""
    found = []
    values = {p.name: float(q) for p, q in orbit.system.parameters.items()}
    for name, (low, high) in zip(names, ranges):
        for to in (low, high):
            branch = follow(orbit, {name: to}, steps=Steps(max_points=2000), max_steps=1_000_000)
            back = np.flatnonzero(np.diff(branch.values) * (to - branch.values[0]) < 0)
            last = min([*np.flatnonzero(~branch.stable), *back[:1] + 1, len(branch.stable)])
            # The first place at which it turns back, jumps, or loses its stability, be it for less than a step.
            ends = [
                b for b, place in zip(branch.specials, branch.places)
                if place <= last and (
                    b.kind in SMOOTH or b.jumps or b.kind == "jump of the orbit"
                    or b.beyond is not None and not (b.beyond.stable and b.beyond.isolated)
                )
            ]  # fmt: skip
            if ends:
                kind, at = ends[0].kind, ends[0].parameter
            elif back.size and last == back[0] + 1:  # where it meets its mirror image, as a rule
                kind, at = "turn", branch.values[back[0]]
            elif last == len(branch.stable) and abs(branch.values[-1] - to) < 1e-9 * (1 + abs(to)):
                kind, at = "border", to
            else:
                kind, at = "end", branch.values[min(last, len(branch.stable) - 1)]
            found.append((kind, {**values, name: float(at)}, branch.end))
    return found


def distance(curves: list[dict], at: np.ndarray, name: str) -> float:
    """Of a point of the plane to the nearest curve, in parts of the ranges."""
    lines = (Line({"values": np.array(curve["values"])}, {}) for curve in curves)
    return min((line.distance(at, np.ptp(SETS[name][2], axis=1))[0] for line in lines), default=np.inf)


def checked(name: str, curves: list[dict], config: Config) -> dict:
    """Random points of a plane, and whether the set admits the attractors there."""
    random = np.random.default_rng(config.seed)
    low, high = np.array(SETS[name][2]).T
    places, skipped = [], 0
    while len(places) < config.points:
        at = low + (high - low) * random.random(2)
        if distance(curves, at, name) < config.near:
            skipped += 1
        else:
            places.append(at)
    rows = parts(
        {f"{name}, point {k}": (at_a_point, name, curves, at, k, config) for k, at in enumerate(places)},
        config.workers,
    )
    return {"points": rows, "skipped": skipped}


def at_a_point(name: str, curves: list[dict], at: np.ndarray, number: int, config: Config) -> dict:
    """The attractors at a point, and where they end that is on no curve."""
    view, parameters, ranges, _ = SETS[name]
    names, random = parameters.split(), np.random.default_rng((config.seed, number))
    low, high = np.array(ranges).T
    orbits, fates = attractors_at(view, dict(zip(names, at)), config, random)
    failures = []
    for orbit in orbits:
        for kind, place, words in borders(orbit, names, ranges):
            there = np.array([place[n] for n in names])
            # A parameter that is not negative cannot be followed to 0 itself.
            outside = (np.minimum(there - low, high - there) / (high - low)).min() < config.near
            if kind != "border" and not outside and (off := distance(curves, there, name)) >= config.near:
                where = ", ".join(f"{n} = {place[n]:.6g}" for n in names)
                failures.append(f"{kind} at {where}, {off:.2g} from any curve: {words[:160]}")
    return {"at": at, "attractors": len(orbits), "fates": dict(fates), "failures": failures}


def plane(name: str, config: Config) -> dict:
    """The set of a plane, as data."""
    found, seconds = the_set(name, config)
    curves = [
        {
            "kind": curve.kind, "values": np.round(curve.values, 9), "origin": curve.origin, "ends": curve.ends,
            "periods": int(curve.arrays["points"].shape[1]),
            "symmetric": bool(np.isnan(curve.arrays["mirrored"]).all()),
        }
        for curve in found.curves
    ]  # fmt: skip
    diagrams = [
        {"line": line, "branches": len(d.branches), "gaps": d.gaps, "unexplained": int((d.explained == -1).sum())}
        for line, d in zip(found.lines, found.diagrams)
    ]  # fmt: skip
    return {
        "curves": curves, "points": [{"name": p.kind, "at": list(p.values.values())} for p in found.specials],
        "diagrams": diagrams, "lost": found.lost,
        "seconds": {key: round(value, 1) for key, value in seconds.items()},
    }  # fmt: skip


def run(config: Config) -> dict:
    planes = {name: part(name, plane, name, config) for name in config.planes}
    return {name: one | {"check": checked(name, one["curves"], config)} for name, one in planes.items()}


def called(curve: dict) -> str:
    """The name of a curve."""
    kind = (
        "symmetric"
        if curve["symmetric"]
        else "asymmetric"
        if curve["periods"] == 1
        else f"period {curve['periods']}"
    )
    return f"{curve['kind']}, {kind}"


def claims(data: dict) -> list[Claim]:
    found = []
    for name, one in data.items():
        rows = one["check"]["points"]
        bad = [row for row in rows if row["failures"]]
        number = sum(row["attractors"] for row in rows)
        ours = f"{len(rows) - len(bad)} of {len(rows)} points, {number} attracting orbits"
        found.append(
            claim(
                f"{name}: what attracts is bounded by curves of the set", "at every point", ours, not bad,
                "; ".join(text for row in bad for text in row["failures"])[:400],
            )
        )  # fmt: skip
    wall, spent = (max(one["seconds"][key] for one in data.values()) for key in ("wall", "processor"))
    found.append(
        claim(
            "A set takes less than 10 minutes on two cores",
            "600 s",
            f"at most {wall:.0f} s, with {spent:.0f} s of processor time, on a machine that others used too",
            wall < 600,
            "slower, on a machine that others used too: compare the processor time",
        )
    )
    return found


def _drawn(name: str, one: dict, ax) -> None:
    curves = [(called(curve), curve["values"]) for curve in one["curves"]]
    draw_set(ax, curves, [p["at"] for p in one["points"]], one["check"]["points"])
    _, parameters, ranges, _ = SETS[name]
    greek = {"omega": "drive frequency ω", "sigma": "drive amplitude σ", "rho": "static friction ρ"}
    first, second = parameters.split()
    ax.set(
        xlim=ranges[0], ylim=ranges[1], xlabel=greek[first], ylabel=greek[second], title=name.split(" over")[0]
    )
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, fontsize=7)


def draw(data: dict):
    figures = {}
    for key, label in (("omega", ""), ("rho", "rho")):
        names = [name for name in data if f"({key}" in name]
        fig = new_figure(6.6, 5.2 * len(names))
        for name, ax in zip(names, fig.subplots(len(names), 1, squeeze=False)[:, 0]):
            _drawn(name, data[name], ax)
        figures[label] = fig
    return figures


STUDY = Study(
    name="bifurcation_sets",
    question="Which orbits does a block have, over its drive and its static friction, and where do they change?",
    expected="every border of what attracts is a curve of the set; at most 10 minutes a set on two cores",
    full=Config(),
    fast=Config(
        drive=((1, 2), (3,)), static=((1, 3), (3,)), starts=((0.5, 0.3),), values=12, workers=1, points=3, tried=10,
        transient=100, longest=1,
    ),
    run=run,
    claims=claims,
    draw=draw,
)  # fmt: skip

if __name__ == "__main__":
    command(STUDY)
