"""What a run gives: the Solution, its records and outputs."""
