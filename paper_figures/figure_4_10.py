"""Figure 4.10 of Xiong's thesis: how frictional lag changes the transition through a velocity reversal."""

import numpy as np
import sympy as sp

from paper_figures import friction as fr
from paper_figures.claims import Claim
from paper_figures.sources import EXPECTED, IDENTITY, computed
from pwsmooth.plotting import COLOUR, direction_arrows

NAME = "4.10"
TITLE = "Frictional lag through velocity reversals: the peak force falls as the lag grows"
CAPTION = f"""
(a) Velocities v = 10 sin 2 pi f t um/s, f = 1 and 10 Hz; (b) the friction force over the last cycle, for two lags
tau_d. At 1 Hz a longer lag leaves the static friction less time to build up at the reversal. At 10 Hz the loops depend
on the start for ever: elements that never yield keep their offset from it; dotted:
from a start in the middle of the positions, whose loop is symmetric. {fr.NOTE}
"""
CASES = (
    (1, 0.02, COLOUR["right"]),
    (1, 0.08, COLOUR["left"]),
    (10, 0.02, COLOUR["stick"]),
    (10, 0.08, COLOUR["velocity"]),
)
LISTED = {0.02: 1.884692, 0.08: 1.672935}  # tests/reference/presliding.py, last second, 1 Hz
TIMES = np.linspace(1, 2, 20001)


def claims(runs):
    """Numbers of the reconstruction, and what the figure is about."""
    peak = {case: float(runs[case](TIMES, "force").max()) for case in runs}
    found = [
        Claim.number(
            f"largest force, 1 Hz, tau_d = {lag} s (N; reconstruction)",
            listed,
            peak[1, lag],
            1e-4 * listed,
            **computed("tests/reference/presliding.py"),
        )
        for lag, listed in LISTED.items()
    ]
    found.append(
        Claim(
            "a longer lag lowers the peak after a reversal, 1 Hz",
            "lower",
            f"{peak[1, 0.02]:.4f} N to {peak[1, 0.08]:.4f} N",
            peak[1, 0.08] < peak[1, 0.02],
            "it does not",
            **EXPECTED,
        )
    )
    biggest = max(peak.values())
    found.append(
        Claim(
            "the force stays within the axes of the source, +-2 N",
            "below F_s = 2 N",
            f"{biggest:.4f} N",
            biggest < 2,
            "it leaves them",
            **IDENTITY,
        )
    )
    return found


def draw(fast):
    """Velocity over time, force over velocity."""
    figure, right, runs = fr.lag_panels(10 * sp.sin(2 * sp.pi * fr.RATE * fr.t), CASES, TIMES)
    for rate, lag, colour in CASES:
        cycle = TIMES[TIMES >= 2 - 1 / rate][:-1]
        v, force = (runs[rate, lag](cycle, name) for name in ("velocity", "force"))
        direction_arrows(right, v, force, (0.2, 0.7), colour=colour)
    # The same drive a quarter of a cycle later: it begins in the middle of its positions.
    rig = fr.rig(fr.MultistateXKY(), velocity=10 * sp.cos(2 * sp.pi * fr.RATE * fr.t), t_span=(0, 2))
    other = fr.run(rig, rate=10, tau_d=0.02)
    cycle = TIMES[TIMES >= 1.9]
    right.plot(other(cycle, "velocity"), other(cycle, "force"), ":", color=COLOUR["mark"],
               label="10 Hz, $\\tau_d$ = 0.02 s,\nsymmetric start")  # fmt: skip
    right.set(xlim=(-10.5, 10.5), ylim=(-2.1, 2.1))
    figure.legend(*right.get_legend_handles_labels(), loc="outside lower right", ncols=2, handlelength=1.5)
    return figure, claims(runs)
