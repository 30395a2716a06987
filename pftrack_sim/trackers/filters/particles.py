"""Bootstrap particle filter: predict, weigh, estimate, resample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray
from pftrack_sim.trackers.filters.dynamics import Dynamics


class ParticleFilter:
    """A bootstrap filter: the dynamics are the proposal (Arulampalam et al. 2002, algorithm 4).

    Weights are stored as logarithms and normalised on demand, so that small likelihoods do not underflow.

    Args:
        states: `(N, D)` initial particles, of equal weight.
        rng: Source of all random numbers.
    """

    def __init__(self, states: FloatArray, rng: np.random.Generator) -> None:
        self.states = np.array(states, dtype=np.float64)
        self.log_weights = np.zeros(len(self.states))
        self._rng = rng

    @property
    def weights(self) -> FloatArray:
        """`(N,)` weights, summing to 1; all equal when every likelihood is 0."""
        peak = self.log_weights.max()
        if not np.isfinite(peak):
            return np.full(self.log_weights.size, 1.0 / self.log_weights.size)
        raw = np.exp(self.log_weights - peak)
        return raw / raw.sum()

    def predict(self, dynamics: Dynamics) -> None:
        """Move every particle by the dynamics."""
        self.states = dynamics.draw(self.states, self._rng)

    def weigh(self, log_likelihood: FloatArray) -> None:
        """Multiply the weights by a likelihood, given its `(N,)` logarithms; -inf for impossible states."""
        self.log_weights = self.log_weights + log_likelihood

    def mean(self, top: int | None = None) -> FloatArray:
        """`(D,)` weighted mean of the `top` particles of greatest weight, or of all (Ko et al. 2012, eq. 12)."""
        weights = self.weights
        if top is not None and top < weights.size:
            # Stable, so that ties are broken alike on every machine.
            heaviest = np.argsort(-weights, kind="stable")[:top]
        else:
            heaviest = np.arange(weights.size)
        share = weights[heaviest] / weights[heaviest].sum()
        # Relative to one particle, so that identical particles have exactly that mean.
        origin = self.states[heaviest[0]]
        return origin + share @ (self.states[heaviest] - origin)

    def resample(self) -> None:
        """Systematic resampling; all weights are equal afterwards."""
        chosen = systematic_resampling(self.weights, self._rng)
        self.states = self.states[chosen]
        self.log_weights = np.zeros(chosen.size)

    def restart(self, state: FloatArray, count: int | None = None) -> None:
        """Put `count` particles (as many as now if None) at one `(D,)` state, with equal weights."""
        self.states = np.repeat(state[None], len(self.states) if count is None else count, axis=0)
        self.log_weights = np.zeros(len(self.states))

    def truncate(self, count: int) -> None:
        """Drop all particles but the first `count` >= 1."""
        self.states, self.log_weights = self.states[:count], self.log_weights[:count]


def systematic_resampling(weights: FloatArray, rng: np.random.Generator, count: int | None = None) -> NDArray[np.intp]:
    """`(count,)` ascending indices, by equal steps along the cumulative `(N,)` weights from one uniform random number.

    Particle i is drawn `count * weights[i]` times on average, rounded up or down; `count` is N if None. Source:
    Carpenter, Clifford & Fearnhead 1999; Arulampalam et al. 2002, algorithm 2.
    """
    draws = weights.size if count is None else count
    edges = np.cumsum(weights)
    total = float(edges[-1])
    points = (rng.random() + np.arange(draws)) * (total / draws)
    # Rounding may put the last point on the upper end, beyond the last particle.
    return np.searchsorted(edges, np.minimum(points, np.nextafter(total, 0.0)), side="right")
