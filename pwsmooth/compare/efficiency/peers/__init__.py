"""Solvers of others, one file each, given what their users would give them; none is needed by the package itself.

The extra `bench` installs them. What is not installed is said so in the points of a comparison, never left out.
"""
