"""Counter-based random numbers: Philox4x64-10 (Salmon et al., SC 2011), the generator of numpy's `Philox`.

The key is (seed, trajectory), the counter (what, where): any number of any trajectory is found without the ones
before it. So noise does not depend on chunks, workers or the steps of a solver.
"""

import math

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..machine.compiling import kernel

_M0, _M1 = np.uint64(0xD2E7470EE14C6C93), np.uint64(0xCA5A826395121157)
_W0, _W1 = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBB67AE8584CAA73B)
_SHIFT = np.uint64(11)
_SCALE = 2.0**-53


@intrinsic
def _high(typingctx, a, b):
    """Upper 64 bits of a product of two uint64."""

    def codegen(context, builder, sig, args):
        wide = ir.IntType(128)
        product = builder.mul(builder.zext(args[0], wide), builder.zext(args[1], wide))
        return builder.trunc(builder.lshr(product, ir.Constant(wide, 64)), ir.IntType(64))

    return types.uint64(types.uint64, types.uint64), codegen


@kernel
def philox(key0, key1, c0, c1, c2, c3):
    """The four uint64 of one counter; arguments are integers, negative ones modulo 2^64."""
    k0, k1 = np.uint64(key0), np.uint64(key1)
    a, b, c, d = np.uint64(c0), np.uint64(c1), np.uint64(c2), np.uint64(c3)
    for _ in range(10):
        high0, low0 = _high(_M0, a), _M0 * a
        high1, low1 = _high(_M1, c), _M1 * c
        a, b, c, d = high1 ^ b ^ k0, low1, high0 ^ d ^ k1, low0
        k0 += _W0
        k1 += _W1
    return a, b, c, d


@kernel
def unit_interval(word):
    """A uint64 as a double in (0, 1): centres of 2^53 equal cells, so that 0 and 1 never come."""
    return (float(word >> _SHIFT) + 0.5) * _SCALE


@kernel
def normal_pair(word0, word1):
    """Two independent standard normal numbers (Box and Muller)."""
    radius = math.sqrt(-2.0 * math.log(unit_interval(word0)))
    angle = 2.0 * math.pi * unit_interval(word1)
    return radius * math.cos(angle), radius * math.sin(angle)


@kernel
def four_normals(key0, key1, c0, c1, c2, c3):
    """Four independent standard normal numbers of one counter."""
    a, b, c, d = philox(key0, key1, c0, c1, c2, c3)
    p, q = normal_pair(a, b)
    r, s = normal_pair(c, d)
    return p, q, r, s
