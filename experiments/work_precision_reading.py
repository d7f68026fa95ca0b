"""The reading of the work-precision study: docs/methods.md, written from the data file and nothing else.

Usage: python experiments/work_precision_reading.py     after experiments/work_precision.py, which also calls it
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
from studytools import RESULTS

from pwsmooth.compare.efficiency.charts import best_width
from pwsmooth.compare.efficiency.points import Point, WorkPrecision

OURS, STIFF = "event-driven", "event-driven, stiff"
PAGE = Path(__file__).resolve().parent.parent / "docs" / "methods.md"
ERRORS = (1e-2, 1e-4, 1e-8, 1e-12)
COLUMNS = {
    "event-driven": "event-driven", "event-driven, stiff": "stiff steps",
    "smoothed, algebraic": "smoothed", "Moreau-Jean": "Moreau-Jean",
    "heyoka, events": "heyoka", "numbalsoda DOP853, events": "numbalsoda DOP853", "CVODE, events": "CVODE",
    "diffrax, events": "diffrax", "DOP853, restarted": "SciPy DOP853", "Radau, restarted": "SciPy Radau",
    "nosnoc, 4 stages": "nosnoc", "solve_nivp": "solve_nivp",
}  # fmt: skip


def own(name: str) -> bool:
    """Whether a method is this package's."""
    return name.startswith("event-driven") or name.startswith("smoothed")


def behind(points, bound):
    """(case, peer, its time over ours) of the scenes on which a peer reaches the error in less time than this package's
    event-driven steps, Taylor's or the stiff ones."""
    late = []
    for case in points.references:
        best = points.of(case).cheapest(bound)
        rivals = [p for name, p in best.items() if not own(name)]
        ours = next((p for name, p in best.items() if name in (OURS, STIFF)), None)
        if rivals and (ours is None or rivals[0].seconds < ours.seconds):
            share = rivals[0].seconds / ours.seconds if ours else math.nan
            late.append((case, rivals[0].method, share))
    return late


def load(path=RESULTS / "work_precision.json"):
    """(points, the data file's content)"""
    content = json.loads(Path(path).read_text())
    numbers = ("error", "event_error", "seconds", "first_call")
    rows = [
        {k: math.nan if k in numbers and v is None else v for k, v in row.items()}
        for row in content["data"]["points"]
    ]
    return WorkPrecision((Point(**row) for row in rows), content["data"]["references"]), content


class Reading:
    """Numbers of the sentences."""

    def __init__(self, points):
        self.points, self.cases = points, list(points.references)

    def time(self, case, method, error):
        """Least seconds of a method within an error; None if it does not get there."""
        found = self.points.of(case).cheapest(error).get(method)
        return found.seconds if found else None

    def ratios(self, method, error, over=OURS):
        """{case: time of the method over that of another} where both get there."""
        pairs = {c: (self.time(c, method, error), self.time(c, over, error)) for c in self.cases}
        return {c: a / b for c, (a, b) in pairs.items() if a and b}

    def reached(self, method, error):
        """Cases on which the method gets within the error."""
        return [c for c in self.cases if self.time(c, method, error)]

    def present(self, method):
        """Whether there is any result of the method."""
        return any(p.method == method and np.isfinite(p.error) for p in self.points)

    def refused(self, method):
        """{case: why} where it has no form or never succeeds."""
        notes = {}
        for case in self.cases:
            here = [p for p in self.points.of(case) if p.method == method]
            if here and not any(np.isfinite(p.error) for p in here):
                notes[case] = here[0].note.removeprefix("cannot do: ")
        return notes


def times(number):
    """'3.2 times', with two digits."""
    return f"{number:.2g} times" if number < 100 else f"{round(number, -1):.0f} times"


def span(ratios):
    """'2.1 to 14 times'"""
    low, high = min(ratios.values()), max(ratios.values())
    return times(high) if f"{low:.2g}" == f"{high:.2g}" else f"{low:.2g} to {times(high)}"


