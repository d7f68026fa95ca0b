"""S5: does the contact law matter once the restitution is right?

A slider-crank with a clearance joint runs for thousands of revolutions with eight contact laws that have one exact
restitution e at one speed of impact. Three have it at every speed and for every mass: F = g(delta) (1 + eta v/v0) with
the exact eta and three elastic parts g (all laws of that table are one law then). Kelvin and Voigt's and the linear
residual law have it at every speed, but for one mass only; of Hunt and Crossley's and of the two nonlinear residual
laws (reconstructions) it falls with the speed.

Hypotheses, written after pilot runs of 20 to 100 revolutions and before the full run:
(1) One e at one speed is enough: impacts, flights, time in contact and the largest Lyapunov exponent are the same for
    all eight within 10 %.
(2) One e at all speeds is enough: laws with the same e(v) differ by no more than their errors, whatever their elastic
    part is. Two laws with a linear elastic part and the e(v) of two others run beside them for that.
(3) If (2) fails, then because the load F_0 = m r omega^2 presses the joint together by delta_0, and a bounce slower
    than v_c ~ sqrt(2 F_0 delta_0/m) no longer leaves: a series of bounces from v on has log(v/v_c)/log(1/e) of them
    with a constant e, and about 3/(2 b v_c) with Hunt and Crossley's 1 - e = 2 b v/3. Laws with the same e(v) and the
    same delta_0 are the same. A third law beside them has Hertz's exponent and the delta_0 of the linear one.
(4) What the law leaves its mark on is the peak force: K^(2/5) v^(6/5) with Hertz's exponent, sqrt(K) v of linear laws.

Method: laws are tuned for each clearance by Newton's method on a drop test (free impact of the slider's mass at
0.1 m/s, a hard impact of the middle setting), with the derivative through its events. Stiffness: K = pi E* L/(2 sqrt(2
c)) of the joint in all of Hertz's exponent (Bai's has 3/2 of it); linear ones indent as deeply at that speed. Runs go
on from their last state every ten revolutions, from which blocks come. Times of contact and speeds are those of the
located events; peaks are looked for between the steps around the largest force of a contact. Lyapunov exponents by two
runs whose distance is brought back to 1e-6 of the clearance, and of its speed, twenty times a revolution. What carries
deviations through the events exactly (`variations`, `lyapunov_exponents`) agrees, see the findings, but takes seconds a
revolution: the stiffness sqrt(delta) of a contact has no series where it begins.

Statistics: impacts a revolution, and those faster than half of omega sqrt(r c); the sum of v^2 a revolution, over
omega^2 r c; the mean flight as a part of a revolution; the share of time in contact; the exponent a revolution.

Error bars: standard errors by scipy.stats.bootstrap over blocks.

What was reduced: clearances and speeds are three each; a thousand revolutions at each of these nine settings, ten
thousand at the middle one, three thousand of the laws beside the eight. Exponents are averages over 100 of them, peaks
are looked for in every fourth block.

Changed on the way: in the second of two runs what a residual law remembers is kept from falling below 0, as -7e-18 had
been refused as a start. Hypothesis 3 was found to hold but in part: the verdict says so.

Usage: python experiments/contact_laws.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import sys
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.ticker import NullLocator
from scipy.optimize import root_scalar
from scipy.stats import bootstrap
from studytools import Study, claim, command, part, parts

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from paper_figures.contact import COLOUR
from pwsmooth.analysis.maps import variations
from pwsmooth.laws.contact import (
    BaiImpact,
    HertzImpact,
    HuntCrossley,
    KelvinVoigt,
    LinearResidual,
    LiuImpact,
    ResidualHuntCrossley,
    ResidualIndentation,
    composite_modulus,
    contact_duration,
    exact_eta,
    maximal_indentation,
)
from pwsmooth.plotting import new_figure
from pwsmooth.scenes import free_impact, slider_crank

# The scene's: slider, rod, crank, rod's length and inertia, joint's length.
MASS, ROD_MASS = 1.013, 1.130  # kg
CRANK, ROD, LENGTH = 0.05, 0.30, 0.015  # m
LIGHT = (0.0153 + ROD_MASS * ROD**2 / 4) / ROD**2  # kg, what the rod resists an impact across the slide with
STEEL = composite_modulus(207e9, 0.3)
FLIGHT, CONTACT = 0, 1
STARTS = {"touch-down": CONTACT, "slow touch-down": CONTACT, "lift-off": FLIGHT}  # by the event
BINS = np.linspace(-5, 1, 49)  # of log10 of the speed (m/s)


@dataclass(frozen=True)
class Config:
    """Clearances (m), speeds of the crank (rpm), revolutions of a run."""

    e: float = 0.9
    others: tuple[float, ...] = (0.6,)  # restitutions in the middle, beside e
    speed: float = 0.1  # m/s, at which laws are tuned
    clearances: tuple[float, ...] = (5e-5, 5e-4, 1e-3)
    rpms: tuple[float, ...] = (60.0, 200.0, 1200.0)
    middle: tuple[float, float] = (5e-4, 200.0)
    revolutions: int = 1000
    many: int = 10_000  # in the middle
    beside: int = 3000  # of the laws beside the eight
    growing: int = 100  # for the exponent
    settling: int = 50
    block: int = 10
    looked_at: int = 4  # of so many blocks the peaks of one
    resamples: int = 300
    checked: float = 0.3  # revolutions over which growth is compared; 0: not


# ---- the laws


def stiffness(clearance):
    """K (N/m^1.5) of the joint: Liu's force for small indentations."""
    return float(math.pi * STEEL * LENGTH / 2 / math.sqrt(2 * clearance))


