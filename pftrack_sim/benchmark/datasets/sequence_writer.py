"""Write one simulated episode as a sequence of a data set."""

from __future__ import annotations

import math
import shutil
import tarfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np
import scipy  # it imports its packages at first use
from numpy.typing import NDArray

from pftrack_sim.benchmark.asked.plan import Episode
from pftrack_sim.benchmark.kept.tables import table_writer, truth_columns
from pftrack_sim.benchmark.running.rollout import Sample, detected, rollout, simulated
from pftrack_sim.benchmark.running.sinks import video_writer
from pftrack_sim.core.errors import RunError
from pftrack_sim.core.image_files import encode
from pftrack_sim.core.records import Detections, Frame, Image, Truth
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.formats import LAYOUTS, Annotations, PersonBox
from pftrack_sim.formats.images import VIDEO
from pftrack_sim.formats.maps import MapKind, encode_depth, encode_flow, encode_masks
from pftrack_sim.formats.webdataset import SHARD, add_member, sample
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.truth.geometry import SceneGeometry

ImageFormat: TypeAlias = Literal["png", "jpg", "mp4"]
QUALITIES: dict[ImageFormat, tuple[int, range]] = {"jpg": (95, range(1, 101)), "mp4": (18, range(52))}
"""Quality unless another is asked for, and all that are allowed: of JPEG, and H.264's constant rate factor."""
TRUTH = "truth.parquet"
"""Truth of everybody in view, a row per person and frame, beside the images of a sequence."""

# Limits are those of `losses.TAGS`; VOT's own attributes are annotated by hand.
_AROUND_S, _SIZE_FACTOR, _LUMINANCE_FACTOR, _MOTION_SIZES = 0.5, 1.25, 1.3, 0.3
_STEP_M, _TURN_RAD = 0.001, 0.001
"""Least motion of the camera between two frames."""


@dataclass(frozen=True)
class ExportJob:
    """One sequence to write.

    Attributes:
        episode: What is simulated; the robot follows its script.
        quality: Of `QUALITIES`; PNG has none.
    """

    episode: Episode
    folder: Path
    layout: str
    image: ImageFormat = "png"
    quality: int = 0
    maps: tuple[MapKind, ...] = ()
    backend: str | None = None
    number: int = 0
    detections: bool = False


