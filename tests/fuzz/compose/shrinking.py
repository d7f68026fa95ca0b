"""A case that is wrong, made smaller while it stays wrong: events, terms and switches are left out one by one.

Chain: __init__.py (verdicts) -> **shrinking** -> __main__.py --show.
"""

from __future__ import annotations

import copy
import time

from ..judging import WRONG
from .grammar import num

SECONDS = 240  # after which the smallest so far is shown


def shrunk(model, one, ways):
    """The program of a case; of the smallest wrong one where it is wrong."""
    from . import build, judge, program

    played = build(model)
    verdict = judge(played, one, ways)
    if verdict.kind != WRONG:
        return program(played, one, ways) + f"\n# {verdict}"
    first, ends = kind_of(verdict), time.monotonic() + SECONDS
    changed = True
    while changed and time.monotonic() < ends:
        changed = False
        for smaller, numbers in candidates(model, one):
            if time.monotonic() > ends:
                break
            try:
                trial = build(smaller)
                found = judge(trial, numbers, ways)
            except Exception:  # a model that is none
                continue
            if found.kind == WRONG and kind_of(found) == first:
                model, one, played, verdict, changed = smaller, numbers, trial, found, True
                break
    return program(played, one, ways) + f"\n# {verdict}"


def kind_of(verdict):
    """What stays the same while a case is made smaller."""
    return verdict.reason.split(":")[-1][:12] if "raised" in verdict.reason else verdict.kind


def candidates(model, one):
    """Smaller models, with their numbers."""
    if model.family:
        smaller = copy.deepcopy(model)
        smaller.family = None  # the elements one by one
        yield smaller, one
    for name in ("events", "kicks"):
        for k in range(len(getattr(model, name))):
            if name == "events" and k not in dict(events_alone(model)):
                continue
            smaller = copy.deepcopy(model)
            del getattr(smaller, name)[k]
            yield smaller, one
    if model.mass:
        smaller = copy.deepcopy(model)
        smaller.mass = None
        yield smaller, one
    for k, event in events_alone(model):
        for change in [{"when": None}, {"direction": 0}] + [
            {"update": {x: y for x, y in event.update.items() if x != target}} for target in event.update
        ]:
            if any(getattr(event, name) != value for name, value in change.items()):
                smaller = copy.deepcopy(model)
                for name, value in change.items():
                    setattr(smaller.events[k], name, value)
                yield smaller, one
        if len(event.at) > 1:
            for i in range(len(event.at)):
                smaller = copy.deepcopy(model)
                smaller.events[k].at = event.at[:i] + event.at[i + 1 :]
                yield smaller, one
    for where, e in places(model):
        for part in parts(e):
            smaller = copy.deepcopy(model)
            put(smaller, where, part)
            yield smaller, one
    if len(one.instants) > 1:
        fewer = copy.copy(one)
        fewer.instants = one.instants[:-1]
        yield model, fewer
        fewer = copy.copy(one)
        fewer.instants = one.instants[-1:]
        yield model, fewer
    for i, x in enumerate(one.start):
        if x:
            moved = copy.copy(one)
            moved.start = [0.0 if k == i else y for k, y in enumerate(one.start)]
            yield model, moved


def events_alone(model):
    """(number, event) of those that are no element's of a family: a family's event is written once, and stays."""
    elements = [event.surface for event in model.family.events()] if model.family else []
    return [(k, event) for k, event in enumerate(model.events) if event.surface not in elements or event.at]


def places(model):
    """Where expressions stand, and they; a family's rates are written once, and stay."""
    ring = range(model.family.first, model.family.first + model.family.n) if model.family else ()
    for i, e in enumerate(model.rates):
        if i not in ring:
            yield ("rates", i), e
    for i, (c, e) in enumerate(model.unknowns):
        yield ("unknowns", i, c), e
    for k, event in events_alone(model):
        if event.surface is not None:
            yield ("surface", k), event.surface
        if event.when is not None:
            yield ("when", k), event.when
        for target, e in event.update.items():
            yield ("update", k, target), e


def put(model, where, e):
    """Puts an expression into its place."""
    name, k, *rest = where
    if name == "rates":
        model.rates[k] = e
    elif name == "unknowns":
        model.unknowns[k] = (rest[0], e)
    elif name == "update":
        model.events[k].update[rest[0]] = e
    else:
        setattr(model.events[k], name, e)


def parts(e):
    """Smaller expressions of the same sort."""
    logical = e[0] in ("and", "or", "xor", "not")
    comparison = e[0] in (">", ">=", "<", "<=")
    if e[0] == "+":
        for i in range(1, len(e)):
            rest = e[:i] + e[i + 1 :]
            yield rest if len(rest) > 2 else rest[1]
    elif logical:
        yield from e[1:]
    elif not comparison and e[0] != "num":
        for constant in (0, 1):
            if e != num(constant):
                yield num(constant)
        for part in e[1:]:
            if isinstance(part, tuple) and part[0] not in (">", ">=", "<", "<=", "and", "or", "xor", "not"):
                yield part
    for i, part in enumerate(e[1:], 1):
        if isinstance(part, tuple):
            for smaller in parts(part):
                yield e[:i] + (smaller,) + e[i + 1 :]
