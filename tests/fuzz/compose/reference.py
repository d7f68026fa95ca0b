"""What a model of the grammar does, from docs/event_contract.md alone; nothing of the package is used.

Every sign, Max, condition and stair is an atom with a frozen mode M, so that all between two instants is smooth:

    sign h = M    |h| = M h    max(a, b) = (a + b + M (a - b))/2    h > 0 is (1 + M)/2    floor h = M

DOP853 goes from zero to zero. At an instant events act, then impacts, then all assignments of modes to the atoms that
are at their zeros are tried: M = 1, M = -1, or M in [-1, 1] that keeps the zero (Filippov). The one that its own flow
keeps is taken. Where there is none, or several, or where what an update reads is open, the reference does not judge.
Chain: grammar.py -> **reference** -> __init__.py.
"""

from __future__ import annotations

import bisect
import itertools
import math
import time
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

from .grammar import COMPARISONS, Case, Event, Model, add, minus, mul, num, walk
from .stepping import Steps

AT_ZERO = 1e-8  # a surface that is nearer to 0 at an instant is at its zero
AHEAD = (1e-4, 3e-4)  # where the flow of an assignment is looked at
KEPT = 1e-11  # a surface that is further from 0 there has a side
LIFTED = 1e-14  # a gap that opens as the cube of time
FLAT = 1e-12  # one that is nearer stays at 0
REST = 2e-7  # a slower rebound is rest
STOP = 1e-9  # a slip in a disc that is slower has stopped
NUDGE = 2e-7  # slip with which a disc lets go
MOST = 400  # instants of a run that is judged
_EARLY = (
    1e-4,
    1e-3,
    0.01,
    0.03,
    0.1,
    0.2,
    0.4,
    0.6,
    0.8,
)  # shares of a sample: where what has left 0 is looked at
SECONDS = 10  # of the processor, for a run that is judged
TOO_SLOW = "reference too slow"


class UndecidedError(Exception):
    """The reference does not judge from here."""


# ---- from expressions to smooth ones with modes


@dataclass(frozen=True)
class Atom:
    """A surface with a mode; `kind` is "kink", "sign", "H", ">", ">=", "floor" or "hid" (with its strength)."""

    kind: str
    h: tuple
    strength: tuple | None = None


class Smooth:
    """The functions of a model: every expression lowered, and compiled as Python."""

    def __init__(self, model):
        self.model, self.atoms, self.numbers = model, [], {}
        self.n = len(model.states)
        self.unknowns = []
        for c, e in model.unknowns:
            self.unknowns.append(("cubic", c, self.lower(e)))
        self.rates = [self.lower(e) for e in model.rates]
        if model.mass:
            i, j, m = model.mass
            m, F, G = self.lower(m), self.rates[i], self.rates[j]
            det = minus(num(4), mul(m, m))
            self.rates[i] = ("/", minus(mul(num(2), F), mul(m, G)), det)
            self.rates[j] = ("/", minus(mul(num(2), G), mul(m, F)), det)
        self.gaps = [self.lower(gap) for gap, _ in model.contacts]
        self.speeds = [self.along(gap) for gap in self.gaps]
        self.restitutions = [self.lower(e) for _, e in model.contacts]
        self.discs = [tuple(map(self.lower, pair)) for pair in model.discs]
        self.surfaces = [None if e.surface is None else self.lower(e.surface) for e in model.events]
        self.updates = [{x: self.lower(y) for x, y in e.update.items()} for e in model.events]
        self.conditions = [None if e.when is None else self.truth(e.when) for e in model.events]
        self.periods = [None if e.every is None else self.lower(e.every) for e in model.events]
        self.f = self.compiled(self.rates)
        self.h = [self.compiled([a.h]) for a in self.atoms]
        self.all_h = self.compiled([a.h for a in self.atoms])
        self.dh = [self.gradient(a.h) for a in self.atoms]
        self.gap, self.speed = self.compiled(self.gaps), self.compiled(self.speeds)
        self.dgap = [self.gradient(e) for e in self.gaps]
        self.dspeed = [self.gradient(e) for e in self.speeds]
        self.restitution = self.compiled(self.restitutions)
        self.disc = self.compiled([h for pair in self.discs for h in pair])
        self.ddisc = [self.gradient(h) for pair in self.discs for h in pair]
        self.surface = self.compiled([num(1) if e is None else e for e in self.surfaces])
        self.update = [{x: self.compiled([y]) for x, y in u.items()} for u in self.updates]
        self.when = [None if c is None else self.compiled([c]) for c in self.conditions]
        self.every = [None if e is None else self.compiled([e]) for e in self.periods]
        self.below = [self.atoms_in(a.h) for a in self.atoms]  # atoms in the surface of an atom

    def atom(self, kind, h, strength=None):
        """The number of an atom."""
        key = Atom(kind, h, strength)
        if key not in self.numbers:
            self.numbers[key] = len(self.atoms)
            self.atoms.append(key)
        return ("M", self.numbers[key])

    def lower(self, e):
        """The expression with modes in place of switches."""
        kind = e[0]
        if kind in ("num", "p", "x", "t", "m", "d", "R", "D"):
            return e
        if kind == "a":
            return self.unknowns[e[1]]
        if kind == "lam":
            return self.atom("sign", self.lower(self.model.switches[e[1]]))
        if kind == "hid":
            return self.atom("hid", self.lower(self.model.switches[e[1]]), e[2])
        if kind == "pw":
            theta, a, b = self.truth(e[1]), self.lower(e[2]), self.lower(e[3])
            return add(b, mul(theta, minus(a, b)))
        parts = [self.lower(part) for part in e[1:]]
        if kind == "+":
            return add(*parts)
        if kind == "*":
            return mul(*parts)
        if kind == "sin":
            return ("sin", *parts)
        if kind == "sign":
            return self.atom("sign", parts[0])
        if kind == "H":
            return mul(num(0.5), add(num(1), self.atom("H", parts[0])))
        if kind == "abs":
            return mul(self.atom("kink", parts[0]), parts[0])
        if kind in ("max", "min"):
            a, b = parts
            bend = mul(self.atom("kink", minus(a, b)), minus(a, b))
            return mul(num(0.5), add(a, b, bend if kind == "max" else mul(num(-1), bend)))
        if kind in ("floor", "frac"):
            stairs = self.atom("floor", parts[0])
            return stairs if kind == "floor" else minus(parts[0], stairs)
        assert kind == "mod", kind
        return minus(parts[0], mul(parts[1], self.atom("floor", ("/", *parts))))

    def truth(self, c):
        """A condition as a number between 0 and 1."""
        kind = c[0]
        if kind in COMPARISONS:
            a, b = map(self.lower, c[1:])
            h = minus(a, b) if kind[0] == ">" else minus(b, a)
            return mul(num(0.5), add(num(1), self.atom(">" if len(kind) == 1 else ">=", h)))
        parts = [self.truth(part) for part in c[1:]]
        if kind == "not":
            return minus(num(1), parts[0])
        a, b = parts
        if kind == "and":
            return mul(a, b)
        return minus(add(a, b), mul(num(1 if kind == "or" else 2), a, b))

    def atoms_in(self, e):
        """Numbers of the atoms in a lowered expression, and of those in their surfaces."""
        found, left = set(), [e]
        while left:
            e = left.pop()
            if e[0] == "M":
                if e[1] not in found:
                    found.add(e[1])
                    left.append(self.atoms[e[1]].h)
            else:
                left += [part for part in e[1:] if isinstance(part, tuple)]
        return found

    def derivative(self, e, by):
        """Of a lowered expression by ("x", i) or ("t",); modes are constant."""
        kind = e[0]
        if e == by:
            return num(1)
        if kind in ("num", "p", "x", "t", "m", "R", "D", "M"):
            return num(0)
        if kind == "d":
            return ("slope", e[1]) if by == ("t",) else num(0)
        if kind == "slope":
            return num(0)
        if kind == "+":
            return add(*(self.derivative(part, by) for part in e[1:]))
        if kind == "*":
            parts = e[1:]
            return add(
                *(mul(*parts[:i], self.derivative(part, by), *parts[i + 1 :]) for i, part in enumerate(parts))
            )
        if kind == "sin":
            return mul(("cos", e[1]), self.derivative(e[1], by))
        if kind == "cos":
            return mul(num(-1), ("sin", e[1]), self.derivative(e[1], by))
        if kind == "/":
            a, b = e[1:]
            return ("/", minus(mul(self.derivative(a, by), b), mul(a, self.derivative(b, by))), mul(b, b))
        if kind == "cubic":
            c, inner = e[1:]
            slope = self.derivative(inner, by)
            return slope if slope == num(0) else ("/", slope, add(num(1), mul(num(3 * c), e, e)))
        raise AssertionError(kind)

    def along(self, e):
        """The rate of an expression."""
        parts = [mul(self.derivative(e, ("x", i)), self.rates[i]) for i in range(self.n)]
        return add(self.derivative(e, ("t",)), *parts)

    def gradient(self, e):
        """Function of the derivatives by time and by the states."""
        return self.compiled(
            [self.derivative(e, ("t",)), *(self.derivative(e, ("x", i)) for i in range(self.n))]
        )

    def compiled(self, expressions):
        """Function (t, x, M, p, m, d, s, R, D) -> list; d are values of drives, s their slopes."""
        body = ", ".join(map(self.source, expressions))
        return eval(
            f"lambda t, x, M, p, m, d, s, R, D: [{body}]", {"sin": math.sin, "cos": math.cos, "cubic": cubic}
        )

    def source(self, e):
        kind = e[0]
        if kind == "num":
            return f"({e[1]!r})"
        if kind == "t":
            return "t"
        if kind in ("x", "p", "m", "M", "R"):
            return f"{kind}[{e[1]}]"
        if kind == "d":
            return f"d[{e[1]}]"
        if kind == "slope":
            return f"s[{e[1]}]"
        if kind == "D":
            return f"D[{2 * e[1] + e[2]}]"
        if kind == "cubic":
            return f"cubic({e[1]!r}, {self.source(e[2])})" if e[1] else self.source(e[2])
        if kind in ("sin", "cos"):
            return f"{kind}({self.source(e[1])})"
        return "(" + f" {kind} ".join(map(self.source, e[1:])) + ")"


