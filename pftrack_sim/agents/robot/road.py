"""The road under the wheels: roughness by ISO 8608, felt through wheels and suspension.

The ground that is drawn stays flat, and so does the one that the wheels stand on. A bump of height z under a wheel
would stretch or press its spring as much as it lifts the wheel, so its spring and damper push as if it were there:
-(k z + c dz/dt) on the joint of each suspension. That leaves out only the inertia of the wheels themselves.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.random_streams import stream
from pftrack_sim.scenario.axes.sensing import JitterAxis
from pftrack_sim.scene.robot import (
    CASTER_ARM_M,
    CASTER_DAMPING_NS_M,
    CASTER_SPRING_N_M,
    WHEEL_DAMPING_NS_M,
    WHEEL_RADIUS_M,
    WHEEL_SPRING_N_M,
)

ROUGHNESS_M3 = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}
"""G_d(n_0): displacement power spectral density at `REFERENCE_CYCLES_M`, geometric mean of each class (ISO 8608)."""

REFERENCE_CYCLES_M = 0.1
"""n_0, a spatial frequency."""

LOOP_M = 64.0
"""The road repeats itself after this distance."""

SHORTEST_M, LONGEST_M = 0.05, 2.0
"""Wavelengths: longer ones are hills, which do not shake; shorter ones disappear under a wheel."""

_SAMPLE_M = 0.005


def profile(road_class: str, rng: np.random.Generator) -> NDArray[np.float64]:
    """Heights along one track, with the spectrum G_d(n) = G_d(n_0) (n / n_0)^-2 of ISO 8608.

    Args:
        road_class: `"A"` to `"E"`.
        rng: Draws the phases.

    Returns:
        `(N,)` heights [m] every 5 mm along a loop of `LOOP_M`.
    """
    count = round(LOOP_M / _SAMPLE_M)
    cycles_m = np.arange(count // 2 + 1) / LOOP_M
    inside = (cycles_m >= 1.0 / LONGEST_M) & (cycles_m <= 1.0 / SHORTEST_M)
    density = np.zeros(cycles_m.size)
    density[inside] = ROUGHNESS_M3[road_class] * (cycles_m[inside] / REFERENCE_CYCLES_M) ** -2.0
    # A cosine of amplitude a holds the power a^2 / 2 of one line of the spectrum.
    amplitude = np.sqrt(2.0 * density / LOOP_M)
    phase = rng.uniform(0.0, 2.0 * np.pi, cycles_m.size)
    return np.fft.irfft(0.5 * count * amplitude * np.exp(1j * phase), count)


class RoadExcitation:
    """Pushes the suspension of a compiled robot as a rough road would.

    Args:
        model: Has the robot.
        axis: Class of the road, and how much of it there is.
        seed: Root seed of the episode.
    """

    def __init__(self, model: mujoco.MjModel, axis: JitterAxis, seed: int) -> None:
        tracks = [profile(axis.road_class, stream(seed, "jitter", "road", side)) for side in ("left", "right")]
        # Casters run between the wheels' tracks.
        self._heights = axis.roughness * np.stack([*tracks, 0.5 * (tracks[0] + tracks[1])])
        self._slopes = (np.roll(self._heights, -1, axis=1) - self._heights) / _SAMPLE_M
        axles = [model.joint(f"robot/axle-{side}") for side in ("left", "right")]
        self._angles = np.array([joint.qposadr[0] for joint in axles])
        self._speeds = np.array([joint.dofadr[0] for joint in axles])
        mounts = [model.joint(f"robot/suspension-{end}").dofadr[0] for end in ("left", "right", "front", "rear")]
        self._mounts = np.array(mounts)
        self._spring = np.repeat([WHEEL_SPRING_N_M, CASTER_SPRING_N_M], 2)
        self._damper = np.repeat([WHEEL_DAMPING_NS_M, CASTER_DAMPING_NS_M], 2)
        self._track = np.array([0, 1, 2, 2])
        self._ahead_m = np.array([0.0, 0.0, CASTER_ARM_M, -CASTER_ARM_M])

    def write(self, data: mujoco.MjData) -> None:
        """Set the forces for the coming physics step."""
        height, rate = self.bumps(data)
        data.qfrc_applied[self._mounts] = -(self._spring * height + self._damper * rate)

    def bumps(self, data: mujoco.MjData) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Road under the left wheel, the right wheel, the front caster and the rear caster.

        Returns:
            `(4,)` heights [m] and `(4,)` rates at which they change [m/s].
        """
        left, right = (WHEEL_RADIUS_M * data.qpos[self._angles]).tolist()
        left_m_s, right_m_s = (WHEEL_RADIUS_M * data.qvel[self._speeds]).tolist()
        middle, middle_m_s = 0.5 * (left + right), 0.5 * (left_m_s + right_m_s)
        at = np.array([left, right, middle, middle]) + self._ahead_m
        place = np.mod(at, LOOP_M) / _SAMPLE_M
        index = place.astype(np.intp) % self._heights.shape[1]
        slope = self._slopes[self._track, index]
        height = self._heights[self._track, index] + slope * (place - np.floor(place)) * _SAMPLE_M
        return height, slope * np.array([left_m_s, right_m_s, middle_m_s, middle_m_s])
