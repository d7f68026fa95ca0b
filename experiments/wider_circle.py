"""E8: the source's wider circle: four neighbours of its oscillator, each with its claim.

a  The undriven planar cousin, reconstructed as a block on a belt (no equations are printed): x' = v + V,
   v' = -x - c x' - N lam (1 + rho z), z slaved. Expected: rho = 0 decays to rest from every start; rho = 3 traps starts
   that stick in a stick-slip oscillation. Undamped its period is pi + 2 atan(V/d) + 2 d/V, d = mu_s - 1 (N = 1): a half
   turn and twice the angle of (d, V) about x = 1, then a stick from 1 - d to 1 + d at the speed V.
b  Other sigmoids. Expected: the slaved event-driven orbit does not know them; smoothed ones (eps = beta) give the same
   kind of orbit, at distances that fall with eps. The orbit leaves its sticks by the fold, where a layer is left late
   by a time ~ eps^(2/3) (theory, order of smoothing): that power is expected of the largest distance.
c  The sliding bifurcation at N mu_s = max|q''| (source, proposition 5 and its end). Expected: rest at y = 0 survives up
   to sigma = 16/9 and is lost at omega t = pi/2, 3 pi/2.
d  Shaw's oscillator: forced, with a static coefficient of friction above the kinetic one, which the hidden term gives.
   Expected: multi-period orbits. Found by a scan over the frequency: none without a belt; many, and chaos, on one.

Usage: python experiments/wider_circle.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from paper_figures import oscillator as osc
from pwsmooth import Return, Strobe, Switch, System, solve
from pwsmooth.analysis.lyapunov import lyapunov_exponents
from pwsmooth.analysis.maps import Stroboscopic
from pwsmooth.analysis.orbits import find_orbit, refine
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.studies.attraction import orbit_diagram

SIGMOIDS = ("algebraic", "tanh", "erf")
MIRROR = {osc.y: -osc.y, osc.v: -osc.v}
MU_S = 16 / 9


@dataclass(frozen=True)
class Config:
    """Of all four parts."""

    belt_speed: float = 0.5
    damping: float = 0.05
    starts: tuple[tuple[float, float], ...] = ((1.3, 0.0), (0.2, 0.0), (-1.0, 0.0), (1.7, 0.0), (0.5, 0.0))
    eps: tuple[float, ...] = (1e-2, 1e-3, 1e-4, 1e-5)
    forcing: float = 1.0
    frequencies: tuple[float, float, int] = (0.2, 2.2, 401)
    transient: int = 300
    kept: int = 48
    chaotic_at: float = 1.3
    average: float = 20000.0


# ---- a, d: the block on a belt

t, x, v, z = sp.symbols("t x v z", real=True)
omega, beta = sp.symbols("omega beta", positive=True)
rho, a, c, V = sp.symbols("rho a c V", nonnegative=True)
lam = Switch("lam", v)
_BLOCK = System(
    {x: v + V, v: a * sp.cos(omega * t) - x - c * (v + V) - lam * (1 + rho * z), z: (1 - lam**2 - z) / beta},
    time=t,
    parameters={rho: 3, omega: 1, beta: 1, a: 0, c: 0, V: 0.5},
).layered({z: sp.oo})
_UNDRIVEN = System(
    {x: v + V, v: -x - c * (v + V) - lam * (1 + rho * z), z: (1 - lam**2 - z) / beta},
    parameters={rho: 3, beta: 1, c: 0, V: 0.5},
).layered({z: sp.oo})


def planar(config):
    """Where starts that stick go, with and without the hidden term; the period of the undamped oscillation."""
    ends = {}
    for strength in (0.0, 3.0):
        system = _UNDRIVEN.with_parameters({"rho": strength, "c": config.damping, "V": config.belt_speed})
        ends[str(round(strength))] = []
        for start in config.starts:
            run = solve(system, (0, 400), list(start), dense_output=True)
            late = run(np.linspace(380, 400, 2000))
            swing = float(late[0].max() - late[0].min())
            path = run(np.linspace(0, 60, 1500))
            ends[str(round(strength))].append(
                {"swing": swing, "x": path[0], "speed": path[1] + config.belt_speed}
            )
    undamped = _UNDRIVEN.with_parameters({"c": 0.0, "V": config.belt_speed})
    orbit = find_orbit(undamped, {"x": 0.9, "v": 0.0}, seen=Return(x - 1, direction=1))
    d = MU_S - 1
    exact = np.pi + 2 * np.arctan(config.belt_speed / d) + 2 * d / config.belt_speed
    return {"ends": ends, "period": orbit.period, "exact": exact, "multiplier": abs(orbit.multipliers[0])}


def shaw(config):
    """Orbit diagram over the frequency, periods found there, and the exponent of a chaotic orbit."""
    values = np.linspace(*config.frequencies)
    system = _BLOCK.with_parameters({"a": config.forcing, "c": config.damping, "V": config.belt_speed})
    start = {"x": 0.5, "v": 0.3}
    period = 2 * sp.pi / omega
    shown = orbit_diagram(
        system, omega, values, start, Strobe(period), transient=config.transient, keep=config.kept
    )
    still = orbit_diagram(
        system.with_parameters({"V": 0.0, "a": 2.2, "c": 0.1}), omega, values[::5], start, Strobe(period),
        transient=config.transient, keep=config.kept,
    )  # fmt: skip
    found = [recurrence(points) for points in shown.points]
    orbits = []
    for n in sorted({f for f in found if f > 1}):
        i = found.index(n)
        step = Stroboscopic(system.with_parameters({"omega": values[i]}), period, count=n)
        orbit = refine(step, shown.points[i, -1])
        if orbit.success:
            orbits.append({"period": n, "omega": values[i], "multiplier": abs(orbit.multipliers[0])})
    chaotic = system.with_parameters({"omega": config.chaotic_at})
    random = np.random.default_rng(5)
    exponents = [
        lyapunov_exponents(
            chaotic, dict(zip("xv", random.uniform(-1, 1, 2))), config.average / 8, transient=500
        )
        for _ in range(8)
    ]
    each = np.array([e.exponents[0] for e in exponents])
    return {
        "omega": values,
        "x": shown["x"],
        "periods": found,
        "still": sorted({recurrence(points) for points in still.points}),
        "orbits": orbits,
        "exponents": each,
        "exponent": float(each.mean()),
        "error": float(each.std(ddof=1) / np.sqrt(len(each))),
        "neighbours": neighbours(chaotic, start, config.average / 10),
    }


def recurrence(points):
    """Smallest n <= 12 after which the last points repeat, 0 if none."""
    for n in range(1, 13):
        if np.all(np.abs(points[n:] - points[:-n])[-n:] < 1e-6 * (1 + np.abs(points[-n:]))):
            return n
    return 0


def neighbours(system, start, time):
    """The exponent again, without any linearisation: how the distance of two orbits grows, set back every period."""
    T, size = 2 * np.pi / float(system.parameters[omega]), 1e-8
    tight = {"rtol": 1e-12, "atol": 1e-14}
    at = solve(system, (0, 80 * T), start, **tight).x[:, -1]
    other, total, count = at + [size, 0], 0.0, int(time / T)
    for k in range(80, 80 + count):
        at, other = (solve(system, (k * T, (k + 1) * T), list(w), **tight).x[:, -1] for w in (at, other))
        apart = np.linalg.norm(other - at)
        total += np.log(apart / size)
        other = at + (other - at) * (size / apart)
    return total / (count * T)


# ---- b, c: the driven oscillator


def sigmoids(config):
    """Slaved and smoothed two-stick orbits for every sigmoid."""
    found = {}
    times = np.linspace(0, 2 * np.pi, 721)[:-1]
    for name in SIGMOIDS:
        slaved = osc.oscillator().layered({osc.z: sp.oo}, sigmoid=name)
        exact = find_orbit(slaved, osc.SLAVED_START, seen=Strobe(2 * sp.pi, symmetry=MIRROR), transient=40)
        guess = {"y": exact.x0["y"], "v": exact.x0["v"], "z": 0.0}
        y, apart, stable = exact.solution()(times, "y"), {}, exact.success
        for eps in config.eps:
            smooth = osc.oscillator(beta=eps).smoothed(eps=eps, sigmoid=name)
            orbit = find_orbit(smooth, guess, seen=Strobe(2 * sp.pi, symmetry=MIRROR), transient=40)
            apart[f"{eps:g}"] = orbit.solution()(times, "y") - y
            stable = stable and orbit.success and orbit.stable
        found[name] = {"slaved": exact.x, "stable": stable, "apart": apart}
    return {"t": times, "eps": config.eps, "orbits": found}


def boundary():
    """The amplitude up to which rest at y = 0 survives in the slaved limit, and where it is lost just above."""
    view = osc.oscillator().layered({osc.z: sp.oo})

    def lost(sigma):
        run = solve(
            view.with_parameters({"sigma": sigma}), (0, 2 * np.pi), {"y": 0, "v": 0}, rtol=1e-12, atol=1e-14
        )
        return run.event_times("slip")

    low, high = 1.7, 1.9
    while high - low > 1e-12:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if lost(middle).size else (middle, high)
    amplitudes = MU_S + np.logspace(-8, -1, 15)
    return {"limit": low, "amplitudes": amplitudes, "lost_at": [lost(A)[0] for A in amplitudes]}


def run(config):
    """All four parts."""
    return {
        "planar": planar(config),
        "sigmoids": sigmoids(config),
        "boundary": boundary(),
        "shaw": shaw(config),
    }


def claims(data):
    """What was expected beside what was found."""
    part = data["planar"]
    rest, trapped = ([end["swing"] for end in part["ends"][key]] for key in ("0", "3"))
    orbits = data["sigmoids"]["orbits"]
    slaved = np.array([orbits[s]["slaved"] for s in SIGMOIDS])
    off = {s: [float(np.abs(apart).max()) for apart in orbits[s]["apart"].values()] for s in SIGMOIDS}
    last = np.log(data["sigmoids"]["eps"][-2] / data["sigmoids"]["eps"][-1])
    orders = {s: float(np.log(d[-2] / d[-1]) / last) for s, d in off.items()}
    edge, found = data["boundary"], data["shaw"]
    above = np.array(edge["amplitudes"]) - MU_S
    early = np.pi / 2 - np.array(edge["lost_at"])
    # sigma sin(omega t) = 16/9 just before pi/2
    predicted = np.arccos(MU_S / (MU_S + above))
    several = sorted({o["period"] for o in found["orbits"]})
    gap = abs(found["exponent"] - found["neighbours"])
    # The run of the neighbours is ten times shorter; four standard errors of the difference.
    spread = 4 * found["error"] * np.sqrt(11)
    return [
        claim("a: without the hidden term the block comes to rest", "from all starts",
              f"swings {max(rest):.1e} at most",
              max(rest) < 1e-3, "it goes on"),
        claim("a: with it starts that stick are trapped in stick-slip", "from all starts",
              f"swings {min(trapped):.3f} at least", min(trapped) > 1, "some decay"),
        Claim.number("a: period of the undamped stick-slip",
                     part["exact"], part["period"], 1e-9, digits=11, origin="derived"),
        claim("b: the slaved orbit does not know the sigmoid", "equal", f"apart by {np.ptp(slaved, axis=0).max():.1e}",
              np.ptp(slaved, axis=0).max() < 1e-10, "they differ"),
        claim("b: smoothed by each sigmoid it is a stable symmetric orbit nearby, the nearer the smaller eps = beta",
              "largest distance ~ eps^(2/3)",
              "; ".join(f"{s} {', '.join(f'{d:.2g}' for d in off[s])}, at last ~ eps^{orders[s]:.2f}" for s in off)
              + f" (eps = {', '.join(orbits['tanh']['apart'])})",
              all(orbits[s]["stable"] and np.all(np.diff(off[s]) < 0) for s in off)
              and all(abs(order - 2 / 3) < 0.05 for order in orders.values()),
              "not found near, or of another order", origin="derived"),
        Claim.number("c: rest survives up to sigma", MU_S, edge["limit"], 1e-9, digits=10, origin="derived"),
        claim("c: it is lost where sigma sin t = N mu_s first, at pi/2 in the limit", "arccos(16/9 / sigma) before",
              f"off by {np.abs(early - predicted).max():.1e}",
              np.abs(early - predicted).max() < 1e-6, "elsewhere", origin="derived"),
        claim("d: multi-period orbits of the forced oscillator with static friction", "several periods",
              f"periods {several} on a belt, confirmed by Newton's method; without one {found['still']}",
              len(several) >= 2, "none found"),
        claim("d: a chaotic orbit", "exponent > 0",
              f"{found['exponent']:.4f} +- {found['error']:.4f}, mean and standard error of 8 independent starts "
              f"({min(found['exponents']):.4f} to {max(found['exponents']):.4f}); by two neighbours "
              f"{found['neighbours']:.4f}",
              found["exponent"] > 5 * found["error"] and gap < spread, "not clearly positive"),
    ]  # fmt: skip


def draw(data):
    """One panel for each part."""
    figure = new_figure(7.0, 5.6)
    (planar_ax, sigmoid_ax), (edge_ax, shaw_ax) = figure.subplots(2, 2)
    for key, colour, dash, label in (
        ("0", COLOUR["right"], "-", "$\\rho = 0$"),
        ("3", COLOUR["left"], "--", "$\\rho = 3$"),
    ):
        for i, end in enumerate(data["planar"]["ends"][key][:2]):
            planar_ax.plot(
                end["x"], end["speed"], dash, color=colour, linewidth=0.9, label=label if i == 0 else None
            )
    planar_ax.set(xlabel="x", ylabel="x'", title="a  Block on a belt, undriven")
    planar_ax.set_ylim(-0.95, 0.85)
    planar_ax.legend(loc="upper center", ncols=2)
    eps = np.array(data["sigmoids"]["eps"])
    for name, line, mark in zip(SIGMOIDS, ("-", "--", ":"), "os^"):
        off = [np.abs(apart).max() for apart in data["sigmoids"]["orbits"][name]["apart"].values()]
        sigmoid_ax.loglog(eps, off, line, marker=mark, color=COLOUR["smoothed"], markersize=4, fillstyle="none",
                          label=name)  # fmt: skip
    sigmoid_ax.loglog(eps, 0.6 * off[-1] * (eps / eps[-1]) ** (2 / 3), color=COLOUR["mark"], linewidth=0.7,
                      label="$\\varepsilon^{2/3}$")  # fmt: skip
    sigmoid_ax.set(xlabel="$\\varepsilon = \\beta$", ylabel="largest |y - y of the slaved orbit|",
                   title="b  Other sigmoids")  # fmt: skip
    sigmoid_ax.legend(loc="upper left")
    above = np.array(data["boundary"]["amplitudes"]) - MU_S
    edge_ax.loglog(
        above, np.arccos(MU_S / (MU_S + above)), color=COLOUR["exact"], label="arccos$(16/(9\\sigma))$"
    )
    edge_ax.loglog(above, np.pi / 2 - np.array(data["boundary"]["lost_at"]), "o", color=COLOUR["stick"],
                   markersize=4, label="event-driven")  # fmt: skip
    edge_ax.set(xlabel="$\\sigma - 16/9$", ylabel="$\\pi/2 - \\omega t$ at the first slip",
                title="c  Rest is lost at the drive's turn")  # fmt: skip
    edge_ax.legend(loc="upper left")
    found = data["shaw"]
    x = np.array(found["x"], float)
    values = np.array(found["omega"])
    shaw_ax.plot(
        np.repeat(values, x.shape[1]), x.ravel(), ".", color=COLOUR["exact"], markersize=0.9, rasterized=True
    )
    shaw_ax.set(xlabel="forcing frequency $\\omega$", ylabel="x, once a period",
                title="d  Forced block on a belt")  # fmt: skip
    return figure


STUDY = Study(
    name="wider_circle",
    question="Do the source's neighbours behave as it says: planar cousin, other sigmoids, sliding bifurcation, Shaw?",
    expected="Trapped only with the hidden term; sigmoids matter less and less, as eps^(2/3); rest is lost at 16/9; "
    "multi-period orbits.",
    full=Config(),
    fast=Config(starts=((1.3, 0.0),), frequencies=(0.4, 1.4, 21), transient=100, average=1500.0),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
