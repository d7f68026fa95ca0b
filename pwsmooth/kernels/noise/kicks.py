"""Kicks: random displacements of some states at the instants k*every, as the reset of one time event.

    x_i(t+) = x_i(t-) + size_i * xi,    xi uniform on [-1, 1], or normal or Laplace's with variance 1, addressed by
                                        (seed, trajectory, k, i)

The two functions stand in the place of a model's own `act`: they serve the event `index` and pass every other one on.
What they need is found through the word before the parameters, p[-1]: the address of a Kick.
"""

import math

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..machine.bundle import bundle_type
from ..machine.compiling import kernel, unit
from ..machine.pointers import call_act, float_bits
from ..stiff.call import call_event
from .random import four_normals, philox, unit_interval
from .state import KICKS, Kick


@intrinsic
def _kick_at(typingctx, address):
    """The Kick at an int64 address."""

    def codegen(context, builder, sig, args):
        return builder.inttoptr(args[0], ir.IntType(8).as_pointer())

    return bundle_type(Kick)(types.int64), codegen


@kernel
def _displace(K, t, xnew):
    """Adds the kick of time t to xnew, to what other events of the instant have made of it."""
    number = round(t / K.every)
    for first in range(0, len(K.where), 4):
        if K.law == 1:
            draws = four_normals(K.seed, K.trajectory, number, first, 0, KICKS)
        else:
            a, b, c, d = philox(K.seed, K.trajectory, number, first, 0, KICKS)
            draws = (
                2.0 * unit_interval(a) - 1.0,
                2.0 * unit_interval(b) - 1.0,
                2.0 * unit_interval(c) - 1.0,
                2.0 * unit_interval(d) - 1.0,
            )
        for i in range(first, min(first + 4, len(K.where))):
            xi = draws[i - first]
            if K.law == 2:
                # The uniform number as a probability: P(|xi| > s) = exp(-sqrt(2) s).
                xi = math.copysign(-math.sqrt(0.5) * math.log1p(-abs(xi)), xi)
            xnew[K.where[i]] += K.size[i] * xi


_doubles = types.CPointer(types.float64)


@unit(types.int64, types.int64, types.float64, _doubles, _doubles, _doubles, _doubles)
def kick_act(i, t, x, mult, p, xnew):
    """`act` of the event-driven path, with kicks."""
    K = _kick_at(float_bits(p[-1]))
    if i != K.index:
        return call_act(K.act, i, t, x, mult, p, xnew)
    _displace(K, t, xnew)
    return 1


@unit(types.int64, types.int64, types.float64, _doubles, _doubles, _doubles)
def kick_act_smooth(i, t, x, p, xnew):
    """`act` of the smoothed path, with kicks."""
    K = _kick_at(float_bits(p[-1]))
    if i != K.index:
        return call_event(K.act, i, t, x, p, xnew)
    _displace(K, t, xnew)
    return 1
