"""Families event by event of their elements, beside the run that renews all of them at every event.

Chains, rings, lattices and graphs of up to 60 elements; strengths, stiffnesses and starts of their own; switches that
slide, cross and bend, hidden static friction, memories, resets, a switch of all at known times, friction that weakens,
functions. Nothing but `local` differs: states, multipliers, events of every element and ambiguities have to be equal.
Chain: judging.py -> assemblies.py (here) -> __main__.py.
"""

from __future__ import annotations

import contextlib
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
import sympy as sp

from pwsmooth import Event, Family, Switch, System, solve
from pwsmooth.definition import one_element

from . import judging
from .judging import ILL, RECORDED, REFUSED, RIGHT, WRONG, Played, Verdict

TITLE = "assemblies"
KINDS = ("sliding", "hidden", "relay", "kink", "memory", "fire", "bounce", "driven", "weakening", "first order",
         "functions", "parallel")  # fmt: skip
WAYS = ("chain", "ring", "lattice", "graph")
TIGHT = {"rtol": 1e-13, "atol": 1e-15}
BOUND = 1e-11  # of states, relative to their size
t, u = sp.symbols("t u", real=True)


@dataclass
class Model:
    """A kind of element, how they are linked, and a System of n of them."""

    kind: str
    way: str
    n: int
    arguments: dict
    states: tuple
    own: tuple  # parameters of elements


@dataclass
class Case:
    """Numbers of one run."""

    p: dict
    start: dict
    instants: np.ndarray


@contextlib.contextmanager
def templates():
    """Families of any size have a template."""
    before, one_element.TEMPLATE_FROM = one_element.TEMPLATE_FROM, 1
    try:
        yield
    finally:
        one_element.TEMPLATE_FROM = before


