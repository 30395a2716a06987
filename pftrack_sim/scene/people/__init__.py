"""People: bodies of natural proportions, clothes and faces."""
