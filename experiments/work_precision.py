"""What does accuracy cost? Every method on scenes with known answers: error against time and evaluations.

Errors are taken against references from an independent path (compare/efficiency/case.py), at three ends of the
span, in units of the states' sizes; open marks are runs with a wrong itinerary, another sequence of crossings, sticks,
slips or impacts. Rivals get the same right-hand side compiled, rules at their events that are compiled too, a bound on
the step that keeps their events from being stepped over, and their best tolerance at every error; compilation is not
counted. SciPy's and CVODE's callbacks pass through Python, which is most of their time: their evaluations show what
is left without it. How each method is tuned stands in the data file, beside the versions of the peers; one that is not
installed is listed as absent.

The time stepping is linear in the multiplier: on the scene with static friction, whose hidden term is not, it
converges to another orbit.

Expected: located events give the order of the smooth method; time stepping and smoothing are limited by their first
order in the step or in eps; a bare sign stalls as soon as there is a stick; where a law is smooth but stiff (LuGre), an
explicit method pays for stability.

Usage: python experiments/work_precision.py [--fast] [--out DIR] [--draw FILE.json]
Full: about ten minutes of processor time with all peers (pip install -e '.[bench]').
"""

from __future__ import annotations

import math
import sys
import textwrap
from dataclasses import dataclass

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from studytools import Study, claim, command
from work_precision_reading import OURS, behind, write_reading

from pwsmooth.compare.efficiency.cases import CASES
from pwsmooth.compare.efficiency.charts import SHORT, plot_orders, plot_widths, plot_work
from pwsmooth.compare.efficiency.measuring import work_precision
from pwsmooth.compare.efficiency.methods import METHODS
from pwsmooth.compare.efficiency.points import Point, WorkPrecision
from pwsmooth.plotting import COLOUR, new_figure

STICKING = ("sticking", "hidden", "relay", "belt", "chain")
BOUNDS = (1e-4, 1e-8, 1e-12)
SHOWN = (
    "event-driven", "event-driven, stiff", "smoothed, algebraic", "Moreau-Jean", "DOP853, restarted",
    "Radau, restarted", "heyoka, events", "CVODE, events", "numbalsoda DOP853, events", "diffrax, events",
    "nosnoc, 4 stages", "solve_nivp", "BDF, bare sign", "numbalsoda LSODA, bare sign",
)  # fmt: skip


# A chart for a first look: scenes on which different methods come second, or first.
FEW_CASES = {
    "hidden": "static friction",
    "relay": "a relay that slides for long",
    "lugre": "LuGre's law, stiff",
}
FEW_METHODS = (
    "event-driven", "event-driven, stiff", "smoothed, algebraic", "heyoka, events", "numbalsoda DOP853, events",
    "DOP853, restarted", "Moreau-Jean",
)  # fmt: skip

LEFT_OUT = ("smoothed, tanh", "RK45, restarted", "DOP853, bare sign", "diffrax, bare sign", "nosnoc, 2 stages")


@dataclass(frozen=True)
class Config:
    """Cases, methods (without near doubles of others), and repeats of each timing."""

    cases: tuple[str, ...] = tuple(CASES)
    methods: tuple[str, ...] = tuple(name for name in METHODS if name not in LEFT_OUT)
    repeats: int = 3
    longest: float = 0.3


FAST = Config(
    cases=("sticking", "relay", "ball"),
    methods=("event-driven", "smoothed, algebraic", "DOP853, restarted", "Moreau-Jean"),
    repeats=1,
    longest=0.1,
)


def run(config):
    data = WorkPrecision()
    for case in config.cases:
        data += (found := work_precision(case, config.methods, repeats=config.repeats, longest=config.longest))
        data.references |= found.references
        print(f"{case}: {len(found)} points", flush=True)
    used = dict.fromkeys(p.method for p in data)
    return {
        "points": [point.as_dict() for point in data],
        "references": data.references,
        "methods": {name: {"knob": METHODS[name].knob, "options": METHODS[name].options, "package": METHODS[name].extra}
                    for name in used},
    }  # fmt: skip


def points_of(data):
    """The Points of a data file, with nan where JSON has none."""
    numbers = ("error", "event_error", "seconds", "first_call")
    rows = [
        {k: float("nan") if k in numbers and v is None else v for k, v in row.items()} for row in data["points"]
    ]
    return WorkPrecision((Point(**row) for row in rows), data["references"])


def claims(data):
    points = points_of(data)
    found = []
    for bound in BOUNDS:
        late = behind(points, bound)
        found.append(claim(f"At an error of {bound:g} no peer is faster than event-driven steps, explicit or stiff.",
                           "on every scene",
                           "; ".join(f"{case}: {name} takes {share:.2g} of its time" for case, name, share in late)
                           or "on every scene", not late, "a peer needs less time there"))  # fmt: skip
    ours = [p for p in points if p.method == OURS]
    wrong = [p for p in ours if p.itinerary != "right"]
    found.append(claim("The event-driven itineraries are right at every tolerance from 1e-6 down.", "none wrong",
                       f"{len(wrong)} of {len(ours)} wrong", not wrong, "see the chart"))  # fmt: skip
    bare = [
        p for p in points if "bare sign" in p.method and p.case in STICKING and "not installed" not in p.note
    ]
    if bare:
        right = sum(np.isfinite(p.error) and p.error < 1e-4 for p in bare)
        found.append(claim("A bare sign gets no error below 1e-4 where the orbit sticks.", "no run does",
                           f"{right} of {len(bare)} do", right == 0, "some get through the sticks"))  # fmt: skip
    return found


