"""Image-based visual servoing: follow a person by the box around them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.errors import ParameterError
from pftrack_sim.proprio import PROPRIO_INDEX
from pftrack_sim.records import Estimate

GAZE_S = 0.25
"""Time constant of the head: a tenth of a second of vision and motors, with a phase margin of 65 degrees."""

TURN_S = 0.8
"""Time constant of the base under the head: three times the head's, so that the two loops stay apart."""

DISTANCE_S = 1.2
"""Time constant of the distance: an error of 1 m asks for 0.8 m/s, which the base reaches within 0.7 s."""

SPEED_S = 1.0
"""Smoothing of the target's speed: a stride changes the box's height twice a second, and must not show."""

COAST_S = 0.6
"""Without the target, all motion dies away with this time constant."""

REVERSE_SHARE = 0.4
"""Fastest way backwards, as a share of the fastest forward."""

_EDGE_PX = 1.5


class Servo:
    """Keeps the box centred with pan and tilt, turns the base after the head, drives to the wanted distance.

    Every axis is a first-order servo, error over time constant (Chaumette and Hutchinson 2006, "Visual servo control,
    part I", IEEE Robotics and Automation Magazine; the box's centre and height are the features):

        pan rate  = bearing of the box's centre off the optical axis / GAZE_S - turn rate felt by the gyro
        tilt rate = elevation of the box's centre off the optical axis / GAZE_S
        turn rate = pan angle / TURN_S
        forward   = cos(pan) (target's speed away from the robot + (distance - wanted distance) / DISTANCE_S)

    The distance follows from the box's height and an assumed body height. A box cut by the top or bottom of the image
    is shorter than the person: it may show that the person is nearer than before, never that they are farther. When
    the tracker is unsure, reports an occlusion, or gives an empty box, the last command fades out.

    Args:
        distance_m: Wanted distance.
        person_m: Assumed body height.
        fovy_deg: Vertical field of view of the camera, unless `reset` is told.
        rate_hz: Frames per second.
        max_speed_m_s: The robot's fastest forward speed: a command of 1 means this.
        max_turn_deg_s: The robot's fastest turn rate.
        max_pan_deg_s: The head's fastest pan rate.
        max_tilt_deg_s: The head's fastest tilt rate.
        least_confidence: Below this the tracker counts as unsure.

    Raises:
        ParameterError: A number that is not positive and finite, or a confidence outside [0, 1].
    """

    def __init__(
        self,
        *,
        distance_m: float = 3.0,
        person_m: float = 1.72,
        fovy_deg: float = 50.0,
        rate_hz: float = 30.0,
        max_speed_m_s: float = 1.6,
        max_turn_deg_s: float = 90.0,
        max_pan_deg_s: float = 120.0,
        max_tilt_deg_s: float = 60.0,
        least_confidence: float = 0.2,
    ) -> None:
        limits = {
            "max_speed_m_s": max_speed_m_s,
            "max_turn_deg_s": max_turn_deg_s,
            "max_pan_deg_s": max_pan_deg_s,
            "max_tilt_deg_s": max_tilt_deg_s,
        }
        positive = {"distance_m": distance_m, "person_m": person_m, "rate_hz": rate_hz, **limits}
        for key, value in positive.items():
            if not (_is_number(value) and value > 0.0):
                raise ParameterError(f"servo: {key} must be a positive number, got {value!r}")
        if not (_is_number(fovy_deg) and 0.0 < fovy_deg < 180.0):
            raise ParameterError(f"servo: fovy_deg must be between 0 and 180, got {fovy_deg!r}")
        if not (_is_number(least_confidence) and 0.0 <= least_confidence <= 1.0):
            raise ParameterError(f"servo: least_confidence must be in [0, 1], got {least_confidence!r}")
        self._wanted_m = float(distance_m)
        self._person_m = float(person_m)
        self._fovy_rad = math.radians(fovy_deg)
        self._frame_s = 1.0 / float(rate_hz)
        speed, *rates = (float(value) for value in limits.values())
        self._limits = np.array([speed, *(math.radians(rate) for rate in rates)])
        self._least_confidence = float(least_confidence)
        self.reset((640, 480))

    def reset(self, image_size: tuple[int, int], fovy_rad: float | None = None) -> None:
        """Forget the last target; see `Controller.reset`."""
        width_px, height_px = image_size
        self._centre_px = (0.5 * width_px, 0.5 * height_px)
        self._focal_px = 0.5 * height_px / math.tan(0.5 * (self._fovy_rad if fovy_rad is None else fovy_rad))
        self._command = np.zeros(4)
        self._distance_m: float | None = None
        self._away_m_s = 0.0

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> NDArray[np.float64]:
        """The command that centres the box and keeps the distance; see `Controller.act`."""
        x, y, w, h = (float(value) for value in estimate.box)
        if estimate.occluded or estimate.confidence < self._least_confidence or w <= 0.0 or h <= 0.0:
            self._distance_m = None
            self._command = self._command * math.exp(-self._frame_s / COAST_S)
            return self._command.copy()
        bearing = -math.atan2(x + 0.5 * w - self._centre_px[0], self._focal_px)
        elevation = -math.atan2(y + 0.5 * h - self._centre_px[1], self._focal_px)
        pan = float(proprio[PROPRIO_INDEX["pan_rad"]])
        spin = float(proprio[PROPRIO_INDEX["gyro_z_rad_s"]])
        rolling = 0.5 * float(proprio[PROPRIO_INDEX["wheel_left_m_s"]] + proprio[PROPRIO_INDEX["wheel_right_m_s"]])
        distance = self._distance(y, h, rolling * math.cos(pan + bearing))
        forward = max(0.0, math.cos(pan)) * (self._away_m_s + (distance - self._wanted_m) / DISTANCE_S)
        forward = max(forward, -REVERSE_SHARE * float(self._limits[0]))
        wanted = np.array([forward, pan / TURN_S, bearing / GAZE_S - spin, elevation / GAZE_S])
        self._command = np.clip(wanted / self._limits, -1.0, 1.0)
        return self._command.copy()

    def _distance(self, y_px: float, h_px: float, approach_m_s: float) -> float:
        """Distance to the person [m]; also learns how fast they walk away.

        Args:
            y_px: Top of the box.
            h_px: Height of the box.
            approach_m_s: The robot's own speed towards the person.
        """
        distance = self._focal_px * self._person_m / h_px
        last, image_height_px = self._distance_m, 2.0 * self._centre_px[1]
        cut = y_px < _EDGE_PX or y_px + h_px > image_height_px - _EDGE_PX
        if last is not None and cut:
            distance = min(distance, last)
        elif last is not None:
            gain = 1.0 - math.exp(-self._frame_s / SPEED_S)
            self._away_m_s += gain * ((distance - last) / self._frame_s + approach_m_s - self._away_m_s)
        self._distance_m = distance
        return distance


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
