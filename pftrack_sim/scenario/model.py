"""Tables of a scenario after every range has been drawn: validated, frozen numbers.

The unit of every number is in its key. Angles are degrees here (`_deg`) and radians in code. World frame: z up,
x forward at the robot's start. The JSON Schema for editors is derived from these classes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Annotated, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from pftrack_sim.core.errors import UnknownNameError
from pftrack_sim.scenario.axes import Axes
from pftrack_sim.scenario.camera import CAMERA, Camera, FurtherCamera
from pftrack_sim.scenario.people import Distractors, FurtherTarget, Group, Target, end_s, title
from pftrack_sim.scenario.robot import Robot
from pftrack_sim.scenario.section import (
    Angle,
    Band,
    NotNegative,
    Positive,
    Seconds,
    Section,
    Share,
    UpAxis,
    number,
    setting,
)


class Place(Section):
    """A place that ships, and its loose furniture."""

    kind: Literal["plaza", "corridor", "warehouse", "street", "street-day", "hall", "park"] = setting(
        ..., "Kind of place; 'street': at night."
    )
    clutter: Share = setting(1.0, "Share of the place's loose furniture that is present.")


class _ModelPlace(Section):
    model: str = setting(..., "File, relative to the scenario's.")
    model_digest: str = setting("", "Digest of that file and of those that it names, as they were read.")


class MapPlace(_ModelPlace):
    """A map of a building, of ROS's map_server: what is occupied becomes walls."""

    kind: Literal["map"]
    wall_m: float = number(2.8, 0.3, 20, "Height of the walls, and of the ceiling on them.")


class MjcfPlace(_ModelPlace):
    """A scene of MuJoCo: its geoms and lights; what has joints stands still."""

    kind: Literal["mjcf"]
    groups: tuple[Annotated[int, Field(ge=0, le=5)], ...] = setting(
        (0, 1, 2), "Groups of geoms that are drawn.", max_length=6
    )
    floor_m: float | None = setting(
        None, "Height of the floor; by default that of the lowest large one.", ge=-500, le=500
    )


class MeshPlace(_ModelPlace):
    """A room of triangle meshes: glTF, GLB, OBJ, PLY or STL."""

    kind: Literal["mesh"]
    scale: float = setting(1.0, "Metres in a unit of the file: 0.001 for millimetres.", gt=0, le=1000)
    up: UpAxis = setting("auto", "Axis that points up; 'auto': y in glTF, GLB and OBJ, else z.")
    floor_m: float | None = setting(
        None, "Height of the floor; by default that of the lowest large one.", ge=-500, le=500
    )


AnyPlace: TypeAlias = Annotated[Place | MapPlace | MjcfPlace | MeshPlace, Field(discriminator="kind")]


_RESERVED = re.compile(r"target|bearer|walker|(distractor|crosser|passer|member)-\d+")  # Names of people


class Jitter(Section):
    """Vibration of the camera on its mount, in addition to that of the drive.

    Band-limited Gaussian motion: independent roll, pitch, yaw and x, y, z, each with the RMS given.
    """

    angular_rms_deg: float = number(0.0, 0, 20, "RMS of each of roll, pitch and yaw.")
    translational_rms_mm: NotNegative = setting(0.0, "RMS along each of x, y and z.")
    band_hz: Band = setting((1.0, 12.0), "Lowest and highest frequency.")


class Sensor(Section):
    """Optical blur, exposure and colours, and anti-aliasing."""

    psf_sigma_px: float = number(0.5, 0, 5, "Standard deviation of the lens's point-spread function; 0: perfect.")
    level: float = number(
        122.0,
        0,
        250,
        "Mean level that the exposure brightens the first frame to, and holds; 0: the picture as it is drawn, without "
        "the curve of tones, vignette, bloom and drift.",
    )
    exposure_limit_ev: float = number(3.6, 0, 10, "Most stops by which the exposure brightens: a night stays dark.")
    vignette: Share = setting(0.16, "Share of light that is lost in the corners.")
    bloom: Share = setting(0.6, "Share of what is brighter than level 190 that the lens scatters around it.")
    white_balance_ev: float = number(
        0.16, 0, 2, "Root mean square of the stops by which red and blue drift against green after the first frame."
    )
    multisamples: Literal[0, 2, 4, 8] = setting(0, "Anti-aliasing samples per pixel of the colour image.")


class _LightChange(Section):
    ev: float = number(..., -10, 5, "Change of the light in stops; -1 halves it.")
    lights: Literal["all", "sun", "lamps"] = setting("all", "Which lights change.")


class LightStep(_LightChange):
    """A sudden change."""

    kind: Literal["step"]
    at_s: NotNegative = setting(..., "Time of the change.")


class LightRamp(_LightChange):
    """A gradual change."""

    kind: Literal["ramp"]
    from_s: NotNegative = setting(..., "Time at which the ramp begins.")
    to_s: NotNegative = setting(..., "Time at which the ramp ends.")

    def _contradictions(self) -> Iterator[str]:
        if self.from_s >= self.to_s:
            yield f"to_s must be later than from_s, got from_s={self.from_s:g}, to_s={self.to_s:g}"


LightChange: TypeAlias = Annotated[LightStep | LightRamp, Field(discriminator="kind")]


