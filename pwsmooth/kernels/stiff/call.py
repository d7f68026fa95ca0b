"""Calls of the generated functions of the stiff path by their address (see pointers.py for why by address)."""

from numba import types

from ..machine.pointers import caller

# Positions in the array of addresses, in the order of codegen.stiff.NAMES.
RATES1, HOIST, RATES8, JACOBIAN, FACTOR, SOLVE, SURFACES, SURFACES8, TAYLOR, WATCH8, ACT, RADAU = range(12)
# Behind them the units of the loop, in the order of stiff_loop.UNITS.
ATTEMPT_UNIT, TAYLOR_UNIT, EVENTS_UNIT, SPARSE_FACTOR, SPARSE_SOLVE = range(12, 17)

# rates1, jacobian and surfaces: overwrites out.
call_point = caller("t, x, p, out")

# hoist: overwrites c, everything that depends on time alone at the 8 stage times.
call_hoist = caller("t8, p, c")

# rates8: overwrites the rates at 8 stages.
call_rates8 = caller("t8, c, x8, p, f8")

# factor: overwrites lu with the eliminations of m I - J in four lanes.
call_factor = caller("J, m, lu")

# solve: overwrites r with the solutions.
call_solve = caller("lu, r")

# radau: one attempt, see radau.py; overwrites x, f, poly, Z, J and what the Core says of an attempt.
call_radau = caller(
    "t, h, ratio, eta, kappa, rtol, again, p, x, f, weight, newton_weight, surf, poly, Z, J, core", types.int64
)

# surfaces8 and watch8: overwrites out with values at 8 points.
call_lanes = caller("t8, x8, p, out")

# taylor: overwrites rows with orders 0..K of the states and surfaces.
call_taylor = caller("t, x, p, K, stride, rows")

# act: fires event i; overwrites what it sets in xnew; 0 if its `when` fails.
call_event = caller("i, t, x, p, xnew", types.int64)

# attempt_unit: the same for any model.
call_attempt_unit = caller("core, t, h, ratio, eta", types.int64)

# taylor_unit: one attempt, or only its reach.
call_taylor_unit = caller("core, task", types.int64)

# events_unit: what happened on the step from t.
call_events_unit = caller("core, t, degree, offset", types.int64)

# sparse_factor: overwrites lu.
call_sparse_factor = caller("plan, J, mu, lu")

# sparse_solve: overwrites r.
call_sparse_solve = caller("plan, lu, r")
