"""The robot that carries the camera: its route, the person who drives it in open-loop episodes, sills, the drive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, TypeAlias, cast

from pydantic import Field, model_validator

from pftrack_sim.core.proprioception import BEAMS, FIELD_DEG, RANGE_M, beam_angles_rad
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario.section import Angle, Coordinate, Point, Positive, Section, number, setting

OWN_RADIUS_M = 0.25  # Of the robot that ships
_ROLES = ("camera_site", "camera_rpy_deg", "drive", "wheels", "wheelbase_m", "pan", "tilt", "pose_deg")
"""Keys about the file of a robot."""


class StillRoute(Section):
    """The robot stands still."""

    kind: Literal["still"]
    start_m: Point = setting((0.0, 0.0), "Position of the robot.")
    heading_deg: Angle = setting(0.0, "Heading; 0 is +x, counter-clockwise.")


class WaypointRoute(Section):
    """The robot drives through points, then stops."""

    kind: Literal["waypoints"]
    points_m: tuple[Point, ...] = setting(..., "Points to drive through.", min_length=2, max_length=1000)
    speed_m_s: Positive = setting(0.8, "Cruising speed.")


class TrailRoute(Section):
    """The robot drives along the target's own path, keeping a distance behind it."""

    kind: Literal["trail"]
    distance_m: Positive = setting(3.5, "Distance kept behind the target, along its path.")
    offset_m: Coordinate = setting(0.0, "Sideways offset from the target's path; positive is left.")


class BesideRoute(Section):
    """The robot drives beside the target, parallel to its path, so that the background sweeps past."""

    kind: Literal["beside"]
    distance_m: Positive = setting(3.0, "Sideways distance from the target's path.")
    side: Literal["left", "right"] = setting("right", "On which side of the target the robot drives.")
    lead_m: Coordinate = setting(0.0, "How far ahead of the target along its path; negative is behind.")


Route: TypeAlias = Annotated[StillRoute | WaypointRoute | TrailRoute | BesideRoute, Field(discriminator="kind")]


# A careful, an average and a hasty operator; None is the default.
_CHARACTERS: dict[str, tuple[float | None, float | None, float | None]] = {
    "reaction_s": (0.25, 0.3, 0.35),
    "dead_zone_deg": (4.0, 4.0, 4.0),
    "head_hz": (0.6, 0.7, 0.8),
    "head_damping": (0.8, 0.6, 0.45),
    "wander_deg": (7.0, 9.0, 12.0),
    "wander_s": (5.0, 3.8, 3.0),
    "glances_per_minute": (None, 3.0, 6.0),
    "glance_deg": (None, 20.0, 25.0),
    "glance_s": (None, 0.8, 0.8),
    "stops_per_minute": (1.0, 2.0, 3.0),
    "stop_s": (1.0, 1.0, 1.2),
    "stop_turn_deg": (None, 20.0, 30.0),
    "distance_ratio": (1.5, 1.8, 2.4),
    "distance_period_s": (24.0, 20.0, 16.0),
    "swing_m": (0.3, 0.5, 0.7),
    "swing_every_m": (8.0, 8.0, 7.0),
}
CHARACTERS: dict[str, dict[str, Any]] = {
    "steady": {},
    **{
        character: {key: values[column] for key, values in _CHARACTERS.items() if values[column] is not None}
        for column, character in enumerate(("careful", "average", "hasty"))
    },
}
"""Values that each character gives to the keys left out."""


