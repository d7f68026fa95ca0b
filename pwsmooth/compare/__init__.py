"""Comparisons: what is exact (verify), what accuracy costs, where methods break, which model a scene needs."""

from .. import on_first_use

_HOME = {
    "CASES": "work_precision.cases",
    "Case": "work_precision.case",
    "case_of": "work_precision.case",
    "METHODS": "work_precision.methods",
    "Method": "work_precision.methods",
    "Point": "work_precision.points",
    "WorkPrecision": "work_precision.points",
    "work_precision": "work_precision.measuring",
    "ladder": "ladders",
    "stability": "hazards",
}

__all__ = ["CASES", "METHODS", "Case", "Method", "Point", "WorkPrecision", "case_of", "ladder", "stability",
           "work_precision"]  # fmt: skip


__getattr__, __dir__ = on_first_use(__name__, _HOME)
