"""A Bundle: what kernels see of it, and what it refuses."""

import ctypes

import numpy as np
import pytest

from pwsmooth.codegen.machine.objects import link
from pwsmooth.kernels.machine.block import Bundle

Mixed = type("Mixed", (Bundle,), {"__annotations__": {
    "count": "int", "pointer": "f8*[k]", "size": "float", "table": "f8[2, k]", "flag": "b1[:]", "last": "int",
}})  # fmt: skip
Inner = type("Inner", (Bundle,), {"__annotations__": {"sum": "float", "squares": "f8[2*k + 1]"}})
Outer = type("Outer", (Bundle,), {"__annotations__": {"first": "int", "inner": Inner, "last": "f8[k]"}})


def test_kernels_read_and_write_numbers_arrays_and_pointers_by_name():
    from numba import types

    from pwsmooth.kernels.machine.compiling import unit

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
    two = Mixed.in_one_block(Mixed.planned({"k": 3}), flag=[True, False])
    two.pointer[:] = pointer
    engine = link(double.compiled())
    call = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(engine.get_function_address(double.symbol))
    for bundle in (one, two):
        call(bundle.address)
    assert (one.count, one.size, one.last) == (5, 1.5, 1)
    assert (two.count, two.size, two.last) == (1, 0.0, 2)
    assert np.array_equal(one.table, table + pointer)
    assert np.array_equal(two.table, [pointer, pointer])


def test_a_bundle_inside_another_one_stands_on_its_memory():
    from numba import types

    from pwsmooth.kernels.machine.compiling import unit

    @unit(types.float64, Inner, types.int64)
    def add(inner, i):
        inner.sum += inner.squares[i]
        return inner.sum

    @unit(types.float64, Outer)
    def sum_of_squares(s):
        s.first += 1
        for i in range(len(s.inner.squares)):
            s.inner.sum += s.inner.squares[i] * s.last[0]
        return s.inner.sum

    outer = Outer.zeros({"k": 3}, first=7)
    outer.inner.squares[:] = np.arange(7.0) ** 2
    outer.last[0] = 2.0
    assert outer.inner.squares.ctypes.data % 64 == 0
    engines = [link(part.compiled()) for part in (sum_of_squares, add)]
    whole, part = (
        e.get_function_address(u.symbol) for e, u in zip(engines, (sum_of_squares, add), strict=True)
    )
    ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p)(whole)(outer.address)
    assert (outer.first, outer.inner.sum) == (8, 182.0)
    adding = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_int64)(part)
    assert adding(outer.inner.address, 6) == outer.inner.sum == 218.0


def test_a_block_is_zero_where_it_is_asked_to_be():
    plan = Mixed.planned({"k": 3}, undefined=["table"])
    bundle = Mixed.in_one_block(plan, lambda size: np.full(size, 255, np.uint8), flag=[True])
    assert np.all(bundle.pointer == 0) and np.all(np.isnan(bundle.table))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (dict(pointer=[1.0], table=np.eye(2)), r"needs \['flag'\] and has no \[\]"),
        (dict(pointer=[1.0], table=np.eye(2), flag=[True], name=1), r"needs \[\] and has no \['name'\]"),
        (dict(pointer=[1.0], table=[1.0], flag=[True]), "table has rank 1, declared 2"),
    ],
)
def test_what_is_absent_unknown_or_of_another_rank_is_refused(values, message):
    with pytest.raises(TypeError, match=message):
        Mixed(**values)
