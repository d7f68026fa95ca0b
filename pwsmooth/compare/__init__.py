"""Comparisons: what is exact (verify), what accuracy costs, where methods break, which model a scene needs."""

import importlib

_HOME = {
    "CASES": "cases",
    "Case": "case",
    "case_of": "case",
    "METHODS": "methods",
    "Method": "methods",
    "Point": "points",
    "WorkPrecision": "points",
    "work_precision": "measuring",
    "ladder": "ladders",
    "stability": "hazards",
}

__all__ = ["CASES", "METHODS", "Case", "Method", "Point", "WorkPrecision", "case_of", "ladder", "stability",
           "work_precision"]  # fmt: skip


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)


def __dir__():
    return [*globals(), *_HOME]
