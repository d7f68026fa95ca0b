"""Contact figure 2: a ball dropped on every law."""

import numpy as np

from paper_figures.claims import Claim
from paper_figures.contact import COLOUR, DASH
from paper_figures.sources import EXPECTED, closed_form, computed, friction_thesis
from pwsmooth.laws.contact import (
    HertzImpact,
    HuntCrossley,
    KelvinVoigt,
    LinearResidual,
    ResidualHuntCrossley,
    ResidualIndentation,
    RigidImpact,
)
from pwsmooth.plotting import new_figure
from pwsmooth.scenes import falling_ball

NAME = "c2"
TITLE = "A falling ball on each contact law"
CAPTION = """
1 kg dropped from 0.1 m. Left: height; right: force in the first contact over time since touch-down. Kelvin-Voigt
and the linear residual law: K = 1e4 N/m; the others K = 1e5 N/m^1.5. Kelvin-Voigt b1 = 0.005 s, Hunt-Crossley b2 =
0.3 s/m, residual laws beta = 0.005 s, gamma = 1000/s, Lankarani-Nikravesh c_r = 0.75, rigid e = 0.75. Parameters
are ours; R1 and R2 are reconstructions; Lankarani and Nikravesh's law at 0.75 rebounds higher than the rigid one.
Crosses: the end of bouncing, by accumulation of impacts (rigid) or by a last touch-down. Of the rigid law there is
no force curve: its contact has no duration.
"""
LAWS = {
    "Kelvin-Voigt": KelvinVoigt(K=1e4, b=0.005),
    "Hunt-Crossley": HuntCrossley(b=0.3),
    "Lankarani-Nikravesh": HertzImpact(c_r=0.75),
    "linear residual": LinearResidual(K=1e4, beta=0.005, gamma=1000),
    "R1": ResidualIndentation(beta=0.005),
    "R2": ResidualHuntCrossley(beta=0.005),
    "rigid": RigidImpact(e=0.75),
}
END = 1.5
# First lift-off (s) and indentation there (m), by DOP853: tests/figures/test_figure_references.py.
LIFT_OFF = {"R1": (0.172406, 2.9429e-3), "Hunt-Crossley": (0.174956, 0.0)}


def claims(runs):
    """The specification's table of the falling ball, and how each law ends."""
    r1, hc = runs["R1"], runs["Hunt-Crossley"]
    off, off_hc = r1.event_times("reset", "lift-off")[0], hc.event_times("reset", "lift-off")[0]
    rigid = runs["rigid"].event_times("accumulation")
    limit = np.sqrt(0.2 / 9.81) * (1 + 2 * 0.75 / 0.25)
    return [
        Claim.number(
            "R1: first lift-off (s)",
            LIFT_OFF["R1"][0],
            off,
            5e-7,
            **computed("tests/figures/test_figure_references.py"),
        ),
        Claim.number(
            "R1: indentation there (m): not zero",
            LIFT_OFF["R1"][1],
            float(r1(off, "p")),
            5e-8,
            **computed("tests/figures/test_figure_references.py"),
        ),
        Claim.number(
            "Hunt-Crossley: first lift-off (s)",
            LIFT_OFF["Hunt-Crossley"][0],
            off_hc,
            5e-7,
            **computed("tests/figures/test_figure_references.py"),
        ),
        Claim.number(
            "Hunt-Crossley: indentation there (m)",
            0.0,
            float(hc(off_hc, "p")),
            1e-12,
            **friction_thesis("chapter 5"),
        ),
        Claim.number(
            "R1 rests at (m g/K)^(2/3) (m)", 2.127058e-3, r1["p"][-1], 5e-10, digits=7, **closed_form()
        ),
        Claim(
            "Hunt-Crossley bounces for ever, residual laws stop after finitely many",
            "2 lift-offs (R1), no end (HC)",
            f"R1 {len(r1.event_times('reset', 'lift-off'))}, Hunt-Crossley "
            f"{len(hc.event_times('reset', 'lift-off'))} within {END} s and still moving",
            len(r1.event_times("reset", "lift-off")) == 2 and abs(hc["v"][-1]) > 1e-3,
            "it does not",
            **EXPECTED,
        ),
        Claim.number(
            "rigid: the impacts accumulate at t1 (1 + 2e/(1 - e)) (s)",
            limit,
            float(rigid[0]),
            1e-9,
            digits=9,
            **closed_form(),
        ),
    ]


def draw(fast):
    """Height and force."""
    runs = {
        name: falling_ball(law).solve((0, END), rtol=1e-10, dense_output=True) for name, law in LAWS.items()
    }
    figure = new_figure(6.2, 3.9)
    left, right = figure.subplots(1, 2, width_ratios=(1.5, 1))
    fall, ends = np.sqrt(0.2 / 9.81), []
    for name, run in runs.items():
        times = np.linspace(0, END, 6001)
        height = -run(times, "p")
        e = np.sqrt(max(0, height[times > fall + 0.036].max()) / 0.1)
        left.plot(
            times,
            1e3 * height,
            color=COLOUR[name],
            linestyle=DASH[name],
            label=f"{name}: {e:.2f}",
            linewidth=1.2,
        )
        if name == "rigid":
            ends.append((run.event_times("accumulation")[0], 0.0))
            continue
        times = fall + np.linspace(1e-9, 0.036, 3000)
        force = run(times, "force")
        force[-run(times, "p") > 0] = np.nan
        shown = (
            np.cumsum(np.abs(force) <= 1e-9) < 2
            if "resid" in name or name in ("R1", "R2")
            else np.isfinite(force)
        )
        right.plot(
            1e3 * (times - fall)[shown], force[shown], color=COLOUR[name], linestyle=DASH[name], linewidth=1.2
        )
    for name in ("R1", "R2", "linear residual"):
        run = runs[name]
        last = run.event_times("reset", "touch-down")[-1]
        ends.append((last, 1e3 * -run(last, "p")))
    left.plot(*np.array(ends, float).T, "x", color=COLOUR["rigid"], markersize=7, markeredgewidth=1.6, zorder=6,
              label="end of bouncing")  # fmt: skip
    left.axhline(0, color="#999999", linewidth=0.6, zorder=0)
    right.axhline(0, color="#999999", linewidth=0.6, zorder=0)
    left.set(xlabel="time (s)", ylabel="height (mm)", xlim=(0, END), title="height")
    right.set(xlabel="time since touch-down (ms)", ylabel="force (N)", title="force in the first contact")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3, handlelength=2.2,
                  title="law: root of the first rebound's height over that of the drop")  # fmt: skip
    return figure, claims(runs)
