"""Commands that read run folders: merge, verify, query, compare and report them."""

from __future__ import annotations

import csv
import json
import os
import secrets
import shlex
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from pftrack_sim.cli import options, tables
from pftrack_sim.cli.progress import progress_bar, show_run
from pftrack_sim.cli.values import parse_names
from pftrack_sim.core.errors import ParameterError, RunError, UnknownNameError
from pftrack_sim.core.memory import memory_limit

if TYPE_CHECKING:
    from pftrack_sim.benchmark.reading.store import QueryResult
    from pftrack_sim.benchmark.reference.submission import Submission

_QUERY_S, _PRINT_S, _QUERY_GB = 110.0, 10.0, 4.0
"""Limits of a query: its time, that of its last value and of printing it, and its memory."""

_LEAST_WIDTH = 6
"""Where the columns of a query would be narrower, its rows are printed a column a line."""


def merge(
    out: Annotated[Path, typer.Argument(help="Run folder to make, or to add to.")],
    folders: Annotated[list[Path], typer.Argument(help="Run folders.")],
) -> None:
    """Merge run folders, for example parts of a plan."""
    from pftrack_sim.benchmark.reading.merge import merge as merge_runs

    tables.print_lines(merge_runs(out, folders).lines())


def check(folder: Annotated[Path, typer.Argument(help="Run folder.")]) -> None:
    """Verify that a run folder is complete and undamaged."""
    from pftrack_sim.benchmark.reading.check import check as check_run

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

    # DuckDB keeps its limits from row to row: making or printing one huge value may take longer.
    ended = threading.Timer(_QUERY_S + _PRINT_S, _end_query)
    ended.daemon = True
    ended.start()
    try:
        with memory_limit(1024 * _QUERY_GB):  # DuckDB counts neither single values nor the rows that it hands out
            _print_query(RunStore(folder).query(sql, limit_s=_QUERY_S, limit_gb=_QUERY_GB), format_)
    except MemoryError:
        raise RunError(f"the query failed: its answer takes more than {_QUERY_GB:g} GB") from None
    finally:
        ended.cancel()


def _end_query() -> None:
    """End this process, which writes nothing but its answer: DuckDB cannot be stopped within a value."""
    line = f"pftrack-sim: the query failed: it and its answer took longer than {_QUERY_S + _PRINT_S:g} s"
    print(line, file=sys.stderr, flush=True)  # noqa: T201 - this is the command line
    os._exit(2)


def _print_query(answer: QueryResult, layout: str) -> None:
    """Print the rows of a query as a table, as CSV, or as lines of JSON."""
    if layout == "csv":
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(answer.columns)
        writer.writerows(answer.rows)
    elif layout == "json":
        for row in answer.rows:
            print(json.dumps(dict(zip(answer.columns, row, strict=True)), default=str))  # noqa: T201
    elif layout == "table" and len(answer.columns) * _LEAST_WIDTH > tables.console.width:
        for row in answer.rows:
            pairs = zip(answer.columns, map(_cell, row), strict=True)
            tables.print_lines(["", *(f"{head}: {cell}" for head, cell in pairs)])
    elif layout == "table":
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
        for place, head in enumerate(answer.columns):
            is_text = bool(answer.rows) and isinstance(answer.rows[0][place], str)
            table.add_column(Text(head), justify="left" if is_text else "right", overflow="fold")
        for row in answer.rows:
            table.add_row(*(Text(_cell(cell)) for cell in row))
        tables.console.print(table)
    else:
        raise ParameterError(f"--format must be table, csv or json, got {layout!r}")


