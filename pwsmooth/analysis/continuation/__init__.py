"""Branches of orbits and equilibria over one parameter, their bifurcations, and curves of these over two."""

from ... import on_first_use

_HOME = {
    "Bifurcation": "branches",
    "Branch": "branches",
    "Codimension2": "two_parameters",
    "Curve": "two_parameters",
    "EquilibriumBifurcation": "equilibria.branch",
    "EquilibriumBranch": "equilibria.branch",
    "EquilibriumCurve": "equilibria.curves",
    "branch_off": "branches",
    "cycle_from": "equilibria.hopf",
    "Steps": "steps",
    "follow": "following",
}

__all__ = [*_HOME]

__getattr__, __dir__ = on_first_use(__name__, _HOME)
