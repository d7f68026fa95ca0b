"""One description of a random polynomial piecewise system -> the text of a System, and the oracle's tables.

A model is a set of rows, each a sum of monomials with coefficients that are parameters: a structure is compiled once
and its cases differ in numbers. Variables are the states x0, x1, ..., then S = sin(w t + a), C = cos(w t + a), T = t
(states of the oracle, functions of time in the text), then the switches' lam0, ..., then the reactions R0, ...
The System is made by running the text, so that the script of a failing case is the case.
Chain: oracle.py -> models.py (here) -> the fuzzers.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from .oracle import Tables, run, value_of_row

# A term: (number, parameter or None, {variable: power}).


@dataclass
class Event:
    """A zero of `surface`: each state of `update` grows by a sum of terms."""

    surface: list
    update: dict
    direction: int = 0


@dataclass
class Model:
    """Rows of a random structure; `kinks` are (state, number, parameter, switch, "Abs" or "Max")."""

    n: int
    rates: list
    surfaces: list = field(default_factory=list)
    notation: list = field(default_factory=list)  # of each switch: "Switch" or "sign"
    kinks: list = field(default_factory=list)
    gaps: list = field(default_factory=list)
    restitution: list = field(default_factory=list)  # parameters
    events: list = field(default_factory=list)
    parameters: int = 0
    bare: tuple = ()  # states that stand as Memory

    # The places of variables; S, C, T are behind the states.
    @property
    def S(self):
        return self.n

    @property
    def T(self):
        return self.n + 2

    def lam(self, j):
        return self.n + 3 + j

    def reaction(self, k):
        return self.n + 3 + len(self.surfaces) + k

    def new(self):
        """A fresh parameter."""
        self.parameters += 1
        return self.parameters - 1

    def term(self, number, *variables, parameter=True):
        """A term with a fresh parameter: number * k * product of variables."""
        powers = {}
        for v in variables:
            powers[v] = powers.get(v, 0) + 1
        return (number, self.new() if parameter else None, powers)

    # ---- text

    def names(self):
        switches, reactions = range(len(self.surfaces)), range(len(self.gaps))
        return (
            [f"x{i}" for i in range(self.n)]
            + ["sp.sin(w*t + a)", "sp.cos(w*t + a)", "t"]
            + [f"lam{j}" for j in switches]
            + [f"R{k}.reaction" for k in reactions]
        )

    def text(self, order=None, switch_order=None, prefix="", repeat=None):
        """Source that makes the System S; the keywords rename, reorder and repeat what it says.

        repeat: {switch: factor}: half of each term in the switch is written with a second Switch on factor * surface.
        """
        names = [prefix + s if s[0] == "x" else s for s in self.names()]

        def written(row):
            parts = []
            for number, parameter, powers in row:
                factors = [repr(number)] if number != 1 or not (powers or parameter is not None) else []
                factors += [f"k{parameter}"] if parameter is not None else []
                factors += [names[v] + (f"**{p}" if p > 1 else "") for v, p in powers.items()]
                parts.append("*".join(factors))
            return " + ".join(parts) or "0"

        xs = names[: self.n]
        plain = [x for i, x in enumerate(xs) if i not in self.bare]
        lines = ["import sympy as sp", "from pwsmooth import Event, Memory, Switch, System, Unilateral, solve"]
        symbols = ["t", *plain, "w", "a", *(f"k{i}" for i in range(self.parameters))]
        lines.append(f'{", ".join(symbols)} = sp.symbols("{" ".join(symbols)}", real=True)')
        lines += [f'{xs[i]} = Memory("{xs[i]}")' for i in self.bare]
        for j in switch_order or range(len(self.surfaces)):
            h = written(self.surfaces[j])
            if self.notation[j] == "Switch":
                lines.append(f'lam{j} = Switch("{prefix}lam{j}", {h})')
            else:
                lines.append(f"lam{j} = sp.sign({h})")
            if repeat and j in repeat:
                factor = repeat[j]
                side = -1 if factor < 0 else 1
                lines.append(f'lam{j} = (lam{j} + {side}*Switch("{prefix}again{j}", {factor!r}*({h})))/2')
        for k, gap in enumerate(self.gaps):
            lines.append(f'R{k} = Unilateral({written(gap)}, restitution=k{self.restitution[k]}, name="R{k}")')
        rates = []
        for i in order or range(self.n):
            if i in self.bare:
                continue
            row = written(self.rates[i])
            for state, number, parameter, j, kind in self.kinks:
                if state == i:
                    h = written(self.surfaces[j])
                    row += f" + {number!r}*k{parameter}*sp.{kind}({h}{', 0' if kind == 'Max' else ''})"
            rates.append(f"{xs[i]}: {row}")
        lines.append(f"rates = {{{', '.join(rates)}}}")
        events = []
        for i, e in enumerate(self.events):
            update = ", ".join(f"{xs[s]}: {xs[s]} + {written(row)}" for s, row in e.update.items())
            events.append(
                f'Event({written(e.surface)}, direction={e.direction}, update={{{update}}}, name="E{i}")'
            )
        given = [s for s in symbols[len(plain) + 1 :] if _stands(s, "\n".join([*lines[3:], *events]))]
        lines.append(f"events = [{', '.join(events)}]")
        lines.append(
            f"S = System(rates, time=t, events=events, parameters=dict.fromkeys([{', '.join(given)}], 1))"
        )
        return "\n".join(lines)

    def system(self, **changes):
        """(System, names of its parameters) of the text."""
        space = {}
        exec(self.text(**changes), space)
        return space["S"], {p.name for p in space["S"].parameters}

    # ---- tables

    def tables(self, p, w):
        """The oracle's tables at these parameters; w is the frequency of S and C."""
        n, N = self.n, self.n + 3
        m, c = len(self.surfaces), len(self.gaps)

        def numbers(row):
            return [(number * (1 if q is None else p[q]), powers) for number, q, powers in row]

        rates = [numbers(row) for row in self.rates]
        for state, number, parameter, j, kind in self.kinks:
            k = number * p[parameter]
            for coefficient, powers in numbers(self.surfaces[j]):
                part = k / 2 if kind == "Max" else k
                rates[state].append((part * coefficient, {**powers, self.lam(j): 1}))
                if kind == "Max":
                    rates[state].append((part * coefficient, powers))
        rates += [[(w, {n + 1: 1})], [(-w, {n: 1})], [(1.0, {})]]
        gaps = [numbers(row) for row in self.gaps]
        speeds = []
        for gap in gaps:
            row = []
            for coefficient, powers in gap:
                for v, power in powers.items():
                    assert power == 1 and len(powers) == 1, "gaps are linear"
                    row += [(coefficient * number, inner) for number, inner in rates[v]]
            speeds.append(row)
        rows = rates + [numbers(row) for row in self.surfaces] + gaps + speeds
        rows += [numbers(e.surface) for e in self.events]
        for e in self.events:
            rows += [numbers(e.update.get(i, [])) for i in range(N)]
        coef, row, fac, var, power = [], [0], [0], [], []
        for terms in rows:
            for number, powers in terms:
                coef.append(number)
                var += powers.keys()
                power += powers.values()
                fac.append(len(var))
            row.append(len(coef))
        integers = [np.array(a, np.int64) for a in (row, fac, var, power)]
        return Tables(
            N, m, c, len(self.events), np.array(coef, float), *integers,
            np.array([e.direction for e in self.events], np.int64),
            np.array([p[q] for q in self.restitution], float),
        )  # fmt: skip


