"""What does a gradient of a piecewise-smooth motion cost, at which error, by which method?

Three motions, one number at the end of each, by all its parameters and its start:

    crossing   y'' = -sigma sin t - k y - c y' - N sign(y'), sigma = 4: eleven crossings
    sticking   the same with sigma = 1.2: ten sticks
    ball       dropped from h = 50 on a floor, e = 0.8: one impact

The reference is the closed form piece by piece in 60 digits (events by Newton's method, derivatives by differences of
1e-20): it shares nothing with any entrant. Errors are the largest of the components, in units of the largest of the
gradient. Time is processor time, the least of interleaved rounds, compilation apart; of methods with several knobs
(tolerance, step of the differences, eps, bound of the integrator's step) the best combinations are drawn.

    pwsmooth, forward / backward    `by=`, `costs.Objective`
    differences of pwsmooth, SciPy  central ones of event-driven runs; SciPy's DOP853 is stopped at each event
    differences, smoothed           central ones of `system.smoothed(eps)`, algebraic and tanh
    smoothed, its derivatives       `by=` of the same views
    heyoka, saltation by hand       variational equations of each smooth piece; it has no jumps of its own: NumPy adds
                                    them at its events
    diffrax, events                 Dopri8, reverse through its events; the number of pieces is told
    diffrax, bare sign              reverse through the right-hand side with its sign, equal and adaptive steps (Tsit5)

Expected: exact derivatives are as good as the solve and cost a few of it; differences lose digits; a sign that is
stepped over has a derivative of 0, so that what the surfaces add is missed however small the steps are.

Usage: python experiments/gradients.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import functools
import itertools
import math
import time
from dataclasses import dataclass

import gradient_peers as peers
import mpmath as mp
import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command

from pwsmooth import System, Unilateral, solve
from pwsmooth.costs import Objective, final
from pwsmooth.plotting import COLOUR, new_figure

t, y, v = sp.symbols("t y v", real=True)
k, c, N, sigma, g, e = sp.symbols("k c N sigma g e", positive=True)

TITLES = {
    "crossing": "dry friction, 11 crossings: 6 derivatives",
    "sticking": "dry friction, 10 sticks: 6 derivatives",
    "ball": "ball, an impact: 3 derivatives",
}
#: Method -> colour, line, mark.
LOOKS = {
    "pwsmooth, forward": (COLOUR["exact"], "-", "o"),
    "pwsmooth, backward": (COLOUR["exact"], "--", "s"),
    "differences of pwsmooth": (COLOUR["stick"], "-", "v"),
    "heyoka, saltation by hand": (COLOUR["heyoka"], "-", "D"),
    "diffrax, events": (COLOUR["diffrax"], "-", "^"),
    "differences of SciPy": (COLOUR["SciPy"], "-", ">"),
    "differences, smoothed": (COLOUR["smoothed"], "-", "<"),
    "smoothed, its derivatives": (COLOUR["smoothed"], "--", "p"),
    "diffrax, bare sign, equal steps": (COLOUR["no events"], ":", "x"),
    "diffrax, bare sign, adaptive": (COLOUR["approximation"], ":", "+"),
}
FLOOR = 1e-16  # an error of nothing is drawn here
OWN = ("pwsmooth, forward", "pwsmooth, backward")
BARE = tuple(name for name in LOOKS if "bare" in name)


@dataclass(frozen=True)
class Config:
    """Tolerances and steps of every method; rounds of timing."""

    tolerances: tuple[float, ...] = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)
    coarse: tuple[float, ...] = (1e-5, 1e-9, 1e-13)  # where a second knob is swept too
    shares: tuple[float, ...] = (1e-2, 1e-3, 1e-4, 1e-5)  # steps of differences, of each value
    longest: tuple[float, ...] = (0.3, 1.0)  # s, bound of a peer's steps
    eps: tuple[float, ...] = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
    steps: tuple[int, ...] = (100, 300, 1000, 3000, 10000)
    rounds: int = 5


# ---- scenes


def oscillator(drive: float):
    """(System, Motion)"""
    parameters, start = {k: 3.1, c: 0.1, N: 1.0, sigma: drive}, {y: 0.5, v: 0.3}
    pull = -sigma * sp.sin(t) - k * y
    system = System({y: v, v: pull - c * v - N * sp.sign(v)}, time=t, parameters=parameters)
    return system, peers.Motion(
        t, parameters, start, 10 * math.pi, {y: v, v: pull - c * v - N * peers.SIDE}, v, (k, c, N, sigma, y, v), y,
        stick={y: sp.S.Zero, v: sp.S.Zero}, lam=pull / N,
    )  # fmt: skip


def ball():
    """(System, Motion)"""
    parameters, start = {g: 9.8, e: 0.8}, {y: 50.0, v: 0.0}
    floor = Unilateral(y, restitution=e, name="R")
    system = System({y: v, v: -g + floor.reaction}, time=t, parameters=parameters)
    return system, peers.Motion(t, parameters, start, 5.0, {y: v, v: -g}, y, (y, g, e), y, reset={v: -e * v})


SCENES = {
    "crossing": functools.partial(oscillator, 4.0),
    "sticking": functools.partial(oscillator, 1.2),
    "ball": ball,
}


# ---- reference


def dropped(h, g_, e_):
    """Height at t = 5 after one impact."""
    fall = mp.sqrt(2 * h / g_)
    return e_ * g_ * fall * (5 - fall) - g_ * (5 - fall) ** 2 / 2


def piecewise(times, kinds, q):
    """y at the end of the oscillator, from its closed form on every piece; `times` are refined by Newton's method."""
    k_, c_, n_, drive, y0, v0 = q
    side, t0, stuck = 1, mp.mpf(0), False
    gap = (k_ - 1) ** 2 + c_**2
    a, w = c_ / 2, mp.sqrt(k_ - c_**2 / 4)
    sine, cosine = -drive * (k_ - 1) / gap, drive * c_ / gap

    def slip(at):
        """(y, v) at a time of the slip that began at t0 in (y0, v0)."""
        first = y0 - (sine * mp.sin(t0) + cosine * mp.cos(t0) - side * n_ / k_)
        speed = v0 - (sine * mp.cos(t0) - cosine * mp.sin(t0))
        second = (speed + a * first) / w
        s, decay = at - t0, mp.exp(-a * (at - t0))
        shape = first * mp.cos(w * s) + second * mp.sin(w * s)
        slope = w * (second * mp.cos(w * s) - first * mp.sin(w * s)) - a * shape
        return (decay * shape + sine * mp.sin(at) + cosine * mp.cos(at) - side * n_ / k_,
                decay * slope + sine * mp.cos(at) - cosine * mp.sin(at))  # fmt: skip

    for guess, kind in zip(times, kinds):
        if stuck:
            level = -mp.sign(mp.mpf(drive * mp.sin(guess) + k_ * y0)) * n_
            t0 = mp.findroot(lambda at, held=k_ * y0 + level: -drive * mp.sin(at) - held, guess)
            side, stuck = int(mp.sign(level)), False
        else:
            t_event = mp.findroot(lambda at: slip(at)[1], guess)
            y0, v0, t0 = slip(t_event)[0], mp.mpf(0), t_event
            stuck, side = kind == "stick", -side
    return y0 if stuck else slip(10 * mp.pi)[0]