def _cell(value: object) -> str:
    """A value of a query: floats with six digits, in lists too."""
    if isinstance(value, list):
        return f"[{', '.join(_cell(one) for one in cast('list[object]', value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


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
    from pftrack_sim.benchmark.said.comparison import compare_runs
    from pftrack_sim.cli.results import print_comparison
    from pftrack_sim.report import write_comparison
    from pftrack_sim.report.comparison import losses_of_both

    names = parse_names(trackers) if trackers is not None else []
    one, other = RunStore(first), RunStore(second or first)
    found = compare_runs(one, other, names, measure=measure)
    print_comparison(found)
    tables.print_lines(losses_of_both(one, other, found))
    tables.print_page(write_comparison(one, other, found, html or other.path / "comparison.html"))


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
            help="Write one figure for a paper instead: success.pdf, precision.pdf, axis.pdf, cost.pdf, the overlap "
            "against the time per frame, reliability.pdf, how often a tracker is right at each confidence, or "
            "strips.pdf, frames of one episode for all trackers (.svg, .png)."
        ),
    ] = None,
    columns: Annotated[int, typer.Option(min=1, max=2, help="Width of --figure in columns of a paper.")] = 1,
) -> None:
    """Write report.html, a page with all results of a run."""
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.benchmark.reading.losses import loss_shares
    from pftrack_sim.cli.results import print_losses
    from pftrack_sim.report import write_figure

    if figure is not None:
        tables.print_folder(write_figure(run, figure, columns))
        return
    write_page(run)
    print_losses(loss_shares(RunStore(run)))


def submit(
    paths: Annotated[list[Path], typer.Argument(help="Run folders of bench and follow; or a submission, to check it.")],
    tracker: Annotated[str | None, typer.Option(help="The tracker, where a run has several.")] = None,
    out: Annotated[Path, typer.Option(metavar="FILE", help="Submission to write.")] = Path("submission.parquet"),
    verify: Annotated[
        bool, typer.Option("--verify", help="Play a random twentieth of a submission's episodes again, and compare.")
    ] = False,
    workers: options.Workers = options.CORES,
    isolation: options.Isolation = "auto",
) -> None:
    """Make or check a file of a tracker's results on a suite.

    The suite is a frozen one, such as standard; all of its episodes are in the file, those of bench and of follow.
    To verify a tracker of somebody else's runs their code: name it with --tracker.
    """
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.benchmark.kept.folder import is_run
    from pftrack_sim.benchmark.reference.submission import make_submission, problems, read_submission, write_submission
    from pftrack_sim.trackers import is_builtin

    if all(is_run(path) for path in paths):
        if verify:
            raise ParameterError("--verify takes a submission, which submit RUN... --out FILE writes")
        made = make_submission([RunStore(path) for path in paths], tracker)
        write_submission(out, made)
        tables.print_folder(out)
        foreign = [] if is_builtin(name := made.about.trackers[0].name) else ["--tracker", name]
        tables.print_lines([f"next: pftrack-sim {shlex.join(['submit', str(out), '--verify', *foreign])}"])
        return
    if len(paths) != 1:
        other = next(path for path in paths if not is_run(path))
        raise ParameterError(f"submit takes run folders, or one submission to check: {other} is no run folder")
    found = read_submission(paths[0])
    wrong = problems(found)
    about = found.about
    names = {one.name for one in about.trackers}
    if tracker is not None and tracker not in names:
        raise UnknownNameError("tracker of the submission", tracker, names)
    what = f"{paths[0]}: {found.label} on {about.suite}, {len(found.rows)} episodes"
    tables.print_lines([what, *(f"  {one}" for one in wrong), *(["refused"] if wrong else [])])
    if verify and not wrong:
        wrong = _play_again(found, tracker, workers, isolation)
    raise typer.Exit(1 if wrong else 0)


def _play_again(found: Submission, tracker: str | None, workers: int, isolation: str) -> bool:
    """Verify a submission and print what came of it; whether it is refused."""
    from pftrack_sim.benchmark.reference.verification import verify
    from pftrack_sim.trackers import is_builtin

    for name in (one.name for one in found.about.trackers):
        if not is_builtin(name) and tracker != name:
            raise ParameterError(f"verifying runs the code of {name}, from here: name it with --tracker {name}")
    seed = secrets.randbits(32)  # the submitter cannot predict which episodes are played
    with show_run("", found.path, f"a twentieth of the episodes, by seed {seed}") as on_progress:
        played = verify(found, seed, workers=workers, isolation=isolation, on_progress=on_progress)
    tables.print_lines(played.lines())
    return not played.good


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
