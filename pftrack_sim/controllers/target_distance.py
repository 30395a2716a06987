"""Distance to the target from its box, the ground plane and the range finder, fused by an extended Kalman filter."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pftrack_sim.controllers.base import RobotParameters
from pftrack_sim.core.proprioception import beam_angles_rad
from pftrack_sim.core.types import FloatArray

HEIGHT_SIGMA = 0.08  # Standard deviation of the logarithm of a box's height: gait and the tracker's error

FEET_SIGMA_M, FEET_SIGMA_RAD = 0.12, 0.02
"""Error of the foot point: half a stride, and the angle of the box's lower edge with the swing of the mast."""

RANGE_SIGMA_M = 0.12  # Error of the range to a body whose legs swing
LEG_M = 0.12  # From the front of the nearest leg to the middle of the body: half a shin when standing, more in a stride

LEG_GATE_M = (0.6, 1.5)
"""Beams that end farther from the estimated distance did not meet the target's legs: twice its standard deviation,
within these limits."""

LENS_M = 0.06  # From the axle, where the beams start, forward to the optical centre
HALF_BODY_M = 0.3  # Half the width in which legs are searched in the scan
CORRELATION_S = 0.4  # Correlation time of all errors: they come from the gait, so successive frames are not independent

SCALE_PRIOR, SCALE_S = 0.07, 20.0
"""Deviation of the logarithm of body heights, and the time in which a learnt error of the box's scale is forgotten."""

SCALE_DRIFT = 0.08  # Random walk of the box's scale, per square root of a second: trackers' boxes drift
ACCELERATION = 0.7  # Random walk of the target's speed, (m/s) per square root of a second
MAX_SPEED_M_S = 2.5  # Bound of the target's speed
GATE = 3.0  # Measurements farther than this many standard deviations from the prediction are not used
RECOVERY_S = 0.7  # After the box has been refused for this time, the filter starts anew from it
EDGE_PX = 1.5  # A box nearer than this to an edge of the image is cut by it
_FIT_SCALE = 0.1  # A box whose scale is off by more does not end at the feet
_LEAST_SLOPE = 0.02  # Beyond some 60 m neither feet nor height tell a distance
_MIN_DISTANCE_M = 0.2
_MIN_SPREAD_RAD = math.radians(2.5)


class View(NamedTuple):
    """A box in the camera's view.

    Attributes:
        box: x, y, w, h [px].
        pan_rad: Pan of the camera's axis in the frame of the chassis.
        tilt_rad: Tilt of the camera's axis; positive is up.
        ranges_m: `(37,)` ranges of the range finder.
    """

    box: tuple[float, float, float, float]
    pan_rad: float
    tilt_rad: float
    ranges_m: FloatArray


