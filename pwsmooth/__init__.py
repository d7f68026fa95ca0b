"""pwsmooth: exact switching for piecewise-smooth dynamics.

The public names, loaded on first use: `import pwsmooth` compiles and plots nothing.
"""

import importlib
import sys
import types

_HOME = {
    "System": "system",
    "HiddenTerm": "system",
    "Switch": "primitives",
    "Event": "primitives",
    "Memory": "primitives",
    "Unilateral": "primitives",
    "Algebraic": "primitives",
    "Family": "family",
    "Kicks": "noise",
    "Diffusion": "diffusion",
    "ensemble": "noise_ensemble",
    "solve": "solve",
    "sweep": "sweep",
    "find_orbit": "analysis.orbits",
    "follow": "analysis.continuation",
    "lyapunov_exponents": "analysis.lyapunov",
    "basins": "analysis.basins",
    "orbit_diagram": "analysis.basins",
    "Solution": "solution",
    "Outcome": "solution",
}

__all__ = [*_HOME]


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__():
    return [*globals(), *__all__]


class _Package(types.ModuleType):
    """`pwsmooth.solve` is the function, also after Python has bound the submodule of that name here."""

    def __setattr__(self, name, value):
        if not (name in _HOME and isinstance(value, types.ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
