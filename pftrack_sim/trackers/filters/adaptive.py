"""A filter that opens when its prediction is poor (Zhou, Chellappa & Moghaddam 2004; Kwon et al. 2005, eq. 6 to 11).

Nothing here knows what is observed: an error is a number that is about 1 where the model predicts as well as it says,
and an observation is a vector that changes smoothly with the state. Any appearance model that can say both can use it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.errors import ParameterError

Numbers: TypeAlias = NDArray[np.floating[Any]]
"""Observations, which may be of half the precision of states: they are many."""


@dataclass(frozen=True)
class AdaptiveSpread:
    """How far and how densely to search, given how poor the prediction is.

    Attributes:
        noise: R_0, the factor on the dynamics' noise when the error is 1.
        noise_min: R_min.
        noise_max: R_max.
        count: J_0, the number of particles when the factor is R_0.
        count_max: J_max, never exceeded.
    """

    noise: float
    noise_min: float
    noise_max: float
    count: int
    count_max: int

    def __post_init__(self) -> None:
        if not 0.0 < self.noise_min <= self.noise <= self.noise_max:
            given = f"{self.noise_min:g}, {self.noise:g}, {self.noise_max:g}"
            raise ParameterError(f"the least, the usual and the greatest noise must be > 0 and rise, got {given}")
        if not 1 <= self.count <= self.count_max:
            given = f"{self.count}, {self.count_max}"
            raise ParameterError(f"the usual and the greatest number of particles must be >= 1 and rise, got {given}")

    def factor(self, error: float) -> float:
        """R_t = max(min(R_0 sqrt(error), R_max), R_min) (9).

        Args:
            error: Prediction error, >= 0.
        """
        return max(min(self.noise * float(np.sqrt(error)), self.noise_max), self.noise_min)

    def particles(self, factor: float) -> int:
        """J_t = J_0 R_t / R_0 (11), rounded, in [1, J_max].

        Args:
            factor: R_t.
        """
        return max(min(round(self.count * factor / self.noise), self.count_max), 1)


def slopes(state_shifts: NDArray[np.float64], observation_shifts: Numbers) -> Numbers:
    """How observations change with the state: the first-order linear fit over the particles of one frame.

    Zhou et al. 2004 fit the state on the observation, which has more unknowns than there are particles; fitted this
    way round there are only D unknowns to a number of the observation.

    Args:
        state_shifts: `(N, D)` particles less their mean.
        observation_shifts: `(N, d)` their observations less that of the mean.

    Returns:
        `(D, d)` change of the observation per unit of each state component; 0 where the particles do not differ, or
        where what they observe does not.
    """
    # Components have different units: without dividing by their spread, one could be mistaken for rounding.
    spread = np.sqrt(np.mean(np.square(state_shifts), axis=0))
    unit = np.where(spread > 0.0, spread, 1.0)
    shifts = state_shifts / unit
    kind = observation_shifts.dtype
    solved = np.linalg.pinv(shifts.T @ shifts, rcond=_ROUNDING, hermitian=True).astype(kind)
    effect = solved @ (shifts.T.astype(kind) @ observation_shifts)
    # Rounding's effect must be no effect: `shift` would divide by it.
    size = np.linalg.norm(effect, axis=1)
    effect[(size <= _ROUNDING * size.max()) | (spread == 0.0)] = 0.0
    return effect / unit[:, None].astype(kind)


def shift(slope: Numbers, surprise: Numbers, weights: Numbers | None = None) -> NDArray[np.float64]:
    """The state's shift that explains an observation by least squares: the adaptive velocity (8).

    Args:
        slope: `(D, d)` from `slopes`.
        surprise: `(d,)` what was observed at the old state, less what the model has there.
        weights: `(d,)` how much each number of the observation counts; all the same if None.

    Returns:
        `(D,)` shift: at the old state plus it, the first-order fit expects no surprise. A component that the
        observation does not depend on stays where it is.
    """
    weighed = slope if weights is None else slope * weights
    normal, right = (weighed @ slope.T).astype(np.float64), (weighed @ surprise).astype(np.float64)
    diagonal = np.sqrt(np.diagonal(normal))
    unit = np.where(diagonal > 0.0, diagonal, 1.0)
    return -(np.linalg.pinv(normal / np.outer(unit, unit), rcond=_ROUNDING, hermitian=True) @ (right / unit)) / unit


_ROUNDING = 1e-6
"""Directions weaker than this share of the strongest are what rounding left over (observations may be float32)."""
