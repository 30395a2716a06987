"""Sinks of a rollout: videos, logs, errors, digests of frames, the truth, the course of the robot."""

from __future__ import annotations

import contextlib
import hashlib
import math
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.error import FFmpegError

from pftrack_sim.benchmark.kept.files import atomic_write
from pftrack_sim.benchmark.kept.tables import Column, column
from pftrack_sim.benchmark.running.rollout import Sample, Sink
from pftrack_sim.benchmark.running.tracker_runner import TrackerRunner
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.core.image_files import encode
from pftrack_sim.core.palette import styles_of
from pftrack_sim.core.proprioception import PROPRIO_NAMES, RANGES
from pftrack_sim.core.records import Estimate, Image, Truth
from pftrack_sim.core.text import one_line
from pftrack_sim.logs import LogFrame, LogInfo, log_format, log_writer
from pftrack_sim.render.overlay import draw_frame, draw_recorded
from pftrack_sim.scenario.model import ResolvedScenario
from pftrack_sim.score import following

_TIME_BASE = Fraction(1, 90_000)
"""Unit of time stamps in videos [s]: the one of MPEG."""


def picture(sample: Sample, estimates: Mapping[str, Estimate | None], labels: Sequence[str] = ()) -> Image:
    """A frame with its truth and estimates by the trackers' labels, `(H, W, 3)` uint8 RGB.

    The `labels` of all trackers of the run, by default of these, give each its colour and marker.
    """
    styles = styles_of(labels or list(estimates))
    known = {label: estimate for label, estimate in estimates.items() if estimate is not None}
    if sample.frame is not None:
        return draw_frame(sample.frame, known, styles)
    return draw_recorded(sample.image, sample.true_box, known, caption=sample.caption, styles=styles)


def latest(runners: Sequence[TrackerRunner]) -> dict[str, Estimate | None]:
    """The trackers' estimates in the present frame, by label."""
    return {runner.spec.label: runner.estimates[-1] for runner in runners}


def nearest_look_alike(truth: Truth, people: Sequence[Truth]) -> float:
    """Distance in the image to the nearest other visible person whose box is half to twice as high as the target's.

    Returns:
        Between the centres of the amodal boxes, in sizes of the target, sqrt(w h); infinite without such a person, NaN
        where the target has no box.
    """
    x, y, width, height = truth.amodal_box.tolist()
    others = [one.amodal_box for one in people if one.name != truth.name and one.scored]
    gaps = [math.hypot(left + w / 2 - x - width / 2, top + h / 2 - y - height / 2)
            for left, top, w, h in others if 0.5 * height <= h <= 2.0 * height]  # fmt: skip
    return math.nan if math.isnan(x) else min(gaps, default=math.inf) / math.sqrt(width * height)


class TruthLog:
    """Truth of the target and of everybody in view, and a digest of the images of a simulated episode.

    Attributes:
        graphics: What drew the images, once it is known.
    """

    def __init__(self) -> None:
        self.graphics = ""
        self.truths: list[Truth] = []
        self.people: list[tuple[Truth, ...]] = []
        self._images = hashlib.blake2b(digest_size=16)

    def __call__(self, sample: Sample) -> None:
        """Add a frame."""
        frame = sample.frame
        assert frame is not None
        self.truths.append(frame.truth)
        self.people.append(tuple(frame.people))  # A sequence that is still to be found would keep the image.
        self._images.update(np.ascontiguousarray(sample.image).data)

    @property
    def frames_digest(self) -> str:
        """BLAKE2b of all pixels."""
        return self._images.hexdigest()


