"""The sliding system along the arc of a multiplier, for the neighbourhood of folds.

While switches slide, g(t, x, lambda) = 0. With ' = d/ds and s the arc of one multiplier (pseudo-arclength, Keller 1977)

    x' = f t',   lambda' = L,   (g_t + g_x f) t' + g_lambda L = 0,   c . L = 1,

a bordered linear system that stays regular where g_lambda is singular: the fold is a simple zero of t'(s), so it is
located like any other event, where lambda(t) itself has only a square-root expansion.
"""

from __future__ import annotations

import sympy as sp

from .model import Model, Multiplier


def fold_model(model: Model) -> Model:
    """Lower the sliding system of `model` to one in s: states (x, t, multipliers), multipliers (t', multipliers').

    Surfaces, in order: the zero of t' has none (multiplier 0 carries it), then those of the model's multipliers and
    events, as functions of the new states. Parameters: the model's, then c_1, ..., c_m.
    """
    rate_t = sp.Symbol("pws_dt_ds", real=True)
    count = len(model.multipliers)
    rates = sp.symbols(f"pws_dlam_ds_1:{count + 1}", real=True, seq=True)
    c = sp.symbols(f"pws_c_1:{count + 1}", real=True, seq=True)
    symbols = [mu.symbol for mu in model.multipliers]
    s = sp.Symbol("pws_s", real=True)
    border = sum((ci * Li for ci, Li in zip(c, rates, strict=True)), sp.Integer(0)) - 1
    multipliers = [Multiplier(rate_t, "algebraic", border)]
    for mu, rate in zip(model.multipliers, rates, strict=True):
        along = mu.condition.diff(model.time)
        for x, f in zip(model.states, model.rhs, strict=True):
            along += mu.condition.diff(x) * f
        equation = along * rate_t
        for symbol, other in zip(symbols, rates, strict=True):
            equation += mu.condition.diff(symbol) * other
        multipliers.append(Multiplier(rate, "algebraic", equation, surface=mu.surface))
    return Model(
        time=s,
        states=(*model.states, model.time, *symbols),
        parameters=(*model.parameters, *c),
        rhs=(*(f * rate_t for f in model.rhs), rate_t, *rates),
        multipliers=tuple(multipliers),
        events=model.events,
    )
