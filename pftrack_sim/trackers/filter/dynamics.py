"""How a state moves from one frame to the next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Dynamics(Protocol):
    """Draws the next state of every particle."""

    def draw(self, states: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """`(N, D)` next states, given `(N, D)` states."""
        ...


@dataclass(frozen=True)
class RandomWalk:
    """First-order autoregressive with coefficient 1: the previous state plus Gaussian noise (Ko et al. 2012, eq. 11).

    Attributes:
        sigma: `(D,)` standard deviation of each component's noise, in the component's unit.
    """

    sigma: tuple[float, ...]

    def draw(self, states: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """`(N, D)` next states, given `(N, D)` states."""
        return states + rng.standard_normal(states.shape) * np.asarray(self.sigma)
