"""python -m tests.fuzz NAME --cases N --structures K --seed S --resume FILE: counts verdicts, keeps failing seeds.

Chain: the fuzzers -> __main__.py.
"""

from __future__ import annotations

import argparse
import importlib
import json
import multiprocessing
import sys
import time
from collections import Counter
from pathlib import Path

from . import judging, planted

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
SLOW = 5.0  # seconds of a case that are reported


def one_structure(name, seed, number, cases):
    """Counts and failures of one structure's cases, as JSON has them."""
    began = time.monotonic()
    module = importlib.import_module(f".{name}", __package__)
    counts, failures, slow, examples = Counter(), [], [], {}
    key = seed * 100_000 + number
    try:
        played = getattr(module, "compiled", judging.compiled)(module, key)
    except Exception as error:  # a model that the package refuses to build is a finding
        text = f"structure raised {type(error).__name__}: {error}"
        return {
            "structure": number,
            "counts": {judging.WRONG: cases},
            "failures": [[key, -1, text[:300], 0, 0]],
        }
    play = getattr(module, "play", judging.play)
    for i in range(cases):
        before = time.monotonic()
        verdict = play(played, key * 1000 + i)
        what = " ".join(filter(None, (verdict.kind, verdict.reason)))[:60]
        counts[what] += 1
        if verdict.kind != judging.RIGHT:
            examples.setdefault(what, [key, key * 1000 + i])
        if verdict.kind == judging.WRONG:
            failures.append([key, key * 1000 + i, verdict.reason, verdict.error, verdict.tags])
        if time.monotonic() - before > SLOW and i:
            slow.append([key, key * 1000 + i, round(time.monotonic() - before, 1)])
    return {"structure": number, "counts": counts, "failures": failures, "slow": slow, "examples": examples,
            "seconds": time.monotonic() - began}  # fmt: skip


def _task(arguments):
    return one_structure(*arguments)


def fuzz(name, cases, structures, seed, resume=None, jobs=1, numbers=None):
    """Counts of verdicts, failures, an example of each kind; `resume` is a file with a line a structure.

    `numbers` are those of the structures that are played, where not all are.
    """
    each = min(999, -(-cases // structures))
    done = {}
    if resume and Path(resume).exists():
        for line in Path(resume).read_text().splitlines():
            found = json.loads(line)
            if found["run"] == [name, seed, each]:
                done[found["structure"]] = found
    left = [(name, seed, k, each) for k in numbers or range(structures) if k not in done]
    counts, failures, examples = Counter(), [], {}
    for found in done.values():
        counts.update(found["counts"])
        failures += found["failures"]
        examples = found.get("examples", {}) | examples

    def take(found):
        counts.update(found["counts"])
        failures.extend(found["failures"])
        for what, where in found.get("examples", {}).items():
            examples.setdefault(what, where)
        for item in found.get("slow", []):
            print("slow", *item, flush=True)
        if resume:
            with open(resume, "a") as file:
                file.write(json.dumps(found | {"run": [name, seed, each]}) + "\n")

    if jobs == 1:
        for arguments in left:
            take(_task(arguments))
    else:
        with multiprocessing.get_context("spawn").Pool(jobs) as pool:
            for found in pool.imap_unordered(_task, left):
                take(found)
    return counts, failures, examples


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
    parser.add_argument("--jobs", type=int, default=1)
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
    counts, failures, examples = fuzz(
        given.name, given.cases, given.structures, given.seed, given.resume, given.jobs
    )
    for kind, count in counts.most_common():
        print(f"{count:8d}  {kind}", *("--show", *examples[kind]) if kind in examples else ())
    module = importlib.import_module(f".{given.name}", __package__)
    if hasattr(module, "table"):
        print(module.table(given.seed * 100_000 + k for k in range(given.structures)))
    for structure, seed, reason, error, tags in failures[:20]:
        print(f"  --show {structure} {seed}: {reason}, error {error:.3g}, tags {tags}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
