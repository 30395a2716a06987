"""What a frame costs the trackers of the papers, as ratios to OpenCV's TrackerMIL beside them in the same run.

    tracker.update / cv2.TrackerMIL.update

One thread, 640x480, a box of 80x160 px, the medians over `FRAMES` frames; 100 particles for the methods of the three
papers, those of the preset `default` for the methods that Ko et al. name beside theirs, five detections for `chau2011`.
Every frame is shown to all in turn, so that a noisy machine disturbs all alike. Run as a program, with names of
trackers if not all are wanted.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from statistics import median
from typing import Any

# Libraries of linear algebra read it when they are loaded.
for _library in ("OMP", "OPENBLAS", "MKL"):
    os.environ[f"{_library}_NUM_THREADS"] = "1"

import cv2
import numpy as np

from pftrack_sim import trackers
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Detections

WIDTH, HEIGHT, FRAMES, COUNT = 640, 480, 300, 100
TARGETS = {
    **dict.fromkeys(["ko2012", "ko2012-rgb", "ko2012-hsv", "ko2012-hsv-kernel", "ko2012-cslbp"], 20),
    "lee2012-color": 25,
    "lee2012-color-hog": 25,
    "lee2012": 12,
    "kwon2005": 12,
    "kwon2005-no-occlusion": 12,
    "chau2011": 10,
    "deguchi2004": 10,
    "islam2009": 10,
    "khan2011": 6,
    "klein2010": 4,
    "sidibe2010": 10,
    "yang2005": 6,
}
"""How many times faster than TrackerMIL each shall be."""
PAPERS = ("ko2012", "lee2012", "kwon2005")

write = sys.stdout.write


class Walk:
    """A textured target that sways over a textured background."""

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        self._background = _blotches(rng, WIDTH, HEIGHT, 20)
        self._target = _blotches(rng, 80, 160, 5)
        self._target[..., 2] //= 3
        self._room = (WIDTH - 80, HEIGHT - 160)

    def box(self, index: int) -> np.ndarray:
        """`(4,)` true box [px]."""
        x = round(self._room[0] * (0.5 + 0.3 * np.sin(index / 20)))
        y = round(self._room[1] * (0.5 + 0.2 * np.sin(index / 13)))
        return np.array([x, y, self._target.shape[1], self._target.shape[0]], dtype=np.float64)

    def detections(self, index: int) -> Detections:
        """The target and four people who stand still."""
        others = [[150.0 * k, 40.0 * k, 60.0, 150.0] for k in range(4)]
        return Detections(np.array([self.box(index), *others]), np.full(5, 0.9))

    def image(self, index: int) -> np.ndarray:
        """`(480, 640, 3)` uint8."""
        image = self._background.copy()
        x, y, w, h = (int(one) for one in self.box(index))
        image[y : y + h, x : x + w] = self._target
        return image


def _blotches(rng: np.random.Generator, width: int, height: int, size: int) -> np.ndarray:
    coarse = rng.integers(0, 256, (height // size, width // size, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC))


def costs_ms(made: dict[str, Any], walk: Walk, frames: int) -> dict[str, float]:
    """Median ms of `update` of each tracker, every frame shown to all, in an order that turns from frame to frame.

    What ran before decides what is in the processor's caches, so no tracker may always come after the same one.
    """
    taken: dict[str, list[float]] = {name: [] for name in made}
    for tracker in made.values():
        if isinstance(tracker, trackers.NeedsDetections):
            tracker.receive_detections(walk.detections(0))
        tracker.init(walk.image(0), walk.box(0))
    for index in range(1, frames + 1):
        image = walk.image(index)
        names = list(made)
        for name in names[index % len(names) :] + names[: index % len(names)]:
            tracker = made[name]
            if isinstance(tracker, trackers.NeedsDetections):
                tracker.receive_detections(walk.detections(index))
            taken[name].append(clock_ms(lambda one=tracker, image=image: one.update(image)))
    return {name: median(values) for name, values in taken.items()}


def clock_ms(call: Callable[[], Any]) -> float:
    """Processor time of one call [ms]: all is in this thread, and other programs' time does not count."""
    began = time.thread_time()
    call()
    return (time.thread_time() - began) * 1e3


def make(name: str) -> Any:
    """A tracker with `COUNT` particles, if it has that parameter and is one of `PAPERS`."""
    try:
        return trackers.make(name, particle_count=COUNT) if name.startswith(PAPERS) else trackers.make(name)
    except ParameterError:
        return trackers.make(name)


def compare(names: list[str]) -> None:
    """Every tracker beside TrackerMIL."""
    ms = costs_ms({name: make(name) for name in ("opencv-mil", *names)}, Walk(), FRAMES)
    write(f"{'tracker':<24}{'ms':>8}{'of MIL':>10}{'at most':>10}\n")
    for name, value in ms.items():
        ratio = ms["opencv-mil"] / value
        target = TARGETS.get(name)
        least = f"1/{target}" if target else "-"
        verdict = "" if not target or ratio >= target else "  too slow"
        write(f"{name:<24}{value:>8.3f}{f'1/{ratio:.1f}':>10}{least:>10}{verdict}\n")


def main() -> None:
    """Print the table."""
    cv2.setNumThreads(1)
    compare(sys.argv[1:] or list(TARGETS))


if __name__ == "__main__":
    main()
