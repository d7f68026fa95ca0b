"""Diagrams by one call: all branches over a parameter, and all curves of their bifurcations over two."""

from .. import on_first_use

__all__ = ["Diagram", "Found", "diagram", "read_diagram"]

_HOME = {"Diagram": "result", "Found": "result", "diagram": "one_parameter", "read_diagram": "result"}

__getattr__, __dir__ = on_first_use(__name__, _HOME)
