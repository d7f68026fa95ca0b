"""S3: how do sticks appear and vanish when what decides is the layer, r = eps/beta?

    y' = v,   v' = -sigma sin(omega t) - k y - c v - lam (1 + rho z),   beta z' = 1 - lam^2 - z
    k = 3.1, c = 0.1, N = 1, rho = 3

Hypothesis: a capture bifurcation. An orbit exists as long as the layer decides as it needs: one that sticks while
the force at its arrival is below F_c(r), one that passes while it is above. Sticks so appear and vanish with a
finite length and no multiplier at 1; both kinds of orbit attract side by side between their captures, and a slow
sweep has hysteresis. As the slow motion does not know of r, the curves follow from F_c alone: F_c(r) = |F| at the
arrival, over the drive.

Method: orbits of the layered view with a finite r (the limit eps -> 0 at fixed r), and their curves of captures over
(r, sigma) at omega = 1 and over (r, omega) at sigma = 2.4 (pwsmooth.follow, kind "capture"): of the symmetric
orbit of two sticks, of the asymmetric one of one stick, of the one that only slips. Branches over r at sigma = 2.4
to their ends. Smoothed runs (pwsmooth.sweep, random starts) count which kind a start leads to: the first 200 run for 30
periods and show the attractors, the others are counted with the one to which they have come within 1e-4 after ten, or
run on. And sigma ramped by 1 in thousands of periods, up and down, shows where the kinds change, at several eps with
beta = eps/r.

Checks of their own: F_c(r) = |F| solved for r by brentq, with the arrival force of slow orbits in which nothing of
the layer is left to decide (slaved, two-stage, rho = 0). Exact ends are compared with what smoothed runs do, as eps
falls.

Error bars: of shares Wilson's 95 % intervals; of ramps the drive's change within three periods.

Changed after first runs: points from F_c alone are left out where the two-stage orbit has lost its own stick and is
another one.

Usage: python experiments/capture_bifurcation.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from scipy.optimize import brentq
from studytools import Claim, Study, claim, command, part, parts

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from friction_oscillator import beta, coulomb, hidden, lam, omega, sigma, t, v, y, z

from pwsmooth import Strobe, System, find_orbit, follow, solve, sweep
from pwsmooth.analysis.continuation import Steps
from pwsmooth.analysis.sticking import capture_threshold, critical_ratio
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.studies import Function, Work

PERIOD = 2 * sp.pi / omega
MIRROR = {y: -y, v: -v}
KINDS = ("two sticks", "one stick", "slip only")
# Starts that lead to each kind (spec, section 4), and the r and sigma at which they do.
STARTS = {
    "two sticks": ({y: 0.78, v: -1.03}, 0.3, 2.4),
    "one stick": ({y: 0.6, v: -1.07}, 0.01, 2.4),
    "slip only": ({y: 0.3, v: -1.9}, 0.3, 4.5),
}


@dataclass(frozen=True)
class Config:
    """Planes, starts of the basins, ramps."""

    ratios: tuple[float, float] = (5e-3, 1.0)
    drives: tuple[float, float] = (0.8, 5.0)
    frequencies: tuple[float, float] = (0.5, 2.0)
    planes: tuple[tuple[str, str], ...] = (
        ("two sticks", "sigma"), ("one stick", "sigma"), ("slip only", "sigma"), ("two sticks", "omega"),
        ("one stick", "omega"),
    )  # fmt: skip
    longest_step: float = 0.18
    basins: tuple[float, ...] = (0.001, 0.005, 0.015, 0.035, 0.06, 0.085, 0.15)  # r at sigma = 2.4
    basin_eps: float = 1e-5
    starts: int = 10_000
    scouts: int = 200  # of them
    settled: int = 30  # periods after which a start is at its attractor
    ramp_ratio: float = 0.05
    eps: tuple[float, ...] = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
    periods: int = 4000  # of a ramp


# ---- orbits and curves


def layered(ratio, **values):
    return hidden().layered({z: ratio}).with_parameters(values)


def orbit(kind):
    start, ratio, drive = STARTS[kind]
    symmetry = None if kind == "one stick" else MIRROR
    found = find_orbit(layered(ratio, sigma=drive), start, seen=Strobe(PERIOD, symmetry=symmetry), transient=60)
    # Where a saddle is in the layer of its crossings.
    return follow(found, {sigma: 3.8}).points[-1] if kind == "slip only" else found


def curve(kind, over, config):
    """The curve of captures of a kind over r and the drive's amplitude or frequency."""
    ranges = {"ratio_z": config.ratios, over: config.drives if over == "sigma" else config.frequencies}
    found = follow(orbit(kind), ranges, kind="capture", steps=Steps(first=0.05, longest=config.longest_step))
    orbits = [
        {"multiplier": float(max(abs(one.multipliers))), "stick": stuck(one)} for one in found.points
    ] if over == "sigma" else []  # fmt: skip
    return {"kind": kind, "over": over, "values": found.values, "orbits": orbits,
            "ends": [[p.kind, list(p.values.values())] for p in found.specials]}  # fmt: skip


