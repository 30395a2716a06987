"""Exact truth of all people in view, frame by frame."""

from __future__ import annotations

import math
import weakref
from collections.abc import Sequence
from typing import NamedTuple, cast

import cv2
import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.camera.pinhole import focal_and_centre
from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.core.photometry import LUMINANCE
from pftrack_sim.core.records import DeferredPeople, Image, State, Truth, frozen_array
from pftrack_sim.core.types import FloatArray, read_only
from pftrack_sim.render.capture.frame_capture import CapturedFrame
from pftrack_sim.render.culling import PixelRect, View
from pftrack_sim.render.renderer import checked_poses
from pftrack_sim.render.segmentation import Segmenter
from pftrack_sim.scene.layout import PEOPLE_GROUP, body_owners
from pftrack_sim.scene.thing import BODY
from pftrack_sim.truth.captured import CapturedScene
from pftrack_sim.truth.geometry import SceneGeometry
from pftrack_sim.truth.silhouettes import InstantScene, PeopleInView, Scene, Shapes, Silhouette, poses_of

_NO_DISTORTION = read_only(np.zeros(5))


class _Frame(NamedTuple):
    """What is known of one frame, see `observe`; `target` is the index of a person, `pelvis_m` `(P, 3)`."""

    target: int
    scene: Scene
    image: Image | None
    pelvis_m: FloatArray
    T_world_people: FloatArray
    T_world_camera: FloatArray
    distortion: FloatArray
    time_s: float


