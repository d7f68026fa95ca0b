"""Equilibria: regular, sliding, on stops, virtual; their modes and stability."""

from ... import on_first_use

_HOME = {
    "Equilibrium": "equilibrium",
    "equilibria": "finding",
    "find_equilibrium": "finding",
}

__all__ = [*_HOME]

__getattr__, __dir__ = on_first_use(__name__, _HOME)
