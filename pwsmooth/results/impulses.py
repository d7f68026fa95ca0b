"""Impulses of impacts: what reactions, and outputs that are linear in them, integrate to over the instant.

    int R dt = P,   int e dt = e(R = P) - e(R = 0),  with the lambda that friction has in the impact

Chain: kernels/instant/impacts.py (P and lambda) -> **this file** -> records.py, as `EventRecord.impulse`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp

from ..definition.discs import is_affine
from ..definition.model import Model
from ..kernels.state import EV_IMPACT
from .outputs import vectorised

Impulse = dict[str, float]


class ImpulsesOf:
    """The impulses of a model's runs."""

    def __init__(self, model: Model) -> None:
        self.model = model

    @functools.cached_property
    def contacts(self) -> dict[str, int]:
        """The multipliers that are reactions."""
        return {str(mu.symbol): k for k, mu in enumerate(self.model.multipliers) if mu.kind == "contact"}

    @functools.cached_property
    def outputs(self) -> dict[str, sp.Expr]:
        """Outputs that are linear in reactions; those of families are left out."""
        if self.model.families is not None:
            return {}
        reactions = [mu.symbol for mu in self.model.multipliers if mu.kind == "contact"]
        unknown = {mu.symbol for mu in self.model.multipliers if mu.kind == "algebraic"}
        linear = {str(name): sp.sympify(e, strict=True) for name, e in self.model.outputs}
        return {
            name: e
            for name, e in linear.items()
            if e.free_symbols & {*reactions} and not e.free_symbols & unknown and is_affine(e, reactions)
        }

    @functools.cached_property
    def values(self) -> Any:
        """A numpy function of these outputs."""
        return vectorised(self.model, sp.Tuple(*self.outputs.values()))

    def __call__(
        self,
        times: np.ndarray,
        codes: np.ndarray,
        push: np.ndarray,
        t: np.ndarray,
        x: np.ndarray,
        p: Any,
        now: bool,
    ) -> Callable[[int], Impulse | None]:
        """Index of an event -> its impulse, or None of what is no impact.

        Parameters
        ----------
        times, codes, push : ndarray, shapes (ne,), (ne, 4), (ne, m)
            What the kernels recorded of the events.
        t, x : ndarray, shapes (nt,), (nt, n)
            Columns of the run, those at the events among them.
        p : ndarray
            Values of the parameters.
        now : bool
            Whether all are found at once; else when one is asked for, and the columns are kept until then.
        """
        p = np.array(p)

        @functools.cache
        def found() -> dict[int, Impulse]:
            impacts = np.flatnonzero(codes[: len(push), 1] == EV_IMPACT)
            rows = push[impacts]
            columns = [rows[:, k] for k in self.contacts.values()]
            if self.outputs and len(impacts):
                at = np.searchsorted(t, times[impacts])
                mult = rows.T.copy()
                for k, mu in enumerate(self.model.multipliers):
                    if mu.kind == "disc":
                        mult[k] = 0.5  # its components tell the direction, also of a slip
                free = mult.copy()
                free[list(self.contacts.values())] = 0.0
                struck, unstruck = (self.values(t[at], *x[at].T, *rows, *p) for rows in (mult, free))
                columns += [np.broadcast_to(a - b, len(impacts)) for a, b in zip(struck, unstruck, strict=True)]
            names = (*self.contacts, *self.outputs)
            result = {}
            for i, values in zip(impacts.tolist(), np.array(columns).T.tolist(), strict=True):
                struck_by = str(self.model.multipliers[int(codes[i, 0])].symbol)
                # Of many contacts those that push.
                result[i] = {
                    name: v
                    for name, v in zip(names, values)
                    if v != 0.0 or name == struck_by or name in self.outputs
                }
            return result

        if now:
            known = found()
            return known.get
        return lambda i: found().get(i)
