"""Derivatives of a run by parameters and starts: from its tape, from saltation matrices, from collocation."""

from ... import on_first_use

_HOME = dict.fromkeys(("Derivatives", "EventDerivative", "NoDerivative"), "of_solution")

__all__ = [*_HOME]

__getattr__, __dir__ = on_first_use(__name__, _HOME)
