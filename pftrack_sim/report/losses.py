"""Losses of the page: when each tracker lost the target, and what happened then."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pftrack_sim.benchmark import RunStore
from pftrack_sim.benchmark.losses import LOSS, TAGS, tag_title

_KEY = "scenario, condition, seed, label"


def losses_of(store: RunStore, trackers: Sequence[str], numbers: Mapping[tuple[str, str, int], int]) -> dict[str, Any]:
    """Data of the losses.

    Args:
        store: The run.
        trackers: Labels in the order of the page.
        numbers: The page's episodes by scenario, condition and seed.

    Returns:
        `loss`: the definition; `tags`: names and meanings; `losses`: rows of tracker, episode, first and zero time [s],
        time found again or null, and a bit for each tag; `moments`: rows of tracker, episode, number of frames in which
        the target can be seen, and number of those with each tag.
    """
    bits = " + ".join(f"{name}::INTEGER * {1 << place}" for place, name in enumerate(TAGS))
    counts = ", ".join(f"sum({name}::INTEGER)::INTEGER" for name in TAGS)
    lost = store.query(f"SELECT {_KEY}, round(time_s, 3), round(zero_s, 3), round(found_s, 3), {bits} FROM losses")
    seen = store.query(f"SELECT {_KEY}, count(*), {counts} FROM moments WHERE scored GROUP BY ALL ORDER BY ALL")

    def rows(found: Sequence[tuple[Any, ...]]) -> list[list[Any]]:
        return [
            [trackers.index(label), numbers[scenario, condition, seed], *values]
            for scenario, condition, seed, label, *values in found
        ]

    meanings = [[tag_title(name), words] for name, (words, _) in TAGS.items()]
    return {"loss": LOSS, "tags": meanings, "losses": rows(lost.rows), "moments": rows(seen.rows)}
