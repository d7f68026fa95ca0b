"""General-purpose integrators with error control alone: nothing tells them of a layer or a surface.

SciPy's, CVODE (scikit-sundae), LSODA and DOP853 compiled (numbalsoda) and heyoka's Taylor method, each at a state after
a span. Every run is bounded: Stalled where a bound is met, Collapsed where the solver gives up.
"""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from .failures import Collapsed, Stalled

SCIPY = ("RK45", "DOP853", "Radau", "BDF", "LSODA")
MOST = 100_000  # evaluations of a right-hand side through Python, and steps of heyoka
STEPS = 30_000  # of compiled peers


def counted(rates: Callable[..., Any], most: int) -> Callable[..., Any]:
    """rates(t, x) for `most` calls; compiled functions take an x that is contiguous and not read-only, a copy."""
    calls = 0

    def bounded(t: float, x: np.ndarray) -> Any:
        nonlocal calls
        calls += 1
        if calls > most:
            raise Stalled
        return rates(t, np.array(x))

    return bounded


def scipy_end(
    method: str, rates: Callable[..., Any], span: tuple[float, float], x0: Any, rtol: float, atol: float,
    most: int = MOST,
) -> np.ndarray:  # fmt: skip
    """State at the end of the span."""
    from scipy.integrate import solve_ivp

    with warnings.catch_warnings(), quiet():
        warnings.simplefilter("ignore")
        run = solve_ivp(counted(rates, most), span, np.array(x0, float), method, rtol=rtol, atol=atol)
    if run.status < 0:
        raise Collapsed(run.message)
    return run.y[:, -1]


def cvode(
    rates: Callable[..., Any], span: tuple[float, float], x0: Any, rtol: float, atol: float, most: int = MOST
) -> np.ndarray:
    """State at the end, by CVODE's BDF."""
    from sksundae.cvode import CVODE

    # At its own step limit it restarts where it stands; the count of evaluations is what ends a run.
    bounded = counted(rates, most)

    def fill(t: float, x: np.ndarray, out: np.ndarray) -> None:
        out[:] = bounded(t, x)

    with quiet():
        run = CVODE(fill, rtol=rtol, atol=atol, max_num_steps=most).solve(np.array(span), np.array(x0, float))
    if not run.success:
        raise Collapsed(run.message)
    return run.y[-1]


@functools.cache
def _address(rates: Any, n: int, count: int) -> tuple[Any, Any]:
    """A C function of a compiled right-hand side that starts at t = 0; the time of the start is the last parameter."""
    from numba import carray, cfunc
    from numbalsoda import lsoda_sig

    @cfunc(lsoda_sig)
    def f(t, x, out, p):
        numbers = carray(p, (count + 1,))
        change = rates(t + numbers[count], carray(x, (n,)), numbers[:count])
        for i in range(n):
            out[i] = change[i]

    return f, f.address


def compiled_peer(name: str, rates: Any, span: tuple[float, float], x0: Any, p: Any, rtol: float) -> np.ndarray:
    """State at the end of a `fixed.compiled` right-hand side, by numbalsoda's "lsoda" or "dop853"; atol = rtol."""
    # Fortran keeps what it prints until the process ends, past `quiet`, unless its library is loaded unbuffered.
    os.environ.setdefault("GFORTRAN_UNBUFFERED_ALL", "1")
    import numbalsoda

    _, address = _address(rates, len(x0), len(p))
    data = np.array([*p, span[0]], float)
    with quiet():
        x, success = getattr(numbalsoda, name)(
            address, np.array(x0, float), np.array([0.0, span[1] - span[0]]), data, rtol, rtol, STEPS
        )
    if not success:
        raise Stalled
    return x[-1]


def heyoka_taylor(equations: Any, p: Any, span: tuple[float, float], x0: Any, rtol: float) -> Any:
    """State at the end by heyoka's adaptive Taylor method, as its users call it.

    `equations(hy)`, hashable, is its system of (variable, expression), with parameters hy.par[i].
    """
    stepper = _taylor(equations, rtol)
    stepper.time = span[0]
    stepper.state[:] = x0
    stepper.pars[:] = p
    outcome = stepper.propagate_until(span[1], max_steps=MOST)[0]
    import heyoka

    if outcome == heyoka.taylor_outcome.step_limit:
        raise Stalled
    if outcome != heyoka.taylor_outcome.time_limit:
        raise Collapsed(str(outcome))
    return stepper.state.copy()


@functools.cache
def _taylor(equations: Any, rtol: float) -> Any:
    import heyoka

    system = equations(heyoka)
    return heyoka.taylor_adaptive(system, np.zeros(len(system)), tol=rtol)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Without what Fortran and C codes print when they fail."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = [(fd, os.dup(fd)) for fd in (1, 2)]
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        for fd, _ in saved:
            os.dup2(sink, fd)
        yield
    finally:
        for fd, copy in saved:
            os.dup2(copy, fd)
            os.close(copy)
        os.close(sink)
