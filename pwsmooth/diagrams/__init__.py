"""Diagrams by one call: all branches over a parameter, and all curves of their bifurcations over two."""

from .. import on_first_use

__all__ = [
    "BifurcationSet",
    "Diagram",
    "Found",
    "Meeting",
    "bifurcation_set",
    "diagram",
    "read_diagram",
    "read_set",
]

_HOME = {
    "BifurcationSet": "sets",
    "Diagram": "result",
    "Found": "result",
    "Meeting": "sets",
    "bifurcation_set": "two_parameters",
    "diagram": "one_parameter",
    "read_diagram": "result",
    "read_set": "sets",
}

__getattr__, __dir__ = on_first_use(__name__, _HOME)
