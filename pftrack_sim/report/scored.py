"""Report of scored result files: the page of a run, with sequences in the place of seeds, and a table of numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

import pftrack_sim
from pftrack_sim.benchmark.datasets.results import Scored, ScoredResult, score_text
from pftrack_sim.benchmark.kept.files import csv_text, write_bytes
from pftrack_sim.benchmark.reading.losses import LOSS
from pftrack_sim.core.errors import RunError
from pftrack_sim.report.build import render_page
from pftrack_sim.report.contents import Shown, TrackerFrames, board, episode_entry, matrix
from pftrack_sim.report.tables import Table

_TABLE = "results.csv"


def write_scored(found: Scored, out: Path, sources: Mapping[str, str]) -> Path:
    """Write `report.html` and `results.csv`, a row for each result file, into a folder.

    Args:
        found: The scores.
        out: The folder; other files in it stay.
        sources: What was scored, by name, for the page's provenance.

    Returns:
        The page's path.

    Raises:
        RunError: The folder is a file, or cannot be written to.
    """
    if out.exists() and not out.is_dir():
        raise RunError(f"{out} is not a folder")
    rows = [
        {"tracker": one.tracker.label, "sequence": one.sequence, "repetition": one.seed, **one.summary.as_dict()}
        for one in found.results
    ]
    page = render_page(
        out.resolve().name,
        _contents(found),
        benchmark=benchmark_table(found),
        how=[*sources.items(), ("version", pftrack_sim.__version__)],
    )
    write_bytes(out / "report.html", page.encode())
    write_bytes(out / _TABLE, csv_text(list(rows[0]), [list(row.values()) for row in rows]).encode())
    return out / "report.html"


def benchmark_table(found: Scored) -> Table | None:
    """For each tracker what the scorer of the data set's own benchmark computes; None where it has none."""
    if not found.benchmark:
        return None
    heads = list(next(iter(found.benchmark.values())))
    rows = [[tracker, *(score_text(values[name]) for name in heads)] for tracker, values in found.benchmark.items()]
    spaced = [name.replace("_", "\n", 1) for name in heads]
    return Table("As the benchmark's own scorer computes them", ("tracker",), spaced, rows)


def _contents(found: Scored) -> dict[str, Any]:
    trackers = list(dict.fromkeys(one.tracker.label for one in found.results))
    sequences = list(dict.fromkeys(one.sequence for one in found.results))
    return {
        **board(trackers, trackers, _episodes(found.results, sequences)),
        "unit": "sequence",
        "scenarios": sequences,
        "conditions": ["base"],
        "levels": [{}],
        "axes": [],
        "maps": [],
        "drives": [],
        "matrix": matrix(found.comparisons, trackers),
        "loss": LOSS,
        "tags": [],
        "losses": [],
        "moments": [],
    }


def _episodes(
    results: Sequence[ScoredResult], sequences: Sequence[str]
) -> Iterator[tuple[dict[str, Any], list[Shown]]]:
    """Trackers by sequence and repetition."""
    for name in sequences:
        for repetition in sorted({one.seed for one in results if one.sequence == name}):
            its = [one for one in results if (one.sequence, one.seed) == (name, repetition)]
            shown = [_shown(one) for one in its]
            entry = episode_entry(repetition, its[0].rate_hz, shown[0].frames)
            yield entry | {"scenario": sequences.index(name), "condition": 0}, shown


def _shown(one: ScoredResult) -> Shown:
    seen = np.isfinite(one.frames.truth[:, 0])
    time_s = np.arange(len(seen)) / one.rate_hz
    frames = TrackerFrames(time_s, one.frames.overlap, one.frames.centre_error_px, seen.astype(np.float64), seen)
    values = {name: None if np.isnan(value) else value for name, value in asdict(one.summary).items()}
    return Shown(one.tracker.label, values, one.error, frames)
