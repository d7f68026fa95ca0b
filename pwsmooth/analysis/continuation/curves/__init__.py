"""Curves of bifurcations of orbits in two parameters: their starts, one step, the way along them."""
