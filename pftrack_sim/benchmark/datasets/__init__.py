"""Data sets of other tools: written from simulations, evaluated, and scored."""
