"""A cost of a run as a function that JAX differentiates and maps: extra `jax`.

JAX calls back to the host for a run and its gradient; the derivative of the callback is linear in the gradient, so that
`jvp`, `grad` and `vmap` follow from one rule.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..door import checks
from .objective import Objective

__all__ = ["jax_function"]


@checks.door(objective=checks.instance(Objective, "an Objective, as pwsmooth.costs makes it"))
def jax_function(objective: Objective) -> Any:
    """An objective as a function of a JAX array.

    Parameters
    ----------
    objective : Objective
        A cost as a function of k quantities.

    Returns
    -------
    callable
        Of an array of shape (k,) to a scalar; `jax.grad`, `jax.jvp`, `jax.jit` and `jax.vmap` (one run after the other)
        apply.

    Raises
    ------
    ValueError
        JAX computes in single precision: the options of a run are too fine for that.

    >>> import jax
    >>> jax.config.update("jax_enable_x64", True)
    >>> x = sp.Symbol("x", real=True)
    >>> cost = jax_function(Objective(System({x: -2 * x}), final(x), (0, 1), {x: 1}, ["x"]))
    >>> print(f"{jax.grad(lambda q: cost(q) ** 2)(jax.numpy.array([3.0]))[0]:.6f}")  # 6 exp(-4)
    0.109894
    """
    checks.needs("jax", "jax>=0.5", "jax", "jax_function")
    import jax
    import jax.numpy as jnp

    if not jax.config.jax_enable_x64:
        raise ValueError(
            'JAX computes in single precision; call jax.config.update("jax_enable_x64", True) first.'
        )
    k = len(objective.start)

    def host(q: Any) -> tuple[np.ndarray, np.ndarray]:
        rows = np.asarray(q, float).reshape(-1, k)
        values, gradients = zip(*(objective(row) for row in rows))
        return np.array(values).reshape(q.shape[:-1]), np.array(gradients).reshape(q.shape)

    def both(q: Any) -> Any:
        shapes = jax.ShapeDtypeStruct(q.shape[:-1], float), jax.ShapeDtypeStruct(q.shape, float)
        return jax.pure_callback(host, shapes, q, vmap_method="expand_dims")

    @jax.custom_jvp
    def cost(q: Any) -> Any:
        return both(q)[0]

    @cost.defjvp
    def slope(primals: Any, tangents: Any) -> Any:
        value, gradient = both(primals[0])
        return value, jnp.dot(gradient, tangents[0])

    return lambda q: cost(jnp.asarray(q, float))
