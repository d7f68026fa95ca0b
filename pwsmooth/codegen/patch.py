"""The programs of a family for a patch of its elements: the same text, with tables of who is whose neighbour.

A run that renews a few elements at each event (kernels/local) sets the numbers of elements and the tables anew for
every patch, so that it needs a copy of the code of its own.
Chain: template.py -> families/*.py -> native.build -> **PatchCode** -> paths/local.py.
"""

from __future__ import annotations

import ctypes

import numpy as np

from ..definition.model import Model, tables_of
from .families.fields import FamilyFields
from .families.writing import write_family_jets
from .layout import Layout
from .machine import cache, native, objects

PROGRAMS = "fields", "linear", "act", "slip", "general"


class PatchCode:
    """One copy of the machine code of a model with one family.

    Attributes
    ----------
    address : dict
        "fields", "linear", "act", "slip", "general" -> address, 0 where the model has none.
    sizes : ndarray of int64, shape (2, programs)
        Addresses of the number of elements and of the number of places, in every program.
    constants : dict
        Name of a program -> constants of its text.
    offsets : list of int
        Of the neighbours, in the order of the table.
    """

    def __init__(self, model: Model):
        families = model.families
        assert families is not None

        def build() -> dict[str, str]:
            return FamilyFields(model, patch=True).write() | write_family_jets(model, patch=True)

        key = cache.fingerprint(families.template)
        texts = cache.cached_texts(f"{key}-patch", build)
        tables = tuple(tables_of(model))
        self.offsets = Layout(families.template).offsets[0]
        found = {name: texts[name] for name in PROGRAMS if name in texts}
        self._codes = {name: objects.Code(text, native.build, (), tables) for name, text in found.items()}
        self.constants = {name: code.constants for name, code in self._codes.items()}
        symbols = {"slip": "jet_slip", "general": "jet_general"}
        self.address = dict.fromkeys(PROGRAMS, 0) | {
            name: code.address(symbols.get(name, name)) for name, code in self._codes.items()
        }
        self.sizes = np.array([[c.place(f"n{i}") for c in self._codes.values()] for i in range(2)], np.int64)

    def give(self, near: np.ndarray, number: np.ndarray) -> None:
        """Tables of doubles: place of each neighbour of each element of the patch, number of each element."""
        self._tables = near, number
        for code in self._codes.values():
            for name, table in (("near0", near), ("number0", number)):
                if place := code.place(name):
                    ctypes.c_void_p.from_address(place).value = table.ctypes.data
