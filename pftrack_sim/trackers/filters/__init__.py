"""Particle filters without any knowledge of images: dynamics, weights, resampling, estimate."""

from __future__ import annotations

from pftrack_sim.trackers.filters.adaptive import AdaptiveNoise, adaptive_velocity, fit_slopes
from pftrack_sim.trackers.filters.dynamics import ConstantVelocity, Dynamics, RandomWalk
from pftrack_sim.trackers.filters.particles import ParticleFilter, systematic_resampling

__all__ = [
    "AdaptiveNoise",
    "ConstantVelocity",
    "Dynamics",
    "ParticleFilter",
    "RandomWalk",
    "adaptive_velocity",
    "fit_slopes",
    "systematic_resampling",
]
