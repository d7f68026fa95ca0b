"""A model as the plain functions that a user of other solvers writes: compiled, with the parameters as numbers.

    rates(t, x, lam, out)       dx/dt, lam_j = 1 or -1, or anything between while a switch slides
    surfaces(t, x, lam, out)    h_j
    residuals(t, x, lam, out)   g_j: dh_j/dt of a switch, d2h_j/dt2 of a contact
    walls(t, x, lam, out)       the surfaces, then those of events that are no multiple of one of them
    whens, updates              of events: 1 or 0, and the state after

Memories are states with rate 0. The rivals of a comparison get the same right-hand side, compiled, that they would
be given by hand.
Chain: Model -> **this file** -> automaton.py, timestepping.py, peers.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ...definition.model import Model, Select


@dataclass(frozen=True)
class Plain:
    """Compiled functions of one model; n states with memories, m multipliers, one surface each.

    `events` has (index of the wall, direction across it, terminal) of each event.
    """

    n: int
    m: int
    contacts: tuple[bool, ...]
    kinks: tuple[bool, ...]
    events: tuple[tuple[int, int, bool], ...]
    n_walls: int
    rates: Callable[..., None]
    surfaces: Callable[..., None]
    residuals: Callable[..., None]
    impacts: Callable[..., None]
    bare: Callable[..., np.ndarray]  # (t, x) -> dx/dt with lam = sign h put in, as one writes it naively
    walls: Callable[..., None]
    whens: Callable[..., None]
    updates: Callable[..., None]  # (t, x, lam, out (n_events, n))
    matters: Callable[[tuple[int, ...]], tuple[bool, ...]]  # sides -> which multipliers the rates depend on
    # "jacobian", d rates/dx (n, n), or "gradients", dh/dx (m, n): their expressions grow fast, so made when wanted
    derivatives: Callable[[str], Callable[..., None]]


def plain(system: Any, varied: tuple[str, ...] = ()) -> Plain:
    """The functions of a system; compiled once for each model and its values.

    Parameters become numbers, except those `varied`, which are states of rate 0 after all others: many values of one
    compiled model. ValueError for algebraic unknowns and events at instants, which no function of (t, x) can hold.
    """
    model = system.model
    names = [str(p) for p in model.parameters]
    unknown = [name for name in varied if name not in names]
    if unknown:
        raise ValueError(f"`varied` names {unknown[0]!r}; the parameters are {', '.join(names) or 'none'}.")
    values = (None if name in varied else float(v) for name, v in zip(names, system.parameter_values))
    return _compiled(model, tuple(values))


def happenings(model: Model) -> list[Any]:
    """Events of the model; singular arguments, which this package alone watches, change nothing."""
    return [event for event in model.events if not event.singular]


def all_rates(model: Model) -> list[sp.Expr]:
    """dx/dt of all states, memories included."""
    return [*model.rhs, *[sp.S.Zero] * (len(model.states) - len(model.rhs))]


def numbers(system: Any) -> dict[sp.Symbol, sp.Float]:
    """Parameters and their values."""
    return dict(zip(system.model.parameters, map(sp.Float, map(float, system.parameter_values))))


def affine(lam: sp.Expr, a: sp.Expr, b: sp.Expr) -> sp.Expr:
    """A selection that is a for lam = 1 and b for lam = -1."""
    return (a + b) / 2 + lam * (a - b) / 2


def ordinary(e: sp.Expr) -> sp.Expr:
    """Selections as branches: the active one off the surface, the affine form while the switch slides."""
    return e.replace(
        Select,
        lambda lam, a, b: sp.Piecewise(
            (a, lam >= 1), (b, lam <= -1), (ordinary((a + b) / 2) + lam * ordinary((a - b) / 2), True)
        ),
    )


class broken(sp.Function):
    """max(0, base)**exponent: a trial stage beyond the end of a contact must not be nan."""

    nargs = 2


def real(e: sp.Expr) -> sp.Expr:
    """The same with broken powers of what may become negative."""
    return e.replace(
        lambda part: part.is_Pow and not part.exp.is_integer and not part.base.is_number,
        lambda part: broken(*part.args),
    )


@functools.lru_cache(maxsize=64)
def _compiled(model: Model, values: tuple[float | None, ...]) -> Plain:
    from numba import njit

    happening = happenings(model)
    if any(e.surface is None for e in happening) or any(mu.kind == "algebraic" for mu in model.multipliers):
        raise ValueError(
            "algebraic unknowns and events at given instants have no form as plain functions of (t, x)."
        )
    varied = [p for p, value in zip(model.parameters, values) if value is None]
    states = [*model.states, *varied]
    n, m = len(states), len(model.multipliers)
    fixed = {p: sp.Float(value) for p, value in zip(model.parameters, values) if value is not None}
    rhs = [*all_rates(model), *[sp.S.Zero] * len(varied)]
    lams = [mu.symbol for mu in model.multipliers]
    surfaces = [mu.surface for mu in model.multipliers]
    # The multiplier of a kink is never solved for.
    residuals = [sp.S.Zero if mu.regularity == "kink" else mu.residual for mu in model.multipliers]
    impacts = [e for mu in model.multipliers if mu.impact for e in (*mu.impact, *varied)]
    walls, events = _walls(happening, surfaces, fixed)
    whens = [sp.Piecewise((1, e.when.xreplace(fixed)), (0, True)) for e in happening]
    updates = [dict(e.update).get(i, x) for e in happening for i, x in enumerate(states)]

    def function(name, expressions, shape):
        plain_ones = [real(ordinary(e).xreplace(fixed)) for e in expressions]
        space: dict[str, Any] = {"math": math, "broken": njit(_power)}
        exec(_text(name, plain_ones, model.time, states, lams, shape), space)
        return njit(error_model="numpy")(space[name])

    @functools.cache
    def derivatives(name):
        of = {"jacobian": rhs, "gradients": surfaces}[name]
        return function(name, [e.diff(x) for e in of for x in states], (len(of), n))

    @functools.cache
    def matters(sides):
        depends = []
        for j, lam in enumerate(lams):
            others = {mu: sp.Integer(s) for i, (mu, s) in enumerate(zip(lams, sides)) if i != j and s}
            rest = [e.xreplace(others) for e in (*rhs, *residuals)]
            # Substitution leaves selections that it has decided: they are evaluated anew.
            rest = [e.replace(Select, lambda *args: Select(*args)) for e in rest if e.has(lam)]
            depends.append(any(e.has(lam) for e in rest))
        return tuple(depends)

    rates = function("rates", rhs, (n,))
    h = function("surfaces", surfaces, (m,))

    @njit(error_model="numpy")
    def bare(t, x):
        lam, out, levels = np.ones(m), np.empty(n), np.empty(m)
        # A surface may depend on the multipliers before it.
        for j in range(m):
            h(t, x, lam, levels)
            lam[j] = np.sign(levels[j])
        rates(t, x, lam, out)
        return out

    return Plain(
        n, m, tuple(mu.kind == "contact" for mu in model.multipliers),
        tuple(mu.regularity == "kink" for mu in model.multipliers), events, len(walls), rates, h,
        function("residuals", residuals, (m,)),
        function("impacts", impacts, (max(1, len(impacts) // n), n)),
        bare,
        function("walls", walls, (len(walls),)), function("whens", whens, (len(whens),)),
        function("updates", updates, (len(whens), n)), matters, derivatives,
    )  # fmt: skip


def _walls(happening, surfaces, fixed):
    """All surfaces, and of every event the wall on which it lies with the direction across it."""
    walls, events = list(surfaces), []
    for event in happening:
        ratios = [sp.cancel((event.surface / wall).xreplace(fixed)) for wall in walls]
        same = [k for k, ratio in enumerate(ratios) if ratio.is_number]
        if not same:
            walls.append(event.surface)
        k, ratio = (same[0], ratios[same[0]]) if same else (len(walls) - 1, sp.S.One)
        events.append((k, int(event.direction * sp.sign(ratio)), bool(event.terminal)))
    return walls, tuple(events)


def _text(name, expressions, time, states, lams, shape):
    """Source of a function that writes the expressions into `out` of the given shape."""
    rename = {time: sp.Symbol("t")}
    rename |= {x: sp.Symbol(f"x{i}") for i, x in enumerate(states)}
    rename |= {lam: sp.Symbol(f"lam{j}") for j, lam in enumerate(lams)}
    used = set().union(*(e.free_symbols for e in expressions)) if expressions else set()
    lines = [f"def {name}(t, x, lam, out):"]
    for kind, symbols in (("x", states), ("lam", lams)):
        lines += [f"    {kind}{i} = {kind}[{i}]" for i, s in enumerate(symbols) if s in used]
    shared, results = sp.cse([e.xreplace(rename) for e in expressions], sp.numbered_symbols("c_"))
    lines += [f"    {s} = {_code(e)}" for s, e in shared]
    for k, e in enumerate(results):
        place = ", ".join(map(str, np.unravel_index(k, shape)))
        lines.append(f"    out[{place}] = {_code(e)}")
    return "\n".join([*lines, "    return"])


def _code(e):
    text = sp.pycode(e, fully_qualified_modules=True, user_functions={"broken": "broken"})
    return text.replace("math.copysign(1, ", "math.copysign(1.0, ")


def _power(base, exponent):
    return base**exponent if base > 0.0 else 0.0


@functools.cache
def elimination() -> Callable[..., None]:
    """Compiled (a, b): b <- a^-1 b for a matrix b, a is overwritten; Gauss-Jordan with pivots.

    For the few unknowns of these models it takes a fraction of LAPACK's call, and of the time to compile it.
    """
    from numba import njit

    @njit(error_model="numpy")
    def eliminate(a, b):
        size, columns = b.shape
        for k in range(size):
            best = k
            for i in range(k + 1, size):
                if abs(a[i, k]) > abs(a[best, k]):
                    best = i
            if best != k:
                for j in range(size):
                    a[k, j], a[best, j] = a[best, j], a[k, j]
                for j in range(columns):
                    b[k, j], b[best, j] = b[best, j], b[k, j]
            for i in range(size):
                if i != k:
                    share = a[i, k] / a[k, k]
                    for j in range(k, size):
                        a[i, j] -= share * a[k, j]
                    for j in range(columns):
                        b[i, j] -= share * b[k, j]
        for k in range(size):
            for j in range(columns):
                b[k, j] /= a[k, k]

    return eliminate
