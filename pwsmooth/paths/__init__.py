"""How a Model is run: event-driven, smoothed, by stiff steps; what a call may spend."""