def _links(family, way, r):
    """sum(term) over the neighbours of an element."""
    n = family.n
    if way == "graph":
        own = np.arange(n)[:, None]
        table = (own + 1 + np.array([r.permutation(n - 1)[:3] for _ in range(n)])) % n
        fewer = r.random((n, 3)) < (0, 0.2, 0.2)
        return family.links(np.where(fewer, own, table) + 1).sum
    if way == "lattice":
        rows = next(k for k in (4, 3, 2, 1) if n % k == 0)
        return family.lattice((rows, n // rows), periodic=bool(r.integers(2))).sum
    far = int(r.integers(2))
    offsets = (1, -1, 2) if far else (1, -1)
    return lambda term: sp.Add(*(term(lambda m, o=o: family.neighbour(m, o)) for o in offsets))


def structure(seed):
    """A Model."""
    r = np.random.default_rng([61, seed])
    kind = KINDS[seed % len(KINDS)]
    way = WAYS[int(r.integers(len(WAYS)))]
    # The elements of hidden static friction are written out for the run of all.
    n = int(r.integers(4, 9)) if kind == "hidden" else int(np.exp(r.uniform(np.log(2), np.log(60.9))))
    n = max(n, {"graph": 5, "lattice": 2}.get(way, 3))
    family = Family(n, periodic=way == "ring")
    y, w, v = family.symbols("y w v")
    F, k, c, e, g = family.symbols("F k c e g", positive=True)
    over = _links(family, way, r)
    linked = bool(r.integers(2))  # springs of two elements, or of the element alone
    shape = (lambda d: d, sp.sin, lambda d: d + d**3 / 4)[int(r.choice(3, p=[0.6, 0.2, 0.2]))]

    def pull(z):
        return over(lambda at: ((k + at(k)) / 2 if linked else k) * shape(at(z) - z))

    def lam(h):
        return Switch("lam", h)

    events = []
    drag = over(lambda at: at(w) - w) / 8 if r.random() < 0.3 else 0
    if kind == "sliding":
        rates = {y: w, w: pull(y) + drag - y - F * lam(w - u)}
    elif kind == "hidden":
        one = lam(w - u)
        rates = {y: w, w: pull(y) - y - F * one * (1 + e * (1 - one**2))}
    elif kind == "relay":
        rates = {v: pull(v) - g * v + c * sp.Heaviside(v - e) + u * sp.sin(t)}
    elif kind == "kink":
        rates = {y: w, w: pull(y) + drag - y - F * sp.Max(0, y - e) - c * sp.Abs(w) + u * sp.cos(2 * t)}
    elif kind == "memory":
        on = family.memory("on", 1)
        rates = {v: pull(v) - g * v + (1 + c) * on}
        events = [
            Event(v - e, direction=1, update={on: 0}, name="off"),
            Event(v - e / 3, direction=-1, update={on: 1}, name="on"),
        ]
    elif kind == "fire":
        count = family.memory("count", 0)
        rates = {v: 1 + c - g * v + pull(v)}
        events = [Event(v - 1, direction=1, update={v: 0, count: count + 1}, name="fire")]
    elif kind == "bounce":
        rates = {y: w, w: pull(y) - 1 - c + u * sp.sin(3 * t)}
        events = [Event(y, direction=-1, update={w: -e * w}, name="bounce")]
    elif kind == "driven":
        rates = {y: w, w: pull(y) - y - F * lam(w) + (1 + c) * sp.sign(sp.sin(3 * t + u))}
    elif kind == "weakening":
        rates = {y: w, w: pull(y) - y - F * lam(w - u) / (1 + 6 * e * sp.Abs(w - u))}
    elif kind == "first order":
        rates = {v: pull(v) - g * v + 2 * u * sp.sin(2 * t) - F * lam(v - e)}
    elif kind == "functions":
        rates = {y: w, w: pull(y) - y - F * lam(w - u) * (1 + e * sp.exp(-((w / c) ** 2))) - sp.tanh(3 * w) / 5}
    else:
        slip = family.memory("slip", 0)
        speed = (1 + 9 * u) * (1 + t / 9) * sp.cos(2 * sp.pi * t)  # no element turns where it has turned
        events = [
            Event(k * y - F, direction=1, update={slip: 1}, when=sp.Eq(slip, 0), name="up"),
            Event(k * y + F, direction=-1, update={slip: 1}, when=sp.Eq(slip, 0), name="down"),
            Event(speed, update={slip: 0}, when=sp.Eq(slip, 1), name="stop"),
        ]
        rates = {y: sp.Piecewise((speed, sp.Eq(slip, 0)), (20 * ((F + u) * sp.sign(speed) - k * y), True))}
    used = set().union(*(sp.sympify(q).free_symbols for q in rates.values()))
    for s in list(used):
        used |= getattr(s, "surface", sp.S.Zero).free_symbols
    for event in events:
        used |= event.surface.free_symbols.union(*(q.free_symbols for _, q in event.update))
    own = tuple(q for q in (F, k, c, e, g) if any(q.name == s.name for s in used))
    arguments = {"rates": rates, "time": t, "events": events}
    arguments["parameters"] = {q: 1 for q in own} | ({u: 1} if u in used else {})
    return Model(kind, way, n, arguments, tuple(rates), own)


def case(M, seed):
    """Random numbers for it."""
    r = np.random.default_rng([62, seed])
    n, alike = M.n, r.random() < 0.2

    def numbers(low, high):
        return [float(a) for a in (np.full(n, r.uniform(low, high)) if alike else r.uniform(low, high, n))]

    ranges = {"F": (0.5, 1.5), "k": (0.2, 4.0), "c": (0.1, 1.0), "e": (0.3, 1.5), "g": (0.2, 1.0)}
    if M.kind == "bounce":
        ranges["e"] = (0.8, 1.0)
    if M.kind == "parallel":
        ranges |= {"F": (0.2, 1.0), "k": (0.3, 3.0)}
    if M.kind == "hidden":
        ranges["e"] = (0.1, 3.0)
    p = {q: numbers(*ranges[q.name]) for q in M.own}
    if any(q == u for q in M.arguments["parameters"]):
        p[u] = float(r.uniform(0.05, 0.6))
    start = {x: numbers(0.1, 0.9) if M.kind in ("bounce", "fire") else numbers(-0.7, 0.7) for x in M.states}
    if "w" in {x.name for x in M.states} and r.random() < 0.5 and u in p:
        w = next(x for x in M.states if x.name == "w")
        start[w] = [p[u] if r.random() < 0.7 else a for a in start[w]]
    end = float(r.uniform(1, 3 if M.kind in ("parallel", "bounce", "weakening") else 8))
    return Case(p, start, np.sort(np.append(r.uniform(0, end, 5), [0.0, end])))


def compiled(_, seed):
    """The structure of this seed."""
    model = structure(seed)
    with templates():
        system = System(**model.arguments)
    return Played(None, model, system, set())


def play(played, seed):
    """The verdict on one case."""
    return judged(played, case(played.model, seed))


def judged(played, one, cascades=False):
    """The verdict on these numbers; of `cascades` of bounces, without their events."""
    try:
        whole, local = (_run(played, one, way) for way in (False, True))
    except Exception as error:
        return Verdict(WRONG, f"raised {type(error).__name__}: {error}"[:200])
    if not (whole.success and local.success):
        kind = (
            WRONG if whole.success and not cascades else REFUSED
        )  # folds of several elements at one instant stop the run of all
        return Verdict(kind, f"{whole.outcome.name}, by elements {local.outcome.name}")
    found = compared(whole, local, not cascades)
    if found is None:
        return Verdict(RIGHT)
    reason, error = found
    if cascades and whole.ambiguities:
        # How bounces of several end together is a matter of their order, and both runs say so.
        return Verdict(RECORDED, whole.ambiguities[0].kind, error)
    moved = max(_spread(played, one, whole, k) for k in range(3))
    if reason == "states" and error <= 10 * moved:
        return Verdict(ILL, "", error)
    if reason != "states" and moved == np.inf:
        return Verdict(ILL, reason, error)
    return Verdict(WRONG, reason, error)


def _run(played, one, way, start=None, by=None):
    # Hidden static friction is two levels in a template: its layer and its folds are those of elements written out.
    system = played.system if way else played.system._without_levels()
    return (by or judging.solve)(system, (0, float(one.instants[-1])), start or one.start, parameters=one.p,
                         t_eval=one.instants, local=way, max_steps=judging.STEPS, **TIGHT)  # fmt: skip


def _spread(played, one, whole, number):
    """How far a start that is 1e-13 beside leads, in all; inf to other events."""
    r = np.random.default_rng(number)
    moved = {x: [a * (1 + 1e-13 * r.uniform(-1, 1)) for a in numbers] for x, numbers in one.start.items()}
    other = _run(played, one, False, moved, by=solve)
    if not other.success or _itineraries(other).keys() != _itineraries(whole).keys():
        return np.inf
    same = all(
        [a[1:] for a in x] == [b[1:] for b in y]
        for x, y in zip(_itineraries(whole).values(), _itineraries(other).values(), strict=True)
    )
    return float(np.abs(other.x - whole.x).max() / (1 + np.abs(whole.x).max())) if same else np.inf


def _itineraries(solution):
    """Switch or event of an element -> (time, kind, note) of its events."""
    found = defaultdict(list)
    for e in solution.events:
        found[e.switch].append((e.time, e.kind, e.note))
    return dict(sorted(found.items()))


def _multipliers(solution):
    """Name of a multiplier -> its values and its statuses."""
    rows = zip(solution.multipliers, solution.mult, solution.status, strict=False)  # a row even of none
    return {name: (lam, status) for name, lam, status in rows}


def compared(whole, local, events=True):
    """(what differs, by how much) between two runs of a case, or None."""
    size = 1 + float(np.abs(whole.x).max())
    if not np.array_equal(whole.t, local.t):
        return "times", np.inf
    error = float(np.abs(whole.x - local.x).max() / size)
    if not error <= BOUND:
        return "states", error
    held = [_multipliers(run) for run in (whole, local)]
    for name, (lam, status) in held[0].items():
        if not np.array_equal(status, held[1][name][1]):
            return f"status of {name}", np.inf
        error = float(np.abs(lam - held[1][name][0]).max())
        # Those of hidden friction by the root of a cubic, which is steep beside its fold.
        if not error <= 1e4 * BOUND:
            return f"multiplier {name}", error
    if not events:
        return None
    ours, theirs = _itineraries(local), _itineraries(whole)
    if ours.keys() != theirs.keys():
        return f"events of {sorted(ours.keys() ^ theirs.keys())[:4]}", np.inf
    for name, events in ours.items():
        if [e[1:] for e in events] != [e[1:] for e in theirs[name]]:
            return f"events of {name}", np.inf
        late = max(abs(a[0] - b[0]) for a, b in zip(events, theirs[name], strict=True))
        if late > 1e3 * BOUND:
            return f"times of {name}", late
    times = [e.time for e in local.events]
    if times != sorted(times):
        return "order of events", np.inf
    unsure = [sorted((a.switch, a.kind, a.taken) for a in run.ambiguities) for run in (whole, local)]
    if unsure[0] != unsure[1]:
        return f"ambiguities {unsure}", np.inf
    return None


def script(number, seed):
    """The case as a program."""
    return (
        "from tests.fuzz import assemblies\n"
        f"played = assemblies.compiled(None, {number})\none = assemblies.case(played.model, {seed})\n"
        f"# {played_text(number)}\nwhole, local = (assemblies._run(played, one, way) for way in (False, True))"
    )


def played_text(number):
    M = structure(number)
    return f"{M.kind}, {M.way}, n = {M.n}: {M.arguments['rates']}"
