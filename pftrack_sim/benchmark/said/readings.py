"""Boxes that are not what they should be: x, y, w, h in pixels."""

from __future__ import annotations

import numpy as np

from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.score.frames import FIRST_FRAMES, misread_boxes


def misread_trackers(store: RunStore) -> list[str]:
    """A sentence for each tracker of a run whose first boxes fit the truth far better in another convention.

    Raises:
        RunError: There is no finished episode, or a file cannot be read.
    """
    rows = store.query(
        f"SELECT label, estimate, {store.plan.truth}, K FROM frames "
        "WHERE status = 'ok' AND estimate IS NOT NULL AND scored QUALIFY row_number() OVER "
        f"(PARTITION BY label ORDER BY scenario, condition, seed, frame) <= {FIRST_FRAMES} ORDER BY ALL"
    ).rows
    found: list[str] = []
    for label in dict.fromkeys(row[0] for row in rows):
        own = [row[1:] for row in rows if row[0] == label]
        camera = np.reshape(own[0][2], (3, 3))
        # The principal point is in the middle of the image, or nearly so.
        size = (2.0 * float(camera[0, 2]), 2.0 * float(camera[1, 2]))
        said = misread_boxes([row[0] for row in own], [row[1] for row in own], size)
        if said is not None:
            found.append(f"{label}: {said}")
    return found
