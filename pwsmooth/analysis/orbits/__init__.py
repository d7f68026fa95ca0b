"""Periodic orbits: found by shooting, told apart by itinerary, with their multipliers."""

from ... import on_first_use

_HOME = {
    "Change": "itineraries",
    "PeriodicOrbit": "periodic_orbit",
    "change_between": "itineraries",
    "find_orbit": "finding",
    "refine": "finding",
    "same_itinerary": "itineraries",
}

__all__ = [*_HOME]

__getattr__, __dir__ = on_first_use(__name__, _HOME)
