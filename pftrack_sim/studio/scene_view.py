"""The scene in a viser server: what stands still with its textures, what moves as boxes and ellipsoids."""

from __future__ import annotations

import importlib
import io
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from pftrack_sim.core.image_files import encode
from pftrack_sim.core.types import BoolArray, FloatArray, IntArray
from pftrack_sim.render.renderer import geoms_drawn
from pftrack_sim.render.triangles import model_triangles
from pftrack_sim.scene.compiled_model import texture_image
from pftrack_sim.scene.layout import SCENERY_GROUP, owner_name
from pftrack_sim.scene.scene_spec import geom_meshes
from pftrack_sim.studio.tracked import Moment

_TRACKED = (40, 190, 90)  # Colour of the ring around the person who is tracked, and of the target's path
_MACHINES, _YELLOW = (60, 90, 140), (255, 200, 0)  # Colours of the robot and carts, and of the camera
_OVERHEAD_M = 2.2  # What begins above is left out, so that one can look into a room from above
_PICTURE_AT_M = 0.8  # Distance of the picture in front of the robot's camera
_MARGIN = 1.08  # Of a view through the camera, around the picture
_FIELD_RAD = math.radians(75.0)
_PATH_M, _RING_M = 0.03, 0.45
_BACK_M, _UP_M = 4.0, 3.0  # Where the view starts behind and above the robot's camera,
_CLEAR_M = 0.4  # and how far from what stands behind it
_PLACE = (np.arange(6) == SCENERY_GROUP).astype(np.uint8)  # Groups of geoms that a ray to the back meets


@dataclass(frozen=True, eq=False)
class _Batch:
    """Geoms of one owner that are drawn with one shape."""

    owner: str
    geoms: IntArray
    centres_m: FloatArray
    handle: Any


class SceneView:
    """The 3D view of a viser server.

    It calls `on_person` with the name of a person who is clicked, `on_picture` with the shares of width and height at
    which the picture is clicked, and `on_box` with such `(4,)` x, y, w, h of a box that is drawn on the picture.
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
        self._pose = np.eye(4)
        self._scene.configure_default_lights(enabled=True, cast_shadow=False)

    def build(self, model: mujoco.MjModel, moment: Moment, people: tuple[str, ...], path_m: FloatArray) -> None:
        """Show another compiled world at a moment, its people, the target first, and the target's `(N, 2)` path [m]."""
        drawn = geoms_drawn(model)
        owners = np.array([owner_name(model.body(int(body)).name) for body in model.geom_bodyid])
        moving = (model.body_weldid[model.geom_bodyid] != 0) | (model.body_mocapid[model.geom_bodyid] >= 0)
        still = drawn & ~moving & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
        self._people = people
        self._model, self._data = model, mujoco.MjData(model)
        self._data.geom_xpos[:], self._data.geom_xmat[:] = moment.geom_m, moment.geom_rotation.reshape(-1, 9)
        self._scene.add_glb("/place", _static_scene(model, moment, still), receive_shadow=False)
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
                    self._batches.append(self._batch(model, owner, shape, geoms, boxes[geoms]))
        self._build_camera(moment)
        self._lines("/path", _on_the_ground(path_m), _TRACKED)
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
            if batch.owner == moment.truth.name:
                self._lines("/ring", _ring(moment.geom_m[batch.geoms].mean(axis=0)[:2]), _TRACKED)
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
        forward, camera = self._forward(), self._pose[:3, 3]
        if not self._batches:
            return camera - 0.3 * forward, camera + _PICTURE_AT_M * forward
        hit_m = mujoco.mj_ray(self._model, self._data, camera, -forward, _PLACE, 1, -1, np.zeros(1, np.int32), None)
        back_m = min(_BACK_M, max(0.0, hit_m - _CLEAR_M)) if hit_m >= 0.0 else _BACK_M
        return camera - back_m * forward + (0.0, 0.0, _UP_M), camera + 3.0 * forward - (0.0, 0.0, 0.4)

    def _forward(self) -> FloatArray:
        """`(3,)` horizontal direction in which the robot's camera looks."""
        forward = self._pose[:3, 2] * (1.0, 1.0, 0.0)
        return forward / max(float(np.linalg.norm(forward)), 1e-6)

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

    def _batch(self, model: mujoco.MjModel, owner: str, shape: str, geoms: IntArray, boxes: FloatArray) -> _Batch:
        is_person = owner in self._people
        trimesh = _trimesh()
        unit = trimesh.creation.box((2.0, 2.0, 2.0)) if shape == "boxes" else trimesh.creation.icosphere(2, 1.0)
        handle = self._scene.add_batched_meshes_simple(
            f"/moving/{owner}/{shape}",
            np.asarray(unit.vertices),
            np.asarray(unit.faces),
            np.tile((1.0, 0.0, 0.0, 0.0), (len(geoms), 1)),
            np.zeros((len(geoms), 3)),
            batched_scales=np.maximum(boxes[:, 1], 1e-3),
            batched_colors=np.array([_mean_colour(model, geom) for geom in geoms]) if is_person else _MACHINES,
            lod="off",
        )
        if is_person:

            def clicked(_: Any) -> None:
                self._on_person(owner)

            handle.on_click(clicked)
        return _Batch(owner, geoms, boxes[:, 0], handle)

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


