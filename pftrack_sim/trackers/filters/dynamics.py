"""Dynamics: how a state moves from one frame to the next."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pftrack_sim.core.types import FloatArray


class Dynamics(Protocol):
    """Draws the next state of every particle."""

    def draw(self, states: FloatArray, rng: np.random.Generator) -> FloatArray:
        """`(N, D)` next states, given `(N, D)` states."""
        ...


@dataclass(frozen=True)
class RandomWalk:
    """First-order autoregression with coefficient 1: previous state plus Gaussian noise (Ko et al. 2012, eq. 11).

    Attributes:
        sigma: `(D,)` standard deviation of each component's noise, in the component's unit.
        last_two_correlation: Correlation of the noises of the last two components, in [0, 1]: 0 as printed.
    """

    sigma: tuple[float, ...]
    last_two_correlation: float = 0.0

    def draw(self, states: FloatArray, rng: np.random.Generator) -> FloatArray:
        """`(N, D)` next states, given `(N, D)` states."""
        noise = rng.standard_normal(states.shape)
        if self.last_two_correlation:
            independent = math.sqrt(1.0 - self.last_two_correlation**2)
            noise[:, -1] = self.last_two_correlation * noise[:, -2] + independent * noise[:, -1]
        return states + noise * np.asarray(self.sigma)


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
