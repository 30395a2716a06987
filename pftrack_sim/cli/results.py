"""The commands `export-results` and `score`."""

from __future__ import annotations

import math
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

    overlaps: dict[str, dict[str, list[float]]] = {}
    groups: dict[tuple[str, str], list[Summary]] = {}
    for one in found.results:
        tracker = one.tracker.label
        overlaps.setdefault(one.sequence, {}).setdefault(tracker, []).append(one.summary.mean_overlap)
        groups.setdefault(("", tracker), []).append(one.summary)
    trackers = [tracker for _, tracker in groups]
    if len(overlaps) <= _MOST_SEQUENCES:
        table = tables.new_table("Mean overlap per sequence", ("sequence",), trackers)
        for name, by_tracker in overlaps.items():
            runs = [by_tracker.get(one, []) for one in trackers]
            table.add_row(name, *(f"{sum(run) / len(run):.3f}" if run else "-" for run in runs))
        tables.print_table(table)
    tables.print_groups("frames with a known box", groups, unit="result")
    if found.benchmark:
        heads = list(next(iter(found.benchmark.values())))
        spaced = [name.replace("_", "\n", 1) for name in heads]
        table = tables.new_table("As the benchmark's own scorer computes them", ("tracker",), spaced)
        for tracker, values in found.benchmark.items():
            table.add_row(tracker, *(score_text(values[name]) for name in heads))
        tables.print_table(table)
    if found.comparisons:
        table = tables.new_table(
            "Differences of mean overlap over sequences (95% interval, p of the sign-flip test after Holm)",
            ("first", "second"),
            ("sequences", "first - second", "p"),
        )
        for pair in found.comparisons:
            ends = "" if math.isnan(pair.low) else f"\n{pair.low:+.3f} to {pair.high:+.3f}"
            p = "-" if math.isnan(pair.p_corrected) else f"{pair.p_corrected:.3f}"
            table.add_row(pair.first, pair.second, str(pair.seeds), f"{pair.difference:+.3f}{ends}", p)
        tables.print_table(table)