def reference(name: str, values: np.ndarray) -> tuple[np.ndarray, int]:
    """The gradient, and the number of events."""
    if name == "ball":
        function, count = dropped, 1
    else:
        from reference.coulomb_oscillator import KIND_NAMES, solve_closed_form

        k0, c0, n0, s0, y0, v0 = values
        times, codes, _ = solve_closed_form(k0, s0, c0, n0, y0=y0, v0=v0, t_end=10 * math.pi)
        kinds = [KIND_NAMES[code] for code in codes]
        count = len(times)

        def function(*q):
            return piecewise(times.tolist(), kinds, q)

    with mp.workdps(60):
        at, step = [mp.mpf(float(x)) for x in values], mp.mpf(10) ** -20

        def moved(i, by):
            return function(*[x + by * (i == j) for j, x in enumerate(at)])

        slopes = [(moved(i, step) - moved(i, -step)) / (2 * step) for i in range(len(at))]
        return np.array([float(s) for s in slopes]), count


# ---- entrants


def entrants(config: Config, name: str, count: int):
    """(method, setting, gradient of the values) of one scene."""
    system, motion = SCENES[name]()
    names, q = [s.name for s in motion.names], motion.values
    span = (0.0, motion.end)

    def tight(rtol):
        return {"rtol": rtol, "atol": 1e-2 * rtol}

    def by_name(of, **options):
        """q -> number at the end of a run of a system."""
        states, parameters = ({s.name for s in group} for group in (motion.start, motion.parameters))
        fixed = {s.name: value for s, value in motion.start.items()}

        def run(at):
            given = dict(zip(names, at.tolist()))
            return solve(
                of, span, fixed | {s: given[s] for s in states & given.keys()},
                parameters={p: given[p] for p in parameters & given.keys()}, **options,
            ).x[0, -1]  # fmt: skip

        return run

    for rtol in config.tolerances:
        yield (
            OWN[0],
            rtol,
            lambda r=rtol: solve(system, span, motion.start, by=names, **tight(r)).derivatives.end[0],
        )
        objective = Objective(system, final(y), span, motion.start, names, **tight(rtol))
        yield OWN[1], rtol, lambda o=objective: o(o.start).gradient
        heyoka = peers.Variational(motion, max(1e-2 * rtol, 1e-16))
        yield "heyoka, saltation by hand", rtol, lambda h=heyoka: h(q)[1]
    through = peers.events(motion, count, "reverse")
    for rtol, longest in itertools.product(config.tolerances, config.longest):
        yield (
            "diffrax, events",
            (rtol, longest),
            lambda r=rtol, m=longest: np.array(through(q, r, 1e-2 * r, m)[1]),
        )
    for rtol, share in itertools.product(config.coarse, config.shares):
        run = by_name(system, **tight(rtol))
        yield "differences of pwsmooth", (rtol, share), lambda f=run, s=share: peers.differences(f, q, s)
        for longest in config.longest:
            run = peers.stopped(system, motion, max_step=longest, **tight(max(rtol, 3e-14)))
            yield (
                "differences of SciPy",
                (rtol, share, longest),
                lambda f=run, s=share: peers.differences(f, q, s),
            )
    if motion.reset:
        return  # an impact has no smoothed form, and no sign to step over
    for eps, sigmoid in itertools.product(config.eps, ("algebraic", "tanh")):
        view = system.smoothed(eps, sigmoid)
        yield (
            "smoothed, its derivatives",
            (eps, sigmoid, 1e-6),
            lambda f=view: solve(f, span, motion.start, by=names, **tight(1e-6)).derivatives.end[0],
        )
        for rtol, share in itertools.product(config.coarse[:2], config.shares[::2]):
            run = by_name(view, **tight(rtol))
            yield (
                "differences, smoothed",
                (eps, sigmoid, rtol, share),
                lambda f=run, s=share: peers.differences(f, q, s),
            )
    for steps in config.steps:
        equal = peers.bare(motion, "reverse", steps)
        yield BARE[0], steps, lambda f=equal: bare_gradient(f(q, 0.0, 0.0))
    adaptive = peers.bare(motion, "reverse")
    for rtol in config.tolerances[:3]:
        yield BARE[1], rtol, lambda f=adaptive, r=rtol: bare_gradient(f(q, r, 1e-2 * r))


