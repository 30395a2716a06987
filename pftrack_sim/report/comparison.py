"""Page of a comparison: paired differences, what the seeds can show, and the episodes that got worse as videos."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from pftrack_sim import score
from pftrack_sim.benchmark import RunStore
from pftrack_sim.benchmark.reading.losses import TAGS, loss_shares, tag_title
from pftrack_sim.benchmark.said.comparison import Difference, EpisodeDifference, RunComparison
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.palette import styles_of
from pftrack_sim.core.types import FloatArray
from pftrack_sim.report.contents import read_frames
from pftrack_sim.report.html import render, write_page
from pftrack_sim.report.tables import number_text, p_text, range_text
from pftrack_sim.score.events import occlusions

_MOST_EPISODES = 12
_SIZES = (0.01, 0.02, 0.05, 0.1)  # Differences whose seeds are named
_BEFORE_S = 1.0  # A video starts so long before the overlaps part
_WINDOW_S = 0.5


def write_comparison(first: RunStore, second: RunStore, found: RunComparison, target: Path) -> Path:
    """Write the page of a comparison; it needs nothing but itself and the videos of the runs where they are.

    Args:
        first: The run that the differences are taken from.
        second: The other one.
        found: Their comparison.
        target: HTML file to write.

    Raises:
        ParameterError: The name does not end in `.html`.
        RunError: A file of the runs cannot be read, or the page cannot be written.
    """
    if target.suffix.lower() not in (".html", ".htm"):
        raise ParameterError(f"a page's name must end in .html, got {str(target)!r}")
    worse = [pair for pair in found.episodes if pair.difference < 0.0]
    largest = max(found.episodes, key=lambda pair: abs(pair.difference), default=None)
    shown = [row.difference for row in (*found.rows, *found.tags)]
    ends = np.array([[one.mean, one.low, one.high] for one in shown])
    scale = max(0.01, float(np.nanmax(np.abs(ends), initial=0.0)))
    styles = [styles_of(store.plan.labels)[name] for store, name in zip((first, second), found.names, strict=True)]
    page = render(
        "comparison",
        ["comparison.js"],
        found=found,
        styles=styles if styles[0] != styles[1] else [styles[0], styles[1]._replace(dash="dot")],
        rows=[_row(row, scale) for row in found.rows],
        tags=[_row(row, scale) for row in found.tags],
        intervals=score.INTERVALS,
        verdicts=score.VERDICTS,
        meaning=score.MEASURE_DEFINITIONS[found.measure],
        meanings={tag_title(tag): words for tag, (words, _) in TAGS.items()},
        scale=number_text(scale, 3),
        remarks=remarks(found),
        losses=losses_of_both(first, second, found),
        report=_link(second.path / "report.html", target.parent),
        worse=len(worse),
        better=sum(pair.difference > 0.0 for pair in found.episodes),
        episodes=[
            _episode(first, second, found, pair, target.parent)
            for pair in worse[:_MOST_EPISODES]
            if pair is not largest
        ],
        largest=_episode(first, second, found, largest, target.parent) if largest else None,
    )
    return write_page(target, page)


def remarks(found: RunComparison) -> list[str]:
    """What the seeds of a comparison can show, and which episodes do not count, a sentence each."""
    last, pairs = found.rows[-1], len(found.episodes)
    lines: list[str] = []
    wanted = [f"{size:g}: {count}" for size in _SIZES if (count := last.seeds_for(size)) is not None]
    if wanted:
        what = "Seeds that show a difference with a power of 80%, at the spread between these seeds"
        lines.append(f"{what}: {'; '.join(wanted)}.")
    if found.different_frames:
        lines.append(
            f"{found.different_frames} of {pairs} pairs did not see the same frames: the scenario, the drawing or the "
            "robot's way differs."
        )
    if found.unpaired:
        lines.append(f"{found.unpaired} episodes are in one of the two only, and left out.")
    return lines


def losses_of_both(first: RunStore, second: RunStore, found: RunComparison) -> list[str]:
    """How often each of the two lost the target in its whole run, a sentence each; none without such frames.

    Raises:
        RunError: A run cannot be read.
    """
    shares = [loss_shares(store).get(name) for store, name in zip((first, second), found.names, strict=True)]
    return [f"{title} {one.statement}." for title, one in zip(found.titles, shares, strict=True) if one is not None]


def _row(row: Difference, scale: float) -> dict[str, Any]:
    """Cells of a row of the table, and places of mark and interval on a bar from -scale to scale [percent]."""

    def place(value: float) -> float:
        return round(50.0 + 50.0 * value / scale, 2)

    found = row.difference
    known = not math.isnan(found.low)
    mean, _, brackets = range_text(found, sign="+").partition(" ")
    return {
        "name": row.scenario,
        "condition": tag_title(row.condition) if row.condition in TAGS else row.condition,
        "seeds": found.seeds,
        "means": [number_text(row.first, 3), number_text(row.second, 3)],
        "difference": mean,
        "interval": brackets.strip("()"),
        "p": p_text(found.p),
        "verdict": row.verdict,
        "mark": place(found.mean) if found.seeds else None,
        "bar": (place(found.low), round(place(found.high) - place(found.low), 2)) if known else None,
    }


def _episode(
    first: RunStore, second: RunStore, found: RunComparison, pair: EpisodeDifference, folder: Path
) -> dict[str, Any]:
    """One episode: the overlaps of both over time, and their videos at the moment at which they part."""
    frames = [
        read_frames(store, [result])[name]
        for store, result, name in zip((first, second), (pair.first, pair.second), found.names, strict=True)
    ]
    end_s = max(float(one.time_s[-1]) for one in frames) or 1.0
    overlaps = [frames[0].overlap, np.interp(frames[0].time_s, frames[1].time_s, frames[1].overlap)]
    ahead, behind = overlaps if pair.difference <= 0.0 else overlaps[::-1]
    parting_s = _parting_s(frames[0].time_s, ahead, behind)
    start_s = max(parting_s - _BEFORE_S, 0.0)
    files = [store.video_of(result) for store, result in ((first, pair.first), (second, pair.second))]
    videos = [None if file is None else _link(file, folder) for file in files]
    same = videos[0] == videos[1]
    titles = [" and ".join(found.titles)] if same else list(found.titles)
    shown = zip(titles, videos, strict=False)
    return {
        "title": f"{pair.first.scenario}, {pair.first.condition.name}, seed {pair.first.seed}",
        "scores": [number_text(one.number(found.measure), 3) for one in (pair.first, pair.second)],
        "difference": f"{pair.difference:+z.3f}",
        "end_s": round(end_s, 3),
        "parting_s": round(parting_s, 2),
        "start_s": round(start_s, 2),
        "lines": [_points(one.time_s / end_s, one.overlap) for one in frames],
        "covered": _covered(frames[0].time_s / end_s, frames[0].visible_fraction),
        "videos": [{"title": title, "link": link and f"{link}#t={max(start_s, 0.01):.2f}"} for title, link in shown],
    }


def _parting_s(time_s: FloatArray, first: FloatArray, second: FloatArray) -> float:
    """When `second` falls behind: the start of the first `_WINDOW_S` in which it does by half of the most it does."""
    count = max(1, int(np.count_nonzero(time_s < time_s[0] + _WINDOW_S)))
    behind = np.convolve(np.nan_to_num(first - second), np.full(count, 1.0 / count), mode="valid")
    return float(time_s[int(np.argmax(behind >= 0.5 * behind.max()))]) if behind.max() > 0.0 else 0.0


def _points(x: FloatArray, y: FloatArray) -> str:
    """Points of an SVG line in a box of 100 x 30, with 0 at the bottom."""
    return " ".join(f"{100.0 * a:.2f},{30.0 - 30.0 * b:.2f}" for a, b in zip(x, np.nan_to_num(y), strict=True))


def _covered(x: FloatArray, visible_fraction: FloatArray) -> Sequence[tuple[float, float]]:
    """Starts and widths of the times in which the target is occluded, of 100."""
    edges = np.append(x, 1.0) * 100.0
    return [
        (round(float(edges[first]), 2), round(float(edges[last + 1] - edges[first]), 2))
        for first, last in occlusions(visible_fraction)
    ]


def _link(file: Path, folder: Path) -> str:
    return quote(os.path.relpath(file.resolve(), folder.resolve()).replace(os.sep, "/"))
