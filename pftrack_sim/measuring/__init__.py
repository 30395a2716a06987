"""Levels of the stress axes in recorded material, each with its interval."""