class Operator(Section):
    """How the head follows the target and the base its route while the robot follows its script.

    The defaults are the steady operator: the head turns towards the target whenever it is more than 6 degrees off the
    middle, the base keeps its place. Whatever is random is drawn from streams of its own. The episode begins on the
    route, with the target in the middle. Robots driven by actions have no operator.
    """

    character: Literal["steady", "careful", "average", "hasty"] = setting(
        "steady", "Gives the keys left out the values of this kind of operator."
    )
    reaction_s: float = number(0.0, 0, 1, "Delay of the response to a movement of the target; 0.2 to 0.4 in people.")
    dead_zone_deg: float = number(6.0, 0, 20, "Errors of direction that the operator leaves as they are.")
    head_hz: float = number(
        0.0,
        0,
        2,
        "Natural frequency of the second-order response of the head, 0.5 to 1 in manual tracking; 0 is a first-order "
        "response without overshoot.",
    )
    head_damping: float = number(0.7, 0.1, 2, "Damping ratio: 1 does not overshoot, 0.5 does by 16 %, 0.3 by 37 %.")
    wander_deg: float = number(0.0, 0, 40, "RMS angle by which the aim wanders sideways; half as much up and down.")
    wander_s: float = number(4.0, 0.5, 60, "Mean period of that wandering: from one side to the other and back.")
    glances_per_minute: float = number(0.0, 0, 30, "How often the camera looks elsewhere and returns.")
    glance_deg: float = setting(
        25.0, "Mean angle by which it looks to one side of the target, within 30 %.", gt=0, le=150
    )
    glance_s: float = number(1.0, 0.1, 20, "Mean time until it turns back, within 30 %.")
    keep_in_view: bool = setting(True, "Whether the target's centre stays in the image, whatever the aim does.")
    stops_per_minute: float = number(0.0, 0, 20, "How often the base brakes to a stop; afterwards it catches up.")
    stop_s: float = number(2.0, 0.1, 20, "Mean time for which it stands, within 30 %.")
    stop_turn_deg: float = number(0.0, 0, 120, "Angle by which the body turns in a stop, to one side and back.")
    distance_ratio: float = number(
        1.0, 1, 5, "Largest over smallest distance kept; the route's is their geometric mean."
    )
    distance_period_s: float = number(20.0, 2, 3600, "Mean time from near to far and back, within 20 %.")
    swing_m: float = number(
        0.0, 0, 3, "How far the base swings wide of its route, to each side in turn: up to this, where there is room."
    )
    swing_every_m: float = number(8.0, 2, 3600, "Mean distance from one swing to the left to the next.")

    @model_validator(mode="before")
    @classmethod
    def _with_character(cls, values: Any) -> Any:
        if not isinstance(values, Mapping):
            return values
        given = cast("Mapping[str, Any]", values)
        character = given.get("character", "steady")
        return {**CHARACTERS.get(character, {}), **given} if isinstance(character, str) else given


class Sills(Section):
    """Sills across the way of the robot, which shake it through its suspension."""

    height_mm: float = number(0.0, 0, 15, "Height; thresholds of doors have up to 13 (ADA Standards 2010, 404.2.5).")
    every_m: float = number(4.0, 0.5, 1000, "Mean way from one to the next, within 30 %.")


class Sensors(Section):
    """Errors of the robot's sensors, all 0: exact, of each frame and at once.

    Rates and delays are rounded to control ticks, 40 ms or shorter.

    Data sheets: BMI088 (Bosch), gyroscope 0.014 deg/s and accelerometer 0.0017 m/s^2 over the square root of the
    bandwidth in Hz, biases within 1 deg/s and 0.2 m/s^2; URG-04LX (Hokuyo), range within 0.03 m up to 1 m, 3 % beyond.
    """

    gyro_noise_deg_s: float = number(0.0, 0, 100, "Standard deviation of the turn rates, in each frame anew.")
    gyro_bias_deg_s: float = number(0.0, 0, 100, "Standard deviation of an offset about each axis, once an episode.")
    accelerometer_noise_m_s2: float = number(0.0, 0, 100, "Standard deviation of the accelerations.")
    accelerometer_bias_m_s2: float = number(0.0, 0, 100, "Standard deviation of an offset along each axis.")
    range_noise_m: float = number(0.0, 0, 5, "Standard deviation of the ranges.")
    range_noise_share: float = number(0.0, 0, 1, "The same as a share of each range; both add up as independent.")
    range_lost: float = number(0.0, 0, 1, "Share of the beams that return nothing, in each frame others.")
    odometry_rate_hz: float = number(0.0, 0, 1000, "How often odometry and wheel speeds are new; 0: always.")
    odometry_delay_ms: float = number(0.0, 0, 2000, "How old they are, besides.")
    imu_rate_hz: float = number(0.0, 0, 1000, "How often turn rates and accelerations are new; 0: always.")
    imu_delay_ms: float = number(0.0, 0, 2000, "How old they are, besides.")
    range_rate_hz: float = number(0.0, 0, 1000, "How often ranges are new: 10 of an URG-04LX; 0: always.")
    range_delay_ms: float = number(0.0, 0, 2000, "How old they are, besides.")


