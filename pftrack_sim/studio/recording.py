"""Recorded frames in place of the simulator: a sequence, a video file, or a camera."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import cv2
import numpy as np

from pftrack_sim.benchmark.running.tracker_runner import Isolation, check_trackers
from pftrack_sim.core.boxes import NO_BOX
from pftrack_sim.core.errors import ParameterError, SequenceError
from pftrack_sim.core.palette import styles_of
from pftrack_sim.core.records import Frame, Image, Truth
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats import RecordedSequence
from pftrack_sim.render.overlay import draw_recorded
from pftrack_sim.studio.settings import Settings
from pftrack_sim.studio.tracked import MEMORY_MB, UNSEEN, Moment, TrackedSession
from pftrack_sim.trackers.isolation import Limits

_NO_RATE_HZ = 30.0  # Of sequences and cameras that do not tell theirs
_FOVY_RAD = math.radians(50.0)


class Camera:
    """A camera by its number; it never goes back, and no box is known.

    Raises:
        SequenceError: It cannot be opened.
    """

    def __init__(self, number: int) -> None:
        self._capture = cv2.VideoCapture(number)
        if not self._capture.isOpened():
            raise SequenceError(f"camera {number}: cannot be opened")
        self.rate_hz = self._capture.get(cv2.CAP_PROP_FPS) or _NO_RATE_HZ

    def image(self) -> Image | None:
        """`(H, W, 3)` uint8 RGB of the newest frame; None where the camera gives none."""
        read, bgr = self._capture.read()
        return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8) if read else None

    def close(self) -> None:
        """Free the camera."""
        self._capture.release()


Source: TypeAlias = RecordedSequence | Camera


@dataclass(frozen=True, eq=False)
class RecordedMoment(Moment):
    """One frame of a recording; without a box nothing is scored."""

    def picture(self) -> Image:
        """See `Moment`."""
        return draw_recorded(
            self.frame.image,
            self.truth.amodal_box,
            self.estimates,
            caption=f"{self.frame.time_s:.2f} s" if self.estimates else "no box yet: draw one",
            styles=styles_of(self.ms),
        )


class RecordedSession(TrackedSession):
    """Recorded frames with trackers on them. Trackers start with a frame's true box, or with a box that is drawn.

    Arguments are those of `TrackedSession`, and what opens the recording, whose name the settings have.

    Raises:
        SequenceError: There is no frame.
        UnknownNameError: An unknown tracker.
    """

    simulated = False

    def __init__(
        self,
        settings: Settings,
        open_source: Callable[[], Source],
        *,
        isolation: Isolation = "auto",
        memory_mb: float = MEMORY_MB,
    ) -> None:
        super().__init__(settings, isolation=isolation, memory_mb=memory_mb)
        self._source = open_source()
        self._ended = False
        self._set_runners(settings.trackers)
        first = self._frame(0)
        if first is None:
            raise SequenceError(f"{settings.name}: no frame can be read")
        self._show(first)

    @property
    def rate_hz(self) -> float:
        """See `TrackedSession`."""
        return self._source.rate_hz or _NO_RATE_HZ

    @property
    def over(self) -> bool:
        """See `TrackedSession`; it shows when there is no next frame."""
        return self._ended

    @property
    def people(self) -> tuple[str, ...]:
        """The target alone."""
        return ("target",)

    def advance(self) -> Moment:
        """See `TrackedSession`.

        Raises:
            ParameterError: There is no further frame.
            SequenceError: The next frame is damaged.
        """
        frame = self._frame(self.moment.frame.index + 1)
        if frame is None:
            self._ended = True
            raise ParameterError("the recording is over: restart it")
        self._show(frame)
        return self.moment

    def change(self, settings: Settings) -> str:
        """Take other trackers; they start with the next true or drawn box.

        Raises:
            UnknownNameError: An unknown tracker.
        """
        check_trackers(settings.trackers, self._isolation, Limits())
        last = next((one.box for one in self.moment.estimates.values()), None)
        self._set_runners(settings.trackers)
        self.settings = settings
        frame = self.history.pop().frame
        self._show(frame, None if frame.truth.scored else last)
        return "Trackers start with the true box, else with the last box of the first tracker, else with a drawn one."

    def restart(self, moment: Moment | None = None) -> str:
        """See `TrackedSession`."""
        index = 0 if moment is None else moment.frame.index
        frame = self._frame(index)
        if frame is None:
            raise ParameterError("a camera does not go back, and this recording has no such frame")
        while self.history and self.history[-1].frame.index >= index:
            self.history.pop()
        self._set_runners(self.settings.trackers)
        self._ended = False
        self._show(frame)
        return self._restarted

    def close(self) -> None:
        """Close the source, and end the trackers' processes."""
        super().close()
        if isinstance(self._source, Camera):
            self._source.close()

    def _frame(self, index: int) -> Frame | None:
        """A frame of the sequence, or the camera's newest; None after the last one."""
        source, box = self._source, NO_BOX
        if isinstance(source, Camera):
            image = source.image()
        else:
            image = source.image(index) if index < len(source) else None
            box = source.truth[index] if image is not None else NO_BOX
        if image is None:
            return None
        truth = _truth(box, image, index / self.rate_hz)
        return Frame(index, truth.time_s, image, truth, ())

    def _show(self, frame: Frame, drawn: FloatArray | None = None) -> None:
        self._step_runners(frame, frame.truth, drawn)
        nothing: Any = np.zeros((0, 3), dtype=np.float32)
        self._remember(RecordedMoment(frame, frame.truth, *self._latest(), frame.index, 0, nothing, nothing))


def _truth(box: FloatArray, image: Image, time_s: float) -> Truth:
    """What is known of a frame: its box, or nothing. The camera is a level one of 50 degrees, for the 3D view."""
    height, width = image.shape[:2]
    focal = 0.5 * height / math.tan(0.5 * _FOVY_RAD)
    pose = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]], dtype=np.float64)
    known: dict[str, Any] = (
        {"box": box, "amodal_box": box, "visible_box": box, "state": "visible"} if np.isfinite(box).all() else {}
    )
    return Truth(
        name="target",
        visible_fraction=np.nan,
        truncation=0.0,
        T_world_camera=pose,
        T_world_target=np.full((4, 4), np.nan),
        K=np.array([[focal, 0.0, 0.5 * width], [0.0, focal, 0.5 * height], [0.0, 0.0, 1.0]]),
        distortion=np.zeros(5),
        time_s=time_s,
        **{**UNSEEN, **known},
    )