def stuck(one):
    """Time stuck in a period."""
    run = one.solution()
    return float(sum(s.end - s.start for s in run.segments if s.status == (0,)))


def branches():
    """Over r at sigma = 2.4: the two sticks down to their capture, the one stick up to its own."""
    found = []
    for kind, to in (("two sticks", 0.005), ("one stick", 0.3)):
        branch = follow(orbit(kind), {"ratio_z": to})
        (end,) = branch.of_kind("capture")
        at = [k for k, r in enumerate(branch.values) if (r >= end.parameter) == (to < 0.1)]
        found.append({
            "kind": kind, "end": end.parameter, "bar": end.error if hasattr(end, "error") else None,
            "r": branch.values[at], "stick": [stuck(branch.points[k]) for k in at],
            "multiplier": [float(max(abs(branch.points[k].multipliers))) for k in at],
        })  # fmt: skip
    return found


def from_force(kind, over, value):
    """r (its logarithm) at which F_c is the arrival force of a slow orbit that does not ask the layer; or None."""
    begin = 4.5 if kind == "slip only" else 2.4
    values = {"sigma": begin, "omega": 1.0}
    if kind == "slip only":
        system = coulomb(**values)
    else:
        system = hidden(**values).layered({z: sp.oo if kind == "two sticks" else 0})
    symmetry = None if kind == "one stick" else MIRROR
    found = find_orbit(system, STARTS[kind][0], seen=Strobe(PERIOD, symmetry=symmetry), transient=60)
    branch = follow(found, {over: float(value)}) if value != values[over] else None
    if branch is not None:
        # In the two-stage view a stick is lost where its own arrival exceeds N: from there on it is another orbit.
        if not branch.end.startswith("reached") or any(
            one.kind.startswith("jump") for one in branch.specials
        ):
            return None
        found, values = branch.points[-1], {**values, over: float(value)}
    run = found.solution()
    what = "stick" if kind == "two sticks" else "crossing"
    event = next(e for e in run.events if e.kind == what)
    place = float(run(event.time, "y"))
    force = abs(values["sigma"] * math.sin(values["omega"] * event.time) + 3.1 * place)
    if not found.success or not 1 < force < 16 / 9:
        return None
    return brentq(lambda s: capture_threshold(3, math.exp(s)) - force, math.log(1e-4), math.log(critical_ratio(3)),
                  xtol=1e-13, rtol=1e-13)  # fmt: skip


# ---- smoothed runs


