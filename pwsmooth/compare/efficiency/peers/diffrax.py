"""diffrax: Runge-Kutta methods in JAX, compiled by XLA, with an event that ends a solve.

Tuned: double precision; Dopri8 with its PID controller, Newton's method on the event; one compiled solve for all modes,
whose sides are arguments; sliding multipliers solved inside the right-hand side. Kvaerno5 for smoothed systems.
P. Kidger, On Neural Differential Equations, PhD thesis, Oxford 2021.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import sympy as sp

from ..automaton import Strike, automaton, follow
from ..plain import Plain, all_rates, happenings, numbers, ordinary, real


def _jnp() -> Any:
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp

    return jnp


def function(expressions: Any, system: Any) -> Any:
    """(t, x, lam) -> array, by sympy's printer for JAX."""
    jnp, model, values = _jnp(), system.model, numbers(system)
    lams = [mu.symbol for mu in model.multipliers]

    bodies = [real(ordinary(e).xreplace(values)) for e in expressions]
    # Both branches of a selection are evaluated: the broken power is finite on either side.
    broken = {"broken": lambda base, power: jnp.where(base > 0, jnp.where(base > 0, base, 1.0) ** power, 0.0)}
    made = sp.lambdify([model.time, list(model.states), lams], bodies, modules=[broken, "jax"], cse=True)
    return lambda t, x, lam: (
        jnp.array(jnp.broadcast_arrays(*made(t, list(x), list(lam)))) if bodies else jnp.zeros(0)
    )


class Modes:
    """One compiled solve for all modes of a model."""

    def __init__(self, system: Any, functions: Plain, longest: float, most: int) -> None:
        import diffrax as dfx
        import jax
        import optimistix as optx

        jnp = _jnp()
        self.functions, self.rules, self.jnp = functions, automaton(functions), jnp
        parts: tuple[Any, ...] = tuple(system.model.multipliers)
        rates = function(all_rates(system.model), system)
        slide = [mu.kind == "switch" and mu.regularity != "kink" for mu in parts]
        residuals = function([mu.residual if s else sp.S.Zero for mu, s in zip(parts, slide)], system)
        surfaces = function([part.surface for part in (*parts, *happenings(system.model))], system)
        m, nw = functions.m, functions.n_walls
        contact = jnp.array(functions.contacts)

        def multipliers(t, x, status):
            fixed = jnp.where(contact, 0.0, status[:m])
            if not any(slide):
                return fixed
            free = (status[:m] == 0) & ~contact
            at_zero = residuals(t, x, fixed)
            columns = jax.vmap(lambda unit: residuals(t, x, fixed + unit) - at_zero)(jnp.eye(m)).T
            both = free[:, None] & free[None, :]
            matrix = jnp.where(both, columns, jnp.eye(m))
            return fixed + jnp.linalg.solve(matrix, jnp.where(free, -at_zero, 0.0))

        def margin(k):
            def of(t, y, args, **_):
                status, begin, watched = args
                lam = multipliers(t, y, status)
                off = status[k] * surfaces(t, y, lam)[k]
                value = jnp.where(status[k] == 0, 1.0 - lam[k] ** 2, off) if k < m else off
                return jnp.where((t <= begin) | ~watched[k], 1e-300, value)

            return of

        term = dfx.ODETerm(lambda t, x, args: rates(t, x, multipliers(t, x, args[0])))
        event = dfx.Event(
            [margin(k) for k in range(nw)], optx.Newton(1e-13, 1e-13, optx.rms_norm), direction=False
        )

        # Tolerances are arguments, so that one compilation serves all.
        def run(t, end, x, status, watched, rtol, atol):
            control = dfx.PIDController(rtol=rtol, atol=atol, dtmax=longest)
            out = dfx.diffeqsolve(
                term, dfx.Dopri8(), t, end, None, x, (status, t, watched), stepsize_controller=control, event=event,
                max_steps=most, throw=False, saveat=dfx.SaveAt(t1=True),
            )  # fmt: skip
            return out.ts[-1], out.ys[-1], jnp.array(out.event_mask), out.stats["num_steps"]

        self.solve = jax.jit(run)

    def advance(self, rtol, atol, t, end, x, status, watched):
        """For `follow`, at given tolerances."""
        seen = np.zeros(self.functions.n_walls, bool)
        seen[list(watched)] = True
        now, y, mask, steps = self.solve(t, end, x, status.astype(float), seen, rtol, atol)
        mask = np.asarray(mask)
        if not mask.any() and float(now) < end:
            raise RuntimeError("diffrax did not reach the end")
        # Dopri8 has 14 stages, the first of which is the last of the step before.
        return Strike(float(now), np.array(y), int(np.argmax(mask)) if mask.any() else None, 13 * int(steps))

    def run(self, t_end: float, x0: np.ndarray, rtol: float, atol: np.ndarray) -> Any:
        """(state at the end, events, evaluations)"""
        advance = functools.partial(self.advance, rtol, atol)
        return follow(self.rules, advance, (0.0, t_end), x0, most=2000)


# Kept: compilation is no part of a run.
modes = functools.lru_cache(maxsize=256)(Modes)


@functools.lru_cache(maxsize=256)
def ignoring(system: Any, most: int) -> Any:
    """A compiled Dopri8 on the right-hand side with its bare sign: (x0, t_end, rtol, atol) -> x, steps, success."""
    import diffrax as dfx
    import jax

    jnp = _jnp()
    model = system.model
    rates = function(all_rates(model), system)
    surfaces = function([mu.surface for mu in model.multipliers], system)
    m = len(model.multipliers)

    def bare(t, x, _):
        lam = jnp.ones(m)
        for j in range(m):
            lam = lam.at[j].set(jnp.sign(surfaces(t, x, lam)[j]))
        return rates(t, x, lam)

    def run(x0, t_end, rtol, atol):
        control = dfx.PIDController(rtol=rtol, atol=atol)
        out = dfx.diffeqsolve(
            dfx.ODETerm(bare), dfx.Dopri8(), 0.0, t_end, None, x0, stepsize_controller=control, max_steps=most,
            throw=False, saveat=dfx.SaveAt(t1=True),
        )  # fmt: skip
        return out.ys[-1], out.stats["num_steps"], out.result == dfx.RESULTS.successful

    return jax.jit(run)


def solve_ignoring(system: Any, t_end: float, x0: np.ndarray, rtol: float, atol: np.ndarray, most: int) -> Any:
    """(state at the end, no events, evaluations); RuntimeError where the steps do not suffice."""
    x, steps, ok = ignoring(system, most // 13)(x0, t_end, rtol, atol)
    if not ok:
        raise RuntimeError(f"diffrax needs more than {most // 13} steps")
    return np.array(x), None, 13 * int(steps)
