"""Compositions: models drawn from the grammar of the whole notation, where two and three pieces meet.

    python -m tests.fuzz compose --cases 50000 --structures 3000 --resume FILE

Each case is run twice, by another method or as the same model written otherwise, and held against the reference, a
simulator written from docs/event_contract.md. WRONG is a run that two others contradict, the reference among them
where it judges, without an ambiguity, where the motion's condition number is below 1000.
Chain: judging.py -> grammar.py -> reference.py, plain.py, relations.py -> **here** -> shrinking.py; __main__.py.
"""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections import Counter
from dataclasses import dataclass

import numpy as np

from pwsmooth.codegen.machine import clock
from pwsmooth.paths.derivatives import NoDerivative

from .. import judging
from ..judging import ILL, RECORDED, REFUSED, RIGHT, TOO_SLOW, UNDECIDED, WRONG, Verdict, timed
from . import plain, reference, relations
from .grammar import PIECES, Style, Writer, case, structure

TITLE = "compositions"
ERROR = 1e-6  # of states, relative to their size
CONDITION = 1e3
BY = 1e-7  # how far a case is moved to see its condition
AS_IS = Style()
# Reasons for which the reference does not judge and that leave more than one motion.
OPEN = (
    "several assignments",
    "conflicting updates",
    "Heaviside(0)",
    "an update reads a switch at its zero",
    "an update that ends on a surface",
    "a slide that repels",
    "several impulses",
    "an event at the end",
    "an impact at the end",
)
__all__ = ["case", "compiled", "play", "script", "structure", "table"]


@dataclass
class Structure:
    """A model, compiled in the plain way; other ways are compiled when they are played."""

    model: object
    smooth: object
    systems: dict

    def system(self, style):
        if style not in self.systems:
            with timed("models"):
                self.systems[style] = relations.written(self.model, style)
        return self.systems[style]


@dataclass
class Run:
    """A run in the model's units; `outcome` is a name, or what was raised."""

    name: str
    outcome: str
    success: bool
    values: np.ndarray
    end: float
    ambiguities: list
    moves: tuple | None = None

    def said_before(self, t):
        """The first ambiguity up to a time, or None."""
        return next((kind for at, kind in self.ambiguities if at <= t + 1e-9), None)


def compiled(_, seed):
    """The structure of this seed."""
    return build(structure(seed))


def build(model):
    """A model, compiled."""
    built = Structure(model, answered(reference.Smooth, model), {})
    built.system(AS_IS)
    return built


def answered(function, *arguments):
    """What the reference says."""
    with timed("reference"):
        return function(*arguments)