@contextlib.contextmanager
def video_writer(path: Path, rate_hz: float, quality: int = 21) -> Generator[Callable[[Image, float], None]]:
    """Write an H.264 video that browsers play; the file appears under its name when it is complete.

    Args:
        path: File to write, ending in `.mp4`.
        rate_hz: Nominal frames per second.
        quality: Constant rate factor of H.264: 18 is visually lossless, 28 is small.

    Yields:
        A function that appends a frame `(H, W, 3)` uint8 RGB, shown at a time [s]. All frames have one size; an odd
        last row or column is dropped.

    Raises:
        ParameterError: The name does not end in `.mp4`.
        RunError: The file cannot be written.
    """
    if path.suffix.lower() != ".mp4":
        raise ParameterError(f"a video's name must end in .mp4, got {str(path)!r}")
    rate = Fraction(rate_hz).limit_denominator(1001)
    container: Any
    try:
        with (
            atomic_write(path) as part,
            av.open(str(part), "w", format="mp4", options={"movflags": "faststart"}) as container,
        ):
            # With its tree of macroblocks x264 writes other bits now and then, one video in some hundred.
            options = {"crf": str(quality), "preset": "veryfast", "threads": "1", "x264-params": "mbtree=0"}
            stream: Any = container.add_stream("libx264", rate=rate, options=options)
            stream.codec_context.time_base = _TIME_BASE
            # The only pixel format that every browser decodes; it needs even sizes.
            stream.pix_fmt = "yuv420p"

            def add(image: Image, time_s: float) -> None:
                height, width = (size - size % 2 for size in image.shape[:2])
                if not stream.codec_context.is_open:
                    stream.width, stream.height = width, height
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image[:height, :width]), format="rgb24")
                frame.pts, frame.time_base = round(time_s / _TIME_BASE), _TIME_BASE
                container.mux(stream.encode(frame))

            yield add
            container.mux(stream.encode())
    except FFmpegError as error:  # not always an OSError: a full disk is found when the file is closed
        raise RunError(f"cannot write {path}: {one_line(str(error.strerror or error))}") from None


class FollowLog:
    """Course and sensors of the robot in closed loop.

    Positions and sensors are those at the frame; `after_*` is where its command led.
    """

    def __init__(self) -> None:
        self._columns: dict[str, list[Any]] = {}
        self._last: dict[str, Any] = {}

    def __call__(self, sample: Sample) -> None:
        """Add a frame."""
        after = sample.after
        assert sample.frame is not None
        assert sample.action is not None
        assert after is not None
        self._last = dict(after)
        truth, (x_m, y_m, heading_rad) = sample.frame.truth, sample.info["robot_pose"]
        camera, late_s = truth.T_world_camera, float(sample.action.get("late_s", 0.0))
        row = {
            "robot_x_m": x_m,
            "robot_y_m": y_m,
            "robot_heading_rad": heading_rad,
            "gaze_rad": math.atan2(camera[1, 2], camera[0, 2]),
            "target_x_m": truth.T_world_target[0, 3],
            "target_y_m": truth.T_world_target[1, 3],
            **dict(
                zip(("command_forward", "command_turn", "command_pan", "command_tilt"), after["command"], strict=True)
            ),
            "late_s": late_s if late_s <= after["time_s"] - truth.time_s + 1e-9 else 0.0,
            "after_s": after["time_s"],
            "after_x_m": after["robot_pose"][0],
            "after_y_m": after["robot_pose"][1],
            "after_distance_m": after["distance_m"],
            "after_bearing_rad": after["bearing_rad"],
            "after_bystander_m": after["bystander_m"],
            "after_seen": after["truth"].scored,
            "following": after["following"],
            **dict(zip(PROPRIO_NAMES, sample.observation["proprio"][: RANGES.start], strict=False)),
            "ranges_m": sample.observation["proprio"][RANGES].tolist(),
        }
        for name, value in row.items():
            self._columns.setdefault(name, []).append(value)

    def columns(self) -> dict[str, Column]:
        """`(N,)` columns of the episode's table."""
        return {name: column(values) for name, values in self._columns.items()}

    def scores(self, settings: ResolvedScenario, frame_count: int) -> dict[str, Any]:
        """Scores of following, as columns of the summary; `frame_count` is that of a full episode."""
        after, info = self.columns(), self._last
        path = following.DrivenPath(
            after["after_s"],
            after["after_distance_m"],
            after["after_bearing_rad"],
            after["after_seen"],
            np.stack([after["after_x_m"], after["after_y_m"]], axis=1),
            after["after_bystander_m"],
            info["outcome"],
        )
        measures = following.summarise(path, settings.follow, frame_count)
        scores = {f"follow_{name}": value for name, value in asdict(measures).items()}
        return {**scores, "outcome": info["outcome"], "collided_with": info["collision"], "clipped": info["clipped"]}