class TruthObserver:
    """Truth of the people of one model; keeps the boxes of the last frame, for the image motion.

    A person is every geom of the people's group on bodies named `"<name>/..."`, one of them `"<name>/pelvis"`; a thing
    that is tracked has `"<name>/body"` alone.

    Args:
        model: The model.
        people: Names, the target's first.
        K: `(3, 3)` camera matrix [px].
        size: Width and height of the images.
        parts: Names of the parts that the target's boxes enclose; empty for the whole body.
        targets: Names of further targets, of whom truth is told also out of view; so is the first one's with them.

    Raises:
        ParameterError: No people, a person without a pelvis or visible geoms, or an invalid camera matrix.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        people: Sequence[str],
        K: ArrayLike,
        size: tuple[int, int],
        parts: Sequence[str] = (),
        targets: Sequence[str] = (),
    ) -> None:
        if not people:
            raise ParameterError("truth needs the name of at least one person, the target's first")
        focal_and_centre(K)  # Raises for what is no camera matrix.
        self._size, self._K = size, frozen_array(K)
        self._people = tuple(people)
        owners = np.array(body_owners(model))
        geom_owners = owners[model.geom_bodyid]
        names, self._owner_ids = np.unique(geom_owners, return_inverse=True)
        self._owner_names: list[str] = names.tolist()
        self._segmenter = Segmenter(model)
        in_group = (np.asarray(model.geom_group) == PEOPLE_GROUP) & self._segmenter.drawn
        geoms = [np.flatnonzero(in_group & (geom_owners == name)) for name in self._people]
        self._pelvis = np.array([_pelvis(model, name) for name in self._people], dtype=np.intp)
        for name, ids in zip(self._people, geoms, strict=True):
            if ids.size == 0:
                raise ParameterError(f"{name!r} has no visible geoms of group {PEOPLE_GROUP}")
        bodies = [model.body(f"{people[0]}/{part}").id for part in parts]
        boxed = np.flatnonzero(in_group & np.isin(model.geom_bodyid, bodies))
        self._shapes = Shapes(model, self._segmenter, geoms, boxed)
        self._target = 0
        self._told = {self._people.index(name) for name in (people[0], *targets)} if targets else set[int]()
        self._last: PeopleInView | None = None  # Of the last frame
        self._unread = weakref.WeakValueDictionary[float, DeferredPeople]()

    @property
    def silhouettes(self) -> dict[str, Silhouette]:
        """Silhouettes in the last frame, by person, of those who may have a pixel in it."""
        found = {} if self._last is None else {name: self._last.silhouette(k) for k, name in enumerate(self._people)}
        return {name: silhouette for name, silhouette in found.items() if silhouette is not None}

    def depth_m(self) -> NDArray[np.float32]:
        """`(H, W)` depth along the optical axis of what each pixel of the last frame shows; infinite for nothing."""
        assert self._last is not None
        return self._last.scene.segment(PixelRect(0, 0, *self._size), np.flatnonzero(self._segmenter.drawn)).depth_m()

    def track(self, name: str) -> None:
        """Tell of this person as the target from the next frame on.

        Raises:
            UnknownNameError: There is no such person.
        """
        if name not in self._people:
            raise UnknownNameError("person", name, self._people)
        self._target = self._people.index(name)

    def finish(self) -> None:
        """Find all people of frames that are still referenced, whose poses would otherwise be kept with them."""
        for people in list(self._unread.values()):
            _ = people.everybody

    def observe(
        self,
        data: mujoco.MjData,
        T_world_camera: ArrayLike,
        image: Image | None,
        time_s: float,
        T_world_people: ArrayLike,
    ) -> Sequence[Truth]:
        """Truth of the next frame, taken at an instant through a pinhole.

        Args:
            data: Positions at the time of the frame, up to date.
            T_world_camera: `(4, 4)` camera pose, OpenCV axes.
            image: `(H, W, 3)` the frame, for its luminance; None where there is none: the luminance is NaN.
            time_s: Time of the frame since the start of the episode.
            T_world_people: `(P, 4, 4)` root poses in the order of the people: origin on the ground below the pelvis,
                x forward, z up.

        Returns:
            The target, then further targets and all with an amodal pixel in the image, in the order of the people. All
            but the target are found when they are first asked for.

        Raises:
            ParameterError: Poses or an image of the wrong shape.
        """
        self._check(image, T_world_people)
        pose, roots = frozen_array(checked_poses(T_world_camera), (4, 4)), np.array(T_world_people, dtype=np.float64)
        scene = InstantScene(self._segmenter, self._shapes.bounds, self._view(data, pose))
        pelvis_m = data.xpos[self._pelvis]
        return self._observe(_Frame(self._target, scene, image, pelvis_m, roots, pose, _NO_DISTORTION, float(time_s)))

    def observe_captured(self, captured: CapturedFrame, image: Image | None, time_s: float) -> Sequence[Truth]:
        """Truth of the next frame, taken by a `FrameCapture`; poses and distances are at `middle_s` of its shutter.

        Image, time, result and errors are those of `observe`.
        """
        roots = np.asarray(captured.T_world_people, dtype=np.float64)
        self._check(image, roots)
        pose, distortion = frozen_array(captured.T_world_camera, (4, 4)), captured.capture.lens.coefficients
        scene = CapturedScene(self._segmenter, self._shapes.bounds, captured)
        pelvis_m = captured.body_positions[self._pelvis]
        return self._observe(_Frame(self._target, scene, image, pelvis_m, roots, pose, distortion, float(time_s)))

    def _observe(self, frame: _Frame) -> Sequence[Truth]:
        view, before = PeopleInView(self._shapes, frame.scene, self._size), self._last
        self._last = view

        def others() -> tuple[Truth, ...]:
            rest = (person for person in range(len(self._people)) if person != frame.target)
            found = (self._truth(frame, person, view, before) for person in rest)
            return tuple(one for one in found if one is not None)

        target = cast("Truth", self._truth(frame, frame.target, view, before))
        people = self._unread[frame.time_s] = DeferredPeople(target, others)
        return people

    def extents_m(self, data: mujoco.MjData, T_world_people: ArrayLike) -> FloatArray:
        """`(P, 2, 3)` smallest and largest coordinates of each person's body in its own frame, by its root pose."""
        roots = np.asarray(T_world_people, dtype=np.float64)
        positions, rotations = poses_of(data, self._shapes.geoms)
        bodies, ends = self._shapes.bodies, list[tuple[FloatArray, FloatArray]]()
        starts = [*bodies.starts, len(bodies.vertices)]
        for root, first, last in zip(roots, starts, starts[1:], strict=False):
            world = [bodies.vertices[part] @ rotations[part].T + positions[part] for part in range(first, last)]
            local = (np.concatenate(world) - root[:3, 3]) @ root[:3, :3]
            ends.append((local.min(axis=0), local.max(axis=0)))
        return np.array(ends)

    def scene_geometry(self, data: mujoco.MjData, T_world_camera: FloatArray) -> SceneGeometry:
        """What every pixel of an image through a pinhole shows, from a `(4, 4)` camera pose, and how far it is."""
        view = self._view(data, T_world_camera)
        drawn = self._segmenter.segment(view, PixelRect(0, 0, *self._size))
        return SceneGeometry(drawn.ids, drawn.depth_m().astype(np.float64), view)

    def _view(self, data: mujoco.MjData, pose: FloatArray) -> View:
        return View(data.geom_xpos.copy(), data.geom_xmat.copy(), pose, self._K, self._segmenter.near_m)

    def _check(self, image: Image | None, T_world_people: ArrayLike) -> None:
        people, shape = len(self._people), np.shape(T_world_people)
        if shape != (people, 4, 4):
            raise ParameterError(f"T_world_people must have shape ({people}, 4, 4), got {shape}")
        width, height = self._size
        if image is not None and image.shape != (height, width, 3):
            raise ParameterError(f"the image must have shape ({height}, {width}, 3), got {image.shape}")

    def _truth(self, frame: _Frame, person: int, view: PeopleInView, before: PeopleInView | None) -> Truth | None:
        """Truth of a person; None for others than targets without an amodal pixel in the image."""
        silhouette, (amodal, swept) = view.silhouette(person), view.boxes(person)
        box, truncation = _clipped(amodal, *self._size)
        inside = 0 if silhouette is None else int(np.count_nonzero(silhouette.amodal))
        # Of a target selected by its trunk, the trunk's box may be outside the image while a leg is inside.
        present = bool(inside and box[2] * box[3])
        if not inside and person != frame.target and person not in self._told:
            return None
        visible_box, fraction, luminance = boxes.NO_BOX, 0.0, float("nan")
        seen = int(np.count_nonzero(silhouette.visible)) if silhouette is not None and inside else 0
        state: State = "out_of_view" if not present else "visible" if seen else "occluded"
        if silhouette is not None and seen:
            rect, visible = silhouette.rect, silhouette.visible.view(np.uint8)
            left, top, *visible_size = cv2.boundingRect(visible)
            visible_box = np.array([rect.left + left, rect.top + top, *visible_size], dtype=np.float64)
            fraction = seen / inside
            if frame.image is not None:
                luminance = float(np.dot(cv2.mean(frame.image[rect.slices], visible)[:3], LUMINANCE)) / 255.0
        if not present:
            box[2:] = 0.0
        box.setflags(write=False)
        motion_px = 0.0 if before is None else math.dist(_centre(amodal), _centre(before.boxes(person)[0]))
        return Truth(
            name=self._people[person],
            box=box,
            amodal_box=frozen_array(amodal),
            swept_box=frozen_array(swept),
            visible_box=visible_box,
            visible_fraction=fraction,
            truncation=truncation,
            state=state,
            occluders=() if silhouette is None or (inside and seen == inside) else self._occluders(silhouette),
            distance_m=math.dist(frame.pelvis_m[person].tolist(), frame.T_world_camera[:3, 3].tolist()),
            T_world_camera=frame.T_world_camera,
            T_world_target=frozen_array(frame.T_world_people[person]),
            K=self._K,
            distortion=frame.distortion,
            time_s=frame.time_s,
            image_motion_px=motion_px,
            luminance=luminance,
        )

    def _occluders(self, silhouette: Silhouette) -> tuple[str, ...]:
        """Names of what occludes a person, by number of pixels, then by name."""
        counts = np.bincount(self._owner_ids[silhouette.occluding_geoms()], minlength=len(self._owner_names)).tolist()
        names = ((-count, name) for count, name in zip(counts, self._owner_names, strict=True) if count)
        return tuple(name for _, name in sorted(names))


def _pelvis(model: mujoco.MjModel, name: str) -> int:
    for part in ("pelvis", BODY):
        body = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"{name}/{part}"))
        if body >= 0:
            return body
    raise ParameterError(f"the model has no body '{name}/pelvis'")


def _centre(box: FloatArray) -> tuple[float, float]:
    x, y, w, h = box.tolist()
    return x + 0.5 * w, y + 0.5 * h


def _clipped(amodal: FloatArray, width_px: int, height_px: int) -> tuple[FloatArray, float]:
    """Amodal box clipped to the image, and the share of its area outside; an empty box and 1 behind the camera."""
    if not all(map(math.isfinite, amodal.tolist())):
        return np.zeros(4), 1.0
    box, area = boxes.clip(amodal, width_px, height_px), boxes.area(amodal)
    return box, min(1.0, max(0.0, 1.0 - boxes.area(box) / area)) if area > 0.0 else 1.0
