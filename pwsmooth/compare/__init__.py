"""Comparisons: what is exact (verify), what accuracy costs, where methods break, which model a scene needs."""

from .. import on_first_use

_HOME = {
    "CASES": "efficiency.cases",
    "Case": "efficiency.case",
    "case_of": "efficiency.case",
    "METHODS": "efficiency.methods",
    "Method": "efficiency.methods",
    "Point": "efficiency.points",
    "WorkPrecision": "efficiency.points",
    "work_precision": "efficiency.measuring",
    "ladder": "ladders",
    "stability": "hazards",
}

__all__ = ["CASES", "METHODS", "Case", "Method", "Point", "WorkPrecision", "case_of", "ladder", "stability",
           "work_precision"]  # fmt: skip


__getattr__, __dir__ = on_first_use(__name__, _HOME)
