"""Steps between instants: series, the pair, roots, what is met."""
