"""The particle filter itself: predict, weigh, estimate, resample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.trackers.filters.dynamics import Dynamics
from pftrack_sim.trackers.filters.resampling import effective_sample_size, systematic


class ParticleFilter:
    """A bootstrap filter: the dynamics propose, the likelihood weighs (Arulampalam et al. 2002, algorithm 4).

    Weights are kept as logarithms and are normalised only when asked for, so that no likelihood is too small.

    Args:
        states: `(N, D)` first particles, all of equal weight.
        rng: Everything random comes from here.
    """

    def __init__(self, states: NDArray[np.float64], rng: np.random.Generator) -> None:
        self.states = np.array(states, dtype=np.float64)
        self.log_weights = np.zeros(len(self.states))
        self._rng = rng

    @property
    def weights(self) -> NDArray[np.float64]:
        """`(N,)` weights, summing to 1; all equal when no particle has any likelihood left."""
        peak = self.log_weights.max()
        if not np.isfinite(peak):
            return np.full(self.log_weights.size, 1.0 / self.log_weights.size)
        raw = np.exp(self.log_weights - peak)
        return raw / raw.sum()

    @property
    def effective_sample_size(self) -> float:
        """How many equally weighted particles these are worth, in [1, N]."""
        return effective_sample_size(self.weights)

    def predict(self, dynamics: Dynamics) -> None:
        """Move every particle by the dynamics."""
        self.states = dynamics.draw(self.states, self._rng)

    def weigh(self, log_likelihood: NDArray[np.float64]) -> None:
        """Multiply the weights by a likelihood.

        Args:
            log_likelihood: `(N,)` logarithms; -inf for the impossible.
        """
        self.log_weights = self.log_weights + log_likelihood

    def mean(self, top: int | None = None) -> NDArray[np.float64]:
        """Weighted mean of the particles that weigh most (Ko et al. 2012, eq. 12).

        Args:
            top: How many; all if None, the single heaviest if 1.

        Returns:
            `(D,)` state.
        """
        weights = self.weights
        if top is not None and top < weights.size:
            # Stable, so that ties fall the same way on every machine.
            heaviest = np.argsort(-weights, kind="stable")[:top]
        else:
            heaviest = np.arange(weights.size)
        share = weights[heaviest] / weights[heaviest].sum()
        # About one of them, so that particles that agree to the bit have exactly that mean.
        one = self.states[heaviest[0]]
        return one + share @ (self.states[heaviest] - one)

    def resample(self, count: int | None = None) -> None:
        """Draw the particles anew by weight; all weigh the same afterwards.

        Args:
            count: How many there shall be; as many as now if None.
        """
        chosen = systematic(self.weights, self._rng, count)
        self.states = self.states[chosen]
        self.log_weights = np.zeros(chosen.size)

    def restart(self, state: NDArray[np.float64], count: int | None = None) -> None:
        """Put every particle at one `(D,)` state; all weigh the same afterwards.

        Args:
            state: Where.
            count: How many there shall be; as many as now if None.
        """
        self.states = np.repeat(state[None], len(self.states) if count is None else count, axis=0)
        self.log_weights = np.zeros(len(self.states))

    def keep(self, count: int) -> None:
        """Drop all particles but the first.

        Args:
            count: How many are kept, >= 1.
        """
        self.states, self.log_weights = self.states[:count], self.log_weights[:count]
