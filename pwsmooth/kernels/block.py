"""A struct of numbers and arrays that kernels take as one pointer.

Passing some sixty arrays one by one (or in a tuple, which is the same to LLVM) makes every call flatten hundreds of
words and made the core compile for minutes. A Bundle is a block of 8-byte cells: a scalar takes one, an array its
address and shape. To a kernel `bundle.x` is an ordinary array (bundle.py); the Python object keeps the memory alive.
"""

from __future__ import annotations

import numpy as np

_DTYPES = {"f8": np.float64, "i8": np.int64, "i1": np.int8, "b1": np.bool_}


class Bundle:
    """Base of the structs in state.py; an annotation is "int", "float" or an element's code with "[rank]"."""

    fields: tuple[tuple[str, str], ...]

    def __init_subclass__(cls):
        cls.fields = tuple(cls.__annotations__.items())

    def __init__(self, **values):
        cells = []
        for name, code in self.fields:
            value = values.pop(name)
            if code == "int":
                cells.append(value)
            elif code == "float":
                cells.append(np.float64(value).view(np.int64))
            else:
                value = np.ascontiguousarray(value, _DTYPES[code[:2]])
                if value.ndim != int(code[3]):
                    raise TypeError(f"{type(self).__name__}.{name} has rank {value.ndim}, declared {code}.")
                cells += [value.ctypes.data, *value.shape]
            setattr(self, name, value)
        if values:
            raise TypeError(f"{type(self).__name__} has no fields {', '.join(values)}.")
        self.cells = np.array(cells, np.int64)
        self.address = self.cells.ctypes.data
