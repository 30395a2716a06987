"""Changes of pace and pauses of the distractors, each from a random stream of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pftrack_sim.core.types import FloatArray

_PAUSES = 1.0 / 3.0  # Share of the changes that are pauses
# Shorter than the time after which a pedestrian counts as stuck.
_PAUSE_S = (0.8, 3.0)
_PACE = (0.55, 1.35)


class PaceChanges:
    """Factors on the speeds of pedestrians, which change at random times.

    Args:
        rngs: One generator per pedestrian.
        per_minute: Mean number of changes; 0 leaves every factor at 1.

    Attributes:
        factors: `(N,)` factors on the walking speeds; 0 in a pause.
    """

    def __init__(self, rngs: Sequence[np.random.Generator], per_minute: float) -> None:
        self._rngs, self._mean_s = rngs, 60.0 / per_minute if per_minute > 0.0 else np.inf
        self.factors: FloatArray = np.ones(len(rngs))
        self._until_s = [self._walk_s(rng) for rng in rngs]

    def update(self, time_s: float) -> None:
        """Advance to a time."""
        for person, rng in enumerate(self._rngs):
            if time_s < self._until_s[person]:
                continue
            if self.factors[person] > 0.0 and rng.random() < _PAUSES:
                self.factors[person] = 0.0
                self._until_s[person] = time_s + rng.uniform(*_PAUSE_S)
            else:
                self.factors[person] = rng.uniform(*_PACE)
                self._until_s[person] = time_s + self._walk_s(rng)

    def _walk_s(self, rng: np.random.Generator) -> float:
        return float(rng.exponential(self._mean_s)) if np.isfinite(self._mean_s) else np.inf