def draw(data):
    points = points_of(data)
    cases = list(data["references"])
    figures = {name: grid(points, cases, name or "seconds", data) for name in ("", "evaluations")}
    if any(", order" in p.method for p in points):
        figures["orders"] = orders(points)
    figures["eps"] = widths(points)
    if not set(FEW_CASES) - set(cases):
        figures["short"] = few(points)
    return figures


def few(points):
    """Three scenes and seven methods, named at the top."""
    figure = new_figure(7.0, 2.9)
    panels = figure.subplots(1, len(FEW_CASES), sharey=True)
    for axes, (case, title) in zip(panels, FEW_CASES.items()):
        plot_work(points.of(case), axes, methods=FEW_METHODS, label=False)
        axes.set(title=title, xlabel="processor time (s)", ylabel="")
    panels[0].set(ylabel="error of the state, relative", ylim=(3e-17, 10))
    panels[0].yaxis.set_major_locator(LogLocator(numticks=7))
    named = {label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels())}
    figure.legend(named.values(), named, loc="outside upper center", ncols=4)
    return figure


def grid(points, cases, work, data):
    """One panel a case, on a page of two columns' width; the legend in the place of a panel, or below."""
    columns = min(3, len(cases))
    rows = -(-len(cases) // columns)
    figure = new_figure(7.0, 2.05 * rows + 0.4)
    panels = figure.subplots(rows, columns, squeeze=False)
    named = {}
    for axes, case in zip(panels.flat, cases):
        plot_work(points.of(case), axes, work=work, methods=SHOWN, label=False)
        title = points.references[case]["title"].replace(" = ", "\u00a0=\u00a0")  # not broken there
        axes.set_title(textwrap.fill(title, 30), fontsize=8)
        axes.set(xlabel="", ylabel="")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(numticks=6))
        axes.tick_params(labelsize=7)
        handles, labels = axes.get_legend_handles_labels()
        named |= dict(zip(labels, handles))
    named = {
        SHORT.get(name, name): named[SHORT.get(name, name)] for name in SHOWN if SHORT.get(name, name) in named
    }
    named["open: wrong itinerary"] = Line2D([], [], marker="o", color=COLOUR["mark"], linestyle="none",
                                            markerfacecolor="white", markersize=3.5)  # fmt: skip
    spare = panels.flat[len(cases) :]
    for axes in spare:
        axes.axis("off")
    place = dict(loc="center") if len(spare) else dict(loc="outside lower center", ncols=4)
    (spare[0] if len(spare) else figure).legend(named.values(), named, fontsize=7, **place)
    figure.supylabel("error of the state, in units of its size", fontsize=9)
    told = "evaluations of the right-hand side"
    figure.supxlabel(told if work == "evaluations" else f"processor time (s), {machine(data)}", fontsize=9)
    return figure


def machine(data):
    """What the data file knows of the machine."""
    known = data.get("provenance") or {}
    words = [known.get("processor") or known.get("machine"), known.get("system")]
    words += [f"{known['cores']} cores"] * ("cores" in known)
    return ", ".join(word for word in words if word) or "machine not recorded"


def orders(points):
    """What a fixed order costs the event-driven path, for three errors."""
    figure = new_figure(7.0, 3.9)
    panels = figure.subplots(1, len(BOUNDS), sharey=True)
    for axes, error in zip(panels, BOUNDS):
        plot_orders(points, axes, error=error)
        axes.axhline(1, color=COLOUR["mark"], linewidth=0.6)
        axes.set(xticks=range(8, 29, 4), title=f"error $10^{{{math.log10(error):.0f}}}$")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    for axes in panels[1:]:
        axes.set_ylabel("")
    panels[0].set_yticks([0.5, 1, 2, 5, 10])
    # A case that reaches one error may not reach another.
    named = {label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels())}
    figure.legend(named.values(), named, loc="outside lower center", ncols=2, fontsize=7.5)
    return figure


def widths(points):
    """The best eps of the smoothed path against the error asked for, and the time that it takes."""
    figure = new_figure(7.0, 3.6)
    left, right = figure.subplots(1, 2)
    plot_widths(points, left)
    plot_widths(points, right, what="seconds")
    left.set_title("smoothed path: the ε that is cheapest")
    right.set_title("its time, over the event-driven path's")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


STUDY = Study("work_precision", "What does accuracy cost on nonsmooth systems, method by method?",
              "Located events keep the order of the smooth method; smoothing and time stepping are first order; a bare "
              "sign stalls where the orbit sticks.", Config(), FAST, run, claims, draw)  # fmt: skip

if __name__ == "__main__":
    command(STUDY)
    if not {"--fast", "--out"} & set(sys.argv):
        write_reading()
