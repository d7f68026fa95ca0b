"""Expressions as a graph, and the text of scalar code."""
