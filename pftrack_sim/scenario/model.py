"""Tables of a scenario after every range has been drawn: validated, frozen numbers.

The unit of every number is in its key. Angles are degrees here (`_deg`) and radians in code. World frame: z up,
x forward at the robot's start. The JSON Schema for editors is derived from these classes.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from pftrack_sim.scenario.actions import Action, end_s, overlap_problem, title
from pftrack_sim.scenario.axes import Axes
from pftrack_sim.scenario.carried import Carried, carrying_problem
from pftrack_sim.scenario.groups import Group
from pftrack_sim.scenario.section import Angle, Coordinate, NotNegative, Point, Positive, Seconds, Section, Share
from pftrack_sim.scenario.teleoperation import Operator, Sills


class Place(Section):
    """The place and its loose furniture."""

    kind: Literal["plaza", "corridor", "warehouse", "street", "street-day", "hall", "park"] = Field(
        description="Kind of place; 'street': at night."
    )
    clutter: Share = Field(default=1.0, description="Share of the place's loose furniture that is present.")


class StillRoute(Section):
    """The robot stands still."""

    kind: Literal["still"]
    start_m: Point = Field(default=(0.0, 0.0), description="Position of the robot.")
    heading_deg: Angle = Field(default=0.0, description="Heading; 0 is +x, counter-clockwise.")


class WaypointRoute(Section):
    """The robot drives through points, then stops."""

    kind: Literal["waypoints"]
    points_m: Annotated[tuple[Point, ...], Field(min_length=2, max_length=1000)] = Field(
        description="Points to drive through."
    )
    speed_m_s: Positive = Field(default=0.8, description="Cruising speed.")


class TrailRoute(Section):
    """The robot drives along the target's own path, keeping a distance behind it."""

    kind: Literal["trail"]
    distance_m: Positive = Field(default=3.5, description="Distance kept behind the target, along its path.")
    offset_m: Coordinate = Field(default=0.0, description="Sideways offset from the target's path; positive is left.")


class BesideRoute(Section):
    """The robot drives beside the target, parallel to its path, so that the background sweeps past."""

    kind: Literal["beside"]
    distance_m: Positive = Field(default=3.0, description="Sideways distance from the target's path.")
    side: Literal["left", "right"] = Field(default="right", description="On which side of the target the robot drives.")
    lead_m: Coordinate = Field(
        default=0.0, description="How far ahead of the target along its path; negative is behind."
    )


Route: TypeAlias = Annotated[StillRoute | WaypointRoute | TrailRoute | BesideRoute, Field(discriminator="kind")]


class Robot(Section):
    """The differential-drive robot that carries the camera, and its script in open-loop episodes."""

    route: Route
    gaze: Literal["target", "forward"] = Field(
        default="target",
        description="'target': the head follows the target with an operator's lag; 'forward': fixed.",
    )
    operator: Operator = Operator()
    sills: Sills = Sills()
    max_speed_m_s: Positive = Field(default=1.6, description="Fastest forward speed of the drive.")
    max_turn_deg_s: Positive = Field(default=90.0, description="Fastest turn rate of the drive.")
    max_pan_deg_s: Positive = Field(default=120.0, description="Fastest pan rate of the head.")
    max_tilt_deg_s: Positive = Field(default=60.0, description="Fastest tilt rate of the head.")
    floor_friction: Annotated[float, Field(ge=0.02, le=2.0)] = Field(
        default=1.0, description="Coulomb friction between tyres and floor: 1 dry, 0.4 wet tiles, 0.1 ice."
    )
    latency_ms: Annotated[float, Field(ge=0.0, le=2000.0)] = Field(
        default=0.0, description="Delay from a command to the motors, rounded to the physics step."
    )
    odometry_error_percent: Annotated[float, Field(ge=0.0, le=20.0)] = Field(
        default=0.5,
        description="Standard deviation of the odometry's error of each wheel's radius and of the track.",
    )


class Camera(Section):
    """The camera on the robot's mast."""

    width_px: Annotated[int, Field(ge=16, le=4096)] = Field(default=640, description="Image width.")
    height_px: Annotated[int, Field(ge=16, le=4096)] = Field(default=480, description="Image height.")
    fovy_deg: Annotated[float, Field(ge=5.0, le=130.0)] = Field(default=50.0, description="Vertical field of view.")
    rate_hz: Annotated[float, Field(ge=1.0, le=250.0)] = Field(default=30.0, description="Frames per second.")
    height_m: Annotated[float, Field(ge=0.3, le=3.0)] = Field(default=1.25, description="Height of the optical centre.")
    mount: Literal["front", "left", "right", "back"] = Field(
        default="front", description="Direction of the camera at rest."
    )
    tilt_deg: Annotated[float, Field(ge=-45.0, le=45.0)] = Field(
        default=0.0, description="Tilt at rest; positive looks up."
    )
    grey: bool = Field(default=False, description="A grey camera: its luma in each of the three channels.")


