"""Costs of a run and their exact gradients, through every event, backward in time.

    cost = integral(x**2) + (final(x) - 2)**2

A cost is an expression of quantities that a run gives (an integral, a value at the end, at a time or at an event, the
time of an event, an extreme, a duration, a misfit of data) and of parameters. Its gradient by many parameters costs a
few runs: slopes are carried back over the tape that the run has written (kernels/tangent/reverse.py).

Chain: System, solve() -> **costs**, minimise() -> fits.
"""

from .minimising import minimise
from .minimum import Evaluation, Minimum
from .objective import Objective, value_and_gradient
from .quantities import (
    Quantity,
    at,
    at_event,
    duration,
    event_time,
    final,
    integral,
    largest,
    misfit,
    smallest,
)
from .reading import Gradient

__all__ = [
    "Evaluation", "Gradient", "Minimum", "Objective", "Quantity", "at", "at_event", "duration", "event_time", "final",
    "integral", "largest", "minimise", "misfit", "smallest", "value_and_gradient",
]  # fmt: skip
