"""Branches of orbits and equilibria over one parameter, their bifurcations, and curves of these over two."""

from ... import on_first_use

_HOME = {
    "Branch": "branch",
    "Special": "special",
    "Steps": "steps",
    "branch_off": "branches",
    "cycle_from": "equilibria.hopf",
    "follow": "following",
}

__all__ = [*_HOME]

__getattr__, __dir__ = on_first_use(__name__, _HOME)
