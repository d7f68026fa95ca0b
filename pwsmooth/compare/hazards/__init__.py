"""Where each method breaks, and how: maps of hazards with the border that theory draws.

failures.py   the ways of failing, and the rules that tell them apart
hazard.py     what a hazard is: a plane of situations, methods, a border
fixed.py, unguarded.py, stopping.py   the methods that are put beside this package's own
explicit_*.py, smoothed.py, ...       the hazards, a family a file
maps.py       running them
stability_map.py   what came of it; charts.py, tables.py: showing it
"""

from .failures import KINDS, Finding
from .hazard import Axis, Hazard
from .maps import HAZARDS, stability
from .stability_map import StabilityMap

__all__ = ["HAZARDS", "KINDS", "Axis", "Finding", "Hazard", "StabilityMap", "stability"]
