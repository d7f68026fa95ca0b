"""What does accuracy cost? Every method on scenes with known answers: error against time and evaluations.

Errors are taken against references from an independent path (pwsmooth/compare/cases.py), at three ends of the span;
open marks are runs with a wrong itinerary, another sequence of crossings, sticks, slips or impacts. Rivals get the
same right-hand side compiled, a bound on the step that keeps their events from being stepped over, and their best
tolerance at every error; compilation is not counted. SciPy's integrators run in Python, which is most of their time:
their evaluations show what is left without it.

The time stepping is linear in the multiplier: on the scene with static friction, whose hidden term is not, it
converges to another orbit.

Expected: located events give the order of the smooth method; time stepping and smoothing are limited by their first
order in the step or in eps; a bare sign stalls as soon as there is a stick.

Usage: python experiments/work_precision.py [--fast] [--out DIR] [--draw FILE.json]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from studytools import Study, claim, command

from pwsmooth.compare.cases import CASES
from pwsmooth.compare.charts import plot_work
from pwsmooth.compare.work_precision import Point, work_precision
from pwsmooth.plotting import new_figure

OURS = "event-driven"
STICKING = ("sticking", "hidden", "relay", "belt", "chain")


@dataclass(frozen=True)
class Config:
    """Cases, methods (all by default), and repeats of each timing."""

    cases: tuple[str, ...] = tuple(CASES)
    methods: tuple[str, ...] = ()
    repeats: int = 5
    longest: float = 0.5


FAST = Config(
    cases=("sticking", "relay", "ball"),
    methods=("event-driven", "smoothed, algebraic", "DOP853, restarted at events", "Moreau-Jean time stepping"),
    repeats=1,
    longest=0.1,
)


def run(config):
    points = work_precision(config.cases, config.methods, repeats=config.repeats, longest=config.longest)
    references = {name: {"source": CASES[name].reference.source, "uncertainty": CASES[name].reference.uncertainty,
                         "events": len(CASES[name].reference.kinds)} for name in config.cases}  # fmt: skip
    return {"points": [point.as_dict() for point in points], "references": references}


def points_of(data):
    """The Points of a data file, with nan where JSON has none."""
    numbers = ("error", "event_error", "seconds", "first_call")
    rows = [
        {k: float("nan") if k in numbers and v is None else v for k, v in row.items()} for row in data["points"]
    ]
    return [Point(**row) for row in rows]


def cheapest(points, bound, groups, attribute):
    """The least work with a right itinerary at an error within the bound; inf if there is none."""
    good = [p for p in points if p.group in groups and p.error <= bound and p.itinerary == "right"]
    return min((getattr(p, attribute) for p in good), default=float("inf"))


def claims(data):
    points = points_of(data)
    cases = list(data["references"])
    rivals = {p.group for p in points} - {OURS}
    found = []
    for bound in (1e-4, 1e-8, 1e-12):
        behind = []
        for case in cases:
            here = [p for p in points if p.case == case]
            if cheapest(here, bound, {OURS}, "seconds") > cheapest(here, bound, rivals, "seconds"):
                behind.append(case)
        found.append(claim(f"At an error of {bound:g} no method takes less time than the event-driven one.",
                           "on every scene", "behind on " + ", ".join(behind) if behind else "on every scene",
                           not behind, "a rival needs less time there"))  # fmt: skip
    wrong = [p for p in points if p.group == OURS and p.itinerary != "right"]
    ours = f"{len(wrong)} of {sum(p.group == OURS for p in points)} wrong"
    found.append(claim("The event-driven itineraries are right at every tolerance from 1e-6 down.", "none wrong",
                       ours, not wrong, "see the chart"))  # fmt: skip
    bare = [p for p in points if p.group == "no events" and p.case in STICKING]
    if bare:
        ended = sum(np.isfinite(p.error) for p in bare)
        reach = f"{ended} of {len(bare)} runs reach it"
        found.append(claim("A bare sign stalls where the orbit sticks.", "none reaches the end",
                           reach, ended == 0, "some get through the sticks"))  # fmt: skip
    return found


def draw(data):
    points = points_of(data)
    cases = list(data["references"])
    rows = (len(cases) + 1) // 2
    figure = new_figure(12.0, 2.6 * rows + 1.0)
    grid = figure.subplots(rows, 4, squeeze=False)
    for k, case in enumerate(cases):
        here = [p for p in points if p.case == case]
        left, right = grid[k // 2][2 * (k % 2) : 2 * (k % 2) + 2]
        plot_work(here, left)
        plot_work(here, right, work="evaluations")
        left.set_title(CASES[case].title)
        right.set_ylabel("")
    for axes in grid.flat[2 * len(cases) :]:
        axes.axis("off")
    entries = {}
    for axes in grid.flat:
        entries |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels())}
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=4)
    return figure


STUDY = Study("work_precision", "What does accuracy cost on nonsmooth systems, method by method?",
              "Located events keep the order of the smooth method; smoothing and time stepping are first order; a bare "
              "sign stalls where the orbit sticks.", Config(), FAST, run, claims, draw)  # fmt: skip

if __name__ == "__main__":
    command(STUDY)
