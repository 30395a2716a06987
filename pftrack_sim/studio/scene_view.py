"""The scene as simple geometry in a viser server: what stands still as one mesh, what moves as boxes and ellipsoids."""

from __future__ import annotations

import importlib
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.renderer import geoms_drawn
from pftrack_sim.render.triangles import model_triangles
from pftrack_sim.scene.layout import owner_name
from pftrack_sim.scene.scene_spec import geom_meshes
from pftrack_sim.studio.tracked import Moment

TRACKED, OTHERS, MACHINES = (40, 190, 90), (120, 120, 120), (60, 90, 140)
"""Colours of people, and of the robot and carts; the target's path has the target's."""

_YELLOW = (255, 200, 0)
_OVERHEAD_M = 2.2
"""What begins above is left out, so that one can look into a room from above."""

_PICTURE_AT_M = 0.8
"""Distance of the picture in front of the robot's camera."""

_MARGIN = 1.08
"""Of a view through the camera, around the picture."""

_FIELD_RAD = math.radians(75.0)
_PATH_M = 0.03
_PATTERNED = 0.5
"""Share of a texture on a face, from which on the face has the texture's mean colour."""


@dataclass(frozen=True, eq=False)
class _Batch:
    """Geoms of one owner that are drawn with one shape."""

    owner: str
    geoms: IntArray
    centres_m: FloatArray
    handle: Any