class Jitter(Section):
    """Vibration of the camera on its mount, in addition to that of the drive.

    Band-limited Gaussian motion: independent roll, pitch, yaw and x, y, z, each with the RMS given.
    """

    angular_rms_deg: Annotated[float, Field(ge=0.0, le=20.0)] = Field(
        default=0.0, description="RMS of each of roll, pitch and yaw."
    )
    translational_rms_mm: NotNegative = Field(default=0.0, description="RMS along each of x, y and z.")
    band_hz: tuple[Positive, Positive] = Field(default=(1.0, 12.0), description="Lowest and highest frequency.")

    @model_validator(mode="after")
    def _band_is_ordered(self) -> Jitter:
        if self.band_hz[0] >= self.band_hz[1]:
            raise ValueError(f"band_hz must be [low, high] with low < high, got {list(self.band_hz)}")
        return self


class Sensor(Section):
    """Optical blur and anti-aliasing."""

    psf_sigma_px: Annotated[float, Field(ge=0.0, le=5.0)] = Field(
        default=0.5,
        description="Blur of the lens: standard deviation of its point-spread function; 0 is a perfect lens.",
    )
    multisamples: Literal[0, 2, 4, 8] = Field(
        default=0, description="Anti-aliasing samples per pixel of the colour image."
    )


class LightStep(Section):
    """A sudden change."""

    kind: Literal["step"]
    at_s: NotNegative = Field(description="Time of the change.")
    ev: Annotated[float, Field(ge=-10.0, le=5.0)] = Field(description="Change of the light in stops; -1 halves it.")
    lights: Literal["all", "sun", "lamps"] = Field(default="all", description="Which lights change.")


class LightRamp(Section):
    """A gradual change."""

    kind: Literal["ramp"]
    from_s: NotNegative = Field(description="Time at which the ramp begins.")
    to_s: NotNegative = Field(description="Time at which the ramp ends.")
    ev: Annotated[float, Field(ge=-10.0, le=5.0)] = Field(description="Change of the light in stops; -1 halves it.")
    lights: Literal["all", "sun", "lamps"] = Field(default="all", description="Which lights change.")

    @model_validator(mode="after")
    def _ends_after_it_begins(self) -> LightRamp:
        if self.from_s >= self.to_s:
            raise ValueError(f"to_s must be later than from_s, got from_s={self.from_s:g}, to_s={self.to_s:g}")
        return self


LightChange: TypeAlias = Annotated[LightStep | LightRamp, Field(discriminator="kind")]


class Lights(Section):
    """Sun, sky and lamps of the place, and how they change."""

    shadows: bool = Field(default=True, description="Whether the main light casts shadows.")
    ev: Annotated[float, Field(ge=-10.0, le=5.0)] = Field(default=0.0, description="All light, in stops; -1 halves it.")
    sun_azimuth_deg: Angle = Field(default=40.0, description="Azimuth of the sun; 0 is +x, counter-clockwise.")
    sun_elevation_deg: Annotated[float, Field(ge=5.0, le=90.0)] = Field(default=48.0, description="Sun's elevation.")
    patches: Annotated[float, Field(ge=0.0, le=0.9)] = Field(
        default=0.0,
        description="Share of the ground that the sun does not reach: below foliage on the plaza, between windows of "
        "the roof indoors (needs shadows); on the street, how much the lamps differ in brightness and colour.",
    )
    patch_m: Annotated[float, Field(ge=0.5, le=20.0)] = Field(
        default=3.0, description="Mean size of a tree's crown or window that makes the patches."
    )
    schedule: tuple[LightChange, ...] = Field(
        default=(), max_length=1000, description="Changes over time; their stops add up."
    )


MAX_PATH_M = 2000.0


