"""Diagrams by one call: all branches over a parameter, and all curves of their bifurcations over two."""

from .. import on_first_use

__all__ = [
    "BifurcationSet",
    "Diagram",
    "diagram",
    "read_diagram",
]

_HOME = {
    "BifurcationSet": "sets",
    "Diagram": "result",
    "diagram": "calling",
    "read_diagram": "sets",
}

__getattr__, __dir__ = on_first_use(__name__, _HOME)
