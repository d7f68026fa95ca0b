"""E1: how do stick time and amplitude grow with the hidden term rho, and where is nonlinear sticking born?

    y' = v,   v' = -sigma sin t - k y - c v - N lam (1 + rho z),   sigma = 2.4, k = 3.1, c = 0.1, N = 1

Two regimes of z, event-driven, each from several starts at every rho: slaved (z = 1 - lam^2) and relaxing
(0.1 z' = 1 - lam^2 - z).

Expected: in slip the hidden term vanishes, so the slip-only orbit of rho = 0 is an orbit for every rho until the
layer captures it. Slaved, that is where the force |F| = 1.04008 at its crossings falls below N mu_s(rho), mu_s =
2 rho ((1 + rho)/(3 rho))^(3/2) for rho > 1/2: at rho = 0.8039. There |F| grows at once past N mu_s, so that the stick
is born with length zero. Relaxing, capture needs |F| < N, which the slip-only orbit never meets: it stays an
attractor for every rho, and sticking orbits appear beside it, asymmetric, with one stick a period: in a fold, at which
their branch, followed from rho = 3, turns back.

Usage: python experiments/rho.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from friction_oscillator import coulomb, hidden, omega, v, y, z

from pwsmooth import Strobe, find_orbit, follow, solve, sweep
from pwsmooth.analysis.sticking import fold
from pwsmooth.plotting import COLOUR, new_figure

DRIVE = 2 * sp.pi / omega


@dataclass(frozen=True)
class Config:
    """Values of rho, starts (y, v), and how long a transient may take."""

    rhos: tuple[float, float, int] = (0.0, 5.0, 201)
    ys: tuple[float, ...] = (0.78, 0.6, -0.6, 0.5, 1.2, 0.6858)
    vs: tuple[float, ...] = (-1.03, -1.07, 1.07, 0.3, 0.0, -0.8658)  # the last: near the slip-only orbit
    transient: int = 300
    periods: int = 12
    refinements: int = 7  # of the birth's bracket, each by ten


def swept(system, rhos, config, more, starts=slice(None)):
    """The sweep of one regime over rho and the starts."""
    return sweep(
        system, {"rho": rhos}, points={"y": config.ys[starts], "v": config.vs[starts]}, x0=more, seen=Strobe(DRIVE),
        transient=config.transient, periods=config.periods, measures=["sticks", "itinerary", "period", "amplitude(y)"],
    )  # fmt: skip


def birth(system, config, more, low, high):
    """Bracket of the smallest rho at which the slip-only orbit is captured, and the stick time at its end."""
    last = slice(len(config.ys) - 1, None)
    for _ in range(config.refinements):
        rhos = np.linspace(low, high, 11)
        times = swept(system, rhos, config, more, last).stick_time.values[0]
        if not (times > 0).any():
            return None
        k = int(np.argmax(times > 0))
        low, high = rhos[max(k - 1, 0)], rhos[k]
    return low, high, times[k]


def crossing_force():
    """|F| at the crossings of the slip-only orbit: rho = 0, after its transient."""
    orbit = solve(coulomb(), (0, 400 * np.pi), {"y": 0.6858, "v": -0.8658}, dense_output=True)
    at = orbit.event_times("crossing")[-1]
    return float(abs(-2.4 * np.sin(at) - 3.1 * orbit(at, "y")))


def fold_of_sticks(config: Config) -> dict:
    """Where the relaxing block's sticking orbit, followed down from rho = 3, turns back; its stick time there."""
    start = {y: config.ys[0], v: config.vs[0], z: 0}
    orbit = find_orbit(hidden(rho=3), start, seen=Strobe(DRIVE), transient=config.transient)
    branch = follow(orbit, {"rho": 0})
    found = branch.of_kind("fold")[0]
    events = [e for run in found.point.runs() for e in run.events]
    begin, end = (next(e.time for e in events if e.kind.startswith(kind)) for kind in ("stick", "slip"))
    return {
        "rho": found.parameter, "stick time": (end - begin) % found.point.period, "end": branch.end,
    }  # fmt: skip


def run(config: Config) -> dict:
    rhos = np.linspace(*config.rhos)
    regimes = {"slaved": (hidden().layered({z: sp.oo}), {}), "relaxing": (hidden(), {"z": 0.0})}
    data: dict = {"rho": rhos, "force": crossing_force(), "fold": fold_of_sticks(config), "regimes": {}}
    for name, (system, more) in regimes.items():
        found = swept(system, rhos, config, more)
        data["regimes"][name] = {
            "stick time": np.round(found.stick_time.values, 9),
            "sticks": np.round(found.sticks.values, 3),
            "amplitude": np.round(found.y_amplitude.values, 9),
            "itinerary": found.itinerary.values.tolist(),
            "failed": int((found.outcome.values < 0).sum()),
            "birth": birth(system, config, more, 0.0, 5.0),
        }
    return data


def static_friction(rho: float) -> float:
    lam = sp.Symbol("lam")
    return float(fold(1 - lam**2, lam, rho).mu_s)


def expected_birth(force: float) -> float:
    from scipy.optimize import brentq

    return brentq(lambda rho: 2 * rho * ((1 + rho) / (3 * rho)) ** 1.5 - force, 0.5, 5, xtol=1e-14)


