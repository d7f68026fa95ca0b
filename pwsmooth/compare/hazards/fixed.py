"""Fixed-step methods as they stand in textbooks: explicit Euler, Runge-Kutta of order 4, backward Euler.

    z = h lambda:   |1 + z| <= 1    |1 + z + z^2/2 + z^3/6 + z^4/24| <= 1    |1/(1 - z)| <= 1

On a real negative lambda the explicit ones are stable for h |lambda| <= 2 and 2.785294.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

# Ends of the intervals of stability on the negative real axis.
REAL = {"explicit Euler": 2.0, "Runge-Kutta 4": 2.785293563405282, "backward Euler": np.inf}
FIXED = tuple(REAL)


def growth(method: str, z: complex) -> complex:
    """The stability function R(z)."""
    if method == "explicit Euler":
        return 1 + z
    if method == "Runge-Kutta 4":
        return 1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))
    return 1 / (1 - z)


def longest_stable(method: str, jacobian: np.ndarray) -> float:
    """The largest h with |R(h lambda)| <= 1 for all eigenvalues, 0 if every step is unstable; inf if none is.

    Found on a logarithmic grid and refined: the first step length from small ones at which the bound is exceeded.
    """
    eigenvalues = np.linalg.eigvals(jacobian)
    fastest = np.max(np.abs(eigenvalues))

    def stable(h: float) -> bool:
        return all(abs(growth(method, h * e)) <= 1 + 1e-12 for e in eigenvalues)

    grid = np.geomspace(1e-4, 1e3, 4000) / fastest
    beyond = np.array([not stable(h) for h in grid])
    if not beyond.any():
        return np.inf
    k = int(np.argmax(beyond))
    if k == 0:
        return 0.0
    low, high = grid[k - 1], grid[k]
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


@functools.cache
def _steps(method: str) -> Callable[..., Any]:
    """run(rates, t0, x0, h, steps, p), compiled once for all right-hand sides, which are arguments of one type.

    Families over the components, since every assignment between arrays compiles the text of its error message.
    """
    from numba import njit, types

    if method == "explicit Euler":

        @njit(error_model="numpy")
        def advance(rates, t, x, h, p, new):
            k = rates(t, x, p)
            for i in range(len(x)):
                new[i] = x[i] + h * k[i]

    elif method == "Runge-Kutta 4":

        @njit(error_model="numpy")
        def advance(rates, t, x, h, p, new):
            n, stage = len(x), np.empty(len(x))
            k1 = rates(t, x, p)
            for i in range(n):
                stage[i] = x[i] + h / 2 * k1[i]
            k2 = rates(t + h / 2, stage, p)
            for i in range(n):
                stage[i] = x[i] + h / 2 * k2[i]
            k3 = rates(t + h / 2, stage, p)
            for i in range(n):
                stage[i] = x[i] + h * k3[i]
            k4 = rates(t + h, stage, p)
            for i in range(n):
                new[i] = x[i] + h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i])

    elif method == "backward Euler":

        @njit(error_model="numpy")
        def advance(rates, t, x, h, p, new):
            n = len(x)
            change, moved, matrix = np.empty(n), np.empty(n), np.empty((n, n))
            for i in range(n):
                new[i] = x[i]
            for _ in range(50):
                f = rates(t + h, new, p)
                for i in range(n):
                    change[i] = new[i] - x[i] - h * f[i]
                    moved[i] = new[i]
                for j in range(n):
                    d = 1e-7 * max(abs(new[j]), 1e-6)
                    moved[j] = new[j] + d
                    beside = rates(t + h, moved, p)
                    moved[j] = new[j]
                    for i in range(n):
                        matrix[i, j] = -h * (beside[i] - f[i]) / d
                    matrix[j, j] += 1.0
                # Gauss elimination: n is 1 to 3, and dense rows are exchanged for size.
                for j in range(n):
                    best = j
                    for i in range(j + 1, n):
                        if abs(matrix[i, j]) > abs(matrix[best, j]):
                            best = i
                    if best != j:
                        for k in range(n):
                            matrix[j, k], matrix[best, k] = matrix[best, k], matrix[j, k]
                        change[j], change[best] = change[best], change[j]
                    for i in range(j + 1, n):
                        factor = matrix[i, j] / matrix[j, j]
                        for k in range(j, n):
                            matrix[i, k] -= factor * matrix[j, k]
                        change[i] -= factor * change[j]
                for j in range(n - 1, -1, -1):
                    for k in range(j + 1, n):
                        change[j] -= matrix[j, k] * change[k]
                    change[j] /= matrix[j, j]
                largest = size = 0.0
                finite = True
                for i in range(n):
                    new[i] -= change[i]
                    largest, size = max(largest, abs(change[i])), max(size, abs(new[i]))
                    finite = finite and math.isfinite(change[i])
                if not finite or largest <= 1e-13 * (1e-6 + size):
                    break

    else:
        raise ValueError(f"`method` is {method!r}; choose from {', '.join(FIXED)}.")

    vector = types.float64[::1]
    of = types.float64[:, ::1](_type(), types.float64, vector, types.float64, types.int64, vector)

    @njit(of, error_model="numpy")
    def run(rates, t0, x0, h, steps, p):
        n = len(x0)
        out, x, new = np.empty((steps + 1, n)), x0.copy(), np.empty(n)
        for i in range(n):
            out[0, i] = x[i]
        for k in range(steps):
            advance(rates, t0 + k * h, x, h, p, new)
            for i in range(n):
                x[i] = out[k + 1, i] = new[i]
        return out

    return run


@functools.cache
def _type() -> Any:
    """rates(t, x, p) as numba's function type: without it every function is a type of its own."""
    from numba import types

    vector = types.float64[::1]
    return types.FunctionType(vector(types.float64, vector, vector))


@functools.cache
def compiled(rates: Callable[..., Any]) -> Any:
    """rates(t, x, p) -> dx/dt as a compiled function of one type, so that the methods compile once for all."""
    from numba import njit

    return njit(_type().signature, error_model="numpy")(rates)


def fixed(method: str, rates: Any, t0: float, x0: Any, h: float, steps: int, p: Any) -> np.ndarray:
    """States (steps + 1, n) of a `compiled` right-hand side; not finite from where they overflow.

    Backward Euler solves its equation by Newton's method with a differenced Jacobian, at most 50 iterations; where
    that does not converge it keeps the last iterate, as simple codes do.
    """
    return _steps(method)(rates, t0, np.array(x0, float), float(h), int(steps), np.array(p, float))
