"""A particle filter that knows no pixels: dynamics, weights, resampling, estimate."""

from __future__ import annotations

from pftrack_sim.trackers.filters.dynamics import ConstantVelocity, Dynamics, RandomWalk
from pftrack_sim.trackers.filters.particles import ParticleFilter
from pftrack_sim.trackers.filters.resampling import effective_sample_size, systematic

__all__ = ["ConstantVelocity", "Dynamics", "ParticleFilter", "RandomWalk", "effective_sample_size", "systematic"]