def claims(data: dict) -> list[Claim]:
    slaved, relaxing = data["regimes"]["slaved"], data["regimes"]["relaxing"]
    predicted = expected_birth(data["force"])
    low, high, born = slaved["birth"]
    rho = np.array(data["rho"])
    words = np.array(relaxing["itinerary"])
    slip_only = (words[-1] == "R L").all()
    at_3 = int(np.argmin(abs(rho - 3)))
    longest = np.array(relaxing["stick time"]).max(axis=0)
    appears = int(np.argmax(longest > 0))
    turn = data["fold"]
    return [
        claim("Slaved: nonlinear sticking is born where N mu_s reaches the force at the crossings", f"{predicted:.7f}",
              f"between {low:.7f} and {high:.7f}", low - 1e-6 <= predicted <= high + 1e-6, "born elsewhere",
              origin="derived"),
        claim(
            "Slaved: it is born with length zero",
            "0",
            f"stick time {born:.1e} a period at rho = {high:.7f}",
            born < 100 * (high - low),
            "a stick of finite length",
        ),
        claim("Relaxing: the slip-only orbit is never captured", "slip only at every rho from its neighbourhood",
              "R L at all" if slip_only else "other orbits at some rho", slip_only, "it was captured"),
        claim(
            "Relaxing: sticking orbits appear in a fold, with a stick of finite length", "a fold of their branch",
            f"rho = {turn['rho']:.9f}, stick time {turn['stick time']:.6f} there; by trajectories from rho = "
            f"{rho[appears]:.3f} on, {longest[appears]:.3f}",
            turn["stick time"] > 0.2 and rho[appears - 1] < turn["rho"] <= rho[appears],
            "born of length zero, or elsewhere than trajectories find them",
        ),
        claim("Relaxing: one stick a period", "S R L or S L R, where it sticks", ", ".join(sorted(set(words.ravel()))),
              set(words.ravel()) <= {"R L", "S R L", "S L R", "S"}, "other orbits were met"),
        claim("At rho = 3 the relaxing stick has the length that another program finds", "1.179049648",
              f"{longest[at_3]:.9f}",
              abs(longest[at_3] - 1.179049648) < 1e-8, "another length", origin="independent",
              where="tests/reference/relaxing.py"),
    ]  # fmt: skip


def draw(data: dict):
    fig = new_figure(3.5, 6.2)
    axes = fig.subplots(2, 1)
    rho, force = np.array(data["rho"]), data["force"]
    marks = {"slaved": (COLOUR["stick"], "o"), "relaxing": (COLOUR["left"], "s")}
    for ax, key, label in zip(
        axes, ("stick time", "amplitude"), ("stick time a period, in 1/ω", "amplitude of y")
    ):
        for name, one in data["regimes"].items():
            values = np.array(one[key], float)
            colour, marker = marks[name]
            title = f"{name}: {'two sticks' if name == 'slaved' else 'one stick'} a period"
            for i, row in enumerate(values):
                # Small full circles, and open squares that are fewer: told apart in grey.
                look = (
                    dict(markersize=1.8)
                    if name == "slaved"
                    else dict(markersize=3.5, markevery=6, fillstyle="none")
                )
                ax.plot(rho, row, marker, color=colour, label=title if i == 0 else None, **look)
        ax.axvline(expected_birth(force), color=COLOUR["mark"], linewidth=0.8, linestyle=":")
        ax.set(xlabel="hidden term ρ", ylabel=label, xlim=(rho[0], rho[-1]))
    axes[0].plot(
        data["fold"]["rho"], data["fold"]["stick time"], "D", color=COLOUR["mark"], markersize=4.5,
        fillstyle="none", zorder=3,
    )  # fmt: skip
    axes[0].annotate(
        "fold", (data["fold"]["rho"], data["fold"]["stick time"]), xytext=(-19, 5), textcoords="offset points",
        color=COLOUR["mark"], fontsize=8,
    )  # fmt: skip
    axes[0].set_ylim(-0.05, 2)
    axes[1].set_ylim(1.05, 1.35)
    axes[0].annotate(
        "N μₛ(ρ) = |F| at the crossings", (expected_birth(force), 1.75), xytext=(6, 0), textcoords="offset points",
        color=COLOUR["mark"], fontsize=8,
    )  # fmt: skip
    axes[0].annotate(
        "slip only, beside the sticking orbits", (1.25, 0.05), color=marks["relaxing"][0], fontsize=8
    )
    axes[1].legend(loc="upper left", bbox_to_anchor=(0.17, 1.0), markerscale=1.5)
    return fig


STUDY = Study(
    name="rho",
    question="How do stick time and amplitude grow with the hidden term rho, and where is nonlinear sticking born?",
    expected="slaved: at rho = 0.8039, where N mu_s(rho) = |F| = 1.04008; relaxing: beside a lasting slip-only one",
    full=Config(),
    fast=Config(rhos=(0.0, 5.0, 26), transient=150, refinements=4),
    run=run,
    claims=claims,
    draw=draw,
)

if __name__ == "__main__":
    command(STUDY)
