"""How a frame is taken that is no instant through a pinhole: with a lens, a shutter that stays open, rows read in turn.

Drawings show an instant through a pinhole. Where only the camera turns, one drawing holds all the light that the
exposure collects, and each pixel fetches it along its own ray at its own time (`camera.warp`). Where people move or
the camera travels, that is no longer true, and more drawings are made, as many as the motion has pixels:

- over the rows, in bands, when near scenery shifts while the rows are read. People need none of these: every part of
  a moving body is drawn where it is when its own row is read;
- over the exposure, in samples, when anything but the camera's turning shifts meanwhile.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.camera import rotations as turns
from pftrack_sim.camera import shutter as shutters
from pftrack_sim.camera.distortion import Lens
from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.camera.remap import RadianceAccumulator, Rays, ground_nearness
from pftrack_sim.camera.shake import Vibration
from pftrack_sim.camera.shutter import CameraTrajectory, Shutter
from pftrack_sim.core.errors import ParameterError, ScenarioError
from pftrack_sim.core.records import Image
from pftrack_sim.render.backend import Renderer
from pftrack_sim.render.capture.pose_history import PoseHistory
from pftrack_sim.render.capture.render_pass import RenderPass, framed, reach, rows_seen
from pftrack_sim.scenario import ResolvedScenario
from pftrack_sim.scene.layout import PEOPLE_GROUP, SCENERY_GROUP

Array = NDArray[np.float64]

_SHAKE_PX = 6
"""Margin of a drawing for the turning of the camera within a frame; beyond it, the drawing is made smaller."""

_LARGEST = 1.6
"""A drawing is at most this much larger than the image, each way; beyond, it is made smaller."""

_KNOTS = 9
"""Instants at which the camera's pose is known within a frame; straight in between."""

_BAND_PX, _MOST_BANDS = 1.5, 6
"""Shift of scenery while the rows are read that needs another band; the error is half of it, either way."""

_SAMPLE_PX, _MOST_SAMPLES = 1.0, 8
"""Shift during the exposure that needs another drawing."""

_MOST_DRAWINGS = 16
"""In one frame: then bands are left out."""

_TURN_PX, _MOST_TURNS = 1.0, 32
"""Turn of the camera during the exposure that needs another resampling of a drawing."""

_STILL_M = 2e-4
"""A camera that travels less during a frame stands still."""

_AHEAD_M = 0.3
"""Nearer things are not asked how far they shift."""

_PROBES = (8, 6)
"""Rays across and down that tell how far away the scenery is."""


@dataclass(frozen=True, eq=False)
class CapturedFrame:
    """A frame that was taken, and how.

    Attributes:
        image: `(H, W, 3)` the light that the sensor saw.
        exposer: Who took it.
        flight: The camera's way.
        T_world_camera: `(4, 4)` at mid-exposure of the middle row.
        T_world_people: `(P, 4, 4)` root poses at that instant.
        bodies: `(nbody, 3)` positions of all bodies at that instant [m].
        drawings: Works out one for each run of rows, of each row's mid-exposure: what the truth is found on. To be
            called before the next frame is taken.
    """

    image: Image
    exposer: FrameCapture
    flight: CameraTrajectory
    T_world_camera: Array
    T_world_people: Array
    bodies: Array
    drawings: Callable[[], list[RenderPass]]