class TargetDistance:
    """Estimates the distance on the ground from the camera to the target, and the target's speed away from it.

    State: distance d [m], speed u of the target along the line of sight [m/s], and s, the logarithm of the box's height
    over that of an average person. With the robot's speed v towards the target, d' = d + (u - v) dt; u and s are random
    walks. An extended Kalman filter with scalar updates (Bar-Shalom, Li and Kirubarajan 2001, "Estimation with
    applications to tracking and navigation", sections 5.2 and 10.3), each behind a gate on its innovation:

    * height: the box spans tan(top) - tan(bottom) = H exp(s) / d in the elevations of its edges. Not used where the
      image cuts the box;
    * feet: the lower edge meets the ground at d = camera height / tan(-bottom). Not used where the image cuts it;
    * range: beams in the width of a body that end near the predicted distance. Whoever steps between is nearer than
      the gate allows.

    A box that keeps its size while the target walks off contradicts the range; s takes up the contradiction, and the
    foot point is trusted less the more s differs from that of a person.

    Args:
        person_m: Height of an average person.
    """

    def __init__(self, person_m: float) -> None:
        self._person_m = person_m
        self.reset(RobotParameters())

    def reset(self, robot: RobotParameters) -> None:
        """Forget everything, on this robot."""
        self._robot = robot
        self._state: FloatArray | None = None
        self._covariance = np.zeros((3, 3))
        self._refused_s = 0.0
        self.legs_m = math.inf
        """Distance to the target by the last scan alone; infinite where no beam met its legs."""

    @property
    def distance_m(self) -> float | None:
        """Distance [m]; None before the first box."""
        return None if self._state is None else float(self._state[0])

    @property
    def speed_m_s(self) -> float:
        """Speed of the target away from the robot [m/s]; 0 before the first box."""
        return 0.0 if self._state is None else float(self._state[1])

    def predict(self, approach_m_s: float) -> None:
        """Advance by a frame; `approach_m_s` is the robot's speed towards the target."""
        if self._state is None:
            return
        frame_s = self._robot.frame_s
        distance, speed, scale = self._state.tolist()
        keep = math.exp(-frame_s / SCALE_S)
        self._state = np.array([max(distance + (speed - approach_m_s) * frame_s, _MIN_DISTANCE_M), speed, scale * keep])
        step = np.array([[1.0, frame_s, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, keep]])
        noise = frame_s * np.array([0.0, ACCELERATION**2, SCALE_DRIFT**2])
        self._covariance = step @ self._covariance @ step.T + np.diag(noise)

    def update(self, view: View) -> None:
        """Correct the prediction by a box and a scan."""
        if self._state is None or self._refused_s > RECOVERY_S:
            self._start(view)
        assert self._state is not None
        passed = [self._correct(*cue) for cue in self._box_cues(view, self._state)]
        self._refused_s = self._refused_s + self._robot.frame_s if passed and not any(passed) else 0.0
        if self._cut_above(view) or self._cut_below(view):
            # The body is at least as high as what the image shows of it.
            farthest = self._farthest_m(view) * math.exp(float(self._state[2]) + GATE * HEIGHT_SIGMA)
            self._state[0] = min(float(self._state[0]), farthest)
        self._update_range(view)
        self._state[1] = min(max(float(self._state[1]), -MAX_SPEED_M_S), MAX_SPEED_M_S)

    def _update_range(self, view: View) -> None:
        """Correct by the beams in the width of a body."""
        assert self._state is not None
        distance = float(self._state[0])
        low, high = LEG_GATE_M
        gate = min(max(2.0 * math.sqrt(self._covariance[0, 0]), low), high)
        ends = self._beam_ends_m(view, distance)
        ends = ends[ends < distance + gate]
        fills_image = self._cut_above(view) and self._cut_below(view)
        if not fills_image:
            ends = ends[ends > distance - gate]
        # No one has room between the camera and a target that fills the image: the nearest beam ends at the target.
        order = ends if fills_image else np.abs(ends + LEG_M - distance)
        self.legs_m = float(ends[np.argmin(order)]) + LEG_M if ends.size else math.inf
        passed = not ends.size or self._correct(self.legs_m, np.array([1.0, 0.0, 0.0]), RANGE_SIGMA_M)
        if fills_image and not passed:
            self._state[:2] = self.legs_m, 0.0

    def body_elevation_rad(self) -> float:
        """Elevation of the middle of the body above the horizon, as the camera sees it."""
        assert self._state is not None
        return math.atan2(0.5 * self._person_m - self._robot.camera_height_m, float(self._state[0]))

    def _start(self, view: View) -> None:
        """Start from the box alone."""
        feet = self._feet_m(view)
        distance = feet if feet is not None and self._cut_above(view) else self._farthest_m(view)
        distance = max(distance, _MIN_DISTANCE_M)
        speed = 0.0 if self._state is None else float(self._state[1])
        self._state = np.array([distance, speed, 0.0])
        # A box that is cut may be much nearer.
        share = 0.4 if self._cut_below(view) else 0.15
        self._covariance = np.diag([(share * distance) ** 2, 1.0, SCALE_PRIOR**2])
        self._refused_s = 0.0

    def _box_cues(self, view: View, state: FloatArray) -> Iterator[tuple[float, FloatArray, float]]:
        """Measured values, rows of the measurement matrix and standard deviations of height and feet."""
        if not (self._cut_above(view) or self._cut_below(view)):
            distance = float(state[0])
            # log d - s, linearised at the prediction.
            value = math.log(self._farthest_m(view) / distance) + 1.0
            yield value, np.array([1.0 / distance, 0.0, -1.0]), HEIGHT_SIGMA
        feet = self._feet_m(view)
        if feet is None:
            return
        height = self._robot.camera_height_m
        misfit = 0.5 * self._person_m * max(abs(float(state[2])) - _FIT_SCALE, 0.0) * feet / height
        angle = FEET_SIGMA_RAD * (feet * feet + height * height) / height
        yield feet, np.array([1.0, 0.0, 0.0]), math.hypot(FEET_SIGMA_M, angle, misfit)

    def _correct(self, value: float, row: FloatArray, sigma: float) -> bool:
        """Update by a measurement, its `(3,)` row and its standard deviation; returns whether it passed the gate."""
        assert self._state is not None
        innovation, variance = value - float(row @ self._state), float(row @ self._covariance @ row)
        if abs(innovation) > GATE * math.sqrt(variance + sigma * sigma):
            return False
        # Errors last for a correlation time: a frame carries only its share of what one independent measurement would.
        noise = sigma * sigma * max(1.0, CORRELATION_S * self._robot.rate_hz)
        gain = self._covariance @ row / (variance + noise)
        self._state = self._state + gain * innovation
        self._covariance = self._covariance - np.outer(gain, row @ self._covariance)
        return True

    def _tangent(self, v_px: float, view: View) -> float:
        """Tangent of the elevation of an image row above the horizon, in the vertical plane of the optical axis."""
        below = math.atan2(v_px - 0.5 * self._robot.image_size[1], self._robot.focal_px)
        return math.tan(min(max(view.tilt_rad - below, -1.5), 1.5))

    def _farthest_m(self, view: View) -> float:
        """Distance at which an average person is as high as the box; a body that the image cuts is nearer."""
        _, y, _, height = view.box
        # A tracker guesses what lies beyond the image.
        top, bottom = max(y, 0.0), min(y + height, float(self._robot.image_size[1]))
        return self._person_m / max(self._tangent(top, view) - self._tangent(bottom, view), _LEAST_SLOPE)

    def _cut_above(self, view: View) -> bool:
        return view.box[1] < EDGE_PX

    def _cut_below(self, view: View) -> bool:
        return view.box[1] + view.box[3] > self._robot.image_size[1] - EDGE_PX

    def _feet_m(self, view: View) -> float | None:
        """Distance of the foot point on the ground; None where the image cuts it off or it is above the horizon."""
        x, y, width, height = view.box
        robot = self._robot
        down = -self._tangent(y + height, view)
        if self._cut_below(view) or down < _LEAST_SLOPE:
            return None
        # Off the image's middle the foot point is farther than in the plane of the optical axis.
        aside = (x + 0.5 * width - 0.5 * robot.image_size[0]) / robot.focal_px
        below = (y + height - 0.5 * robot.image_size[1]) / robot.focal_px
        forward = math.cos(view.tilt_rad) + below * math.sin(view.tilt_rad)
        return robot.camera_height_m / down * math.hypot(1.0, aside / max(forward, 0.1))

    def _beam_ends_m(self, view: View, predicted_m: float) -> FloatArray:
        """Distances from the camera to what the beams in the width of a body hit."""
        x, _, width, _ = view.box
        bearing = view.pan_rad - math.atan2(x + 0.5 * width - 0.5 * self._robot.image_size[0], self._robot.focal_px)
        spread = max(math.atan2(HALF_BODY_M, predicted_m), _MIN_SPREAD_RAD)
        angles = beam_angles_rad(self._robot.beam_field_deg, len(view.ranges_m))
        off = np.abs(np.remainder(angles - bearing + math.pi, 2.0 * math.pi) - math.pi)
        return view.ranges_m[(off < spread) & (view.ranges_m < self._robot.range_m)] - LENS_M
