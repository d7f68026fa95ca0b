"""Many orbits in one call."""
