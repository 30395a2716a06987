"""What a tracker's error leaves to look at: the frame with its last box, and its traceback with what it printed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import cv2

from pftrack_sim.benchmark.running.rollout import Step
from pftrack_sim.benchmark.running.sinks import picture
from pftrack_sim.benchmark.running.tracker_runner import TrackerRunner


class ErrorLog:
    """A sink that keeps the frame in which a tracker ended with an error.

    Args:
        runners: The trackers.
        labels: All trackers of the run; default: those of the runners.
    """

    def __init__(self, runners: Sequence[TrackerRunner], labels: Sequence[str] = ()) -> None:
        self._runners = runners
        self._labels = labels or [runner.spec.label for runner in runners]
        self._pictures: dict[str, bytes] = {}

    def __call__(self, step: Step) -> None:
        """Look for new errors."""
        for runner in self._runners:
            label = runner.spec.label
            if runner.error is not None and label not in self._pictures:
                drawn = picture(step.sample, [runner], self._labels, last=True)
                self._pictures[label] = cv2.imencode(".png", cv2.cvtColor(drawn, cv2.COLOR_RGB2BGR))[1].tobytes()

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
