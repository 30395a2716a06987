"""Losses of the target, with what the truth says happened then, as views over a run's frames."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import duckdb

from pftrack_sim.benchmark.kept.files import sql_text

if TYPE_CHECKING:
    from pftrack_sim.benchmark.reading.store import RunStore

TRACKED = 0.3
"""Overlap from which the target counts as tracked: a loss begins with the last such frame."""

LOST, LOST_S = 0.1, 0.5
"""A target is lost where the overlap stays below this for so long."""

AROUND_S = 0.5
"""What happens up to so long before and after a loss began belongs to it."""

FAST_PER_S = 7.5
"""Speed [sizes/s] above which the target moves fast: near the 75 % quantile of the fastest twentieth of the frames of
recorded videos (`step_p95_per_s` of `score.profile.recorded_quantiles`)."""

TAGS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "occluded": ("less than half of the target is visible", "min(visible_fraction) OVER near < 0.5"),
        "look_alike_near": (
            "the centre of another person, half to twice as high, is within 0.6 sizes, sqrt(w h), of the target's",
            "min(nearest_look_alike) OVER near < 0.6",
        ),
        "light_change": (
            "the target's luminance changes by a factor above 1.3",
            "max(seen_luminance) OVER near > 1.3 * min(seen_luminance) OVER near",
        ),
        "fast_motion": (
            f"the target's centre moves faster than {FAST_PER_S:g} sizes per second from one frame to the next",
            f"max(image_motion_px / size / lasts_s) OVER near > {FAST_PER_S}",
        ),
        "truncated": ("more than a tenth of the target's box is outside the image", "max(truncation) OVER near > 0.1"),
        "scale_change": (
            "the target's size changes by a factor above 1.25",
            "max(size) OVER near > 1.25 * min(size) OVER near",
        ),
    }
)
"""What can happen at a loss: meaning and SQL, within `AROUND_S` of it. Several can be true of one loss."""

EVER_TRACKED = f"coalesce(bool_or(status = 'ok' AND overlap >= {TRACKED}), false)"
"""SQL over scored moments of an episode: whether the target is tracked in any after the one with the given box."""

LOSS = (
    f"an overlap below {LOST:g} for {LOST_S:g} s in which the target can be seen, after it was tracked (at least "
    f"{TRACKED:g}); it begins with the last frame in which it was tracked. Frames after a tracker's error are no part"
)
"""Definition of a loss."""


@dataclass(frozen=True)
class LossShares:
    """How often a tracker lost the target in some episodes, and what happened then.

    Attributes:
        lost: Number of those with a loss.
        untracked: Number of those in which the tracker, once started, never tracked the target.
        errors: Number of those in which it ended with an error.
        shares: Share of the losses, by tag; NaN without losses.
        frame_count: Number of frames in which the target can be seen.
        frames: Share of these that have the tag around them.
    """

    losses: int
    episodes: int
    lost: int
    untracked: int
    errors: int
    shares: Mapping[str, float]
    frame_count: int
    frames: Mapping[str, float]

    @property
    def statement(self) -> str:
        """Number of losses and what they begin with more often than other frames have it, as the end of a sentence."""
        of = f"of {self.episodes} episode{'s' if self.episodes != 1 else ''}"
        parts = [f"never tracks the target in {self.untracked} {of}"] if self.untracked else []
        if self.losses:
            tag = max(TAGS, key=lambda one: self.shares[one] - self.frames[one])
            often = f"{self.losses} time{'s' if self.losses != 1 else ''}"
            parts.append(f"loses the target {often} in {self.lost} {of}")
            if self.shares[tag] > self.frames[tag]:
                usual = f"{self.frames[tag]:.0%} of all {self.frame_count} frames"
                parts.append(f"{self.shares[tag]:.0%} of the losses begin with: {tag_title(tag)} ({usual})")
        elif self.untracked < self.episodes:
            parts.append(f"never loses the target{' once it is tracked' if self.untracked else ''}")
        if self.errors:
            parts.append(f"ends with an error in {self.errors} {of}")
        return "; ".join(parts)


def tag_title(tag: str) -> str:
    """A tag in words.

    >>> tag_title("look_alike_near")
    'look-alike near'
    """
    return tag.replace("_", " ").replace("look alike", "look-alike")


def create_loss_views(database: duckdb.DuckDBPyConnection) -> None:
    """Create `moments` and `losses` from `frames`."""
    # DuckDB orders NaN above all numbers.
    numbers = ["visible_fraction", "truncation", "image_motion_px", "nearest_look_alike"]
    values = ", ".join(f"CASE WHEN NOT isnan({name}) THEN {name} END AS {name}" for name in numbers)
    tags = ", ".join(f"coalesce({sql}, false) AS {name}" for name, (_, sql) in TAGS.items())
    database.execute(
        f"""
        CREATE VIEW moments AS
        WITH sized AS (
            SELECT kind, scenario, condition, seed, label, frame, time_s, status, overlap, scored, {values},
                sqrt(amodal_box[3] * amodal_box[4]) AS size,
                time_s - lag(time_s) OVER (PARTITION BY scenario, condition, seed, label ORDER BY frame) AS lasts_s,
                CASE WHEN visible_fraction > 0.5 AND NOT isnan(luminance) THEN luminance END AS seen_luminance
            FROM frames
        )
        SELECT kind, scenario, condition, seed, label, frame, time_s, status, overlap, scored, {tags} FROM sized
        WINDOW near AS (
            PARTITION BY scenario, condition, seed, label ORDER BY time_s
            RANGE BETWEEN {AROUND_S} PRECEDING AND {AROUND_S} FOLLOWING
        )
        """
    )
    names = ", ".join(TAGS)
    database.execute(
        f"""
        CREATE VIEW losses AS
        WITH spans AS (
            -- A span begins with a frame in which the target is tracked; in it a run of low overlaps ends with one that
            -- is not low. Frames without the target do neither, nor do they count.
            SELECT *, time_s - lag(time_s) OVER episode AS lasts_s,
                max(CASE WHEN scored AND status = 'ok' AND overlap >= {TRACKED} THEN frame END) OVER episode AS tracked,
                count(*) FILTER (scored AND overlap >= {LOST}) OVER episode AS run
            FROM moments WHERE status <> 'error'
            WINDOW episode AS (PARTITION BY scenario, condition, seed, label ORDER BY frame)
        ), lost AS (
            SELECT scenario, condition, seed, label, tracked AS frame, min(time_s) AS lost_s
            FROM spans WHERE scored AND overlap < {LOST} AND tracked IS NOT NULL
            GROUP BY scenario, condition, seed, label, tracked, run HAVING sum(lasts_s) >= {LOST_S} - 1e-6
        ), began AS (
            SELECT *, lead(time_s) OVER (PARTITION BY scenario, condition, seed, label ORDER BY frame) AS found_s
            FROM spans WHERE frame = tracked
        )
        SELECT scenario, condition, seed, label, frame, time_s, min(lost_s) AS lost_s, found_s, {names}
        FROM began JOIN lost USING (scenario, condition, seed, label, frame) GROUP BY ALL ORDER BY ALL
        """
    )


def loss_shares(store: RunStore) -> dict[str, LossShares]:
    """Losses of each tracker of a run, by label, in the plan's order.

    Raises:
        RunError: There is no finished episode, or a file cannot be read.
    """
    tags = ", ".join(f"avg({name}::INTEGER)" for name in TAGS)
    seen = f"SELECT label, count(*)::INTEGER, [{tags}] AS seen FROM moments WHERE scored GROUP BY label"
    ends = (
        "SELECT label, count(*)::INTEGER, count(*) FILTER (NOT tracked)::INTEGER, count(error)::INTEGER FROM summary "
        f"JOIN (SELECT scenario, condition, seed, label, {EVER_TRACKED} AS tracked FROM moments WHERE scored "
        "GROUP BY ALL) USING (scenario, condition, seed, label) GROUP BY label"
    )
    lost = (
        f"SELECT label, count(*), count(DISTINCT (scenario, condition, seed)), [{tags}] AS lost "
        "FROM losses GROUP BY label"
    )
    found: dict[str, LossShares] = {}
    frames, ended, losses = ({row[0]: row[1:] for row in store.query(one).rows} for one in (seen, ends, lost))
    for label, (episodes, untracked, errors) in ended.items():
        frame_count, usual = frames[label]
        count, episodes_lost, shares = losses.get(label, (0, 0, [math.nan] * len(TAGS)))
        found[label] = LossShares(
            *(count, episodes, episodes_lost, untracked, errors),
            dict(zip(TAGS, shares, strict=True)),
            frame_count,
            dict(zip(TAGS, usual, strict=True)),
        )
    return {label: found[label] for label in store.plan.labels if label in found}


def overlaps_by_tag(store: RunStore, label: str) -> dict[str, dict[tuple[str, str, int], float]]:
    """A tracker's mean overlap on the frames with a tag around them: by tag, and by scenario, condition and seed.

    Raises:
        RunError: There is no finished episode, or a file cannot be read.
    """
    means = ", ".join(f"avg(overlap) FILTER ({name})" for name in TAGS)
    rows = store.query(
        f"SELECT scenario, condition, seed, {means} FROM moments "
        f"WHERE scored AND status <> 'init' AND label = {sql_text(label)} GROUP BY ALL ORDER BY ALL"
    ).rows
    return {
        tag: {(row[0], row[1], row[2]): row[3 + place] for row in rows if row[3 + place] is not None}
        for place, tag in enumerate(TAGS)
    }
