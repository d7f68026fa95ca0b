"""Stiff steps: Radau, Taylor, the gate, events."""
