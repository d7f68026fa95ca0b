"""Deviations along a run: the tape that the loop has written is played again, with the linearised flow on every step
and the saltation of every instant."""
