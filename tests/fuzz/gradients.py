"""Gradients of random costs, pulled back over the tape, against the same costs by the run's derivatives forward.

A cost is a random sum of quantities of a scene: integrals, ends, values at times, misfits, times of events, durations.
Its objective's own run gives both, so that they differ by roundings alone.
Chain: scenes.py, differences.py -> gradients.py (here) -> __main__.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sympy as sp

from pwsmooth import costs
from pwsmooth.paths.derivatives.of_solution import NoDerivative

from . import differences, judging, scenes
from .judging import RIGHT, UNDECIDED, WRONG, Verdict

TITLE = "gradients of random costs"
_TOLERANCE = 1e-11  # of the size of its terms


@dataclass
class Played:
    """A scene, an Objective of it, and the terms of its cost: a factor and a quantity each."""

    scene: object
    objective: object
    terms: list
    length: float


def compiled(_, number):
    """The scene of a structure's number with a random cost."""
    found = scenes.all_scenes()
    scene = found[number % len(found)]
    r = np.random.default_rng([41, number])
    model = scene.system.model
    states = model.states[: len(model.states) - model.n_memory]
    # All cases of a structure have one span, in which the times of the cost lie.
    length = float(scene.length * r.uniform(0.5, 0.9))

    values, (t0, _) = scenes.draw(scene, r)

    def expression():
        one, other = (states[i] for i in r.integers(len(states), size=2))
        return r.choice([one, one * other, one**2 + other / 3, sp.sin(one) * other])

    def quantity(kind):
        if kind == "integral":
            return costs.integral(expression())
        if kind == "final":
            return costs.final(expression())
        if kind == "at":
            return costs.at(expression(), t0 + float(length * r.uniform(0.3, 0.95)))
        if kind == "misfit":
            times = t0 + np.sort(length * r.uniform(0.2, 1.0, 7))
            return costs.misfit(expression(), times, r.normal(size=7), 0.5)
        switch = str(r.choice([m.symbol.name for m in scene.system.model.multipliers]))
        return (
            costs.duration(switch)
            if kind == "duration"
            else costs.event_time(switch, number=int(r.integers(2)))
        )

    kinds = ["integral", "final", "at", "misfit"]
    if scene.system.model.multipliers:
        kinds += ["duration", "time"]
    terms = {quantity(kind): float(r.normal()) for kind in r.choice(kinds, 3)}
    made = differences.Case(values | {"t0": t0}, (t0, t0 + length), np.zeros(0), 0, [])
    start, parameters = differences.numbers_of(scene, made.values)
    options = dict(differences.TIGHT)
    noise = scenes.noise_of(scene, 1)
    objective = costs.Objective(
        scene.system, sum(factor * q for q, factor in terms.items()), (t0, t0 + length), start,
        [*scene.ranges, "t0"], parameters=parameters, **options, **({"noise": noise} if noise else {}),
    )  # fmt: skip
    return Played(scene, objective, list(terms.items()), length)


def forward(played, run):
    """The gradient by the derivatives of the run, and the size of what it is a sum of."""
    d, asked, total, size = run.derivatives, played.objective._asked, 0.0, 0.0
    end = float(run.t[-1])
    for q, factor in played.terms:
        if q.kind == "integral":
            slope = d.end[asked.integrals[q]]
        elif q.kind in ("final", "at"):
            slope = d(end if q.kind == "final" else q.where[0], asked.outputs[q])
        elif q.kind == "misfit":
            t, measured, sigma = np.frombuffer(q.where[0]).reshape(3, -1)
            off = (run(t, asked.outputs[q]) - measured) / sigma
            slope = d(t, asked.outputs[q]) @ (2 * off / sigma)
        elif q.kind == "event_time":
            switch, kind, number, *_ = q.where
            slope = d.event_times(kind, switch)[number]
        else:
            j = run.multipliers.index(q.where[0])
            ends = [
                (t, sign) for s in run.segments if s.status[j] == 0 for t, sign in ((s.start, -1), (s.end, 1))
            ]
            times, moves = run.event_times(), d.event_times()
            slope = sum(
                (sign * moves[np.abs(times - t).argmin()] for t, sign in ends if run.t[0] < t < run.t[-1]),
                np.zeros(len(d.names)),
            )
        total = total + factor * slope
        size += float(np.abs(factor * slope).max())
    return total, size


def play(played, seed):
    """The verdict on one case."""
    r = np.random.default_rng([42, seed])
    scene, objective = played.scene, played.objective
    values, _ = scenes.draw(scene, r)
    q = np.array([values.get(name, 0.0) for name in objective.names])
    q[objective.names.index("t0")] = objective._span[0]
    label = scene.name.split()[0]
    try:
        run = objective.solve(q)
        if not run.success:
            return Verdict(judging.REFUSED, f"{label}: {run.outcome.name}")
        try:
            expected, size = forward(played, run)
        except (NoDerivative, IndexError) as error:
            expected, size = error, 0.0
        try:
            found = objective(q).gradient
        except NoDerivative as error:
            found = error
    except Exception as error:  # what a cost raises else is a finding
        return Verdict(WRONG, f"{scene.name}: raised {type(error).__name__}: {error}"[:200])
    if isinstance(expected, Exception) or isinstance(found, Exception):
        both = isinstance(expected, Exception) and isinstance(found, Exception)
        return Verdict(UNDECIDED if both else WRONG, f"{label}: refused {'by both' if both else 'by one'}")
    error = float(np.abs(expected - found).max() / (1e-3 + size))
    if error > _TOLERANCE:
        reached = error <= _TOLERANCE * multiplier(played, run) / 1e3
        return Verdict(judging.ILL if reached else WRONG, f"{label}: gradient", error)
    return Verdict(RIGHT, label, error)


def multiplier(played, run):
    """By how much a rounding within the run may grow, till its end or in the time of an accumulation that is read.

    A rounding of a gap moves the bounce after it by this over the speed: as many times as bounces are short.
    """
    replay = run.derivatives._replay(np.array([run.t[-1]]), points=False)
    largest = np.abs(replay.instant_w).max(initial=1.0)
    if any(q.kind in ("event_time", "duration") for q, _ in played.terms):
        for places, weights in run.derivatives._limits.values():
            shorter = np.diff(replay.instant_t[places], prepend=run.t[0])
            largest = max(largest, float(np.abs(weights / shorter).max()))
    return largest


def script(number, seed):
    """What a case is."""
    played = compiled(None, number)
    r = np.random.default_rng([42, seed])
    return f"# {played.scene.name}\ncost = {played.terms}\nvalues = {scenes.draw(played.scene, r)[0]}"
