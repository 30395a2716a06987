"""Vibration of the camera on its mount: band-limited Gaussian motion in six axes.

Spectral synthesis (Shinozuka and Deodatis 1991, "Simulation of stochastic processes by spectral representation",
Applied Mechanics Reviews 44): a sum of cosines with random phases has the wanted spectrum, tends to a Gaussian with
the number of cosines, and is closed form in time, so it can be asked at any instant and in any order.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.scenario.axes import JitterAxis
from pftrack_sim.scenario.model import Jitter
from pftrack_sim.streams import stream

Numbers = NDArray[np.float64]

COSINES = 64
"""Cosines per axis: kurtosis within 0.03 of a Gaussian's, and no repetition within an episode."""


class Vibration:
    """One realisation of a vibration.

    The spectrum is flat over the band: one cosine in each of `COSINES` equal parts of it, at a random place in its
    part, all of the same amplitude. Each of the six axes has its own frequencies and phases and the RMS given.

    Args:
        jitter: RMS per axis, and the band.
        rng: Draws frequencies and phases; the draws do not depend on the RMS.
    """

    def __init__(self, jitter: Jitter, rng: np.random.Generator) -> None:
        low, high = jitter.band_hz
        part = (np.arange(COSINES) + rng.random((6, COSINES))) / COSINES
        rms = np.repeat([math.radians(jitter.angular_rms_deg), 1e-3 * jitter.translational_rms_mm], 3)
        self._omega = 2.0 * np.pi * (low + (high - low) * part)
        self._phase = rng.uniform(0.0, 2.0 * np.pi, (6, COSINES))
        self._amplitude = np.repeat(rms[:, None] * math.sqrt(2.0 / COSINES), COSINES, axis=1)

    def plus(self, other: Vibration) -> Vibration:
        """Both at once: rotation vectors and translations add up."""
        both = object.__new__(Vibration)
        both._omega = np.concatenate([self._omega, other._omega], axis=1)
        both._phase = np.concatenate([self._phase, other._phase], axis=1)
        both._amplitude = np.concatenate([self._amplitude, other._amplitude], axis=1)
        return both

    @property
    def still(self) -> bool:
        """Whether nothing moves."""
        return not self._amplitude.any()

    def offset(self, time_s: ArrayLike) -> tuple[Numbers, Numbers]:
        """Where the camera is, seen from where it would be without vibration.

        Args:
            time_s: Instants, any shape.

        Returns:
            `(..., 3)` rotation vectors [rad] (about x: nodding, y: panning, z: rolling) and `(..., 3)` translations
            [m], camera frame as OpenCV.
        """
        time = np.asarray(time_s, dtype=np.float64)[..., None, None]
        axes = (self._amplitude * np.cos(self._omega * time + self._phase)).sum(axis=-1)
        return axes[..., :3], axes[..., 3:]

    def displace(self, T_world_camera: NDArray[np.float64], time_s: float) -> Numbers:
        """`(4, 4)` pose of the shaken camera; without vibration the pose itself, to the bit.

        Args:
            T_world_camera: `(4, 4)` pose without vibration.
            time_s: Since the start of the episode.
        """
        if self.still:
            return np.array(T_world_camera, dtype=np.float64)
        rotation, translation = self.offset(time_s)
        shake = np.eye(4)
        shake[:3, :3] = cv2.Rodrigues(rotation)[0]
        shake[:3, 3] = translation
        return T_world_camera @ shake


def combined(base: Jitter, axis: JitterAxis, seed: int) -> Vibration:
    """A scenario's own vibration plus its stress axis.

    Args:
        base: Of the scenario.
        axis: `severity` times its RMS is added; at severity 0 the result is the base alone, to the bit.
        seed: Root seed of the episode. The two have streams of their own (`jitter/base`, `jitter/axis`), so raising
            the severity makes the same shaking larger and changes nothing else.
    """
    vibration = Vibration(base, stream(seed, "jitter", "base"))
    if axis.severity == 0.0:
        return vibration
    added = Jitter(
        angular_rms_deg=axis.severity * axis.angular_rms_deg,
        translational_rms_mm=axis.severity * axis.translational_rms_mm,
        band_hz=axis.band_hz,
    )
    return vibration.plus(Vibration(added, stream(seed, "jitter", "axis")))
