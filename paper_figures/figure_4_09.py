"""Figure 4.9 of Xiong's thesis: frictional lag of the multistate law around its Stribeck curve."""

import numpy as np
import sympy as sp

from paper_figures import friction as fr
from paper_figures.claims import Claim
from paper_figures.sources import EXPECTED, computed, friction_thesis
from pwsmooth.plotting import COLOUR, direction_arrows

NAME = "4.9"
TITLE = "Frictional lag of the multistate law: more force while accelerating than while slowing down"
CAPTION = f"""
(a) Velocities v = 12.5 (1 - cos 2 pi f t) um/s, f = 1 and 10 Hz; (b) the friction force over the last cycle, for two
lags tau_d; thin black: the Stribeck curve g(v). Where v touches zero the elements return to presliding and the force
drops. {fr.NOTE}
"""
CASES = (
    (1, 0.02, COLOUR["right"]),
    (1, 0.08, COLOUR["left"]),
    (10, 0.02, COLOUR["stick"]),
    (10, 0.08, COLOUR["velocity"]),
)
# tests/reference/presliding.py (LSODA, tolerance 1e-10), last second: smallest force while all elements slide, largest
# force, area of the loop in (v, f).
LISTED = {0.02: (1.000065, 1.990110, 2.605048), 0.08: (1.003702, 1.942452, 8.296965)}
TIMES = np.linspace(1, 2, 20001)


def stribeck(v):
    """g(v) of the reference set."""
    return 1 + np.exp(-((v / 8) ** 2))


def claims(runs):
    """Numbers of the reconstruction, and what the source says of the figure."""
    found, areas = [], {}
    for (rate, lag), solution in runs.items():
        v, force = solution(TIMES, "velocity"), solution(TIMES, "force")
        areas[rate * lag] = abs(fr.work(force, v))
        if rate == 1:
            for what, listed, ours in zip(
                ("smallest force (N)", "largest force (N)", "area of the loop (N um/s)"),
                LISTED[lag],
                (sliding_minimum(solution), force.max(), areas[rate * lag]),
            ):
                text = f"{what}, 1 Hz, tau_d = {lag} s (reconstruction)"
                found.append(
                    Claim.number(
                        text,
                        listed,
                        float(ours),
                        1e-4 * listed,
                        digits=7,
                        **computed("tests/reference/presliding.py"),
                    )
                )
        above = branch_difference(solution, rate)
        found.append(
            Claim(
                f"the force while accelerating is above the one while slowing down, {rate} Hz, tau_d = {lag} s",
                "above",
                f"by {above:.4f} N or more for 6 < v < 24 um/s",
                above > 0,
                "it is not",
                **friction_thesis("chapter 4, conclusion", origin="reconstruction"),
            )
        )
    per_cycle = {x: area / (1 if x in (0.02, 0.08) else 10) for x, area in areas.items()}
    found.append(
        Claim(
            "the lag's loop is largest near 2 pi f tau_d = 1 (0.13, 0.50, 1.26, 5.0 here)",
            "not monotone in f tau_d",
            ", ".join(f"{per_cycle[x]:.2f}" for x in sorted(per_cycle)),
            max(per_cycle, key=per_cycle.get) in (0.08, 0.2),
            "it is monotone",
            **EXPECTED,
        )
    )
    return found


def sliding_minimum(solution):
    """Smallest force while all elements slide."""
    force, count = solution(TIMES, "force"), solution(TIMES, "presliding")
    return force[np.round(count) == 0].min()


def branch_difference(solution, rate):
    """Smallest difference of force between the branches at equal speed, in the last full cycle."""
    half = 0.5 / rate
    up = np.linspace(2 - 2 * half, 2 - half, 4001)
    v, rising, falling = (
        solution(up, "velocity"),
        solution(up, "force"),
        solution(2 - half + (2 - half - up), "force"),
    )
    chosen = (v > 6) & (v < 24)
    return float((rising - falling)[chosen].min())


def draw(fast):
    """Velocity over time, force over velocity."""
    figure, right, runs = fr.lag_panels(
        sp.Rational(25, 2) * (1 - sp.cos(2 * sp.pi * fr.RATE * fr.t)), CASES, TIMES
    )
    speeds = np.linspace(0, 25, 401)
    right.plot(speeds, stribeck(speeds), color=COLOUR["exact"], linewidth=0.8, label="g(v)", zorder=5)
    for rate, lag, colour in CASES:
        cycle = TIMES[TIMES >= 2 - 1 / rate][:-1]
        v, force = (runs[rate, lag](cycle, name) for name in ("velocity", "force"))
        direction_arrows(right, v, force, (0.35, 0.8), colour=colour)
    right.set(xlim=(0, 25.5), ylim=(0.9, 2.1))
    figure.legend(*right.get_legend_handles_labels(), loc="outside lower right", ncols=2, handlelength=1.5)
    return figure, claims(runs)