def ramped():
    """The smoothed oscillator whose drive's amplitude grows by `rate` in a unit of time."""
    start, rate = sp.Symbol("start", positive=True), sp.Symbol("rate", real=True)
    return System(
        {y: v, v: -(start + rate * t) * sp.sin(t) - sp.Rational(31, 10) * y - v / 10 - lam * (1 + 3 * z),
         z: (1 - lam**2 - z) / beta},
        time=t, parameters={start: 2.4, rate: 0.0, beta: 0.1},
    ).smoothed(1e-3)  # fmt: skip


RAMPED = ramped()
NEAR = 1e-4  # of an attractor: what is left of a deviation after a third of the periods
PIECE = 100  # periods of a ramp that are run at once


def kind_of(solution, window):
    """0, 1, 2 of KINDS, from the steps of the last period: those of a smoothed run crowd where v is small."""
    last = solution.t >= window.start
    times, places, slow = solution.t[last], solution["y"][last], np.abs(solution["v"][last])
    if abs(places.max() + places.min()) > 0.02:
        return 1.0
    still = np.maximum(slow[1:], slow[:-1]) <= 5 * solution.parameters["eps"]
    return 0.0 if np.diff(times)[still].sum() > 0.05 * (window.end - window.start) else 2.0


def seen(solution, window):
    """Kind and state at the end."""
    return {"kind": kind_of(solution, window), **{f"{s}_end": float(solution[s][-1]) for s in "yvz"}}


def after(system, starts, periods):
    """Kinds and states (n, 3) of many starts, by the last of so many periods."""
    found = sweep(
        system, points=dict(zip("yvz", starts.T)), seen=Strobe(2 * sp.pi), transient=periods - 1, periods=1,
        measures=Function(seen, names=("kind", "y_end", "v_end", "z_end")), rtol=1e-6,
        work=Work(workers=1, progress=False),
    )  # fmt: skip
    return found["kind"].values, np.column_stack([found[f"{name}_end"].values for name in "yvz"])


def basin(ratio, config):
    """How many starts lead to each kind.

    The first ones are run for all periods and show the attractors. The others are of the kind of the attractor near
    which they are after the first third of them; where there is none, they go on to the end.
    """
    random = np.random.default_rng(3)
    starts = np.zeros((config.starts, 3))
    starts[:, 0] = random.uniform(-2, 2, config.starts)
    starts[:, 1] = random.uniform(-3, 3, config.starts)
    width = config.basin_eps
    system = RAMPED.with_parameters({"eps": width, "beta": width / ratio, "start": 2.4, "rate": 0.0})
    first, early = config.scouts, config.settled // 3
    known, ends = after(system, starts[:first], config.settled)
    kinds, states = after(system, starts[first:], early)
    distance = np.abs(states[:, None, :2] - ends[None, :, :2]).max(axis=2)
    nearest = np.argmin(np.where(np.isnan(distance), np.inf, distance), axis=1)
    there = distance[np.arange(len(states)), nearest] < NEAR
    kinds = np.where(there, known[nearest], kinds)
    late = np.flatnonzero(~there & np.isfinite(states).all(axis=1))
    if late.size:
        kinds[late], _ = after(system, states[late], config.settled - early)
    kinds = np.append(known, kinds)
    return {
        "r": ratio,
        "counts": [int((kinds == k).sum()) for k in range(3)],
        "failed": int(np.isnan(kinds).sum()),
        "late": int(late.size),
    }


