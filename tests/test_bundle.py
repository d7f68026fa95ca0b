"""A Bundle: what kernels see of it, and what it refuses."""

import ctypes

import numpy as np
import pytest

from pwsmooth.kernels.block import Bundle

Mixed = type("Mixed", (Bundle,), {"__annotations__": {
    "count": "int", "pointer": "f8*", "size": "float", "table": "f8[2]", "flag": "b1[1]", "last": "int",
}})  # fmt: skip
SHAPES = {"pointer": (3,), "table": (2, 3)}


def test_kernels_read_and_write_numbers_arrays_and_pointers_by_name():
    from numba import types

    from pwsmooth.kernels.compiling import unit

    @unit(types.void, Mixed)
    def double(s):
        s.count += 1
        s.size *= 2.0
        for i in range(s.table.shape[0]):
            for j in range(s.table.shape[1]):
                s.table[i, j] += s.pointer[j]
        s.last = 1 if s.flag[1] else 2

    table, pointer = np.arange(6.0).reshape(2, 3), np.array([10.0, 20.0, 30.0])
    one = Mixed(count=4, size=0.75, pointer=pointer, table=table.copy(), flag=[False, True])
    two = Mixed.in_one_block(Mixed.planned(SHAPES, {}), flag=[True, False])
    two.pointer[:] = pointer
    for bundle in (one, two):
        ctypes.CFUNCTYPE(None, ctypes.c_void_p)(double.address)(bundle.address)
    assert (one.count, one.size, one.last) == (5, 1.5, 1)
    assert (two.count, two.size, two.last) == (1, 0.0, 2)
    assert np.array_equal(one.table, table + pointer)
    assert np.array_equal(two.table, [pointer, pointer])


def test_a_block_is_zero_where_it_is_asked_to_be():
    plan = Mixed.planned({"pointer": (3,)}, {"table": (2, 3)})
    old = np.full(plan.size, 255, np.uint8)
    bundle = Mixed.in_one_block(plan, lambda size: old, flag=[True])
    assert np.all(bundle.pointer == 0) and np.all(np.isnan(bundle.table))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (dict(pointer=[1.0], table=np.eye(2)), r"needs \['flag'\] and has no \[\]"),
        (dict(pointer=[1.0], table=np.eye(2), flag=[True], name=1), r"needs \[\] and has no \['name'\]"),
        (dict(pointer=[1.0], table=[1.0], flag=[True]), r"table has rank 1, declared f8\[2\]"),
    ],
)
def test_what_is_absent_unknown_or_of_another_rank_is_refused(values, message):
    with pytest.raises(TypeError, match=message):
        Mixed(**values)
