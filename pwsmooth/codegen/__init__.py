"""Model -> compiled addresses: the only place that turns symbols into machine code.

    compiled = compile_model(model)
    compiled.fields, compiled.jet_slip, ...     int addresses of C functions, 0 where the model has none

Text is cached by the model's fingerprint, machine code by the text's hash: a second process does neither
symbolic work nor compilation. Chain: model.py -> dag.py, scalar.py, fields.py, jets.py -> cache.py -> kernels.
"""

from __future__ import annotations

from functools import cached_property

from ..model import Model
from . import cache

_compiled: dict[Model, Compiled] = {}


class Compiled:
    """Addresses of a model's functions; it must outlive their use.

    Attributes
    ----------
    model : Model
    n, m, ne, nz, np : int
        Numbers of states (memories included), multipliers, events, layer states, parameters.
    fields, linear, act, outputs, layer : int
        Addresses of the pointwise functions (fields.py), 0 where the model has none. Loaded when asked for.
    """

    def __init__(self, model: Model):
        self.model = model
        self.n, self.m, self.ne = len(model.states), len(model.multipliers), len(model.events)
        self.nz, self.np = len(model.layer_states), len(model.parameters)
        self._key = cache.fingerprint(model)
        self._modules: list = []  # keeps the machine code alive

    def _address(self, name: str) -> int:
        path = self._fields.get(name)
        if path is None:
            return 0
        module = cache.load_module(path)
        self._modules.append(module)
        return getattr(module, name).address

    @cached_property
    def _fields(self):
        def build():
            from .fields import write_fields

            return write_fields(self.model)

        return cache.cached_modules(f"{self._key}-fields", build)

    @cached_property
    def fields(self) -> int:
        return self._address("fields")

    @cached_property
    def linear(self) -> int:
        return self._address("linear")

    @cached_property
    def act(self) -> int:
        return self._address("act")

    @cached_property
    def outputs(self) -> int:
        return self._address("outputs")

    @cached_property
    def layer(self) -> int:
        return self._address("layer")


def compile_model(model: Model) -> Compiled:
    """Compiled functions of a model; one object for equal models, kept for the life of the process.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth.model import Model
    >>> t, x = sp.symbols("t x", real=True)
    >>> compile_model(Model(time=t, states=(x,), parameters=(), rhs=(-x,))).n
    1
    """
    if model not in _compiled:
        _compiled[model] = Compiled(model)
    return _compiled[model]