def ramp(eps, up, config):
    """(sigma at which the kind changes for good, or None) on the way up from two sticks, or down from one."""
    n = config.periods
    low, high = 2.0, 3.0
    values = {"eps": eps, "beta": eps / config.ramp_ratio, "start": low if up else high, "rate": 0.0}
    start = {"y": 0.78, "v": -1.03, "z": 0.0} if up else {"y": 0.6, "v": -1.07, "z": 0.0}
    settled = solve(RAMPED, (0, 80 * math.pi), start, parameters=values, rtol=1e-8)
    values["rate"] = (1 if up else -1) * (high - low) / (2 * math.pi * n)
    times = (2 * math.pi * np.arange(PIECE)[:, None] + np.linspace(0, 2 * math.pi, 41)[:-1]).ravel()
    state, places = settled.x[:, -1], []
    for k in range(0, n, PIECE):
        # From t = 0 again: at t = 25 000 the spacing of numbers is too coarse for the layer of eps = 1e-6.
        now = values | {"start": values["start"] + values["rate"] * 2 * math.pi * k}
        times_and_end = np.append(times, 2 * math.pi * PIECE)
        run = solve(
            RAMPED, (0, times_and_end[-1]), list(state), parameters=now, t_eval=times_and_end, rtol=1e-7
        )
        if not run.success:
            raise RuntimeError(f"The ramp at eps = {eps:g} did not finish: {run.message}")
        state = run.x[:, -1]
        places.append(run["y"][:-1].reshape(PIECE, -1))
    places = np.concatenate(places)
    lopsided = np.abs(places.max(axis=1) + places.min(axis=1)) > 0.05
    changed = np.flatnonzero(lopsided == up)
    began = bool(lopsided[0] == (not up))
    at = None if not began or not changed.size else values["start"] + values["rate"] * 2 * math.pi * changed[0]
    return {"eps": eps, "up": up, "began": began, "sigma": at, "bar": 3 * (high - low) / n}


def run(config):
    groups = {
        "curves": {f"curve {kind} {over}": (curve, kind, over, config) for kind, over in config.planes},
        "basins": {f"basin {r:g}": (basin, r, config) for r in config.basins},
        "branches": {"branches": (branches,)},
        "ramps": {f"ramp {e:g} {up}": (ramp, e, up, config) for e in config.eps for up in (True, False)},
    }
    found = iter(parts({name: job for group in groups.values() for name, job in group.items()}))
    data = {name: [next(found) for _ in group] for name, group in groups.items()}
    data["branches"] = data["branches"][0]
    points = []
    for one in data["curves"]:
        r, values = one["values"]
        points += [
            (one["kind"], one["over"], values[k], r[k]) for k in np.linspace(1, len(r) - 2, 5).astype(int)
        ]
    exact = parts(
        {f"force {kind} {over} {r}": (from_force, kind, over, value) for kind, over, value, r in points}
    )
    data["forces"] = [
        {"kind": kind, "over": over, "value": value, "curve": r, "force": None if e is None else math.exp(e)}
        for (kind, over, value, r), e in zip(points, exact)
    ]
    data["ramp_ratio"] = config.ramp_ratio
    data["ends"] = {k: part(f"end {k}", ramp_end, k, config.ramp_ratio) for k in KINDS[:2]}
    data["slips_to"] = math.exp(part("slips to", from_force, "slip only", "sigma", 2.4))
    return data


def ramp_end(kind, ratio):
    """sigma at which the arrival force is F_c(ratio)."""
    low, high = (2.05, 2.4) if kind == "one stick" else (2.4, 2.8)
    return brentq(lambda s: from_force(kind, "sigma", s) - math.log(ratio), low, high, xtol=1e-8)


def wilson(count, number):
    """95 % interval of a share."""
    share, q = count / number, 1.959963984540054
    middle, half = (
        share + q * q / (2 * number),
        q * math.sqrt(share * (1 - share) / number + q * q / (4 * number**2)),
    )
    return (middle - half) / (1 + q * q / number), (middle + half) / (1 + q * q / number)


