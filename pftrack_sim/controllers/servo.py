"""Image-based visual servoing: follow a person by the box around them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.controllers.base import RobotParameters, is_lost, is_positive
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.proprioception import PROPRIO_INDEX
from pftrack_sim.core.records import Estimate

GAZE_S = 0.25
"""Time constant of the head: a tenth of a second of vision and motors, with a phase margin of 65 degrees."""

TURN_S = 0.8
"""Time constant of the base under the head: three times the head's, so that the two loops stay apart."""

DISTANCE_S = 1.2
"""Time constant of the distance: an error of 1 m asks for 0.8 m/s, which the base reaches within 0.7 s."""

SPEED_S = 1.0
"""Smoothing of the target's speed: a stride changes the box's height twice a second, and must not show."""

FASTEST_WALK_M_S = 2.5
"""Nobody who is followed walks faster: the learnt speed never winds up beyond it."""

COAST_S = 0.6
"""Without the target, all motion dies away with this time constant."""

REVERSE_SHARE = 0.4
"""Fastest way backwards, as a share of the fastest forward."""

ACCELERATION = np.array([1.2, 4.0, 12.0, 8.0])
"""Steepest change asked for: forward [m/s^2], turn, pan, tilt [rad/s^2]. A gentle start carries the mast upright: more
than this the base would not give anyway, and asking for it only piles up what must be taken back."""
ACCELERATION.setflags(write=False)

_EDGE_PX = 1.5


class Servo:
    """Keeps the box centred with pan and tilt, turns the base after the head, drives to the wanted distance.

    Every axis is a first-order servo, error over time constant (Chaumette and Hutchinson 2006, "Visual servo control,
    part I", IEEE Robotics and Automation Magazine; the box's centre and height are the features):

        pan rate  = bearing of the box's centre off the optical axis / GAZE_S - turn rate felt by the gyro
        tilt rate = elevation of the box's centre off the optical axis / GAZE_S
        turn rate = pan angle / TURN_S
        forward   = cos(pan) (target's speed away from the robot + (distance - wanted distance) / DISTANCE_S)

    The gains follow from the robot. An error e with de/dt = -e / T through a delay d has the phase margin
    pi/2 - d / T: the head's 0.1 s of delay and T = 0.25 s leave 67 degrees. The base turns under the head, which takes
    its turn out again, so T = 0.8 s keeps it a factor of three slower. A walker at the speed u would leave a
    first-order servo behind by u T; the learnt speed of the target is fed forward instead, and is the one thing here
    that is integrated: it is bounded, and held still while the box cannot be trusted, so that nothing winds up.

    The distance follows from the box's height and an assumed body height. A box cut by the top or bottom of the image
    is shorter than the person: it may show that the person is nearer than before, never that they are farther. When
    the tracker is unsure, reports an occlusion, or gives an empty box, the last command fades out.

    Args:
        distance_m: Wanted distance; None takes that of the task.
        person_m: Assumed body height.
        least_confidence: Below this the tracker counts as unsure.

    Raises:
        ParameterError: A number that is not positive and finite, or a confidence outside [0, 1].
    """

    def __init__(
        self, *, distance_m: float | None = None, person_m: float = 1.72, least_confidence: float = 0.2
    ) -> None:
        for key, value in {"distance_m": distance_m, "person_m": person_m}.items():
            if not (is_positive(value) or (key == "distance_m" and value is None)):
                raise ParameterError(f"servo: {key} must be a positive number, got {value!r}")
        if least_confidence != 0.0 and not (is_positive(least_confidence) and least_confidence <= 1.0):
            raise ParameterError(f"servo: least_confidence must be in [0, 1], got {least_confidence!r}")
        self._asked_m = distance_m
        self._person_m = float(person_m)
        self.least_confidence = float(least_confidence)
        """Below this the tracker counts as unsure."""
        self.reset(RobotParameters())

    def reset(self, rig: RobotParameters) -> None:
        """Forget the last target; see `Controller.reset`."""
        self._rig = rig
        self._wanted_m = rig.distance_m if self._asked_m is None else self._asked_m
        self._limits = rig.limits
        self._step = ACCELERATION * rig.frame_s / self._limits
        self._command = np.zeros(4)
        self.distance_m: float | None = None
        """To the target as the last box has it; None while it is lost."""
        self._away_m_s = 0.0

    def act(self, estimate: Estimate, proprio: NDArray[Any]) -> NDArray[np.float64]:
        """The command that centres the box and keeps the distance; see `Controller.act`."""
        if is_lost(estimate, self.least_confidence):
            self.distance_m = None
            self._command = self._command * math.exp(-self._rig.frame_s / COAST_S)
            return self._command.copy()
        _, y, _, h = estimate.box.tolist()
        bearing, elevation = direction(estimate, self._rig)
        pan = float(proprio[PROPRIO_INDEX["pan_rad"]])
        spin = float(proprio[PROPRIO_INDEX["gyro_z_rad_s"]])
        rolling = 0.5 * float(proprio[PROPRIO_INDEX["wheel_left_m_s"]] + proprio[PROPRIO_INDEX["wheel_right_m_s"]])
        distance = self._learn(y, h, rolling * math.cos(pan + bearing))
        forward = max(0.0, math.cos(pan)) * (self._away_m_s + (distance - self._wanted_m) / DISTANCE_S)
        forward = max(forward, -REVERSE_SHARE * float(self._limits[0]))
        wanted = np.clip(
            np.array([forward, pan / TURN_S, bearing / GAZE_S - spin, elevation / GAZE_S]) / self._limits, -1.0, 1.0
        )
        self._command = self._command + np.clip(wanted - self._command, -self._step, self._step)
        return self._command.copy()

    def _learn(self, y_px: float, h_px: float, approach_m_s: float) -> float:
        """Distance to the person [m]; also learns how fast they walk away.

        Args:
            y_px: Top of the box.
            h_px: Height of the box.
            approach_m_s: The robot's own speed towards the person.
        """
        distance = self._rig.focal_px * self._person_m / h_px
        last, frame_s = self.distance_m, self._rig.frame_s
        cut = y_px < _EDGE_PX or y_px + h_px > self._rig.image_size[1] - _EDGE_PX
        if last is not None and cut:
            distance = min(distance, last)
        elif last is not None:
            gain = 1.0 - math.exp(-frame_s / SPEED_S)
            self._away_m_s += gain * ((distance - last) / frame_s + approach_m_s - self._away_m_s)
            self._away_m_s = min(max(self._away_m_s, -FASTEST_WALK_M_S), FASTEST_WALK_M_S)
        self.distance_m = distance
        return distance


def direction(estimate: Estimate, rig: RobotParameters) -> tuple[float, float]:
    """Bearing (to the left) and elevation (upwards) of a box's centre off the optical axis [rad]."""
    x, y, w, h = estimate.box.tolist()
    width_px, height_px = rig.image_size
    bearing = -math.atan2(x + 0.5 * w - 0.5 * width_px, rig.focal_px)
    return bearing, -math.atan2(y + 0.5 * h - 0.5 * height_px, rig.focal_px)
