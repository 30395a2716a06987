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
from pftrack_sim.scenario.section import (
    Angle,
    Band,
    Coordinate,
    NotNegative,
    Point,
    Positive,
    Seconds,
    Section,
    Share,
    number,
    setting,
)
from pftrack_sim.scenario.teleoperation import Operator, Sills


class Place(Section):
    """The place and its loose furniture."""

    kind: Literal["plaza", "corridor", "warehouse", "street", "street-day", "hall", "park"] = setting(
        ..., "Kind of place; 'street': at night."
    )
    clutter: Share = setting(1.0, "Share of the place's loose furniture that is present.")


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


class Robot(Section):
    """The differential-drive robot that carries the camera, and its script in open-loop episodes."""

    route: Route
    gaze: Literal["target", "forward"] = setting(
        "target", "'target': the head follows the target with an operator's lag; 'forward': fixed."
    )
    operator: Operator = Operator()
    sills: Sills = Sills()
    max_speed_m_s: Positive = setting(1.6, "Fastest forward speed of the drive.")
    max_turn_deg_s: Positive = setting(90.0, "Fastest turn rate of the drive.")
    max_pan_deg_s: Positive = setting(120.0, "Fastest pan rate of the head.")
    max_tilt_deg_s: Positive = setting(60.0, "Fastest tilt rate of the head.")
    floor_friction: float = number(
        1.0, 0.02, 2, "Coulomb friction of tyres on the floor: 1 dry, 0.4 wet tiles, 0.1 ice."
    )
    latency_ms: float = number(0.0, 0, 2000, "Delay from a command to the motors, rounded to the physics step.")
    odometry_error_percent: float = number(0.5, 0, 20, "Standard deviation of the odometry's wheel radii and track.")


class Camera(Section):
    """The camera on the robot's mast."""

    width_px: int = number(640, 16, 4096, "Image width.")
    height_px: int = number(480, 16, 4096, "Image height.")
    fovy_deg: float = number(50.0, 5, 130, "Vertical field of view.")
    rate_hz: float = number(30.0, 1, 250, "Frames per second.")
    height_m: float = number(1.25, 0.3, 3, "Height of the optical centre.")
    mount: Literal["front", "left", "right", "back"] = setting("front", "Direction of the camera at rest.")
    tilt_deg: float = number(0.0, -45, 45, "Tilt at rest; positive looks up.")
    grey: bool = setting(False, "A grey camera: its luma in each of the three channels.")


class Jitter(Section):
    """Vibration of the camera on its mount, in addition to that of the drive.

    Band-limited Gaussian motion: independent roll, pitch, yaw and x, y, z, each with the RMS given.
    """

    angular_rms_deg: float = number(0.0, 0, 20, "RMS of each of roll, pitch and yaw.")
    translational_rms_mm: NotNegative = setting(0.0, "RMS along each of x, y and z.")
    band_hz: Band = setting((1.0, 12.0), "Lowest and highest frequency.")


class Sensor(Section):
    """Optical blur and anti-aliasing."""

    psf_sigma_px: float = number(0.5, 0, 5, "Standard deviation of the lens's point-spread function; 0: perfect.")
    multisamples: Literal[0, 2, 4, 8] = setting(0, "Anti-aliasing samples per pixel of the colour image.")


class LightStep(Section):
    """A sudden change."""

    kind: Literal["step"]
    at_s: NotNegative = setting(..., "Time of the change.")
    ev: float = number(..., -10, 5, "Change of the light in stops; -1 halves it.")
    lights: Literal["all", "sun", "lamps"] = setting("all", "Which lights change.")


class LightRamp(Section):
    """A gradual change."""

    kind: Literal["ramp"]
    from_s: NotNegative = setting(..., "Time at which the ramp begins.")
    to_s: NotNegative = setting(..., "Time at which the ramp ends.")
    ev: float = number(..., -10, 5, "Change of the light in stops; -1 halves it.")
    lights: Literal["all", "sun", "lamps"] = setting("all", "Which lights change.")

    @model_validator(mode="after")
    def _ends_after_it_begins(self) -> LightRamp:
        if self.from_s >= self.to_s:
            raise ValueError(f"to_s must be later than from_s, got from_s={self.from_s:g}, to_s={self.to_s:g}")
        return self


LightChange: TypeAlias = Annotated[LightStep | LightRamp, Field(discriminator="kind")]


class Lights(Section):
    """Sun, sky and lamps of the place, and how they change."""

    shadows: bool = setting(True, "Whether the main light casts shadows.")
    ev: float = number(0.0, -10, 5, "All light, in stops; -1 halves it.")
    sun_azimuth_deg: Angle = setting(40.0, "Azimuth of the sun; 0 is +x, counter-clockwise.")
    sun_elevation_deg: float = number(48.0, 5, 90, "Sun's elevation.")
    patches: float = number(
        0.0,
        0,
        0.9,
        "Share of the ground that the sun does not reach: below foliage on the plaza, between windows of the roof "
        "indoors (needs shadows); on the street, how much the lamps differ in brightness and colour.",
    )
    patch_m: float = number(3.0, 0.5, 20, "Mean size of a tree's crown or window that makes the patches.")
    schedule: tuple[LightChange, ...] = setting((), "Changes over time; their stops add up.", max_length=1000)


MAX_PATH_M = 2000.0


