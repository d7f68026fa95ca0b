"""How much model does a scene need? Six observables, each on every model of its scene.

Poorer models take their parameters from the richest one (its steady curve at the scene's typical speed, its virgin
curve, its restitution at the scene's first impact); distances carry the numerical error of both runs and, where there
is noise, the 95 % interval of the mean. Costs are processor times on one machine, medians of repeats.

Expected: Coulomb suffices where nothing sticks; the asymmetric orbit of the solid-friction oscillator needs the hidden
term with its relaxation; the losses of presliding need several states; more model is not always nearer.

Usage: python experiments/ladder.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

from dataclasses import dataclass

from studytools import Study, claim, command

from pwsmooth.compare.ladders import Ladder, ladder
from pwsmooth.compare.ladders.chart import VERDICT_COLOUR, VERDICT_MARK
from pwsmooth.plotting import new_figure

# Scene, observable, tolerance.
ASKED = (
    ("forced oscillator", "amplitude", "1%"),
    ("oscillator", "top displacement", "1%"),
    ("presliding", "loss", "2%"),
    ("drift", "displacement", "5%"),
    ("belt", "period", "1%"),
    ("ball", "third apex", "5%"),
)


@dataclass(frozen=True)
class Config:
    """What is asked, timed runs of each rung, and trajectories of the noisy one."""

    asked: tuple[tuple[str, str, str], ...] = ASKED
    repeats: int = 9
    samples: int = 32


FAST = Config(asked=ASKED[:3], repeats=1, samples=4)


def run(config):
    found = [ladder(*asked, repeats=config.repeats, samples=config.samples) for asked in config.asked]
    return {"ladders": {f"{one.scene}: {one.observable.name}": one.records() for one in found}}


def ladders(data):
    """The Ladders of a data file by scene."""
    return {records["scene"]: Ladder.from_records(records) for records in data["ladders"].values()}


def claims(data):
    found = ladders(data)
    forced, hidden, rig = found["forced oscillator"], found["oscillator"], found["presliding"]
    made = [
        claim("Coulomb gives the amplitude of an oscillator that never sticks.", "recommended: Coulomb",
              f"recommended: {forced.recommended}", forced.recommended == "Coulomb", "another rung is"),
        claim("Below the hidden term that relaxes nothing gives the asymmetric orbit.", "recommended: relaxing",
              f"recommended: {hidden.recommended}", hidden.recommended == "relaxing", "another rung does"),
    ]  # fmt: skip
    near = [s.name for s in rig.steps if s.verdict == "within"]
    words = "Nothing short of the multistate law gives the loss of presliding, a small loop in a large one."
    made.append(
        claim(words, "none within 2 %", f"within: {', '.join(near) or 'none'}", not near, "a poorer law does")
    )
    if "drift" in found:
        drift = found["drift"]
        coulomb, lugre = drift["Coulomb"].distance, drift["LuGre"].distance
        made.append(claim("More is not always nearer: under a small cyclic force LuGre is further off than Coulomb.",
                          "distance of LuGre > of Coulomb", f"{lugre:.2g} m > {coulomb:.2g} m", lugre > coulomb,
                          "LuGre is nearer"))  # fmt: skip
    return made


WORDS = {"within": "within the tolerance", "outside": "outside", "richest": "the richest model"}


def draw(data):
    """A row a scene: names are read on a page of two columns' width."""
    from matplotlib.lines import Line2D

    found = list(ladders(data).values())
    heights = [0.5 + 0.125 * len(one.steps) for one in found]
    figure = new_figure(7.0, sum(heights) + 0.6)
    grid = figure.subplots(len(found), 2, squeeze=False, width_ratios=(3, 2), height_ratios=heights)
    for pair, one in zip(grid, found):
        left, right = one.chart(pair)
        unit = "" if one.observable.unit == "1" else f" ({one.observable.unit})"
        left.set_title(f"{left.get_title(loc='left')}{unit}", fontsize=8)
        for axes in pair:
            axes.set_xlabel("")
            axes.tick_params(labelsize=7)
    marks = [
        Line2D([], [], color=VERDICT_COLOUR[v], marker=VERDICT_MARK[v], linestyle="", markersize=5)
        for v in WORDS
    ]
    marks.append(Line2D([], [], color=VERDICT_COLOUR["within"], marker="D", linestyle="", markersize=6))
    figure.legend(marks, [*WORDS.values(), "recommended"], loc="outside lower center", ncols=len(WORDS) + 1,
                  title="left: distance from the richest model; right: processor time of a run (ms)")  # fmt: skip
    return figure


EXPECTED = (
    "Coulomb where nothing sticks; the hidden term with its relaxation for the asymmetric orbit; several states for "
    "presliding; and more model is not always nearer."
)
STUDY = Study("ladder", "How much model does a scene need?", EXPECTED, Config(), FAST, run, claims, draw)

if __name__ == "__main__":
    command(STUDY)