def claims(data) -> list[Claim]:
    checked = [f for f in data["forces"] if f["force"] is not None]
    off = max(abs(f["force"] / f["curve"] - 1) for f in checked)
    ends = {b["kind"]: b["end"] for b in data["branches"]}
    at_end = {b["kind"]: (b["multiplier"], b["stick"], b["r"]) for b in data["branches"]}
    near = {}
    for kind, (multiplier, stick, r) in at_end.items():
        k = int(np.argmin(np.abs(np.array(r) - ends[kind])))
        near[kind] = (multiplier[k], stick[k])
    lengths = {
        c["kind"]: (c["orbits"][int(np.argmin(c["values"][0]))]["stick"],
                    c["orbits"][int(np.argmax(c["values"][0]))]["stick"])
        for c in data["curves"] if c["orbits"] and c["kind"] != "slip only"
    }  # fmt: skip
    critical = critical_ratio(3)
    meets = [e[1][0] for c in data["curves"] for e in c["ends"] if e[0] == "capture + crossing-sliding"]
    expected = {
        b["r"]: {k for k, low, high in (
            (0, ends["two sticks"], math.inf), (1, 0, ends["one stick"]), (2, 0, data["slips_to"])
        ) if low < b["r"] < high} for b in data["basins"]
    }  # fmt: skip
    wrong = [b["r"] for b in data["basins"] if {k for k, n in enumerate(b["counts"]) if n} != expected[b["r"]]]
    failed = sum(b["failed"] for b in data["basins"])
    told = []
    for b in data["basins"]:
        n = sum(b["counts"])
        parts = [
            f"{KINDS[k]} {100 * c / n:.1f} % ({100 * wilson(c, n)[0]:.1f} to {100 * wilson(c, n)[1]:.1f})"
            for k, c in enumerate(b["counts"]) if c
        ]  # fmt: skip
        told.append(f"r = {b['r']:g}: {', '.join(parts)}")
    result = [
        claim(
            "the curves of captures follow from F_c and the slow orbits alone", "r within 1e-6",
            f"{len(checked)} of {len(data['forces'])} points of {len(data['curves'])} curves, off by {off:.1e} of r; "
            "of the others the slow orbit was not reached",
            off < 1e-6 and len(checked) > 0.6 * len(data["forces"]), "they differ, or too few were compared",
            origin="independent",
        ),
        claim(
            "at sigma = 2.4: two sticks from r = 0.0237 on, one stick up to 0.0902 (independent values)",
            "0.0237 and 0.0902", f"{ends['two sticks']:.6f} and {ends['one stick']:.6f}",
            abs(ends["two sticks"] - 0.0237) < 5e-5 and abs(ends["one stick"] - 0.0902) < 5e-5, "elsewhere",
            origin="independent",
        ),
        claim(
            "sticks vanish with a finite length and no multiplier at 1", "multipliers bounded away from 1",
            "at sigma = 2.4 "
            + "; ".join(f"{k}: length {s:.4f}, largest multiplier {m:.3f}" for k, (m, s) in near.items())
            + f"; along the curve of two sticks the length falls from {lengths['two sticks'][0]:.3f} to "
            f"{lengths['two sticks'][1]:.3f} at r*",
            all(m < 0.9 and s > 0.1 for m, s in near.values()),
            "a multiplier comes to 1, or the stick shrinks to nothing",
        ),
        claim(
            "the curves end at the ratio from which the fold captures", f"r* = {critical:.6f}",
            f"{len(meets)} ends, within {max(abs(m - critical) for m in meets):.1e}",
            len(meets) > 0 and max(abs(m - critical) for m in meets) < 1e-6, "elsewhere",
            origin="independent",
        ),
        claim(
            "smoothed runs reach the kinds that the curves admit, and no other", "at every r",
            "; ".join(told) + (f"; {failed} runs failed" if failed else ""), not wrong and not failed,
            f"not at r = {wrong}" if wrong else "runs failed",
        ),
    ]  # fmt: skip
    gaps = {
        up: [(r["eps"], r["sigma"]) for r in data["ramps"] if r["up"] == up and r["sigma"]]
        for up in (True, False)
    }
    for up, kind in ((True, "two sticks"), (False, "one stick")):
        end, seen = data["ends"][kind], gaps[up]
        distance = [abs(s - end) for _, s in seen]
        order = (
            math.log(distance[-2] / distance[-1]) / math.log(seen[-2][0] / seen[-1][0])
            if len(seen) > 1
            else math.nan
        )
        bar = data["ramps"][0]["bar"]
        lost = [f"{r['eps']:g}" for r in data["ramps"] if r["up"] == up and not r["sigma"]]
        result.append(
            claim(
                f"a slow sweep {'up' if up else 'down'} at r = {data['ramp_ratio']:g} leaves {kind} at the capture "
                "as eps -> 0",
                f"sigma = {end:.5f}",
                "; ".join(f"eps = {e:g}: {s:.4f}" for e, s in seen) + f" (+- {bar:.4f})"
                + (f"; at eps = {', '.join(lost)} no change from it" if lost else "") + f"; distance ~ eps^{order:.2f}",
                len(seen) > 1 and bool((np.diff(distance) < bar).all()) and distance[-1] < max(0.01, 3 * bar),
                "it does not tend there",
            )
        )  # fmt: skip
    return result


