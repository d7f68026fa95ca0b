"""Where does each method break, and how? Maps of hazards, with the border that theory draws over the measured one.

Every hazard is a plane: the ratio that decides (a step, a tolerance, a distance) against a circumstance. A method is
run at every point, and each run is put into one way of failing by the rules of pwsmooth/compare/hazards/failures.py.
Runs are bounded in evaluations, so that a stall is seen as one.

Expected: explicit steps fail at the border of linear theory; error control alone steps over layers that are thinner
than the tolerance; methods that look for a change of sign miss pairs of crossings; a bare sign stalls; this package's
two paths are right on every map, or say that they cannot decide.

Usage: python experiments/stability.py [--fast] [--only HAZARD ...] [--out DIR] [--draw FILE.json]

--only computes some hazards anew and keeps the others of the data file.
"""

from __future__ import annotations

import argparse
import io
import json
from pathlib import Path

from benchtools import provenance, write_json
from studytools import RESULTS, claim

from paper_figures.claims import counted
from pwsmooth import plotting
from pwsmooth.compare.hazards import HAZARDS, StabilityMap, stability
from pwsmooth.compare.hazards.charts import page
from pwsmooth.results.files import write_whole

QUESTION = "Where does each method break on nonsmooth systems, and how?"
EXPECTED = (
    "Explicit steps at the border of linear theory; error control alone where layers are thinner than the tolerance; "
    "searches for a change of sign at pairs of crossings; a bare sign in every stick; this package's own paths nowhere."
)
OURS = ("event-driven", "event-driven, layered", "smoothed path")
# The smoothed system itself, however well it is integrated, has another answer than the limit there.
STAND_IN = tuple((name, "smoothed path") for name in ("near-fold", "noise", "long-stick"))
ON_FIRST = 10  # maps on the first page: as many bands as on the second
LINEAR = ("lugre", "dai-friction", "dai-contact", "stiff-contact")


def claims(records):
    """What the maps say, as Claims."""
    maps = {record["name"]: StabilityMap.from_record(record) for record in records}
    found = []
    for one in maps.values():
        for method in (m for m in OURS if m in one.methods and (one.name, m) not in STAND_IN):
            failures = int(one.failed(method).sum())
            recorded = one.tally(method).get("recorded", 0)
            ours = f"{failures} of {int(one.total(method).sum())} fail" + (
                f", {recorded} recorded" * bool(recorded)
            )
            found.append(
                claim(f"{one.title}: {method} is right or says that it cannot decide.", "no failure", ours,
                      failures == 0, "see the map")
            )  # fmt: skip
    pairs = [(name, method) for name in LINEAR for method in ("explicit Euler", "Runge-Kutta 4")]
    for name, method in (*pairs, *STAND_IN):
        if name in maps:
            share = maps[name].agreement(method)
            found.append(
                claim(f"{maps[name].title}: {method} fails where theory says.", "on 95 % of the map",
                      f"on {100 * share:.0f} %", share >= 0.95, "see the map")
            )  # fmt: skip
    return [c.record() for c in found]


def content_of(records, versions):
    """The data file."""
    ordered = [records[name] for name in HAZARDS if name in records]
    return {
        "study": "stability",
        "question": QUESTION,
        "expected": EXPECTED,
        "fast": any(record["fast"] for record in ordered),
        "data": {"maps": ordered},
        "claims": claims(ordered),
        "cpu_seconds": round(sum(record["seconds"] for record in ordered), 1),
        "provenance": versions,
    }


def write_charts(records, folder):
    """Two pages of the maps; `StabilityMap.chart` draws each from the data."""
    maps = [StabilityMap.from_record(record) for record in records]
    with plotting.style():
        for name, part in (("", maps[:ON_FIRST]), ("_2", maps[ON_FIRST:])):
            if part:
                save(page(part), folder / f"stability{name}.png")


def save(figure, target):
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    write_whole(target, buffer.getvalue())


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=QUESTION)
    parser.add_argument("--fast", action="store_true", help="coarser, in seconds")
    parser.add_argument("--only", nargs="+", choices=list(HAZARDS), metavar="HAZARD", help=", ".join(HAZARDS))
    parser.add_argument("--out", type=Path, default=RESULTS, help="directory of the data and the charts")
    parser.add_argument("--draw", type=Path, metavar="FILE.json", help="judge and draw again from a data file")
    options = parser.parse_args()
    target = options.draw or options.out / "stability.json"
    target.parent.mkdir(parents=True, exist_ok=True)
    old = json.loads(target.read_text()) if target.exists() and (options.draw or options.only) else None
    records = {record["name"]: record for record in old["data"]["maps"]} if old else {}
    if not options.draw:
        for name in options.only or HAZARDS:
            records[name] = stability(name, fast=options.fast).record() | {"fast": options.fast}
            print(f"{name:20} {records[name]['seconds']:6.1f} s", flush=True)
            # After every hazard: what was computed survives an interruption.
            write_json(target, content_of(records, provenance()))
    content = content_of(records, old["provenance"] if options.draw else provenance())
    write_json(target, content)
    write_charts(content["data"]["maps"], target.parent)
    for one in content["claims"]:
        if not one["holds"]:
            print(f"- {one['claim']} found {one['ours']}: {one['verdict']}")
    print(f"{counted(content['claims'])}; {content['cpu_seconds']} s; written to {target.parent}")


if __name__ == "__main__":
    main()