class Target(Section):
    """The person to track."""

    path_m: Annotated[tuple[Point, ...], Field(min_length=2, max_length=1000)] = Field(
        description="Points the target walks through; corners are rounded. It stops at the last one."
    )
    speed_m_s: Annotated[float, Field(ge=0.3, le=2.2)] = Field(default=1.25, description="Walking speed.")
    height_m: Annotated[float, Field(ge=1.4, le=2.1)] = Field(default=1.74, description="Body height.")
    wardrobe: Annotated[int, Field(ge=0, le=10_000)] = Field(
        default=0,
        description="Number of the set of random clothes and builds: scenarios with different numbers show different "
        "people at the same seed.",
    )
    init: Literal["body", "torso"] = Field(
        default="body",
        description="What the target's boxes enclose, from the selection to the score: 'body': the whole person; "
        "'torso': the trunk from the hips to the neck, without the arms, as users often draw it.",
    )
    start_stride: Literal["median", "any"] = Field(
        default="median",
        description="Gait phase in the first frame, in which the target is selected: 'median': one at which the box "
        "has its median width over a stride; 'any': drawn from the seed.",
    )
    actions: tuple[Action, ...] = Field(
        default=(), max_length=1000, description="What it does on its way, one thing at a time."
    )

    carries: tuple[Carried, ...] = Field(
        default=(), max_length=100, description="What it carries, or picks up on its way."
    )

    @model_validator(mode="after")
    def _path_can_be_walked(self) -> Target:
        length_m = sum(math.dist(one, other) for one, other in pairwise(self.path_m))
        if length_m > MAX_PATH_M:
            raise ValueError(f"path_m must be at most {MAX_PATH_M:g} m long, got {length_m:g} m")
        return self

    @model_validator(mode="after")
    def _actions_are_possible(self) -> Target:
        problem = overlap_problem(self.actions) or carrying_problem(self.carries, self.actions)
        if problem:
            raise ValueError(problem)
        return self


class Distractors(Section):
    """Other pedestrians."""

    count: Annotated[int, Field(ge=0, le=12)] = Field(default=3, description="Number of pedestrians.")
    similarity: Share = Field(
        default=0.2, description="Similarity of their clothes to the target's; 1 is the same clothes."
    )
    speed_m_s: Annotated[float, Field(ge=0.3, le=2.2)] = Field(default=1.2, description="Mean walking speed.")
    changes_per_minute: Annotated[float, Field(ge=0.0, le=60.0)] = Field(
        default=0.0, description="How often each changes its pace, or pauses for 1 to 3 s: a third of the changes."
    )


class Occluder(Section):
    """An occluder between the camera and the target at a given time and for a given duration.

    The target's centre line is behind it from `at_s` to `at_s + duration_s`.
    """

    kind: Literal["pillar", "wall", "boxes", "walker"] = Field(
        description="'pillar': full height; 'wall': low, covers the legs upwards; 'boxes': a stack; 'walker': a person."
    )
    at_s: NotNegative = Field(description="When the target's centre line goes behind it.")
    duration_s: Positive = Field(default=1.0, description="Duration for which the centre line stays behind it.")
    share: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        default=1.0, description="Share of the target's height that a wall or boxes cover."
    )
    depth: Annotated[float, Field(ge=0.2, le=0.9)] = Field(
        default=0.6, description="Position on the line from the camera (0) to the target (1)."
    )
    similarity: Share = Field(default=0.0, description="Similarity of a walker's clothes to the target's.")


class Follow(Section):
    """Wanted distance and limits of `Follow-v0`."""

    distance_m: Positive = Field(default=3.0, description="Wanted distance to the target.")
    distance_limit_m: Positive = Field(default=3.0, description="Error of distance at which the reward reaches 0.")
    bearing_limit_deg: Annotated[float, Field(gt=0.0, le=180.0)] = Field(
        default=45.0, description="Error of bearing at which the reward reaches 0."
    )
    lost_after_s: Positive = Field(
        default=3.0, description="The episode ends when the target is out of view this long."
    )


class ResolvedScenario(Section):
    """Scenario of one episode with every range drawn; created by `Scenario.resolve(seed)`."""

    version: Annotated[int, Field(ge=1, le=10_000)] = Field(
        default=1, description="Raised when frames or truth of the scenario change."
    )
    title: str = Field(description="One line for lists.")
    tier: Literal["easy", "real", "hard"] = Field(
        default="easy",
        description="'easy': calm; 'real': as hard as recorded video (docs/profile.md); 'hard': harder.",
    )
    duration_s: Seconds = Field(default=12.0, description="Length of an episode.")
    place: Place
    robot: Robot
    camera: Camera = Camera()
    sensor: Sensor = Sensor()
    jitter: Jitter = Jitter()
    axes: Axes = Axes()
    lights: Lights = Lights()
    target: Target
    distractors: Distractors = Distractors()
    groups: tuple[Group, ...] = Field(default=(), max_length=6, description="People who belong together.")
    occluders: tuple[Occluder, ...] = Field(default=(), max_length=32, description="Occlusions, each at its time.")
    follow: Follow = Follow()

    def late_actions(self) -> list[str]:
        """Messages about the target's actions that do not end within the episode."""
        return [
            f"target.{title(index, action)}: ends after the episode, which lasts {self.duration_s:g} s"
            for index, action in enumerate(self.target.actions)
            if end_s(action) > self.duration_s
        ]

    @property
    def frame_count(self) -> int:
        """Frames captured in one episode, at least 2; see `frame_delivery.frame_count` for those delivered."""
        return max(2, round(self.duration_s * self.camera.rate_hz))
