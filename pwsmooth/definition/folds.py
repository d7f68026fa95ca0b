"""The sliding system along the arc of a multiplier, for the neighbourhood of folds.

While switches slide, g(t, x, lambda) = 0. With ' = d/ds and s the arc of one multiplier (pseudo-arclength, Keller 1977)

    x' = f t',   lambda' = L,   (g_t + g_x f) t' + g_lambda L = 0,   c . L = 1,

a bordered linear system that stays regular where g_lambda is singular: the fold is a simple zero of t'(s), so it is
located like any other event, where lambda(t) itself has only a square-root expansion.
"""

from __future__ import annotations

import sympy as sp

from .model import Held, Model, Multiplier


def fold_model(model: Model) -> Model:
    """Lower the sliding system of `model` to one in s: states (x, t, multipliers), multipliers (t', multipliers').

    Surfaces, in order: the zero of t' has none (multiplier 0 carries it), then those of the model's multipliers and
    events, as functions of the new states. Parameters: the model's, then c_1, ..., c_m, and where something is chosen
    by whether a multiplier is held the statuses s_1, ..., s_m: along an arc none changes.
    """
    statuses = {mu.symbol: sp.Symbol(f"pws_s_{j}", real=True) for j, mu in enumerate(model.multipliers, 1)}

    def along_arc(e):
        return e.replace(Held, lambda lam, apart, held: _chosen(statuses[lam], apart, held))

    conditions = [along_arc(mu.condition) for mu in model.multipliers]
    model_rates = [along_arc(f) for f in model.rhs]
    used = set().union(*(e.free_symbols for e in (*conditions, *model_rates))) & {*statuses.values()}
    rate_t = sp.Symbol("pws_dt_ds", real=True)
    count = len(model.multipliers)
    rates = sp.symbols(f"pws_dlam_ds_1:{count + 1}", real=True, seq=True)
    c = sp.symbols(f"pws_c_1:{count + 1}", real=True, seq=True)
    symbols = [mu.symbol for mu in model.multipliers]
    s = sp.Symbol("pws_s", real=True)
    border = sum((ci * Li for ci, Li in zip(c, rates, strict=True)), sp.Integer(0)) - 1
    multipliers = [Multiplier(rate_t, "algebraic", border)]
    for mu, g, rate in zip(model.multipliers, conditions, rates, strict=True):
        along = g.diff(model.time)
        for x, f in zip(model.states, model_rates, strict=True):
            along += g.diff(x) * f
        equation = along * rate_t
        for symbol, other in zip(symbols, rates, strict=True):
            equation += g.diff(symbol) * other
        multipliers.append(Multiplier(rate, "algebraic", equation, surface=mu.surface))
    return Model(
        time=s,
        states=(*model.states, model.time, *symbols),
        parameters=(*model.parameters, *c, *(statuses.values() if used else ())),
        rhs=(*(f * rate_t for f in model_rates), rate_t, *rates),
        multipliers=tuple(multipliers),
        events=model.events,
    )


def _chosen(status, apart, held):
    """What `Held` chooses, told by the multiplier's status."""
    return sp.Piecewise((apart, sp.Or(sp.Eq(status, 1), sp.Eq(status, -1))), (held, True), evaluate=False)
