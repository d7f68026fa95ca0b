"""pwsmooth: exact switching for piecewise-smooth dynamics.

The public names, loaded on first use: `import pwsmooth` compiles and plots nothing.

Bad input raises ValueError or TypeError before anything runs, with the argument, its value and the remedy. A numerical
failure raises nothing: the Solution keeps what came before it, and its `outcome` says what to try.
"""

import importlib
import sys
import types

_HOME = {
    "System": "system",
    "HiddenTerm": "system",
    "Switch": "definition.primitives",
    "Disc": "definition.primitives",
    "Event": "definition.primitives",
    "Memory": "definition.primitives",
    "Unilateral": "definition.primitives",
    "Algebraic": "definition.primitives",
    "Family": "definition.families.family",
    "Recorder": "definition.families.recording",
    "Histogram": "definition.families.event_statistics",
    "Activity": "definition.families.event_statistics",
    "SlipHistogram": "definition.families.event_statistics",
    "Drive": "definition.drives",
    "Control": "definition.controls",
    "Kicks": "noise.kicks",
    "Diffusion": "noise.diffusion",
    "ensemble": "sweep.ensemble",
    "solve": "solve",
    "sweep": "sweep",
    "Strobe": "analysis.maps.seen",
    "Return": "analysis.maps.seen",
    "find_orbit": "analysis.orbits.finding",
    "find_equilibrium": "analysis.equilibria.finding",
    "equilibria": "analysis.equilibria.finding",
    "follow": "analysis.continuation.following",
    "manifold": "analysis.global_objects.manifolds",
    "sliding_portrait": "analysis.global_objects.portraits",
    "diagram": "diagrams.calling",
    "lyapunov_exponents": "analysis.lyapunov",
    "basins": "sweep.basins",
    "orbit_diagram": "sweep.basins",
    "explore": "explore",
    "Solution": "results.solution",
    "Outcome": "results.records",
}

__all__ = [*_HOME]


def on_first_use(package, home):
    """`__getattr__` and `__dir__` of a package whose names stand in the modules that `home` tells.

    A name stays what `home` says, also after Python has bound a submodule of that name to the package.
    """
    module = sys.modules[package]

    class Package(types.ModuleType):
        def __setattr__(self, name, value):
            if not (name in home and isinstance(value, types.ModuleType)):
                super().__setattr__(name, value)

    def get(name):
        if name not in home:
            from .door.calls import hint

            raise AttributeError(f"module {package!r} has no attribute {name!r}." + hint(name, home))
        value = getattr(importlib.import_module(f".{home[name]}", package), name)
        setattr(module, name, value)
        return value

    module.__class__ = Package
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
