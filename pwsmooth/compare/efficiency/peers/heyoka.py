"""heyoka: Taylor integration by LLVM with event detection on the polynomials.

Tuned: fast_math; one compiled integrator for each set of sliding switches, sides as run-time parameters, so that a
crossing costs no compilation; sliding multipliers solved symbolically; terminal events that fall through zero.
Selections that cannot be evaluated on the other side (broken powers) are compiled side by side.
F. Biscani, D. Izzo, MNRAS 504 (2021) 2614-2628; 513 (2022) 4833-4844.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import sympy as sp

from ....definition.model import Select
from ..automaton import Strike, automaton, follow
from ..plain import Plain, affine, all_rates, happenings, numbers

COOLDOWN = 1e-6  # s


class Heyoka:
    """The integrators of one model at one tolerance."""

    def __init__(self, system: Any, functions: Plain, tol: float) -> None:
        import heyoka

        heyoka.set_logger_level_critical()
        model = system.model
        self.hy, self.model, self.functions, self.tol = heyoka, model, functions, tol
        self.rules = automaton(functions)
        self.numbers = numbers(system)
        self.lams = [mu.symbol for mu in model.multipliers]
        self.modes: dict[Any, Any] = {}
        self.stopped: tuple[int, float] = (0, 0.0)
        # Switches between branches of which one may be undefined: their side is compiled in.
        self.fixed = {
            self.lams.index(select.args[0])
            for e in (*model.rhs, *(mu.surface for mu in model.multipliers))
            for select in e.atoms(Select)
            if any(not p.exp.is_integer for p in select.atoms(sp.Pow))
        }

    def mode(self, status: np.ndarray, watched: tuple[int, ...]) -> Any:
        """The integrator of a mode, compiled when it is first met."""
        key = (watched, *(int(s) if s == 0 or j in self.fixed else 1 for j, s in enumerate(status)))
        if key not in self.modes:
            self.modes[key] = self.compiled(status, watched)
        return self.modes[key]

    def compiled(self, status: np.ndarray, watched: tuple[int, ...]) -> Any:
        """heyoka's own integrator with the events of the walls that are watched."""
        hy, model, m = self.hy, self.model, self.functions.m
        pars = sp.symbols(f"side0:{len(status)}", real=True)
        place, slides = {}, []
        for j, mu in enumerate(model.multipliers):
            if mu.kind == "contact":
                place[mu.symbol] = sp.S.Zero
            elif status[j] == 0:
                slides.append(j)
            else:
                place[mu.symbol] = sp.Integer(int(status[j])) if j in self.fixed else pars[j]
        if slides:
            unknown = [self.lams[j] for j in slides]
            residuals = [self.plainly(model.multipliers[j].residual, place) for j in slides]
            place |= sp.solve(residuals, unknown, dict=True)[0]
        symbols = {model.time: hy.time, **{p: hy.par[k] for k, p in enumerate(pars)}}
        states = hy.make_vars(*(f"x{i}" for i in range(len(model.states))))
        symbols |= dict(zip(model.states, states))

        def translated(e: Any) -> Any:
            return hy.from_sympy(binary(self.plainly(e, place).xreplace(self.numbers)), symbols)

        surfaces = [mu.surface for mu in model.multipliers]
        surfaces += [e.surface for e in happenings(model)][: len(status) - m]
        events = []
        for k in watched:
            margin = 1 - place[self.lams[k]] ** 2 if k < m and status[k] == 0 else pars[k] * surfaces[k]
            # Its own cooldown is deduced from the slope, which is zero where a slip begins: infinitely long.
            events.append(
                hy.t_event(translated(margin), direction=hy.event_direction.negative, cooldown=COOLDOWN)
            )
        # The number of run-time parameters is read off the equations: where none is used there is none.
        return hy.taylor_adaptive(
            list(zip(states, map(translated, all_rates(model)))), [0.0] * len(states), tol=self.tol, fast_math=True,
            t_events=events,
        )  # fmt: skip

    def plainly(self, e: sp.Expr, place: dict) -> sp.Expr:
        """With the multipliers put in, selections as the affine form unless their side is a number."""
        e = e.xreplace(place).replace(Select, lambda *args: Select(*args))
        return e.replace(Select, affine)

    def advance(self, t, end, x, status, watched):
        """For `follow`."""
        ta = self.mode(status, watched)
        ta.time = t
        ta.state[:] = x
        ta.pars[:] = status[: len(ta.pars)]
        # The double zero with which a slip begins may be found again: then the event's cooldown has to stay.
        if self.stopped != (id(ta), t):
            ta.reset_cooldowns()
        outcome, _, _, steps, *_ = ta.propagate_until(end)
        work = steps * (ta.order + 1)
        self.stopped = (id(ta), ta.time)
        if outcome == self.hy.taylor_outcome.time_limit:
            return Strike(end, ta.state.copy(), None, work)
        index = -int(outcome.value if hasattr(outcome, "value") else outcome) - 1
        if not 0 <= index < len(watched):
            raise RuntimeError(f"heyoka stopped at t = {ta.time:g}: {outcome}")
        return Strike(ta.time, ta.state.copy(), watched[index], work)

    def run(self, t_end: float, x0: np.ndarray) -> Any:
        """(state at the end, events, evaluations)"""
        return follow(self.rules, self.advance, (0.0, t_end), x0, most=2000)


def binary(e: sp.Expr) -> sp.Expr:
    """Fractions as floating-point numbers, which is what heyoka takes."""
    return e.replace(lambda a: a.is_Rational and not a.is_Integer, lambda a: sp.Float(float(a)))


# Kept: compilation is no part of a run.
integrators = functools.lru_cache(maxsize=256)(Heyoka)


class Smooth:
    """heyoka on a smoothed view: no event, one compiled integrator."""

    def __init__(self, view: Any, tol: float, most: int) -> None:
        import heyoka as hy

        hy.set_logger_level_critical()
        model = view.model
        values = numbers(view)
        states = hy.make_vars(*(f"x{i}" for i in range(len(model.states))))
        symbols = {model.time: hy.time, **dict(zip(model.states, states))}
        rates = [hy.from_sympy(binary(e.xreplace(values)), symbols) for e in model.rhs]
        self.ta = hy.taylor_adaptive(list(zip(states, rates)), [0.0] * len(states), tol=tol, fast_math=True)
        self.done, self.most = hy.taylor_outcome.time_limit, most

    def run(self, t_end: float, x0: np.ndarray) -> Any:
        """(state at the end, no events, evaluations)"""
        ta = self.ta
        ta.time = 0.0
        ta.state[:] = x0
        outcome, _, _, steps, *_ = ta.propagate_until(t_end, max_steps=self.most // (ta.order + 1))
        if outcome != self.done:
            raise RuntimeError(f"heyoka stopped at t = {ta.time:g}: {outcome}")
        return ta.state.copy(), None, steps * (ta.order + 1)
