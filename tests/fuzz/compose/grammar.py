"""The notation as a grammar: a random model, its numbers, and its text.

An expression is a tuple: its first place names what it is, the others are its parts.

    number   ("num", c) ("p", k) ("x", i) ("t",) ("m", i) ("d", i) ("a", i) ("R", k) ("D", j, c) ("lam", j)
    smooth   ("+", ...) ("*", ...) ("sin", e)
    switch   ("sign", h) ("H", h) ("abs", h) ("max", a, b) ("min", a, b) ("floor", e) ("frac", e) ("mod", e, T)
             ("pw", condition, e, otherwise) ("hid", j, rho): lam (1 + rho (1 - lam^2))
    condition  (">", a, b) (">=", a, b) ("<", a, b) ("<=", a, b) ("and", ...) ("or", ...) ("xor", ...) ("not", c)

Parameters p, states x, memories m, drives d, unknowns a, reactions R, multipliers lam of switches and D of discs.
Chain: **grammar** -> reference.py (what it does), relations.py (how else it may be written) -> __init__.py.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

# Each piece of the notation is drawn by itself with this probability: any two meet in one model of about sixteen.
PIECES = dict.fromkeys(
    ("sign", "Heaviside", "Abs", "Max", "Piecewise", "steps of t", "steps of x", "logic", "Switch", "nested",
     "Memory", "every", "at", "surface", "switch in a surface", "direction", "when", "nonlinear update",
     "terminal", "held drive", "line drive", "kick", "Algebraic", "mass matrix", "start on a surface",
     "end on a clock", "late start"), 0.25,
) | dict.fromkeys(("hidden", "Disc", "contact", "friction in the push", "family"), 0.2)  # fmt: skip
# What a parameter is: a number of this kind is drawn for each case.
OFFSET, GAIN, PERIOD, RESTITUTION, FRICTION, HIDDEN = range(6)
COMPARISONS = {">": "<", "<": ">", ">=": "<=", "<=": ">="}
STEPS = ("floor", "frac", "mod")


def num(c):
    """A number."""
    return ("num", float(c))


def add(*parts):
    """A sum, without the parts that are 0."""
    parts = [q for p in parts for q in (p[1:] if p[0] == "+" else (p,)) if q != num(0)]
    return parts[0] if len(parts) == 1 else ("+", *parts) if parts else num(0)


def mul(*parts):
    """A product, without the factors that are 1."""
    if num(0) in parts:
        return num(0)
    parts = [q for p in parts for q in (p[1:] if p[0] == "*" else (p,)) if q != num(1)]
    return parts[0] if len(parts) == 1 else ("*", *parts) if parts else num(1)


def minus(a, b):
    """a - b"""
    return add(a, mul(num(-1), b))


@dataclass
class Event:
    """What `pwsmooth.Event` is given; `update` maps ("x", i) or ("m", i) to an expression."""

    surface: tuple | None = None
    every: tuple | None = None
    at: tuple = ()
    direction: int = 0
    update: dict = field(default_factory=dict)
    when: tuple | None = None
    terminal: bool = False


@dataclass
class Family:
    """A ring of equal elements with one state each; `rate` and `event` read ("own",) and ("next", offset)."""

    first: int  # place of the first element's state
    rate: tuple
    event: Event | None = None
    n: int = 3

    def of_element(self, e, k):
        """An expression of the element with the number k."""
        if e[0] in ("own", "next"):
            return ("x", self.first + (k + (e[1] if e[0] == "next" else 0)) % self.n)
        return tuple(self.of_element(part, k) if isinstance(part, tuple) else part for part in e)

    def events(self):
        """Those of all elements."""
        e = self.event
        return [] if e is None else [
            Event(self.of_element(e.surface, k), direction=e.direction,
                  update={self.of_element(x, k): self.of_element(y, k) for x, y in e.update.items()})
            for k in range(self.n)
        ]  # fmt: skip


@dataclass
class Model:
    """A random model; `pieces` are the names of what it was drawn from."""

    states: list = field(default_factory=list)  # names
    rates: list = field(default_factory=list)  # of mass matrix rows: the forces
    parameters: list = field(default_factory=list)  # kinds
    memories: list = field(default_factory=list)  # initial values
    drives: list = field(default_factory=list)  # (kind, times, values)
    unknowns: list = field(default_factory=list)  # (c, e) of  a + c a^3 = e
    switches: list = field(default_factory=list)  # surfaces
    discs: list = field(default_factory=list)  # pairs of surfaces
    contacts: list = field(default_factory=list)  # (gap, restitution)
    events: list = field(default_factory=list)
    kicks: list = field(default_factory=list)  # (state, size, time)
    mass: tuple | None = None  # (i, j, m): [[2, m], [m, 2]] on two states
    family: Family | None = None
    t0: float = 0.0
    pieces: set = field(default_factory=set)
    starts: list = field(default_factory=list)  # (surface, its offset) on which a run may start
    unused: set = field(default_factory=set)  # names of parameters that no longer stand in the System

    def trees(self):
        """All expressions."""
        yield from self.rates
        yield from (e for _, e in self.unknowns)
        yield from self.switches
        yield from (h for pair in self.discs for h in pair)
        yield from (e for contact in self.contacts for e in contact)
        for event in self.events:
            yield from (e for e in (event.surface, event.every, event.when) if e is not None)
            yield from event.update.values()
        if self.mass:
            yield self.mass[2]


def walk(e):
    """The expression and all of its parts."""
    yield e
    for part in e[1:]:
        if isinstance(part, tuple):
            yield from walk(part)


# ---- drawing


class _Draw:
    def __init__(self, seed):
        self.r = np.random.default_rng([101, seed])
        self.model = Model()
        self.has = {name: self.r.random() < share for name, share in PIECES.items()}
        self.has["contact"] |= self.has["friction in the push"]
        self.has["Piecewise"] |= self.has["logic"]
        self.leaves = []

    def new(self, kind):
        self.model.parameters.append(kind)
        return ("p", len(self.model.parameters) - 1)

    def pick(self, items):
        return items[int(self.r.integers(len(items)))]

    def state(self, name, rate=None):
        self.model.states.append(name)
        self.model.rates.append(rate)
        self.leaves.append(("x", len(self.model.states) - 1))
        return self.leaves[-1]

    def use(self, name):
        """Whether a piece was drawn; it then stands in the model."""
        if self.has[name]:
            self.model.pieces.add(name)
        return self.has[name]

    def affine(self, leaves=None, depth=0):
        """c q + d r - offset, on which a run may start."""
        leaves = leaves or self.leaves
        c, leaf = self.pick((1, 1, -1, 0.5, 2)), self.pick(leaves)
        parts = [mul(num(c), leaf)]
        if self.r.random() < 0.4:
            d, other = self.pick((1, -0.5, 0.5)), self.pick(leaves)
            if leaf != other or c + d:  # else a constant is left
                parts.append(mul(num(d), other))
        if depth < 2 and self.has["nested"] and self.r.random() < 0.4:
            parts.append(mul(num(self.pick((0.5, -0.25, 1))), self.switch(depth=depth + 1)))
            self.model.pieces.add("nested")
        offset = self.new(OFFSET)
        h = minus(add(*parts), offset)
        if depth == 0:
            self.model.starts.append((h, offset[1]))
        return h

    def in_time(self):
        """A surface of time."""
        return minus(("t",), add(num(self.model.t0), self.new(GAIN)))

    def condition(self, depth=0):
        c = (self.pick(list(COMPARISONS)), self.affine(depth=depth), num(0))
        if self.r.random() < 0.2:
            c = (self.pick((">", "<=")), self.in_time(), num(0))
        if self.has["logic"] and (depth == 0 or self.r.random() < 0.6):
            self.model.pieces.add("logic")
            kind = self.pick(("and", "or", "xor", "not"))
            other = (self.pick((">", "<")), self.affine(depth=1), num(0))
            c = ("not", c) if kind == "not" else (kind, c, other)
        return c

    def switch(self, kind=None, depth=0):
        """An expression that jumps or has a kink, of size 1."""
        kinds = [k for k in ("sign", "Heaviside", "Abs", "Max", "Piecewise", "steps of t", "steps of x", "Switch")
                 if self.has[k]]  # fmt: skip
        kind = kind or self.pick(kinds or ["sign"])
        self.model.pieces.add(kind)
        if kind == "sign":
            return ("sign", self.affine(depth=depth))
        if kind == "Heaviside":
            return ("H", self.affine(depth=depth))
        if kind == "Switch":
            # A Switch of memories and parameters alone is refused.
            h = self.affine([leaf for leaf in self.leaves if leaf[0] == "x"], depth=max(depth, 1))
            self.model.switches.append(h)
            return ("lam", len(self.model.switches) - 1)
        if kind == "Abs":
            return ("abs", self.affine(depth=depth))
        if kind == "Max":
            other = num(0) if self.r.random() < 0.5 else self.affine(depth=depth)
            return (self.pick(("max", "min")), self.affine(depth=depth), other)
        if kind == "Piecewise":
            c = self.condition(depth)
            one = mul(num(self.pick((1, -1, 0.5))), self.pick([num(1), *self.leaves]))
            return ("pw", c, one, self.pick([num(0), num(0.25), self.new(OFFSET)]))
        of_time = kind == "steps of t"
        e = ("t",) if of_time else self.affine(depth=max(depth, 1))
        period = self.new(PERIOD)
        if of_time and self.model.t0:
            e = add(e, num(-self.model.t0))
        shape = self.pick(STEPS)
        if shape == "mod":
            ramp = ("mod", e, period)
            # A duty cycle is what Mod is most often written for.
            duty = ("<", ramp, mul(self.pick((num(0.5), num(1), self.new(GAIN))), period))
            return ("pw", duty, num(1), num(0)) if self.r.random() < 0.3 else minus(ramp, num(0.25))
        e = mul(num(self.pick((1, 2))), e)
        return mul(num(0.5), (shape, e)) if shape == "floor" else minus((shape, e), num(0.5))

    def wave(self):
        return ("sin", add(mul(num(self.pick((1, 2, 3))), ("t",)), self.new(OFFSET)))

    # ---- parts of the model

    def blocks(self):
        """States, and what acts on them alone."""
        M, r = self.model, self.r
        if self.use("late start"):
            M.t0 = self.pick((1.0, -2.5, 64.5, 1000.0))
        x = self.state("x0")
        M.rates[0] = add(mul(num(-1), self.new(GAIN), x), mul(num(0.75), self.wave()))
        if r.random() < 0.5 or self.has["mass matrix"]:
            y = self.state("x1")
            M.rates[1] = add(mul(num(-0.5), y), mul(num(self.pick((0.5, -0.5))), x), self.new(OFFSET))
        if self.use("mass matrix"):
            M.mass = (0, 1, self.pick((num(0.5), ("sin", x), ("sin", ("t",)))))
        if self.use("hidden"):
            v = self.state("v")
            M.switches.append(minus(v, self.new(OFFSET)))
            held = ("hid", len(M.switches) - 1, self.new(HIDDEN))
            M.rates[-1] = add(mul(num(1.5), self.wave()), x, mul(num(-1), self.new(GAIN), held))
        if self.use("contact"):
            q, u = self.state("q"), self.state("u")
            M.contacts.append((q, self.new(RESTITUTION)))
            R = ("R", 0)
            M.rates[-2] = u
            M.rates[-1] = add(num(-1), mul(num(0.75), self.wave()), mul(num(0.25), x), R)
            if self.use("friction in the push"):
                w = self.state("w")
                slip = minus(w, self.pick((num(0), num(0.25))))
                M.rates[-1] = add(
                    mul(num(0.5), self.wave()), mul(num(-1), self.new(FRICTION), R, ("sign", slip))
                )
        if self.use("Disc"):
            a, b = self.state("a"), self.state("b")
            M.discs.append((minus(a, self.pick((num(0), num(0.25)))), b))
            mu = self.new(GAIN)
            for c, row in enumerate((-2, -1)):
                M.rates[row] = add(mul(num(0.5), self.wave()), mul(num(-1), mu, ("D", 0, c)))
        if self.use("family"):
            self.family()
        if self.use("Memory"):
            M.memories.append(float(self.pick((0, 1))))
            self.leaves.append(("m", 0))
            M.rates[0] = add(M.rates[0], mul(num(0.5), ("m", 0)))
        for kind in ("held drive", "line drive"):
            if self.use(kind):
                times = M.t0 + np.arange(-1, 13) * self.pick((0.5, 0.75, 1.0))
                M.drives.append((kind.split()[0], times, np.round(r.uniform(-1, 1, len(times)), 2)))
                self.leaves.append(("d", len(M.drives) - 1))
                M.rates[0] = add(M.rates[0], mul(num(0.25), self.leaves[-1]))
        if self.use("Algebraic"):
            e = self.affine()
            if r.random() < 0.5:
                e = add(e, mul(num(0.5), self.switch()))
            M.unknowns.append((self.pick((0.0, 0.25)), e))
            self.leaves.append(("a", 0))
            M.rates[0] = add(M.rates[0], mul(num(0.5), ("a", 0)))

    def family(self):
        """A ring of three elements, with a switch in each and perhaps an event."""
        M, own = self.model, ("own",)
        h = minus(add(own, mul(num(-0.5), ("next", 1))), self.new(OFFSET))
        shape = self.pick(("sign", "H", "abs", "max"))
        switch = (shape, h, num(0)) if shape == "max" else (shape, h)
        pull = minus(mul(num(0.5), add(("next", 1), ("next", -1))), own)
        rate = add(pull, mul(num(self.pick((-0.75, 0.5))), switch), mul(num(0.5), ("x", 0)), self.wave())
        M.family = Family(len(M.states), rate)
        for k in range(M.family.n):
            self.state(f"y_{k + 1}", M.family.of_element(rate, k))
        M.rates[0] = add(M.rates[0], mul(num(0.25), ("x", M.family.first)))
        if self.r.random() < 0.5:
            surface = minus(own, self.new(OFFSET))
            update = {own: self.pick((mul(num(-0.5), own), minus(own, num(0.5))))}
            M.family.event = Event(surface, direction=self.pick((1, -1, 0)), update=update)
            M.events += M.family.events()

    def places(self):
        """Switches in the rates: each kind that was drawn stands there once."""
        M = self.model
        plain = [i for i, name in enumerate(M.states) if name != "q" and name[0] != "y"]
        kinds = ("sign", "Heaviside", "Abs", "Max", "Piecewise", "steps of t", "steps of x", "Switch")
        for kind in kinds:
            if self.has[kind]:
                i = self.pick(plain)
                factor = num(self.pick((-1, -0.75, -0.5, 0.5, 0.75)))
                M.rates[i] = add(M.rates[i], mul(factor, self.switch(kind)))

    def update(self):
        """A few new values."""
        M, found = self.model, {}
        targets = [
            ("x", i) for i, name in enumerate(M.states) if name not in ("q", "a", "b") and name[0] != "y"
        ]
        if M.memories and self.r.random() < 0.7:
            m = ("m", 0)
            found[m] = self.pick((add(m, num(1)), minus(num(1), m)))
        if not found or self.r.random() < 0.6:
            x = self.pick(targets)
            found[x] = self.pick(
                (add(x, num(0.5)), mul(num(-0.5), x), num(0.25), mul(num(-1), x), minus(x, num(0.25)))
            )
        if self.has["nonlinear update"]:
            self.model.pieces.add("nonlinear update")
            x = self.pick(targets)
            found[x] = add(mul(num(0.5), x), mul(num(0.5), self.switch(depth=1)))
        return found

    def dates(self, n):
        steps = self.r.choice(np.arange(1, 14), n, replace=False)
        return tuple(float(self.model.t0 + 0.25 * k) for k in sorted(steps))

    def events(self):
        """Events, kicks."""
        M = self.model
        if self.use("surface") or self.has["direction"] or self.has["switch in a surface"]:
            h = self.affine()
            if self.use("switch in a surface"):
                h = add(h, mul(num(self.pick((0.5, -0.5, 1))), self.switch(depth=1)))
            M.events.append(Event(h, direction=self.pick((1, -1)) if self.use("direction") else 0))
        if self.use("every"):
            M.events.append(Event(every=self.new(PERIOD)))
        if self.use("at"):
            M.events.append(Event(at=self.dates(int(self.r.integers(1, 4)))))
        for event in M.events:
            event.update = event.update or self.update()
        # A family's event is written once for all elements, and has no condition.
        alone = M.events[M.family.n :] if M.family and M.family.event else M.events
        if alone and self.use("when"):
            event = self.pick(alone)
            event.when = self.condition(depth=1)
            if M.memories and self.r.random() < 0.4:
                event.when = ("and", (self.pick((">", "<=")), ("m", 0), num(0)), event.when)
                M.pieces.add("logic")
        if self.use("terminal"):
            event = Event(
                minus(self.pick(self.leaves[: len(M.states)]), num(self.pick((1.25, -1.25)))), terminal=True
            )
            M.events.append(event)
        if self.use("kick"):
            for date in self.dates(int(self.r.integers(1, 3))):
                free = [i for i, name in enumerate(M.states) if name not in ("q", "a", "b") and name[0] != "y"]
                targets = [i for i in free if not M.mass or i not in M.mass[:2]]
                if not targets:
                    continue
                M.kicks.append((self.pick(targets), float(self.pick((0.5, -0.5, 0.25))), date))


def structure(seed):
    """The model of this seed."""
    draw = _Draw(seed)
    draw.blocks()
    draw.places()
    draw.events()
    draw.use("start on a surface")
    draw.use("end on a clock")
    return draw.model


@dataclass
class Case:
    """Numbers of one run."""

    p: list
    start: list
    t0: float
    instants: list  # the last one is the end
    on: int | None = None  # number of the surface on which it starts


_RANGES = {OFFSET: (-1, 1), GAIN: (0.3, 1.2), PERIOD: (0.4, 1.3), RESTITUTION: (0, 0.8), FRICTION: (0.1, 0.6),
           HIDDEN: (0.6, 1.5)}  # fmt: skip
_PLAIN = {OFFSET: (-0.75, -0.5, -0.25, 0, 0.25, 0.5, 0.75), GAIN: (0.5, 1.0), PERIOD: (0.5, 1.0, 0.75),
          RESTITUTION: (0, 0.5), FRICTION: (0.25, 0.5), HIDDEN: (1.0,)}  # fmt: skip


def case(model, seed):
    """The numbers of this seed: plain ones, with which instants coincide, or any."""
    r = np.random.default_rng([102, seed])

    def number(kind, plain):
        return float(r.choice(_PLAIN[kind]) if r.random() < plain else r.uniform(*_RANGES[kind]))

    plain = float(r.choice((0.1, 0.6, 1.0)))
    p = [number(kind, plain) for kind in model.parameters]
    start = [number(OFFSET, plain) for _ in model.states]
    if model.contacts:
        q = model.states.index("q")
        start[q] = abs(start[q])
        if start[q] == 0:
            start[q + 1] = abs(start[q + 1])
    length = float(r.uniform(1.5, 4))
    if "end on a clock" in model.pieces:
        length = float(r.choice((2.0, 2.5, 3.0)))
    inner = np.sort(r.uniform(0.05, 0.98, 4)) * length
    found = Case(p, start, model.t0, [*(model.t0 + inner).tolist(), model.t0 + length])
    if "start on a surface" in model.pieces and model.starts and r.random() < 0.7:
        k = int(r.integers(len(model.starts)))
        h, offset = model.starts[k]
        p[offset] = 0.0
        at = value(h, Point(found.t0, start, p, model.memories, [float(d[2][2]) for d in model.drives]))
        if at is not None and at * 1024 == int(at * 1024):  # else rounding decides on which side it starts
            p[offset], found.on = float(at), k
    return found


@dataclass
class Point:
    """Where an expression is evaluated."""

    t: float
    x: list
    p: list
    m: list
    d: list


_SIMPLE = {
    "num": lambda at, c: c,
    "p": lambda at, k: at.p[k],
    "x": lambda at, i: at.x[i],
    "t": lambda at: at.t,
    "m": lambda at, i: at.m[i],
    "d": lambda at, i: at.d[i],
}
_OF_VALUES = {
    "+": lambda *a: sum(a), "*": lambda *a: float(np.prod(a)), "sin": np.sin, "sign": np.sign, "abs": abs, "max": max,
    "min": min, "H": lambda h: (1 + np.sign(h)) / 2, "floor": np.floor, "frac": lambda e: e - np.floor(e),
    "mod": lambda e, T: e - T * np.floor(e / T), "pw": lambda c, a, b: a if c else b, ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b, "<": lambda a, b: a < b, "<=": lambda a, b: a <= b, "and": lambda *c: all(c),
    "or": lambda *c: any(c), "xor": lambda a, b: a != b, "not": lambda c: not c,
}  # fmt: skip


def value(e, at):
    """The expression's number at a point; None of what has to be solved for."""
    if e[0] in _SIMPLE:
        return _SIMPLE[e[0]](at, *e[1:])
    if e[0] not in _OF_VALUES:
        return None
    parts = [value(part, at) for part in e[1:]]
    return None if any(part is None for part in parts) else _OF_VALUES[e[0]](*parts)