class Lights(Section):
    """Sun, sky and lamps of the place, and how they change."""

    shadows: bool = setting(True, "Whether the sun casts shadows; lamps cast none.")
    shadow_pixels: int | None = number(
        None, 16, 8192, "Width of the map of shadows; their edges are as soft as one of its pixels. Else the image's."
    )
    shadow_reach_m: float = number(
        14.0, 2, 200, "Half the width of the ground before the camera on which the sun casts shadows."
    )
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
    lost_after_s: Positive = setting(8.0, "The episode ends when the target is out of view this long.")


class ResolvedScenario(Section):
    """Scenario of one episode with every range drawn; created by `Scenario.resolve(seed)`."""

    version: int = number(1, 1, 10000, "Raised when frames or truth of the scenario change.")
    title: str = setting(..., "One line for lists.")
    tier: Literal["easy", "real", "hard"] = setting(
        "easy", "'easy': calm; 'real': as hard as recorded video (docs/profile.md); 'hard': harder."
    )
    duration_s: Seconds = setting(12.0, "Length of an episode.")
    place: AnyPlace
    robot: Robot
    camera: Camera = Camera()
    cameras: tuple[FurtherCamera, ...] = setting((), "Further cameras, fixed to the first one.", max_length=8)
    viewed: str = setting(CAMERA, "Name of the camera that trackers look through: 'camera' is the first one.")
    sensor: Sensor = Sensor()
    jitter: Jitter = Jitter()
    axes: Axes = Axes()
    lights: Lights = Lights()
    target: Target
    targets: tuple[FurtherTarget, ...] = setting((), "Further targets, of whom truth is told by name.", max_length=12)
    tracked: str = setting("target", "Name of the target that selection, scores and following are about.")
    distractors: Distractors = Distractors()
    groups: tuple[Group, ...] = setting((), "People who belong together.", max_length=6)
    occluders: tuple[Occluder, ...] = setting((), "Occlusions, each at its time.", max_length=32)
    follow: Follow = Follow()

    def _contradictions(self) -> Iterator[str]:
        counts = {"distractor": self.distractors.count, "member": sum(one.count for one in self.groups)}
        people = [f"{kind}-{number}" for kind, count in counts.items() for number in range(1, count + 1)]
        for index, one in enumerate(self.targets):
            if one.name in self.target_names[: index + 1] or (one.path_m and _RESERVED.fullmatch(one.name)):
                yield f"targets.{index}.name: {one.name!r} is the name of somebody else: choose another"
            if not one.path_m and one.name not in people:
                unknown = UnknownNameError("person without a path_m", one.name, people)
                yield f"targets.{index}.name: {unknown}"
        if self.tracked not in (known := [*dict.fromkeys([*self.target_names, *people])]):
            yield f"tracked: {UnknownNameError('person', self.tracked, known)}"
        names = self.camera_names
        for place, name in enumerate(names):
            where = "camera" if place == 0 else f"cameras.{place - 1}"
            if name in names[:place]:
                yield f"{where}.name: {name!r} is the name of another camera: choose another"
            try:
                own = self.seen_by(name).camera.calibrated
            except ValidationError as error:
                yield f"{where}: {error.errors()[0]['msg'].removeprefix('Value error, ')}"
                continue
            if own is not None and len(own.distortion) == 4 and any(self.axes.distortion.coefficients):
                yield f"axes.distortion: is of Brown's model, and {where}.calibrated of an equidistant lens: set 0"
        if self.viewed not in names:
            yield f"viewed: {UnknownNameError('camera', self.viewed, names)}"

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Names of all cameras, that of `camera` first."""
        return CAMERA, *(one.name for one in self.cameras)

    def seen_by(self, name: str) -> ResolvedScenario:
        """The scenario whose `camera` has lens and image of the one of this name."""
        if name == CAMERA:
            return self
        further = next(one for one in self.cameras if one.name == name)
        return self.model_copy(update={"camera": further.seen_by(self.camera)})

    @property
    def viewing(self) -> ResolvedScenario:
        """The scenario as trackers see it."""
        return self.seen_by(self.viewed)

    def T_camera(self, name: str) -> NDArray[np.float64]:
        """`(4, 4)` pose of a camera in the axes of the first one."""
        return {CAMERA: np.eye(4), **{one.name: one.T_camera for one in self.cameras}}[name]

    @property
    def target_names(self) -> tuple[str, ...]:
        """Names of all targets, that of `target` first."""
        return "target", *(one.name for one in self.targets)

    @property
    def walking_targets(self) -> tuple[FurtherTarget, ...]:
        """Further targets that have a path of their own."""
        return tuple(one for one in self.targets if one.path_m)

    @property
    def distortion(self) -> tuple[float, ...]:
        """Coefficients of the calibrated lens and the axis together, see `CalibratedLens`."""
        own, axis = self.camera.calibrated, self.axes.distortion.coefficients
        if own is None or len(own.distortion) == 4:
            return axis if own is None else own.distortion
        return *map(sum, zip(own.distortion, axis, strict=False)), *own.distortion[5:]

    def late_actions(self) -> list[str]:
        """Messages about the target's actions that do not end within the episode."""
        return [
            f"target.{title(index, action)}: ends after the episode, which lasts {self.duration_s:g} s; "
            "only an override of duration_s may cut it"
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
    pushes = settings.target.thing.pushes if settings.target.thing is not None else ()
    times += [(f"target.thing.pushes.{index}", one.at_s) for index, one in enumerate(pushes)]
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