def _stands(symbol, text):
    return re.search(rf"\b{symbol}\b", text) is not None


@dataclass
class Case:
    """Numbers of one run: parameters, start, span; `closed` and `on` mark contacts and switches that begin at 0."""

    p: np.ndarray
    w: float
    a: float
    start: np.ndarray
    t0: float
    instants: np.ndarray
    closed: tuple = ()
    on: tuple = ()
    options: dict = field(default_factory=dict)

    def parameters(self, known):
        values = {f"k{i}": float(v) for i, v in enumerate(self.p)} | {"w": self.w, "a": self.a}
        return {k: v for k, v in values.items() if k in known}


@dataclass
class Answer:
    """What the oracle says: states at the instants (nan from where it does not judge), events, tags."""

    code: int
    reached: float
    states: np.ndarray
    events: int
    log: np.ndarray
    graze: np.ndarray
    tags: int


def answer(model, case, log_size=0):
    """The oracle's answer."""
    D = model.tables(case.p, case.w)
    v = np.zeros(D.N + D.m + D.c)
    v[: model.n] = case.start
    angle = case.w * case.t0 + case.a
    v[model.n : D.N] = np.sin(angle), np.cos(angle), case.t0
    status = np.ones(D.m + D.c, np.int64)
    for j in range(D.m):
        h = value_of_row(D, D.N + j, v)
        status[j] = 0 if j in case.on else (1 if h > 0 else -1)
        v[D.N + j] = status[j]
    for k in case.closed:
        status[D.m + k] = 0
    log, graze, tags = np.zeros((log_size, 3)), np.zeros(2), np.zeros(1, np.int64)
    code, reached, states, events = run(D, v, status, case.t0, case.instants, log, graze, tags)
    return Answer(code, reached, states[:, : model.n], events, log[:events], graze, int(tags[0]))


def script(model, case, expected=None):
    """A short program that shows the case."""
    S, known = model.system()
    given = ", ".join(f"{k}: {v!r}" for k, v in case.parameters(known).items())
    lines = [
        model.text(),
        f"values = {{{given}}}",
        f"instants = {[float(t) for t in case.instants]}",
        f"s = solve(S, ({float(case.t0)!r}, {float(case.instants[-1])!r}), {[float(x) for x in case.start]}, "
        f"t_eval=instants, parameters=values, **{case.options!r})",
        "print(s.outcome.name, s.ambiguities, list(s.events))",
        "print(s.x[:, :])",
    ]
    if expected is not None:
        lines.append(f"# expected {np.asarray(expected).T.round(9).tolist()}")
    return "\n".join(lines)
