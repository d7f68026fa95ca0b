"""python -m tests.fuzz NAME --cases N --structures K --seed S --resume FILE: counts verdicts, keeps failing seeds.

Chain: the fuzzers -> playing.py -> __main__.py.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from . import judging, planted
from .playing import one_structure, played_apart

NAMES = (
    "affine",
    "contacts",
    "resets",
    "hidden",
    "smooth",
    "invariance",
    "discs",
    "lines",
    "assemblies",
    "links",
    "loops",
    "layers",
    "noises",
    "compose",
)
OF_DERIVATIVES = ("slopes", "differences", "gradients")
KINDS = (
    judging.WRONG,
    judging.ILL,
    judging.UNDECIDED,
    judging.REFUSED,
    "justly",
    judging.RECORDED,
    judging.RIGHT,
)
SHOWN = {judging.UNDECIDED: "not judged", "justly": "justly refused"}


@dataclass
class Tally:
    """What was found: counts and an example of each kind of verdict, failures, slow cases, seconds by part."""

    structures: int = 0
    counts: Counter = field(default_factory=Counter)
    failures: list = field(default_factory=list)
    examples: dict = field(default_factory=dict)
    too_slow: list = field(default_factory=list)  # (structure, case) that were given up
    seconds: Counter = field(default_factory=Counter)

    def add(self, found):
        """What was found in one structure, as JSON has it."""
        self.structures += 1
        self.counts.update(found["counts"])
        self.failures += found["failures"]
        self.too_slow += found.get("too slow", [])
        self.examples = found.get("examples", {}) | self.examples
        self.seconds.update(found.get("parts", {"all": found.get("seconds", 0.0)}))

    def __str__(self):
        cases, seconds = sum(self.counts.values()), sum(self.seconds.values())
        wrong = sum(n for kind, n in self.counts.items() if kind.startswith(judging.WRONG))
        parts = ", ".join(f"{part} {taken:.0f}" for part, taken in self.seconds.most_common())
        lines = [
            f"{cases} cases, {self.structures} structures, {wrong} {judging.WRONG}",
            f"{seconds:.0f} seconds, {seconds / max(cases, 1):.3f} a case: {parts}",
        ]
        for kind in KINDS:
            of_kind = [(what, n) for what, n in self.counts.most_common() if what.split()[0] == kind]
            if of_kind:
                lines.append(f"{sum(n for _, n in of_kind):8d}  {SHOWN.get(kind, kind)}")
            for what, n in of_kind:
                shown = (
                    (" ".join(map(str, ("  --show", *self.examples[what])))) if what in self.examples else ""
                )
                lines.append(f"{n:12d}  {what.removeprefix(kind).strip() or kind}{shown}")
        if self.too_slow:
            lines.append(f"too slow, --show: {', '.join(f'{k} {i}' for k, i in self.too_slow)}")
        return "\n".join(lines)


def fuzz(name, cases, structures, seed, resume=None, jobs=0, numbers=None):
    """The Tally; `resume` is a file with a line a structure, `jobs` the number of other processes that play.

    `numbers` are those of the structures that are played, where not all are.
    """
    each = min(999, -(-cases // structures))
    tally, done = Tally(), set()
    if resume and Path(resume).exists():
        for line in Path(resume).read_text().splitlines():
            found = json.loads(line)
            if found["run"] == [name, seed, each] and found["structure"] not in done:
                done.add(found["structure"])
                tally.add(found)
        print(f"done before: {tally}", flush=True)
    left = [(name, seed, k, each) for k in numbers or range(structures) if k not in done]

    def take(found):
        tally.add(found)
        for item in found.get("slow", []):
            print("slow", *item, flush=True)
        if resume:
            with open(resume, "a") as file:
                file.write(json.dumps(found | {"run": [name, seed, each]}) + "\n")

    for found in played_apart(left, jobs) if jobs else (one_structure(*arguments) for arguments in left):
        take(found)
    return tally


def show(name, structure, seed):
    """The script of a case, with what the oracle expects."""
    module = importlib.import_module(f".{name}", __package__)
    if hasattr(module, "script"):
        return module.script(structure, seed)
    from .models import answer, script

    model = module.structure(structure)
    case = module.case(model, seed)
    expected = answer(model, case, 100)
    note = f"# oracle: code {expected.code} at t = {expected.reached:.9g}, tags {expected.tags}"
    return "\n".join([script(model, case, expected.states), note])


def main(arguments=None):
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("name", nargs="?", choices=NAMES + OF_DERIVATIVES)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--structures", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--resume", help="file of what is done")
    parser.add_argument("--jobs", type=int, default=1, help="processes that play")
    parser.add_argument(
        "--show", nargs=2, type=int, metavar=("STRUCTURE", "CASE"), help="print a case as a script"
    )
    parser.add_argument("--self-test", action="store_true", help="plant faults: every fuzzer must see them")
    given = parser.parse_args(arguments)
    if given.self_test:
        return planted.main([given.name] if given.name else NAMES)
    if not given.name:
        parser.error("give a NAME or --self-test")
    if given.show:
        print(show(given.name, *given.show))
        return 0
    tally = fuzz(given.name, given.cases, given.structures, given.seed, given.resume, given.jobs)
    print(tally)
    module = importlib.import_module(f".{given.name}", __package__)
    if hasattr(module, "table"):
        print(module.table(given.seed * 100_000 + k for k in range(given.structures)))
    for structure, seed, reason, error, tags in tally.failures[:20]:
        print(f"  --show {structure} {seed}: {reason}, error {error:.3g}, tags {tags}")
    return 1 if tally.failures else 0


if __name__ == "__main__":
    sys.exit(main())