def drop(law, speed, mass=MASS, by=()):
    """(restitution, its derivatives) of a free impact."""
    depth = maximal_indentation(stiffness(5e-5), 1.5, mass, speed)
    scene = free_impact(law, speed=speed, m=mass, t_span=(0, 100 * depth / speed + 2e-3))
    run = scene.solve(rtol=1e-12, atol=[1e-16] * len(scene.system.states), by=list(by) or None)
    if not (run.success and run["force"][-1] == 0):
        raise RuntimeError(f"{type(law).__name__} at {speed:g} m/s: {run.message}")
    row = [str(s) for s in scene.system.states].index("v")
    return -run["v"][-1] / speed, [-run.derivatives.end[row, k] / speed for k in range(len(by))]


def tuned(law, name, e, speed):
    """The law with the value of its damping parameter at which the drop test gives e."""

    def off(value):
        found, (slope,) = drop(replace(law, **{name: float(value)}), speed, by=(name,))
        return found - e, slope

    root = root_scalar(off, x0=getattr(law, name), fprime=True, method="newton", rtol=1e-12)
    return replace(law, **{name: float(root.root)})


def load(rpm):
    """m r omega^2 (N)."""
    return MASS * CRANK * (2 * math.pi * rpm / 60) ** 2


def linear_stiffness(K, speed):
    """Of the spring (N/m) that an elastic impact at this speed indents as deeply as K delta^(3/2)."""
    return MASS * speed**2 / maximal_indentation(K, 1.5, MASS, speed) ** 2


def stiffer(linear, rpm):
    """K of Hertz's exponent that yields as much to the joint's load as the spring."""
    return linear**1.5 / math.sqrt(load(rpm))


def laws(clearance, e, speed, rpm):
    """The eight laws of the joint by name, and those beside them."""
    K, factor = stiffness(clearance), float(exact_eta(e))
    linear = linear_stiffness(K, speed)
    lasts = float(contact_duration(K, 1.5, MASS, speed))
    exact = dict(c_r=e, eta="zhang-sharf")
    residual = dict(gamma=10 / lasts, beta=lasts / 30)
    eight = {
        "Hertz": HertzImpact(K=K, **exact),
        "Liu": LiuImpact(E_star=STEEL, length=LENGTH, clearance=clearance, **exact),
        "Bai": BaiImpact(E_star=STEEL, length=LENGTH, clearance=clearance, **exact),
        "Hunt-Crossley": HuntCrossley(K=K, b=factor / speed, release="zero force"),
        "Kelvin-Voigt": tuned(KelvinVoigt(K=linear, b=lasts / 30, release="zero force"), "b", e, speed),
        "linear residual": tuned(LinearResidual(K=linear, **residual), "beta", e, speed),
        "R1": tuned(ResidualIndentation(K=K, **residual), "beta", e, speed),
        "R2": tuned(ResidualHuntCrossley(K=K, **residual), "beta", e, speed),
    }
    beside = {
        "Hertz, linear": HertzImpact(K=linear, n=1.0, **exact),
        "Hertz, stiffer": HertzImpact(K=stiffer(linear, rpm), **exact),
        "Hunt-Crossley, linear": HuntCrossley(K=linear, n=1.0, b=factor / speed, release="zero force"),
    }
    return eight, beside


def restitutions(config, e):
    """Of each law of the middle joint: e over the speed, and of the mass that the joint has across the slide."""
    eight, beside = laws(config.middle[0], e, config.speed, config.middle[1])
    speeds = config.speed * np.geomspace(0.01, 10, 13)
    return {
        name: {
            "speed": speeds, "e": [drop(law, v)[0] for v in speeds], "at": drop(law, config.speed)[0],
            "light": drop(law, config.speed, LIGHT)[0],
        }
        for name, law in (eight | beside).items()
    }  # fmt: skip


# ---- a run


def finished(run):
    """The run, or an error with what happened."""
    if not run.success:
        raise RuntimeError(run.message)
    return run


def pieces(scene, x, config, revolutions):
    """Solutions of blocks of revolutions, from the state behind those in which the motion settles."""
    ends = [0, *range(config.settling, config.settling + revolutions + 1, config.block)]
    for k, (begin, end) in enumerate(zip(ends, ends[1:])):
        dense = k > 0 and (k - 1) % config.looked_at == 0
        run = finished(scene.solve((begin * scene.period, end * scene.period), x, dense_output=dense))
        x = run.x[:, -1]
        yield run


