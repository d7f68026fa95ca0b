"""A cost of a run as a function that torch differentiates: extra `torch`."""

from __future__ import annotations

from typing import Any

from ..door import checks
from .objective import Objective

__all__ = ["torch_function"]


@checks.door(objective=checks.instance(Objective, "an Objective, as pwsmooth.costs makes it"))
def torch_function(objective: Objective) -> Any:
    """An objective as a function of a torch tensor.

    Parameters
    ----------
    objective : Objective
        A cost as a function of k quantities.

    Returns
    -------
    callable
        Of a tensor of shape (k,) to a scalar tensor in double precision, whose `backward` is the exact gradient.

    >>> x = sp.Symbol("x", real=True)
    >>> objective = Objective(System({x: -2 * x}), final(x), (0, 1), {x: 1}, ["x"])
    >>> cost = torch_function(objective)  # doctest: +SKIP
    """
    checks.needs("torch", "torch>=2.4", "torch", "torch_function")
    import torch

    class Cost(torch.autograd.Function):
        @staticmethod
        def forward(context: Any, q: Any) -> Any:
            value, gradient = objective(q.detach().cpu().numpy())
            context.save_for_backward(torch.as_tensor(gradient))
            return torch.as_tensor(value, dtype=torch.float64)

        @staticmethod
        def backward(context: Any, *slopes: Any) -> Any:
            (gradient,) = context.saved_tensors
            return slopes[0] * gradient

    return Cost.apply