# ---- text


@dataclass(frozen=True)
class Style:
    """How a model is written; the first values are the plain way."""

    spelled: bool = False  # Piecewise for sign, Abs for Max, floor for Mod, negated conditions
    factor: float = 1  # of surfaces, of comparisons
    prefix: str = ""
    reverse: bool = False
    shift: float = 0  # of time
    size: float = 1  # of states
    pace: float = 1  # of time
    numbers: tuple | None = None  # in place of parameters
    written_out: bool = False  # the elements of a family one by one


class Writer:
    """The text of a model in a style."""

    def __init__(self, model, style):
        self.model, self.style = model, style
        self.ring = None if style.written_out else model.family
        self.names = [style.prefix + name for name in model.states]

    def name(self, kind, i):
        return {"p": "k", "m": "m", "d": "d", "a": "a", "lam": "lam", "D": "D"}[kind] + f"{i}"

    def number(self, c):
        return repr(int(c)) if c == int(c) and abs(c) < 1e9 else repr(float(c))

    def expression(self, e):
        """The text, in brackets where it has to be."""
        kind, s = e[0], self.style
        if kind == "num":
            return self.number(e[1]) if e[1] >= 0 else f"({self.number(e[1])})"
        if kind == "p" and s.numbers is not None:
            return f"({self.number(s.numbers[e[1]])})"
        if kind in ("p", "m", "d", "a", "lam"):
            return self.name(*e)
        if kind == "x":
            return self.names[e[1]] if s.size == 1 else f"{self.names[e[1]]}/{s.size!r}"
        if kind in ("own", "next"):
            y = f"{s.prefix}y"
            y = y if kind == "own" else f"ring.neighbour({y}, {e[1]})"
            return y if s.size == 1 else f"{y}/{s.size!r}"
        if kind == "t":
            shifted = f"(t - {s.shift!r})" if s.shift else "t"
            return shifted if s.pace == 1 else f"{shifted}/{s.pace!r}"
        if kind == "R":
            return f"R{e[1]}.reaction"
        if kind == "D":
            return f"D{e[1]}[{e[2]}]"
        if kind == "hid":
            lam, rho = f"lam{e[1]}", self.expression(e[2])
            return f"{lam}*(1 + {rho}*(1 - {lam}**2))"
        if kind == "+":
            return "(" + " + ".join(map(self.expression, e[1:])) + ")"
        if kind == "*":
            return "*".join(map(self.expression, e[1:]))
        if kind in COMPARISONS or kind in ("and", "or", "xor", "not"):
            return self.condition(e)
        parts = [self.expression(part) for part in e[1:]]
        return (self.spelled if s.spelled else self.plain)(kind, *parts)

    def plain(self, kind, *parts):
        h = self.times(parts[0]) if kind in ("sign", "H") else parts[0]
        return {
            "sin": lambda: f"sp.sin({h})",
            "sign": lambda: f"{self.side()}sp.sign({h})",
            "H": lambda: f"sp.Heaviside({h})" if self.style.factor > 0 else f"(1 - sp.Heaviside({h}))",
            "abs": lambda: f"sp.Abs({h})",
            "max": lambda: f"sp.Max({h}, {parts[1]})",
            "min": lambda: f"sp.Min({h}, {parts[1]})",
            "floor": lambda: f"sp.floor({h})",
            "frac": lambda: f"sp.frac({h})",
            "mod": lambda: f"sp.Mod({h}, {parts[1]})",
            "pw": lambda: f"sp.Piecewise(({parts[1]}, {h}), ({parts[2]}, True))",
        }[kind]()

    def spelled(self, kind, *parts):
        a, b = (*parts, "")[:2]
        return {
            "sin": lambda: f"sp.sin({a})",
            "sign": lambda: f"(2*sp.Heaviside({a}) - 1)",
            "H": lambda: f"(1 + sp.sign({a}))/2",
            "abs": lambda: f"sp.Max({a}, -{a})",
            "max": lambda: f"({a} + {b} + sp.Abs({a} - {b}))/2",
            "min": lambda: f"sp.Piecewise(({a}, {a} - ({b}) < 0), ({b}, True))",
            "floor": lambda: f"({a} - sp.frac({a}))",
            "frac": lambda: f"sp.Mod({a}, 1)",
            "mod": lambda: f"({a} - {b}*sp.floor({a}/{b}))",
            "pw": lambda: f"sp.Piecewise(({parts[2]}, sp.Not({a})), ({b}, True))",
        }[kind]()

    def side(self):
        return "-" if self.style.factor < 0 else ""

    def times(self, h):
        """A surface times the factor of the style and the size of the states."""
        factor = self.style.factor * self.style.size
        return h if factor == 1 else f"{factor!r}*{h}"

    def condition(self, c):
        """A condition."""
        if c[0] in COMPARISONS:
            kind = COMPARISONS[c[0]] if self.style.factor < 0 else c[0]
            a, b = (self.times(self.expression(e)) for e in c[1:])
            return f"({a} {kind} {b})"
        return f"sp.{c[0].capitalize()}({', '.join(map(self.condition, c[1:]))})"

    def moment(self, t):
        return repr((t + self.style.shift) * self.style.pace)

    def event(self, number, e):
        s = self.style
        parts = []
        if e.surface is not None:
            parts.append(self.times(self.expression(e.surface)))
        elif e.every is not None:
            parts.append(f"every={self.expression(e.every)}" + (f"*{s.pace!r}" if s.pace != 1 else ""))
        else:
            parts.append(f"at=[{', '.join(map(self.moment, e.at))}]")
        if e.direction:
            parts.append(f"direction={e.direction if s.factor > 0 else -e.direction}")
        if e.update:
            updates = [f"{self.target(x)}: {self.sized(x, self.expression(y))}" for x, y in e.update.items()]
            parts.append(f"update={{{', '.join(updates)}}}")
        if e.when is not None:
            parts.append(f"when={self.condition(e.when)}")
        if e.terminal:
            parts.append("terminal=True")
        return f'Event({", ".join(parts)}, name="E{number}")'

    def target(self, x):
        if x[0] == "own":
            return f"{self.style.prefix}y"
        return self.names[x[1]] if x[0] == "x" else f"m{x[1]}"

    def sized(self, x, text):
        return text if x[0] == "m" or self.style.size == 1 else f"{self.style.size!r}*({text})"

    def rate(self, i, e=None):
        s, text = self.style, self.expression(self.model.rates[i] if e is None else e)
        if s.size != 1 or s.pace != 1:
            text = f"{s.size / s.pace!r}*({text})"
        for state, size, time in self.model.kicks:
            if state == i:
                text += f" + ({size * s.size!r})*sp.DiracDelta(t - ({self.moment(time)}))"
        return text

    def text(self):
        """Source that makes the System S."""
        M, s = self.model, self.style
        numbers = range(len(M.parameters)) if s.numbers is None else ()
        alone = [name for name in self.names if not (self.ring and "y_" in name)]
        symbols = ["t", *alone, *(f"k{k}" for k in numbers)]
        symbols += [
            f"{kind}{i}" for kind, items in (("d", M.drives), ("a", M.unknowns)) for i in range(len(items))
        ]
        lines = ["import sympy as sp"]
        lines.append(
            "from pwsmooth import Algebraic, Disc, Drive, Event, Memory, Switch, System, Unilateral, solve"
        )
        lines.append(f'{", ".join(symbols)}, _ = sp.symbols("{" ".join(symbols)} _", real=True)')
        members = range(0)
        if self.ring:
            members = range(self.ring.first, self.ring.first + self.ring.n)
            name = f"{s.prefix}y"
            lines[1] = lines[1].replace("Event,", "Event, Family,")
            lines.append(f"ring = Family({self.ring.n}, periodic=True)")
            lines.append(f'({name},) = ring.symbols("{name}")')
            lines.append(
                ", ".join(self.names[i] for i in members) + f" = ring.at({name}, slice(1, {self.ring.n}))"
            )
        lines += [f'm{i} = Memory("m{i}", {initial!r})' for i, initial in enumerate(M.memories)]
        for j, h in enumerate(M.switches):
            lines.append(f'lam{j} = Switch("lam{j}", {self.times(self.expression(h))})')
            if s.factor < 0:
                lines.append(f"lam{j} = -lam{j}")
        for j, pair in enumerate(M.discs):
            surfaces = ", ".join(self.times(self.expression(h)) for h in pair)
            lines.append(f'D{j} = Disc("D{j}", ({surfaces}))')
            if s.factor < 0:
                lines.append(f"D{j} = [-D{j}[0], -D{j}[1]]")
        for k, (gap, e) in enumerate(M.contacts):
            lines.append(
                f'R{k} = Unilateral({self.expression(gap)}, restitution={self.expression(e)}, name="R{k}")'
            )
        order = range(len(M.states))[:: -1 if s.reverse else 1]
        coupled = M.mass[:2] if M.mass else ()
        rates = [f"{self.names[i]}: {self.rate(i)}" for i in order if i not in coupled and i not in members]
        if self.ring:
            rates.append(f"{s.prefix}y: {self.rate(-1, self.ring.rate)}")
        lines.append(f"rates = {{{', '.join(rates)}}}")
        events = [self.event(k, e) for k, e in enumerate(M.events)]
        if self.ring and self.ring.event:
            events = [self.event("ring", self.ring.event), *events[self.ring.n :]]
        lines.append(f"events = [{', '.join(events[:: -1 if s.reverse else 1])}]")
        options = ["time=t", "events=events"]
        if M.mass:
            forces = [f"{self.names[i]}: {self.rate(i)}" for i in coupled]
            m = self.expression(M.mass[2])
            options += [f"mass_matrix=sp.Matrix([[2, {m}], [{m}, 2]])", f"forcing={{{', '.join(forces)}}}"]
        if M.unknowns:
            rows = [
                f"Algebraic(a{i}, a{i} + {c!r}*a{i}**3 - {self.expression(e)})"
                for i, (c, e) in enumerate(M.unknowns)
            ]
            options.append(f"algebraic=[{', '.join(rows)}]")
        if M.drives:
            rows = [
                f"d{i}: Drive({[(float(t) + s.shift) * s.pace for t in times]}, {[float(v) for v in values]}, "
                f'kind="{"hold" if kind == "held" else "line"}")'
                for i, (kind, times, values) in enumerate(M.drives)
            ]
            options.append(f"drives={{{', '.join(rows)}}}")
        body = "\n".join([*lines[3:], *options])
        given = [f"k{k}" for k in numbers if _stands(f"k{k}", body) and f"k{k}" not in M.unused]
        options.append(f"parameters=dict.fromkeys([{', '.join(given)}], 1)")
        lines.append(f"S = System(rates, {', '.join(options)})")
        return "\n".join(lines)


def _stands(symbol, text):
    import re

    return re.search(rf"\b{symbol}\b", text) is not None