class RangeFinder(Section):
    """Range finder 0.2 m above the ground, its beams about straight ahead; an URG-04LX has 682 in 240 degrees, 4 m."""

    beams: int = number(BEAMS, 2, 2000, "Beams, from the right of the field to its left.")
    field_deg: float = number(FIELD_DEG, 1, 360, "Angle between the first and the last.")
    range_m: float = number(RANGE_M, 0.5, 100, "Longest range; also what a beam tells that meets nothing.")

    @property
    def angles_rad(self) -> FloatArray:
        """`(beams,)` directions of the beams, counter-clockwise from straight ahead."""
        return beam_angles_rad(self.field_deg, self.beams)


class Robot(Section):
    """The robot that carries the camera, ours or that of a file, and its script in open-loop episodes."""

    route: Route
    model: str | None = setting(None, "MJCF or URDF file of a robot, or 'menagerie:' and a name; left out, our own.")
    model_digest: str = setting("", "Digest of that file, as it was read.")
    motion: str | None = setting(
        None, "CSV of the recorded motion of a base: what is faster than a second shakes the robot."
    )
    motion_digest: str = setting("", "Digest of that file, as it was read.")
    camera_site: str | None = setting(
        None, "Its camera, or the site or link where the camera is; left out, its first camera, or one called camera."
    )
    camera_rpy_deg: tuple[Angle, Angle, Angle] | None = setting(
        None, "Roll, pitch and yaw by which it is turned in the axes of that link: x forward, y left, z up."
    )
    drive: Literal["planar", "omni", "differential", "ackermann", "motors"] = setting(
        "planar",
        "How its base moves. 'differential': forwards, and about the middle of its axle; 'planar' and 'omni': without "
        "a pan joint its body turns to the target whatever its course; 'ackermann': as a car, by `wheelbase_m`; "
        "'motors': by the motors, wheels, springs and masses of its file, with the names of our own robot's.",
    )
    wheels: tuple[str, str] | None = setting(
        None, "Joints of its left and right wheel, of a car the rear ones: the middle, track and radius."
    )
    wheelbase_m: float | None = number(None, 0.05, 5, "Of a car: distance from its rear axle to the front one.")
    max_steer_deg: float = number(24.0, 1, 80, "Of a car: largest steering angle; 24 of an F1TENTH car.")
    max_steer_deg_s: float = number(183.0, 1, 3600, "Of a car: fastest change of the angle; 183 of an F1TENTH car.")
    pan: str | None = setting(None, "Its joint that pans the camera, or 'none'; left out, the nearest upright hinge.")
    tilt: str | None = setting(None, "Its joint that tilts it, or 'none'; left out, the nearest lateral hinge.")
    pose_deg: dict[str, Angle] = setting({}, "Angles of its hinges; left out, those of its first keyframe, or 0.")
    radius_m: float | None = number(None, 0.05, 3, "Its radius on the ground; left out, that of what collides.")
    gaze: Literal["target", "forward"] = setting(
        "target", "'target': the head follows the target with an operator's lag; 'forward': fixed."
    )
    operator: Operator = Operator()
    sills: Sills = Sills()
    sensors: Sensors = Sensors()
    range_finder: RangeFinder = RangeFinder()
    max_speed_m_s: Positive = setting(1.6, "Fastest forward speed of the drive.")
    max_turn_deg_s: Positive = setting(90.0, "Fastest turn rate of the drive.")
    max_pan_deg_s: Positive = setting(120.0, "Fastest pan rate of the head.")
    max_tilt_deg_s: Positive = setting(60.0, "Fastest tilt rate of the head.")
    floor_friction: float = number(
        1.0, 0.02, 2, "Coulomb friction of tyres on the floor: 1 dry, 0.4 wet tiles, 0.1 ice."
    )
    latency_ms: float = number(0.0, 0, 2000, "Delay from a command to the motors, rounded to the physics step.")
    odometry_error_percent: float = number(0.5, 0, 20, "Standard deviation of the odometry's wheel radii and track.")

    def _contradictions(self) -> Iterator[str]:
        given = [key for key in _ROLES if getattr(self, key) != type(self).model_fields[key].default]
        if self.model is None and given:
            yield f"{', '.join(given)}: about the file of a robot: set robot.model, too"
        if (self.drive == "ackermann") != (self.wheelbase_m is not None):
            yield "drive = 'ackermann' and wheelbase_m, from the rear axle to the front one, go together"
        if self.drive == "motors" and given != ["drive"]:
            given.remove("drive")
            yield f"{', '.join(given)}: has no effect with drive = 'motors', which takes the file as it is"

    @property
    def half_width_m(self) -> float:
        """Radius of the robot on the ground."""
        return OWN_RADIUS_M if self.radius_m is None else self.radius_m