def bare_gradient(found):
    """None where the steps did not suffice: they grind on a surface that attracts from both sides."""
    value, gradient = found
    return np.array(gradient) if np.isfinite(value) else None


def seconds(task) -> float:
    """Processor time of a call; a short one is repeated: its first call after another method's pays for cold caches."""
    begun = time.process_time()
    task()
    once = time.process_time() - begun
    if once > 5e-3:
        return once
    repeats = 1 + int(5e-3 / max(once, 5e-5))
    begun = time.process_time()
    for _ in range(repeats):
        task()
    return (time.process_time() - begun) / repeats


def measured(config: Config, name: str) -> dict:
    _, motion = SCENES[name]()
    exact, count = reference(name, motion.values)
    rows, size = [], np.abs(exact).max()
    for method, setting, task in entrants(config, name, count):
        gradient = task()
        error = np.inf if gradient is None else np.abs(gradient - exact).max() / size
        rows.append({"method": method, "setting": setting, "error": error, "times": [], "task": task})
    for _ in range(config.rounds):
        for row in rows:
            # A slow one is seen to be slow once.
            if not row["times"] or row["times"][0] < 1.0:
                row["times"].append(seconds(row["task"]))
    return {
        "names": [s.name for s in motion.names],
        "reference": exact,
        "events": count,
        "points": [
            {"method": row["method"], "setting": row["setting"], "error": row["error"],
             "seconds": min(row["times"])}
            for row in rows
        ],
    }  # fmt: skip


def run(config: Config) -> dict:
    return {name: measured(config, name) for name in SCENES}


# ---- what is said and drawn


def line(scene: dict, method: str) -> list[dict]:
    """The points of a method that none of its own beats in both error and time; all of a bare sign's."""
    points = [p for p in scene["points"] if p["method"] == method and p["error"] is not None]
    if method in BARE:
        return points
    front: list[dict] = []
    for p in sorted(points, key=lambda p: (p["seconds"], p["error"])):
        if not front or p["error"] < front[-1]["error"]:
            front.append(p)
    return front


