"""Friction in the plane: what does accuracy cost, and does a block at rest stay?

The forced planar oscillator z'' + z = 1.6 cos(t/4) + i sin(t/4) - lambda, two stops and two onsets up to t = 30: error
of the place at the end against 18 digits (an integration in polar variables by other means), over processor time.
Methods: events located exactly; Moreau's time stepping (half steps of the place, the projection of the free velocity on
the friction disc), compiled; the smoothed stand-in v/sqrt(v^2 + eps^2), compiled, by SciPy's LSODA and Radau, at every
eps with several tolerances; the same stand-in by the package's own path. Of each method the chart shows the runs that
no other of its runs beats. Compilation is not counted.

Then a block at rest on an incline with four fifths of the slope that friction holds: how far does it creep? MuJoCo's
soft contacts are a case of it where it is installed, with its defaults, with impratio = 100 and with its no-slip
iterations.

And what a period of stick and slip in the plane costs beside one on a line with as many events (a cubic spring, whose
field is as little linear): over drives z'' + z = a cos(W t) + i b sin(W t) - lambda, with slips that begin slowly and
that spiral into rest among them.

Expected: events reach 1e-11; Moreau's error is of first order in the step, smoothing's of order 4/5 in eps; what is
smoothed creeps, and what has a set-valued law does not. A period in the plane costs at most 8 of those on a line.

Usage: python experiments/planar_friction.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import numpy as np
import sympy as sp
from numba import njit
from scipy.integrate import solve_ivp
from studytools import Study, claim, command

from pwsmooth import Disc, Switch, System, solve
from pwsmooth.laws.friction import Coulomb
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.scenes import incline, planar_oscillator, t

EXACT = 1.0703152234846091 - 0.1501620315342416j  # z(30), 18 digits
START = (0.3, 0.1, 0.5, -0.4)
STYLE = {
    "event-driven": ("exact", "o"), "Moreau": ("time stepping", "s"), "smoothed, LSODA": ("SciPy", "^"),
    "smoothed, Radau": ("no events", "v"), "smoothed, own path": ("smoothed", "D"),
}  # fmt: skip


@dataclass(frozen=True)
class Config:
    """Tolerances, numbers of steps, widths, repeats of each timing; length of the rest, s."""

    rtols: tuple[float, ...] = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
    steps: tuple[int, ...] = (100, 300, 1000, 3000, 10000, 30000, 100000, 300000, 1000000, 3000000)
    widths: tuple[float, ...] = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
    tolerances: tuple[float, ...] = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
    repeats: int = 5
    rest: float = 100.0
    drives: tuple[tuple[float, float, float], ...] = (
        (1.6, 0.5, 0.25), (1.6, 0.2, 0.25), (1.6, 0.1, 0.25), (1.3, 0.2, 0.25), (1.2, 0.8, 0.5), (1.6, 0.3, 0.5),
        (1.4, 0.6, 0.25), (1.6, 0.8, 0.25), (1.3, 0.3, 0.5),
    )  # fmt: skip
    periods: int = 2000
    rounds: int = 9


FAST = Config(rtols=(1e-6, 1e-10), steps=(300, 3000, 30000), widths=(1e-2, 1e-3, 1e-4), tolerances=(1e-6,), repeats=1,
              rest=10.0, drives=((1.6, 0.5, 0.25), (1.3, 0.3, 0.5)), periods=50, rounds=3)  # fmt: skip


@njit(cache=False)
def moreau(n):
    """Place after n steps of Moreau's scheme over 30 units of time."""
    h = 30.0 / n
    x, y, u, v = 0.3, 0.1, 0.5, -0.4
    for k in range(n):
        half = (k + 0.5) * h
        x += 0.5 * h * u
        y += 0.5 * h * v
        u += h * (1.6 * math.cos(half / 4) - x)
        v += h * (math.sin(half / 4) - y)
        size = math.sqrt(u * u + v * v)
        left = max(0.0, size - h) / size if size > 0.0 else 0.0
        u *= left
        v *= left
        x += 0.5 * h * u
        y += 0.5 * h * v
    return x, y