@contextlib.contextmanager
def episode_log(path: Path, name: str, settings: ResolvedScenario, runners: Sequence[TrackerRunner]) -> Generator[Sink]:
    """Write a log of an episode; the file appears under its name when it is complete.

    The suffix of the path gives the format, the name is for people.

    Yields:
        A sink for samples with proprioception and robot pose.

    Raises:
        ParameterError: No format has this suffix.
        RunError: The format's library is missing, or the file cannot be written.
    """
    robot = settings.robot
    turn, pan, tilt = (math.radians(one) for one in (robot.max_turn_deg_s, robot.max_pan_deg_s, robot.max_tilt_deg_s))
    labels = tuple(runner.spec.label for runner in runners)
    limits, error = (robot.max_speed_m_s, turn, pan, tilt), 0.01 * robot.odometry_error_percent
    own = robot.sensors
    gyro = math.radians(math.hypot(own.gyro_noise_deg_s, own.gyro_bias_deg_s))
    imu = (gyro, math.hypot(own.accelerometer_noise_m_s2, own.accelerometer_bias_m_s2))
    info = LogInfo(name, settings.camera.rate_hz, labels, limits, error, imu, settings.T_camera(settings.viewed))
    form = log_format(path)
    with atomic_write(path) as part, log_writer(form, part, info) as add:

        def sink(sample: Sample) -> None:
            assert sample.frame is not None
            add(
                LogFrame(
                    sample.frame,
                    sample.info["robot_pose"],
                    np.asarray(sample.observation["proprio"], dtype=np.float64),
                    sample.info["robot"],
                    latest(runners),
                    {runner.spec.label: runner.ms[-1] for runner in runners},
                    None if sample.after is None else np.asarray(sample.after["command"], dtype=np.float64),
                )
            )

        yield sink


class ErrorLog:
    """A sink that keeps the frame in which a tracker ended with an error."""

    def __init__(self, runners: Sequence[TrackerRunner], labels: Sequence[str] = ()) -> None:
        self._runners = runners
        self._labels = labels or [runner.spec.label for runner in runners]
        self._pictures: dict[str, bytes] = {}

    def __call__(self, sample: Sample) -> None:
        """Look for new errors."""
        for runner in self._runners:
            label = runner.spec.label
            if runner.error is not None and label not in self._pictures:
                last = next((one for one in reversed(runner.estimates) if one is not None), None)
                drawn = picture(sample, {label: last}, self._labels)
                self._pictures[label] = encode(drawn, ".png")

    def files(self, stems: Iterable[str]) -> dict[str, bytes]:
        """Picture and text of each error, by name: the given stem of each tracker, with `.png` and `.txt`."""
        found: dict[str, bytes] = {}
        for stem, runner in zip(stems, self._runners, strict=True):
            if runner.error is not None:
                found[f"{stem}.png"] = self._pictures[runner.spec.label]
                found[f"{stem}.txt"] = error_text(runner).encode()
        return found


def error_text(runner: TrackerRunner) -> str:
    """Error of a tracker in lines: where it happened, the traceback, and what was printed."""
    parts = [f"{runner.spec.label} ended with an error, {runner.error}", runner.traceback]
    parts += [f"It printed:\n{runner.printed}"] if runner.printed else []
    return "\n\n".join(part for part in parts if part) + "\n"
