"""Pieces of generated Taylor programs: block sums of convolutions, and the linear solver of sliding jets.

Orders come in blocks of four, k = 4q + 1 .. 4q + 4. At a block's start `presum` gives, for its four orders at
once, the part of sum a_j b_(k-j) whose two factors lie before the block; what remains are at most three pairs,
which the program keeps in registers. A loop over j at every order costs 4 times as much: its length changes
with k, so each of its ends is a mispredicted branch, and it reloads numbers that were only just stored.
"""

from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 4
_DOUBLE, _INT = ir.DoubleType(), ir.IntType(64)
_VECTOR = ir.VectorType(_DOUBLE, LANES)
_CONTRACT = ("contract",)


@intrinsic
def _block_sum(typingctx, rows, a, b, q, out):
    """Overwrites rows[out..out+3] with sum over 1 <= j <= 4q, k - j <= 4q of a_j b_(k-j), k = 4q+1 .. 4q+4."""
    signature = types.void(rows, types.int64, types.int64, types.int64, types.int64)

    def codegen(context, builder, sig, args):
        rows, a, b, q, out = args
        zero, undefined = ir.Constant(_VECTOR, [0.0] * LANES), ir.Constant(_VECTOR, ir.Undefined)
        broadcast = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        # Four sums, because one would wait for each addition.
        sums = [cgutils.alloca_once_value(builder, zero) for _ in range(LANES)]
        known = builder.mul(q, _INT(LANES))

        def vector(offset):
            return builder.bitcast(builder.gep(rows, [offset]), _VECTOR.as_pointer())

        def add(j, into, valid):
            factor = builder.load(builder.gep(rows, [builder.add(a, j)]))
            factor = builder.insert_element(undefined, factor, ir.IntType(32)(0))
            factor = builder.shuffle_vector(factor, undefined, broadcast)
            first = builder.sub(builder.add(builder.add(b, known), _INT(1)), j)
            other = builder.load(vector(first), align=8)
            if valid < LANES:  # beyond are orders that do not exist yet
                lanes = ir.VectorType(ir.IntType(1), LANES)
                mask = ir.Constant(lanes, [int(lane < valid) for lane in range(LANES)])
                other = builder.select(mask, other, zero)
            product = builder.fmul(factor, other, flags=_CONTRACT)
            builder.store(builder.fadd(builder.load(into), product, flags=_CONTRACT), into)

        with builder.if_then(builder.icmp_signed(">", q, _INT(0))):
            for j in range(1, LANES + 1):
                add(_INT(j), sums[j - 1], j)
            stop = builder.add(known, _INT(1))
            with cgutils.for_range_slice(builder, _INT(LANES + 1), stop, _INT(LANES)) as (j, _):
                for lane in range(LANES):
                    add(builder.add(j, _INT(lane)), sums[lane], LANES)
        s = [builder.load(q) for q in sums]
        total = builder.fadd(builder.fadd(s[0], s[1]), builder.fadd(s[2], s[3]))
        builder.store(total, vector(out), align=8)
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def choose(typingctx, condition, a, b):
    """a if condition else b, both evaluated: no branch, and no block for the compiler to analyse."""
    def codegen(context, builder, sig, args):
        return builder.select(*args)

    return types.float64(types.boolean, types.float64, types.float64), codegen


@njit(cache=True, error_model="numpy")
def presum(rows, a, b, q, out):
    """Block sum of the rows at offsets a and b for block q; overwrites rows[out..out+3]."""
    _block_sum(rows, a, b, q, out)


@njit(cache=True, error_model="numpy")
def lu_factor(rows, a, n):
    """Factorise the n*n matrix at offset a in place, numbers of the pivot rows after it; 1 where singular."""
    scale = 0.0
    for i in range(n * n):
        scale = max(scale, abs(rows[a + i]))
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(rows[a + r * n + c]) > abs(rows[a + best * n + c]):
                best = r
        rows[a + n * n + c] = best
        for i in range(n):
            rows[a + c * n + i], rows[a + best * n + i] = rows[a + best * n + i], rows[a + c * n + i]
        pivot = rows[a + c * n + c]
        # Rounding leaves a few eps of the largest entry where the exact pivot is 0.
        if not abs(pivot) > 2e-15 * scale:
            return 1
        for r in range(c + 1, n):
            f = rows[a + r * n + c] / pivot
            rows[a + r * n + c] = f
            for i in range(c + 1, n):
                rows[a + r * n + i] -= f * rows[a + c * n + i]
    return 0


@njit(cache=True, error_model="numpy")
def lu_solve(rows, a, n):
    """Solve with the factors at offset a; right-hand side and solution stand after the pivot numbers."""
    b = a + n * n + n
    for c in range(n):
        best = b + int(rows[a + n * n + c])
        rows[b + c], rows[best] = rows[best], rows[b + c]
    for r in range(n):
        for i in range(r):
            rows[b + r] -= rows[a + r * n + i] * rows[b + i]
    for r in range(n - 1, -1, -1):
        for i in range(r + 1, n):
            rows[b + r] -= rows[a + r * n + i] * rows[b + i]
        rows[b + r] /= rows[a + r * n + r]
