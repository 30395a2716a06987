"""Accuracy, robustness and expected average overlap of a run that starts trackers from anchors, as VOT 2020 does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from pftrack_sim.benchmark.asked.plan import START
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.core.types import FloatArray
from pftrack_sim.score.protocols import from_anchors

Scores: TypeAlias = Mapping[tuple[str, str], Mapping[int, Mapping[str, float]]]
"""`score.protocols.from_anchors` for each seed over its scenarios, by condition apart from the start, and tracker."""


def anchor_scores(store: RunStore) -> tuple[Scores, tuple[int, int]] | None:
    """Scores of a run from anchors, of frames in which the target can be seen; None for runs that go forward only.

    Beside them the lengths of `from_anchors`: the middle half of those of all runs.

    Raises:
        RunError: A file cannot be read.
    """
    if not any(episode.backward for episode in store.plan.first_episodes):
        return None
    rows = store.query(
        "SELECT condition, label, seed, scenario, list(overlap ORDER BY frame) FROM frames WHERE scored GROUP BY ALL"
    ).rows
    runs: dict[tuple[str, str], dict[int, dict[str, list[FloatArray]]]] = {}
    for name, label, seed, scenario, overlaps in rows:
        condition = store.plan.conditions[name]
        others = condition.model_copy(update={"levels": tuple(one for one in condition.levels if one[0] != START)})
        own = runs.setdefault((others.name, label), {}).setdefault(seed, {}).setdefault(scenario, [])
        own.append(np.array(overlaps, dtype=np.float64))
    counts = [one.size for by in runs.values() for own in by.values() for some in own.values() for one in some]
    low, high = (round(float(one)) for one in np.quantile(counts, (0.25, 0.75)))
    lengths = max(low, 1), max(high, low, 1) + 1
    scores = {
        key: {seed: from_anchors(list(own.values()), lengths) for seed, own in sorted(by.items())}
        for key, by in sorted(runs.items())
    }
    return scores, lengths