class Contacts:
    """Beginnings and ends of contacts over the blocks of a run, each in the block in which it falls."""

    def __init__(self) -> None:
        self.phase, self.since = FLIGHT, 0.0
        self.impacts: list[
            np.ndarray
        ] = []  # (4, n) of a block: speed, peak, duration, speed at its end (nan: later)
        self.sums: list[
            tuple[float, float, float]
        ] = []  # of a block: time in contact, that of flights, how many

    def add(self, run, resting):
        """One block; `resting` is how long the contact of an impact of 1 m/s lasts at most."""
        begin, end = float(run.t[0]), float(run.t[-1])
        found = [(e.time, STARTS[e.switch]) for e in run.events if e.switch in STARTS]
        times, to = np.array(found).reshape(-1, 2).T
        changes = np.diff(to, prepend=self.phase) != 0
        times, to = times[changes], to[changes]
        on, off = times[to == CONTACT], times[to == FLIGHT]
        inside, left_at = 0.0, np.concatenate([[self.since], off])
        if self.phase == CONTACT:  # the first contact has begun before
            left_at, off = off, off[1:]
            inside = float(left_at[0] if len(left_at) else end) - begin
        flown = on - left_at[: len(on)]
        ends = np.concatenate([off, [end] * (len(on) - len(off))])
        inside += float((ends - on).sum())
        self.sums.append((inside, float(flown.sum()), len(flown)))
        radius = np.hypot(run["e_x"], run["e_y"])
        approach = (run["e_x"] * run["u_x"] + run["e_y"] * run["u_y"]) / np.where(radius > 0, radius, 1.0)
        speed = approach[np.searchsorted(run.t, on)]
        left = np.full(len(on), np.nan)
        left[: len(off)] = -approach[np.searchsorted(run.t, off)]
        left[ends - on > resting * np.maximum(speed, 1e-9) ** -0.2] = np.nan
        self.impacts.append(np.array([speed, peaks(run, on, ends), ends - on, left]))
        if len(times):
            self.phase = int(to[-1])
            self.since = float(times[-1])


def peaks(run, begins, ends):
    """Largest normal force of each contact, between the steps too; nan without dense output."""
    if run.dense is None or not len(begins):
        return np.full(len(begins), np.nan)
    force = run["normal"]
    first, last = np.searchsorted(run.t, begins), np.searchsorted(run.t, ends, side="right")
    marks = np.stack([first, np.minimum(last, len(run.t) - 1)], axis=1).ravel()
    top = np.array(
        [a + np.argmax(force[a:b]) for a, b in zip(marks[::2], np.maximum(marks[1::2], marks[::2] + 1))]
    )
    largest = force[top]
    low, high = np.maximum(run.t[np.maximum(top - 1, 0)], begins), run.t[np.minimum(top + 1, len(run.t) - 1)]
    high = np.minimum(high, ends)
    for _ in range(3):
        times = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, 9)
        values = run(times.ravel(), "normal").reshape(times.shape)
        at = np.argmax(values, axis=1)
        largest = np.maximum(largest, values.max(axis=1))
        rows = np.arange(len(at))
        low, high = times[rows, np.maximum(at - 1, 0)], times[rows, np.minimum(at + 1, 8)]
    return largest


def scales(scene, clearance):
    """Unit of a deviation of each state, 0 of a flag."""
    speed = 2 * math.pi / scene.period * math.sqrt(CRANK * clearance)
    of = {"e_x": clearance, "e_y": clearance, "u_x": speed, "u_y": speed, "speed": speed, "a": clearance}
    return np.array([of.get(str(s), 0.0) for s in scene.system.states])


def growth(scene, x, clearance, begin, revolutions, size=1e-6, cuts=20):
    """Logarithm of the growth of a small deviation in each of `cuts` parts of a revolution, and its last direction.

    A part at whose end only one of the two runs is in contact, or both are equal, is counted with the next one.
    """
    scale, flag = scales(scene, clearance), [str(s) for s in scene.system.states].index("touching")
    moves, x = scale > 0, np.array(x, float)
    remembered = [str(s) == "a" for s in scene.system.states]
    direction = np.where(np.arange(len(x)) < 4, 0.5, 0.0)
    y = x + size * scale * direction
    t, piece, logs = begin, scene.period / cuts, []
    for _ in range(round(revolutions * cuts)):
        x, y = (finished(scene.solve((t, t + piece), z)).x[:, -1] for z in (x, y))
        t += piece
        off = np.zeros(len(x))
        off[moves] = (y - x)[moves] / scale[moves] / size
        if x[flag] != y[flag] or not off.any():
            logs.append(0.0)
            continue
        logs.append(math.log(np.linalg.norm(off)))
        direction = off / np.linalg.norm(off)
        y = x + size * scale * direction
        y[remembered] = np.maximum(y[remembered], 0)  # what a residual law remembers decays to 0
    return np.array(logs), direction


