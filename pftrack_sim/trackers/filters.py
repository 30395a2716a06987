"""Particle filters without any knowledge of images: dynamics, weights, resampling, and adaptive velocity.

The velocity (Zhou, Chellappa & Moghaddam 2004; Kwon et al. 2005, eq. 6 to 8) is independent of what is observed: an
observation is a vector that changes smoothly with the state.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import FloatArray

Observations: TypeAlias = NDArray[np.floating[Any]]  # Observations may have half the precision of states


@dataclass(frozen=True)
class RandomWalk:
    """First-order autoregression with coefficient 1: previous state plus Gaussian noise (Ko et al. 2012, eq. 11).

    Attributes:
        sigma: `(D,)` standard deviation of each component's noise, in the component's unit.
        last_two_correlation: Correlation of the noises of the last two components, in [0, 1]: 0 as printed.
        normals: Gives the next `(N, D)` standard normal noise for N; None for independent draws.
    """

    sigma: tuple[float, ...]
    last_two_correlation: float = 0.0
    normals: Callable[[int], FloatArray] | None = None

    def draw(self, states: FloatArray, rng: np.random.Generator) -> FloatArray:
        """`(N, D)` next states, given `(N, D)` states."""
        noise = rng.standard_normal(states.shape) if self.normals is None else self.normals(len(states))
        if self.last_two_correlation == 1.0:
            noise[:, -1] = noise[:, -2]
        elif self.last_two_correlation:
            independent = math.sqrt(1.0 - self.last_two_correlation**2)
            noise[:, -1] = self.last_two_correlation * noise[:, -2] + independent * noise[:, -1]
        moved = noise * np.asarray(self.sigma)
        moved += states
        return moved


@dataclass(frozen=True)
class ConstantVelocity:
    """Position moves by the velocity; size and velocity have uniform noise (Lee et al. 2012, eq. 9).

    States are `(N, 6)`: x, y, w, h, vx, vy. As printed, a velocity's noise moves the position one frame later.

    Attributes:
        reach: Half the range of the noise of w, h, vx, vy, in the component's unit.
        keep_shape: Whether width and height share one draw; they have one each as printed.
    """

    reach: tuple[float, float, float, float]
    keep_shape: bool = False

    def draw(self, states: FloatArray, rng: np.random.Generator) -> FloatArray:
        """`(N, 6)` next states, given `(N, 6)` states."""
        moved = states.copy()
        moved[:, :2] += states[:, 4:]
        noise = rng.uniform(-1.0, 1.0, (len(states), 4))
        if self.keep_shape:
            noise[:, 1] = noise[:, 0]
        moved[:, 2:] += noise * np.asarray(self.reach)
        return moved


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
        if not math.isfinite(peak):
            return np.full(self.log_weights.size, 1.0 / self.log_weights.size)
        raw = np.exp(self.log_weights - peak)
        raw /= raw.sum()
        return raw

    @property
    def effective_share(self) -> float:
        """Effective sample size 1 / sum(w^2) over the number of particles, in (0, 1]; 1 where weights tell nothing."""
        return 1.0 / float(np.sum(np.square(self.weights)) * self.log_weights.size)

    def predict(self, dynamics: RandomWalk | ConstantVelocity) -> None:
        """Move every particle by the dynamics."""
        self.states = dynamics.draw(self.states, self._rng)

    def weigh(self, log_likelihood: FloatArray) -> None:
        """Multiply the weights by a likelihood, given its `(N,)` logarithms; -inf for impossible states."""
        self.log_weights = self.log_weights + log_likelihood

    def mean(self, top: int | None = None) -> FloatArray:
        """`(D,)` weighted mean of the `top` particles of greatest weight, or of all (Ko et al. 2012, eq. 12)."""
        weights = self.weights
        states = self.states
        if top is not None and top < weights.size:
            # Stable, so that ties are broken alike on every machine.
            heaviest = (-weights).argsort(kind="stable")[:top]
            weights, states = weights[heaviest], states[heaviest]
        # Relative to one particle, so that identical particles have exactly that mean.
        origin = states[0]
        return origin + (weights / weights.sum()) @ (states - origin)

    def resample(self, *, multinomial: bool = False) -> None:
        """Systematic resampling, or independent draws by weight; all weights are equal afterwards."""
        weights = self.weights
        if multinomial:
            chosen = self._rng.choice(weights.size, weights.size, p=weights)
        else:
            chosen = systematic_resampling(weights, self._rng)
        self.states = self.states[chosen]
        self.log_weights = np.zeros(chosen.size)

    def restart(self, state: FloatArray, count: int | None = None) -> None:
        """Put `count` particles (as many as now if None) at one `(D,)` state, with equal weights."""
        self.states = np.empty((len(self.states) if count is None else count, state.size))
        self.states[:] = state
        self.log_weights = np.zeros(len(self.states))

    def truncate(self, count: int) -> None:
        """Drop all particles but the first `count` >= 1."""
        self.states, self.log_weights = self.states[:count], self.log_weights[:count]


def systematic_resampling(weights: FloatArray, rng: np.random.Generator) -> NDArray[np.intp]:
    """`(N,)` ascending indices, by equal steps along the cumulative `(N,)` weights from one uniform random number.

    Particle i is drawn `N * weights[i]` times on average, rounded up or down. Source: Carpenter, Clifford & Fearnhead
    1999; Arulampalam et al. 2002, algorithm 2.
    """
    edges = np.cumsum(weights)
    total = float(edges[-1])
    points = (rng.random() + np.arange(weights.size)) * (total / weights.size)
    # Rounding may put the last point on the upper end, beyond the last particle.
    return np.searchsorted(edges, np.minimum(points, np.nextafter(total, 0.0)), side="right")


def fit_slopes(state_shifts: FloatArray, observation_shifts: Observations) -> Observations:
    """`(D, d)` change of the observation per unit of each state component: linear least squares over the particles.

    Zhou et al. 2004 fit the state on the observation, which has more unknowns than there are particles; in this
    direction there are only D unknowns per component of the observation. 0 for components in which the particles or
    their observations do not differ.

    Args:
        state_shifts: `(N, D)` particles of one frame minus their mean.
        observation_shifts: `(N, d)` their observations minus that of the mean.
    """
    # Scaled by the spread: components have different units, and a small one could be taken for rounding errors.
    spread = np.sqrt(np.mean(np.square(state_shifts), axis=0))
    unit = np.where(spread > 0.0, spread, 1.0)
    shifts = state_shifts / unit
    dtype = observation_shifts.dtype
    inverse = np.linalg.pinv(shifts.T @ shifts, rcond=_TOLERANCE, hermitian=True).astype(dtype)
    effect = inverse @ (shifts.T.astype(dtype) @ observation_shifts)
    # Rounding errors become exactly 0: `adaptive_velocity` would divide by them.
    size = np.linalg.norm(effect, axis=1)
    effect[(size <= _TOLERANCE * size.max()) | (spread == 0.0)] = 0.0
    return effect / unit[:, None].astype(dtype)


def adaptive_velocity(slopes: Observations, innovation: Observations) -> FloatArray:
    """`(D,)` shift of the state that explains a change of the observation by least squares (8).

    0 in components that the observation does not depend on. `slopes` are those of `fit_slopes`, the `(d,)` innovation
    is the observation at the previous state minus the model's.
    """
    normal, right = (slopes @ slopes.T).astype(np.float64), (slopes @ innovation).astype(np.float64)
    diagonal = np.sqrt(np.diagonal(normal))
    unit = np.where(diagonal > 0.0, diagonal, 1.0)
    return -(np.linalg.pinv(normal / np.outer(unit, unit), rcond=_TOLERANCE, hermitian=True) @ (right / unit)) / unit


_TOLERANCE = 1e-6
"""Directions weaker than this share of the strongest are rounding errors (observations may be float32)."""
