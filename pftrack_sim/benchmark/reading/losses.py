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
"""Overlap from which the target counts as tracked: a loss begins with the last such frame before an overlap of 0."""

AROUND_S = 0.5
"""What happens up to so long before and after a loss began belongs to it."""

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
            "the target's centre moves by more than 0.3 sizes between two frames",
            "max(image_motion_px / size) OVER near > 0.3",
        ),
        "truncated": ("more than a tenth of the target's box is outside the image", "max(truncation) OVER near > 0.1"),
        "scale_change": (
            "the target's size changes by a factor above 1.25",
            "max(size) OVER near > 1.25 * min(size) OVER near",
        ),
    }
)
"""What can happen at a loss: meaning and SQL, within `AROUND_S` of it. Several can be true of one loss.

The limit of fast motion is near the 75 % quantile of `step_p95` in recorded video (`score.profile.recorded_quantiles`).
"""

LOSS = (
    f"an overlap of 0 in a frame in which the target can be seen, after it was tracked (at least {TRACKED}); "
    "it begins with the last frame in which it was tracked"
)
"""Definition of a loss."""


@dataclass(frozen=True)
class LossShares:
    """How often a tracker lost the target, and what happened then.

    Attributes:
        losses: Number of losses.
        episodes: Number of episodes with one.
        shares: Share of the losses, by tag; NaN without losses.
        frames: Share of all frames in which the target can be seen that have the tag around them.
    """

    losses: int
    episodes: int
    shares: Mapping[str, float]
    frames: Mapping[str, float]

    @property
    def statement(self) -> str:
        """Number of losses and what they begin with more often than other frames have it, as the end of a sentence."""
        if not self.losses:
            return "never loses the target"
        tag = max(TAGS, key=lambda one: self.shares[one] - self.frames[one])
        often = f"{self.losses} time{'s' if self.losses != 1 else ''}"
        said = f"loses the target {often} in {self.episodes} episode{'s' if self.episodes != 1 else ''}"
        if self.shares[tag] <= self.frames[tag]:
            return said
        return f"{said}; {self.shares[tag]:.0%} begin with: {tag_title(tag)} ({self.frames[tag]:.0%} of all frames)"


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
            SELECT kind, scenario, condition, seed, label, frame, time_s, overlap, scored, {values},
                sqrt(amodal_box[3] * amodal_box[4]) AS size,
                CASE WHEN visible_fraction > 0.5 AND NOT isnan(luminance) THEN luminance END AS seen_luminance
            FROM frames
        )
        SELECT kind, scenario, condition, seed, label, frame, time_s, overlap, scored, {tags} FROM sized
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
            SELECT *, max(CASE WHEN scored AND overlap >= {TRACKED} THEN frame END) OVER (
                PARTITION BY scenario, condition, seed, label ORDER BY frame) AS tracked
            FROM moments
        ), grouped AS (
            SELECT scenario, condition, seed, label, tracked AS frame, min(time_s) AS time_s,
                min(frame) FILTER (scored AND overlap = 0) AS zero_frame,
                min(time_s) FILTER (scored AND overlap = 0) AS zero_s,
                {", ".join(f"first({name} ORDER BY frame) AS {name}" for name in TAGS)}
            FROM spans WHERE tracked IS NOT NULL GROUP BY ALL
        ), followed AS (
            SELECT *, lead(time_s) OVER (PARTITION BY scenario, condition, seed, label ORDER BY frame) AS found_s
            FROM grouped
        )
        SELECT scenario, condition, seed, label, frame, time_s, zero_frame, zero_s, found_s, {names} FROM followed
        WHERE zero_frame IS NOT NULL ORDER BY ALL
        """
    )


def loss_shares(store: RunStore) -> dict[str, LossShares]:
    """Losses of each tracker of a run, by label, in the plan's order.

    Raises:
        RunError: There is no finished episode, or a file cannot be read.
    """
    tags = ", ".join(f"avg({name}::INTEGER)" for name in TAGS)
    seen = f"SELECT label, [{tags}] AS seen FROM moments WHERE scored GROUP BY label"
    lost = (
        f"SELECT label, count(*) AS losses, count(DISTINCT (scenario, condition, seed)) AS episodes, [{tags}] AS lost "
        "FROM losses GROUP BY label"
    )
    rows = store.query(
        f"SELECT label, losses, episodes, lost, seen FROM ({seen}) LEFT JOIN ({lost}) USING (label)"
    ).rows
    found = {
        label: LossShares(
            losses or 0,
            episodes or 0,
            dict(zip(TAGS, shares or [math.nan] * len(TAGS), strict=True)),
            dict(zip(TAGS, frames, strict=True)),
        )
        for label, losses, episodes, shares, frames in rows
    }
    return {label: found[label] for label in store.plan.labels if label in found}


def overlaps_by_tag(store: RunStore, label: str) -> dict[str, dict[tuple[str, str, int], float]]:
    """A tracker's mean overlap on the frames with a tag around them: by tag, and by scenario, condition and seed.

    Raises:
        RunError: There is no finished episode, or a file cannot be read.
    """
    means = ", ".join(f"avg(overlap) FILTER ({name})" for name in TAGS)
    rows = store.query(
        f"SELECT scenario, condition, seed, {means} FROM moments "
        f"WHERE scored AND frame > 0 AND label = {sql_text(label)} GROUP BY ALL ORDER BY ALL"
    ).rows
    return {
        tag: {(row[0], row[1], row[2]): row[3 + place] for row in rows if row[3 + place] is not None}
        for place, tag in enumerate(TAGS)
    }
