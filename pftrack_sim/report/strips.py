"""Film strips: a few frames of the best, the median and the worst of all episodes, as the papers show them."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pftrack_sim.benchmark import Result, RunStore
from pftrack_sim.benchmark.running.filming import draw_again
from pftrack_sim.benchmark.running.rollout import Sample
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.image_files import encode
from pftrack_sim.core.palette import styles_of
from pftrack_sim.core.records import Image
from pftrack_sim.formats.images import video as read_video
from pftrack_sim.formats.images import video_times
from pftrack_sim.report.tables import grouped

FRAMES = 5
WIDTH_PX = 320
_QUALITY = 82
_NAME_INCH = 0.5


def strips(store: RunStore) -> list[dict[str, Any]]:
    """Strips of the tracker with the highest mean overlap: of its best, median and worst episode of all.

    Each has a title, the tracker and its overlap, and pictures: their times [s], and JPEG as data URIs; none where
    the episode has no video.

    Raises:
        SequenceError: A video is broken.
    """
    ranked = _ranked(store)
    if not any(store.video_of(result) for result in ranked):
        return []
    places = {len(ranked) - 1: "best", len(ranked) // 2: "median", 0: "worst"}
    return [_strip(title, ranked[place], store.video_of(ranked[place])) for place, title in places.items()]


def draw_strips(store: RunStore, figure: Any) -> None:
    """Draw the leader's median episode, a row of frames for each tracker with its box and, dashed, the true one.

    The frames are drawn again.

    Raises:
        ParameterError: A run in closed loop, or one in which the target is never visible.
    """
    ranked = _ranked(store)
    if store.plan.kind == "follow" or not ranked:
        raise ParameterError("strips show one episode to all trackers: of a run of bench in which the target is seen")
    episode = store.episode_of(ranked[len(ranked) // 2])
    own = [one for one in store.results if one.values["number"] == episode.number]
    first = episode.first_frame
    wanted = [first + index for index in _spread(int(own[0].values["episode_frames"]) - first)]
    images: list[Image] = []
    times_s: list[float] = []

    def keep(sample: Sample) -> None:
        if sample.frame is not None and sample.frame.index in wanted:
            images.append(sample.image)
            times_s.append(sample.time_s)

    draw_again(episode, [keep])
    height, width = images[0].shape[:2]
    figure.set_figheight((figure.get_figwidth() - _NAME_INCH) / FRAMES * height / width * len(own) + _NAME_INCH)
    styles = styles_of(store.plan.labels)
    plots = figure.subplots(len(own), FRAMES, squeeze=False)
    for row, one in zip(plots, own, strict=True):
        table = store.frame_columns(one, ("estimate", store.plan.truth))
        known = {
            name: [[np.nan] * 4 if box is None else box for box in column]  # a miss has none
            for name, column in table.items()
        }
        drawn = ((known["estimate"], styles[one.label].hexadecimal, "-"), (known[store.plan.truth], "white", ":"))
        for axes, index, image in zip(row, wanted, images, strict=True):
            axes.imshow(image)
            axes.set(xticks=(), yticks=(), xlim=(0, width), ylim=(height, 0))
            for boxes, colour, line in drawn:
                x, y, w, h = boxes[index]
                axes.plot([x, x + w, x + w, x, x], [y, y, y + h, y + h, y], line, color=colour, lw=0.8)
        row[0].set_ylabel(one.label.replace("[", "\n["), fontsize=5, parse_math=False)
    for axes, time_s in zip(plots[0], times_s, strict=True):
        axes.set_title(f"{time_s:.1f} s", fontsize=6)
    figure.suptitle(episode.name, fontsize=7)


def _ranked(store: RunStore) -> list[Result]:
    """Results of the tracker with the highest mean overlap, the worst first."""
    # Episodes of those that have the truth show nothing about tracking.
    seen = [one for one in store.results if one.tracker.told != "truth" and not one.never_seen]
    ranked = [
        sorted(own, key=lambda one: one.number("mean_overlap")) for own in grouped(seen, lambda one: one.label).values()
    ]
    return max(ranked, key=lambda own: np.mean([one.number("mean_overlap") for one in own]), default=list[Result]())


def _spread(count: int) -> list[int]:
    """Numbers of `FRAMES` of so many frames."""
    return [int(index) for index in np.linspace(0, count - 1, FRAMES)] if count else []


def _strip(title: str, result: Result, video: Path | None) -> dict[str, Any]:
    return {
        "title": f"{title}: {result.scenario}, {result.condition.name}, seed {result.seed}",
        "tracker": result.label,
        "overlap": result.number("mean_overlap"),
        "pictures": [] if video is None else _pictures(video),
    }


def _pictures(video: Path) -> list[tuple[float, str]]:
    (images, _), times_s = read_video(video), video_times(video)
    return [(float(times_s[index]), _data_uri(images.read(index))) for index in _spread(len(images))]


def _data_uri(image: Image) -> str:
    height, width = image.shape[:2]
    small = cv2.resize(image, (WIDTH_PX, round(WIDTH_PX * height / width)), interpolation=cv2.INTER_AREA)
    encoded = encode(np.asarray(small, dtype=np.uint8), ".jpg", cv2.IMWRITE_JPEG_QUALITY, _QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(encoded).decode()
