"""Exact truth of everyone in view, frame by frame: boxes, visibility, who covers whom, poses, motion, light."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.camera import shapes
from pftrack_sim.camera.extents import Bodies
from pftrack_sim.camera.outlines import Outlines
from pftrack_sim.camera.pinhole import camera_matrix
from pftrack_sim.camera.shapes import Shape
from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.photometry import LUMINANCE
from pftrack_sim.core.records import Image, State, Truth
from pftrack_sim.render.backend import Renderer
from pftrack_sim.render.capture.frame_capture import CapturedFrame
from pftrack_sim.scene.layout import PEOPLE_GROUP, owner_name
from pftrack_sim.truth.silhouettes import Silhouette, Silhouettes, pixels_around
from pftrack_sim.truth.tracing import Traced, trace

Array = NDArray[np.float64]

_NO_DISTORTION = np.zeros(5)
_NO_DISTORTION.setflags(write=False)


class TruthObserver:
    """Truth of the people of one model; remembers the previous frame, for their motion in the image.

    A person is every geom of the people's group on bodies named `"<name>/..."`, one of them `"<name>/pelvis"`.

    Args:
        model: The model the renderer draws.
        people: Names, the target's first.
        renderer: Draws ids; it is bound to the model.
        K: `(3, 3)` camera matrix [px], or a vertical field of view [rad].
        size: Width and height of the images, where the renderer draws them with a margin; None: what it draws.

    Raises:
        ParameterError: No people, a name without a pelvis or without geoms, or a camera matrix that is none.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        people: Sequence[str],
        renderer: Renderer,
        K: ArrayLike | float,
        size: tuple[int, int] | None = None,
    ) -> None:
        if not people:
            raise ParameterError("truth needs the name of at least one person, the target's first")
        self._renderer = renderer
        self._size = size if size is not None else (renderer.width_px, renderer.height_px)
        self._K = camera_matrix(K, *self._size)
        self._people = tuple(people)
        self._owners = [owner_name(model.body(body).name) for body in range(model.nbody)]
        self._body_of_geom = np.array(model.geom_bodyid, dtype=np.intp)
        person_of = {name: index for index, name in enumerate(self._people)}
        of_body = np.array([person_of.get(owner, -1) for owner in self._owners], dtype=np.intp)
        in_group = np.asarray(model.geom_group) == PEOPLE_GROUP
        person_of_geom = np.where(in_group & renderer.visible_geoms, of_body[self._body_of_geom], -1)
        self._pelvis = np.array([_pelvis(model, name) for name in self._people], dtype=np.intp)
        geoms = [np.flatnonzero(person_of_geom == person) for person in range(len(self._people))]
        for name, own in zip(self._people, geoms, strict=True):
            if own.size == 0:
                raise ParameterError(f"{name!r} has no visible geoms of group {PEOPLE_GROUP} to be seen by")
        self._geoms = np.concatenate(geoms)
        self._bodies = Bodies([[_shape(model, int(geom)) for geom in own] for own in geoms])
        self._outlines: Outlines | None = None
        self._silhouettes = Silhouettes(model, person_of_geom, renderer.visible_geoms)
        self._previous: Array | None = None

    def reset(self) -> None:
        """Forget the previous frame."""
        self._previous = None

    def observe(
        self,
        data: mujoco.MjData,
        T_world_camera: ArrayLike,
        image: Image,
        time_s: float,
        T_world_people: ArrayLike,
    ) -> tuple[Truth, ...]:
        """Truth of the next frame.

        Args:
            data: Positions at the instant of the frame, up to date.
            T_world_camera: `(4, 4)` camera pose, OpenCV axes.
            image: `(H, W, 3)` the frame, for its luminance.
            time_s: Time of the frame since the start of the episode.
            T_world_people: `(P, 4, 4)` root poses in the order of the people: origin on the ground below the pelvis,
                x forward, z up.

        Returns:
            The target, then everyone else with a pixel inside the image (covered or not), in the order of the people.

        Raises:
            ParameterError: Poses or an image of the wrong shape.
        """
        pose = np.asarray(T_world_camera, dtype=np.float64)
        self._check(image, T_world_people)
        limbs = data.geom_xpos[self._geoms], data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        amodal, depths = self._bodies.boxes(*limbs, pose, self._K, self._renderer.near_m)
        rects = {
            person: rect for person, box in enumerate(amodal) if (rect := pixels_around(box, self._size)) is not None
        }
        lowest = self._bodies.lowest(*limbs)
        found = self._silhouettes.find(self._renderer, data, pose, self._K, rects, depths[:, 1], lowest)
        everybody = Traced(amodal, amodal, found)
        return self._written(everybody, image, time_s, pose, T_world_people, data.xpos, _NO_DISTORTION)

    def observe_taken(self, taken: CapturedFrame, image: Image, time_s: float) -> tuple[Truth, ...]:
        """Truth of the next frame, taken by an `FrameCapture`: with a lens, over an exposure, row by row.

        Args:
            taken: How it was taken.
            image: `(H, W, 3)` the frame, for its luminance.
            time_s: Time of the frame since the start of the episode.

        Returns:
            As `observe`; poses and distances are those at mid-exposure of the middle row.

        Raises:
            ParameterError: Poses or an image of the wrong shape.
        """
        self._check(image, taken.T_world_people)
        if self._outlines is None:
            self._outlines = Outlines(self._bodies.shapes)
        everybody = trace(taken, self._renderer, self._bodies, self._outlines, self._geoms, self._silhouettes)
        distortion = taken.capture.lens.coefficients
        return self._written(
            everybody, image, time_s, taken.T_world_camera, taken.T_world_people, taken.body_positions, distortion
        )

    def _check(self, image: Image, T_world_people: ArrayLike) -> None:
        people, shape = len(self._people), np.shape(T_world_people)
        if shape != (people, 4, 4):
            raise ParameterError(f"T_world_people must have shape ({people}, 4, 4), got {shape}")
        width, height = self._size
        if image.shape != (height, width, 3):
            raise ParameterError(f"the image must have shape ({height}, {width}, 3), got {image.shape}")

    def _written(
        self,
        everybody: Traced,
        image: Image,
        time_s: float,
        pose: Array,
        T_world_people: ArrayLike,
        bodies: Array,
        distortion: Array,
    ) -> tuple[Truth, ...]:
        """The records, from boxes and pixels."""
        width, height = self._size
        amodal, found = everybody.amodal, everybody.found
        roots = np.asarray(T_world_people, dtype=np.float64)
        motion = self._motion(amodal)
        distance = np.linalg.norm(bodies[self._pelvis] - pose[:3, 3], axis=1)
        truths: list[Truth] = []
        for person, name in enumerate(self._people):
            silhouette = found.get(person)
            inside = int(np.count_nonzero(silhouette.amodal)) if silhouette is not None else 0
            if person and not inside:
                continue
            seen = _Seen(silhouette, inside, image)
            truths.append(
                Truth(
                    name=name,
                    box=_box_inside(amodal[person], width, height, empty=not inside),
                    amodal_box=amodal[person],
                    visible_box=seen.box,
                    swept_box=everybody.swept[person],
                    visible_fraction=seen.fraction,
                    truncation=_truncation(amodal[person], width, height),
                    state=seen.state,
                    occluders=self._names(silhouette),
                    distance_m=float(distance[person]),
                    T_world_camera=pose,
                    T_world_target=roots[person],
                    K=self._K,
                    distortion=distortion,
                    time_s=float(time_s),
                    image_motion_px=float(motion[person]),
                    luminance=seen.luminance,
                )
            )
        return tuple(truths)

    def _motion(self, amodal: Array) -> Array:
        """`(P,)` displacement of the boxes' centres since the last frame [px]; remembers this one."""
        centres = amodal[:, :2] + 0.5 * amodal[:, 2:]
        previous, self._previous = self._previous, centres
        return np.zeros(len(centres)) if previous is None else np.linalg.norm(centres - previous, axis=1)

    def _names(self, silhouette: Silhouette | None) -> tuple[str, ...]:
        """Who covers a person, most pixels first; by name where equal."""
        covering = silhouette.covering() if silhouette is not None else np.empty(0, dtype=np.int32)
        if covering.size == 0:
            return ()
        counts: dict[str, int] = {}
        geoms, pixels = np.unique(covering, return_counts=True)
        for geom, count in zip(geoms, pixels, strict=True):
            owner = self._owners[self._body_of_geom[geom]]
            counts[owner] = counts.get(owner, 0) + int(count)
        return tuple(sorted(counts, key=lambda owner: (-counts[owner], owner)))


