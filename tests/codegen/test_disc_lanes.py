"""The fields of discs at eight points at once, against those of one point.

Guards: codegen/lanes.py, codegen/machine/vectors.py, kernels/machine/lanes.py.
"""

import ctypes

import numpy as np
import pytest
import sympy as sp

from pwsmooth import Disc, Switch, System, solve
from pwsmooth.codegen import compile_model

x, v, w = sp.symbols("x v w", real=True)
t, mu = sp.symbols("t mu", positive=True)
lam = Disc("lam", (v, w))
FIELDS = {
    "plain": (sp.sin(2 * t) - x, sp.Rational(1, 3)),
    "functions": (sp.exp(-x) * sp.cos(t) / (1 + v**2) ** sp.Rational(3, 2), sp.sqrt(2 + x**2) * sp.atan(w)),
    "powers": ((2 + x) ** sp.Rational(4, 3) - (1 + x**2) ** mu, sp.erf(x) * sp.Symbol("s_") ** 2),
}


def system(first, second):
    first, second = (sp.sympify(e).subs(sp.Symbol("s_"), Switch("s", x)) for e in (first, second))
    return System(
        {x: v, v: first - mu * lam[0], w: second - mu * lam[1] * (1 + x**2)}, time=t, parameters={mu: 0.7}
    )


def called(address, arrays):
    kind = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(arrays))
    kind(address)(*(a.ctypes.data for a in arrays))


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("slips", [True, False])
def test_eight_points_at_once_give_what_one_does(name, slips):
    model = system(*FIELDS[name]).model
    compiled, n, m = compile_model(model), len(model.states), len(model.multipliers)
    sizes = n, m + len(model.events), m
    rng = np.random.default_rng(3)
    times, states, lams, p = (
        rng.random(8),
        rng.normal(size=(n, 8)),
        rng.uniform(-0.7, 0.7, (m, 8)),
        np.array([0.7]),
    )
    for j, mult in enumerate(model.multipliers):
        if mult.kind == "disc" and slips:
            lams[j] = 1.0
    found = [np.full((size, 8), np.nan) for size in sizes]
    called(compiled.fields8, [times, states, lams, p, *found])
    kind = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_void_p] * 6)
    for q in range(8):
        one = [np.full(size, np.nan) for size in sizes]
        given = [np.ascontiguousarray(a) for a in (states[:, q], lams[:, q], p)]
        kind(compiled.fields)(times[q], *(a.ctypes.data for a in (*given, *one)))
        for many, single in zip(found, one):
            np.testing.assert_allclose(many[:, q], single, rtol=1e-14, atol=1e-15)


def test_what_is_no_vector_is_computed_point_by_point_with_the_same_motion():
    # The same force as a power, and as an exponential function.
    forces = (2 + x**2) ** (v / 10), sp.exp(v * sp.log(2 + x**2) / 10)
    systems = [system(1.5 * sp.sin(t) - x + f - 1, sp.Rational(1, 5) * sp.cos(t)) for f in forces]
    assert [compile_model(s.model).fields8 != 0 for s in systems] == [False, True]
    runs = [solve(s, (0, 20), (1, 0, 0), rtol=1e-11) for s in systems]
    first, second = ([(e.kind, e.time) for e in r.events] for r in runs)
    assert [k for k, _ in first] == [k for k, _ in second] and {k for k, _ in first} > {"stick"}
    np.testing.assert_allclose([s for _, s in first], [s for _, s in second], atol=1e-9)
