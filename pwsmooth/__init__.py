"""pwsmooth: exact switching for piecewise-smooth dynamics.

The public names, loaded on first use: `import pwsmooth` compiles and plots nothing.

Bad input raises ValueError or TypeError before anything runs, with the argument, its value and the remedy. A numerical
failure raises nothing: the Solution keeps what came before it, and its `outcome` says what to try.
"""

import importlib
import sys

_HOME = {
    "System": "system",
    "Switch": "definition.primitives",
    "Disc": "definition.primitives",
    "Event": "definition.primitives",
    "Memory": "definition.primitives",
    "Unilateral": "definition.primitives",
    "Algebraic": "definition.primitives",
    "Family": "definition.families.family",
    "Drive": "definition.drives",
    "Control": "definition.controls",
    "Kicks": "noise.kicks",
    "Diffusion": "noise.diffusion",
    "solve": "solving",
    "Solution": "results.solution",
    "Outcome": "results.records",
    "sweep": "studies.sweeping",
    "basins": "studies.attraction",
    "Strobe": "analysis.maps.seen",
    "Return": "analysis.maps.seen",
    "find_orbit": "analysis.orbits.finding",
    "find_equilibrium": "analysis.equilibria.finding",
    "follow": "analysis.continuation.following",
    "diagram": "diagrams.calling",
    "fit": "fitting.fitting",
    "minimise": "costs.minimising",
    "explore": "explorer.opening",
}

__all__ = [*_HOME]


def on_first_use(package, home):
    """`__getattr__` and `__dir__` of a package whose names stand in the modules that `home` tells."""
    module = sys.modules[package]

    def get(name):
        if name not in home:
            from .door.calls import hint

            raise AttributeError(f"module {package!r} has no attribute {name!r}." + hint(name, home))
        value = getattr(importlib.import_module(f".{home[name]}", package), name)
        setattr(module, name, value)
        return value

    return get, lambda: [*vars(module), *home]


_get, _names = on_first_use(__name__, _HOME)


def __getattr__(name):
    if name != "__version__":
        return _get(name)
    from importlib.metadata import PackageNotFoundError, version

    try:
        found = version(__name__)
    except PackageNotFoundError:  # sources that are on the path alone
        found = "0+unknown"
    globals()[name] = found
    return found


def __dir__():
    return [*_names(), "__version__"]
