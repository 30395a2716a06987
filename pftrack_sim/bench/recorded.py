"""Trackers on recorded sequences: the same contest, with images from a folder and boxes drawn by hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pftrack_sim import score
from pftrack_sim.bench.contest import enter
from pftrack_sim.formats import RecordedSequence
from pftrack_sim.score import Summary


@dataclass(frozen=True)
class RecordedResult:
    """What one tracker scored on one sequence with one seed."""

    sequence: str
    tracker: str
    seed: int
    summary: Summary
    failure: str | None


def evaluate(
    sequences: Sequence[RecordedSequence],
    trackers: Sequence[str],
    seeds: Sequence[int],
    *,
    preset: str = "default",
    on_frame: Callable[[], None] = lambda: None,
) -> list[RecordedResult]:
    """Run every tracker on every sequence with every seed.

    A tracker starts at the first frame with truth; frames without truth are shown and not scored.

    Args:
        sequences: As `formats.read_sequence` gives them.
        trackers: Names for `trackers.make`.
        seeds: Seeds of the trackers.
        preset: Preset of every tracker.
        on_frame: Called for every frame, tracker and seed.

    Raises:
        UnknownNameError: An unknown tracker.
        SequenceError: An image cannot be read.
    """
    results: list[RecordedResult] = []
    for sequence in sequences:
        entries = [(seed, entry) for seed in seeds for entry in enter(trackers, seed=seed, preset=preset)]
        known = np.isfinite(sequence.truth[:, 0])
        for index in range(len(sequence)):
            image = sequence.image(index)
            for _, entry in entries:
                entry.see(image, sequence.truth[index], bool(known[index]))
                on_frame()
        for seed, entry in entries:
            overlap = score.overlaps(entry.boxes, sequence.truth)
            error = score.centre_errors(entry.boxes, sequence.truth)
            summary = score.summarise(overlap, error, known, np.array(entry.ms))
            results.append(RecordedResult(sequence.name, entry.name, seed, summary, entry.failure))
    return results
