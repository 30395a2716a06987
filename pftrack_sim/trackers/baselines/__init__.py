"""Baselines: references, template matching, mean shift."""
