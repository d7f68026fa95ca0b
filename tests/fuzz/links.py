"""Families whose elements touch: contacts with a floor and with each other, friction, springs with a gap, bonds that
break.

As assemblies.py: event by event of the elements beside the run of all. Floors with and without friction on top, hard
rods and balls that return less, on springs and free, in chains, rings, lattices and graphs of up to 60 elements.
Chain: assemblies.py -> links.py (here) -> __main__.py.
"""

from __future__ import annotations

import numpy as np
import sympy as sp

from pwsmooth import Event, Family, Switch, System, Unilateral
from pwsmooth.definition.primitives import symbols_of

from . import assemblies
from .assemblies import Case, Model, _links, t, templates, u
from .judging import Played

TITLE = "links"
KINDS = (
    "gaps",
    "hooks",
    "bonds",
    "floor",
    "floor and belt",
    "hits",
    "rods",
    "balls",
    "floor and balls",
    "pile",
    "rubbing",
)
PAIRS = (
    "rubbing",
    "bonds",
    "hits",
    "rods",
    "balls",
    "floor and balls",
)  # of which one end of a link alone has what happens


def structure(seed):
    """A Model."""
    r = np.random.default_rng([63, seed])
    kind = KINDS[seed % len(KINDS)]
    ways = ("chain", "ring") if kind in PAIRS else assemblies.WAYS
    way = ways[int(r.integers(len(ways)))]
    n = int(np.exp(r.uniform(np.log(2), np.log(60.9))))
    n = max(n, {"graph": 5, "lattice": 2}.get(way, 3))
    way, n = ("chain", min(n, 12)) if kind == "pile" else (way, n)
    family = Family(n, periodic=way == "ring")
    y, w = family.symbols("y w")
    F, k, c, e, g, m = family.symbols("F k c e g m", positive=True)
    over = _links(family, way, r)
    nxt, before = family.neighbour(y, 1), family.neighbour(y, -1)
    pull = over(lambda at: at(y) - y) if r.random() < 0.5 or kind == "floor" else 0
    events, contacts = [], []
    if kind == "gaps":
        power = int(r.choice([1, 2]))
        push = over(lambda at: sp.Max(0, (at(k) + k) / 2 * (at(y) - y) - u) ** power)
        back = over(lambda at: sp.Max(0, (at(k) + k) / 2 * (y - at(y)) - u) ** power)
        rates = {y: w, w: push - back - y + pull / 3}
    elif kind == "hooks":

        def hook(at):
            return (at(y) - y) * (k + at(k)) * sp.Piecewise((1, sp.Abs(at(y) - y) < u), (sp.S.Half, True))

        rates = {y: w, w: over(hook) - y - F * Switch("lam", w - u / 4)}
    elif kind == "bonds":
        whole = family.memory("whole", 1)
        broken = Event(
            k * (nxt - y) - 1 - F, direction=1, update={whole: 0}, when=sp.Eq(whole, 1), name="break"
        )
        events = [broken]
        behind = family.neighbour(k, -1)
        rates = {
            y: w,
            w: k * whole * (nxt - y) + behind * family.neighbour(whole, -1) * (before - y) - g * y,
        }
    elif kind in ("floor", "floor and belt"):
        floor = Unilateral(y, restitution=e, name="R")
        contacts = [floor]
        rates = {y: w, w: floor.reaction - c + u * sp.sin(3 * t) + k * pull}
        if kind == "floor and belt":
            (z, v) = family.symbols("z v")
            rates |= {z: v, v: over(lambda at: at(z) - z) - z - F * floor.reaction * Switch("lam", v - u)}
    elif kind == "rubbing":
        rub = Switch("rub", family.neighbour(w, 1) - w)
        ahead, behind = rub, family.neighbour(rub, -1)
        if r.random() < 0.5:
            ahead, behind = sp.sign(family.neighbour(w, 1) - w), sp.sign(w - family.neighbour(w, -1))
        force = F * ahead - family.neighbour(F, -1) * behind - k * y + pull + sp.sin(2 * t + g)
        rates = {y: w, w: (force - c * w) / m}
    elif kind == "hits":
        # Equal balls swap what they have, and each hit takes a share of their speed.
        swap = {w: e * family.neighbour(w, 1), family.neighbour(w, 1): e * w}
        events = [Event(nxt - y + 1, direction=-1, update=swap, name="hit")]
        rates = {y: w, w: pull - y * c + u * sp.cos(2 * t)}
    elif kind == "pile":
        ball = Unilateral(nxt - y - 1, restitution=e * sp.Rational(2, 3), name="R")
        below = Unilateral(y, restitution=e * sp.Rational(2, 3), name="L")
        contacts = [ball, below]
        push = ball.reaction - family.neighbour(ball.reaction, -1)
        rates = {y: w, w: (below.reaction - push + (k * (nxt - y - 1) if pull != 0 else 0)) / m - c - 1}
    else:
        gap = family.neighbour(y, 1, outside=None if way == "ring" or r.random() < 0.5 else 1) - y + 1
        ball = Unilateral(gap, restitution=1 if kind == "rods" else e, name="R")
        contacts = [ball]
        force = -c * y + (pull if kind != "floor and balls" else 0)
        floor = 0
        if kind == "floor and balls":
            below = Unilateral(y + 2, restitution=e, name="L")
            contacts.append(below)
            floor = below.reaction
        rates = {y: w, w: (force + floor + family.neighbour(ball.reaction, -1) - ball.reaction) / m}
    said = [*rates.values(), *(e for c in contacts for e in (c.gap, c.restitution))]
    said += [e for event in events for e in (event.surface, *(value for _, value in event.update))]
    used = {s.name for s in symbols_of(said)}
    own = tuple(q for q in (F, k, c, e, g, m) if q.name in used)
    arguments = {"rates": rates, "time": t, "events": events, "contacts": contacts}
    arguments["parameters"] = {q: 1 for q in own} | ({u: 1} if "u" in used else {})
    return Model(kind, way, n, arguments, tuple(rates), own)