def cubic(c, e):
    """The a with a + c a^3 = e, c > 0."""
    a = e
    for _ in range(60):
        step = (a + c * a**3 - e) / (1 + 3 * c * a * a)
        a -= step
        if abs(step) < 1e-15 * (1 + abs(a)):
            break
    return a


# ---- a run


@dataclass
class Phase:
    """What is true between two instants: modes, what slides (atom -> stair or None), what is closed or sticks."""

    M: list
    slides: dict = field(default_factory=dict)
    closed: tuple = ()
    sticks: tuple = ()
    flat: tuple = ()  # atoms that stay at 0
    branches: tuple = ()  # modes on both sides of a slide that stands in other switches
    multipliers: list = field(default_factory=list)


@dataclass
class Answer:
    """States and memories at the instants, nan from where the reference does not judge; and why."""

    values: np.ndarray
    reason: str = ""
    end: float = math.inf  # time of a terminal event
    log: list = field(default_factory=list)  # (time, number of the event)
    marks: set = field(default_factory=set)


class Run:
    """One run of a model."""

    def __init__(self, smooth, case):
        self.S, self.case, self.p = smooth, case, case.p
        model = smooth.model
        self.m, self.t0, self.t1 = list(model.memories), case.t0, case.instants[-1]
        self.drives = [(kind, list(map(float, times)), list(map(float, y))) for kind, times, y in model.drives]
        self.cells = [bisect.bisect_right(times, case.t0) - 1 for _, times, _ in self.drives]
        self.answer = Answer(np.full((len(case.instants), smooth.n + len(self.m)), np.nan))
        self.clocks = self._clocks()
        self.ends = time.thread_time() + SECONDS

    def spend(self):
        """Stops a run that takes too long."""
        if time.thread_time() > self.ends:
            raise UndecidedError(TOO_SLOW)

    def _clocks(self):
        """Sorted (time, kind, number) of all that strikes after the start."""
        found = []
        zero = [0.0] * self.S.n
        for k, e in enumerate(self.S.model.events):
            if e.every is not None:
                T = self.S.every[k](self.t0, zero, [], self.p, self.m, [], [], [], [])[0]
                first, last = math.floor(self.t0 / T + 1e-9) + 1, math.floor(self.t1 / T + 1e-9)
                found += [(T * i, "event", k) for i in range(first, last + 1)]
            found += [(t, "event", k) for t in e.at if t > self.t0]
        found += [(t, "kick", k) for k, (_, _, t) in enumerate(self.S.model.kicks)]
        for k, (_, times, _) in enumerate(self.S.model.drives):
            found += [(float(t), "knot", k) for t in times if t > self.t0]
        return sorted(c for c in found if c[0] <= self.t1 + 1e-9)

    # ---- evaluation

    def given(self, t):
        """Parameters, memories, drives and their slopes at t."""
        d, s = [], []
        for (kind, times, values), cell in zip(self.drives, self.cells):
            slope = 0.0
            if kind == "line":
                slope = (values[cell + 1] - values[cell]) / (times[cell + 1] - times[cell])
            d.append(values[cell] + slope * (t - times[cell]))
            s.append(slope)
        return self.p, self.m, d, s

    def directions(self, t, x, P, given):
        """Multipliers of discs that slip."""
        if not self.S.discs:
            return []
        h = self.S.disc(t, x, P.M, *given, [0.0] * len(self.S.gaps), [])
        D = []
        for a, b in zip(h[::2], h[1::2]):
            size = math.hypot(a, b) or 1.0
            D += [a / size, b / size]
        return D

    def of(self, function, t, x, P, given, R, D):
        """A function's values; beside a slide in other switches the mean of both sides (Filippov)."""
        if not P.branches:
            return function(t, x, P.M, *given, R, D)
        share = (1 + P.multipliers[0]) / 2 if P.multipliers else 0.5
        sides = (function(t, x, M, *given, R, D) for M in P.branches)
        return [share * a + (1 - share) * b for a, b in zip(*sides)]

    def put(self, P, R, D, values):
        """Multipliers into modes, reactions and discs."""
        i = 0
        for j, stair in P.slides.items():
            P.M[j] = values[i] if stair is None else stair - 1 + (1 + values[i]) / 2
            i += 1
        for k in P.closed:
            R[k] = values[i]
            i += 1
        for k in P.sticks:
            D[2 * k], D[2 * k + 1] = values[i], values[i + 1]
            i += 2

    def field(self, t, x, P):
        """(rates, R, D); multipliers of what is held are solved for."""
        S, given = self.S, self.given(t)
        R, D = [0.0] * len(S.gaps), self.directions(t, x, P, given)
        size = len(P.slides) + len(P.closed) + 2 * len(P.sticks)
        if not size:
            return S.f(t, x, P.M, *given, R, D), R, D

        def residual(values):
            self.put(P, R, D, values)
            P.multipliers = values
            f = self.of(S.f, t, x, P, given, R, D)
            rows = [S.dh[j] for j in P.slides] + [S.dspeed[k] for k in P.closed]
            rows += [S.ddisc[2 * k + c] for k in P.sticks for c in (0, 1)]
            found = []
            for row in rows:
                g = row(t, x, P.M, *given, R, D)
                found.append(g[0] + sum(a * b for a, b in zip(g[1:], f)))
            return f, found

        mu = P.multipliers if len(P.multipliers) == size else [0.0] * size
        for _ in range(8):
            f, r = residual(mu)
            if max(map(abs, r)) < 1e-12:
                break
            columns = []
            for i in range(size):
                moved = list(mu)
                moved[i] += 1.0
                columns.append([b - a for a, b in zip(r, residual(moved)[1])])
            if size == 1:
                slope = columns[0][0]
                if abs(slope) < 1e-9:
                    raise UndecidedError("singular")
                mu = [mu[0] - r[0] / slope]
                continue
            J = np.array(columns).T
            if abs(np.linalg.det(J)) < 1e-9:
                raise UndecidedError("singular")
            mu = (np.array(mu) - np.linalg.solve(J, r)).tolist()
        else:
            raise UndecidedError("no multipliers")
        P.multipliers = mu
        self.put(P, R, D, mu)
        return f, R, D

    def ahead(self, t, x, P, step):
        """The state after a short step."""
        k1 = self.field(t, x, P)[0]
        k2 = self.field(t + step / 2, [a + step / 2 * b for a, b in zip(x, k1)], P)[0]
        k3 = self.field(t + step / 2, [a + step / 2 * b for a, b in zip(x, k2)], P)[0]
        k4 = self.field(t + step, [a + step * b for a, b in zip(x, k3)], P)[0]
        return [a + step / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4)]

    def bounds(self, P, R):
        """What must stay positive for what is held: 1 - |lambda|, R, 1 - |lambda| of discs."""
        mu, i, found = P.multipliers, 0, []
        for j in P.slides:
            found.append(self.bound(j) - abs(mu[i]))
            i += 1
        for _ in P.closed:
            found.append(mu[i])
            i += 1
        for _ in P.sticks:
            found.append(1 - math.hypot(mu[i], mu[i + 1]))
            i += 2
        return found

    def bound(self, j):
        """Largest multiplier of a slide; of hidden friction the height of its fold."""
        atom = self.S.atoms[j]
        if atom.kind != "hid":
            return 1.0
        rho = self.p[atom.strength[1]] if atom.strength[0] == "p" else atom.strength[1]
        if rho <= 0.5:
            return 1.0
        top = math.sqrt((1 + rho) / (3 * rho))
        return top * (1 + rho * (1 - top * top))

    def watch(self, t, x, P):
        """Values whose zeros end the phase; those of events at the end, of either sign."""
        S, given = self.S, self.given(t)
        f, R, D = self.field(t, x, P)
        found = []
        outer = set()
        for M in P.branches:
            outer = {j for j, below in enumerate(S.below) if below & P.slides.keys()}
            h = S.all_h(t, x, M, *given, R, D)
            for j in outer:
                stairs = S.atoms[j].kind == "floor"
                found += [h[j] - M[j], M[j] + 1 - h[j]] if stairs else [M[j] * h[j]]
        for j, (atom, h) in enumerate(zip(S.atoms, S.all_h(t, x, P.M, *given, R, D))):
            if j in P.slides or j in outer:
                continue
            if j in P.flat:
                found.append(1e-7 - abs(h))
            elif atom.kind == "floor":
                found += [h - P.M[j], P.M[j] + 1 - h]
            else:
                found.append(P.M[j] * h)
        found += self.bounds(P, R)
        if S.gaps:
            gap = S.gap(t, x, P.M, *given, R, D)
            found += [gap[k] for k in range(len(gap)) if k not in P.closed]
        if S.discs:
            h = S.disc(t, x, P.M, *given, R, D)
            found += [
                math.hypot(h[2 * k], h[2 * k + 1]) - STOP for k in range(len(S.discs)) if k not in P.sticks
            ]
        return found + self.of(S.surface, t, x, P, given, R, D)

    # ---- between instants

    def travel(self, t, x, P, end):
        """(time, state) of the next zero, or of the end; `self.before` has the sides of events on the way."""
        at = 0  # next wanted instant
        instants = self.case.instants
        while at < len(instants) and instants[at] < t:
            at += 1

        def rates(t, x):
            return self.field(t, x, P)[0]

        steps = Steps(rates, t, x, end, min(0.1, self.flight(t, x, P) / 3))
        before = t, self.watch(t, x, P)
        m = len(before[1]) - len(self.S.surfaces)
        seen = [1e-9] * len(before[1])  # a value that is nearer to 0 has no sign yet
        if open_gaps := len(self.S.gaps) - len(P.closed):
            first_gap = m - open_gaps - (len(self.S.discs) - len(P.sticks))
            seen[first_gap : first_gap + open_gaps] = [1e-15] * open_gaps
        armed = [(h > by) - (h < -by) for h, by in zip(before[1], seen)]
        last = None
        while steps.t < end:
            if not steps.go() or not all(map(math.isfinite, steps.y)):
                raise UndecidedError("no step")
            self.spend()
            dense = steps.polynomial()
            first = math.inf
            apart = (steps.t - steps.t_old) / 4
            for s in (*(steps.t_old + i * apart for i in (1, 2, 3)), steps.t):
                now = self.watch(s, dense(s), P)
                if crossed := [k for k, h in enumerate(now) if armed[k] * h < 0]:
                    first = min(self.root(k, before[0], s, dense, P) for k in crossed)
                    break
                if not all(armed) and any(not armed[k] and now[k] < -seen[k] for k in range(m)):
                    raise UndecidedError("a mode that does not hold")
                if last is not None:
                    for k, (a, b, c) in enumerate(zip(last[1], before[1], now)):
                        if abs(b) < 0.05 and abs(b) < abs(a) and abs(b) < abs(c) and armed[k]:
                            first = min(first, self.dip(k, armed[k], last[0], before[0], s, dense, steps, P))
                    if first < math.inf:
                        break
                if not all(armed):
                    told = [a or (h > by) - (h < -by) for a, h, by in zip(armed, now, seen)]
                    new = [k for k in range(len(told)) if told[k] != armed[k]]
                    for share in _EARLY if new else ():
                        u = before[0] + share * (s - before[0])
                        early = self.watch(u, dense(u), P)
                        if any(told[k] * early[k] < -seen[k] for k in new):
                            raise UndecidedError("instants close to each other")
                    armed = told
                last, before = before, (s, now)
            stop = min(first, steps.t)
            while at < len(instants) and instants[at] < stop:
                self.keep(at, dense(instants[at]))
                at += 1
            self.before = armed[m:]
            if first < math.inf:
                again = Steps(rates, steps.t_old, steps.x, first, first=first - steps.t_old)
                while again.t < first:
                    if not again.go():
                        raise UndecidedError("no step")
                return first, again.y
        return steps.t, steps.y

    def flight(self, t, x, P):
        """Time until the next bounce of a contact that has just rebounded; inf without one."""
        S, shortest = self.S, math.inf
        if len(S.gaps) == len(P.closed):
            return shortest
        f, R, D = self.field(t, x, P)
        given = self.given(t)
        gap, speed = S.gap(t, x, P.M, *given, R, D), S.speed(t, x, P.M, *given, R, D)
        for k, (g, v) in enumerate(zip(gap, speed)):
            if k not in P.closed and abs(g) < AT_ZERO and v > 0:
                row = S.dspeed[k](t, x, P.M, *given, R, D)
                pull = row[0] + sum(a * b for a, b in zip(row[1:], f))
                if pull < 0:
                    shortest = min(shortest, -2 * v / pull)
        return shortest

    def root(self, k, a, b, dense, P):
        def at(s):
            return self.watch(s, dense(s), P)[k]

        if at(a) * at(b) > 0:
            raise UndecidedError("a zero at the beginning of a step")
        return brentq(at, a, b, xtol=1e-14, rtol=1e-14)

    def dip(self, k, side, a, b, c, dense, steps, P):
        """A pair of zeros between three points at which the sign is the same: the first; inf without."""
        a = max(a, steps.t_old)
        times = [*(a + i * ((c - a) / 32) for i in range(32)), c]
        values = [side * self.watch(s, dense(s), P)[k] for s in times]
        i = values.index(min(values))
        if values[i] < 0:
            return (
                self.root(k, times[i - 1] if i else a, times[i], dense, P)
                if i and values[i - 1] > 0
                else math.inf
            )
        if 0 < i < 32:
            u, v, w = values[i - 1 : i + 2]
            if v - (u - w) ** 2 / (8 * (u + w - 2 * v) or 1) < 1e-6:
                raise UndecidedError("touch")
        return math.inf

    def keep(self, at, y):
        """Values at a wanted instant."""
        self.answer.values[at] = [*y, *self.m]

    # ---- at an instant

    def modes(self, t, x, before, exact_time):
        """Pointwise modes, and the atoms that are at their zeros in a way that values before do not tell."""
        S, given = self.S, self.given(t)
        M, doubt = [0.0] * len(S.atoms), set()
        R, D = [0.0] * len(S.gaps), [0.0] * 2 * len(S.discs)
        for j, atom in enumerate(S.atoms):
            h = S.h[j](t, x, M, *given, R, D)[0]
            near = round(h) if atom.kind == "floor" else 0
            M[j] = math.floor(h) if atom.kind == "floor" else math.copysign(1, h)
            if abs(h - near) < AT_ZERO:
                if not self.is_exact(atom.h, exact_time):
                    doubt.add(j)
                M[j] = (
                    near if atom.kind == "floor" else {">": -1, ">=": 1, "sign": 0, "kink": 0}.get(atom.kind, 0)
                )
                if atom.kind in ("H", "hid"):
                    doubt.add(j)
            elif any(i in doubt for i in S.below[j]):
                doubt.add(j)
        return M, doubt

    def is_exact(self, e, exact_time):
        """Whether rounding has no part in an expression."""
        kind = e[0]
        if kind in ("x", "R", "D", "cubic", "sin", "cos"):
            return False
        if kind == "t":
            return exact_time
        if kind == "d":
            return self.S.model.drives[e[1]][0] == "held"
        if kind == "M":
            return self.is_exact(self.S.atoms[e[1]].h, exact_time)
        return all(self.is_exact(part, exact_time) for part in e[1:] if isinstance(part, tuple))

    def read(self, function, expression, t, x, M, doubt):
        """An expression's value; undecided if it reads an atom that is at its zero."""
        if self.S.atoms_in(expression) & doubt:
            raise UndecidedError("an update reads a switch at its zero")
        inside = [expression, *(self.S.atoms[j].h for j in self.S.atoms_in(expression))]
        if self.knots and "'d'" in str(inside):
            raise UndecidedError("an update reads a drive at its knot")
        zeros = [0.0] * len(self.S.gaps), [0.0] * 2 * len(self.S.discs)
        return function(t, x, M, *self.given(t), *zeros)[0]

    def events(self, t, x, P, struck, passed=None):
        """Events, in rounds: the state after, and whether the run ends; `passed` are due by a jump of their surface."""
        S, model = self.S, self.S.model
        clock = [k for _, kind, k in struck if kind == "event"]
        kicks = [k for _, kind, k in struck if kind == "kick"]
        exact = bool(struck)
        self.reached = set()
        due = set(clock) | self.met(t, x, P) if passed is None else set(passed)
        self.due = due
        self.knots = {k for _, kind, k in struck if kind == "knot"}
        acted, terminal, moved = set(), False, False
        kicked = list(kicks)
        if struck:
            # What is a number at the instant has that value from there on: a surface jumps with it first of all.
            for k, a in enumerate(self.sides(t, x, P, *self.modes(t, x, P, exact))):
                if a and self.before[k] * a < 0 and model.events[k].direction in (0, a):
                    due.add(k)
                self.before[k] = a or self.before[k]
        for _ in range(40):
            M, doubt = self.modes(t, x, P, exact and not moved)
            now = []
            for k in sorted(due - acted):
                c = model.events[k]
                if c.when is None or self.read(S.when[k], S.conditions[k], t, x, M, doubt) > 0.5:
                    now.append(k)
            if not now and not kicked and not self.knots:
                return x, terminal
            writes = {}
            for k in now:
                for target, function in S.update[k].items():
                    new = self.read(function, S.updates[k][target], t, x, M, doubt)
                    writes.setdefault(target, []).append((self.increment(k, target, t, x, M), new))
                self.answer.log.append((t, k))
                terminal |= model.events[k].terminal
            for k in kicked:
                i, size, _ = model.kicks[k]
                writes.setdefault(("x", i), []).append((size, x[i] + size))
            kicked = []
            sides = self.sides(t, x, P, M, doubt)
            x = list(x)
            for (kind, i), given in writes.items():
                values = x if kind == "x" else self.m
                if all(d is not None for d, _ in given):
                    values[i] += sum(d for d, _ in given)
                elif any(abs(new - given[0][1]) > 1e-12 for _, new in given):
                    raise UndecidedError("conflicting updates")
                else:
                    values[i] = given[0][1]
            moved = moved or any(kind == "x" for kind, _ in writes)
            acted = (acted | set(now)) & due
            if writes or self.knots:
                for k in self.knots:  # a sample acts with the others of its instant
                    self.cells[k] = min(self.cells[k] + 1, len(model.drives[k][1]) - 2)
                self.knots = set()
                M, doubt = self.modes(t, x, P, exact)
                after = self.sides(t, x, P, M, doubt)
                for k, e in enumerate(model.events):
                    if e.surface is None:
                        continue
                    if k in now:  # no event is fired by its own update
                        self.before[k] = after[k] or 0
                        continue
                    a, b = sides[k], after[k]
                    self.before[k] = b or 0
                    if a is None or b is None:
                        if k not in due and a != b:
                            raise UndecidedError("an update that ends on a surface")
                        continue
                    if a * b < 0 and e.direction in (0, b):
                        due.add(k)
                        acted.discard(k)
        raise UndecidedError("event loop")

    def increment(self, k, target, t, x, M):
        """What an update adds, or None: x -> x + e where e does not read x."""
        y = self.S.model.events[k].update[target]
        if y[0] != "+" or target not in y[1:]:
            return None
        rest = [part for part in y[1:] if part != target]
        if len(rest) != len(y) - 2 or any(part == target for part in walk(("+", *rest))):
            return None
        now = self.S.update[k][target](
            t, x, M, *self.given(t), [0.0] * len(self.S.gaps), [0.0] * 2 * len(self.S.discs)
        )
        return now[0] - (x[target[1]] if target[0] == "x" else self.m[target[1]])

    def sides(self, t, x, P, M, doubt):
        """Sign of each event's surface; None at its zero or where it is open."""
        S, found = self.S, []
        for k, e in enumerate(S.model.events):
            if e.surface is None or S.atoms_in(S.surfaces[k]) & doubt:
                found.append(None)
                continue
            h = S.surface(t, x, M, *self.given(t), [0.0] * len(S.gaps), [0.0] * 2 * len(S.discs))[k]
            found.append(None if abs(h) < AT_ZERO else int(math.copysign(1, h)))
        return found

    def met(self, t, x, P):
        """Events whose surface the motion has reached in their direction."""
        S, found = self.S, set()
        if not any(e.surface is not None for e in S.model.events) or self.started:
            return found
        R, D = self.field(t, x, P)[1:]
        now = self.of(S.surface, t, x, P, self.given(t), R, D)
        near = [k for k, e in enumerate(S.model.events) if e.surface is not None and abs(now[k]) < AT_ZERO]
        jumping = self.jumping(t, x, P)
        for k in list(near):
            if beside := S.atoms_in(S.surfaces[k]) & jumping:
                near.remove(k)
                if not all(S.atoms[j].kind == "floor" and self.is_exact(S.atoms[j].h, True) for j in beside):
                    raise UndecidedError("an event and a switch in it at one instant")
        if not near:
            return found
        y = self.ahead(t, x, P, -AHEAD[0])
        R, D = self.field(t - AHEAD[0], y, P)[1:]
        before = self.of(S.surface, t - AHEAD[0], y, P, self.given(t - AHEAD[0]), R, D)
        y = self.ahead(t, x, P, AHEAD[0])
        R, D = self.field(t + AHEAD[0], y, P)[1:]
        after = self.of(S.surface, t + AHEAD[0], y, P, self.given(t + AHEAD[0]), R, D)
        for k in near:
            if max(abs(before[k]), abs(after[k])) < KEPT:
                continue  # it stays at 0
            if min(abs(before[k]), abs(after[k])) < KEPT or before[k] * after[k] > 0:
                raise UndecidedError("touch of an event")
            if self.last is not None and t - self.last < 2 * AHEAD[0]:
                raise UndecidedError("instants close to each other")
            side = int(math.copysign(1, after[k]))
            self.before[k] = side
            self.reached.add(k)
            if S.model.events[k].direction in (0, side):
                found.add(k)
        return found

    def jumping(self, t, x, P):
        """Atoms at their zeros."""
        S, given, found = self.S, self.given(t), set()
        R, D = [0.0] * len(S.gaps), [0.0] * 2 * len(S.discs)
        for j, (atom, h) in enumerate(zip(S.atoms, S.all_h(t, x, P.M, *given, R, D))):
            if abs(h - (round(h) if atom.kind == "floor" else 0)) < AT_ZERO and j not in P.slides:
                found.add(j)
        return found

    def passed(self, t, x, P):
        """Events through whose surface something else than the motion and updates has carried it."""
        S, found = self.S, set()
        R, D = self.field(t, x, P)[1:]
        now = self.of(S.surface, t, x, P, self.given(t), R, D)
        for k, e in enumerate(S.model.events):
            if e.surface is None or not self.before[k]:
                continue
            if abs(now[k]) < AT_ZERO:
                y = self.ahead(t, x, P, AHEAD[0])  # one that rests there is left without firing
                R, D = self.field(t + AHEAD[0], y, P)[1:]
                ahead = self.of(S.surface, t + AHEAD[0], y, P, self.given(t + AHEAD[0]), R, D)[k]
                if abs(ahead) > KEPT and (k not in self.due | self.reached or ahead * self.before[k] < 0):
                    raise UndecidedError("a surface that jumps onto its zero")
                if k not in self.due | self.reached:
                    self.before[k] = 0
                continue
            side = int(math.copysign(1, now[k]))
            if side != self.before[k] and e.direction in (0, side):
                found.add(k)
            self.before[k] = side
        return found

    def impacts(self, t, x, P):
        """The state after all contacts that close have rebounded."""
        S = self.S
        if not S.gaps:
            return x
        for _ in range(20):
            given, R, D = self.given(t), [0.0] * len(S.gaps), self.directions(t, x, P, self.given(t))
            for k in P.sticks:
                D[2 * k], D[2 * k + 1] = P.multipliers[-2:] if len(P.multipliers) >= 2 else (0.0, 0.0)
            gap, speed = S.gap(t, x, P.M, *given, R, D), S.speed(t, x, P.M, *given, R, D)
            if min(gap) < -AT_ZERO:
                raise UndecidedError("start inside a stop")
            hit = [k for k in range(len(gap)) if gap[k] < AT_ZERO and speed[k] < -1e-12]
            if not hit:
                return x
            if len(hit) > 1:
                raise UndecidedError("impacts at one instant")
            x = self.impact(hit[0], t, x, P, given, D, speed[hit[0]])
            row = S.dgap[hit[0]](t, x, P.M, *given, R, D)[1:]
            off = gap[hit[0]] / sum(a * a for a in row)
            x = [a - off * b for a, b in zip(x, row)]
            self.answer.marks.add("impact")
        raise UndecidedError("impacts without an end")

    def impact(self, k, t, x, P, given, D, speed, e=None):
        """The state after one contact's impact, with Coulomb's law for friction in its push."""
        S = self.S
        e = S.restitution(t, x, P.M, *given, [], D)[k] if e is None else e
        row = S.dspeed[k](t, x, P.M, *given, [0.0] * len(S.gaps), D)[1:]

        def push(M):
            R = [0.0] * len(S.gaps)
            f = S.f(t, x, M, *given, R, D)
            R[k] = 1.0
            return [b - a for a, b in zip(f, S.f(t, x, M, *given, R, D))]

        def after(M):
            B = push(M)
            along = sum(a * b for a, b in zip(row, B))
            rebound = -e * speed if -e * speed > REST else 0.0
            impulse = (rebound - speed) / along
            return [a + impulse * b for a, b in zip(x, B)]

        rubbing = []
        for j, atom in enumerate(S.atoms):
            if atom.kind in ("sign", "H", ">", ">=", "hid"):
                low, high = list(P.M), list(P.M)
                low[j], high[j] = -1.0, 1.0
                if max(abs(a - b) for a, b in zip(push(low), push(high))) > 1e-12:
                    rubbing.append(j)
        if not rubbing:
            return after(P.M)
        if len(rubbing) > 1:
            raise UndecidedError("several frictions in a push")
        j = rubbing[0]

        def slip(value):
            M = list(P.M)
            M[j] = value
            y = after(M)
            return S.h[j](t, y, M, *given, [0.0] * len(S.gaps), D)[0], y

        high, low = slip(1.0), slip(-1.0)
        if high[0] > 0 and low[0] < 0:
            raise UndecidedError("several impulses")
        if high[0] > 0:
            return high[1]
        if low[0] < 0:
            return low[1]
        self.answer.marks.add("stuck impact")
        return slip(brentq(lambda value: slip(value)[0], -1, 1, xtol=1e-15))[1]

    def let_go(self, t, x, P, k):
        """The state with a little slip in the disc k, in the direction of the multiplier that would hold it."""
        S, given = self.S, self.given(t)
        Q = Phase(list(P.M), dict(P.slides), P.closed, (k,))
        D = self.field(t, x, Q)[2][2 * k : 2 * k + 2]
        zeros = [0.0] * len(S.gaps), [0.0] * 2 * len(S.discs)
        for c in (0, 1):
            g = S.ddisc[2 * k + c](t, x, P.M, *given, *zeros)[1:]
            by = NUDGE * D[c] / math.hypot(*D) / sum(a * a for a in g)
            x = [a + by * b for a, b in zip(x, g)]
        self.x = x
        return x

    def settle(self, t, x, P, nudged=False):
        """The phase from here: the one assignment that its own flow keeps; `self.x` is the state."""
        S, given = self.S, self.given(t)
        self.x = x
        R = [0.0] * len(S.gaps)
        choices = []
        gap, speed = [], []
        if S.gaps:
            D = self.directions(t, x, P, given)
            gap, speed = S.gap(t, x, P.M, *given, R, D), S.speed(t, x, P.M, *given, R, D)
        closing = [k for k in range(len(gap)) if gap[k] < AT_ZERO and abs(speed[k]) <= REST]
        h = S.disc(t, x, P.M, *given, R, []) if S.discs else []
        resting = [k for k in range(len(S.discs)) if math.hypot(h[2 * k], h[2 * k + 1]) < 10 * STOP]

        def assign(j, M, slides, flat, doubtful, both=()):
            if j == len(S.atoms):
                choices.append((list(M), dict(slides), tuple(flat), tuple(doubtful), tuple(map(list, both))))
                if len(choices) > 300:
                    raise UndecidedError("too many at one instant")
                return
            atom = S.atoms[j]
            stairs = atom.kind == "floor"

            def side(M):
                """The mode, or None at a zero; and the stair."""
                value = S.h[j](t, x, M, *given, R, [0.0] * 2 * len(S.discs))[0]
                near = round(value) if stairs else 0
                if abs(value - near) < AT_ZERO:
                    return None, near
                return math.floor(value) if stairs else math.copysign(1, value), near

            def go_on(mode, slides, flat, doubtful):
                M[j] = mode
                for other in both:
                    other[j] = mode
                assign(j + 1, M, slides, flat, doubtful, both)

            if both and S.below[j] & slides.keys():
                modes = [side(other)[0] for other in both]
                if None in modes:
                    return  # a zero of a switch of a slide: not tried
                for other, mode in zip(both, modes):
                    other[j] = mode
                M[j] = modes[0]
                assign(j + 1, M, slides, flat, doubtful, both)
                return
            mode, near = side(M)
            if mode is not None:
                go_on(mode, slides, flat, doubtful)
                return
            for mode in (1, -1):
                value = (near if mode == 1 else near - 1) if stairs else mode
                go_on(value, slides, flat, [*doubtful, (j, near, mode)])
            go_on({">": -1, ">=": 1}.get(atom.kind, near), slides, [*flat, j], [*doubtful, (j, near, 0)])
            if atom.kind == "kink":
                return
            if any(j in below for below in S.below):
                if slides or both:
                    return
                M[j] = near - 0.5 if stairs else 0.0
                pair = list(M), list(M)
                pair[0][j], pair[1][j] = (near, near - 1) if stairs else (1.0, -1.0)
                assign(j + 1, M, {j: near if stairs else None}, flat, doubtful, pair)
            elif not both:
                go_on(near - 0.5 if stairs else 0.0, {**slides, j: near if stairs else None}, flat, doubtful)

        assign(0, [0.0] * len(S.atoms), {}, [], [])
        kept = []
        held = [c for n in range(len(closing) + 1) for c in itertools.combinations(closing, n)]
        stuck = [c for n in range(len(resting) + 1) for c in itertools.combinations(resting, n)]
        if len(choices) * len(held) * len(stuck) > 600:
            raise UndecidedError("too many at one instant")
        for (M, slides, flat, doubtful, both), closed, sticks in itertools.product(choices, held, stuck):
            if len(sticks) < len(resting):
                continue  # a disc that does not stick is looked at below
            Q = Phase(list(M), slides, closed, sticks, flat, both)
            found = self.flows(t, x, Q, doubtful, [k for k in closing if k not in closed])
            if found is not None:
                kept.append((Q, found, [d for d in doubtful]))
        kept = self.without_twins(kept)
        if len(kept) > 1:
            kept = self.by_history(kept, P)
        if not kept and resting and not nudged:
            return self.settle(t, self.let_go(t, x, P, resting[0]), P, True)
        if not kept:
            raise UndecidedError("a disc that does not stick" if resting else "no assignment")
        if len(kept) > 1:
            raise UndecidedError("several assignments")
        Q = kept[0][0]
        for j, near, mode in kept[0][2]:
            if mode and not nudged and S.atoms[j].kind == "floor":
                self.require_one_way(t, x, Q, j, near)
        for j in Q.slides:
            self.answer.marks.add("slide")
            self.require_affine(t, x, Q, j)
        for j in Q.flat:
            self.answer.marks.add("flat")
            if S.atoms[j].kind == "H":
                raise UndecidedError("Heaviside(0)")
        return Q

    def flows(self, t, x, Q, doubtful, open_):
        """States ahead if the assignment's own flow keeps it, else None."""
        S, found = self.S, []
        self.spend()
        try:
            for step in AHEAD:
                y = self.ahead(t, x, Q, step)
                f, R, D = self.field(t + step, y, Q)
                if any(b < 1e-10 if k < len(Q.slides) else b < 0 for k, b in enumerate(self.bounds(Q, R))):
                    return None
                h = S.all_h(t + step, y, Q.M, *self.given(t + step), R, D) if doubtful else []
                for j, near, mode in doubtful:
                    off = h[j] - near
                    if mode and mode * off < KEPT:
                        return None
                    if not mode and abs(off) > max(FLAT, 2e-16 * abs(t)):
                        return None
                if open_:
                    gap = S.gap(t + step, y, Q.M, *self.given(t + step), R, D)
                    if any(gap[k] < LIFTED for k in open_):
                        return None
                found.append(y)
        except UndecidedError:
            return None
        return found

    def without_twins(self, kept):
        """One of those whose flows are the same."""
        found = []
        for one in kept:
            for k, other in enumerate(found):
                if np.abs(np.subtract(one[1], other[1])).max() < 1e-13:
                    if one[0].flat and not other[0].flat:
                        found[k] = one
                    break
            else:
                found.append(one)
        return found

    def by_history(self, kept, P):
        """Hidden friction holds what it has, and takes what comes to it."""
        hidden = [j for j, atom in enumerate(self.S.atoms) if atom.kind == "hid"]
        if self.started or not any(j in one[0].slides for one in kept for j in hidden):
            return kept
        return [one for one in kept if any(j in one[0].slides for j in hidden)]

    def require_one_way(self, t, x, Q, j, near):
        """Stairs that cross lead to one side also with what jumps with them on either of its sides; else there are
        hidden terms: what the stairs are between two of their steps may hold the motion.
        """
        S, given = self.S, self.given(t)
        R, D = self.field(t, x, Q)[1:]
        outer = [k for k, below in enumerate(S.below) if j in below]
        sides, ways = [], set()
        for stair in (near - 1, near):
            M = list(Q.M)
            M[j] = stair
            for k in outer:
                h = S.h[k](t, x, M, *given, R, D)[0]
                M[k] = math.floor(h) if S.atoms[k].kind == "floor" else math.copysign(1, h)
            sides.append(M)
        for M in sides if sides[0][:j] + sides[0][j + 1 :] != sides[1][:j] + sides[1][j + 1 :] else []:
            for stair in (near - 1, near):
                M[j] = stair
                g = S.dh[j](t, x, M, *given, R, D)
                ways.add(g[0] + sum(a * b for a, b in zip(g[1:], S.f(t, x, M, *given, R, D))) > 0)
        if len(ways) > 1:
            raise UndecidedError("hidden terms")

    def require_affine(self, t, x, Q, j):
        """The multiplier of a slide acts affinely on its surface, pushing back; else there are hidden terms."""
        S, given = self.S, self.given(t)
        R, D = self.field(t, x, Q)[1:]
        rates = []
        for value in (-1.0, 1.0) if Q.branches else (-1.0, 0.0, 1.0):
            M, stair = list(Q.M if not Q.branches else Q.branches[value < 0]), Q.slides[j]
            M[j] = value if stair is None else stair - 1 + (1 + value) / 2
            g = S.dh[j](t, x, M, *given, R, D)
            rates.append(g[0] + sum(a * b for a, b in zip(g[1:], S.f(t, x, M, *given, R, D))))
        if not Q.branches and abs(rates[0] + rates[-1] - 2 * rates[1]) > 1e-9:
            raise UndecidedError("hidden terms")
        if Q.branches:
            above, below = Q.branches
            alone = list(below)
            alone[j] = above[j]
            bends = any(a.kind == "kink" and u != v for a, u, v in zip(S.atoms, above, below))
            moves = np.abs(np.subtract(S.f(t, x, alone, *given, R, D), S.f(t, x, below, *given, R, D))).max()
            if bends or (S.atoms[j].kind == "floor" and moves > 1e-9):
                raise UndecidedError(
                    "hidden terms"
                )  # within the layer rates are not between those of both sides
        if rates[-1] > rates[0]:
            raise UndecidedError("a slide that repels")

    # ---- the whole run

    def go(self):
        """The answer."""
        try:
            self.whole()
        except UndecidedError as reason:
            self.answer.reason = str(reason)
        except (OverflowError, ZeroDivisionError, np.linalg.LinAlgError, ValueError) as error:
            self.answer.reason = f"{type(error).__name__}: {error}"
        return self.answer

    def whole(self):
        t, x = self.t0, list(self.case.start)
        self.started, self.last = True, None
        self.before, self.due, self.knots, self.reached = [0] * len(self.S.surfaces), set(), set(), set()
        P = Phase([0.0] * len(self.S.atoms))
        x = self.impacts(t, x, P) if self.S.gaps else x
        P = self.settle(t, x, P)
        x = self.x
        self.started = False
        clocks = list(self.clocks)
        for _ in range(MOST):
            end = min(self.t1, clocks[0][0]) if clocks else self.t1
            self.last = t
            at, x = self.travel(t, x, P, end) if end > t else (t, x)
            for target in [c[0] for c in clocks[:1]] + [self.t1]:
                if at != target and abs(at - target) < 1e-10 * max(1, abs(target)):
                    x = self.ahead(at, x, P, target - at)
                    at = target
            t = at
            struck = [c for c in clocks if abs(c[0] - t) <= 1e-12 * max(1, abs(t))]
            at_end = t >= self.t1
            if at_end and not struck:
                self.finish(t, x, P)
                return
            clocks = clocks[len(struck) :]
            x, terminal = self.events(t, x, P, struck)
            for _ in range(20):
                if terminal:
                    self.answer.end = t
                    return
                x = self.impacts(t, self.stop(t, x, P), P)
                P = self.settle(t, x, P)
                x = self.x
                passed = self.passed(t, x, P)
                if not passed:
                    break
                x, terminal = self.events(t, x, P, [], passed)
            else:
                raise UndecidedError("event loop")
            if at_end:
                self.finish(t, x, P)
                return
        raise UndecidedError("accumulation")

    def finish(self, t, x, P):
        """The last wanted instant; open where a surface of an event is met at it."""
        if t != self.last and self.met(t, x, P):
            raise UndecidedError("an event at the end")
        if self.S.gaps:
            zeros = [0.0] * len(self.S.gaps), [0.0] * 2 * len(self.S.discs)
            gap = self.S.gap(t, x, P.M, *self.given(t), *zeros)
            if any(abs(g) < AT_ZERO for k, g in enumerate(gap) if k not in P.closed):
                raise UndecidedError("an impact at the end")
        self.keep(len(self.case.instants) - 1, x)

    def stop(self, t, x, P):
        """A slip in a disc that has become slower than STOP is 0."""
        S = self.S
        if not S.discs:
            return x
        zeros = [0.0] * len(S.gaps), [0.0] * 2 * len(S.discs)
        h = S.disc(t, x, P.M, *self.given(t), *zeros)
        for k in range(len(S.discs)):
            if k not in P.sticks and math.hypot(h[2 * k], h[2 * k + 1]) < 2 * STOP:
                for c in (0, 1):
                    g = S.ddisc[2 * k + c](t, x, P.M, *self.given(t), *zeros)[1:]
                    size = sum(a * a for a in g)
                    x = [a - h[2 * k + c] * b / size for a, b in zip(x, g)]
        return x