class FrameCapture:
    """Takes the frames of one episode.

    Args:
        model: What is drawn.
        lens: The lens.
        shutter: The rows' times.
        vibration: Of the camera's mount.
    """

    def __init__(self, model: mujoco.MjModel, lens: Lens, shutter: Shutter, vibration: Vibration) -> None:
        self._model = model
        self.lens, self.shutter = lens, shutter
        self._vibration = vibration
        self.rays = Rays(lens)
        self._people = np.asarray(model.geom_group) == PEOPLE_GROUP
        bounded = np.asarray(model.geom_type) != int(mujoco.mjtGeom.mjGEOM_PLANE)
        self._scenery = np.flatnonzero((np.asarray(model.geom_group) == SCENERY_GROUP) & bounded)
        self._scratch = mujoco.MjData(model)
        self._past = PoseHistory(shutter.window_s)
        self._through_lens: RenderPass | None = None

    @property
    def drawn_size(self) -> tuple[int, int]:
        """Width and height of the drawings [px]."""
        low, high = reach([self.rays.turned(0, self.rays.bands, np.eye(3))])
        size = np.array(self.lens.size)
        beyond = (high - low) * focal_and_centre(self.lens.K)[:2] - size
        margin = np.ceil(0.5 * np.maximum(beyond, 0.0)) + (0 if self.shutter.instant else _SHAKE_PX)
        width, height = (int(one) for one in np.minimum(size + 2 * margin, np.ceil(_LARGEST * size)))
        return width, height

    def record(self, data: mujoco.MjData, time_s: float, T_world_camera: Array, T_world_people: Array) -> None:
        """Record the poses at the time of a camera frame, captured or not: every frame of the camera, in order.

        Args:
            data: Positions at the time stamp, up to date.
            time_s: Time stamp since the start of the episode.
            T_world_camera: `(4, 4)` camera pose at the time stamp without the vibration of the mount.
            T_world_people: `(P, 4, 4)` root poses at the time stamp.
        """
        self._time_s = time_s
        self._past.remember(data, time_s, T_world_camera, T_world_people)
        self._scratch.light_xpos[:], self._scratch.light_xdir[:] = data.light_xpos, data.light_xdir

    def capture(self, renderer: Renderer) -> CapturedFrame:
        """Render and expose the frame recorded last.

        Args:
            renderer: Renders at `drawn_size`; it is bound to the model.
        """
        window, middle = self.shutter.window_s, self.shutter.middle_s
        instants = np.linspace(-window, 0.0, _KNOTS) if window else np.zeros(1)
        steady = self._past.cameras(instants)
        shaken = [
            self._vibration.displace(pose, self._time_s + when) for pose, when in zip(steady, instants, strict=True)
        ]
        self.flight = CameraTrajectory(instants, np.stack(shaken))
        self._when = self._own_rows()
        edges, samples, turned = self._plan(renderer)
        drawn_px = renderer.width_px, renderer.height_px
        meter = RadianceAccumulator(samples * turned, (self.lens.size[1], self.lens.size[0], 3))
        offsets = self.shutter.exposure_s * ((np.arange(samples * turned) + 0.5) / (samples * turned) - 0.5)
        made: list[RenderPass] = []
        for own in offsets.reshape(samples, turned):
            for bands in itertools.pairwise(edges):
                drawing = self._drawing(bands, own, drawn_px)
                seen = renderer.color(self.state(drawing), drawing.T_world_camera, drawing.K, rows=drawing.rows)
                light = meter.light(seen)
                for places in drawing.places:
                    meter.add(self.rays.rows(*bands), self.rays.fetch(light, places))
                made.append(drawing)

        def drawings() -> list[RenderPass]:
            if samples * turned == 1:
                return made
            return [self._drawing(bands, np.zeros(1), drawn_px) for bands in itertools.pairwise(edges)]

        return CapturedFrame(
            meter.read(),
            self,
            self.flight,
            self.flight.pose(middle),
            self._past.people(middle),
            self._past.bodies(middle),
            drawings,
        )

    def state(self, drawing: RenderPass) -> mujoco.MjData:
        """The scene of a drawing: every part of a moving body where it is when its own row is exposed.

        The camera travels meanwhile: parts go along, on the level, so that soles stay on the ground.
        """
        if self._past.moving.size == 0 or self.shutter.instant:
            self._past.write(self._scratch, 0.0)
            return self._scratch
        first, last = self.shutter.row_s(self.rays.cell_px * np.array(drawing.bands, dtype=np.float64))
        when = np.clip(self._when, first, last) + drawing.sample_s
        self._past.write(self._scratch, when)
        moving, eyes = self._past.moving, self.flight.centres(when)
        # What stands on the ground is carried with it already, by the map of the rays.
        away = self._scratch.geom_xpos[moving] - eyes
        free = 1.0 - np.clip(ground_nearness(away, eyes), 0.0, 1.0)[:, None]
        self._scratch.geom_xpos[moving, :2] += free * (drawing.T_world_camera[:2, 3] - eyes[:, :2])
        return self._scratch

    def at(self, when_s: float) -> mujoco.MjData:
        """The scene at an instant."""
        self._past.write(self._scratch, when_s)
        return self._scratch

    def _own_rows(self) -> Array:
        """`(moving,)` when the row of each moving geom's middle is exposed."""
        flight, moving = self.flight, self._past.moving
        if moving.size == 0 or self.shutter.readout_s == 0.0:
            return np.full(moving.size, self.shutter.middle_s)
        seen = [
            self.lens.pixels(shutters.slopes(self._past.geoms(when)[0], pose, _AHEAD_M))
            for when, pose in flight.followed()
        ]
        when = shutters.meeting(self.shutter, flight.followed_s, np.stack(seen))
        return np.where(np.isfinite(when), when, self.shutter.middle_s)

    def _plan(self, renderer: Renderer) -> tuple[list[int], int, int]:
        """Edges of the runs of bands, drawings over the exposure, and resamplings of each."""
        shutter, whole = self.shutter, self.rays.bands
        if shutter.instant:
            return [0, whole], 1, 1
        focal = float(self.lens.K[1, 1])
        depths = self._probe() if np.ptp(self.flight.poses[:, :3, 3], axis=0).max() > _STILL_M else None
        half, read = 0.5 * shutter.exposure_s, 0.5 * shutter.readout_s
        middle = shutter.middle_s
        runs = samples = turned = 1
        if shutter.readout_s:
            people, spans = self._people_shift(middle - read, middle + read)
            shift = max(self._scenery_shift(depths, middle - read, middle + read), (people * spans).max(initial=0.0))
            runs = int(np.clip(np.ceil(shift / _BAND_PX), 1, min(_MOST_BANDS, whole)))
        if shutter.exposure_s:
            people, _ = self._people_shift(middle - half, middle + half)
            shift = max(self._scenery_shift(depths, middle - half, middle + half), people.max(initial=0.0))
            samples = int(np.clip(np.ceil(shift / _SAMPLE_PX), 1, _MOST_SAMPLES))
            turn = turns.vectors(self.flight.rotations(middle - half).T @ self.flight.rotations(middle + half))
            across = focal * np.hypot(turn[0], turn[1]) + 0.5 * abs(turn[2]) * np.hypot(*self.lens.size)
            count = int(np.clip(np.ceil(across / _TURN_PX), 1, _MOST_TURNS))
            turned = -(-count // samples)
        runs = min(runs, max(1, _MOST_DRAWINGS // samples))
        return [int(edge) for edge in np.linspace(0, whole, runs + 1).round()], samples, turned

    def _people_shift(self, from_s: float, to_s: float) -> tuple[Array, Array]:
        """How far parts of people in view shift [px], beyond the camera's turning, and each one's share of the rows."""
        moving = self._past.moving
        kept = np.flatnonzero(self._people[moving])
        seen: list[Array] = []
        depth = np.zeros(kept.size)
        turn = self.flight.rotations(self.shutter.middle_s)
        for when in (from_s, to_s):
            local = (self._past.geoms(when)[0][kept] - self.flight.centres(when)) @ turn
            depth = local[:, 2]
            seen.append(self.lens.K[0, 0] * local[:, :2] / np.maximum(depth, _AHEAD_M)[:, None])
        size = np.array(self.lens.size)
        inside = (depth > _AHEAD_M) & (np.abs(seen[1]) < 0.75 * size).all(axis=1)
        shift = np.linalg.norm(seen[1] - seen[0], axis=1)[inside]
        reach = 2.0 * self._model.geom_rbound[moving[kept]][inside] * self.lens.K[1, 1] / depth[inside]
        return shift, np.minimum(reach / size[1], 1.0)

    def _probe(self) -> Array:
        """`(N, 3)` points of the scenery all over the view [m]."""
        across, down = (
            (np.arange(count) + 0.5) / count * side for count, side in zip(_PROBES, self.lens.size, strict=True)
        )
        rays = self.lens.slopes(np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2))
        pose = self.flight.pose(self.shutter.middle_s)
        directions = np.column_stack([rays, np.ones(len(rays))]) @ pose[:3, :3].T
        distances, geoms = np.empty(len(rays)), np.empty(len(rays), dtype=np.int32)
        groups = np.zeros(6, dtype=np.uint8)
        groups[SCENERY_GROUP] = 1
        mujoco.mj_multiRay(
            self._model,
            self.at(self.shutter.middle_s),
            pose[:3, 3],
            directions.ravel(),
            groups,
            True,
            -1,
            geoms,
            distances,
            None,
            len(rays),
            mujoco.mjMAXVAL,
        )
        hit = geoms >= 0
        return np.concatenate([pose[:3, 3] + distances[hit, None] * directions[hit], self._nearest_points(pose)])

    def _nearest_points(self, pose: Array) -> Array:
        """`(N, 3)` the nearest point of each thing in view [m]: a pole that slips through between the probes."""
        model, data, own = self._model, self._scratch, self._scenery
        axes = data.geom_xmat[own].reshape(-1, 3, 3)
        middle, half = model.geom_aabb[own, :3], model.geom_aabb[own, 3:]
        eye = np.einsum("nji,nj->ni", axes, pose[:3, 3] - data.geom_xpos[own]) - middle
        points = data.geom_xpos[own] + np.einsum("nij,nj->ni", axes, np.clip(eye, -half, half) + middle)
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        slopes = local[:, :2] / np.maximum(local[:, 2:], _AHEAD_M)
        reach = 0.5 * np.array(self.lens.size) / self.lens.K[(0, 1), (0, 1)]
        return points[(local[:, 2] > _AHEAD_M) & (np.abs(slopes) < reach).all(axis=1)]

    def _scenery_shift(self, points: Array | None, from_s: float, to_s: float) -> float:
        """How far scenery in view shifts [px], beyond the camera's turning and its travel over the ground."""
        if points is None or len(points) == 0:
            return 0.0
        pose = self.flight.pose(self.shutter.middle_s)
        here = points - pose[:3, 3]
        seen: list[Array] = []
        for when in (from_s, to_s):
            eye = self.flight.centres(when)
            away = points - eye
            carried = away + (eye - pose[:3, 3]) * ground_nearness(away, eye)[:, None]
            seen.append(_flat(carried @ pose[:3, :3]) - _flat(here @ pose[:3, :3]))
        return float(self.lens.K[0, 0] * np.linalg.norm(seen[1] - seen[0], axis=1).max())

    def _drawing(self, bands: tuple[int, int], offsets_s: Array, drawn_px: tuple[int, int]) -> RenderPass:
        """A drawing that holds the light of some rows at some offsets from their mid-exposure."""
        if self._through_lens is not None:
            pose = self.flight.poses[0]
            return replace(self._through_lens, T_world_camera=pose)
        sample_s = float(offsets_s.mean())
        first, last = bands
        heights = self.rays.y_px[first : last + 2]
        pose = self.flight.pose(float(self.shutter.row_s(0.5 * (heights[0] + heights[-1]))) + sample_s)
        slopes: list[Array] = []
        for offset in offsets_s:
            when = self.shutter.row_s(heights) if self.shutter.readout_s else np.array(self.shutter.middle_s)
            slopes.append(self.rays.carried(first, last, self.flight.at(when + offset), pose))
        K = framed(self.lens, slopes, drawn_px)
        rows = rows_seen(slopes, K, drawn_px[1])
        places = tuple(self.rays.places(first, last, one, K, rows.start) for one in slopes)
        drawing = RenderPass(bands, sample_s, pose, K, rows, places)
        if self.shutter.instant:
            self._through_lens = drawing
        return drawing


def make_frame_capture(
    settings: ResolvedScenario, model: mujoco.MjModel, K: Array, vibration: Vibration
) -> FrameCapture | None:
    """What takes a scenario's frames; None where each is an instant through a pinhole.

    Args:
        settings: The scenario, every range drawn.
        model: What is drawn.
        K: `(3, 3)` camera matrix [px].
        vibration: Of the camera's mount.

    Raises:
        ScenarioError: A lens that is not invertible over the image.
    """
    axes, camera = settings.axes, settings.camera
    shutter = Shutter(1e-3 * axes.blur.physical, 1e-3 * axes.rolling_shutter.physical, camera.height_px)
    coefficients = axes.distortion.coefficients
    if shutter.instant and not any(coefficients):
        return None
    try:
        lens = Lens(K, coefficients, (camera.width_px, camera.height_px))
    except ParameterError as error:
        raise ScenarioError(repr(settings.title), [f"axes.distortion: {error}"]) from None
    return FrameCapture(model, lens, shutter, vibration)


def _flat(local: Array) -> Array:
    """`(N, 2)` slopes of `(N, 3)` points in camera axes."""
    return np.asarray(local[:, :2] / np.maximum(local[:, 2:], _AHEAD_M))