def export_sequence(job: ExportJob) -> None:
    """Write one sequence; its folder appears under its name when it is complete.

    Raises:
        RunError: It cannot be written.
        ScenarioError: The scenario contradicts itself at this seed, or has effects under which a map has no definition.
    """
    part = job.folder.with_name(f".{job.folder.name}.part")
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        with ExitStack() as opened:
            put: Callable[[str, bytes], None] = partial(_put_file, part)
            if LAYOUTS[job.layout].packed:
                shard = opened.enter_context(tarfile.open(part / SHARD, "w", format=tarfile.PAX_FORMAT))
                put = partial(_put_member, shard, job.folder.name)
            simulation = opened.enter_context(Simulation(job.episode.scenario, backend=job.backend))
            settings, film = job.episode.scenario.resolve(job.episode.seed), None
            if job.image == "mp4":
                path = (part / LAYOUTS[job.layout].image).with_name(VIDEO)
                film = opened.enter_context(video_writer(path, settings.camera.rate_hz, job.quality))
            writer = _SequenceWriter(job, part, simulation, put, film)
            samples = simulated(simulation, job.episode.seed)
            if job.detections:
                samples = detected(samples, settings, job.episode.seed)
            rollout(samples, (), [writer.add])
            writer.flush()
        writer.finish()
        part.rename(job.folder)
    except OSError as error:
        raise RunError(f"cannot write {job.folder}: {error.strerror or error}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _put_file(folder: Path, name: str, content: bytes) -> None:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def _put_member(shard: tarfile.TarFile, sequence: str, name: str, content: bytes) -> None:
    add_member(shard, f"{sequence}/{name}", content)


@dataclass
class _SequenceWriter:
    """Writes images and maps as they come, and keeps the truth for the end: a few hundred bytes per person and frame.

    The files of the last frame are held back, because its flow is known only with the next one.
    """

    job: ExportJob
    folder: Path
    simulation: Simulation
    put: Callable[[str, bytes], None]
    film: Callable[[Image, float], None] | None = None
    frames: list[Frame] = field(default_factory=list[Frame])
    people: list[tuple[PersonBox, ...]] = field(default_factory=list[tuple[PersonBox, ...]])
    detections: list[Detections] = field(default_factory=list[Detections])
    identities: dict[str, int] = field(default_factory=dict[str, int])
    held: list[tuple[str, bytes]] = field(default_factory=list[tuple[str, bytes]])
    geometry: SceneGeometry | None = None

    def add(self, shown: Sample) -> None:
        """Take a frame."""
        frame = shown.frame
        assert frame is not None
        # Without its image: only one is ever held.
        no_image = np.empty((0, 0, 3), dtype=np.uint8)
        self.frames.append(Frame(frame.index, frame.time_s, no_image, frame.truth, frame.people))
        self.people.append(self._people(frame))
        if shown.detections is not None:
            self.detections.append(shown.detections)
        if {"depth", "flow"} & set(self.job.maps):
            geometry = self.simulation.scene_geometry()
            if "flow" in self.job.maps and self.geometry is not None:
                self._hold_map("flow", frame.index - 1, encode_flow(*self.geometry.flow_to(geometry)))
            self.geometry = geometry
        self.flush()
        layout = LAYOUTS[self.job.layout]
        name = layout.image.format(frame.index + layout.first)
        if self.film is not None:
            self.film(frame.image, frame.time_s)
        else:
            suffix = f".{self.job.image}"
            options = [cv2.IMWRITE_JPEG_QUALITY, self.job.quality] if self.job.image == "jpg" else []
            self.held.append((name + suffix, encode(frame.image, suffix, *options)))
        if layout.packed:
            text = sample(self.job.folder.name, frame.index, frame.time_s, self.people[-1])
            self.held.append((f"{name}.json", text))
        if self.geometry is not None and "depth" in self.job.maps:
            self._hold_map("depth", frame.index, encode_depth(self.geometry.depth_m))
        if "masks" in self.job.maps:
            identities = np.zeros(frame.image.shape[:2], dtype=np.uint16)
            for one in frame.people:
                identities[self._visible(one, identities.shape)] = self._identity(one.name)
            self._hold_map("masks", frame.index, encode_masks(identities))

    def _hold_map(self, kind: MapKind, index: int, content: bytes) -> None:
        layout = LAYOUTS[self.job.layout]
        name = layout.image.format(index + layout.first)
        self.held.append((f"{name}.{kind}.png" if layout.packed else f"{kind}/{Path(name).name}.png", content))

    def flush(self) -> None:
        """Write what is held back."""
        for name, content in self.held:
            self.put(name, content)
        self.held.clear()

    def _people(self, frame: Frame) -> tuple[PersonBox, ...]:
        """Everybody in view, with what the layout needs."""
        needs, size = LAYOUTS[self.job.layout].needs, frame.image.shape[:2]
        extents = self.simulation.extents_m() if "solids" in needs else {}
        self.identities.setdefault(frame.truth.name, 1)
        return tuple(
            PersonBox(
                self._identity(one.name),
                tuple(one.box.tolist()),
                one.visible_fraction,
                one.truncation,
                tuple(one.visible_box.tolist()) if one.scored else (),
                run_lengths(self._visible(one, size)) if "masks" in needs and one.scored else (),
                _solid(one, extents[one.name]) if one.name in extents else None,
            )
            for one in frame.people
            if one.state != "out_of_view"
        )

    def _visible(self, person: Truth, size: tuple[int, ...]) -> BoolArray:
        """`(H, W)` pixels that show a person."""
        mask = np.zeros(size, dtype=np.bool_)
        silhouette = self.simulation.silhouettes.get(person.name)
        if silhouette is not None and person.scored:
            mask[silhouette.rect.slices] = silhouette.visible
        return mask

    def finish(self) -> None:
        """Write the annotations and the truth."""
        LAYOUTS[self.job.layout].write(self.folder, self._annotations())
        people = [(frame, person) for frame in self.frames for person in frame.people]
        columns: dict[str, Any] = truth_columns([person for _, person in people])
        columns["frame"] = np.array([frame.index for frame, _ in people])
        columns["identity"] = np.array([self._identity(person.name) for _, person in people])
        columns["person"] = np.array([person.name for _, person in people], dtype=object)
        query = (
            "SELECT frame, identity, person, * EXCLUDE (frame, identity, person) FROM people ORDER BY frame, identity"
        )
        with table_writer(people=columns) as write:
            write(self.folder / TRUTH, query)

    def _annotations(self) -> Annotations:
        settings = self.job.episode.scenario.resolve(self.job.episode.seed).viewing
        truths = [frame.truth for frame in self.frames]
        K = truths[0].K
        return Annotations(
            self.job.folder.name,
            settings.camera.rate_hz,
            (settings.camera.width_px, settings.camera.height_px),
            tuple(self.people),
            self.job.number,
            (float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])),
            frame_tags(truths, settings.camera.rate_hz),
            tuple(self.detections),
        )

    def _identity(self, name: str) -> int:
        """1 for the target, then a number for each person in the order of appearance."""
        return self.identities.setdefault(name, len(self.identities) + 1)


