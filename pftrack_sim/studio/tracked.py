"""What sessions have in common: trackers on frames, and the last frames with what the trackers said."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pftrack_sim.benchmark.asked.plan import TrackerSpec
from pftrack_sim.benchmark.running.sinks import video_writer
from pftrack_sim.benchmark.running.tracker_runner import Isolation, TrackerRunner, make_runners
from pftrack_sim.core import boxes
from pftrack_sim.core.errors import BoxError, UnknownNameError
from pftrack_sim.core.palette import styles_of
from pftrack_sim.core.records import Estimate, Frame, Image, Truth
from pftrack_sim.core.types import FloatArray
from pftrack_sim.render.overlay import draw_boxes
from pftrack_sim.studio.settings import Settings

MEMORY_MB = 400  # For the frames that are kept

# Fields of the truth of a person of whom nothing is known in a frame.
UNSEEN: Mapping[str, Any] = MappingProxyType(
    {
        "box": np.zeros(4),
        **dict.fromkeys(("amodal_box", "visible_box", "swept_box"), boxes.NO_BOX),
        **dict.fromkeys(("distance_m", "image_motion_px", "luminance"), np.nan),
        "state": "out_of_view",
        "occluders": (),
    }
)

_SMALLEST_PX = 4.0  # Least width and height of a drawn box
_SAME_PERSON = 0.3  # Overlap from which on a drawn box is that of a person


@dataclass(frozen=True, eq=False)
class Moment:
    """One frame as it was shown.

    Attributes:
        truth: Of the person who is tracked.
        estimates: Of each tracker that has one, by label.
        ms: Time that each tracker took.
        periods: Camera periods since the start of the episode.
        world: Number of the compiled world it belongs to; geoms are the same within one.
        geom_m: `(ngeom, 3)` float32 positions of all geoms [m].
        geom_rotation: `(ngeom, 3, 3)` float32 orientations.
    """

    frame: Frame
    truth: Truth
    estimates: Mapping[str, Estimate]
    ms: Mapping[str, float]
    periods: int
    world: int
    geom_m: Any
    geom_rotation: Any

    @property
    def overlaps(self) -> dict[str, float]:
        """Overlap of each estimate; NaN while nothing of the person is visible."""
        scored = self.truth.scored
        return {
            name: boxes.iou(self.truth.box, one.box) if scored else float("nan") for name, one in self.estimates.items()
        }

    def picture(self) -> Image:
        """`(H, W, 3)` uint8: the frame with truth and estimates drawn as in reports."""
        people, styles = self.frame.people, styles_of(self.ms)
        return draw_boxes(self.frame.image, self.truth, self.estimates, people=people, styles=styles)


class TrackedSession(ABC):
    """An episode with trackers in it.

    Every method leaves the session as it was when it raises. `memory_mb` is for the frames that are kept.
    """

    simulated = True
    """Whether there is a scene behind the frames, with people, stress axes and a robot."""

    def __init__(self, settings: Settings, *, isolation: Isolation, memory_mb: float) -> None:
        self._memory = int(memory_mb * 1e6)
        self._isolation: Isolation = isolation
        self.settings = settings
        self.history: deque[Moment] = deque()
        """The last frames, oldest first; the last one is the present."""
        self.moment: Moment
        """The present; unlike the history, it can be read from any thread."""
        self.exact = True
        """Whether the frames from here on are those of `settings.toml()` to the bit."""
        self._person = ""
        self._runners: list[TrackerRunner] = []

    @property
    @abstractmethod
    def rate_hz(self) -> float:
        """Frames per second."""

    @property
    @abstractmethod
    def over(self) -> bool:
        """Whether the last frame has been shown."""

    @property
    @abstractmethod
    def people(self) -> tuple[str, ...]:
        """Everyone in the episode, the target first."""

    @property
    def person(self) -> str:
        """Name of the person who is tracked."""
        return self._person or self.people[0]

    @abstractmethod
    def advance(self) -> Moment:
        """Move on to the next frame, and show it to the trackers."""

    @abstractmethod
    def change(self, settings: Settings) -> str:
        """Take other settings, and say in a sentence what was done."""

    @abstractmethod
    def restart(self, moment: Moment | None = None) -> str:
        """Start again at a moment that was shown, or at the first frame, with trackers anew, and say so."""

    @abstractmethod
    def _show(self, frame: Frame, drawn: FloatArray | None = None) -> None:
        """Show a frame to the trackers, which start with a drawn box where there is one."""

    def select(self, person: str) -> str:
        """Track this person from now on, and say so.

        Raises:
            UnknownNameError: No person has this name.
        """
        if person not in self.people:
            raise UnknownNameError("person", person, self.people)
        self._person = person
        self._set_runners(self.settings.trackers)
        self._show_again()
        return f"Tracking {person}."

    def person_at(self, moment: Moment, x_px: float, y_px: float) -> str | None:
        """Name of the nearest person whose box contains a point of the image, or None."""
        for one in sorted(moment.frame.people, key=lambda one: one.distance_m):
            x, y, width, height = one.box
            if x <= x_px < x + width and y <= y_px < y + height:
                return one.name
        return None

    def select_box(self, box: ArrayLike) -> str:
        """Start all trackers with a `(4,)` box [px] on the present frame, less what lies outside, and say so.

        A person whose true box overlaps it by 0.3 or more becomes the target; otherwise the target stays.

        Raises:
            BoxError: It is no box, or less than 4 px of it in width or height are inside the image.
        """
        frame = self.moment.frame
        height, width = frame.image.shape[:2]
        drawn = boxes.clip(boxes.checked(box, what="the drawn box"), width, height)
        if min(drawn[2:]) < _SMALLEST_PX:
            size = " x ".join(f"{side:.1f}" for side in drawn[2:])
            raise BoxError(f"a drawn box needs {_SMALLEST_PX:g} px inside the image both ways, got {size} px")
        fits = [(boxes.iou(one.box, drawn), one.name) for one in frame.people if one.scored]
        overlap, name = max(fits, default=(0.0, ""))
        if overlap >= _SAME_PERSON:
            self._person = name
        self._set_runners(self.settings.trackers)
        self.history.pop()
        self._show(frame, drawn)
        return "Trackers start with the drawn box" + (f"; overlap is with {self.person}." if self.simulated else ".")

    def save_clip(self, path: Path, last_s: float = 10.0) -> None:
        """Write the last seconds with what is drawn on them as an MP4.

        Raises:
            RunError: It cannot be written.
        """
        end_s = self.moment.frame.time_s
        with video_writer(path, self.rate_hz) as add:
            for moment in self.history:
                if moment.world == self.moment.world and moment.frame.time_s >= end_s - last_s:
                    add(moment.picture(), moment.frame.time_s)

    def close(self) -> None:
        """End the trackers' processes."""
        for runner in self._runners:
            runner.close()

    @property
    def errors(self) -> list[str]:
        """Trackers that failed, and why."""
        return [f"{one.spec.label}: {one.error}" for one in self._runners if one.error is not None]

    @property
    def _restarted(self) -> str:
        return f"Restarted at {self.moment.frame.time_s:.2f} s; trackers start anew."

    def _set_runners(self, trackers: Sequence[TrackerSpec]) -> None:
        made = make_runners(trackers, seed=self.settings.seed, isolation=self._isolation)
        for runner in self._runners:
            runner.close()
        self._runners = made

    def _step_runners(self, frame: Frame, truth: Truth, drawn: FloatArray | None) -> None:
        box, visible = (truth.box, truth.visible_fraction) if drawn is None else (drawn, 1.0)
        if np.isnan(visible):  # of a recording only a box is known
            visible = float(truth.scored)
        for runner in self._runners:
            runner.step(frame.image, box, visible)

    def _latest(self) -> tuple[dict[str, Estimate], dict[str, float]]:
        """Estimates and times [ms] of the present frame, by label."""
        latest = {runner.spec.label: runner.estimates[-1] for runner in self._runners}
        estimates = {name: one for name, one in latest.items() if one is not None}
        return estimates, {runner.spec.label: runner.ms[-1] for runner in self._runners}

    def _remember(self, moment: Moment) -> None:
        """Make a moment the present."""
        self.moment = moment
        self.history.append(moment)
        each = sum(one.nbytes for one in (moment.frame.image, moment.geom_m, moment.geom_rotation))
        while len(self.history) > max(2, self._memory // each):
            self.history.popleft()

    def _show_again(self) -> None:
        """Show the present frame to new trackers."""
        self._show(self.history.pop().frame)
