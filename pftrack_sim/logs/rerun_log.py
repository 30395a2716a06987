"""Rerun recordings (`.rrd`) with a layout of views; library: `rerun-sdk`.

Entities: `world/camera` with the image and the boxes on it, `world/robot` and everybody in view, the paths of robot and
target (whole, at all times), and plots of overlap and time per tracker. The only timeline is `time`, in seconds of
simulated time.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim.core.errors import RunError
from pftrack_sim.core.palette import styles_of
from pftrack_sim.core.text import one_line
from pftrack_sim.core.types import FloatArray
from pftrack_sim.logs.frame import LogFrame, LogInfo, encode_jpeg, topics_of

_TRUTH_COLOUR = (0, 200, 0)
_ARROW_M = 0.5


@contextmanager
def writer(path: Path, info: LogInfo) -> Generator[Callable[[LogFrame], None]]:
    """See `logs.log_writer`."""
    library: Any = importlib.import_module("rerun")
    stream = library.RecordingStream("pftrack-sim", recording_id=info.name)
    stream.set_log_time_enabled(False)
    with _write_errors(path):
        stream.save(path, default_blueprint=_blueprint(library.blueprint))
    log = _Log(library, stream, info)
    try:
        yield log.add
        log.finish()
        with _write_errors(path):
            stream.flush()
    finally:
        stream.disconnect()


@contextmanager
def _write_errors(path: Path) -> Generator[None]:
    """Errors of the library's own thread, which writes the file."""
    try:
        yield
    except RuntimeError as error:
        raise RunError(f"cannot write {path}: {one_line(str(error))}") from None


class _Log:
    def __init__(self, library: Any, stream: Any, info: LogInfo) -> None:
        rr = self._library = library
        self._stream = stream
        self._trackers = topics_of(info.trackers, prefix="")
        self._colours = {label: style.colour for label, style in styles_of(info.trackers).items()}
        self._paths: dict[str, list[list[float]]] = {"robot": [], "target": []}
        stream.send_recording_name(info.name)
        stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for label, name in self._trackers.items():
            for plot in ("overlap", "ms"):
                style = rr.SeriesLines(names=label, colors=self._colours[label])
                stream.log(f"plots/{plot}/{name}", style, static=True)

    def add(self, log: LogFrame) -> None:
        """Log a frame."""
        rr, frame, stream = self._library, log.frame, self._stream
        stream.set_time("time", duration=frame.time_s)
        camera, height, width = frame.truth.T_world_camera, *frame.image.shape[:2]
        stream.log("world/camera", rr.Transform3D(translation=camera[:3, 3], mat3x3=camera[:3, :3]))
        pinhole = rr.Pinhole(
            image_from_camera=frame.truth.K, width=width, height=height, camera_xyz=rr.ViewCoordinates.RDF
        )
        stream.log(
            "world/camera/image", pinhole, rr.EncodedImage(contents=encode_jpeg(frame.image), media_type="image/jpeg")
        )
        people = {one.name: one.box for one in frame.people if one.box[2] > 0.0 and one.box[3] > 0.0}
        stream.log("world/camera/image/truth", self._boxes(list(people.values()), list(people), _TRUTH_COLOUR))
        for label, name in self._trackers.items():
            estimate = log.estimates.get(label)
            given = [] if estimate is None else [estimate.box]
            text = f"{label}{'' if estimate is None or not estimate.occluded else ' (occluded)'}"
            stream.log(f"world/camera/image/{name}", self._boxes(given, [text] * len(given), self._colours[label]))
            overlap = log.overlap(label)
            if not math.isnan(overlap):
                stream.log(f"plots/overlap/{name}", rr.Scalars(overlap))
            stream.log(f"plots/ms/{name}", rr.Scalars(log.ms.get(label, 0.0)))
        x, y, heading = log.robot_pose
        turned = rr.RotationAxisAngle(axis=(0.0, 0.0, 1.0), radians=heading)
        stream.log("world/robot", rr.Transform3D(translation=(x, y, 0.0), rotation=turned))
        stream.log("world/robot/heading", rr.Arrows3D(vectors=[[_ARROW_M, 0.0, 0.0]]))
        points = [one.T_world_target[:3, 3] for one in frame.people]
        stream.log("world/people", rr.Points3D(points, labels=[one.name for one in frame.people], radii=0.2))
        self._paths["robot"].append([x, y, 0.0])
        self._paths["target"].append(frame.truth.T_world_target[:3, 3].tolist())
        if log.command is not None:
            for name, value in zip(("forward", "turn", "pan", "tilt"), log.command.tolist(), strict=True):
                stream.log(f"plots/command/{name}", rr.Scalars(value))

    def finish(self) -> None:
        """Log what is known at the end."""
        for name, points in self._paths.items():
            self._stream.log(f"world/paths/{name}", self._library.LineStrips3D([points], labels=[name]), static=True)

    def _boxes(self, given: list[FloatArray], labels: list[str], colour: tuple[int, int, int]) -> Any:
        rr, array = self._library, np.array(given, dtype=np.float64).reshape(-1, 4)
        return rr.Boxes2D(array=array, array_format=rr.Box2DFormat.XYWH, labels=labels, colors=colour)


def _blueprint(rrb: Any) -> Any:
    plots = [rrb.TimeSeriesView(origin=f"plots/{name}", name=name) for name in ("overlap", "ms")]
    views = rrb.Horizontal(
        rrb.Spatial2DView(origin="world/camera/image", name="camera"),
        rrb.Vertical(rrb.Spatial3DView(origin="world", name="world"), *plots),
    )
    return rrb.Blueprint(views, collapse_panels=True)
