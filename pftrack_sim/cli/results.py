"""The commands `export-results` and `score`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pftrack_sim.cli import tables
from pftrack_sim.cli.options import SequenceLayout
from pftrack_sim.cli.progress import progress_bar

if TYPE_CHECKING:
    from pftrack_sim.benchmark.results import Scored
    from pftrack_sim.score import Summary

_MOST_SEQUENCES = 40


def export_results(
    run: Annotated[Path, typer.Argument(help="Run folder that bench wrote.")],
    out: Annotated[Path, typer.Option(help="Folder of the results.")],
    form: Annotated[str, typer.Option("--format", help="otb, got10k, vot or mot.")] = "got10k",
) -> None:
    """Write a run's estimates as result files of a toolkit.

    They belong to the data set that export writes of the same scenarios and seeds.
    """
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.benchmark.results import export_results as export_all

    store = RunStore(run)
    with progress_bar("writing results", store.plan.episode_count) as tick:
        export_all(store, out, form, on_episode=tick)
    tables.print_folder(out)


def score(
    results: Annotated[Path, typer.Argument(help="Folder of result files, of this or of another toolkit.")],
    dataset: Annotated[Path, typer.Option(help="Folder of the data set, or of one sequence.")],
    layout: SequenceLayout = None,
    form: Annotated[
        str | None, typer.Option("--results-format", help="otb, got10k, vot or mot; default: found by the files.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder to write report.html and results.csv into.")] = None,
) -> None:
    """Score result files of other tools against a data set.

    With --out, report.html has leader board, curves, overlap frame by frame and paired differences, and results.csv
    all measures of every file.
    """
    from pftrack_sim.benchmark.results import score_results
    from pftrack_sim.report import write_scored

    found = score_results(results, dataset, layout=layout, form=form)
    _print_scored(found)
    if out is not None:
        tables.print_folder(write_scored(found, out, {"results": str(results), "data set": str(dataset)}))


def _print_scored(found: Scored) -> None:
    """Print the overlap on each sequence, our measures over all, the benchmark's own, and comparisons in pairs."""
    from pftrack_sim.benchmark.results import score_text
    from pftrack_sim.report.tables import Table, interval_of, number_text

    overlaps: dict[str, dict[str, list[float]]] = {}
    groups: dict[tuple[str, str], list[Summary]] = {}
    for one in found.results:
        tracker = one.tracker.label
        overlaps.setdefault(one.sequence, {}).setdefault(tracker, []).append(one.summary.mean_overlap)
        groups.setdefault(("", tracker), []).append(one.summary)
    trackers = [tracker for _, tracker in groups]
    if len(overlaps) <= _MOST_SEQUENCES:
        rows = [
            [name, *(number_text(interval_of(by_tracker.get(one, []))[0]) for one in trackers)]
            for name, by_tracker in overlaps.items()
        ]
        tables.print_table(Table("Mean overlap per sequence", ("sequence",), trackers, rows))
    tables.print_groups("frames with a known box", groups, unit="result")
    if found.benchmark:
        heads = list(next(iter(found.benchmark.values())))
        spaced = [name.replace("_", "\n", 1) for name in heads]
        rows = [[one, *(score_text(values[name]) for name in heads)] for one, values in found.benchmark.items()]
        tables.print_table(Table("As the benchmark's own scorer computes them", ("tracker",), spaced, rows))
    if found.comparisons:
        title = "Differences of mean overlap over sequences (95% interval, p of the sign-flip test after Holm)"
        rows = [
            [
                *(pair.first, pair.second, str(pair.seeds)),
                tables.difference_text(pair.difference, pair.low, pair.high),
                number_text(pair.p_corrected),
            ]
            for pair in found.comparisons
        ]
        tables.print_table(Table(title, ("first", "second"), ("sequences", "first - second", "p"), rows))