def verdict(data) -> str:
    good = [c.holds for c in claims(data)]
    ends = {b["kind"]: b["end"] for b in data["branches"]}
    return (
        f"The hypothesis {'held' if all(good[:4]) else 'did not hold'}: sticks are lost at F = F_c(r) with a finite "
        f"length, at sigma = 2.4 for r between {ends['two sticks']:.5f} and {ends['one stick']:.5f} both kinds "
        f"attract, and a slow sweep {'shows' if good[5] and good[6] else 'does not show'} the hysteresis, with ends "
        "that smoothed runs reach as eps falls."
    )


LOOK = {"two sticks": "stick", "one stick": "right", "slip only": "left"}
DASH = {"two sticks": "-", "one stick": "--", "slip only": ":"}


def draw(data):
    return {"": draw_curves(data), "runs": draw_runs(data)}


def draw_curves(data):
    """Curves of captures over both parameters of the drive, and branches to their ends."""
    figure = new_figure(3.5, 8.2)
    first, second, third = figure.subplots(3, 1)
    for ax, over in ((first, "sigma"), (second, "omega")):
        for c in data["curves"]:
            if c["over"] == over:
                r, values = np.array(c["values"])
                ax.semilogx(r, values, DASH[c["kind"]], color=COLOUR[LOOK[c["kind"]]], label=c["kind"])
        at = [f for f in data["forces"] if f["over"] == over and f["force"]]
        ax.plot([f["force"] for f in at], [f["value"] for f in at], "o", color=COLOUR["mark"], markersize=3.5,
                fillstyle="none", label="from $F_c$ alone")  # fmt: skip
        ax.axvline(critical_ratio(3), color=COLOUR["mark"], linewidth=0.6, linestyle=":")
    first.axvline(data["ramp_ratio"], color="#BBBBBB", linewidth=0.8, zorder=0)
    first.axhline(2.4, color="#BBBBBB", linewidth=0.8, zorder=0)
    first.set(xlabel="$r = \\varepsilon/\\beta$", ylabel="drive $\\sigma$", title="Captures, $\\omega$ = 1")
    first.legend(fontsize=7, loc="upper left")
    second.set(
        xlabel="$r = \\varepsilon/\\beta$", ylabel="frequency $\\omega$", title="Captures, $\\sigma$ = 2.4"
    )
    second.legend(fontsize=7, loc="upper left")
    for b in data["branches"]:
        colour = COLOUR[LOOK[b["kind"]]]
        width = 1.2 if b["kind"] == "two sticks" else 2.4
        third.semilogx(b["r"], b["stick"], "-", color=colour, linewidth=width, label=f"{b['kind']}: time stuck")
        third.semilogx(b["r"], b["multiplier"], "--", color=colour, linewidth=width, label="largest multiplier")
        third.axvline(b["end"], color=colour, linewidth=0.7, linestyle=":")
    third.axhline(1, color=COLOUR["mark"], linewidth=0.7)
    third.set(xlabel="$r$", title="To their ends, $\\sigma$ = 2.4", ylim=(0, 1.8))
    third.legend(fontsize=7, loc="upper left")
    return figure


