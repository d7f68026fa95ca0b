"""Comparisons: what is exact (verify), what accuracy costs, where methods break, which model a scene needs."""
