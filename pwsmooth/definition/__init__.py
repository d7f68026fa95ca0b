"""From what the user writes to a Model: notation, lifting, classes of switches, views, lowering."""