class SceneView:
    """The 3D view of one server.

    Args:
        server: The viser server.
        on_person: Called with the name of a person who is clicked.
        on_picture: Called with the shares of width and height at which the picture is clicked.
        on_box: Called with the `(4,)` x, y, w, h, in shares of width and height, of a box that is drawn on the picture.
    """

    def __init__(
        self,
        server: Any,
        on_person: Callable[[str], None],
        on_picture: Callable[[float, float], None],
        on_box: Callable[[FloatArray], None],
    ):
        self._scene = server.scene
        self._on_person, self._on_picture, self._on_box = on_person, on_picture, on_box
        self._scene.on_rect_select(modifier="shift")(self._drawn)
        self._batches: list[_Batch] = []
        self._people: tuple[str, ...] = ()
        self._tracked = ""
        self._pose = np.eye(4)
        self._scene.configure_default_lights(enabled=True, cast_shadow=False)

    def build(self, model: mujoco.MjModel, moment: Moment, people: tuple[str, ...], path_m: FloatArray) -> None:
        """Show another compiled world.

        Args:
            model: The model.
            moment: A moment in it.
            people: Names, the target's first.
            path_m: `(N, 2)` the target's path.
        """
        drawn = geoms_drawn(model)
        owners = np.array([owner_name(model.body(int(body)).name) for body in model.geom_bodyid])
        moving = (model.body_weldid[model.geom_bodyid] != 0) | (model.body_mocapid[model.geom_bodyid] >= 0)
        still = drawn & ~moving & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
        self._people, self._tracked = people, ""
        self._scene.add_mesh_trimesh("/place", _static_mesh(model, moment, still), receive_shadow=False)
        for old in self._batches:
            old.handle.remove()
        self._batches = []
        boxes = np.asarray(model.geom_aabb, dtype=np.float64).reshape(-1, 2, 3)
        is_box = (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX) | (
            (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH) & ~np.isin(owners, people)
        )
        for owner in dict.fromkeys(owners[drawn & moving].tolist()):
            for shape, chosen in (("boxes", is_box), ("ellipsoids", ~is_box)):
                geoms = np.flatnonzero(drawn & moving & (owners == owner) & chosen)
                if geoms.size:
                    self._batches.append(self._batch(owner, shape, geoms, boxes[geoms], owner in people))
        self._build_camera(moment)
        self._lines("/path", _on_the_ground(path_m), TRACKED)
        self.show(moment)

    def build_recording(self, moment: Moment) -> None:
        """Show the picture of a recording alone, before a camera."""
        self._build_camera(moment)
        self.show(moment)

    def _build_camera(self, moment: Moment) -> None:
        K, (height, width) = moment.truth.K, moment.frame.image.shape[:2]
        half = np.array([width / K[0, 0], height / K[1, 1]]) * 0.5
        self._half_m = half * _PICTURE_AT_M
        self._camera = self._scene.add_frame("/camera", show_axes=False)
        self._scene.add_line_segments(
            "/camera/frustum", _frustum(self._half_m), _YELLOW, thickness=2.0, thickness_units="screen"
        )
        self._picture = self._scene.add_image(
            "/camera/picture", moment.frame.image, *(2.0 * self._half_m), position=(0.0, 0.0, _PICTURE_AT_M)
        )
        self._picture.on_click(self._clicked)

    def show(self, moment: Moment, picture: Any = None) -> None:
        """Show the poses of a moment of this world, and a `(H, W, 3)` picture before the camera."""
        for batch in self._batches:
            rotation = moment.geom_rotation[batch.geoms]
            batch.handle.batched_positions = moment.geom_m[batch.geoms] + np.einsum(
                "nij,nj->ni", rotation, batch.centres_m
            ).astype(np.float32)
            batch.handle.batched_wxyzs = _wxyz(rotation)
        if moment.truth.name != self._tracked:
            self._tracked = moment.truth.name
            for batch in self._batches:
                batch.handle.batched_colors = np.array(self._colour(batch.owner), dtype=np.uint8)
        self._pose = moment.truth.T_world_camera
        self._camera.position = self._pose[:3, 3]
        self._camera.wxyz = _wxyz(self._pose[None, :3, :3])[0]
        if picture is not None:
            self._picture.image = picture

    def show_trail(self, points_m: FloatArray) -> None:
        """Show the `(N, 2)` way of the camera so far."""
        if len(points_m) > 1:
            self._lines("/trail", _on_the_ground(points_m), _YELLOW)

    def _lines(self, name: str, segments_m: Any, colour: tuple[int, int, int]) -> None:
        self._scene.add_line_segments(name, segments_m, colour, thickness=3.0, thickness_units="screen")

    def overview(self) -> tuple[FloatArray, FloatArray]:
        """A place to look from and a point to look at: behind and above the robot, or before a picture."""
        forward = np.array([self._pose[0, 2], self._pose[1, 2], 0.0])
        forward /= max(float(np.linalg.norm(forward)), 1e-6)
        camera = self._pose[:3, 3]
        if not self._batches:
            return camera - 0.3 * forward, camera + _PICTURE_AT_M * forward
        return camera - 4.0 * forward + (0.0, 0.0, 3.0), camera + 3.0 * forward - (0.0, 0.0, 0.4)

    def look_through(self, client: Any) -> None:
        """Let a client look through the robot's camera, so that the picture fills the view."""
        camera = client.camera
        half_m = max(self._half_m[1], self._half_m[0] / camera.aspect)
        camera.up_direction = -self._pose[:3, 1]
        camera.position = self._pose[:3, 3]
        camera.look_at = self._pose[:3, 3] + _PICTURE_AT_M * self._pose[:3, 2]
        camera.fov = 2.0 * math.atan(_MARGIN * half_m / _PICTURE_AT_M)

    def _look_over(self, client: Any) -> None:
        """Let a client look from behind the robot, as at the start."""
        place, towards = self.overview()
        client.camera.up_direction, client.camera.fov = (0.0, 0.0, 1.0), _FIELD_RAD
        client.camera.position, client.camera.look_at = place, towards

    def _batch(self, owner: str, shape: str, geoms: IntArray, boxes: FloatArray, clickable: bool) -> _Batch:
        trimesh = _trimesh()
        unit = trimesh.creation.box((2.0, 2.0, 2.0)) if shape == "boxes" else trimesh.creation.icosphere(2, 1.0)
        handle = self._scene.add_batched_meshes_simple(
            f"/moving/{owner}/{shape}",
            np.asarray(unit.vertices),
            np.asarray(unit.faces),
            np.tile((1.0, 0.0, 0.0, 0.0), (len(geoms), 1)),
            np.zeros((len(geoms), 3)),
            batched_scales=np.maximum(boxes[:, 1], 1e-3),
            batched_colors=self._colour(owner),
            lod="off",
        )
        if clickable:

            def clicked(_: Any) -> None:
                self._on_person(owner)

            handle.on_click(clicked)
        return _Batch(owner, geoms, boxes[:, 0], handle)

    def _colour(self, owner: str) -> tuple[int, int, int]:
        return MACHINES if owner not in self._people else TRACKED if owner == self._tracked else OTHERS

    def _clicked(self, event: Any) -> None:
        if (at := self._on_plane(np.array(event.ray_origin), np.array(event.ray_direction))) is not None:
            self._on_picture(*at.tolist())

    def _drawn(self, event: Any) -> None:
        """Project a rectangle of a client's view onto the picture."""
        camera = event.client.camera
        rotation = Rotation.from_quat(camera.wxyz, scalar_first=True).as_matrix()
        half = math.tan(0.5 * camera.fov) * np.array([camera.aspect, 1.0])
        corners: list[FloatArray] = []
        for screen in itertools.product(*zip(event.screen_min, event.screen_max, strict=True)):
            direction = rotation @ np.append((2.0 * np.array(screen) - 1.0) * half, 1.0)
            at = self._on_plane(np.array(camera.position), direction)
            if at is None:
                return
            corners.append(at)
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        self._on_box(np.concatenate([low, high - low]))
        if self._batches and np.linalg.norm(np.array(camera.position) - self._pose[:3, 3]) < _PICTURE_AT_M:
            self._look_over(event.client)  # the robot's head will be in the way

    def _on_plane(self, origin: FloatArray, direction: FloatArray) -> FloatArray | None:
        """`(2,)` shares of width and height at which a ray in the world meets the picture's plane, or None."""
        to_camera = np.linalg.inv(self._pose)
        start, along = to_camera[:3, :3] @ origin + to_camera[:3, 3], to_camera[:3, :3] @ direction
        if abs(along[2]) < 1e-9:
            return None
        distance = (_PICTURE_AT_M - start[2]) / along[2]
        return 0.5 + 0.5 * (start + along * distance)[:2] / self._half_m if distance > 0.0 else None