def ways(model, seed):
    """Names of the second and the third way in which a case is run."""
    r = np.random.default_rng([103, seed])
    # The clock of `every` strikes at multiples of the period from t = 0 on, whatever the shift.
    fixed = any(event.every is not None for event in model.events)
    names = [name for name in relations.STYLES if not (fixed and name == "shifted")]
    if model.family is None:
        names.remove("written out")
    # One relation a structure: each is compiled.
    relation = names[(seed // 1000) % len(names)]
    # The pair's steps are not known beside a Disc: the others are shorter there.
    method = "short steps" if model.discs else "rk"
    draw = r.random()
    if draw < 0.4:
        return relation, method
    return (method if draw < 0.7 else str(r.choice(["stiff", "split", "derivatives"]))), relation


def run(played, one, way):
    """One case in one way: "auto", another method, in two spans, with derivatives, or a relation."""
    with timed("solves"):
        began, running = time.monotonic(), clock.now()
        found = _run(played, one, way)
        made = time.monotonic() - began - (clock.now() - running)
    judging.SECONDS["code"] += made  # derived and compiled in the first of the solves
    judging.SECONDS["solves"] -= made
    return found


def _run(played, one, way):
    style = relations.STYLES.get(way, AS_IS)
    options = {"max_steps": 20_000, "max_seconds": 20}
    if way in ("rk", "stiff"):
        options["method"] = way
    elif way == "short steps":
        options["max_step"] = 0.03
    elif way == "derivatives" and played.system(AS_IS)[1]:
        options["by"] = sorted(played.system(AS_IS)[1])[:1]
    shape = (len(one.instants), len(one.start) + len(played.model.memories))
    try:
        system, known = played.system(style)
        span, start, options = relations.call(played.model, one, style, known, options)
        if way == "split":
            return _split(played, one, system, span, start, options)
        solution = judging.solve(system, span, start, **options)
    except ValueError:
        if way != "stiff":
            raise
        return _run(played, one, "short steps")  # what slides or has contacts has no implicit steps
    except Exception as error:  # what a solve raises is a finding
        words = f"raised {type(error).__name__}: {error}"
        return Run(way, words[:160], False, np.full(shape, np.nan), np.nan, [])
    times, values = relations.values(played.model, one, style, solution)
    said = [(a.time / style.pace - style.shift, a.kind) for a in solution.ambiguities]
    found = Run(way, solution.outcome.name, solution.success, values, float(times[-1]), said)
    if "by" in options and solution.outcome.name == "FINISHED":
        found.moves = _moves(played.model, solution, options["by"][0])
    return found


def _moves(model, solution, name):
    """(parameter, derivatives of the states at the end by it), or None of a run that says that there are none."""
    try:
        return int(name[1:]), [float(solution.derivatives[state][0, -1]) for state in model.states]
    except NoDerivative:
        return None


def _split(played, one, system, span, start, options):
    """A run over the span in two: the second continues the first."""
    wanted = options.pop("t_eval")
    middle = len(wanted) // 2
    first = judging.solve(system, (span[0], wanted[middle]), start, t_eval=wanted[: middle + 1], **options)
    runs = [first]
    if first.outcome.name == "FINISHED":
        runs.append(
            judging.solve(system, (wanted[middle], span[1]), first, t_eval=wanted[middle + 1 :], **options)
        )
    values, said = None, []
    for solution in runs:
        times, found = relations.values(played.model, one, AS_IS, solution)
        values = found if values is None else np.where(np.isnan(values), found, values)
        said += [(a.time, a.kind) for a in solution.ambiguities]
    return Run("split", runs[-1].outcome.name, runs[-1].success, values, float(times[-1]), said)


@dataclass
class Finding:
    """How a run differs from what is expected: a kind of verdict, why, by how much, and from when on."""

    kind: str
    reason: str = ""
    error: float = 0.0
    since: float = np.inf


def compare(one, got, values, end, judged):
    """A run beside expected values, of which the first `judged` rows count, and the expected end."""
    if got.outcome.startswith("raised"):
        return Finding(WRONG, got.outcome, np.inf)
    size = 1 + float(np.nanmax(np.abs(values[:judged]), initial=0.0))
    for k in range(judged):
        t = one.instants[k]
        if np.isnan(got.values[k]).all() and not (got.success and end < np.inf):
            if not got.success:
                return Finding(REFUSED, got.outcome)
            return _said(got, t, f"{got.outcome}, but ends early", np.inf)
        error = float(np.max(np.abs(got.values[k] - values[k])))
        if not error <= ERROR * size:
            return _said(got, t, "states", error)
    if not got.success:
        return Finding(REFUSED, got.outcome)
    if end < np.inf and not abs(got.end - end) <= ERROR * (1 + abs(end)):
        return _said(got, end, "the end", abs(got.end - end))
    if judged == len(one.instants) and got.outcome == "TERMINATED":
        return _said(got, got.end, "terminated", np.inf)
    return Finding(RIGHT)


def _said(got, t, reason, error):
    said = got.said_before(t)
    return Finding(RECORDED, said, error, t) if said else Finding(WRONG, reason, error, t)


def play(played, seed):
    """The verdict on one case."""
    return judge(played, case(played.model, seed), ways(played.model, seed))


def judge(played, one, others):
    """The verdict on the numbers of a case, run as it is and in two other ways."""
    expected = answered(reference.answer, played.smooth, one)
    if expected.reason == reference.TOO_SLOW:
        return Verdict(UNDECIDED, TOO_SLOW)
    judged = int((~np.isnan(expected.values).any(axis=1)).sum())
    if "flat" in expected.marks:  # sign(0) is 0, where a Piecewise in its place is one of its branches
        method = "short steps" if played.model.discs else "rk"
        others = [name for name in (*others, method) if name != "in other switches"]
    runs = [run(played, one, "auto"), run(played, one, others[0])]
    ended = expected.end < np.inf
    found = [compare(one, each, expected.values, expected.end, judged) for each in runs]
    for kind in (WRONG, REFUSED, RECORDED):
        for k, finding in enumerate(found):
            if finding.kind != kind:
                continue
            words = f"{runs[k].name}: {finding.reason}"
            if finding.reason == "EVENTS_ACCUMULATE" and is_limit(expected.log, runs[k].end):
                continue
            if kind != WRONG or finding.reason.startswith("raised"):
                return Verdict(kind, words, finding.error)
            if not confirmed(played, one, expected, runs, found, k, others[1]):
                return Verdict(UNDECIDED, "not confirmed", finding.error)
            if condition(played, one, expected, judged) > CONDITION:
                return Verdict(ILL, words, finding.error)
            return Verdict(WRONG, words, finding.error)
    if judged == len(one.instants) or ended:
        return moved(played, one, expected, runs) if runs[1].moves and not ended else Verdict(RIGHT)
    return beside(played, one, expected, runs, judged, others[1])


def is_limit(log, end):
    """Whether the last event of a log comes ever sooner, by a ratio that leads it to `end`."""
    times = [t for t, number in log if number == log[-1][1]][-3:]
    if len(times) < 3:
        return False
    before, last = times[1] - times[0], times[2] - times[1]
    return 0 < last < before and abs(times[2] + last / (before / last - 1) - end) < last / 2


def moved(played, one, expected, runs):
    """The verdict on derivatives at the end, beside differences of the reference and of the run."""
    k, found = runs[1].moves
    n, h = len(one.start), 1e-5
    cases = [dataclasses.replace(one, p=[v + s * h * (i == k) for i, v in enumerate(one.p)]) for s in (-1, 1)]
    answers = [answered(reference.answer, played.smooth, each) for each in cases]
    again = [run(played, each, "auto") for each in cases]
    logs = [[number for _, number in each.log] for each in (expected, *answers)]
    ends = [np.array([each.values[-1][:n] for each in two]) for two in (answers, again)]
    if logs[0] != logs[1] or logs[0] != logs[2] or not all(np.isfinite(two).all() for two in ends):
        return Verdict(RIGHT)
    differences = [(two[1] - two[0]) / (2 * h) for two in ends]
    bend = np.abs(ends[0][1] + ends[0][0] - 2 * expected.values[-1][:n]).max() / h
    size = 1 + np.abs(differences[0]).max()
    errors = [float(np.abs(each - found).max() / size) for each in differences]
    if (
        max(errors) <= 1e-3 or bend > 1e-2 * size or runs[1].ambiguities
    ):  # a bend: a start on a surface, a touch
        return Verdict(RIGHT, "derivatives")
    return Verdict(WRONG if min(errors) > 1e-3 else UNDECIDED, "derivatives: of the end", max(errors))


def confirmed(played, one, expected, runs, found, k, third):
    """Whether something besides the reference contradicts a run: another run, or a plain simulator."""
    since = found[k].since
    rows = sum(t <= since for t in one.instants)
    for other in [runs[1 - k], None]:
        other = other or run(played, one, third)
        if compare(one, other, expected.values, expected.end, rows).kind == RIGHT:
            return True
    with timed("plain"):
        values = plain.values(played.smooth, one, since)
    if values is None or rows == 0 or np.isnan(values[rows - 1]).any():
        return False
    row = rows - 1
    if np.isnan(expected.values[row]).any() or np.isnan(runs[k].values[row]).any():
        return False
    near = np.max(np.abs(values[row] - expected.values[row]))
    far = np.max(np.abs(values[row] - runs[k].values[row]))
    return bool(near < far / 4)


def condition(played, one, expected, judged):
    """Median growth of a small change of one number of the case."""
    found = []
    r = np.random.default_rng(0)
    for _ in range(5):
        moved = dataclasses.replace(one, p=list(one.p), start=list(one.start))
        numbers = moved.start if r.random() < 0.5 or not one.p else moved.p
        i = int(r.integers(len(numbers)))
        numbers[i] *= 1 + BY
        other = answered(reference.answer, played.smooth, moved).values[:judged]
        if np.isfinite(other).all():
            found.append(float(np.max(np.abs(other - expected.values[:judged]), initial=0.0)) / BY)
    return float(np.median(found)) if found else np.inf


def beside(played, one, expected, runs, judged, third):
    """Where the reference does not judge to the end: both runs beside each other."""
    silent = all(each.success and not each.ambiguities for each in runs)
    size = 1 + float(np.nanmax(np.abs(runs[0].values), initial=0.0))
    if silent and not _same(*runs, size):
        if expected.reason in OPEN:  # the model allows both, which neither has recorded
            return Verdict(UNDECIDED, f"runs differ in silence: {expected.reason}")
        other = run(played, one, third)
        same = [not other.ambiguities and _same(other, each, size) for each in runs]
        if sum(same) != 1:
            return Verdict(UNDECIDED, f"runs differ, not confirmed: {expected.reason}")
        return Verdict(WRONG, f"{runs[same.index(False)].name}: beside two others ({expected.reason})")
    if judged:
        return Verdict(RIGHT, f"up to {expected.reason}")
    return Verdict(UNDECIDED, expected.reason)


def _same(a, b, size):
    error = np.nanmax(np.abs(a.values - b.values), initial=0.0)
    return a.outcome == b.outcome and bool(error <= ERROR * size)


def table(keys):
    """In how many of these structures each pair of pieces has met: the rarest pairs, and each piece alone."""
    alone, pairs = Counter(), Counter()
    for key in keys:
        pieces = sorted(structure(key).pieces)
        alone.update(pieces)
        pairs.update(itertools.combinations(pieces, 2))
    every = {pair: pairs[pair] for pair in itertools.combinations(sorted(PIECES), 2)}
    rarest = sorted(every.items(), key=lambda item: item[1])
    lines = ["pieces, in structures: " + ", ".join(f"{name} {alone[name]}" for name in sorted(PIECES))]
    lines.append(
        f"pairs: {len(every)}, of which {sum(n < 100 for n in every.values())} in fewer than 100 structures"
    )
    lines += [f"{n:8d}  {a} x {b}" for (a, b), n in rarest[:12]]
    return "\n".join(lines)


def script(number, seed):
    """A case as a program, and the smallest that is found to be wrong as well."""
    from .shrinking import shrunk

    model = structure(number)
    return shrunk(model, case(model, seed), ways(model, seed))


def program(played, one, ways_):
    """A program that shows a case."""
    expected = answered(reference.answer, played.smooth, one)
    known = played.system(AS_IS)[1]
    span, start, options = relations.call(played.model, one, AS_IS, known, {})
    wanted = options.pop("t_eval").tolist()
    rows = [[None if np.isnan(v) else round(float(v), 9) for v in row] for row in expected.values.T]
    lines = [
        Writer(played.model, AS_IS).text(),
        f"s = solve(S, {span}, {start}, t_eval={wanted}, parameters={options['parameters']})",
        "print(s.outcome.name, s.ambiguities, list(s.events))",
        "print(s.x.round(9).tolist())",
        f"# reference: {rows} {expected.reason}, end {expected.end}, events {expected.log}",
    ]
    for way in ("auto", *ways_):
        got = run(played, one, way)
        lines.append(f"# {way}: {got.outcome}, {got.values.T.round(9).tolist()}, {got.ambiguities}")
    return "\n".join(lines)
