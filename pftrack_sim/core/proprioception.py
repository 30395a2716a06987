"""Layout and bounds of the proprioception vector."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

RANGE_M = 5.0  # Maximum range of the range finder
BEAM_HEIGHT_M = 0.2  # Height of its beams above the ground with the robot at rest: shins of people are in it

RANGE_ANGLES_RAD: NDArray[np.float64] = np.deg2rad(np.linspace(-90.0, 90.0, 37))
"""`(37,)` direction of each beam of the range finder: from the right over straight ahead (0) to the left."""
RANGE_ANGLES_RAD.setflags(write=False)

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
    *((f"range_{index:02d}_m", RANGE_M) for index in range(RANGE_ANGLES_RAD.size)),
)

PROPRIO_NAMES: tuple[str, ...] = tuple(name for name, _ in _LAYOUT)
"""Names of the entries, in order.

* odometry: pose by wheel odometry, in the frame of the start (x forward, y left, heading in [-pi, pi]
  counter-clockwise); it drifts through wheel slip and calibration errors.
* wheel: surface speed of the tyre; the mean of the two is the forward speed.
* gyro, accelerometer: at the chassis, x forward, y left, z up; at rest the accelerometer reads +9.81 along z.
* pan, tilt: of the camera's optical axis in the frame of the chassis: pan is counter-clockwise from straight ahead,
  so a camera mounted to the left rests at +pi/2; tilt is positive upwards. The mast may swing: that is not included.
* range: of each beam of the range finder (`RANGE_ANGLES_RAD`), from the middle of the axle, at the height of the hull;
  `RANGE_M` when nothing is hit within it.
"""

PROPRIO_INDEX: Mapping[str, int] = MappingProxyType({name: index for index, name in enumerate(PROPRIO_NAMES)})
"""Index of each entry."""

RANGES = slice(len(PROPRIO_NAMES) - RANGE_ANGLES_RAD.size, len(PROPRIO_NAMES))  # Slice of the range finder's entries

PROPRIO_HIGH: NDArray[np.float32] = np.array([high for _, high in _LAYOUT], dtype=np.float32)
"""`(n,)` upper bound of each entry; -PROPRIO_HIGH is the lower bound. Ranges of common sensors."""
PROPRIO_HIGH.setflags(write=False)
