"""A chunk of orbits through the compiled ensemble (kernels/sweeping/ensemble.py): arrays in, arrays out.

The ctypes call releases Python's lock, so that threads use all cores.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..analysis.maps.seen import Return
from ..kernels.sweeping.state import EXTREMES
from ..paths.budget import spending
from ..paths.call import Options
from ..paths.event_driven import EventDriven
from ..results.records import Outcome
from .measures import Itinerary
from .plan import NO_RETURN, REFUSED, Plan
from .point import solve_point

_RING = 256  # segments remembered, of which the last periods' are read
_NODES = 12  # of Gauss: exact for a polynomial of degree 23, the steps' own


def run_orbits(plan: Plan, columns: Mapping[str, np.ndarray]) -> Any:
    """The ensemble's arrays after the run, with `ok`, `code_done` and `outcome`, each (N,)."""
    from ..codegen.machine.units import unit_address
    from ..kernels.sweeping import state as ensemble_state

    options, setting, system = dict(plan.options), plan.setting, plan.system
    model, count = system.model, len(next(iter(columns.values())))
    t0, begin, end, period = plan.windows(columns, count)
    strobes, section = setting.periods + 1, isinstance(plan.seen, Return)
    base = np.array(system.parameter_values, float)
    run = EventDriven(
        model,
        Options(
            options["method"], options["rtol"], options["atol"], bool(setting.quantities),
            options["max_step"], options["max_steps"], options["order"],
        ),
    )  # fmt: skip
    problem = run.parts.problem(base, run.one_step)
    n, m, ne = len(model.states), len(model.multipliers), len(model.events)
    if section:
        terminal = problem.terminal.copy()
        terminal[-1] = 1  # of returns only the ensemble knows which is the last one
        problem = problem.changed(terminal=terminal)
    p = np.tile(base, (count, 1))
    x0 = np.tile(np.array(plan.start, float), (count, 1))
    for name, kind in plan.kinds:
        if kind == "parameter":
            p[:, [s.name for s in model.parameters].index(name)] = columns[name]
        elif kind == "state":
            x0[:, setting.states.index(name)] = columns[name]
    quantities, outputs = _quantities(plan, n, m)
    # The buffers are emptied when full: small ones stay in the cache.
    now = run.begin(0.0, 0.0, 0.0)
    record = run.recording(max(512, 4 * (2 * m + 3 * ne + 64)), np.zeros(0 if section else strobes))
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    digits = np.zeros(m, np.int64)
    digits[list(setting.word_columns)] = 3 ** np.arange(len(setting.word_columns))
    address = unit_address("ensemble")
    call = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 6, *[ctypes.c_int64] * 2)(address)
    with spending().heard() as gone:
        orbits: Any = ensemble_state.Ensemble.zeros(
            dict(
                N=count, n=n, m=m, nq=len(quantities), nodes=_NODES, ring=_RING, outputs=len(model.outputs),
                strobes=strobes, most=Itinerary.most,
            ),
            run=unit_address("run"),
            outputs=run.sizes.outputs if outputs else 0,
            section=ne - 1 if section else -1,
            transient=plan.transient,
            longest_return=plan.seen.longest if section else 0.0,
            longest=setting.period_detector.max_count if setting.strobed_by else 0,
            period_tol=setting.period_detector.tol,
            stop=gone,
            p=p,
            ratio=_ratios(plan, columns, problem.ratio, count),
            x0=x0,
            t0=t0,
            window=np.column_stack([begin, end]),
            period=period,
            strobe=np.full((count, strobes, n), np.nan),
            strobe_t=np.full((count, strobes), np.nan),
            quantity=quantities,
            wanted=setting.bits,
            word_digits=digits,
            node=0.5 * (nodes + 1),
            weight=0.5 * weights,
            poly=np.zeros(40),  # solve's highest order is 31
        )  # fmt: skip

        def go(control, first, stop):
            bundles = (problem, control, now, record, run.work, orbits)
            call(*(bundle.address for bundle in bundles), first, stop)

        if run.clocked:
            # The instants of time events depend on the parameters and the span: one orbit a call.
            for i in range(count):
                values = system.parameters | {s: v for s, v in zip(model.parameters, p[i].tolist())}
                go(run.timed(t0[i], end[i], values), i, i + 1)
        else:
            go(run.control, 0, count)
    orbits.code_done = orbits.code == Outcome.FINISHED
    _see_the_end(plan, columns, orbits)
    orbits.ok = orbits.code_done if section else orbits.code >= Outcome.FINISHED
    orbits.outcome = orbits.code.copy()
    for i in np.flatnonzero((orbits.code < Outcome.FINISHED) & (orbits.code != NO_RETURN)).tolist():
        late = orbits.code[i] == Outcome.OUT_OF_MEMORY
        orbits.outcome[i] = Outcome.TIME_LIMIT if late else _outcome(plan, columns, i)
    return orbits


def _see_the_end(plan, columns, orbits):
    """Take what an event leaves at the very end, with which no step begins, into the extremes."""
    model, n = plan.system.model, orbits.x0.shape[1]
    acting = [event for event in model.events if event.update]
    at_once = any(event.surface is None for event in acting) or (
        isinstance(plan.seen, Return) and (acting or any(mu.impact for mu in model.multipliers))
    )
    stopped = orbits.code == Outcome.TERMINATED if any(event.terminal for event in acting) else False
    for q in np.flatnonzero(orbits.wanted & EXTREMES).tolist():
        last = np.full(len(orbits.code), np.nan)
        if (place := orbits.quantity[q]) < n:
            last[orbits.code_done] = orbits.strobe[orbits.code_done, -1, place]
        again = stopped | (at_once and place >= n) & orbits.code_done
        for i in np.flatnonzero(again).tolist():
            times = orbits.strobe_t[i] if isinstance(plan.seen, Return) else None
            last[i] = solve_point(plan, columns, i, False, times)[0][plan.setting.quantities[q]][-1]
        orbits.low[:, q] = np.fmin(orbits.low[:, q], last)
        orbits.high[:, q] = np.fmax(orbits.high[:, q], last)


def _ratios(plan, columns, fixed, count):
    """Problem.ratio of every orbit: finite ratios of layered states are parameters, and may be swept."""
    ratio = np.tile(fixed, (count, 1))
    for k, layer in enumerate(plan.system.model.layer_states):
        if layer.ratio.is_Symbol and layer.ratio.name in columns:
            ratio[:, k] = columns[layer.ratio.name]
    return ratio


def _quantities(plan, n, m):
    """Index of every quantity, and whether any is an output."""
    model, setting = plan.system.model, plan.setting
    outputs = [str(name) for name, _ in model.outputs]
    multipliers = [str(mu.symbol) for mu in model.multipliers]
    places = []
    for name in setting.quantities:
        # As a Solution looks a name up: a state, an output, a multiplier.
        if name in setting.states:
            places.append(setting.states.index(name))
        elif name in outputs:
            places.append(n + m + outputs.index(name))
        else:
            places.append(n + multipliers.index(name))
    return np.array(places, np.int64), any(place >= n + m for place in places)


def _outcome(plan, columns, i):
    """Why an orbit failed, in solve()'s words: some of the kernel's codes have causes that are told apart there."""
    try:
        return int(solve_point(plan, columns, i, dense=False)[0].outcome)
    except (ValueError, TypeError):
        return REFUSED
