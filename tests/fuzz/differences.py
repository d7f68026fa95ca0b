"""Derivatives of nonlinear scenes against Ridders' extrapolated differences, and backward against forward.

Differences are taken of runs at 1e-13 whose events come in the same order at all points of a tableau, and of times and
states that no event passes between its points; a tableau says itself how unsure it is. What fails is looked at again
with other steps before it is called wrong. A refusal is justified where a difference finds none either.
Source: Ridders, Accurate computation of F'(x) and F'(x) F''(x), Adv. Eng. Softw. 4 (1982) 75.
Chain: scenes.py, judging.py -> differences.py (here) -> __main__.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pwsmooth.paths.derivatives.of_solution import NoDerivative
from pwsmooth.paths.derivatives.tangents import Readings

from . import judging, scenes
from .judging import RIGHT, UNDECIDED, WRONG, Verdict

TITLE = "derivatives of nonlinear scenes"
TIGHT = {"rtol": 1e-13, "atol": 1e-16, "max_steps": judging.STEPS}
_LEVELS = 8
_RATIO = 1.6  # of one step to the next
_FIRST = 0.01  # of the range of a quantity: the largest step
_ASKED = 3  # quantities of a case that are differenced


@dataclass
class Look:
    """What is differenced of a run: its signature, and numbers by it."""

    signature: tuple
    numbers: np.ndarray
    kept: list


@dataclass
class Case:
    """Values of quantities, the span, times, seed of the noise, and by which quantities is differenced."""

    values: dict
    span: tuple
    times: np.ndarray
    seed: int
    asked: list


def compiled(_, number):
    """The scene of a structure's number."""
    found = scenes.all_scenes()
    return found[number % len(found)]


def case(scene, seed):
    """Random numbers for a scene."""
    r = np.random.default_rng([31, seed])
    values, (t0, t1) = scenes.draw(scene, r)
    # The end of the span is a time like any other; whether it moves with t0 is of no matter.
    times = np.sort(np.append(r.uniform(t0 + 0.1, t1, 4), t1))
    names = [*scene.ranges, "t0"]
    asked = [str(name) for name in r.choice(names, _ASKED, replace=False)]
    return Case(values | {"t0": t0}, (t0, t1), times, int(r.integers(1000)), asked)


def numbers_of(scene, values):
    """(Initial state, parameters) of these values."""
    known = {p.name for p in scene.system.parameters}
    states = {s.name: values.get(s.name, 0.0) for s in scene.system.states}
    return states, {name: value for name, value in values.items() if name in known}


def run(scene, made, values, **more):
    """The run at these values."""
    states, parameters = numbers_of(scene, values)
    return judging.solve(
        scene.system, (values["t0"], made.span[1]), states, parameters=parameters, dense_output=True,
        noise=scenes.noise_of(scene, made.seed), **TIGHT, **more,
    )  # fmt: skip


def kept_events(solution):
    """Places of events without those that lead into an accumulation, whose number is a matter of roundings."""
    events = list(solution.events)
    dropped = set()
    for i, event in enumerate(events):
        if event.kind == "accumulation":
            k = i - 1
            while k >= 0 and (events[k].switch == event.switch or events[k].time == event.time):
                if events[k].switch == event.switch:
                    dropped.add(k)
                k -= 1
    return [i for i in range(len(events)) if i not in dropped]


def look(scene, made, solution):
    """Signature and numbers of a run; None where it did not end."""
    if not solution.success:
        return None
    events, kept = list(solution.events), kept_events(solution)
    told = sorted((round(events[i].time, 9), events[i].switch, events[i].kind) for i in kept)
    when = np.array([events[i].time for i in kept])
    before = [
        tuple(sorted((events[i].switch, events[i].kind) for i in kept if events[i].time <= t))
        for t in made.times
    ]
    signature = (tuple(item[1:] for item in told), tuple(before), tuple(a.kind for a in solution.ambiguities))
    names = names_of(solution)
    rows = [solution(made.times, name) for name in names]
    return Look(signature, np.concatenate([*rows, when]), kept)


def names_of(solution):
    """States, multipliers and outputs."""
    own = [*solution.states, *solution.multipliers]
    return [*own, *(str(name) for name in solution._expressions if str(name) not in own)]


def _tableau(lookup, value, first):
    """(Derivative, what it is unsure of, the step it was taken at) by Ridders' tableau; None where points differ."""
    rows, best, unsure, steps = [], None, None, None
    h = first
    for _ in range(_LEVELS):
        high, low = lookup(value + h), lookup(value - h)
        if high is None or low is None:
            rows, best, unsure = [], None, None  # an event between: nearer ones may be alike
            h /= _RATIO
            continue
        row = [(high - low) / (2 * h)]
        if rows:
            factor = _RATIO**2
            for above in rows[-1]:
                row.append((row[-1] * factor - above) / (factor - 1))
                factor *= _RATIO**2
                error = np.maximum(np.abs(row[-1] - row[-2]), np.abs(row[-1] - above))
                if unsure is None:
                    best, unsure, steps = row[-1].copy(), error, np.full(len(error), h)
                better = error < unsure
                best, unsure = np.where(better, row[-1], best), np.where(better, error, unsure)
                steps = np.where(better, h, steps)
        rows.append(row)
        h /= _RATIO
    return None if len(rows) < 4 else (best, unsure, steps)