def run_lengths(mask: BoolArray) -> tuple[int, ...]:
    """Numbers of pixels that are off and on by turns, column by column, beginning with those that are off.

    >>> run_lengths(np.array([[0, 1], [0, 1], [1, 0]], dtype=bool))
    (2, 3, 1)
    """
    flat = np.concatenate([[False], mask.T.ravel()])
    ends = np.flatnonzero(flat[1:] != flat[:-1])
    return tuple(np.diff(np.concatenate([[0], ends, [mask.size]])).tolist())


def _solid(person: Truth, extents: FloatArray) -> tuple[float, ...]:
    """Height, width, length, middle of the lower face in the camera's frame, turn; see `PersonBox.solid`."""
    low, high = extents
    length, width, height = (high - low).tolist()
    T_camera_person = np.linalg.inv(person.T_world_camera) @ person.T_world_target
    below = np.array([*(0.5 * (low + high))[:2], low[2], 1.0])
    forward = T_camera_person[:3, 0]
    turn = math.atan2(-forward[2], forward[0])
    return (height, width, length, *(T_camera_person @ below)[:3].tolist(), turn)


def frame_tags(truths: Sequence[Truth], rate_hz: float) -> Mapping[str, NDArray[np.bool_]]:
    """For each attribute whether a frame has it.

    Args:
        truths: Of the target, in `N` frames.
        rate_hz: Frames per second.

    Returns:
        `(N,)` flags: `size_change` and `illum_change` are changes by a factor of 1.25 and 1.3 within half a second
        before and after, `motion_change` is motion of the centre by 0.3 sizes, sqrt(w h), since the frame before,
        `camera_motion` a step of 1 mm or a turn of 1 mrad since then.
    """
    size = np.array([np.sqrt(truth.amodal_box[2] * truth.amodal_box[3]) for truth in truths])
    seen = np.array([truth.luminance if truth.visible_fraction > 0.5 else np.nan for truth in truths])
    motion = np.array([truth.image_motion_px for truth in truths])
    poses = np.array([truth.T_world_camera for truth in truths])
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    # The angle of the rotation between two frames: |R - I| = 2 sqrt(2) sin(angle / 2) in the Frobenius norm.
    chords = np.linalg.norm(np.diff(poses[:, :3, :3], axis=0), axis=(1, 2)) / np.sqrt(8.0)
    moved = (steps > _STEP_M) | (chords > np.sin(0.5 * _TURN_RAD))
    reach = 2 * round(_AROUND_S * rate_hz) + 1
    return {
        "size_change": _changes(size, reach, _SIZE_FACTOR),
        "illum_change": _changes(seen, reach, _LUMINANCE_FACTOR),
        "motion_change": np.nan_to_num(motion / size) > _MOTION_SIZES,
        "camera_motion": np.concatenate([[False], moved]),
    }


def _changes(values: FloatArray, reach: int, factor: float) -> BoolArray:
    """`(N,)` whether the largest of the values around is more than `factor` times the least; NaN is left out."""
    unknown = np.isnan(values)
    high = scipy.ndimage.maximum_filter1d(np.where(unknown, -np.inf, values), reach, mode="nearest")
    low = scipy.ndimage.minimum_filter1d(np.where(unknown, np.inf, values), reach, mode="nearest")
    return high > factor * low