def checked(config):
    """Growth over the first part of a revolution: by two runs, and by the fundamental matrix with its saltations."""
    clearance, rpm = config.middle
    law = laws(clearance, config.e, config.speed, rpm)[0]["Hertz"]
    scene = slider_crank(law, clearance=clearance, rpm=rpm)
    x = scene.system.initial_state(scene.x0, 0.0)
    logs, direction = growth(scene, x, clearance, 0.0, config.checked)
    run = finished(scene.solve((0.0, config.checked * scene.period), x, dense_output=True))
    scale = scales(scene, clearance)
    moves = scale > 0
    exact = np.zeros(len(x))
    exact[moves] = (variations(run).matrix[:, :4] @ (0.5 * scale[:4]))[moves] / scale[moves]
    size = float(np.linalg.norm(exact))
    impacts = len(run.event_times("reset", "touch-down"))
    angle = float(np.linalg.norm(exact / size - direction))
    return {"two runs": float(logs.sum()), "matrix": math.log(size), "angle": angle, "impacts": impacts}


def case(law, clearance, rpm, revolutions, config):
    """Statistics of one law in one joint: name -> (value, standard error)."""
    scene = slider_crank(law, clearance=clearance, rpm=rpm)
    K = stiffness(clearance)
    # Four times an elastic contact: what lasts longer is pressed together by the load.
    resting = 4 * float(contact_duration(K, 1.5, MASS, 1.0))
    found, state, failed = Contacts(), None, None
    try:
        for run in pieces(scene, scene.x0, config, revolutions):
            found.add(run, resting)
            state = run.x[:, -1]
    except RuntimeError as error:
        failed = str(error)
    blocks, sums = found.impacts[1:], np.array(found.sums[1:])
    result = {"failed": failed, "blocks": len(blocks)}
    if len(blocks) < 4:
        return result
    unit = 2 * math.pi * rpm / 60 * math.sqrt(CRANK * clearance)
    result |= statistics(blocks, sums, scene.period, unit, K, config)
    if failed is None:
        begin = (config.settling + len(blocks) * config.block) * scene.period
        logs, _ = growth(scene, state, clearance, begin, config.growing)
        parts = logs.reshape(config.growing // 5, -1).sum(axis=1) / 5
        spread = bootstrap(
            (parts,), np.mean, n_resamples=1000, method="percentile", rng=np.random.default_rng(1)
        )
        result["growth"] = (parts.mean(), spread.standard_error)
    return result


# Impacts a revolution, those faster than half the unit omega sqrt(r c), sum of squared speeds a revolution and two
# quantiles of the speed in that unit, mean flight, shares of time in contact and in contacts that the load keeps
# closed, restitution of the others, power of the speed and factor of K^0.4 m^0.6 v^1.2 of hard impacts' peaks.
NAMES = (
    "impacts", "hard", "loss", "fast", "median", "flight", "contact", "resting", "restitution", "slope", "peak",
)  # fmt: skip


def statistics(blocks, sums, period, unit, K, config):
    """What is asked of the impacts of all blocks; errors by resampling the blocks."""
    count = len(blocks)
    of = np.concatenate([np.full(b.shape[1], k) for k, b in enumerate(blocks)])
    speed, peak, lasted, left = np.concatenate(blocks, axis=1)
    order = np.argsort(speed)
    bounced = np.isfinite(left) & (speed > 0)
    fast = (speed >= 0.3 * np.quantile(speed, 0.95)) & (peak > 0) if len(speed) else np.zeros(0, bool)
    x, y = np.log(speed[fast]), np.log(peak[fast])

    def per_block(values, which=slice(None)):
        return np.bincount(of[which], values, minlength=count)

    rests = per_block(np.where(np.isfinite(left), 0.0, lasted))
    moments = np.array([per_block(v, fast) for v in (np.ones(len(x)), x, y, x * x, x * y)])
    reduced = np.log(peak[fast] / (K**0.4 * MASS**0.6 * speed[fast] ** 1.2))
    totals = np.array([
        per_block(np.ones(len(speed))), per_block(speed > unit / 2), per_block(speed**2), *sums[:, [1, 2, 0]].T, rests,
        per_block(left[bounced] ** 2, bounced), per_block(speed[bounced] ** 2, bounced), per_block(reduced, fast),
    ])  # fmt: skip

    def all_of(index):
        weight = np.bincount(index, minlength=count).astype(float)
        revolutions = weight.sum() * config.block
        n, hard, squares, flown, flights, touched, rested, after, before, log_peak = totals @ weight
        m, sx, sy, sxx, sxy = moments @ weight
        weights = np.cumsum(weight[of[order]])
        whole = weights[-1] if len(weights) else 0.0
        q = [speed[order[np.searchsorted(weights, p * whole)]] / unit if whole else np.nan for p in (0.95, 0.5)]
        with np.errstate(all="ignore"):
            return np.array([
                n / revolutions, hard / revolutions, squares / revolutions / unit**2, *q, flown / flights / period,
                touched / revolutions / period, rested / revolutions / period, np.sqrt(after / before),
                (m * sxy - sx * sy) / (m * sxx - sx * sx), np.exp(log_peak / m),
            ])  # fmt: skip

    def spread(of_blocks):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what has no value in any sample, or one without a peak
            drawn = bootstrap(
                (np.arange(count // of_blocks),),
                lambda i: all_of((i[:, None] * of_blocks + np.arange(of_blocks)).ravel()),
                vectorized=False, n_resamples=config.resamples, method="percentile", rng=np.random.default_rng(1),
            )  # fmt: skip
            return np.nanstd(drawn.bootstrap_distribution, axis=-1, ddof=1)

    value, error, pairs = all_of(np.arange(count)), spread(1), spread(2)
    place = np.digitize(np.log10(np.maximum(speed, 1e-12)), BINS) - 1
    shown = [k for k in range(len(BINS) - 1) if np.sum((place == k) & (peak > 0)) >= 10]
    return {
        **{name: (v, e) for name, v, e in zip(NAMES, value, error)},
        "error of pairs": [b / a if a > 0 else np.nan for a, b in zip(error[:3], pairs)],
        "number": len(speed),
        "by speed": [
            [10 ** (BINS[k] + 1 / 16), np.sum(place == k) / (count * config.block), np.nanmedian(peak[place == k])]
            for k in shown
        ],
    }  # fmt: skip


def run(config):
    """The cases, each a part that a killed run finds again."""
    data = {
        "laws": part("laws", restitutions, config, config.e),
        "check": part("check", checked, config) if config.checked else None,
    }
    middle = config.middle
    eight, beside = laws(middle[0], config.e, config.speed, middle[1])
    wanted = [(name, law, *middle, config.e, config.many) for name, law in eight.items()]
    wanted += [(name, law, *middle, config.e, config.beside) for name, law in beside.items()]
    for e in config.others:
        eight, _ = laws(middle[0], e, config.speed, middle[1])
        wanted += [(name, law, *middle, e, config.revolutions) for name, law in eight.items()]
    for clearance in config.clearances:
        for rpm in config.rpms:
            eight, _ = laws(clearance, config.e, config.speed, rpm)
            if (clearance, rpm) != middle:
                wanted += [
                    (name, law, clearance, rpm, config.e, config.revolutions) for name, law in eight.items()
                ]
    # Small clearances and slow cranks first: these take longest.
    wanted.sort(key=lambda one: (one[5] <= config.revolutions, one[3], one[2]))
    found = parts({
        f"{name} {clearance:g} {rpm:g} {e:g}": (case, law, clearance, rpm, revolutions, config)
        for name, law, clearance, rpm, e, revolutions in wanted
    })  # fmt: skip
    data["cases"] = [
        {"law": name, "clearance": clearance, "rpm": rpm, "e": e, **one}
        for (name, _, clearance, rpm, e, _), one in zip(wanted, found)
    ]
    return data


# ---- what it says

EIGHT = ("Hertz", "Liu", "Bai", "Hunt-Crossley", "Kelvin-Voigt", "linear residual", "R1", "R2")
SHOWN = {
    "impacts": "impacts", "hard": "fast impacts", "loss": "sum of v^2", "flight": "flight", "contact": "contact",
    "growth": "exponent",
}  # fmt: skip
# Pairs of one e at all speeds, whatever the mass is (R1 and R2: within 0.4 % of each other).
ALIKE = (
    ("Hertz", "Liu"),
    ("Hertz", "Bai"),
    ("Hertz", "Hertz, linear"),
    ("Hunt-Crossley", "Hunt-Crossley, linear"),
)
LINEAR = ("Kelvin-Voigt", "linear residual")


def setting(data, clearance, rpm, e):
    """The cases of a setting by law."""
    return {c["law"]: c for c in data["cases"] if (c["clearance"], c["rpm"], c["e"]) == (clearance, rpm, e)}


def middle_of(data):
    """The cases of the setting that has the laws beside the eight."""
    at = next(c for c in data["cases"] if c["law"] == "Hertz, linear")
    return setting(data, at["clearance"], at["rpm"], at["e"])


def settings(data):
    """(clearance, rpm) of all settings with the first restitution."""
    return sorted({(c["clearance"], c["rpm"]) for c in data["cases"] if c["e"] == data["cases"][0]["e"]})


def apart(one, other, names=tuple(SHOWN)):
    """(distance in standard errors, statistic, other over one) of the two cases' worst statistic."""
    found = []
    for name in names:
        (a, da), (b, db) = one[name], other[name]
        found.append((abs(a - b) / math.hypot(da, db), name, b / a))
    return max(found)


def told(case, name, digits=3):
    value, error = case[name]
    return f"{value:.{digits}g} +- {error:.1g}"


def claims(data):
    cases, e = middle_of(data), data["cases"][0]["e"]
    off = max(abs(law["at"] - e) for law in data["laws"].values())
    # From a third to three times the reference speed, four values a decade.
    ranges = {name: (min(law["e"][6:11]), max(law["e"][6:11])) for name, law in data["laws"].items()}
    result = [
        claim("the laws have one restitution at the reference speed: drop tests", f"{e:g} within 1e-8",
              f"off by {off:.0e} at most; from a third to three times that speed e is "
              + ", ".join(f"{a:.3f} to {b:.3f} ({name})" for name, (a, b) in ranges.items() if b - a > 1e-3)
              + ", of the others the same", off < 1e-8, "Newton's method has not come to an end", origin="derived"),
    ]  # fmt: skip
    if data["check"] is not None:
        both = data["check"]
        result.append(
            claim("deviations grow as the saltation matrices say", "within 1e-4",
                  f"over {both['impacts']} impacts by exp({both['two runs']:.5f}), two runs, and exp("
                  f"{both['matrix']:.5f}), the matrix; directions {both['angle']:.0e} apart",
                  abs(both["two runs"] - both["matrix"]) < 1e-4 and both["angle"] < 1e-4, "they do not",
                  origin="independent")
        )  # fmt: skip
    pairs = np.mean([cases[law]["error of pairs"] for law in EIGHT])
    result.append(
        claim("blocks of ten revolutions are independent: twice as long ones give the same errors", "ratio 1",
              f"mean ratio {pairs:.2f}", abs(pairs - 1) < 0.2, "errors are too small, by this factor")
    )  # fmt: skip
    spread = {}
    for name in SHOWN:
        values = {law: cases[law][name][0] for law in EIGHT}
        low, high = min(values, key=values.get), max(values, key=values.get)
        spread[name] = (values[high] / values[low], low, high)
    result.append(
        claim("hypothesis 1: with one e at one speed the eight laws do the same", "all within 10 %",
              "; ".join(f"{SHOWN[name]} {told(cases[low], name)} ({low}) to {told(cases[high], name)} ({high})"
                        for name, (_, low, high) in spread.items()),
              max(ratio for ratio, *_ in spread.values()) < 1.1,
              "the law of which e falls with the speed bounces on where others have come to rest")
    )  # fmt: skip
    same = [(apart(cases[a], cases[b]), a, b) for a, b in ALIKE]
    result.append(
        claim("hypothesis 2: laws with the same e at all speeds do the same", "within 3.5 standard errors",
              "; ".join(f"{a} and {b}: {SHOWN[name]} times {ratio:.3f}, {z:.1f} errors apart"
                        for (z, name, ratio), a, b in same),
              max(z for (z, *_), *_ in same) < 3.5, "the load keeps a contact closed the sooner the more it yields")
    )  # fmt: skip
    z, name, ratio = apart(cases["Hertz, linear"], cases["Hertz, stiffer"])
    result.append(
        claim("hypothesis 3: so do laws with the same e at all speeds and one deflection under the joint's load",
              "within 3.5 standard errors",
              f"Hertz, linear and Hertz, stiffer: {SHOWN[name]} times {ratio:.3f}, {z:.1f} errors apart; "
              + "; ".join(f"{SHOWN[n]} {told(cases['Hertz, linear'], n)} and {told(cases['Hertz, stiffer'], n)}"
                          for n in SHOWN),
              z < 3.5, "something else matters too")
    )  # fmt: skip
    at = cases["Hertz"]["clearance"]
    slow, fast = (
        setting(data, at, pick(rpm for c, rpm in settings(data) if c == at), e) for pick in (min, max)
    )
    above, below = (x["Hunt-Crossley"]["impacts"][0] / x["Hertz"]["impacts"][0] for x in (slow, fast))
    result.append(
        claim("away from the reference speed it is e(v) that parts the laws: slower impacts are livelier with Hunt and "
              "Crossley's law, faster ones duller", "more impacts than with Hertz's at a slow crank, fewer at a fast",
              f"{above:.2f} times at {slow['Hertz']['rpm']:g} rpm, {below:.2f} times at {fast['Hertz']['rpm']:g} rpm; "
              "restitution of the bounces there "
              + " and ".join(f"{told(x['Hunt-Crossley'], 'restitution')} (Hertz {told(x['Hertz'], 'restitution')})"
                             for x in (slow, fast)), above > 1 > below, "it is not so")
    )  # fmt: skip
    slopes = {law: cases[law]["slope"] for law in cases}
    straight = {law: 1.0 if law in LINEAR or law.endswith(", linear") else 1.2 for law in cases}
    result.append(
        claim("hypothesis 4: peaks rise as v^(6/5) with Hertz's exponent, as v with linear laws", "within 0.1",
              ", ".join(f"{told(cases[law], 'slope', 4)} ({law})" for law in cases),
              all(abs(slopes[law][0] - straight[law]) < 0.1 for law in cases), "other powers")
    )  # fmt: skip
    K = stiffness(cases["Hertz"]["clearance"])
    speed = data["laws"]["Hertz"]["speed"][8]  # the reference's place in `restitutions`
    K = {
        "Liu": 1.0,
        "Bai": 1.5,
        "Hertz, stiffer": stiffer(linear_stiffness(K, speed), cases["Hertz"]["rpm"]) / K,
    }
    ratios = {law: (cases[law]["peak"][0] / cases["Hertz"]["peak"][0], K[law] ** 0.4) for law in K}
    result.append(
        claim("and as K^(2/5)", "within 3 %",
              ", ".join(f"{found:.3f} of {expected:.3f} ({law}, {K[law]:.3g} K)"
                        for law, (found, expected) in ratios.items()),
              all(abs(found / expected - 1) < 0.03 for found, expected in ratios.values()), "another power")
    )  # fmt: skip
    calm = [c for c in data["cases"] if "growth" in c and c["growth"][0] < 2 * c["growth"][1]]
    known = sum("growth" in c for c in data["cases"])
    result.append(
        claim(
            "the motion is chaotic whatever the law: largest exponents are positive",
            "by two standard errors, all",
            f"{known - len(calm)} of {known}; a turn it is "
            + "; ".join(
                f"{told(c, 'growth')} ({c['law']}, {joint(c)}, e = {c['e']:g})" for c in calm or [cases["Hertz"]]
            ),
            not calm, "there the law settles on a motion that repeats itself, and others do not",
        )
    )  # fmt: skip
    failed = [c for c in data["cases"] if c["failed"]]
    result.append(
        claim(
            "every run comes to its end", "all", f"{len(data['cases']) - len(failed)} of {len(data['cases'])}",
            not failed, "; ".join(f"{c['law']} at {joint(c)}: {c['failed']}" for c in failed[:3]),
        )
    )  # fmt: skip
    return result


def verdict(data):
    cases = middle_of(data)
    by_name = {c.statement.split(":")[0]: c.holds for c in claims(data)}
    held = {name[-1]: holds for name, holds in by_name.items() if name.startswith("hypothesis")}
    often = cases["Hunt-Crossley"]["impacts"][0] / cases["Hertz"]["impacts"][0]
    pressed = [cases[law]["impacts"][0] for law in ("Hertz, linear", "Hertz, stiffer")]
    constant = [cases[law]["impacts"][0] for law in ("Hertz", "Liu", "Bai", "Hertz, linear", "Hertz, stiffer")]
    said = [
        "One e at one speed is enough."
        if held["1"]
        else "The law matters: one e at one speed is not enough. Hunt and Crossley's, whose e nears 1 at small speeds, "
        f"lets the joint bounce {often:.1f} times as often.",
        "One e at all speeds is."
        if held["2"]
        else "Nor quite is one e at all speeds: laws of one constant e, but of other stiffness or exponent, "
        f"are up to {max(constant) / min(constant):.2f} times apart in their impacts.",
        "Those that also yield alike to the joint's load do the same."
        if held["3"]
        else "Most of that is how far the joint's load presses it together: with the same deflection a linear law and "
        f"Hertz's are {max(pressed) / min(pressed):.2f} times apart.",
        "Peaks keep the law's exponent." if held["4"] else "Peaks do not keep the law's exponent.",
    ]
    if not by_name["the motion is chaotic whatever the law"]:
        said.append("In some settings it depends on the law whether the motion is chaotic at all.")
    return " ".join(said)


MARK = dict(zip(EIGHT, "osD^v<>P"))
BESIDE = {
    "Hertz, linear": ("Hertz", "1"), "Hertz, stiffer": ("Hertz", "2"), "Hunt-Crossley, linear": ("Hunt-Crossley", "1"),
}  # fmt: skip


def look(law):
    """Colour and mark of a law; the colour is that of the figures on contact."""
    base, mark = BESIDE.get(law, (law, MARK.get(law)))
    filled = "none" if law in ("Liu", "Hunt-Crossley", "linear residual", "R2") else "full"
    return dict(
        color=COLOUR[{"Liu": "Wang-Liu-Ma"}.get(base, base)], marker=mark, fillstyle=filled, markersize=3.5
    )


def joint(case):
    return f"{1e3 * case['clearance']:g} mm, {case['rpm']:g} rpm"


def finish(figure, ax):
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", fontsize=7, ncols=2)


def ticks(axis, values):
    axis.set_ticks(values, [f"{v:g}" for v in values])
    axis.set_minor_locator(NullLocator())


def draw(data):
    return {"": draw_middle(data), "settings": draw_settings(data)}


def draw_middle(data):
    """What the laws are, which impacts they lead to, and their statistics, in one joint."""
    figure = new_figure(3.5, 7.6)
    top, middle, bottom = figure.subplots(3, 1, height_ratios=(1, 1.2, 1.4))
    cases, speed = middle_of(data), data["laws"]["Hertz"]["speed"][8]
    for k, law in enumerate(EIGHT):
        e = data["laws"][law]
        line = dict(linewidth=1.0, **look(law))
        top.semilogx(e["speed"], e["e"], markevery=(k % 4, 4), **line)
        v, rate, _ = np.array(cases[law]["by speed"]).T
        middle.loglog(v, 8 * rate, markevery=(k % 3, 3), **line)
    for ax in (top, middle):
        ax.axvline(speed, color="0.7", linewidth=0.7, zorder=0)
    top.set(
        xlabel="speed of a free impact (m/s)",
        ylabel="restitution",
        ylim=(0.3, 1.02),
        title="Tuned at one speed",
    )
    middle.set(
        xlabel="speed of an impact (m/s)",
        ylabel="impacts a turn, a decade",
        title=f"Impacts at {joint(cases['Hertz'])}",
    )
    for k, law in enumerate((*EIGHT, *BESIDE)):
        for j, name in enumerate(SHOWN):
            value, error, scale = *cases[law][name], cases["Hertz"][name][0]
            bottom.errorbar(
                j + 0.075 * (k - 5), value / scale, 2 * error / scale, linestyle="none", elinewidth=0.8,
                label=law if j == 0 else None, **look(law),
            )  # fmt: skip
    bottom.axhline(1, color="0.7", linewidth=0.7, zorder=0)
    bottom.set(yscale="log", ylabel="over that of Hertz", title=f"{joint(cases['Hertz'])}, two standard errors")
    bottom.set_xticks(range(len(SHOWN)), [label.replace(" ", "\n", 1) for label in SHOWN.values()], fontsize=7)
    ticks(bottom.yaxis, [0.5, 1, 2, 5, 10])
    finish(figure, bottom)
    return figure


def draw_settings(data):
    """Over all settings in the order of the speed that a joint gives its impacts; and peak forces."""
    figure = new_figure(3.5, 7.6)
    axes = figure.subplots(3, 1)
    e = data["cases"][0]["e"]
    places = sorted(settings(data), key=lambda at: at[1] * math.sqrt(at[0]))
    for k, law in enumerate(EIGHT):
        for ax, name in zip(axes, ("impacts", "contact")):
            found = np.array([setting(data, *at, e)[law].get(name, (np.nan, np.nan)) for at in places], float)
            ax.errorbar(np.arange(len(places)) + 0.09 * (k - 3.5), found[:, 0], 2 * found[:, 1], linestyle="none",
                        elinewidth=0.8, label=law, **look(law))  # fmt: skip
    axes[0].set(yscale="log", ylabel="impacts a turn", title=f"e = {e:g} at one speed: impacts")
    axes[1].set(ylabel="share of time in contact", title="Time in contact")
    for ax in axes[:2]:
        ax.set_xticks(range(len(places)), [f"{1e3 * c:g}\n{rpm:g}" for c, rpm in places], fontsize=7)
    axes[0].text(0.98, 0.97, "no mark: none", transform=axes[0].transAxes, ha="right", va="top", fontsize=7)
    axes[1].set_xlabel("clearance (mm), crank (rpm),\nin the order of the speed of impacts")
    cases, bottom = middle_of(data), axes[2]
    for law in EIGHT:
        v, _, peak = np.array(cases[law]["by speed"]).T
        hard = v > 5e-3
        unit = (stiffness(cases["Hertz"]["clearance"]) ** 0.4 * MASS**0.6 * v**1.2)[hard]
        bottom.semilogx(v[hard], peak[hard] / unit, linewidth=0.8, **look(law))
    # F = K delta^(3/2) at the depth of an elastic impact.
    bottom.axhline(1.25**0.6, color="0.4", linewidth=0.9, linestyle="--")
    bottom.text(
        0.98,
        0.97,
        "dashed: elastic, slider's mass",
        transform=bottom.transAxes,
        ha="right",
        va="top",
        fontsize=7,
    )
    bottom.set(xlabel="speed of an impact (m/s)", ylabel=r"peak / $K^{2/5}m^{3/5}v^{6/5}$",
               title=f"Median peaks at {joint(cases['Hertz'])}")  # fmt: skip
    finish(figure, axes[0])
    return figure


STUDY = Study(
    name="contact_laws",
    question="S5: does the contact law matter once the restitution is right?",
    expected="One e at one speed is enough for impacts, flights, time in contact and the largest Lyapunov exponent; or "
    "one e at all speeds; or that and one deflection under the joint's load. Peaks keep the law's exponent.",
    full=Config(),
    fast=Config(
        others=(), clearances=(5e-4,), rpms=(200.0, 1200.0), revolutions=60, many=200, beside=100, growing=20,
        settling=10, checked=0.0,
    ),
    run=run,
    claims=claims,
    draw=draw,
    verdict=verdict,
)  # fmt: skip

if __name__ == "__main__":
    command(STUDY)
