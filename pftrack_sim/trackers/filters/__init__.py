"""Particle filters without any knowledge of images: dynamics, weights, resampling, estimate."""
