"""Calls of the generated functions of the stiff path by their address (see pointers.py for why by address)."""

from numba import types
from numba.extending import intrinsic

from pwsmooth.kernels.pointers import _caller

# Positions in the array of addresses, in the order of codegen.stiff.NAMES.
RATES1, HOIST, RATES8, JACOBIAN, FACTOR, SOLVE, SURFACES, SURFACES8, TAYLOR, WATCH8, ACT = range(11)


@intrinsic
def call_point(typingctx, address, t, x, p, out):
    """rates1, jacobian and surfaces: overwrites out."""
    return _caller((address, t, x, p, out), types.void)


@intrinsic
def call_hoist(typingctx, address, t8, p, c):
    """hoist(t8, p, c): overwrites c, everything that depends on time alone at the 8 stage times."""
    return _caller((address, t8, p, c), types.void)


@intrinsic
def call_rates8(typingctx, address, t8, c, x8, p, f8):
    """rates8(t8, c, x8, p, f8): overwrites the rates at 8 stages."""
    return _caller((address, t8, c, x8, p, f8), types.void)


@intrinsic
def call_factor(typingctx, address, J, m, lu):
    """factor(J, m, lu): overwrites lu with the eliminations of m I - J in four lanes."""
    return _caller((address, J, m, lu), types.void)


@intrinsic
def call_solve(typingctx, address, lu, r):
    """solve(lu, r): overwrites r with the solutions."""
    return _caller((address, lu, r), types.void)


@intrinsic
def call_lanes(typingctx, address, t8, x8, p, out):
    """surfaces8 and watch8: overwrites out with values at 8 points."""
    return _caller((address, t8, x8, p, out), types.void)


@intrinsic
def call_taylor(typingctx, address, t, x, p, K, stride, rows):
    """taylor(t, x, p, K, stride, rows): overwrites rows with orders 0..K of the states and surfaces."""
    return _caller((address, t, x, p, K, stride, rows), types.void)


@intrinsic
def call_event(typingctx, address, i, t, x, p, xnew):
    """act(i, t, x, p, xnew): fires event i; overwrites what it sets in xnew; 0 if its `when` fails."""
    return _caller((address, i, t, x, p, xnew), types.int64)
