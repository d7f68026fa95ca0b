"""Verdicts: the package's run of a case beside the oracle's.

right          equal within the tolerance
refused        the run stopped with an outcome that says so
recorded       different, behind an ambiguity that the run recorded
undecided      the oracle does not judge (it met what has no unique continuation, or what it does not know)
ill            different, and so is the oracle itself after a change of start and parameters by the tolerance
WRONG          a wrong number without a word
Chain: models.py -> judging.py (here) -> the fuzzers.
"""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections import Counter
from dataclasses import dataclass

import numpy as np

from pwsmooth import solve

from .models import answer

RIGHT, REFUSED, RECORDED, UNDECIDED, ILL, WRONG = "right", "refused", "recorded", "undecided", "ill", "WRONG"

TOO_SLOW = "reference too slow"  # the reason of a case that the reference gives up

STEPS = 200_000  # more than any case of these spans needs

SECONDS = Counter()  # by part of the work
_parts, _since = ["rest"], time.monotonic()


def _turn():
    global _since
    now = time.monotonic()
    SECONDS[_parts[-1]] += now - _since
    _since = now


@contextlib.contextmanager
def timed(part):
    """Counts the seconds of what is done inside for this part, and not for the one around it."""
    _turn()
    _parts.append(part)
    try:
        yield
    finally:
        _turn()
        _parts.pop()


def spent():
    """Seconds by part since the last call."""
    _turn()
    found = {part: round(seconds, 3) for part, seconds in SECONDS.items()}
    SECONDS.clear()
    return found


@dataclass
class Verdict:
    """A verdict, its reason, and what it was judged by."""

    kind: str
    reason: str = ""
    error: float = 0.0
    tags: int = 0
    script: str = ""


def tolerance(options, scale):
    """An error that needs no explanation; a larger one must be the motion's own sensitivity (`spread`)."""
    rtol = min(options.get("rtol", 1e-9), 1e-6)
    return 100 * (rtol + options.get("atol", 1e-12)) * scale + 1e-9 * scale


def spread(model, case, tag, size, tries=5):
    """Largest change of the oracle's states when start and parameters move by `size`; inf if it always stops sooner."""
    base = answer(model, case).states[: tag + 1]
    random = np.random.default_rng(0)
    largest = -1.0
    moves = np.ones(len(case.p))
    if case.closed:  # what is closed at the start stays so
        moves[[q for gap in model.gaps for _, q, _ in gap if q is not None]] = 0
    for _ in range(tries):
        moved = dataclasses.replace(
            case,
            p=case.p * (1 + size * moves * random.uniform(-1, 1, len(case.p))),
            start=case.start
            + size * random.uniform(-1, 1, len(case.start)) * (case.start != 0) * (not case.closed),
            w=case.w * (1 + size * random.uniform(-1, 1)),
        )
        other = answer(model, moved).states[: tag + 1]
        if not np.isfinite(other).all():
            continue  # one that stops says nothing of the others: it must not excuse a wrong number
        largest = max(largest, float(np.max(np.abs(other - base))))
    return largest if largest >= 0 else np.inf


def judge(model, case, solution, expected):
    """The verdict on a solution at `case.instants`."""
    judged = int(np.isfinite(expected.states).all(axis=1).sum())
    if judged == 0:
        return Verdict(UNDECIDED, f"oracle {expected.code}", tags=expected.tags)
    got = solution.x.T[:judged]
    times = solution.t[:judged]
    arrived = len(got) == judged and np.array_equal(times, case.instants[:judged])
    if not arrived:
        # Where the run stopped before what is judged, it has said so; a success has not.
        if solution.success:
            return Verdict(WRONG, f"{solution.outcome.name}, but ends early", tags=expected.tags)
        return Verdict(REFUSED, solution.outcome.name, tags=expected.tags)
    want = expected.states[:judged]
    scale = 1 + float(np.max(np.abs(want)))
    error = np.max(np.abs(got - want), axis=1)
    allowed = tolerance(case.options, scale)
    if np.all(error <= allowed):
        # A run may stop where the oracle judges no longer.
        return Verdict(RIGHT, error=float(error.max() / scale), tags=expected.tags)
    first = int(np.argmax(~(error <= allowed)))
    worst = float(error[first])
    if any(a.time <= case.instants[first] for a in solution.ambiguities):
        return Verdict(RECORDED, solution.ambiguities[0].kind, worst, expected.tags)
    size = min(case.options.get("rtol", 1e-9), 1e-6) + case.options.get("atol", 1e-12) + 1e-12
    if np.isfinite(worst):
        moved = spread(model, case, first, size)
        if worst <= 10 * moved:
            return Verdict(ILL, "" if np.isfinite(moved) else "oracle stops", worst, expected.tags)
    return Verdict(WRONG, solution.outcome.name, worst, expected.tags)


@dataclass
class Played:
    """A structure, compiled: what its cases share."""

    module: object
    model: object
    system: object
    known: set


def compiled(module, seed):
    """The structure of this seed."""
    model = module.structure(seed)
    return Played(module, model, *model.system())


def play(played, seed):
    """The verdict on one case."""
    case = played.module.case(played.model, seed)
    expected = answer(played.model, case)
    try:
        solution = solve(  # the name of this module, in which faults are planted

            played.system, (case.t0, float(case.instants[-1])), case.start.tolist(), t_eval=case.instants,
            parameters=case.parameters(played.known), max_steps=STEPS, **case.options,
        )  # fmt: skip
    except Exception as error:  # what a solve raises is a finding
        return Verdict(WRONG, f"raised {type(error).__name__}: {error}"[:200], tags=expected.tags)
    return judge(played.model, case, solution, expected)
