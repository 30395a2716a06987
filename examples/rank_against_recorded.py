"""Does the board of a frozen suite rank trackers as recorded video does? Spearman's correlation of mean overlaps.

    python examples/rank_against_recorded.py SEQUENCE... --seeds 0:2 --box-noise 0.1

The trackers are those with reference results of the suite that need nothing but images; sequences are what
`pftrack-sim evaluate` reads. Recorded means are over the sequences, those of the board over its scenarios. The
agreement of a half of the sequences with the board is printed beside that of two halves with each other.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from overlap_and_following import interval_of, means, rank_correlation

from pftrack_sim import score, trackers
from pftrack_sim.benchmark import TrackerSpec, parse_seeds
from pftrack_sim.benchmark.asked.suite import newest
from pftrack_sim.benchmark.datasets.recorded import evaluate
from pftrack_sim.benchmark.reading.summary import by_seed
from pftrack_sim.benchmark.reference.submission import references
from pftrack_sim.cli.progress import progress_bar
from pftrack_sim.core.errors import PftrackError
from pftrack_sim.formats import read_sequences

SPLITS = 1000


def board(suite: str) -> dict[str, tuple[TrackerSpec, NDArray[np.float64]]]:
    """By label a tracker that needs only images, and its `(S,)` mean overlaps over the scenarios for each seed."""
    found: dict[str, tuple[TrackerSpec, NDArray[np.float64]]] = {}
    for one in references(suite):
        spec = one.about.trackers[0]
        try:
            made = trackers.make(spec.name, preset=spec.preset, **spec.params)
        except PftrackError as error:
            print(f"without {one.label}: {error}", file=sys.stderr)
            continue
        if isinstance(made, trackers.NeedsTruth | trackers.NeedsDetections):
            continue
        rows = [row for row in one.rows if row["kind"] == "open" and row["mean_overlap"] is not None]
        overlaps = by_seed((row["seed"], row["mean_overlap"]) for row in rows)
        found[one.label] = spec, np.array([overlaps[seed] for seed in sorted(overlaps)])
    return found


def recorded(
    paths: Sequence[Path], specs: Sequence[TrackerSpec], seeds: Sequence[int], noise: float
) -> dict[str, NDArray[np.float64]]:
    """By label the `(N,)` mean overlaps of a tracker on sequences."""
    sequences = [one for path in paths for one in read_sequences(path)]
    with progress_bar("tracking", sum(len(one) for one in sequences)) as tick:
        results = evaluate(sequences, specs, seeds, box_noise=noise, on_frame=tick)
    overlaps: dict[tuple[str, str], list[float]] = {}
    for one in results:
        overlaps.setdefault((one.tracker.label, one.sequence), []).append(one.summary.mean_overlap)
    return {spec.label: np.array([np.mean(overlaps[spec.label, one.name]) for one in sequences]) for spec in specs}


def agreement(real: NDArray[np.float64], drawn: NDArray[np.float64]) -> tuple[float, float, float]:
    """Spearman's correlation of `(T, N)` recorded and `(T, S)` simulated overlaps without noise, and its interval.

    With 12 sequences and 18 seeds the interval covers 93 to 99 % of correlations of 0.55 to 0.98: 200 simulations each
    (`coverage` in `tests/examples/test_rank_against_recorded.py`, `apart` 0.03 to 0.3, `spread` 0.15 and 0.3).
    """
    count = real.shape[1]
    return interval_of(
        lambda weights: rank_correlation(means(real, weights[:, :count]), means(drawn, weights[:, count:])),
        count,
        drawn.shape[1],
    )


def agreement_of_halves(real: NDArray[np.float64], drawn: NDArray[np.float64]) -> tuple[float, float]:
    """Mean correlation of one half of the sequences with the other, and with the board, over random halves."""
    generator, count = np.random.default_rng(0), real.shape[1]
    order = generator.permuted(np.tile(np.arange(count), (SPLITS, 1)), axis=1)
    weights = np.stack([order < count // 2, order >= count - count // 2]) / (count // 2)
    half, other = (means(real, one.astype(np.float64)) for one in weights)
    whole = np.tile(drawn.mean(axis=1), (SPLITS, 1))
    return float(rank_correlation(half, other).mean()), float(rank_correlation(half, whole).mean())


def report(real: Mapping[str, NDArray[np.float64]], drawn: Mapping[str, NDArray[np.float64]], suite: str) -> str:
    """A row for each tracker, the correlation, and from five sequences on its interval and the agreement of halves."""
    labels = sorted(real, key=lambda one: -float(real[one].mean()))
    rows = [f"{one:24} {real[one].mean():.3f}  {drawn[one].mean():.3f}" for one in labels]
    both = np.array([real[one] for one in labels]), np.array([drawn[one] for one in labels])
    count, seeds = (one.shape[1] for one in both)
    said = f"Spearman {rank_correlation(*(one.mean(axis=1)[None] for one in both))[0]:.2f}"
    after = f": {len(labels)} trackers, {count} sequences, {seeds} seeds"
    if count >= score.LEAST_FOR_INTERVAL:
        value, low, high = agreement(*both)
        halves, with_board = agreement_of_halves(*both)
        said += f", without noise {value:.2f} ({low:.2f} to {min(high, 1.0):.2f})"
        after += f"\nHalf of the sequences and {suite}: {with_board:.2f}; half of them and the other half: {halves:.2f}"
    return "\n".join([f"{'tracker':24} recorded  {suite}", *rows, said + after])


def main() -> None:
    """Run the trackers of the board on the sequences, and print both."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sequences", type=Path, nargs="+")
    parser.add_argument("--suite", default=newest("standard"))
    parser.add_argument("--seeds", type=parse_seeds, default=parse_seeds("0"), help="of the trackers")
    parser.add_argument("--box-noise", type=float, default=0.0, help="as of `pftrack-sim evaluate`")
    given = parser.parse_args()
    try:
        known = board(given.suite)
        if len(known) < 3:
            parser.error(f"suite {given.suite!r} has reference results of {len(known)} trackers that need only images")
        found = recorded(given.sequences, [spec for spec, _ in known.values()], given.seeds, given.box_noise)
    except PftrackError as error:
        parser.error(str(error))
    print(report(found, {label: overlaps for label, (_, overlaps) in known.items()}, given.suite))


if __name__ == "__main__":
    main()