@njit(cache=False)
def stand_in(time_, q, eps):
    """The smoothed field."""
    size = math.sqrt(q[2] ** 2 + q[3] ** 2 + eps**2)
    return np.array([q[2], q[3], 1.6 * math.cos(time_ / 4) - q[0] - q[2] / size,
                     math.sin(time_ / 4) - q[1] - q[3] / size])  # fmt: skip


@njit(cache=False)
def slopes(time_, q, eps):
    """Its Jacobian."""
    u, v = q[2], q[3]
    cube = (u**2 + v**2 + eps**2) ** 1.5
    return np.array([[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0],
                     [-1.0, 0.0, -(v**2 + eps**2) / cube, u * v / cube],
                     [0.0, -1.0, u * v / cube, -(u**2 + eps**2) / cube]])  # fmt: skip


def timed(function, repeats):
    """(result, least processor time in seconds) after a run that compiles."""
    function()
    least = math.inf
    for _ in range(repeats):
        begin = time.process_time()
        result = function()
        least = min(least, time.process_time() - begin)
    return result, least


def error(place):
    return abs(complex(*place) - EXACT)


def oscillator():
    force = (sp.Rational(8, 5) * sp.cos(t / 4), sp.sin(t / 4))
    return planar_oscillator(Coulomb(), force, start=START[:2], velocity=START[2:])


def costs(config):
    """Points of all methods: setting, error, seconds, steps."""
    points = []

    def add(method, setting, function, place, steps):
        result, seconds = timed(function, config.repeats)
        points.append({"method": method, "setting": setting, "error": error(place(result)), "seconds": seconds,
                       "steps": int(steps(result))})  # fmt: skip

    scene = oscillator()
    for rtol in config.rtols:
        add("event-driven", rtol, lambda rtol=rtol: scene.solve(rtol=rtol, atol=rtol / 100), lambda r: r.x[:2, -1],
            lambda r: len(r.t))  # fmt: skip
    for n in config.steps:
        add("Moreau", n, lambda n=n: moreau(n), lambda r: r, lambda r, n=n: n)
    for eps in config.widths:
        for rtol in config.tolerances:
            for name in ("LSODA", "Radau"):
                add(
                    f"smoothed, {name}", (eps, rtol),
                    lambda name=name, eps=eps, rtol=rtol: solve_ivp(
                        stand_in, (0, 30), START, name, rtol=rtol, atol=min(rtol, eps) / 100, args=(eps,), jac=slopes
                    ),
                    lambda r: r.y[:2, -1], lambda r: len(r.t),
                )  # fmt: skip
        smooth = scene.system.smoothed(eps)
        add("smoothed, own path", eps, lambda smooth=smooth: planar(smooth, scene), lambda r: r.x[:2, -1],
            lambda r: len(r.t))  # fmt: skip
    return points


def planar(system, scene):
    return solve(system, scene.t_span, scene.x0, rtol=1e-9, atol=1e-11)