class Target(Section):
    """The person to track."""

    path_m: tuple[Point, ...] = setting(
        ...,
        "Points the target walks through; corners are rounded. It stops at the last one.",
        min_length=2,
        max_length=1000,
    )
    speed_m_s: float = number(1.25, 0.3, 2.2, "Walking speed.")
    height_m: float = number(1.74, 1.4, 2.1, "Body height.")
    wardrobe: int = number(
        0,
        0,
        10000,
        "Number of the set of random clothes and builds: scenarios with different numbers show different people at "
        "the same seed.",
    )
    init: Literal["body", "torso"] = setting(
        "body",
        "What the target's boxes enclose, from the selection to the score: 'body': the whole person; 'torso': the "
        "trunk from the hips to the neck, without the arms, as users often draw it.",
    )
    start_stride: Literal["median", "any"] = setting(
        "median",
        "Gait phase in the first frame, in which the target is selected: 'median': one at which the box has its "
        "median width over a stride; 'any': drawn from the seed.",
    )
    actions: tuple[Action, ...] = setting((), "What it does on its way, one thing at a time.", max_length=1000)

    carries: tuple[Carried, ...] = setting((), "What it carries, or picks up on its way.", max_length=100)

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

    count: int = number(3, 0, 12, "Number of pedestrians.")
    similarity: Share = setting(0.2, "Similarity of their clothes to the target's; 1 is the same clothes.")
    speed_m_s: float = number(1.2, 0.3, 2.2, "Mean walking speed.")
    changes_per_minute: float = number(
        0.0, 0, 60, "How often each changes its pace or, every third time, pauses for 1 to 3 s."
    )


class Occluder(Section):
    """An occluder between the camera and the target at a given time and for a given duration.

    The target's centre line is behind it from `at_s` to `at_s + duration_s`.
    """

    kind: Literal["pillar", "wall", "boxes", "walker"] = setting(
        ..., "'pillar': full height; 'wall': low, covers the legs upwards; 'boxes': a stack; 'walker': a person."
    )
    at_s: NotNegative = setting(..., "When the target's centre line goes behind it.")
    duration_s: Positive = setting(1.0, "Duration for which the centre line stays behind it.")
    share: float = setting(1.0, "Share of the target's height that a wall or boxes cover.", gt=0, le=1)
    depth: float = number(0.6, 0.2, 0.9, "Position on the line from the camera (0) to the target (1).")
    similarity: Share = setting(0.0, "Similarity of a walker's clothes to the target's.")


class Follow(Section):
    """Wanted distance and limits of `Follow-v0`."""

    distance_m: Positive = setting(3.0, "Wanted distance to the target.")
    distance_limit_m: Positive = setting(3.0, "Error of distance at which the reward reaches 0.")
    bearing_limit_deg: float = setting(45.0, "Error of bearing at which the reward reaches 0.", gt=0, le=180)
    lost_after_s: Positive = setting(3.0, "The episode ends when the target is out of view this long.")


class ResolvedScenario(Section):
    """Scenario of one episode with every range drawn; created by `Scenario.resolve(seed)`."""

    version: int = number(1, 1, 10000, "Raised when frames or truth of the scenario change.")
    title: str = setting(..., "One line for lists.")
    tier: Literal["easy", "real", "hard"] = setting(
        "easy", "'easy': calm; 'real': as hard as recorded video (docs/profile.md); 'hard': harder."
    )
    duration_s: Seconds = setting(12.0, "Length of an episode.")
    place: Place
    robot: Robot
    camera: Camera = Camera()
    sensor: Sensor = Sensor()
    jitter: Jitter = Jitter()
    axes: Axes = Axes()
    lights: Lights = Lights()
    target: Target
    distractors: Distractors = Distractors()
    groups: tuple[Group, ...] = setting((), "People who belong together.", max_length=6)
    occluders: tuple[Occluder, ...] = setting((), "Occlusions, each at its time.", max_length=32)
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


def late_events(settings: ResolvedScenario) -> list[str]:
    """What begins after the episode, so that it never happens: `"occluders.0 (walker) at 5 s"`."""
    times: list[tuple[str, float]] = [
        *((f"target.actions.{index} ({one.kind})", one.at_s) for index, one in enumerate(settings.target.actions)),
        *((f"occluders.{index} ({one.kind})", one.at_s) for index, one in enumerate(settings.occluders)),
    ]
    for index, change in enumerate(settings.lights.schedule):
        begins_s = change.at_s if isinstance(change, LightStep) else change.from_s
        times.append((f"lights.schedule.{index} ({change.kind})", begins_s))
    for name, axis in settings.axes:
        times += [(f"axes.{name}, event {number}", at_s) for number, at_s in enumerate(axis.events_s, start=1)]
    return [f"{title} at {time_s:.3g} s" for title, time_s in times if time_s >= settings.duration_s]


def axis_without_effect(settings: ResolvedScenario, name: str) -> str | None:
    """Why nothing of a stress axis is in the episode, or in the frames that are compared; None if something is."""
    axis = getattr(settings.axes, name)
    first_s, from_s = min(axis.events_s, default=0.0), axis.compared_from_s if axis.on else 0.0
    if max(first_s, from_s) < settings.duration_s:
        return None
    when = f"its first event begins at {first_s:g} s" if from_s < first_s else f"its first event ends at {from_s:g} s"
    key = next(key for key in ("end_s", "leave_at_s", "at_s") if hasattr(axis, key))
    return (
        f"axes.{name}: has no effect on what is compared: {when}, and the episode lasts {settings.duration_s:g} s; "
        f"set a longer duration_s, or an earlier axes.{name}.{key}"
    )
