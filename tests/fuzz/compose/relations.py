"""The same model written otherwise: each relation is a Style, and the numbers of a case in it.

Renamed and in the reverse order; in other switches; surfaces times 3 and -2; time shifted; units of states and of
time; numbers in place of parameters.
Chain: grammar.py -> **relations** -> __init__.py.
"""

from __future__ import annotations

import re

import numpy as np

from .grammar import Style, Writer

STYLES = {
    "renamed": Style(prefix="z", reverse=True),
    "in other switches": Style(spelled=True),
    "surfaces times 3": Style(factor=3),
    "surfaces times -2": Style(factor=-2),
    "shifted": Style(shift=8.0),
    "large states": Style(size=1e6),
    "small states": Style(size=1e-6),
    "slow": Style(pace=1e6),
    "fast": Style(pace=1e-6),
    "written out": Style(written_out=True),
}


def written(model, style):
    """(System, names of its parameters) of a model in a style."""
    while True:
        space = {}
        try:
            exec(Writer(model, style).text(), space)
        except ValueError as error:
            # sympy has simplified what a parameter stood in.
            gone = re.search(r"`parameters` names '(k\d+)', which stands nowhere", str(error))
            if not gone or gone[1] in model.unused:
                raise
            model.unused.add(gone[1])
            continue
        return space["S"], {p.name for p in space["S"].parameters}


def call(model, one, style, known, options):
    """What `solve` is given for a case: the span, the start, and the rest."""
    moments = [(t + style.shift) * style.pace for t in (one.t0, *one.instants)]
    names = [style.prefix + name for name in model.states]
    start = {name: style.size * x for name, x in zip(names, one.start)}
    parameters = {f"k{k}": float(v) for k, v in enumerate(one.p) if f"k{k}" in known}
    options = dict(parameters=parameters, t_eval=np.array(moments[1:]), **options)
    if style.size != 1:
        options["atol"] = 1e-12 * style.size
    return (moments[0], moments[-1]), start, options


def values(model, one, style, solution):
    """(times, states and memories) of a solution in the units of the model; a row each instant that it reached."""
    times = np.asarray(solution.t) / style.pace - style.shift
    rows = [np.asarray(solution[style.prefix + name]) / style.size for name in model.states]
    kept = {str(name) for name in solution.states}  # a memory that nothing writes is no state
    rows += [
        np.asarray(solution[f"m{i}"]) if f"m{i}" in kept else np.full(len(times), initial)
        for i, initial in enumerate(model.memories)
    ]
    found = np.full((len(one.instants), len(rows)), np.nan)
    for k, t in enumerate(one.instants):
        at = np.flatnonzero(np.abs(times - t) <= 1e-12 * max(1, abs(t)))
        if len(at):
            found[k] = [row[at[-1]] for row in rows]
    return times, found