def periods(config):
    """Microseconds, events and steps of a period of each drive and of the one on a line, and how many times as much an
    event costs, the median of all rounds."""
    a, b, W = sp.symbols("a b Omega", real=True)
    x, y, v, w = sp.symbols("x y v w", real=True)
    lam, s = Disc("lam", (v, w)), Switch("s", v)
    forces = {x: a * sp.cos(W * t), y: b * sp.sin(W * t)}
    plane = System({x: v, y: w, v: forces[x] - x - lam[0], w: forces[y] - y - lam[1]}, time=t,
                   parameters={a: 1.6, b: 0.5, W: 0.25})  # fmt: skip
    line = System({x: v, v: forces[x] - x - x**3 / 20 - 4 * s / 5}, time=t, parameters={a: 1.6, W: 0.25})
    runs = [("on a line", line, START[::2], {a: 1.6, W: 0.25})]
    runs += [(f"{A:g}, {B:g}, {w_:g}", plane, START, {a: A, b: B, W: w_}) for A, B, w_ in config.drives]

    def seconds(system, start, values, rtol):
        span = (0, 2 * math.pi / values[W] * config.periods)
        begin = time.process_time()
        found = solve(system, span, start, parameters=values, rtol=rtol, atol=rtol, dense_output=False)
        return time.process_time() - begin, found

    rows, n = [], config.periods
    for rtol in (1e-12, 1e-9):
        spent, beside = np.zeros((2, 1 + config.rounds, len(runs)))
        for r in range(1 + config.rounds):  # the first one compiles
            for k, (drive, *run) in enumerate(runs):
                # Each beside its own run on the line: the machine is not as fast all the time.
                beside[r, k], on_line = seconds(*runs[0][1:], rtol)
                spent[r, k], found = seconds(*run, rtol)
                if r == 0:
                    rows.append({"drive": drive, "rtol": rtol, "events": len(found.events) / n,
                                 "steps": len(found.t) / n, "to_rest": steps_to_rest(found),
                                 "as_many": len(on_line.events) / len(found.events)})  # fmt: skip
        shares = np.median(spent[1:] / beside[1:], axis=0)
        for row, least, share in zip(rows[-len(runs) :], spent[1:].min(axis=0), shares):
            row["us"], row["ratio"] = 1e6 * float(least) / n, float(share) * row.pop("as_many")
    return rows


