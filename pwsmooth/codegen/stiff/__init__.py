"""Code of the stiff steps: fields, Jacobians, Taylor series, attempts by Radau."""
