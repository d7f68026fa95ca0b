"""Studies: thousands of orbits over parameters, initial conditions and seeds, measured and kept.

axes.py      what is swept            measures.py  what is kept of an orbit
plan.py      a checked sweep          chunk.py     what a worker does with a chunk of points
work.py      by whom and where kept   store.py     chunks on disk, resumed after a kill
stored.py    a store is read          identity.py  what a sweep must agree on to be resumed
dataset.py   the result               study.py     a sweep in a TOML file
periodicity.py, quantities.py, functions.py        measures, by subject
refining.py  a sweep that may be looked at while it runs
sweeping.py  sweep()                  ensembles.py   many noisy paths at once
attraction.py  diagrams and basins      attractors.py  which orbit a trajectory goes to
"""

from .. import on_first_use

_HOME = dict.fromkeys(
    ("Amplitude", "Cost", "Counts", "Extremes", "Function", "Itinerary", "Lyapunov", "Period", "Points", "Statistics",
     "Sticks"), "measures",
) | {
    "Basins": "attraction",
    "Ensemble": "ensembles",
    "Measure": "contract",
    "OrbitDiagram": "attraction",
    "SweepPlan": "refining",
    "Window": "contract",
    "Work": "work",
    "basins": "attraction",
    "ensemble": "ensembles",
    "make_plan": "refining",
    "orbit_diagram": "attraction",
    "read_store": "stored",
    "refine": "refining",
    "refine_basins": "attraction",
    "sweep": "sweeping",
}  # fmt: skip

__all__ = [*_HOME]

__getattr__, __dir__ = on_first_use(__name__, _HOME)