def steps_to_rest(found):
    """The most steps that a slip takes from where it is fastest to rest."""
    speed = np.linalg.norm(found.x[len(found.x) // 2 :], axis=0)
    stops = np.searchsorted(found.t, [e.time for e in found.events if e.kind == "stick"])
    return max(int(end - begin - np.argmax(speed[begin:end])) for begin, end in zip([0, *stops], stops))


def cheapest(points, method):
    """The points that no other of the method beats in both, by falling error."""
    mine = sorted((p for p in points if p["method"] == method), key=lambda p: p["seconds"])
    front, least = [], math.inf
    for p in mine:
        if p["error"] < least:
            front.append(p)
            least = p["error"]
    return front


def creep(config):
    """Distance in m that a block at rest has crept, by method."""
    mu, slope = 0.5, math.atan(0.4)
    scene = incline(Coulomb(F_c=mu), slope=slope, velocity=(0, 0), t_span=(0, config.rest))
    rows = {"event-driven": float(scene.solve().x[0, -1])}
    steps = int(config.rest / 1e-3)
    v = x = 0.0
    for _ in range(steps):  # Moreau
        free = v + 1e-3 * 9.81 * math.sin(slope)
        v = math.copysign(max(0.0, abs(free) - 1e-3 * mu * 9.81 * math.cos(slope)), free)
        x += 1e-3 * v
    rows["Moreau, step 1 ms"] = x
    for eps in (1e-2, 1e-4):
        rows[f"smoothed, eps = {eps:g} m/s"] = float(
            solve(scene.system.smoothed(eps), scene.t_span, scene.x0).x[0, -1]
        )
    for name, option in (
        ("defaults", ""),
        ("impratio 100", 'impratio="100"'),
        ("no-slip", 'noslip_iterations="20"'),
    ):
        if (far := mujoco_rest(mu, slope, option, config.rest)) is not None:
            rows[f"MuJoCo, {name}"] = far
    return rows


def mujoco_rest(mu, slope, option, seconds):
    """Distance that MuJoCo's box creeps down the incline in `seconds` after one of settling; None without MuJoCo."""
    try:
        import mujoco
    except ImportError:
        return None
    g = 9.81
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><option timestep="0.001" cone="elliptic" gravity="{g * math.sin(slope)} 0 {-g * math.cos(slope)}" {option}/>
    <worldbody><geom type="plane" size="50 50 1" friction="{mu} 0 0"/>
    <body pos="0 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="1" friction="{mu} 0 0"/></body>
    </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    begin = float(data.qpos[0])
    for _ in range(int(1000 * seconds)):
        mujoco.mj_step(model, data)
    return float(data.qpos[0]) - begin


def run(config):
    try:
        peer = version("mujoco")
    except PackageNotFoundError:
        peer = None
    return {
        "points": costs(config),
        "creep": creep(config),
        "periods": periods(config),
        "rest": config.rest,
        "mujoco": peer,
    }


def order(points, method, settings, most):
    """Slope of log error over log setting, of the points with errors below `most`, and the pairs."""
    pairs = {}
    for p in points:
        if p["method"] == method and p["error"] < most:
            key = settings(p["setting"])
            pairs[key] = min(pairs.get(key, math.inf), p["error"])
    keys = sorted(pairs)
    return float(np.polyfit(np.log(keys), np.log([pairs[k] for k in keys]), 1)[0])


def claims(data):
    points = data["points"]
    best = {m: min(p["error"] for p in points if p["method"] == m) for m in STYLE}
    first = -order(points, "Moreau", lambda n: n, 0.1)
    smooth = order(points, "smoothed, own path", lambda eps: eps, 0.1)
    least = min(p["seconds"] for p in points if p["method"] == "event-driven" and p["error"] < 1e-6)
    rest = data["creep"]
    cost = {rtol: [r["ratio"] for r in data["periods"] if r["rtol"] == rtol][1:] for rtol in (1e-12, 1e-9)}
    steps = max(r["to_rest"] for r in data["periods"])
    creep_of = abs(rest["smoothed, eps = 0.01 m/s"]) / (0.01 * 0.8 / 0.6 * data["rest"])
    return [
        claim(
            "Located events reach 1e-11", "the tolerances that are asked for", f"{best['event-driven']:.1e}",
            best["event-driven"] < 1e-11, "the fast form stops at rtol = 1e-10",
        ),
        claim(
            "Moreau's time stepping is of first order", "an event within a step", f"order {first:.2f}",
            abs(first - 1) < 0.25, "the error changes its sign between steps of different phase",
            origin="derived",
        ),
        claim(
            "Smoothing is of order 4/5 in eps", "the onset where |lambda| reaches 1, algebraic sigmoid",
            f"order {smooth:.2f}", abs(smooth - 0.8) < 0.1, "eps is not small enough yet", origin="derived",
        ),
        claim(
            "An error of 1e-6 costs least by events", "the orders above",
            ", ".join(f"{m}: {ratio(points, m, least)}" for m in STYLE if m != "event-driven"),
            all(p["seconds"] > least for p in points if p["method"] != "event-driven" and p["error"] < 1e-6),
            "a compiled loop without overhead is quick where its error happens to cross zero",
        ),
        claim(
            "A period in the plane costs at most 8 of those on a line", "as many events, rtol = 1e-12; 1e-9",
            "; ".join(", ".join(f"{r:.1f}" for r in ratios) for ratios in cost.values()),
            max(map(max, cost.values())) <= 8, "a slip that spirals into rest or begins slowly takes more",
        ),
        claim(
            "A stop takes at most 25 steps", "from where the slip is fastest to rest", f"{steps} at most", steps <= 25,
            "a spiral has more turns",
        ),
        claim(
            "A block at rest stays by events and by Moreau's projection", "the law",
            f"{rest['event-driven']:g} m and {rest['Moreau, step 1 ms']:g} m in {data['rest']:g} s",
            rest["event-driven"] == 0 == rest["Moreau, step 1 ms"], "it moves", origin="derived",
        ),
        claim(
            "What is smoothed creeps at eps s/sqrt(1 - s^2)", "s = 4/5 of the friction", f"{creep_of:.4f} of it",
            abs(creep_of - 1) < 1e-2, "it does not", origin="derived",
        ),
    ]  # fmt: skip


def ratio(points, method, least):
    times = [p["seconds"] for p in points if p["method"] == method and p["error"] < 1e-6]
    return f"{min(times) / least:.1f} times" if times else "does not reach it"


def draw(data):
    figure = new_figure(7.4, 5.6)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1), height_ratios=(1.5, 1))
    left, right, below = (figure.add_subplot(part) for part in (grid[0, 0], grid[0, 1], grid[1, :]))
    drives = [r["drive"] for r in data["periods"] if r["rtol"] == 1e-12][1:]
    for k, (rtol, colour) in enumerate(((1e-12, "exact"), (1e-9, "time stepping"))):
        ratios = [r["ratio"] for r in data["periods"] if r["rtol"] == rtol][1:]
        places = np.arange(len(ratios)) + 0.36 * (k - 0.5)
        below.bar(places, ratios, 0.34, color=COLOUR[colour], label=f"rtol = {rtol:g}")
        for place, r in zip(places, ratios):
            below.text(place, r + 0.45, f"{r:.1f}", ha="center", fontsize=7,
                       bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6})  # fmt: skip
    below.axhline(8, color="0.4", linewidth=0.8, linestyle="--", zorder=0)
    below.set_xticks(range(len(drives)), [d.replace(", ", "\n") for d in drives], fontsize=7)
    below.set(xlabel="drive: a, b, W", ylabel="cost of a period\n(of one on a line)")
    below.legend(loc="upper left", fontsize=7)
    below.set_ylim(0, 1.35 * max(r["ratio"] for r in data["periods"]))
    for method, (colour, mark) in STYLE.items():
        front = cheapest(data["points"], method)
        left.loglog([1e3 * p["seconds"] for p in front], [p["error"] for p in front], mark + "-", color=COLOUR[colour],
                    markersize=4, linewidth=1, label=method)  # fmt: skip
    left.set(xlabel="processor time (ms)", ylabel="error of z(30)")
    left.legend(loc="lower right", fontsize=7)
    rows = {name: far for name, far in data["creep"].items()}
    names = list(rows)[::-1]
    lowest = 1e-7
    for k, name in enumerate(names):
        far = abs(rows[name])
        colour = (
            COLOUR["exact"] if far == 0 else COLOUR["no events"] if "MuJoCo" in name else COLOUR["smoothed"]
        )
        if far:
            right.barh(k, far, left=0, color=colour, height=0.6)
        right.text(
            max(1.4 * far, 0.5 * lowest), k, "0" if far == 0 else f"{far:.2g} m", va="center", fontsize=7
        )
    right.set_ylim(-0.6, len(names) - 0.4)
    right.set_yticks(range(len(names)), names, fontsize=7)
    right.set_xscale("log")
    right.set(xlim=(lowest / 3, 1e3), xlabel=f"creep of a block at rest in {data['rest']:g} s (m)")
    return figure


def verdict(data):
    front = cheapest(data["points"], "event-driven")
    return (
        f"Events reach {front[-1]['error']:.0e} in {1e3 * front[-1]['seconds']:.1f} ms; "
        + "; ".join(
            f"{m}: {min(p['error'] for p in data['points'] if p['method'] == m):.0e} at best"
            for m in list(STYLE)[1:]
        )
        + "."
    )


STUDY = Study(
    name="planar_friction",
    question="What does accuracy cost for friction in the plane, and does a block at rest stay?",
    expected="Events reach 1e-11; Moreau is of first order, smoothing of order 4/5 in eps; what is smoothed creeps.",
    full=Config(), fast=FAST, run=run, claims=claims, draw=draw, verdict=verdict,
)  # fmt: skip

if __name__ == "__main__":
    command(STUDY)