def differences(scene, made, base, name, first=_FIRST):
    """The tableau of one quantity, or None."""
    width = np.ptp(scene.ranges[name]) if name in scene.ranges else 1.0

    def lookup(value):
        if name in scene.ranges and any(s.name == name for s in scene.system.parameters) and value < 0:
            return None
        found = look(scene, made, run(scene, made, made.values | {name: value}))
        return found.numbers if found and found.signature == base.signature else None

    return _tableau(lookup, made.values[name], first * width)


def forward(scene, made, solution, names, kept):
    """The same numbers' derivatives as the run gives them, shape (numbers, k)."""
    d = solution.derivatives
    rows = [d(made.times, name).T for name in names_of(solution)]
    events = list(solution.events)
    everywhen = d.event_times()
    order = np.argsort([event.time for event in events], kind="stable")
    where = {int(place): i for i, place in enumerate(order)}
    times = [everywhen[where[i]] for i in kept]
    return np.concatenate([*rows, np.array(times).reshape(-1, len(names))])


def play(scene, seed):
    """The verdict on one case."""
    made = case(scene, seed)
    label = scene.name.split()[0]
    try:
        solution = run(scene, made, made.values, by=[*scene.ranges, "t0"])
    except Exception as error:  # what a solve raises is a finding
        return Verdict(WRONG, f"{scene.name}: raised {type(error).__name__}: {error}"[:200])
    base = look(scene, made, solution)
    if base is None:
        return Verdict(judging.REFUSED, f"{label}: {solution.outcome.name}")
    d = solution.derivatives
    names = [*scene.ranges, "t0"]
    if d.problems:
        first = d.problems[0]
        for name in made.asked:
            # Where differences are sure of a derivative, of this quantity at least, there is one.
            found = differences(scene, made, base, name, 1e-3)
            size = None if found is None else 1 + np.abs(found[0])
            if found is None or np.any(found[1] > 1e-5 * size):
                return Verdict("justly refused", f"{label}: {first.reason[:30]}")
        return Verdict("refused, and differences exist", f"{label}: {first.reason[:30]}")
    try:
        got = forward(scene, made, solution, names, base.kept)
    except NoDerivative as error:
        return Verdict(WRONG, f"{scene.name}: raised {error}"[:200])
    if not np.isfinite(got).all():
        return Verdict(WRONG, f"{scene.name}: not finite")
    growth = 1 + np.abs(got).max()
    undecided = 0
    for name in made.asked:
        column = got[:, names.index(name)]
        verdicts = []
        for first in (_FIRST, 0.3 * _FIRST, 0.05 * _FIRST):
            found = differences(scene, made, base, name, first)
            if found is None:
                continue
            best, unsure, steps = found
            # Runs are as good as their tolerance and the motion's own growth.
            floor = 1e-12 * growth * (1 + np.abs(base.numbers)) / steps
            off = np.abs(column - best) - 10 * unsure - floor
            if np.all(unsure > 1e-3 * (1 + np.abs(best))):
                continue
            verdicts.append(off)
            if np.all(off <= 0):
                break
        if not verdicts:
            undecided += 1
            continue
        worst = np.min(verdicts, axis=0)  # every number is right by one of the tableaus
        if np.any(worst > 0):
            i = int(worst.argmax())
            return Verdict(WRONG, f"{scene.name}: {name} at number {i}", float(worst[i]))
    if undecided == len(made.asked):
        return Verdict(UNDECIDED, f"{label}: events change nearby")
    return backward(scene, made, solution, names, seed)


def backward(scene, made, solution, names, seed):
    """Covectors pulled back over the tape, against the same read forward."""
    r = np.random.default_rng([32, seed])
    n, m = len(solution.x), len(solution.mult)
    derivatives = solution.derivatives._replay(made.times, points=False)
    end, at = r.normal(size=n), r.normal(size=(len(made.times), n + m))
    expected = end @ derivatives.end + np.einsum("ti,tik->k", at, derivatives.at_sample)
    none = np.zeros(0, np.int64), np.zeros((0, 2 * n + 1))
    back = solution.derivatives.tape.pull_back(Readings(end, made.times, at, *none))
    if back.why is not None:
        return Verdict(WRONG, f"{scene.name}: refused backward alone")
    parameters = [s.name for s in solution.model.parameters]
    states = list(solution.states)
    error, growth = 0.0, np.abs(derivatives.at_sample).max(initial=1.0)
    for q, name in enumerate(names):
        if name == "t0":
            continue  # the start moves rates, which `value_and_gradient` adds
        found = (
            back.parameters[parameters.index(name)] if name in parameters else back.start[states.index(name)]
        )
        error = max(error, abs(float(found - expected[q])))
    size = np.abs(expected).max() + growth
    if error > 1e-11 * size and growth < 1e3:
        return Verdict(WRONG, f"{scene.name}: backward", error / size)
    return Verdict(RIGHT, scene.name.split()[0], error / size)


def script(number, seed):
    """What a case is."""
    scene = compiled(None, number)
    made = case(scene, seed)
    return "\n".join([
        f"# {scene.name}: scenes.py", f"values = {made.values}", f"span, times = {made.span}, {made.times.tolist()}",
        f"asked, seed = {made.asked}, {made.seed}",
    ])  # fmt: skip
