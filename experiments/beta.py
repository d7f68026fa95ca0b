"""E2: how does the orbit change with beta, the time that z takes, from the relaxing limit to none?

    y' = v,   v' = -2.4 sin t - 3.1 y - 0.1 v - lam (1 + 3 z),   beta z' = 1 - lam^2 - z

Part 1, eps = 0, event-driven: beta from 1e-5 to 10. Part 2: which limit one gets depends on r = eps/beta. The limit
eps, beta -> 0 at fixed r (event-driven, layer resolved) and the smoothed oscillator at two eps, each from a start
on the two-stick orbit (that of r = oo) and one on the one-stick orbit (that of r = 0.003).

Expected: at eps = 0 one stick a period for small beta, whose length tends to that of the two-stage limit,
0.778356050 (computed apart), by a power of beta: during capture z has to grow from nearly 0 under a force
nearly N, as at the passage of a fold, which suggests beta^(2/3). For beta of the drive's order z is too slow to grow
within a stick and the sticks vanish. Part 2: in the limit both orbits do not depend on r, but exist only while the
layer decides as they need: two sticks while the force on arrival is below the capture threshold F_c(r), one stick
while the force at its crossing is above it. Two thresholds follow from F_c; the smoothed curves tend to them.

Usage: python experiments/beta.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from friction_oscillator import hidden, omega, z

from pwsmooth import Strobe, solve, sweep
from pwsmooth.analysis.sticking import capture_threshold
from pwsmooth.plotting import COLOUR, new_figure
from pwsmooth.studies import Function, Points

DRIVE = 2 * sp.pi / omega
LIMIT = 0.778356050  # the two-stage limit's stick, computed apart
# A stay in |v| <= 5 eps is a stick when it is longer than this and z, which vanishes in slip, grows beyond that: where
# |F| is near N a crossing is slow too.
LEAST, GROWN = 0.2, 0.5


@dataclass(frozen=True)
class Config:
    """Grids of beta (eps = 0) and of r = eps/beta (log10), widths eps, and transients in periods."""

    log_beta: tuple[float, float, int] = (-5.0, 1.0, 61)
    log_r: tuple[float, float, int] = (-2.5, 0.25, 23)
    log_r_smooth: tuple[float, float, int] = (-2.5, 0.25, 23)
    eps: tuple[float, ...] = (1e-2, 1e-3)
    transient: int = 60
    layer_transient: int = 50
    smooth_transient: int = 80
    periods: int = 8
    edge_transient: int = 50


def powers(axis):
    return 10 ** np.linspace(*axis)


def sticks_of_smooth(solution, window):
    """(number, whole time) per period of the stays in the layer that are sticks."""
    eps = solution.parameters["eps"]
    t = np.linspace(window.start, window.end, 400 * window.periods + 1)
    inside = np.concatenate([[0], np.abs(solution(t, "v")) <= 5 * eps, [0]]).astype(int)
    begin, end = np.flatnonzero(np.diff(inside) == 1), np.flatnonzero(np.diff(inside) == -1)
    lengths = (end - begin) * (t[1] - t[0])
    z_at = solution(t, "z")
    grown = np.array([z_at[a:b].max() > GROWN for a, b in zip(begin, end)], bool)
    stays = (lengths > LEAST) & grown
    # A stay that the window's start cuts in two is counted once, with the other half at its end.
    return stays.sum() / window.periods, lengths[stays].sum() / window.periods


def on_orbit(system, transient):
    """A point of the orbit that a start of the specification leads to, and |F| where v reaches zero on it."""
    found = sweep(
        system, {"rho": [3.0]}, x0={"y": 0.6, "v": -1.07}, seen=Strobe(DRIVE), transient=transient, periods=1,
        measures=Points("y", "v", last=1),
    )  # fmt: skip
    return {name: float(found[f"{name}_points"].item()) for name in "yv"}


def forces(system, start):
    """|F| at the events where v reaches zero, over one period: kind -> largest."""
    orbit = solve(system, (0, 2 * np.pi), start, dense_output=True)
    result: dict[str, float] = {}
    for event in orbit.events:
        if event.kind in ("stick", "crossing"):
            force = abs(-2.4 * np.sin(event.time) - 3.1 * float(orbit(event.time, "y")))
            result[event.kind] = max(result.get(event.kind, 0.0), force)
    return result


def threshold(force):
    """r at which the layer just captures under this force."""
    from scipy.optimize import brentq

    log_r = brentq(lambda x: capture_threshold(3.0, 10**x) - force, -4, -0.2, xtol=1e-6)
    return float(10**log_r)


def edge(start, number, low, high, periods):
    """r between low and high where a start begins or ceases to lead to that many sticks a period, to 1e-5 of it."""
    layer = hidden().layered({z: 0.1})

    def led(log_r):
        found = sweep(layer, {"ratio_z": [10**log_r]}, x0=start, seen=Strobe(DRIVE), transient=periods, periods=8,
                      measures=["sticks"])  # fmt: skip
        return round(float(found.sticks.values[0])) == number

    low, high = np.log10(low), np.log10(high)
    at_low = led(low)
    if at_low == led(high):
        raise RuntimeError(f"{number} sticks at both ends of r = {10**low:g} to {10**high:g}, or at none")
    while high - low > 4e-6:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if led(middle) == at_low else (low, middle)
    return float(10 ** (0.5 * (low + high)))


def run(config: Config) -> dict:
    betas, ratios, smooth_ratios = (powers(a) for a in (config.log_beta, config.log_r, config.log_r_smooth))
    two, one = on_orbit(hidden().layered({z: sp.oo}), 60), on_orbit(hidden().layered({z: 0.003}), 40)
    starts = {name: (two[name], one[name]) for name in "yv"}
    common = dict(points=starts, seen=Strobe(DRIVE), periods=config.periods)
    slow = sweep(
        hidden(), {"beta": betas}, x0={"z": 0.0}, transient=config.transient, **common,
        measures=["sticks", "itinerary", "period"],
    )  # fmt: skip
    layer = hidden().layered({z: 0.1})
    limit = sweep(
        layer, {"ratio_z": ratios}, transient=config.layer_transient, measures=["sticks", "itinerary"], **common
    )
    arrival = forces(hidden().layered({z: sp.oo}), two)["stick"]
    crossing = forces(hidden().layered({z: 0.003}), one)["crossing"]
    # The orbits are there on both sides; whether the layer captures decides.
    ends = [edge(two, 2, 0.01, 0.1, config.edge_transient), edge(one, 1, 0.01, 0.3, config.edge_transient)]
    data = {
        "edges": {"two sticks from r": ends[0], "one stick up to r": ends[1]},
        "forces": {"arrival of two sticks": arrival, "crossing of one stick": crossing},
        "predicted": {"two sticks from r": threshold(arrival), "one stick up to r": threshold(crossing)},
        "beta": betas,
        "eps = 0": {
            "sticks": slow.sticks.values, "stick time": slow.stick_time.values,
            "itinerary": slow.itinerary.values.tolist(), "period": slow.period.values,
        },
        "r": ratios,
        "limit": {
            "sticks": limit.sticks.values, "stick time": limit.stick_time.values,
            "itinerary": limit.itinerary.values.tolist(), "outcome": limit.outcome.values,
        },
        "r smooth": smooth_ratios,
        "smoothed": {},
    }  # fmt: skip
    measure = Function(sticks_of_smooth, names=("sticks", "stick_time"), dense=True)
    for eps in config.eps:
        smooth = sweep(
            hidden().smoothed(eps=eps), {"beta": np.sort(eps / smooth_ratios)}, x0={"z": 0.0}, measures=measure,
            transient=config.smooth_transient, rtol=1e-7, atol=1e-10, **common,
        )  # fmt: skip
        # The axis runs over beta: turned round, it runs over r.
        data["smoothed"][f"{eps:g}"] = {
            "sticks": smooth.sticks.values[:, ::-1],
            "stick time": smooth.stick_time.values[:, ::-1],
            "outcome": smooth.outcome.values[:, ::-1],
        }
    return data


def approach(data: dict) -> tuple[np.ndarray, np.ndarray]:
    """beta and the distance of the stick from its limit, where there is one stick a period."""
    sticks, time = np.array(data["eps = 0"]["sticks"], float), np.array(data["eps = 0"]["stick time"], float)
    one = sticks[1] == 1
    return np.array(data["beta"])[one], time[1][one] - LIMIT


def order(data: dict, low: float, high: float) -> float:
    beta, distance = approach(data)
    inside = (beta >= low) & (beta <= high)
    return float(np.polyfit(np.log(beta[inside]), np.log(distance[inside]), 1)[0])


def last_with(sticks, ratios, number):
    """Range of r over which a start leads to that many sticks a period."""
    there = np.array(ratios)[np.round(np.array(sticks, float)) == number]
    return (float(there.min()), float(there.max())) if there.size else (float("nan"),) * 2


def claims(data: dict) -> list[Claim]:
    measured, coarser = order(data, 1e-5, 5e-5), order(data, 1e-3, 5e-3)
    words = {w for row in data["eps = 0"]["itinerary"] for w in row}
    small = np.array(data["beta"]) <= 0.2
    few = {w for row in data["eps = 0"]["itinerary"] for w, s in zip(row, small) if s}
    limit_two = last_with(data["limit"]["sticks"][0], data["r"], 2)
    by_eps = sorted(data["smoothed"], key=float, reverse=True)
    smooth_two = {eps: last_with(data["smoothed"][eps]["sticks"][0], data["r smooth"], 2)[0] for eps in by_eps}
    predicted = data["predicted"]["two sticks from r"], data["predicted"]["one stick up to r"]
    ends = data["edges"]["two sticks from r"], data["edges"]["one stick up to r"]
    return [
        claim("eps = 0, small beta: one stick a period from both starts", "S R L or S L R up to beta = 0.2",
              ", ".join(sorted(few)), few <= {"S R L", "S L R"}, "other orbits"),
        claim("eps = 0: the stick tends to the two-stage limit by a power of beta", "2/3",
              f"{coarser:.3f} near beta = 2e-3, {measured:.3f} near 2e-5", abs(measured - 2 / 3) < 0.02
              and abs(measured - 2 / 3) < abs(coarser - 2 / 3), "another power"),
        claim("eps = 0, beta of the drive's order: no stick is left", "R L at beta = 10",
              ", ".join(sorted({row[-1] for row in data["eps = 0"]["itinerary"]})),
              {row[-1] for row in data["eps = 0"]["itinerary"]} == {"R L"}, "sticks are left"),
        claim("eps, beta -> 0: two sticks from the r where F_c reaches the force on arrival",
              f"{predicted[0]:.5f}", f"from r = {ends[0]:.5f} on (bisection)",
              abs(ends[0] / predicted[0] - 1) < 1e-4, "from another r on", origin="derived"),
        claim("eps, beta -> 0: one stick up to the r where F_c reaches the force at its crossing",
              f"{predicted[1]:.5f}", f"up to r = {ends[1]:.5f} (bisection)",
              abs(ends[1] / predicted[1] - 1) < 1e-4, "up to another r", origin="derived"),
        claim("The smoothed oscillator tends to that as eps falls", f"two sticks from r = {limit_two[0]:.3f}",
              ", ".join(f"from {from_r:.3f} at eps = {eps}" for eps, from_r in smooth_two.items()),
              list(smooth_two.values()) == sorted(smooth_two.values(), reverse=True)
              and min(smooth_two.values()) >= limit_two[0], "not monotone"),
        claim("eps = 0: every orbit repeats within 8 drive periods", "words of S, R and L", ", ".join(sorted(words)),
              words <= {"R L", "S R L", "S L R", "S R S L"}, "some do not repeat within 8 drive periods"),
    ]  # fmt: skip


SHADES = ("white", "#BDBDBD", "#555555")  # no, one, two sticks


def _bars(ax, edges, counts, at):
    """A bar over r, in pieces of equal numbers of sticks, with the number in each; none where none was found."""
    for number, shade in enumerate(SHADES):
        inside = np.flatnonzero(np.diff(np.concatenate([[0], counts == number, [0]]).astype(int)))
        for first, end in zip(inside[::2], inside[1::2]):
            low, high = edges[first], edges[end]
            ax.barh(at, high - low, 0.8, left=low, color=shade, edgecolor=COLOUR["exact"], linewidth=0.6)
            ax.text(np.sqrt(low * high), at, str(number), ha="center", va="center", fontsize=8,
                    color="white" if number == 2 else "black")  # fmt: skip


def draw(data: dict):
    fig = new_figure(7.0, 5.4)
    (left, middle), (right, empty) = fig.subplots(2, 2)
    empty.remove()
    right.set_subplotspec(right.get_gridspec()[1, :])
    beta = np.array(data["beta"])
    for row in data["eps = 0"]["stick time"]:
        left.plot(beta, np.array(row, float), ".", color=COLOUR["exact"], markersize=3)
    left.axhline(LIMIT, color=COLOUR["mark"], linewidth=0.8, linestyle=":")
    left.annotate("two-stage limit", (1e-4, LIMIT), xytext=(2, -10), textcoords="offset points", fontsize=8,
                  color=COLOUR["mark"])  # fmt: skip
    left.set(xscale="log", xlabel="β", ylabel="stick time a period, in 1/ω", title="ε = 0", ylim=(-0.05, 1.45))
    b, distance = approach(data)
    middle.loglog(b, distance, ".", color=COLOUR["exact"], markersize=3)
    near = b[b < 0.03]
    middle.loglog(
        near,
        distance[0] * (near / b[0]) ** (2 / 3),
        color=COLOUR["approximation"],
        linewidth=1,
        label="$\\propto β^{2/3}$",
    )
    middle.set(xlabel="β", ylabel="distance of the stick time", title="from the two-stage limit")
    middle.legend(loc="lower right")
    shown = [("ε, β → 0", data["r"], data["limit"]["sticks"])]
    shown += [(f"ε = {eps}", data["r smooth"], one["sticks"]) for eps, one in data["smoothed"].items()]
    names = []
    for name, ratios, rows in shown:
        edges = np.sqrt(ratios[0] / ratios[1]) * np.append(ratios, ratios[-1] * ratios[1] / ratios[0])
        for start, row in zip(("two sticks", "one stick"), rows):
            _bars(right, edges, np.array(row, float), -len(names) - (len(names) // 2) * 0.4)
            names.append(f"{name}, from {start}")
    places = [-k - (k // 2) * 0.4 for k in range(len(names))]
    right.set_yticks(places, names, fontsize=7)
    for r in data["predicted"].values():
        right.axvline(r, color=COLOUR["left"], linewidth=1.0, linestyle=":")
    right.tick_params(axis="y", length=0)
    right.set_title("sticks a period; dotted: where $F_c$ puts the changes")
    right.set(xscale="log", xlabel="r = ε/β", xlim=(edges[0], edges[-1]),
              ylim=(places[-1] - 0.6, 0.6))  # fmt: skip
    return fig


STUDY = Study(
    name="beta",
    question="How does the orbit change with beta, the time that z takes, from the relaxing limit to none?",
    expected="one stick a period that tends to 0.778356 by beta^(2/3), none at beta of order 1; two at r = eps/beta "
    "above a threshold, with an overlap",
    full=Config(),
    fast=Config(
        log_beta=(-4.0, 1.0, 21), log_r=(-2.0, 0.25, 7), log_r_smooth=(-2.0, 0.25, 7), eps=(1e-2,), transient=100,
        layer_transient=10, smooth_transient=40, edge_transient=0,
    ),
    run=run,
    claims=claims,
    draw=draw,
)  # fmt: skip

if __name__ == "__main__":
    command(STUDY)
