"""numbalsoda: LSODA and DOP853 called from compiled code, the right-hand side a C callback without Python.

Tuned: the loop over events is compiled as well, so that nothing of a run is interpreted; one terminal event a surface.
Absolute tolerances are scalars there: the smallest of the states' is taken. N. J. Wogan, numbalsoda.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ..automaton import KINDS, automaton
from ..plain import Plain


@functools.lru_cache(maxsize=64)
def ignoring(functions: Plain) -> Any:
    """A compiled LSODA on the right-hand side with its bare sign: (x0, t_end, rtol, atol, most) -> x, ok, calls."""
    from numba import carray, cfunc, njit
    from numbalsoda import lsoda, lsoda_sig

    n, bare = functions.n, functions.bare

    @cfunc(lsoda_sig)
    def rhs(t, u, du, data):
        calls = carray(data, (1,))
        calls[0] += 1
        rates = bare(t, carray(u, (n,)))
        for i in range(n):
            du[i] = rates[i]

    address = rhs.address

    @njit
    def run(x0, t_end, rtol, atol, most):
        calls = np.zeros(1)
        x, ok = lsoda(address, x0, np.array([0.0, t_end]), calls, rtol, atol, most)
        return x[-1], ok, calls[0]

    return run, rhs


@functools.lru_cache(maxsize=64)
def with_events(functions: Plain) -> Any:
    """A compiled DOP853 with terminal events, started anew at each."""
    from numba import carray, cfunc, njit
    from numbalsoda import lsoda_sig, solve_ivp

    rules = automaton(functions)
    n, nw = functions.n, functions.n_walls
    field, margins, strike, begin = rules.field, rules.margins, rules.strike, rules.begin

    # The data are the status and the time of the last event: the start may lie on a surface, up to rounding.
    @cfunc(lsoda_sig)
    def rhs(t, u, du, data):
        status = np.empty(nw, np.int64)
        for k in range(nw):
            status[k] = int(data[k])
        field(t, carray(u, (n,)), status, carray(du, (n,)))

    @cfunc(lsoda_sig)
    def events(t, u, out, data):
        status = np.empty(nw, np.int64)
        for k in range(nw):
            status[k] = int(data[k])
        level = carray(out, (nw,))
        margins(t, carray(u, (n,)), status, level)
        if t <= data[nw]:
            level[:] = 1e-300

    rhs_address, event_address = rhs.address, events.address

    @njit
    def run(x0, t_end, rtol, atol, longest, most):
        x, t, evaluations = x0.copy(), 0.0, 0
        status, data = np.ones(nw, np.int64), np.empty(nw + 1)
        begin(t, x, status)
        times, codes, count = np.empty(most), np.empty(most, np.int64), 0
        ok = True
        while count < most:
            for k in range(nw):
                data[k] = status[k]
            data[nw] = t
            out = solve_ivp(rhs_address, np.array([t, t_end]), x, np.empty(0), "DOP853", nw, event_address,
                            data.ctypes.data, 0.0, longest, rtol, atol)  # fmt: skip
            evaluations += out.nfev
            if not out.event_found:
                ok = out.success and out.t[-1] == t_end
                x = out.y[-1].copy()
                break
            t, x = out.t_event, out.y_event.copy()
            times[count], codes[count] = t, strike(out.ind_event, t, x, status)
            count += 1
        return x, times[:count], codes[:count], evaluations, ok and count < most

    return run, rhs, events


def solve_ignoring(
    functions: Plain, t_end: float, x0: np.ndarray, rtol: float, atol: np.ndarray, most: int
) -> Any:
    """(state at the end, no events, evaluations); RuntimeError where LSODA gave up."""
    x, ok, calls = ignoring(functions)[0](x0, t_end, rtol, float(atol.min()), most)
    if not ok:
        raise RuntimeError(f"LSODA gave up within {most} steps")
    return x, None, int(calls)


def solve_events(
    functions: Plain, t_end: float, x0: np.ndarray, rtol: float, atol: np.ndarray, longest: float
) -> Any:
    """(state at the end, events, evaluations); raises RuntimeError as well."""
    run = with_events(functions)[0]
    x, times, codes, evaluations, ok = run(x0, t_end, rtol, float(atol.min()), longest, 2000)
    if not ok:
        raise RuntimeError("the compiled DOP853 did not reach the end")
    return x, lambda: [(float(t), KINDS[code]) for t, code in zip(times, codes)], int(evaluations)