def _ring(middle_m: FloatArray) -> Any:
    """`(32, 2, 3)` segments around a place on the ground."""
    angles = np.linspace(0.0, 2.0 * np.pi, 33)
    return _on_the_ground(middle_m + _RING_M * np.column_stack([np.cos(angles), np.sin(angles)]))


def _frustum(half_m: FloatArray) -> Any:
    """`(8, 2, 3)` edges of a viewing frustum in camera axes."""
    corners = [(x * half_m[0], y * half_m[1], _PICTURE_AT_M) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    rim = [(one, other) for one, other in zip(corners, [*corners[1:], corners[0]], strict=True)]
    return np.array([*(((0.0, 0.0, 0.0), corner) for corner in corners), *rim], dtype=np.float32)


def _static_scene(model: mujoco.MjModel, moment: Moment, shown: BoolArray) -> bytes:
    """The `(ngeom,)` geoms that are shown and do not move, as a GLB with textures."""
    found = model_triangles(model, shown, geom_meshes(model)[:1])
    parts: dict[tuple[int, tuple[float, ...]], list[tuple[FloatArray, FloatArray]]] = {}
    for geom in np.flatnonzero(shown).tolist():
        vertices = found.vertices[slice(*found.vertex_starts[geom : geom + 2])]
        faces = found.faces[slice(*found.face_starts[geom : geom + 2])]
        placed = vertices @ moment.geom_rotation[geom].T + moment.geom_m[geom]
        if placed[:, 2].min() <= _OVERHEAD_M:
            texture, rgb, uv = _surface(model, geom)
            if uv is None:
                texture, rgb, uv = -1, _mean_colour(model, geom) / 255.0, np.zeros((len(faces), 3, 2))
            parts.setdefault((texture, tuple(rgb)), []).append((placed[faces].reshape(-1, 3), uv.reshape(-1, 2)))
    trimesh, scene = _trimesh(), _trimesh().Scene()
    for (texture, rgb), pieces in parts.items():
        corners, uv = (np.concatenate(one) for one in zip(*pieces, strict=True))
        jpeg = None if texture < 0 else io.BytesIO(encode(texture_image(model, texture), ".jpg"))
        material = trimesh.visual.material.PBRMaterial(
            baseColorFactor=[*rgb, 1.0],
            baseColorTexture=jpeg and importlib.import_module("PIL.Image").open(jpeg),
            metallicFactor=0.0,
            roughnessFactor=1.0,
            doubleSided=True,
        )
        visual = trimesh.visual.TextureVisuals(uv=uv * (1.0, -1.0), material=material)
        faces = np.arange(len(corners)).reshape(-1, 3)
        scene.add_geometry(trimesh.Trimesh(corners, faces, visual=visual, process=False))
    return scene.export(file_type="glb")


def _surface(model: mujoco.MjModel, geom: int) -> tuple[int, FloatArray, FloatArray | None]:
    """A geom's texture, -1 for none; its `(3,)` colour; and `(N, 3, 2)` places of its faces in the texture, if any."""
    material, mesh = int(model.geom_matid[geom]), int(model.geom_dataid[geom])
    rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
    texture = -1 if material < 0 else int(model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB])
    uv = None
    if texture >= 0 and mesh >= 0 and model.mesh_texcoordadr[mesh] >= 0:
        faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
        places = model.mesh_texcoord[model.mesh_texcoordadr[mesh] + model.mesh_facetexcoord[faces]]
        uv = places * model.mat_texrepeat[material]
    return texture, np.clip(rgba[:3], 0.0, 1.0).astype(np.float64), uv


def _mean_colour(model: mujoco.MjModel, geom: int) -> Any:
    """`(3,)` uint8: mean of a geom's texture over its faces, or of the whole texture, times its own colour."""
    texture, rgb, uv = _surface(model, geom)
    if texture < 0:
        return (255.0 * rgb).astype(np.uint8)
    pixels = texture_image(model, texture)
    if uv is not None:
        places = np.mod(uv.mean(axis=1), 1.0) * pixels.shape[1::-1]
        pixels = pixels[places[:, 1].astype(np.intp), places[:, 0].astype(np.intp)]
    return (rgb * pixels.reshape(-1, 3).mean(axis=0)).astype(np.uint8)
