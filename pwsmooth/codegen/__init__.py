"""Model -> compiled addresses: the only place that turns symbols into machine code.

    compiled = compile_model(model)
    compiled.fields, compiled.jet_slip, ...     int addresses of C functions, 0 where the model has none

Text is cached by the model's fingerprint, machine code by the text's hash: a second process does neither
symbolic work nor compilation. Chain: model.py -> dag.py, scalar.py, fields.py, jets.py -> native.py.
"""

from __future__ import annotations

import importlib
from functools import cached_property
from weakref import WeakValueDictionary

import numpy as np

from ..definition.model import Model
from .layout import all_tables
from .machine import cache

_compiled: WeakValueDictionary[Model, Compiled] = WeakValueDictionary()


LANES = {"column": 1, "columns": 8}  # of programs that make the series of deviations


class Compiled:
    """Addresses of a model's functions; it must outlive their use.

    Attributes
    ----------
    model : Model
    n, m, ne, nz, np : int
        Numbers of states (memories included), multipliers, events, layer states, parameters.
    fields, fields8, linear, act, outputs, layer : int
        Addresses of the pointwise functions (fields.py, lanes.py), 0 where the model has none. Loaded when asked for.
    jet_slip, jet_general : int
        Addresses of the Taylor programs (jets.py), 0 where the model has none.
    has_jets : bool
        False when some function of the model has no recurrence.
    nrows_slip, nrows_general : (int, int)
        Rows of coefficients that the programs write, and rows that they need for themselves; a row needs a stride of
        at least K + 4.
    surface_rows_slip, surface_rows_general : ndarray of int64, shape (m + ne,)
        Row of each surface, -1 where there is none.
    flat_rows_slip, flat_rows_general : ndarray of int64
        Rows of the arguments of functions that are flat far from 0 (recurrences.FLAT).
    mult_row0 : int
        Row of the first multiplier in the general program.
    """

    def __init__(self, model: Model):
        self.model = model
        self.n, self.m, self.ne = len(model.states), len(model.multipliers), len(model.events)
        self.nz, self.np = len(model.layer_states), len(model.parameters)
        # With families the text, and so its machine code, is that of one element: sizes are put into the loaded code.
        self._families = model.families
        self._key = cache.fingerprint(model.families.template if model.families else model)
        self._sizes = model.families.sizes if model.families else ()
        self._tables = all_tables(model)
        self._modules: list = []  # keeps the machine code alive
        self._loaded: dict = {}

    def _load(self, texts, name: str, made_by: str = "native"):
        if name not in texts:
            return None
        load = importlib.import_module(f".machine.{made_by}", __package__).load
        code = load(texts[name], self._sizes, self._tables)
        self._modules.append(code)
        return code

    def _address(self, name: str) -> int:
        code = self._module(name)
        return code.address(name) if code else 0

    def _module(self, name: str):
        if name not in self._loaded:
            made_by = "vectors" if name == "fields8" else "native"
            self._loaded[name] = self._load(self._fields, name, made_by)
        return self._loaded[name]

    @cached_property
    def _fields(self):
        def build():
            if self._families:
                from .families.fields import FamilyFields

                return FamilyFields(self.model).write()
            from .fields import write_fields

            return write_fields(self.model)

        return cache.cached_texts(f"{self._key}-fields", build)

    @cached_property
    def _jets(self):
        def build():
            if self._families:
                from .families.writing import write_family_jets

                return write_family_jets(self.model)
            from .taylor.jets import write_jets

            return write_jets(self.model)

        return cache.cached_texts(f"{self._key}-jets", build)

    def _tangents(self, what: str):
        """Texts of the pointwise functions of jacobian.py, "point", or of jets."""

        def build():
            if what == "point":
                from .jacobian import write_jacobian

                return write_jacobian(self.model)
            from .taylor.jets import write_jets

            parameters = len(self.model.parameters) if what != "column" else 0
            return write_jets(self.model, parameters=parameters, given=what != "jets", lanes=LANES.get(what, 0))

        return cache.cached_texts(f"{cache.fingerprint(self.model)}-tangents-{what}", build)

    def tangent(self, what: str, name: str):
        """A program of theirs, loaded: its constants and addresses; None where the model has none.

        Jets with the series of the Jacobians ("jets"); these series alone, where those of the run are given ("given");
        the series of eight deviations there ("columns"), or of one that is none of parameters ("column").
        """
        key = "tangent", what, name
        if key not in self._loaded:
            made_by = "columns" if what == "columns" else "native"
            self._loaded[key] = self._load(self._tangents(what), name, made_by)
        return self._loaded[key]

    @cached_property
    def _slip(self):
        return self._load(self._jets, "slip")

    @cached_property
    def _general(self):
        return self._load(self._jets, "general")

    @cached_property
    def fields(self) -> int:
        return self._address("fields")

    @cached_property
    def fields8(self) -> int:
        return self._address("fields8")

    @cached_property
    def linear(self) -> int:
        return self._address("linear")

    def pattern(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the sparse matrix "G" or "DH" that `linear` fills."""
        constants = self._module("linear").constants
        if self._families:
            from .layout import Layout, sparse_pattern

            lay = Layout(self._families.template)
            families, columns = (
                (lay.multipliers, lay.multipliers) if name == "G" else (lay.surfaces, lay.states)
            )
            return sparse_pattern(
                constants[f"{name}_ROWS"], families, columns, self._sizes, self._families.neighbours
            )
        return tuple(np.array(constants[f"{name}_{part}"], np.int64) for part in ("ROW", "COL"))

    @property
    def surfaces_of_unknowns(self) -> tuple[int, ...]:
        """Of which `linear` fills the sizes of their unknowns, behind the slopes."""
        return self._module("linear").constants.get("DH_UNKNOWNS", ())

    @cached_property
    def act(self) -> int:
        return self._address("act")

    @cached_property
    def outputs(self) -> int:
        return self._address("outputs")

    @cached_property
    def layer(self) -> int:
        return self._address("layer")

    @property
    def has_jets(self) -> bool:
        return "slip" in self._jets

    @cached_property
    def jet_slip(self) -> int:
        return self._slip.address("jet_slip") if self._slip else 0

    @cached_property
    def jet_general(self) -> int:
        return self._general.address("jet_general") if self._general else 0

    def _rows(self, program) -> tuple[int, int, np.ndarray, np.ndarray]:
        if program is None:
            return 0, 0, np.zeros(0, np.int64), np.zeros(0, np.int64)
        if self._families:
            from .layout import Layout, numeric_rows

            found = numeric_rows(program.constants, Layout(self._families.template).surfaces, self._sizes)
        else:
            found = (program.constants[name] for name in ("NROWS", "OWN_ROWS", "SURFACE_ROWS", "FLAT_ROWS"))
        *counts, rows, flat = found
        return *counts, np.array(rows, np.int64), np.array(flat, np.int64)

    @property
    def nrows_slip(self) -> tuple[int, int]:
        return self._rows(self._slip)[:2]

    @property
    def nrows_general(self) -> tuple[int, int]:
        return self._rows(self._general)[:2]

    @property
    def by_responses(self) -> bool:
        """Whether all programs are matrix products (responses.py), whose cost hardly grows with the order."""
        programs = [program for program in (self._slip, self._general) if program]
        return bool(programs) and all(program.constants.get("BY_RESPONSES") for program in programs)

    @cached_property
    def surface_rows_slip(self) -> np.ndarray:
        return self._rows(self._slip)[2]

    @cached_property
    def surface_rows_general(self) -> np.ndarray:
        return self._rows(self._general)[2]

    @property
    def flat_rows_slip(self) -> np.ndarray:
        return self._rows(self._slip)[3]

    @property
    def flat_rows_general(self) -> np.ndarray:
        return self._rows(self._general)[3]

    @property
    def mult_row0(self) -> int:
        return self.n


def compile_model(model: Model) -> Compiled:
    """Compiled functions of a model; one object for equal models. Its addresses live as long as the object.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth.definition.model import Model
    >>> t, x = sp.symbols("t x", real=True)
    >>> compile_model(Model(time=t, states=(x,), parameters=(), rhs=(-x,))).n
    1
    """
    found = _compiled.get(model)
    if found is None:
        found = _compiled[model] = _from_functions(model) if model.functions else Compiled(model)
    return found


def _from_functions(model):
    from .functions import CompiledFunctions

    return CompiledFunctions(model)
