"""Adaptive noise, particle number and velocity (Zhou, Chellappa & Moghaddam 2004; Kwon et al. 2005, eq. 6 to 11).

Independent of what is observed: an error is a number that is about 1 where the model predicts as well as expected, and
an observation is a vector that changes smoothly with the state.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import FloatArray

Observations: TypeAlias = NDArray[np.floating[Any]]  # Observations may have half the precision of states


@dataclass(frozen=True)
class AdaptiveNoise:
    """Noise and number of particles as functions of the prediction error.

    Attributes:
        noise: R_0, the factor on the dynamics' noise when the error is 1.
        noise_min: R_min.
        noise_max: R_max.
        count: J_0, the number of particles when the factor is R_0.
        count_max: J_max.
    """

    noise: float
    noise_min: float
    noise_max: float
    count: int
    count_max: int

    def __post_init__(self) -> None:
        if not 0.0 < self.noise_min <= self.noise <= self.noise_max:
            given = f"{self.noise_min:g}, {self.noise:g}, {self.noise_max:g}"
            raise ParameterError(f"expected 0 < noise_min <= noise <= noise_max, got {given}")
        if not 1 <= self.count <= self.count_max:
            given = f"{self.count}, {self.count_max}"
            raise ParameterError(f"expected 1 <= particle_count <= particle_count_max, got {given}")

    def factor(self, error: float) -> float:
        """R_t = max(min(R_0 sqrt(error), R_max), R_min) (9) of a prediction error >= 0."""
        return max(min(self.noise * float(np.sqrt(error)), self.noise_max), self.noise_min)

    def particles(self, factor: float) -> int:
        """J_t = J_0 R_t / R_0 (11) of a factor R_t, rounded, in [1, J_max]."""
        return max(min(round(self.count * factor / self.noise), self.count_max), 1)


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
