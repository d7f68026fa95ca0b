"""A model as the plain functions that a user of other solvers writes: compiled, with the parameters as numbers.

    rates(t, x, lam, out)       dx/dt, lam_j = 1 or -1, or anything between while a switch slides
    surfaces(t, x, lam, out)    h_j
    residuals(t, x, lam, out)   g_j: dh_j/dt of a switch, d2h_j/dt2 of a contact

The rivals of a comparison get the same right-hand side, compiled, that they would be given by hand.
Chain: Model -> **this file** -> baselines.py, peers.py.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ..model import Model, Select

__all__ = ["Plain", "plain"]


@dataclass(frozen=True)
class Plain:
    """Compiled functions of one model; n states (memories are none), m multipliers."""

    n: int
    m: int
    contacts: tuple[bool, ...]
    rates: Callable[..., None]
    surfaces: Callable[..., None]
    residuals: Callable[..., None]
    impacts: Callable[..., None]
    bare: Callable[..., np.ndarray]  # (t, x) -> dx/dt with lam = sign h put in, as one writes it naively
    jacobian: Callable[..., None]  # (t, x, lam, out (n, n)): d rates/dx
    gradients: Callable[..., None]  # (t, x, lam, out (m, n)): dh/dx


def plain(system: Any) -> Plain:
    """The functions of a system; compiled once for each model and its values.

    Raises
    ------
    ValueError
        A model with memories, events or algebraic unknowns, which no plain function of (t, x) can hold.
    """
    return _compiled(system.model, tuple(map(float, system.parameter_values)))


def ordinary(e: sp.Expr) -> sp.Expr:
    """Selections as branches: the active one off the surface, the affine form while the switch slides."""
    return e.replace(
        Select,
        lambda lam, a, b: sp.Piecewise(
            (a, lam >= 1), (b, lam <= -1), (ordinary((a + b) / 2) + lam * ordinary((a - b) / 2), True)
        ),
    )


@functools.lru_cache(maxsize=64)
def _compiled(model: Model, values: tuple[float, ...]) -> Plain:
    from numba import njit

    if model.n_memory or model.events or any(mu.kind == "algebraic" for mu in model.multipliers):
        raise ValueError("memories, events and algebraic unknowns have no form as plain functions of (t, x).")
    n, m = len(model.states), len(model.multipliers)
    numbers = dict(zip(model.parameters, map(sp.Float, values)))
    lams = [mu.symbol for mu in model.multipliers]
    surfaces = [mu.surface for mu in model.multipliers]
    jacobian = [e.diff(x) for e in model.rhs for x in model.states]
    gradients = [h.diff(x) for h in surfaces for x in model.states]
    impacts = [e for mu in model.multipliers if mu.impact for e in mu.impact]

    def function(name, expressions, shape):
        text = _text(
            name, [ordinary(e).xreplace(numbers) for e in expressions], model.time, model.states, lams, shape
        )
        return njit(error_model="numpy")(_made(name, text))

    rates = function("rates", model.rhs, (n,))
    h = function("surfaces", surfaces, (m,))

    @njit(error_model="numpy")
    def bare(t, x):
        lam, out = np.ones(m), np.empty(n)
        # A surface may depend on the multipliers before it.
        for j in range(m):
            levels = np.empty(m)
            h(t, x, lam, levels)
            lam[j] = np.sign(levels[j])
        rates(t, x, lam, out)
        return out

    return Plain(
        n, m, tuple(mu.kind == "contact" for mu in model.multipliers), rates, h,
        function("residuals", [mu.residual for mu in model.multipliers], (m,)),
        function("impacts", impacts, (max(1, len(impacts) // n), n)),
        bare, function("jacobian", jacobian, (n, n)), function("gradients", gradients, (m, n)),
    )  # fmt: skip


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
    return sp.pycode(e, fully_qualified_modules=True).replace("math.copysign(1, ", "math.copysign(1.0, ")


def _made(name, text):
    import math

    space: dict[str, Any] = {"math": math}
    exec(text, space)
    return space[name]