def answer(smooth, case):
    """What the reference says of a case."""
    return Run(smooth, case).go()


def closed_forms():
    """(what, the reference's number, the closed form) of motions that are known."""

    def end(model, start, t):
        return answer(Smooth(model), Case([], start, 0.0, [t])).values[-1]

    x, v, time = ("x", 0), ("x", 1), ("t",)
    # Friction stops a body after v/mu.
    body = Model(["x0", "v"], [v, mul(num(-2), ("sign", v))])
    yield "friction stops", end(body, [0.0, 3.0], 4.0)[0], 9 / 4
    # A ball that falls from 1 with restitution 1/2 is at rest from 3 sqrt(2/9.81) on; then a force lifts it.
    late = (">", minus(time, num(2)), num(0))
    force = add(num(-9.81), ("R", 0), mul(num(11), ("pw", late, num(1), num(0))))
    ball = Model(["q", "u"], [v, force], contacts=[(x, num(0.5))])
    yield "a ball is lifted", end(ball, [1.0, 0.0], 4.0)[0], 1.19 * 2**2 / 2
    # A pulse of 0.3 in every period of 0.5.
    duty = ("<", ("mod", time, num(0.5)), num(0.3))
    yield "pulses", end(Model(["x0"], [("pw", duty, num(1), num(0))]), [0.0], 2.2)[0], 4 * 0.3 + 0.2
    # Hidden friction holds up to its fold: lam (1 + (1 - lam^2)) has the height 2 sqrt(2/3) 2/3.
    held = Model(["v"], [minus(time, ("hid", 0, num(1)))], switches=[x])
    height = 4 / 3 * math.sqrt(2 / 3)
    yield "a fold", end(held, [0.0], 1.5)[0], (1.5**2 - height**2) / 2 - (1.5 - height)
    # An event with a condition, at every whole second but the first: the state is put back to 0.
    reset = Event(every=num(1), update={x: num(0)}, when=(">", time, num(1)))
    yield "resets", end(Model(["x0"], [num(1)], events=[reset]), [0.0], 2.5)[0], 0.5
    # A sample acts with the events of its instant: what an update takes away from a surface it gives back.
    step = ("hold", [0.0, 1.0, 4.0], [0.0, 2.0, 2.0])
    twice = [
        Event(every=num(1), update={x: num(0)}),
        Event(surface=add(("d", 0), x, num(-0.5)), update={x: num(7)}),
    ]
    yield "a sample", end(Model(["x0"], [num(0)], events=twice, drives=[step]), [1.0], 2.5)[0], 0.0
    # A pulse that begins as a clock strikes carries through a surface first of all.
    pulse = ("pw", ("<", ("mod", time, num(1)), num(0.5)), num(1), num(0))
    counted = [
        Event(every=num(1), update={x: add(x, num(10))}),
        Event(surface=minus(pulse, num(0.5)), direction=1, update={x: add(x, num(1))}),
    ]
    yield "a pulse", end(Model(["x0"], [num(0)], events=counted), [0.0], 2.25)[0], 22.0
