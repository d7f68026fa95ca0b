"""Taylor programs: recurrences, jets, responses of linear rates."""
