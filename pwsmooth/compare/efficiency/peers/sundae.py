"""scikit-sundae: SUNDIALS' CVODE, variable-order BDF or Adams, with its root finding.

Tuned: right-hand side compiled by numba; one solver object, whose status array changes from mode to mode; Adams where
nothing is stiff. Its callbacks pass through Python.
A. C. Hindmarsh et al., ACM TOMS 31 (2005) 363-396.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..automaton import Strike, automaton, follow
from ..plain import Plain


class Cvode:
    """CVODE, stopped at every event and started anew.

    `options` are CVODE's (method, rtol, atol, max_step), `most` bounds the evaluations.
    """

    def __init__(self, functions: Plain, most: int, **options: Any) -> None:
        from sksundae.cvode import CVODE

        self.rules = automaton(functions)
        self.n, self.nw = functions.n, functions.n_walls
        self.status, self.begin = np.ones(self.nw, np.int64), 0.0
        self.most, self.calls = most, 0
        field, margins = self.rules.field, self.rules.margins
        self.watched: tuple[int, ...] = ()
        level = np.empty(self.nw)

        def rhs(t, x, out):
            self.calls += 1
            if self.calls > most:
                raise RuntimeError(f"more than {most} evaluations")
            field(t, x, self.status, out)

        def events(t, x, out):
            if t <= self.begin:
                out[:] = 1e-300
                return
            margins(t, x, self.status, level)
            out[:] = 1.0
            for k in self.watched:
                out[k] = level[k]

        events.terminal, events.direction = [True] * self.nw, [-1] * self.nw  # type: ignore[attr-defined]
        self.solver = CVODE(rhs, eventsfn=events, num_events=self.nw, max_num_steps=most, **options)

    def advance(self, t, end, x, status, watched):
        """For `follow`."""
        self.status[:], self.watched, self.begin = status, watched, t
        before = self.calls
        out = self.solver.solve(np.array([t, end]), x)
        if not out.success and out.t_events is None:
            raise RuntimeError(str(out.message))
        spent = self.calls - before
        # Without an event the record still holds that of the run before.
        if out.t[-1] >= end or out.i_events is None or len(out.i_events) == 0:
            return Strike(float(out.t[-1]), np.array(out.y[-1]), None, spent)
        hit = next((k for k in watched if out.i_events[-1][k] != 0), None)
        return Strike(float(out.t_events[-1]), np.array(out.y_events[-1]), hit, spent)

    def run(self, t_end: float, x0: np.ndarray) -> Any:
        """(state at the end, events, evaluations)"""
        self.calls = 0
        return follow(self.rules, self.advance, (0.0, t_end), x0, most=2000)


def ignoring(functions: Plain, t_end: float, x0: np.ndarray, most: int, **options: Any) -> Any:
    """(state at the end, no events, evaluations) on the right-hand side with its bare sign.

    RuntimeError where CVODE gave up, or needed more than `most` evaluations.
    """
    from sksundae.cvode import CVODE

    bare, calls = functions.bare, 0

    def rhs(t, x, out):
        nonlocal calls
        calls += 1
        if calls > most:
            # An exception in a callback is swallowed there; nan makes the step fail.
            out[:] = np.nan
            return
        out[:] = bare(t, x)

    out = CVODE(rhs, max_num_steps=most, **options).solve(np.array([0.0, t_end]), x0)
    if calls > most:
        raise RuntimeError(f"more than {most} evaluations before the end of the span")
    if not out.success:
        raise RuntimeError(str(out.message))
    return np.array(out.y[-1]), None, calls
