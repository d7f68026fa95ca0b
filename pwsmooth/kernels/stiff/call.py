"""Calls of the generated functions of the stiff path by their address (see pointers.py for why by address)."""

from numba import types
from numba.extending import intrinsic

from pwsmooth.kernels.machine.pointers import _caller

# Positions in the array of addresses, in the order of codegen.stiff.NAMES.
RATES1, HOIST, RATES8, JACOBIAN, FACTOR, SOLVE, SURFACES, SURFACES8, TAYLOR, WATCH8, ACT, RADAU = range(12)
# Behind them the units of the loop, in the order of stiff_loop.UNITS.
ATTEMPT_UNIT, TAYLOR_UNIT, EVENTS_UNIT, DENSE_FACTOR, DENSE_SOLVE = range(12, 17)


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
def call_radau(
    typingctx,
    address,
    t,
    h,
    ratio,
    eta,
    kappa,
    rtol,
    again,
    p,
    x,
    f,
    weight,
    newton_weight,
    surf,
    poly,
    Z,
    J,
    core,
):
    """radau(t, h, ratio, eta, ...) -> int64: one attempt, see radau.py; overwrites x, f, poly, Z, J and what
    the Core says of an attempt."""
    arrays = p, x, f, weight, newton_weight, surf, poly, Z, J
    return _caller((address, t, h, ratio, eta, kappa, rtol, again, *arrays, core), types.int64)


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


@intrinsic
def call_attempt_unit(typingctx, address, core, t, h, ratio, eta):
    """attempt_unit(core, t, h, ratio, eta) -> int64: the same for any model."""
    return _caller((address, core, t, h, ratio, eta), types.int64)


@intrinsic
def call_taylor_unit(typingctx, address, core, task):
    """taylor_unit(core, task) -> int64: one attempt, or only its reach."""
    return _caller((address, core, task), types.int64)


@intrinsic
def call_events_unit(typingctx, address, core, t, degree, offset):
    """events_unit(core, t, degree, offset) -> int64: what happened on the step from t."""
    return _caller((address, core, t, degree, offset), types.int64)


@intrinsic
def call_dense_factor(typingctx, address, n, J, mu, lu):
    """dense_factor(n, J, mu, lu): overwrites lu."""
    return _caller((address, n, J, mu, lu), types.void)


@intrinsic
def call_dense_solve(typingctx, address, n, lu, r):
    """dense_solve(n, lu, r): overwrites r."""
    return _caller((address, n, lu, r), types.void)
