"""Layout and bounds of the proprioception vector."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import read_only

RANGE_M, FIELD_DEG, BEAMS = 5.0, 180.0, 37  # Maximum range, field and beams of the range finder by default
BEAM_HEIGHT_M = 0.2  # Height of its beams above the ground with the robot at rest: shins of people are in it


def beam_angles_rad(field_deg: float, beams: int) -> NDArray[np.float64]:
    """`(beams,)` direction of each beam of a range finder: from the right over straight ahead (0) to the left."""
    return np.deg2rad(np.linspace(-0.5 * field_deg, 0.5 * field_deg, beams))


RANGE_ANGLES_RAD: NDArray[np.float64] = read_only(beam_angles_rad(FIELD_DEG, BEAMS))
"""`(37,)` directions of the beams by default."""

_LAYOUT: tuple[tuple[str, float], ...] = (
    ("odometry_x_m", 1000.0),
    ("odometry_y_m", 1000.0),
    ("odometry_heading_rad", np.pi),
    ("wheel_left_m_s", 20.0),
    ("wheel_right_m_s", 20.0),
    ("gyro_x_rad_s", 35.0),
    ("gyro_y_rad_s", 35.0),
    ("gyro_z_rad_s", 35.0),
    ("accelerometer_x_m_s2", 160.0),
    ("accelerometer_y_m_s2", 160.0),
    ("accelerometer_z_m_s2", 160.0),
    ("pan_rad", 2.0 * np.pi),
    ("tilt_rad", np.pi),
)
"""Name and upper bound of each entry but the ranges; bounds are those of common sensors."""

PROPRIO_NAMES: tuple[str, ...] = (*(name for name, _ in _LAYOUT), *(f"range_{index:02d}_m" for index in range(BEAMS)))
"""Names of the entries, in order.

* odometry: pose by wheel odometry, in the frame of the start (x forward, y left, heading in [-pi, pi]
  counter-clockwise); it drifts through wheel slip and calibration errors.
* wheel: surface speed of the tyre; the mean of the two is the forward speed.
* gyro, accelerometer: at the chassis, x forward, y left, z up; at rest the accelerometer reads +9.81 along z.
* pan, tilt: of the camera's optical axis in the frame of the chassis: pan is counter-clockwise from straight ahead,
  so a camera mounted to the left rests at +pi/2; tilt is positive upwards. The mast may swing: that is not included.
* range: of each beam of the range finder (`RANGE_ANGLES_RAD`), from the middle of the axle, at the height of the hull;
  `RANGE_M` when nothing is hit within it. Beams, field and range are those of `robot.range_finder`.
"""

PROPRIO_INDEX: Mapping[str, int] = MappingProxyType({name: index for index, name in enumerate(PROPRIO_NAMES)})
"""Index of each entry."""

RANGES = slice(len(_LAYOUT), None)  # Slice of the range finder's entries


def proprio_high(beams: int, range_m: float) -> NDArray[np.float32]:
    """`(n,)` upper bound of each entry; its negative is the lower bound."""
    return np.array([*(high for _, high in _LAYOUT), *[range_m] * beams], dtype=np.float32)
