"""Does an optimiser find the best start of a motion through a jump, with which gradient?

    x' in 2 - sgn x on [0, 2],    (x(2) - 5/3)^2 + int_0^2 x^2 dt -> min over x(0) in [-2, -1]

x rises with 3, passes 0 at -x(0)/3 and rises with 1: x(2) = 2 + x(0)/3, and the cost is

    J = ((x(0) + 1)/3)^2 - x(0)^3/9 + (2 + x(0)/3)^3/3,    least at x(0) = (18 - sqrt(1668))/16.

Three gradients, all of them exact derivatives of what is computed:

    pwsmooth            of the exact solution, through the crossing: costs.Objective
    eps >> h, eps << h  sgn x -> tanh(x/eps), integrated by explicit Euler steps or the classical Runge-Kutta method of
                        step h; differentiated step by step. Steps longer than the layer jump over it

Each is handed to SciPy's L-BFGS-B, from -2 and from -1. Expected: with eps << h the gradient is that without the jump
(dx(2)/dx(0) = 1, not 1/3), except at starts where a step happens to end inside the layer, and no optimum is found; with
eps >> h it is right up to eps and h; the exact one finds the optimum to 1e-10 within 15 evaluations.

The example and the finding: D. E. Stewart, M. Anitescu, Optimal control of systems with discontinuous differential
equations, Numerische Mathematik 114 (2010) 653-695.

Usage: python experiments/gradient_optimum.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import sympy as sp
from studytools import Claim, Study, claim, command

from pwsmooth import System
from pwsmooth.costs import Objective, final, integral
from pwsmooth.plotting import COLOUR, new_figure

END, AIM = 2.0, 5 / 3
BEST = (18 - math.sqrt(1668)) / 16
EXACT = "exact (pwsmooth)"
WIDE, NARROW = "eps = 10 h", "eps = h/10"
LOOKS = {
    EXACT: (COLOUR["exact"], "o"),
    WIDE: (COLOUR["with events"], "s"),
    NARROW: (COLOUR["no events"], "^"),
}


@dataclass(frozen=True)
class Config:
    """Step of the discretised code, widths of the layer in steps, starts of the chart, evaluations allowed."""

    h: float = 0.02
    wide: float = 10.0
    narrow: float = 0.1
    points: int = 401
    most: int = 60


def closed_form(x0):
    """(J, dJ/dx0)"""
    last = 2 + x0 / 3
    return ((x0 + 1) / 3) ** 2 - x0**3 / 9 + last**3 / 3, 2 * (x0 + 1) / 9 - x0**2 / 3 + last**2 / 3


def stepped(x0: float, h: float, eps: float, classical: bool) -> tuple[float, float]:
    """Cost and its exact derivative by x0 of fixed steps through tanh(x/eps); the integral is a second state."""

    def rates(u):
        # (x, integral) and their deviations
        x, _, dx, _ = u
        level = np.tanh(x / eps)
        return np.array([2 - level, x**2, -(1 - level**2) / eps * dx, 2 * x * dx])

    u = np.array([x0, 0.0, 1.0, 0.0])
    for _ in range(round(END / h)):
        first = rates(u)
        if not classical:
            u = u + h * first
            continue
        second = rates(u + h / 2 * first)
        third = rates(u + h / 2 * second)
        u = u + h / 6 * (first + 2 * second + 2 * third + rates(u + h * third))
    x, area, dx, darea = u
    return (x - AIM) ** 2 + area, 2 * (x - AIM) * dx + darea


def objectives(config: Config) -> dict:
    """Name -> x0 -> (cost, derivative)."""
    x = sp.Symbol("x", real=True)
    cost = (final(x) - sp.Rational(5, 3)) ** 2 + integral(x**2)
    exact = Objective(System({x: 2 - sp.sign(x)}), cost, (0, END), {x: -2}, ["x"])

    def evaluated(x0):
        found = exact([x0])
        return found.value, float(found.gradient[0])

    made = {EXACT: evaluated}
    for method, classical in (("Euler", False), ("Runge-Kutta", True)):
        for name, share in ((WIDE, config.wide), (NARROW, config.narrow)):
            made[f"{name}, {method}"] = lambda x0, e=share * config.h, c=classical: stepped(x0, config.h, e, c)
    return made


def optimised(function, start: float, most: int) -> dict:
    """Every start that L-BFGS-B looked at, and where it stopped."""
    from scipy.optimize import minimize

    tried: list[float] = []

    def counted(x0):
        tried.append(float(x0[0]))
        value, slope = function(float(x0[0]))
        return value, np.array([slope])

    end = minimize(
        counted, [start], jac=True, method="L-BFGS-B", bounds=[(-2, -1)],
        options={"ftol": 0.0, "gtol": 1e-12, "maxfun": most},
    )  # fmt: skip
    return {"tried": tried, "end": float(end.x[0]), "message": str(end.message)}


def run(config: Config) -> dict:
    grid = np.linspace(-2, -1, config.points)
    found = {}
    for name, function in objectives(config).items():
        values = np.array([function(float(x0)) for x0 in grid])
        found[name] = {
            "cost": values[:, 0],
            "gradient": values[:, 1],
            "optimised": {str(start): optimised(function, start, config.most) for start in (-2.0, -1.0)},
        }
    return {"x0": grid, "h": config.h, "eps": config.wide * config.h, "found": found}


def evaluations(one: dict, within: float) -> float:
    """How many until a start this near to the best was looked at."""
    return next((k + 1 for k, x0 in enumerate(one["tried"]) if abs(x0 - BEST) <= within), math.inf)


def claims(data: dict) -> list[Claim]:
    grid, found = np.array(data["x0"]), data["found"]
    value, slope = closed_form(grid)
    own = found[EXACT]
    off = max(np.abs(np.array(own["cost"]) - value).max(), np.abs(np.array(own["gradient"]) - slope).max())
    needed = {start: evaluations(one, 1e-10) for start, one in own["optimised"].items()}
    made = [
        claim("Cost and gradient of the exact solution against the closed form, largest difference", "below 1e-12",
              f"{off:.1e}", off < 1e-12, "larger"),
        claim("The exact gradient finds the best start to 1e-10", "within 15 evaluations from both ends",
              ", ".join(f"{count} from {float(start):g}" for start, count in needed.items()),
              max(needed.values()) <= 15, "more"),
    ]  # fmt: skip
    narrow = {name: one for name, one in found.items() if name.startswith(NARROW)}
    wide = {name: one for name, one in found.items() if name.startswith(WIDE)}
    wrong = {name: float(np.mean(np.sign(one["gradient"]) != np.sign(slope))) for name, one in narrow.items()}
    made.append(
        claim(f"{NARROW}: the share of starts whose gradient has the wrong sign", "above a third",
              ", ".join(f"{share:.0%} ({name.split(', ')[1]})" for name, share in wrong.items()),
              min(wrong.values()) > 1 / 3, "fewer")
    )  # fmt: skip
    # A method of step h is off by some h, a layer of width eps moves the optimum by less than eps.
    h, eps = data["h"], data["eps"]
    for group, name, what, test in (
        (narrow, NARROW, f"farther than a step, {h:g}", lambda ends: min(ends) > h),
        (wide, WIDE, f"within eps, {eps:g}", lambda ends: max(ends) < eps),
    ):
        ends = [abs(run["end"] - BEST) for one in group.values() for run in one["optimised"].values()]
        made.append(
            claim(f"{name}: how far from the best start the optimiser ends", what,
                  ", ".join(f"{end:.2g}" for end in ends), test(ends), "otherwise")
        )  # fmt: skip
    return made


def draw(data: dict):
    fig = new_figure(7.2, 5.0)
    axes = fig.subplot_mosaic([["cost", "tried"], ["gradient", "tried"]])
    cost, gradient, tried = (axes[name] for name in ("cost", "gradient", "tried"))
    for name, (colour, mark) in LOOKS.items():
        one = data["found"][name if name == EXACT else f"{name}, Euler"]
        label = name.replace("eps", "ε")
        order, width = (4, 1.8) if name == EXACT else (3, 1.0)
        cost.plot(data["x0"], one["cost"], color=colour, linewidth=width, zorder=order, label=label)
        gradient.plot(data["x0"], one["gradient"], color=colour, linewidth=width, zorder=order)
        for (start, run), style in zip(one["optimised"].items(), ("-", "--")):
            tried.plot(
                np.arange(1, len(run["tried"]) + 1), [max(abs(x0 - BEST), 1e-16) for x0 in run["tried"]], style,
                marker=mark, markersize=4, color=colour, zorder=order,
                label=f"{label}, from {float(start):g}".replace("-", "−"),
            )  # fmt: skip
    gradient.axhline(0, color=COLOUR["mark"], linewidth=0.6)
    for ax, top in ((cost, 0.72), (gradient, 1.0)):
        ax.axvline(BEST, ymax=top, color=COLOUR["mark"], linewidth=0.8, linestyle=":")
    exact = np.array(data["found"][EXACT]["gradient"])
    gradient.set(xlabel="x(0)", ylabel="derivative of the cost", ylim=(exact.min() - 1, exact.max() + 1.5))
    cost.set(ylabel="cost")
    cost.legend()
    tried.set(xlabel="evaluation", ylabel="distance from the best x(0)", yscale="log", xlim=(0, 26))
    tried.legend(loc="lower right")
    return fig


STUDY = Study(
    name="gradient_optimum",
    question="Does an optimiser find the best start of a motion through a jump, with which gradient?",
    expected="With the exact one to 1e-10 in 15 evaluations; not with that of steps longer than a smoothed layer.",
    full=Config(),
    fast=Config(points=51),
    run=run, claims=claims, draw=draw,
)  # fmt: skip

if __name__ == "__main__":
    command(STUDY)