def power(error):
    """'1e-4'"""
    return f"1e{round(math.log10(error))}"


def scenes(number):
    """'1 scene', '3 scenes'"""
    return f"{number} scene" + "s" * (number != 1)


def milliseconds(seconds):
    """As a table's entry."""
    return f"{seconds * 1e3:.2g}" if seconds < 0.1 else f"{seconds * 1e3:.0f}"


def table(reading, error):
    """Milliseconds of each method on each scene within an error; the least is bold."""
    names = [n for n in COLUMNS if reading.present(n)]
    lines = ["| scene | " + " | ".join(COLUMNS[n] for n in names) + " |", "| --- |" + " ---: |" * len(names)]
    for case in reading.cases:
        found = {n: reading.time(case, n, error) for n in names}
        least = min((s for s in found.values() if s), default=None)
        texts = ["" if s is None else milliseconds(s) for s in found.values()]
        cells = [f"**{text}**" if s and s == least else text for s, text in zip(found.values(), texts)]
        lines.append(f"| {reading.points.references[case]['title']} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def sentences(reading):
    """One a method or a choice: which job it is for, with the row of the data that says so."""
    r, said = reading, []
    count = len(r.cases)
    here = {e: r.reached(OURS, e) for e in ERRORS}
    slow = {c: r.time(c, OURS, 1e-8) for c in here[1e-8]}
    said.append(
        f"**The event-driven path is the default for whatever switches, sticks or impacts**: it gets below 1e-8 on "
        f"{len(here[1e-8])} and below 1e-12 on {len(here[1e-12])} of the {count} scenes, with the right itinerary "
        f"at every tolerance, in {milliseconds(min(slow.values()))} to {milliseconds(max(slow.values()))} ms at "
        "1e-8.")  # fmt: skip
    tight = {c: r.time(c, OURS, 1e-12) / r.time(c, OURS, 1e-4) for c in here[1e-12]}
    most = max(tight, key=tight.get)
    said.append(
        "**Ask it for tight errors, they are nearly free**: from 1e-4 to 1e-12 its time grows by at most "
        f"{tight[most] - 1:.0%} ({most})."
    )
    orders = [p.method for p in r.points if ", order" in p.method]
    if orders:
        lost = {}
        for c in here[1e-8]:
            best = min(s for n in {*orders, OURS} if (s := r.time(c, n, 1e-8)))
            lost[c] = r.time(c, OURS, 1e-8) / best
        worst = max(lost, key=lost.get)
        said.append(
            f"**Leave the order alone**: at 1e-8 the default is within {times(max(lost.values()))} the best of the "
            f"orders 8 to 28 (the worst on {worst}).")  # fmt: skip
    pair = "event-driven, 8(5,3) pair"
    if (ratios := r.ratios(pair, 1e-8)) and (more := r.ratios(pair, 1e-12)):
        said.append(
            "**The Runge-Kutta pair is for right-hand sides without a Taylor recurrence**: with the same events it "
            f"takes {span(ratios)} the time at 1e-8, {span(more)} at 1e-12.")  # fmt: skip
    if ratios := r.ratios(STIFF, 1e-8):
        wins = ", ".join(f"{c} ({times(ratios[c])})" for c in sorted(ratios, key=ratios.get) if ratios[c] < 1)
        said.append(
            '**Stiff steps (`method="stiff"`) are for bristle laws at speed**: the same exact events with implicit '
            f"steps between them, on the {scenes(len(ratios))} where no switch slides; at 1e-8 they are faster on "
            f"{wins or 'none'}.")  # fmt: skip
    name = "smoothed, algebraic"
    if loose := r.ratios(name, 1e-2):
        middle = r.ratios(name, 1e-4)
        wins = sorted(c for c in middle if middle[c] < 1)
        text = "**The smoothed path is a cross-check, and the way to a smooth but stiff law**: it takes "
        text += f"{span(loose)} the event-driven time at 1e-2 and {span(middle)} at 1e-4"
        said.append(text + (f"; it is the faster one on {', '.join(wins)}." if wins else "."))
        best = {c: best_width((p for p in r.points.of(c) if p.method == name), 1e-4) for c in r.cases}
        eps = {c: p.setting[0] for c, p in best.items() if p}
        deep = {c for c in r.cases if best_width((p for p in r.points.of(c) if p.method == name), 1e-8)}
        if eps:
            said.append(
                f"**Its ε is a second tolerance**: an error of 1e-4 is cheapest with ε from {min(eps.values()):.0e} "
                f"to {max(eps.values()):.0e} (in the unit of each surface), and {len(deep)} of {count} scenes reach "
                "1e-8 with any ε at all.")  # fmt: skip
    name = "Moreau-Jean"
    if loose := r.ratios(name, 1e-2):
        fine = r.reached(name, 1e-4)
        said.append(
            f"**Time stepping is for many contacts and rough answers**: it gets to 1e-2 on {scenes(len(loose))} in "
            f"{span(loose)} the event-driven time, to 1e-4 on {len(fine)}, and to 1e-8 on "
            f"{len(r.reached(name, 1e-8))}; where the multiplier enters nonlinearly it converges to another "
            "orbit.")  # fmt: skip
    for name, label, use in (
        ("heyoka, events", "heyoka", "is the peer to beat"),
        (
            "numbalsoda DOP853, events",
            "A compiled DOP853 with a compiled loop over events (numbalsoda)",
            "is the next best",
        ),
        (
            "DOP853, restarted",
            "SciPy's DOP853, restarted at its events,",
            "is an independent reference, not a tool",
        ),
        ("CVODE, events", "CVODE with its root finding", "pays for callbacks through Python"),
        ("diffrax, events", "diffrax with its event", "pays for every restart of a compiled solve"),
        ("solve_nivp", "solve_nivp", "is of second order at most, for loose errors"),
        ("nosnoc, 4 stages", "nosnoc", "solves a nonlinear programme for every step"),
    ):
        if not r.present(name):
            continue
        at = next((e for e in (1e-8, 1e-4, 1e-2) if r.ratios(name, e)), None)
        text = f"**{label} {use}**: "
        if at is None:
            text += "it reaches 1e-2 on no scene"
        else:
            ratios = r.ratios(name, at)
            text += f"at {power(at)} it takes {span(ratios)} the event-driven time on {scenes(len(ratios))}"
            wins = sorted(c for c in ratios if ratios[c] < 1)
            text += f", less than it on {', '.join(wins)}" if wins else ""
        if refused := r.refused(name):
            text += f"; no result on {', '.join(refused)}"
        said.append(text + ".")
    bare = [n for n in dict.fromkeys(p.method for p in r.points) if "bare sign" in n]
    if bare:
        stuck = [c for c in ("sticking", "hidden", "relay", "belt", "chain") if c in r.cases]
        good = {c for n in bare for c in r.reached(n, 1e-4)}
        said.append(
            f"**A bare sign is for no scene that sticks**: of {len(bare)} integrators none gets below 1e-4 on "
            f"{', '.join(c for c in stuck if c not in good)}; it serves where a surface is only a kink or is "
            f"crossed ({', '.join(sorted(good)) or 'nowhere here'}).")  # fmt: skip
    if "lugre" in r.cases and r.present("Radau, restarted"):
        got = {COLUMNS.get(n, n): p.seconds for n, p in r.points.of("lugre").cheapest(1e-4).items()}
        first = list(got)[:3]
        said.append("**LuGre at speed is stiff, and no longer a question of events**: at 1e-4 the order is "
                    + ", ".join(f"{n} ({milliseconds(got[n])} ms)" for n in first) + ".")  # fmt: skip
    late = {e: behind(r.points, e) for e in ERRORS[1:]}
    lost: dict[str, list[str]] = {}
    for e, rows in late.items():
        for case, name, share in rows:
            lost.setdefault(f"{case} ({COLUMNS.get(name, name)})", []).append(f"{share:.2g} at {power(e)}")
    text = "**Where a peer is faster than the event-driven path**, by the share of its time that it takes: "
    text += "; ".join(f"{where} {', '.join(shares)}" for where, shares in lost.items()) or "nowhere here"
    least = min(p.seconds for p in r.points if p.method == OURS)
    if any(name == "Moreau-Jean" for rows in late.values() for _, name, _ in rows):
        text += " (time stepping is a bare loop here, which records nothing)"
    text += f". The least time of any run here, {milliseconds(least)} ms, is mostly the call itself"
    said.append(text + ": what a model needs is kept from call to call.")
    return said


def widths(reading):
    """Cheapest eps, its tolerance and its time for each scene and error."""
    errors = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
    lines = ["| scene | " + " | ".join(f"{e:g}" for e in errors) + " |", "| --- |" + " --- |" * len(errors)]
    for case in reading.cases:
        here = [p for p in reading.points.of(case) if p.method == "smoothed, algebraic"]
        found = [best_width(here, e) for e in errors]
        if any(found):
            numbers = [(*p.setting, milliseconds(p.seconds)) if p else () for p in found]
            cells = ["{:.0e}, {:.0e}, {} ms".format(*three) if three else "" for three in numbers]
            lines.append(f"| {reading.points.references[case]['title']} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def page(points, content):
    """The page's text."""
    reading = Reading(points)
    known = content["provenance"]["versions"]
    absent = sorted({p.method for p in points if p.note.startswith("not installed")})
    versions = ", ".join(f"{k} {v}" for k, v in known.items() if v)
    tuned = "\n".join(
        f"| {name} | {entry['knob']} | {entry['options']} |"
        for name, entry in content["data"]["methods"].items()
        if entry["options"]
    )
    parts = [
        "<!-- Written by experiments/work_precision_reading.py from experiments/results/work_precision.json. -->",
        "# Which method for which job",
        "Every sentence below is computed from the measurements of `experiments/work_precision.py`: "
        f"{len(reading.cases)} scenes whose answers are known (a closed form, or two methods without common code that "
        "agree to 1e-9), every method at many settings, processor time without compilation. Errors are those of the "
        "state, in units of its size, the largest over three instants; a run with another sequence of crossings, "
        "sticks, slips and impacts than the reference's counts as wrong, whatever its error.",
        "![Error against processor time, a panel a scene](../experiments/results/work_precision.png)",
        "\n".join(f"{i}. {text}" for i, text in enumerate(sentences(reading), 1)),
        "## The rows behind the sentences",
        *(f"Milliseconds to an error of {power(e)}; blank: not reached.\n\n{table(reading, e)}" for e in ERRORS[1:]),
        "Evaluations of the right-hand side tell what is left without the interpreter (a Taylor polynomial of order K "
        "counts K + 1):",
        "![Error against evaluations](../experiments/results/work_precision_evaluations.png)",
        "## The order of the event-driven path",
        "![Time at fixed orders over that at the chosen one](../experiments/results/work_precision_orders.png)",
        "## The smoothed path: which ε for which error",
        "The cheapest (ε, rtol, time) within each error:",
        widths(reading),
        "![The cheapest ε against the error](../experiments/results/work_precision_eps.png)",
        "## How they were tuned",
        f"| method | knob | options |\n| --- | --- | --- |\n{tuned}",
        (f"Not installed when this was measured: {', '.join(absent)}. " if absent else "") + f"Versions: {versions}.",
        "Measure your own scene: `pwsmooth.compare.work_precision(scene)`, with a `reference` or with two methods that "
        "have to agree.",
    ]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def write_reading():
    """Writes the page."""
    PAGE.write_text(page(*load()))
    print(f"written: {PAGE.name}")


if __name__ == "__main__":
    write_reading()