def _trimesh() -> Any:
    """The module trimesh, which viser brings."""
    return importlib.import_module("trimesh")


def _wxyz(rotation: Any) -> Any:
    return Rotation.from_matrix(rotation).as_quat(scalar_first=True).astype(np.float32)


def _on_the_ground(points_m: FloatArray) -> Any:
    """`(N - 1, 2, 3)` segments between `(N, 2)` points, just above the ground."""
    points = np.column_stack([points_m, np.full(len(points_m), _PATH_M)]).astype(np.float32)
    return np.stack([points[:-1], points[1:]], axis=1)


def _frustum(half_m: FloatArray) -> Any:
    """`(8, 2, 3)` edges of a viewing frustum in camera axes."""
    corners = [(x * half_m[0], y * half_m[1], _PICTURE_AT_M) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    rim = [(one, other) for one, other in zip(corners, [*corners[1:], corners[0]], strict=True)]
    return np.array([*(((0.0, 0.0, 0.0), corner) for corner in corners), *rim], dtype=np.float32)


def _static_mesh(model: mujoco.MjModel, moment: Moment, shown: BoolArray) -> Any:
    """One mesh of the `(ngeom,)` geoms that are shown and do not move, with a colour for each face."""
    found = model_triangles(model, shown, geom_meshes(model)[:1])
    corners: list[FloatArray] = []
    colours: list[Any] = []
    means: dict[int, Any] = {}
    for geom in np.flatnonzero(shown).tolist():
        vertices = found.vertices[slice(*found.vertex_starts[geom : geom + 2])]
        faces = found.faces[slice(*found.face_starts[geom : geom + 2])]
        placed = vertices @ moment.geom_rotation[geom].T + moment.geom_m[geom]
        if placed[:, 2].min() <= _OVERHEAD_M:
            corners.append(placed[faces].reshape(-1, 3))
            colours.append(np.repeat(_face_colours(model, geom, len(faces), means), 3, axis=0))
    every = np.concatenate(corners)
    faces = np.arange(len(every)).reshape(-1, 3)
    return _trimesh().Trimesh(every, faces, vertex_colors=np.concatenate(colours), process=False)


def _face_colours(model: mujoco.MjModel, geom: int, count: int, means: dict[int, Any]) -> Any:
    """`(count, 4)` uint8: the texture at the middle of each face, or the geom's own colour.

    Mean colours of textures, which many geoms share, are kept in `means`.
    """
    material = int(model.geom_matid[geom])
    rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
    plain = np.tile(np.array(255.0 * np.clip(rgba, 0.0, 1.0), dtype=np.uint8), (count, 1))
    plain[:, 3] = 255
    texture = -1 if material < 0 else int(model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB])
    mesh = int(model.geom_dataid[geom])
    if texture < 0:
        return plain
    width, height, channels = model.tex_width[texture], model.tex_height[texture], model.tex_nchannel[texture]
    start = int(model.tex_adr[texture])
    pixels = model.tex_data[start : start + width * height * channels].reshape(height, width, channels)[..., :3]
    if texture not in means:
        means[texture] = np.array(cv2.mean(np.ascontiguousarray(pixels))[:3], dtype=np.uint8)
    if mesh < 0 or model.mesh_texcoordadr[mesh] < 0:
        plain[:, :3] = means[texture]
        return plain
    face, first = model.mesh_faceadr[mesh], model.mesh_texcoordadr[mesh]
    uv = model.mesh_texcoord[first + model.mesh_facetexcoord[face : face + count]]
    spread = (np.ptp(uv, axis=1) * model.mat_texrepeat[material]).max(axis=1)
    middle = np.mod(uv.mean(axis=1) * model.mat_texrepeat[material], 1.0)
    columns = np.minimum((middle[:, 0] * width).astype(np.intp), width - 1)
    rows = np.minimum((middle[:, 1] * height).astype(np.intp), height - 1)
    plain[:, :3] = pixels[rows, columns]
    # One place of a pattern says nothing about a large face.
    plain[spread >= _PATTERNED, :3] = means[texture]
    return plain