class _Seen:
    """What can be told of a person from pixels."""

    def __init__(self, silhouette: Silhouette | None, inside: int, image: Image) -> None:
        self.box = boxes.NO_BOX
        self.fraction = 0.0
        self.luminance = float("nan")
        self.state: State = "occluded" if inside else "out_of_view"
        if silhouette is None or not silhouette.visible.any():
            return
        rect, visible = silhouette.rect, silhouette.visible.view(np.uint8)
        left, top, width, height = cv2.boundingRect(visible)
        self.box = np.array([rect.left + left, rect.top + top, width, height], dtype=np.float64)
        self.fraction = int(np.count_nonzero(visible)) / inside
        self.luminance = float(np.dot(cv2.mean(image[rect.slices], visible)[:3], LUMINANCE)) / 255.0
        self.state = "visible"


def _pelvis(model: mujoco.MjModel, name: str) -> int:
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"{name}/pelvis")
    if body < 0:
        raise ParameterError(f"no body '{name}/pelvis' in the model: {name!r} is nobody")
    return body


def _shape(model: mujoco.MjModel, geom: int) -> Shape:
    """The shape of a geom in its own frame.

    Raises:
        ParameterError: A plane or height field: nobody consists of these.
    """
    kind, size = mujoco.mjtGeom(int(model.geom_type[geom])), np.asarray(model.geom_size[geom])
    match kind:
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return shapes.sphere(float(size[0]))
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return shapes.capsule(float(size[0]), float(size[1]))
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return shapes.cylinder(float(size[0]), float(size[1]))
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return shapes.ellipsoid(size)
        case mujoco.mjtGeom.mjGEOM_BOX:
            return shapes.cuboid(size)
        case mujoco.mjtGeom.mjGEOM_MESH:
            mesh = int(model.geom_dataid[geom])
            first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            return shapes.hull(model.mesh_vert[first : first + count])
        case _:
            raise ParameterError(f"geom {model.geom(geom).name!r} of a person has type {kind.name}, which has no box")


def _box_inside(amodal: Array, width_px: int, height_px: int, *, empty: bool) -> Array:
    """The amodal box clipped to the image; of no size for a person without a pixel inside."""
    if not np.isfinite(amodal).all():
        return np.zeros(4)
    box = boxes.clip(amodal, width_px, height_px)
    if empty:
        box[2:] = 0.0
    return box


def _truncation(amodal: Array, width_px: int, height_px: int) -> float:
    """Share of the amodal box's area outside the image; 1 when nothing is in front of the camera."""
    whole = boxes.area(amodal)
    if whole == 0.0:
        return 1.0
    return min(1.0, max(0.0, 1.0 - boxes.area(boxes.clip(amodal, width_px, height_px)) / whole))
