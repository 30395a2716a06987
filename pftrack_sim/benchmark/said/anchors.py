"""Accuracy, robustness and expected average overlap of a run that starts trackers from anchors, as VOT 2020 does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pftrack_sim.benchmark.asked.plan import START
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.core.types import FloatArray
from pftrack_sim.score.protocols import Anchored, from_anchors


@dataclass(frozen=True)
class AnchorScores:
    """Scores of each tracker and condition, for each seed over its scenarios.

    Attributes:
        scores: By condition apart from the start, tracker and seed.
        lengths: Middle half of the lengths of all runs [frames], over which expected average overlaps are averaged.
    """

    scores: Mapping[tuple[str, str], Mapping[int, Anchored]]
    lengths: tuple[int, int]


def anchor_scores(store: RunStore) -> AnchorScores | None:
    """Scores of a run from anchors, of frames in which the target can be seen; None for runs that go forward only.

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
    return AnchorScores(
        {
            key: {seed: from_anchors(list(own.values()), lengths) for seed, own in sorted(by.items())}
            for key, by in sorted(runs.items())
        },
        lengths,
    )
