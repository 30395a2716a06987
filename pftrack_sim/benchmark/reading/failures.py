"""Why drives failed, by the truth, as a view over a run's frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from pftrack_sim.benchmark.reading.losses import AROUND_S, TRACKED
from pftrack_sim.controllers.base import LEAST_CONFIDENCE
from pftrack_sim.score.following import FOUND_S

if TYPE_CHECKING:
    from pftrack_sim.benchmark.reading.store import RunStore

AFTER_S = 5.0
"""How long after the target was last tracked the estimate tells where it went."""

ON_ANOTHER_S = 1.0
"""An estimate that overlaps another person for so long of these has gone over to them."""

OFF_SIZE = 1.2
"""Heights that differ by more than this factor are read as another distance."""

CAUSES: Mapping[str, str] = MappingProxyType(
    {
        "error": "the tracker ended with an error",
        "collision": f"the robot hit something, or came too near, within {FOUND_S:g} s of having tracked the target",
        "never tracked": "the target was never tracked",
        "look-alike": f"within {AFTER_S:g} s the estimate was on another person for {ON_ANOTHER_S:g} s",
        "size": f"tracked to the end, but with a height wrong by a factor above {OFF_SIZE:g}, and so a wrong distance",
        "search": f"the target was covered, the tracker said so, and it was not in sight again for {FOUND_S:g} s",
        "hidden": "the target was covered, and the estimate stayed elsewhere, or did not find it when it was in sight",
        "too slow": "the target left the picture of a right estimate, or was tracked to the end, too far away",
        "drift": "the estimate left the target while more than half of it was visible",
    }
)
"""What can have made a drive fail, by the truth from the moment at which its target was last tracked: meanings; the
first that is true counts. Tracked: an overlap of at least `TRACKED`, also in most frames of the second before."""

FAILURES = f"""
CREATE VIEW failures AS
WITH drives AS (
    SELECT frames.*, number, place, summary.error, collided_with, follow_collision = 1 AS collided,
        status = 'ok' AND coalesce(scored AND overlap >= {TRACKED}, false) AS tracked,
        after_s - lag(after_s, 1, 0) OVER (PARTITION BY number, place ORDER BY frame) AS lasts_s
    FROM frames JOIN summary USING (scenario, condition, seed, label) WHERE follow_success = 0
), sure AS (
    SELECT *, tracked AND avg(tracked::INTEGER) OVER (
        PARTITION BY number, place ORDER BY time_s RANGE 1 PRECEDING) >= 0.5 AS had FROM drives
), ends AS (
    SELECT number, place, max(time_s) FILTER (had) AS last_s, max(time_s) AS end_s FROM sure GROUP BY ALL
), others AS (
    SELECT scenario, condition, seed, label, frame, arg_max(person, shared / (area + of_person - shared)) AS other
    FROM (
        SELECT *, estimate[3] * estimate[4] AS area, own[3] * own[4] AS of_person,
            greatest(least(estimate[1] + estimate[3], own[1] + own[3]) - greatest(estimate[1], own[1]), 0)
            * greatest(least(estimate[2] + estimate[4], own[2] + own[4]) - greatest(estimate[2], own[2]), 0) AS shared
        FROM (
            SELECT people.* EXCLUDE amodal_box, people.amodal_box AS own, estimate
            FROM people JOIN drives USING (scenario, condition, seed, label, frame)
            WHERE person <> 'target' AND estimate IS NOT NULL AND NOT estimate_occluded AND NOT tracked
        )
    ) WHERE shared >= {TRACKED} * (area + of_person - shared) GROUP BY ALL
), seen AS (
    SELECT number, place, any_value(drives.scenario) AS scenario, any_value(drives.condition) AS condition,
        any_value(drives.seed) AS seed, any_value(drives.label) AS label, any_value(last_s) AS last_s,
        any_value(end_s) AS end_s, any_value(error) AS error, bool_or(collided) AS collided,
        any_value(collided_with) AS collided_with,
        min(visible_fraction) FILTER (state <> 'out_of_view' AND near) < 0.5 AS hidden,
        any_value(occluders[1]) FILTER (near AND visible_fraction < 0.5) AS cover,
        max(truncation) FILTER (near) > 0.9 AS left_picture,
        median(ln(estimate[4] / amodal_box[4])) FILTER (time_s > end_s - 1) AS growth,
        sum(lasts_s) FILTER (soon AND other IS NOT NULL) >= {ON_ANOTHER_S} AS on_another,
        mode(other) FILTER (soon) AS other,
        avg((estimate_occluded OR confidence < {LEAST_CONFIDENCE})::INTEGER) FILTER (soon) >= 0.5 AS said,
        coalesce(sum(lasts_s) FILTER (time_s > last_s AND state = 'visible' AND visible_fraction >= 0.5), 0)
            >= {FOUND_S} AS in_sight
    FROM (
        SELECT drives.*, last_s, end_s, time_s BETWEEN last_s - {AROUND_S} AND last_s + 1 AS near,
            time_s > last_s AND time_s <= last_s + {AFTER_S} AS soon
        FROM drives JOIN ends USING (number, place)
    ) AS drives LEFT JOIN others USING (scenario, condition, seed, label, frame)
    GROUP BY number, place
)
SELECT scenario, condition, seed, label, last_s AS time_s,
    CASE
        WHEN error IS NOT NULL THEN 'error'
        WHEN collided AND end_s <= last_s + {FOUND_S} THEN 'collision'
        WHEN last_s IS NULL THEN 'never tracked'
        WHEN on_another THEN 'look-alike'
        WHEN end_s <= last_s + {FOUND_S} THEN if(abs(growth) > ln({OFF_SIZE}), 'size', 'too slow')
        WHEN hidden AND said AND NOT in_sight THEN 'search'
        WHEN hidden THEN 'hidden'
        WHEN left_picture THEN 'too slow'
        ELSE 'drift'
    END AS cause,
    CASE WHEN cause = 'error' THEN error WHEN cause = 'look-alike' THEN other
        WHEN cause = 'collision' THEN coalesce(collided_with, 'target')
        WHEN cause IN ('hidden', 'search') THEN cover END AS by_what
FROM seen ORDER BY number, place
"""
"""SQL of the view, over `frames`, `people` and `summary`: the drives without success in the plan's order, each with its
cause, when its target was last tracked [s], and the person, thing or error that caused it."""


@dataclass(frozen=True)
class Failure:
    """A drive without success.

    Attributes:
        cause: Of `CAUSES`.
        time_s: When the target was last tracked; None: never.
        what: The person, thing or error that caused it, if there is one.
    """

    scenario: str
    condition: str
    seed: int
    label: str
    time_s: float | None
    cause: str
    what: str | None

    @property
    def statement(self) -> str:
        """`"look-alike (distractor-2) at 50.1 s"`."""
        what = f" ({self.what})" if self.what and self.cause != "error" else ""
        return f"{self.cause}{what}" + ("" if self.time_s is None else f" at {self.time_s:.1f} s")


def failures(store: RunStore) -> dict[tuple[str, str, int, str], Failure]:
    """Drives without success by scenario, condition, seed and label, in the plan's order; none in open loop.

    Raises:
        RunError: There is no finished episode, or a file cannot be read.
    """
    if store.plan.kind != "follow":
        return {}
    return {row[:4]: Failure(*row) for row in store.query("FROM failures").rows}
