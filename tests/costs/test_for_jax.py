"""Costs as functions of JAX arrays."""

import numpy as np
import pytest
import sympy as sp

from pwsmooth import System
from pwsmooth.costs import Objective, event_time, final

jax = pytest.importorskip("jax")

x, v = sp.symbols("x v", real=True)
mu = sp.Symbol("mu", positive=True)
BODY = System({x: v, v: -mu * sp.sign(v)}, parameters={mu: 2})


@pytest.fixture(scope="module")
def cost():
    from pwsmooth.costs.for_jax import jax_function

    jax.config.update("jax_enable_x64", True)
    return jax_function(Objective(BODY, final(x) * event_time("sgn(v)"), (0, 9), {x: 0, v: 4}, ["mu", "v"]))


def exact(q):
    """v**3/(2 mu**2), and its slopes."""
    m, u = np.asarray(q)
    return u**3 / (2 * m**2), np.array([-(u**3) / m**3, 3 * u**2 / (2 * m**2)])


def test_values_gradients_and_directions(cost):
    q = jax.numpy.array([2.0, 4.0])
    value, gradient = jax.value_and_grad(cost)(q)
    assert float(value) == pytest.approx(exact(q)[0], rel=1e-9)
    assert np.asarray(gradient) == pytest.approx(exact(q)[1], rel=1e-9)
    _, along = jax.jvp(cost, (q,), (jax.numpy.array([1.0, -2.0]),))
    assert float(along) == pytest.approx(exact(q)[1] @ [1.0, -2.0], rel=1e-9)
    assert np.asarray(jax.jit(jax.grad(lambda q: cost(q) ** 2))(q)) == pytest.approx(
        2 * exact(q)[0] * exact(q)[1], rel=1e-9
    )


def test_a_map_runs_a_sweep(cost):
    q = jax.numpy.array([[2.0, 4.0], [1.0, 3.0], [3.0, 5.0]])
    assert np.asarray(jax.vmap(cost)(q)) == pytest.approx([exact(row)[0] for row in q], rel=1e-9)
    assert np.asarray(jax.vmap(jax.grad(cost))(q)) == pytest.approx(
        np.array([exact(row)[1] for row in q]), rel=1e-9
    )


def test_single_precision_is_refused():
    from pwsmooth.costs.for_jax import jax_function

    objective = Objective(BODY, final(x), (0, 9), {x: 0, v: 4}, ["mu"])
    with pytest.raises(TypeError, match="objective"):
        jax_function(3)
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(ValueError, match="single precision"):
            jax_function(objective)
    finally:
        jax.config.update("jax_enable_x64", True)
