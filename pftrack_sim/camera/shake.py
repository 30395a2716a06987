"""Vibration of the camera on its mount: Gaussian motion in six axes, of a band or of gusts.

Spectral synthesis (Shinozuka and Deodatis 1991, "Simulation of stochastic processes by spectral representation",
Applied Mechanics Reviews 44): a sum of cosines with random phases has the wanted spectrum, tends to a Gaussian with
the number of cosines, and is closed form in time, so it can be asked at any instant and in any order.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.random_streams import stream
from pftrack_sim.scenario.axes import JitterAxis
from pftrack_sim.scenario.model import Jitter

Numbers = NDArray[np.float64]

COSINES = 64
"""Cosines per axis: kurtosis within 0.03 of a Gaussian's, and no repetition within an episode."""

GUST_CORNERS = 12.0
"""Gusts end at this many times their corner frequency; 95% of an endless spectrum's power is below."""


class Vibration:
    """One realisation of a vibration: a sum of cosines in each of six axes.

    Args:
        omega: `(6, C)` angular frequencies [rad/s].
        phase: `(6, C)` phases at time 0 [rad].
        amplitude: `(6, C)`; three rotations [rad] and three translations [m].
    """

    def __init__(self, omega: Numbers, phase: Numbers, amplitude: Numbers) -> None:
        self._omega, self._phase, self._amplitude = omega, phase, amplitude

    @classmethod
    def flat(cls, jitter: Jitter, rng: np.random.Generator) -> Vibration:
        """A spectrum that is flat over a band.

        One cosine in each of `COSINES` equal parts of it, at a random place in its part, all of the same amplitude.
        Each of the six axes has its own frequencies and phases and the RMS given.

        Args:
            jitter: RMS per axis, and the band.
            rng: Draws frequencies and phases; the draws do not depend on the RMS.
        """
        low, high = jitter.band_hz
        part = (np.arange(COSINES) + rng.random((6, COSINES))) / COSINES
        rms = np.repeat([math.radians(jitter.angular_rms_deg), 1e-3 * jitter.translational_rms_mm], 3)
        phase = rng.uniform(0.0, 2.0 * np.pi, (6, COSINES))
        amplitude = np.repeat(rms[:, None] * math.sqrt(2.0 / COSINES), COSINES, axis=1)
        return cls(2.0 * np.pi * (low + (high - low) * part), phase, amplitude)

    @classmethod
    def gusts(cls, rms_deg: float, corner_hz: float, mast_m: float, rng: np.random.Generator) -> Vibration:
        """Wind that sways a mast about its foot.

        The spectrum of each angle falls as 1 / (1 + (f / corner)^2), the first-order form of Dryden's gusts
        (MIL-F-8785C), up to `GUST_CORNERS` corners. One cosine in each of `COSINES` parts of equal power.

        Args:
            rms_deg: RMS of each of pitch, yaw and roll.
            corner_hz: Where the spectrum bends.
            mast_m: Height of the camera above the mast's foot: pitch and roll carry it back and forth, and sideways.
            rng: Draws frequencies and phases.
        """
        part = (np.arange(COSINES) + rng.random((3, COSINES))) / COSINES
        omega = 2.0 * np.pi * corner_hz * np.tan(part * math.atan(GUST_CORNERS))
        phase = rng.uniform(0.0, 2.0 * np.pi, (3, COSINES))
        size = np.full((3, COSINES), math.radians(rms_deg) * math.sqrt(2.0 / COSINES))
        # About a foot at p = (0, mast, 0), a small rotation r moves the camera by p x r = (mast r_z, 0, -mast r_x).
        carried = np.stack([mast_m * size[2], np.zeros(COSINES), -mast_m * size[0]])
        return cls(
            np.concatenate([omega, omega[[2, 1, 0]]]),
            np.concatenate([phase, phase[[2, 1, 0]]]),
            np.concatenate([size, carried]),
        )

    def plus(self, other: Vibration) -> Vibration:
        """Both at once: rotation vectors and translations add up."""
        return Vibration(
            np.concatenate([self._omega, other._omega], axis=1),
            np.concatenate([self._phase, other._phase], axis=1),
            np.concatenate([self._amplitude, other._amplitude], axis=1),
        )

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


def combined(base: Jitter, axis: JitterAxis, seed: int, mast_m: float) -> Vibration:
    """A scenario's own vibration plus wind and ground of its stress axis.

    The road is not among them: it moves the robot itself.

    Args:
        base: Of the scenario.
        axis: `severity` times its RMS is added; at severity 0 the result is the base alone, to the bit.
        seed: Root seed of the episode. Each source has a stream of its own, so raising the severity makes the same
            shaking larger, and leaving out one source changes nothing else.
        mast_m: Height of the camera above the mast's foot.
    """
    vibration = Vibration.flat(base, stream(seed, "jitter", "base"))
    if not axis.on:
        return vibration
    if "ground" in axis.sources:
        ground = Jitter(
            angular_rms_deg=axis.severity * axis.ground_rms_deg,
            translational_rms_mm=axis.severity * axis.ground_rms_mm,
            band_hz=axis.ground_band_hz,
        )
        vibration = vibration.plus(Vibration.flat(ground, stream(seed, "jitter", "ground")))
    if "wind" in axis.sources:
        rng = stream(seed, "jitter", "wind")
        gusts = Vibration.gusts(axis.severity * axis.wind_rms_deg, axis.wind_corner_hz, mast_m, rng)
        vibration = vibration.plus(gusts)
    return vibration
