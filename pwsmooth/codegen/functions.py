"""The functions of a system that is made of them, behind the addresses of generated ones.

    fields(t, x, mult, p, dx, h, g)      linear(t, x, mult, p, G, dh)      act(i, t, x, mult, p, xnew)

    g_j = Im h_j(t + i d, x + i d f)/d,    dg_j/dlam_k = Im h_j(t, x + i d df/dlam_k)/d,    dh_j/dx_i likewise

df/dlam is a difference of fourth order: on [-1, 1] the scale is known, and Newton's method asks for no more.
All is compiled anew in every process. Chain: definition/functions.py -> **functions** -> paths/problem.py.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numba import carray, cfunc, literal_unroll, njit, types
from numba.extending import overload

from ..definition.functions import FunctionModel

_D = 1e-30  # complex step
# Difference in lambda: its error is below 1e-13 where the fifth derivative is of order 1, as its rounding is.
_DELTA = 2.0**-9

_POINTER = types.CPointer(types.float64)
_FIELDS = types.void(types.float64, *6 * [_POINTER])
_LINEAR = types.void(types.float64, *5 * [_POINTER])
_ACT = types.int64(types.int64, types.float64, *4 * [_POINTER])
_njit = njit(error_model="numpy")


def _put(values, out):
    """Overwrites `out` with the values of a tuple or an array; with nan where their number differs."""


@overload(_put, jit_options={"error_model": "numpy"})
def _put_typed(values, out):
    if isinstance(values, types.BaseTuple):

        def tuple_(values, out):
            i = 0
            for value in literal_unroll(values):
                out[i] = value
                i += 1

        return tuple_

    def array(values, out):
        for i in range(len(out)):
            out[i] = values[i] if len(values) == len(out) else np.nan

    return array


def _nothing(t, x, p, out):
    pass


def _joined(functions):
    """One function that overwrites out[j] with the j-th function's value."""
    after = _njit(_nothing)
    for j in range(len(functions) - 1, -1, -1):
        after = _before(functions[j], j, after)
    return after


def _before(function, j, after):
    @_njit
    def both(t, x, p, out):
        out[j] = function(t, x, p)
        after(t, x, p, out)

    return both


def _acting(events):
    """One function that lets event i act: 1, or 0 where its `when` does not hold."""

    @_njit
    def after(i, t, x, p, xnew):
        return 1

    for k in range(len(events) - 1, -1, -1):
        if events[k].when is not None or events[k].update is not None:
            after = _act_before(k, events[k].when or _njit(_always), events[k].update or _njit(_same), after)
    return after


def _always(t, x, p):
    return True


def _same(t, x, p):
    return x


def _act_before(k, when, update, after):
    @_njit
    def act(i, t, x, p, xnew):
        if i != k:
            return after(i, t, x, p, xnew)
        if not when(t, x, p):
            return 0
        new = np.full(len(x), np.nan)
        _put(update(t, x, p), new)
        for s in range(len(x)):
            if not new[s] == x[s]:  # what it leaves as it is may be written by another event
                xnew[s] = new[s]
        return 1

    return act


class CompiledFunctions:
    """Addresses of a FunctionModel's functions, with the attributes of `Compiled`; it must outlive their use."""

    has_jets = by_responses = False
    nz = fields8 = layer = outputs = jet_slip = jet_general = mult_row0 = 0
    nrows_slip = nrows_general = 0, 0

    def __init__(self, model: FunctionModel):
        self.model, functions = model, model.functions
        self.n, self.m, self.ne = len(model.states), len(model.multipliers), len(model.events)
        self.np = len(model.parameters)
        self.surface_rows_slip = self.surface_rows_general = np.full(self.m + self.ne, -1)
        self.flat_rows_slip = self.flat_rows_general = np.zeros(0, np.int64)
        none = _njit(_zero)
        real = [h for h, _ in functions.surfaces] + [e.surface or none for e in functions.events]
        exact = [h for _, h in functions.surfaces] + [e.surface_complex or none for e in functions.events]
        self._f, self._real, self._exact = functions.f, _joined(real), _joined(exact)
        self._kept: list[Any] = []  # keeps the machine code alive

    def _address(self, signature: Any, function: Any) -> int:
        self._kept.append(cfunc(signature, error_model="numpy")(function))
        return self._kept[-1].address

    surfaces_of_unknowns = ()

    def pattern(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of "G" or "DH": everything may depend on everything."""
        rows, columns = (self.m, self.m) if name == "G" else (self.m + self.ne, self.n)
        return np.arange(rows + 1) * columns, np.tile(np.arange(columns), rows)

    @cached_property
    def fields(self) -> int:
        n, m, k, size = self.n, self.m, self.np, self.m + self.ne
        f, real, exact = self._f, self._real, self._exact

        def fields(t, x, mult, p, dx, h, g):
            x, lam, p, dx = carray(x, (n,)), carray(mult, (m,)), carray(p, (k,)), carray(dx, (n,))
            heights, residuals = carray(h, (size,)), carray(g, (m,))
            # What raises leaves nan, which the kernels look for.
            dx[:], heights[:], residuals[:] = np.nan, np.nan, np.nan
            _put(f(t, x, lam, p), dx)
            real(t, x, p, heights)
            if m > 0:
                z, slopes = np.empty(n, np.complex128), np.empty(size, np.complex128)
                for i in range(n):
                    z[i] = complex(x[i], _D * dx[i])
                exact(complex(t, _D), z, p, slopes)
                for j in range(m):
                    residuals[j] = slopes[j].imag / _D

        return self._address(_FIELDS, fields)

    @cached_property
    def linear(self) -> int:
        n, m, k, size = self.n, self.m, self.np, self.m + self.ne
        f, exact = self._f, self._exact

        def linear(t, x, mult, p, G, dh):
            x, lam, p = carray(x, (n,)), carray(mult, (m,)).copy(), carray(p, (k,))
            G, dh = carray(G, (m * m,)), carray(dh, (size * (n + 1),))
            G[:], dh[:] = np.nan, np.nan
            z, slopes, rates, change = (
                np.empty(n, np.complex128),
                np.empty(size, np.complex128),
                np.empty(n),
                np.empty(n),
            )
            for c in range(m):
                now = lam[c]
                change[:] = 0.0
                for weight, place in ((1.0, -2.0), (-8.0, -1.0), (8.0, 1.0), (-1.0, 2.0)):
                    lam[c] = now + place * _DELTA
                    _put(f(t, x, lam, p), rates)
                    change += weight / (12.0 * _DELTA) * rates
                lam[c] = now
                for i in range(n):
                    z[i] = complex(x[i], _D * change[i])
                exact(complex(t, 0.0), z, p, slopes)
                for j in range(m):
                    G[j * m + c] = slopes[j].imag / _D
            for i in range(n + 1):
                for s in range(n):
                    z[s] = complex(x[s], _D if s == i else 0.0)
                exact(complex(t, _D if i == n else 0.0), z, p, slopes)
                for j in range(size):
                    dh[j * n + i if i < n else size * n + j] = slopes[j].imag / _D

        return self._address(_LINEAR, linear)

    @cached_property
    def act(self) -> int:
        n, k, act = self.n, self.np, _acting(self.model.functions.events)

        def acts(i, t, x, mult, p, xnew):
            return act(i, t, carray(x, (n,)), carray(p, (k,)), carray(xnew, (n,)))

        return self._address(_ACT, acts)


def _zero(t, x, p):
    return 0.0
