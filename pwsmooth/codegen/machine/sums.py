"""Sums of products of series, in vector registers: the two functions of generated code that are LLVM instructions."""

from __future__ import annotations

from llvmlite import ir

DOUBLE, INT, BOOL, LANE = ir.DoubleType(), ir.IntType(64), ir.IntType(1), ir.IntType(32)
LANES = 4
BLOCK, ROW = ir.VectorType(DOUBLE, LANES), ir.VectorType(DOUBLE, 8)  # what the two functions work on at once


def block_sum(module: ir.Module, fused: ir.Function) -> ir.Function:
    """presum(rows, a, b, q, out): the part of four convolutions that is known at the start of block q.

    Overwrites rows[out..out+3] with sum over 1 <= j <= 4q, k - j <= 4q of a_j b_(k-j), k = 4q+1 .. 4q+4: four
    orders in the lanes of one vector. A loop over j at every order costs four times as much: its length changes
    with k, so each of its ends is a mispredicted branch, and it reloads numbers that were only just stored.
    """
    vector = BLOCK
    kind = ir.FunctionType(ir.VoidType(), [DOUBLE.as_pointer(), INT, INT, INT, INT])
    function = ir.Function(module, kind, "presum")
    function.linkage = "internal"
    rows, a, b, q, out = function.args
    zero, undefined = ir.Constant(vector, [0.0] * LANES), ir.Constant(vector, ir.Undefined)
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    # Four sums, because one would wait for each addition.
    sums = [builder.alloca(vector) for _ in range(LANES)]
    counter = builder.alloca(INT)
    for s in sums:
        builder.store(zero, s)
    known = builder.mul(q, INT(LANES))

    def at(offset):
        return builder.bitcast(builder.gep(rows, [offset]), vector.as_pointer())

    def add(j, into, valid):
        factor = builder.load(builder.gep(rows, [builder.add(a, j)]))
        factor = builder.insert_element(undefined, factor, LANE(0))
        factor = builder.shuffle_vector(factor, undefined, ir.Constant(ir.VectorType(LANE, LANES), [0] * LANES))
        first = builder.sub(builder.add(builder.add(b, known), INT(1)), j)
        other = builder.load(at(first), align=8)
        if valid < LANES:  # beyond are orders that do not exist yet
            mask = ir.Constant(ir.VectorType(BOOL, LANES), [int(lane < valid) for lane in range(LANES)])
            other = builder.select(mask, other, zero)
        builder.store(builder.call(fused, [factor, other, builder.load(into)]), into)

    work, test, loop, end = (function.append_basic_block(name) for name in ("work", "test", "loop", "end"))
    builder.cbranch(builder.icmp_signed(">", q, INT(0)), work, end)
    builder.position_at_end(work)
    for j in range(1, LANES + 1):
        add(INT(j), sums[j - 1], j)
    builder.store(INT(LANES + 1), counter)
    builder.branch(test)
    builder.position_at_end(test)
    j = builder.load(counter)
    builder.cbranch(builder.icmp_signed("<=", j, known), loop, end)
    builder.position_at_end(loop)
    for lane in range(LANES):
        add(builder.add(j, INT(lane)), sums[lane], LANES)
    builder.store(builder.add(j, INT(LANES)), counter)
    builder.branch(test)
    builder.position_at_end(end)
    s = [builder.load(q) for q in sums]
    builder.store(builder.fadd(builder.fadd(s[0], s[1]), builder.fadd(s[2], s[3])), at(out), align=8)
    builder.ret_void()
    return function


def combine(module: ir.Module, fused: ir.Function, name: str, count: int) -> ir.Function:
    """combine(rows, out, value, table, stride, K, c_0, c_1, ...): value + sum_j c_j times the row at table + j stride.

    Overwrites orders 0..K of the row at `out`, and with zeros what is left of the last block of eight.
    """
    vector, width = ROW, ROW.count
    mask = ir.VectorType(LANE, width)
    kind = ir.FunctionType(ir.VoidType(), [DOUBLE.as_pointer(), INT, DOUBLE, INT, INT, INT, *[DOUBLE] * count])
    function = ir.Function(module, kind, name)
    function.linkage = "internal"
    rows, out, value, table, stride, order, *factors = function.args
    undefined = ir.Constant(vector, ir.Undefined)
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    first = builder.insert_element(ir.Constant(vector, [0.0] * width), value, LANE(0))
    factors = [
        builder.shuffle_vector(
            builder.insert_element(undefined, c, LANE(0)), undefined, ir.Constant(mask, [0] * width)
        )
        for c in factors
    ]
    loop, end = function.append_basic_block("loop"), function.append_basic_block("end")
    builder.branch(loop)
    entry = builder.block
    builder.position_at_end(loop)
    start, total = builder.phi(INT), builder.phi(vector)
    start.add_incoming(INT(0), entry)
    total.add_incoming(first, entry)
    result: ir.Value = total
    for j, c in enumerate(factors):
        place = builder.add(builder.add(table, builder.mul(stride, INT(j))), start)
        response = builder.load(builder.bitcast(builder.gep(rows, [place]), vector.as_pointer()), align=8)
        result = builder.call(fused, [c, response, result])
    place = builder.gep(rows, [builder.add(out, start)])
    builder.store(result, builder.bitcast(place, vector.as_pointer()), align=8)
    following = builder.add(start, INT(width))
    start.add_incoming(following, loop)
    total.add_incoming(ir.Constant(vector, [0.0] * width), loop)
    builder.cbranch(builder.icmp_signed("<=", following, order), loop, end)
    builder.position_at_end(end)
    builder.ret_void()
    return function
