"""Road roughness (ISO 8608) and sills as excitation of the robot's suspension.

The ground stays flat for collisions and rendering. A bump of height z under a wheel would compress its spring as much
as it lifts the wheel, so the equivalent force of spring and damper, -(k z + c dz/dt), is applied to the joint of each
suspension. Only the inertia of the wheels themselves is neglected.
"""

from __future__ import annotations

import mujoco
import numpy as np

from pftrack_sim.core.random_streams import stream
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.axes import JitterAxis
from pftrack_sim.scenario.robot import Sills
from pftrack_sim.scene.robot_file.motorised import SUSPENSIONS

ROUGHNESS_M3 = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}
"""G_d(n_0): displacement power spectral density at `REFERENCE_CYCLES_M`, geometric mean of each class (ISO 8608)."""

REFERENCE_CYCLES_M = 0.1  # Spatial frequency n_0 [cycles/m]
LOOP_M = 64.0  # Period of the road
SHORTEST_M, LONGEST_M = 0.05, 2.0
"""Wavelengths of the profile: longer ones do not shake the robot, shorter ones average out under a wheel."""

_SAMPLE_M = 0.005
SILL_WIDTH_M = 0.08


def road_profile(road_class: str, rng: np.random.Generator) -> FloatArray:
    """`(N,)` heights [m] every 5 mm over `LOOP_M` along one track.

    The displacement spectrum is G_d(n) = G_d(n_0) (n / n_0)^-2 (ISO 8608), with random phases.
    """
    count = round(LOOP_M / _SAMPLE_M)
    cycles_m = np.arange(count // 2 + 1) / LOOP_M
    inside = (cycles_m >= 1.0 / LONGEST_M) & (cycles_m <= 1.0 / SHORTEST_M)
    density = np.zeros(cycles_m.size)
    density[inside] = ROUGHNESS_M3[road_class] * (cycles_m[inside] / REFERENCE_CYCLES_M) ** -2.0
    # A cosine of amplitude a has the power a^2 / 2 of one spectral line.
    amplitude = np.sqrt(2.0 * density / LOOP_M)
    phase = rng.uniform(0.0, 2.0 * np.pi, cycles_m.size)
    return np.fft.irfft(0.5 * count * amplitude * np.exp(1j * phase), count)


def sill_profile(sills: Sills, radius: float, rng: np.random.Generator) -> FloatArray:
    """`(N,)` heights [m] every 5 mm over `LOOP_M`: how the centre of a wheel of a radius [m] rises over sills.

    The wheel rolls up the edge of a sill, over its flat top, and down its other edge.
    """
    height = 1e-3 * sills.height_mm
    way = np.arange(round(LOOP_M / _SAMPLE_M)) * _SAMPLE_M
    heights = np.zeros(way.size)
    at_m = sills.every_m * rng.uniform(0.5, 1.0)
    while at_m < LOOP_M - 1.0:  # None where the road begins again: there stands the robot at the start
        beyond = np.maximum(np.abs(way - at_m) - 0.5 * SILL_WIDTH_M, 0.0)
        rise = np.sqrt(np.maximum(radius**2 - beyond**2, 0.0)) - (radius - height)
        heights = np.maximum(heights, rise)
        at_m += sills.every_m * rng.uniform(0.7, 1.3)
    return heights


class RoadExcitation:
    """Applies the forces of a rough road and of sills to the suspension."""

    def __init__(self, model: mujoco.MjModel, axis: JitterAxis, sills: Sills, seed: int) -> None:
        tracks = [road_profile(axis.road_class, stream(seed, "jitter", "road", side)) for side in ("left", "right")]
        # Casters run between the wheels' tracks. Both wheels meet a sill at once, however the robot has turned.
        rough = axis.roughness * np.stack([*tracks, 0.5 * (tracks[0] + tracks[1])])
        self._track, self._heights = np.array([0, 1, 2, 2]), rough
        self._radius_m = float(model.geom("robot/tyre-left").size[0])
        if sills.height_mm > 0.0:
            self._track = np.array([0, 1, 2, 2, 3, 3, 3, 3])
            sill = sill_profile(sills, self._radius_m, stream(seed, "sills"))
            self._heights = np.concatenate([rough, sill[None]])
        self._slopes = (np.roll(self._heights, -1, axis=1) - self._heights) / _SAMPLE_M
        axles = [model.joint(f"robot/axle-{side}") for side in ("left", "right")]
        self._axle_qpos = np.array([joint.qposadr[0] for joint in axles])
        self._axle_dofs = np.array([joint.dofadr[0] for joint in axles])
        joints = [model.joint(f"robot/suspension-{end}") for end in SUSPENSIONS]
        self._suspension_dofs = np.array([joint.dofadr[0] for joint in joints])
        self._spring, self._damper = (np.array([getattr(joint, key)[0] for joint in joints])
                                      for key in ("stiffness", "damping"))  # fmt: skip
        ahead = model.body_pos[model.jnt_bodyid[[joint.id for joint in joints]], 0]
        self._ahead_m = np.tile(ahead, len(self._track) // 4)

    def write(self, data: mujoco.MjData) -> None:
        """Set the forces for the coming physics step."""
        height, rate = self.bumps(data)
        data.qfrc_applied[self._suspension_dofs] = -(self._spring * height + self._damper * rate)

    def bumps(self, data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
        """`(4,)` road heights [m] under left and right wheel, front and rear caster, and `(4,)` their rates [m/s]."""
        left, right = (self._radius_m * data.qpos[self._axle_qpos]).tolist()
        left_m_s, right_m_s = (self._radius_m * data.qvel[self._axle_dofs]).tolist()
        middle, middle_m_s = 0.5 * (left + right), 0.5 * (left_m_s + right_m_s)
        count = len(self._track)
        distance = np.array([left, right, *[middle] * (count - 2)]) + self._ahead_m
        sample = np.mod(distance, LOOP_M) / _SAMPLE_M
        index = sample.astype(np.intp) % self._heights.shape[1]
        slope = self._slopes[self._track, index]
        height = self._heights[self._track, index] + slope * (sample - np.floor(sample)) * _SAMPLE_M
        rate = slope * np.array([left_m_s, right_m_s, *[middle_m_s] * (count - 2)])
        if count > 4:
            return height[:4] + height[4:], rate[:4] + rate[4:]
        return height, rate
