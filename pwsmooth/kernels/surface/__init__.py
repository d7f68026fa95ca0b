"""Motion on surfaces: solved multipliers and the layer."""
