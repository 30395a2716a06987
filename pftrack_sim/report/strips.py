"""Film strips: a few frames of the best, the median and the worst of all episodes, as the papers show them."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pftrack_sim.benchmark import Result, RunStore
from pftrack_sim.core.image_files import encode
from pftrack_sim.core.records import Image
from pftrack_sim.formats.images import video as read_video

FRAMES = 5
WIDTH_PX = 320
_QUALITY = 82


def strips(store: RunStore) -> list[dict[str, Any]]:
    """Strips of the tracker with the highest mean overlap: of its best, median and worst episode of all.

    Each has a title, the tracker and its overlap, and pictures: indices of frames, and JPEG as data URIs; none where
    the episode has no video.

    Raises:
        SequenceError: A video is broken.
    """
    overlaps: dict[str, list[float]] = {}
    for result in store.results:
        # Episodes of those that have the truth show nothing about tracking.
        if result.tracker.told != "truth" and not result.never_seen:
            overlaps.setdefault(result.label, []).append(result.number("mean_overlap"))
    leader = max(overlaps, key=lambda label: np.mean(overlaps[label]), default=None)
    ranked = [one for one in store.results if one.label == leader and not one.never_seen]
    ranked.sort(key=lambda one: one.number("mean_overlap"))
    if not any(store.video_of(result) for result in ranked):
        return []
    places = {len(ranked) - 1: "best", len(ranked) // 2: "median", 0: "worst"}
    return [_strip(title, ranked[place], store.video_of(ranked[place])) for place, title in places.items()]


def _strip(title: str, result: Result, video: Path | None) -> dict[str, Any]:
    return {
        "title": f"{title}: {result.scenario}, {result.condition.name}, seed {result.seed}",
        "tracker": result.label,
        "overlap": result.number("mean_overlap"),
        "pictures": [] if video is None else _pictures(video),
    }


def _pictures(video: Path) -> list[tuple[int, str]]:
    images, _ = read_video(video)
    indices = [int(index) for index in np.linspace(0, len(images) - 1, FRAMES)] if len(images) else []
    return [(index, _data_uri(images.read(index))) for index in indices]


def _data_uri(image: Image) -> str:
    height, width = image.shape[:2]
    small = cv2.resize(image, (WIDTH_PX, round(WIDTH_PX * height / width)), interpolation=cv2.INTER_AREA)
    encoded = encode(np.asarray(small, dtype=np.uint8), ".jpg", cv2.IMWRITE_JPEG_QUALITY, _QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(encoded).decode()