def draw_runs(data):
    """Basins of smoothed runs, and where slow sweeps change."""
    figure = new_figure(3.5, 8.2)
    fourth, fifth, sixth = figure.subplots(3, 1)
    r = np.array([b["r"] for b in data["basins"]])
    for k, kind in enumerate(KINDS):
        counts = np.array([b["counts"][k] for b in data["basins"]])
        number = np.array([sum(b["counts"]) for b in data["basins"]])
        bounds = np.array([wilson(c, n) for c, n in zip(counts, number)]).T
        share = counts / number
        fourth.errorbar(r, share, [np.maximum(share - bounds[0], 0), np.maximum(bounds[1] - share, 0)],
                        fmt="-" + "os^"[k], color=COLOUR[LOOK[kind]], markersize=3.5, linewidth=0.9,
                        label=kind)  # fmt: skip
    for b in data["branches"]:
        fourth.axvline(b["end"], color=COLOUR[LOOK[b["kind"]]], linewidth=0.7, linestyle=":")
    fourth.set(xscale="log", xlabel="$r$", ylabel="share of starts", title="Basins, smoothed, $\\sigma$ = 2.4")
    fourth.legend(fontsize=7, loc="center left")
    shades = dict(
        zip(
            sorted({r["eps"] for r in data["ramps"]}, reverse=True),
            tuple("left approximation stick right exact".split()),
        )
    )
    for ramp_ in data["ramps"]:
        if ramp_["sigma"]:
            fifth.errorbar(ramp_["sigma"], ramp_["eps"], xerr=ramp_["bar"], fmt="^" if ramp_["up"] else "v",
                           color=COLOUR[shades[ramp_["eps"]]], markersize=5, fillstyle="none")  # fmt: skip
    for up, kind in ((True, "two sticks"), (False, "one stick")):
        end = data["ends"][kind]
        fifth.axvline(
            end, color=COLOUR[LOOK[kind]], linestyle=DASH[kind], linewidth=1, label=f"capture of {kind}"
        )
        at = [(x["eps"], abs(x["sigma"] - end)) for x in data["ramps"] if x["up"] == up and x["sigma"]]
        sixth.loglog(*np.array(at).T, "^-" if up else "v-", color=COLOUR[LOOK[kind]], markersize=5, fillstyle="none",
                     label=f"sweep {'up' if up else 'down'}")  # fmt: skip
    fifth.set(yscale="log", xlabel="drive $\\sigma$ at the change", ylabel="$\\varepsilon$",
              title=f"Slow sweeps, $r$ = {data['ramp_ratio']:g}")  # fmt: skip
    fifth.plot([], [], "^", color=COLOUR["mark"], fillstyle="none", label="up")
    fifth.plot([], [], "v", color=COLOUR["mark"], fillstyle="none", label="down")
    fifth.legend(fontsize=7, loc="center")
    sixth.axhline(data["ramps"][0]["bar"], color=COLOUR["mark"], linewidth=0.7, linestyle=":")
    sixth.set(xlabel="$\\varepsilon$", ylabel="distance from the capture", title="Smoothed runs tend there")
    sixth.legend(fontsize=7)
    return figure


STUDY = Study(
    name="capture_bifurcation",
    question="S3: how do sticks appear and vanish when what decides is the layer, r = eps/beta?",
    expected="Where the force at an arrival crosses F_c(r): with finite length, no multiplier at 1, and hysteresis.",
    full=Config(),
    fast=Config(
        planes=(("two sticks", "sigma"), ("one stick", "sigma")), longest_step=0.6, basins=(0.005, 0.06),
        starts=60, scouts=20,
        eps=(1e-5, 1e-6), periods=800,
    ),
    run=run,
    claims=claims,
    draw=draw,
    verdict=verdict,
)  # fmt: skip

if __name__ == "__main__":
    command(STUDY)
