"""Camera shake: Gaussian vibration of the mount in six axes, band-limited or by gusts of wind.

Spectral synthesis (Shinozuka and Deodatis 1991, "Simulation of stochastic processes by spectral representation",
Applied Mechanics Reviews 44): a sum of cosines with random phases has the wanted power spectral density, tends to a
Gaussian process with the number of cosines, and is closed form in time: instants may be evaluated in any order.
"""

from __future__ import annotations

import math
from copy import copy

import cv2
import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.axes import JitterAxis
from pftrack_sim.scenario.model import Jitter

_IDENTITY = np.eye(4)
_COSINES = 64  # Cosines per axis: kurtosis within 0.03 of a Gaussian's, and no repetition within an episode
_GUST_CUTOFF = 12.0  # Cutoff of gusts in corner frequencies; 95 % of the unlimited spectrum's power is below


class CameraShake:
    """One realisation of a vibration: a sum of cosines in each of six axes.

    Args:
        omega: `(6, C)` angular frequencies [rad/s].
        phase: `(6, C)` phases at time 0 [rad].
        amplitude: `(6, C)`: three rotations [rad] and three translations [m].
    """

    def __init__(self, omega: FloatArray, phase: FloatArray, amplitude: FloatArray) -> None:
        self._omega, self._phase, self._amplitude, self._still = omega, phase, amplitude, not amplitude.any()
        self._fixed: FloatArray | None = None

    @classmethod
    def band_limited(
        cls, angular_rms_deg: float, translational_rms_mm: float, band_hz: tuple[float, float], rng: np.random.Generator
    ) -> CameraShake:
        """A spectrum that is flat over a band: one cosine at a random place in each of 64 equal parts of it.

        The draws do not depend on the RMS of each of pitch, yaw and roll, and along each of x, y and z.
        """
        low, high = band_hz
        share = (np.arange(_COSINES) + rng.random((6, _COSINES))) / _COSINES
        rms = np.repeat([math.radians(angular_rms_deg), 1e-3 * translational_rms_mm], 3)
        phase = rng.uniform(0.0, 2.0 * np.pi, (6, _COSINES))
        amplitude = np.repeat(rms[:, None] * math.sqrt(2.0 / _COSINES), _COSINES, axis=1)
        return cls(2.0 * np.pi * (low + (high - low) * share), phase, amplitude)

    @classmethod
    def gusts(cls, rms_deg: float, corner_hz: float, mast_m: float, rng: np.random.Generator) -> CameraShake:
        """Wind that sways a mast about its foot: one cosine in each of 64 parts of equal power.

        The power spectral density of each angle is proportional to 1 / (1 + (f / corner)^2), the first-order form of
        the Dryden gust model (MIL-F-8785C), up to 12 corner frequencies. Pitch and roll displace the camera, `mast_m`
        above the foot.
        """
        share = (np.arange(_COSINES) + rng.random((3, _COSINES))) / _COSINES
        omega = 2.0 * np.pi * corner_hz * np.tan(share * math.atan(_GUST_CUTOFF))
        phase = rng.uniform(0.0, 2.0 * np.pi, (3, _COSINES))
        angle = np.full((3, _COSINES), math.radians(rms_deg) * math.sqrt(2.0 / _COSINES))
        # About a foot at p = (0, mast, 0), a small rotation r moves the camera by p x r = (mast r_z, 0, -mast r_x).
        displacement = np.stack([mast_m * angle[2], np.zeros(_COSINES), -mast_m * angle[0]])
        return cls(
            np.concatenate([omega, omega[[2, 1, 0]]]),
            np.concatenate([phase, phase[[2, 1, 0]]]),
            np.concatenate([angle, displacement]),
        )

    def __add__(self, other: CameraShake) -> CameraShake:
        """Superpose two vibrations: rotation vectors and translations add up."""
        return CameraShake(
            np.concatenate([self._omega, other._omega], axis=1),
            np.concatenate([self._phase, other._phase], axis=1),
            np.concatenate([self._amplitude, other._amplitude], axis=1),
        )

    def offset(self, time_s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Rotation vectors and translations relative to the camera without shake, at instants of any shape.

        Returns:
            `(..., 3)` rotation vectors [rad] (pitch about x, yaw about y, roll about z) and `(..., 3)` translations
            [m], camera axes as in OpenCV.
        """
        time = np.asarray(time_s, dtype=np.float64)[..., None, None]
        axes = (self._amplitude * np.cos(self._omega * time + self._phase)).sum(axis=-1)
        return axes[..., :3], axes[..., 3:]

    def seen_from(self, T_camera_other: FloatArray) -> CameraShake:
        """The same vibration as it moves another camera, `(4, 4)` fixed to the shaken one."""
        other = copy(self)
        other._fixed = T_camera_other
        return other

    def displace(self, T_world_camera: FloatArray, time_s: float) -> FloatArray:
        """`(4, 4)` pose of the shaken camera at a time, from that without shake; equal to the bit without shake.

        `T_world_camera` is that of the camera on the mount, also for another one that is `seen_from` it.
        """
        pose = np.array(T_world_camera, dtype=np.float64)
        if not self._still:
            rotation, translation = self.offset(time_s)
            T_camera_shaken = _IDENTITY.copy()
            T_camera_shaken[:3, :3], T_camera_shaken[:3, 3] = cv2.Rodrigues(rotation)[0], translation
            pose = pose @ T_camera_shaken
        return pose if self._fixed is None else pose @ self._fixed


def camera_shake(base: Jitter, axis: JitterAxis, seed: int, mast_m: float) -> CameraShake:
    """Vibration of a scenario's mount plus wind and ground of the jitter axis; its road moves the robot instead.

    Each source has a random stream of its own: a higher severity scales the same vibration, and omitting a source
    changes no other. `mast_m` is the height of the camera above the foot of the mast.
    """
    own = base.angular_rms_deg, base.translational_rms_mm, base.band_hz
    shake = CameraShake.band_limited(*own, stream(seed, "jitter", "base"))
    if axis.on and "ground" in axis.sources:
        ground = axis.severity * axis.ground_rms_deg, axis.severity * axis.ground_rms_mm, axis.ground_band_hz
        shake += CameraShake.band_limited(*ground, stream(seed, "jitter", "ground"))
    if axis.on and "wind" in axis.sources:
        rng = stream(seed, "jitter", "wind")
        shake += CameraShake.gusts(axis.severity * axis.wind_rms_deg, axis.wind_corner_hz, mast_m, rng)
    return shake