def case(M, seed):
    """Random numbers for it."""
    r = np.random.default_rng([64, seed])
    n, alike = M.n, r.random() < 0.2

    def numbers(low, high):
        return [float(a) for a in (np.full(n, r.uniform(low, high)) if alike else r.uniform(low, high, n))]

    ranges = {
        "F": (0.1, 1.0),
        "k": (0.5, 4.0),
        "c": (0.1, 1.0),
        "e": (0.2, 0.8),
        "g": (0.2, 1.0),
        "m": (0.5, 2.0),
    }
    if M.kind == "hits":
        ranges["e"] = (0.9, 1.0)
    p = {q: numbers(*ranges[q.name]) for q in M.own}
    if u in M.arguments["parameters"]:
        p[u] = float(r.uniform(0.05, 0.5))
    start = {x: numbers(-1.5, 1.5) if x.name in "wv" else numbers(-0.45, 0.45) for x in M.states}
    if "floor" in M.kind and "balls" not in M.kind:
        start[M.states[0]] = numbers(0.1, 0.9)
    if M.kind == "pile":
        start[M.states[0]] = [a + 1.1 * i for i, a in enumerate(numbers(0.01, 0.1))]
    end = float(r.uniform(0.5, 4))
    return Case(p, start, np.sort(np.append(r.uniform(0, end, 5), [0.0, end])))


def compiled(_, seed):
    """The structure of this seed."""
    model = structure(seed)
    with templates():
        system = System(**model.arguments)
    assert system.model.families is not None, f"{model.kind} has no template"
    return Played(None, model, system, set())


def play(played, seed):
    """The verdict on one case."""
    # A bounce that stays within the rounding of its gap is over at any instant at which its contact is looked at, and
    # the run of all looks at every one: events elsewhere that do nothing change the last bounces of a pile, and nothing
    # else.
    return assemblies.judged(played, case(played.model, seed), cascades=played.model.kind == "pile")


def script(number, seed):
    """The case as a program."""
    return (
        "from tests.fuzz import assemblies, links\n"
        f"played = links.compiled(None, {number})\none = links.case(played.model, {seed})\n"
        f"# {played_text(number)}\nwhole, local = (assemblies._run(played, one, way) for way in (False, True))"
    )


def played_text(number):
    M = structure(number)
    return f"{M.kind}, {M.way}, n = {M.n}: {M.arguments['rates']}"