def least_error(scene, method):
    return min((p["error"] for p in line(scene, method)), default=math.inf)


def least_time(scene, method, error):
    return min((p["seconds"] for p in line(scene, method) if p["error"] <= error), default=math.inf)


def per_scene(data, made):
    return ", ".join(f"{name} {made(scene)}" for name, scene in data.items())


def claims(data: dict) -> list[Claim]:
    made = []
    for method in OWN:
        worst = max(least_error(scene, method) for scene in data.values())
        made.append(
            claim(f"{method}: the error of the gradient", "below 1e-12 on every scene",
                  per_scene(data, lambda s, m=method: f"{least_error(s, m):.1e}"), worst < 1e-12, "larger")
        )  # fmt: skip
    rivals = [name for name in LOOKS if name not in OWN]
    for error in (1e-4, 1e-8):
        told, least = [], math.inf
        for name, scene in data.items():
            own = min(least_time(scene, method, error) for method in OWN)
            best = min(rivals, key=lambda rival: least_time(scene, rival, error))
            ratio = least_time(scene, best, error) / own
            least = min(least, ratio)
            told.append(f"{name} {ratio:.2g} ({best})" if math.isfinite(ratio) else f"{name} none")
        made.append(
            claim(f"Time of the best other way to a gradient within {error:g}, in units of pwsmooth's derivatives",
                  "more than 1", ", ".join(told), least > 1, "another way is faster")
        )  # fmt: skip
    lost = [
        least_error(s, "differences of pwsmooth") / min(least_error(s, m) for m in OWN) for s in data.values()
    ]
    made.append(
        claim("Differences of the same runs: their least error", "at least 100 times that of the derivatives",
              per_scene(data, lambda s: f"{least_error(s, 'differences of pwsmooth'):.1e}"), min(lost) > 100, "closer")
    )  # fmt: skip
    signs = {name: scene for name, scene in data.items() if name != "ball"}
    bare = min(least_error(s, method) for s in signs.values() for method in BARE)
    made.append(
        claim("Reverse through a bare sign: its least error, at any step", "above 1 %",
              per_scene(signs, lambda s: f"{min(least_error(s, m) for m in BARE):.2g}"), bare > 0.01, "smaller")
    )  # fmt: skip
    views = ("differences, smoothed", "smoothed, its derivatives")
    smooth = min(least_error(s, method) for s in signs.values() for method in views)
    made.append(
        claim("The smoothed stand-in, by differences or its own derivatives: least error",
              "above 1e-8 for eps from 1e-6 on",
              per_scene(signs, lambda s: f"{min(least_error(s, m) for m in views):.1e}"), smooth > 1e-8, "smaller")
    )  # fmt: skip
    return made


def draw(data: dict):
    fig = new_figure(7.2, 5.8)
    axes = fig.subplots(2, 2, sharex=True, sharey=True).ravel()
    for ax, (name, scene) in zip(axes, data.items()):
        for method, (colour, style, mark) in LOOKS.items():
            points = line(scene, method)
            own = method in OWN
            ax.plot(
                [1e3 * p["seconds"] for p in points], [max(p["error"], FLOOR) for p in points], style, marker=mark,
                color=colour, markersize=5 if mark in "x+" else 4, linewidth=1.6 if own else 1.0,
                zorder=4 if own else 3,
            )  # fmt: skip
        ax.set(xscale="log", yscale="log", title=TITLES[name])
        ax.set_ylabel("error of the gradient" if ax in axes[::2] else "")
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        ax.grid(color="#DDDDDD", linewidth=0.5)
    for ax in axes[1:3]:
        ax.set_xlabel("processor time (ms)")
        ax.xaxis.set_tick_params(labelbottom=True)
    legend = axes[3]
    for method, (colour, style, mark) in LOOKS.items():
        legend.plot([], [], style, marker=mark, color=colour, markersize=4.5, label=method)
    legend.set_axis_off()
    legend.legend(loc="center left", fontsize=9, borderaxespad=0, labelspacing=0.7)
    return fig


STUDY = Study(
    name="gradients",
    question="What does a gradient of a piecewise-smooth motion cost, at which error, by which method?",
    expected="Derivatives as good as the solve; differences with fewer digits; of a bare sign a wrong one.",
    full=Config(),
    fast=Config(
        tolerances=(1e-5, 1e-9, 1e-13), shares=(1e-2, 1e-4), longest=(0.3,), eps=(1e-2, 1e-4), steps=(300, 3000),
        rounds=1,
    ),
    run=run, claims=claims, draw=draw,
)  # fmt: skip

if __name__ == "__main__":
    command(STUDY)
