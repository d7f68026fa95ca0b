"""Branches of equilibria, their bifurcations, and curves of these in two parameters."""
