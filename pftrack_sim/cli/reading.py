"""Commands that read run folders: merge, verify, query, compare and report them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pftrack_sim.cli import tables
from pftrack_sim.cli.progress import progress_bar
from pftrack_sim.cli.values import parse_labels


def merge(
    out: Annotated[Path, typer.Argument(help="Run folder to make, or to add to.")],
    folders: Annotated[list[Path], typer.Argument(help="Run folders of the same plan.")],
) -> None:
    """Merge run folders of one plan, written with bench --part."""
    from pftrack_sim.benchmark.kept.merge import merge as merge_runs

    tables.print_lines(merge_runs(out, folders).lines())


def check(folder: Annotated[Path, typer.Argument(help="Run folder.")]) -> None:
    """Verify that a run folder is complete and undamaged."""
    from pftrack_sim.benchmark.kept.check import check as check_run

    found = check_run(folder)
    tables.print_lines(found.lines())
    raise typer.Exit(0 if found.good else 1)


def query(
    folder: Annotated[Path, typer.Argument(help="Run folder.")],
    sql: Annotated[str, typer.Argument(help="SQL over the views episodes, frames, people, summary, losses, moments.")],
    format_: Annotated[str, typer.Option("--format", help="table, csv or json.")] = "table",
) -> None:
    """Run SQL over a run's tables."""
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.cli.answers import print_query

    print_query(RunStore(folder).query(sql), format_)


def compare(
    first: Annotated[Path, typer.Argument(help="Run folder.")],
    second: Annotated[Path | None, typer.Argument(help="Another; default: the same.")] = None,
    trackers: Annotated[
        str | None,
        typer.Option(
            "--trackers", "--tracker", metavar="A,B", help="A tracker of the first run and one of the second."
        ),
    ] = None,
    measure: Annotated[str, typer.Option(help="Column of the summary to compare.")] = "mean_overlap",
    html: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Page to write; default: comparison.html in the second folder.")
    ] = None,
) -> None:
    """Compare two trackers, or one tracker in two runs.

    Differences are paired by episode; a row says whether its seeds can show a difference at all.
    """
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.benchmark.comparison import compare_runs
    from pftrack_sim.report import write_comparison
    from pftrack_sim.report.comparison import losses_of_both

    names = parse_labels(trackers) if trackers is not None else []
    one, other = RunStore(first), RunStore(second or first)
    found = compare_runs(one, other, names, measure=measure)
    tables.print_comparison(found)
    tables.print_lines(losses_of_both(one, other, found))
    tables.print_folder(write_comparison(one, other, found, html or other.path / "comparison.html"))


def write_page(run: Path) -> None:
    """Write the report of a run folder into it, and print its path."""
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.report import write_report
    from pftrack_sim.report.contents import by_episode

    with progress_bar("reading", len(by_episode(RunStore(run).results))) as tick:
        page = write_report(run, on_episode=tick)
    tables.print_folder(page)


def report(
    run: Annotated[Path, typer.Argument(help="Run folder that bench wrote.")],
    figure: Annotated[
        Path | None,
        typer.Option(
            help="Write one figure for a paper instead: success.pdf, precision.pdf, axis.pdf, or cost.pdf, the overlap "
            "against the time per frame (.svg, .png)."
        ),
    ] = None,
) -> None:
    """Write report.html, a page with all results of a run."""
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.benchmark.losses import loss_shares
    from pftrack_sim.report import write_figure

    if figure is not None:
        tables.print_folder(write_figure(run, figure))
        return
    write_page(run)
    tables.print_losses(loss_shares(RunStore(run)))


def update_tables(
    document: Annotated[Path, typer.Argument(help="Markdown file with blocks of tables.")],
    runs: Annotated[Path, typer.Option(help="Folder that holds the run folders.")] = Path("runs"),
) -> None:
    """Write tables of run folders into a Markdown document.

    They replace what stands between <!-- tables of RUN --> and <!-- end -->.
    """
    from pftrack_sim.report.markdown import update_document

    written, kept = update_document(document, runs)
    tables.print_lines([*(f"written: {name}" for name in written), *(f"kept, no run folder: {name}" for name in kept)])
