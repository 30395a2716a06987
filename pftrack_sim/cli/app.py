"""Commands and their options: parsing and printing only."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pftrack_sim.cli import tables
from pftrack_sim.cli.options import (
    Backend,
    BenchPreset,
    BenchSeeds,
    BenchTrackers,
    FrameLimit,
    Isolation,
    MemoryLimit,
    Out,
    Params,
    Part,
    Preset,
    ProgressMode,
    Refresh,
    Scheduler,
    ScoredBox,
    Seeds,
    Settings,
    Trackers,
    Videos,
    Workers,
)
from pftrack_sim.cli.profile import profile
from pftrack_sim.cli.progress import cores, progress_bar, show_run
from pftrack_sim.cli.values import (
    parse_axes,
    parse_labels,
    parse_latency,
    parse_names,
    parse_part,
    parse_settings,
    parse_trackers,
)
from pftrack_sim.core.errors import ParameterError

if TYPE_CHECKING:
    from pftrack_sim.benchmark import Plan
    from pftrack_sim.trackers.isolation import Limits

app = typer.Typer(
    name="pftrack-sim",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

app.command()(profile)


def _print_version(wanted: bool) -> None:
    if wanted:
        from pftrack_sim import __version__

        typer.echo(f"pftrack-sim {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Track people from a moving robot camera, simulated with exact truth."""


@app.command("list")
def list_names(
    what: Annotated[str, typer.Argument(help="scenarios, suites, trackers, controllers or axes.")] = "scenarios",
) -> None:
    """List scenarios, suites, trackers, controllers or axes."""
    tables.print_names(what)


@app.command()
def bench(
    scenarios: Annotated[list[str], typer.Argument(help="Suites or scenarios: names or paths of TOML files.")],
    trackers: BenchTrackers = None,
    seeds: BenchSeeds = None,
    axis: Annotated[
        list[str] | None,
        typer.Option(
            "--axis",
            metavar="AXIS=0,1,2",
            help="Severities of a stress axis, or AXIS.PARAMETER=5,10 for one of its parameters; may be repeated.",
        ),
    ] = None,
    settings: Settings = None,
    preset: BenchPreset = None,
    truth: ScoredBox = "box",
    out: Out = None,
    videos: Videos = "first",
    backend: Backend = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    part: Part = "1/1",
    isolation: Isolation = "auto",
    frame_limit_s: FrameLimit = 60.0,
    memory_limit_mb: MemoryLimit = 4096.0,
    refresh: Refresh = False,
    progress: ProgressMode = "",
) -> None:
    """Run trackers in open loop on suites or scenarios.

    Every frame is rendered once for all trackers.
    """
    from pftrack_sim.benchmark import parse_seeds, plan_all
    from pftrack_sim.trackers.isolation import Limits

    plan = plan_all(
        scenarios,
        trackers=parse_trackers(trackers, preset or "default") if trackers is not None else None,
        seeds=parse_seeds(seeds) if seeds is not None else None,
        axes=parse_axes(axis or []),
        overrides=parse_settings(settings or []),
        preset=preset,
        truth=truth,
    )
    limits = Limits(frame_limit_s, memory_limit_mb)
    _run(plan, out, workers, scheduler, videos, backend, isolation, limits, part, refresh, progress)


def _run(
    plan: Plan,
    out: Path | None,
    workers: int | None,
    scheduler: str | None,
    videos: str,
    backend: str | None,
    isolation: str,
    limits: Limits,
    part: str,
    refresh: bool,
    progress: str,
) -> None:
    """Run a plan, print its results, and write the report."""
    from pftrack_sim.benchmark import new_run_path, run

    path = out if out is not None else new_run_path(plan)
    with show_run(progress, path) as on_progress:
        finished = run(
            plan,
            path,
            workers=workers if workers is not None else cores(),
            scheduler=scheduler,
            videos=videos,
            backend=backend,
            isolation=isolation,
            limits=limits,
            part=parse_part(part),
            refresh=refresh,
            on_progress=on_progress,
        )
    tables.print_bench(finished.results)
    tables.print_axes(finished)
    tables.print_follow(finished.results)
    tables.print_suites(plan, finished.results)
    tables.print_folder(path)
    _report(path)


@app.command()
def merge(
    out: Annotated[Path, typer.Argument(help="Run folder to make, or to add to.")],
    folders: Annotated[list[Path], typer.Argument(help="Run folders of the same plan.")],
) -> None:
    """Merge run folders of one plan, written with bench --part."""
    from pftrack_sim.benchmark.merge import merge as merge_runs

    tables.print_lines(merge_runs(out, folders).lines())


@app.command()
def check(folder: Annotated[Path, typer.Argument(help="Run folder.")]) -> None:
    """Verify that a run folder is complete and undamaged."""
    from pftrack_sim.benchmark.check import check as check_run

    found = check_run(folder)
    tables.print_lines(found.lines())
    raise typer.Exit(0 if found.good else 1)


@app.command()
def query(
    folder: Annotated[Path, typer.Argument(help="Run folder.")],
    sql: Annotated[str, typer.Argument(help="SQL over the views episodes, frames and summary.")],
    format_: Annotated[str, typer.Option("--format", help="table, csv or json.")] = "table",
) -> None:
    """Run SQL over a run's tables."""
    from pftrack_sim.benchmark import RunStore

    tables.print_query(RunStore(folder).query(sql), format_)


@app.command()
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
) -> None:
    """Compare two trackers, or one tracker in two runs.

    Differences are paired by episode; a row says whether its seeds can show a difference at all.
    """
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.benchmark.comparison import compare_runs

    names = parse_labels(trackers) if trackers is not None else []
    tables.print_comparison(compare_runs(RunStore(first), RunStore(second or first), names, measure=measure))


@app.command()
def follow(
    scenarios: Annotated[list[str], typer.Argument(help="Suites or scenarios: names or paths of TOML files.")],
    trackers: BenchTrackers = None,
    controllers: Annotated[
        str | None,
        typer.Option(
            "--controllers",
            "--controller",
            metavar="A,B",
            help="Controllers, by name; default: servo-avoid, or a suite's own.",
        ),
    ] = None,
    seeds: BenchSeeds = None,
    latency: Annotated[
        str,
        typer.Option(
            metavar="A=55,B=measured",
            help="ms charged per frame, by tracker; measured: once, here; or paper: the printed figures for all.",
        ),
    ] = "",
    axis: Annotated[
        list[str] | None,
        typer.Option(
            "--axis", metavar="AXIS=0,1,2", help="As for bench; also latency=0,13,55 in ms, for every tracker alike."
        ),
    ] = None,
    settings: Settings = None,
    preset: BenchPreset = None,
    truth: ScoredBox = "box",
    out: Out = None,
    videos: Videos = "first",
    backend: Backend = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    part: Part = "1/1",
    isolation: Isolation = "auto",
    frame_limit_s: FrameLimit = 60.0,
    memory_limit_mb: MemoryLimit = 4096.0,
    refresh: Refresh = False,
    progress: ProgressMode = "",
) -> None:
    """Run trackers in closed loop: their boxes drive the robot.

    A controller turns the boxes into commands; overlap and following are scored.
    """
    from pftrack_sim import scenario as all_scenarios
    from pftrack_sim.benchmark import parse_seeds, plan_all
    from pftrack_sim.benchmark.latency import resolve_latencies
    from pftrack_sim.benchmark.tracker_runner import checked_isolation
    from pftrack_sim.trackers.isolation import Limits

    chosen = parse_trackers(trackers, preset or "default") if trackers is not None else None

    def plan_with(latency_ms: dict[str, float]) -> Plan:
        return plan_all(
            scenarios,
            trackers=chosen,
            seeds=parse_seeds(seeds) if seeds is not None else None,
            axes=parse_axes(axis or []),
            overrides=parse_settings(settings or []),
            preset=preset,
            truth=truth,
            controllers=parse_names(controllers) if controllers is not None else None,
            latency_ms=latency_ms,
            closed_loop=True,
        )

    limits = Limits(frame_limit_s, memory_limit_mb)
    plan = plan_with({})
    names = list(dict.fromkeys(one.name for one in plan.trackers))
    if latency:
        stage = plan.sweeps[0].scenarios[0]
        first = all_scenarios.Scenario(stage.name, stage.tree)
        given = parse_latency(latency, names)
        plan = plan_with(
            resolve_latencies(given, plan.trackers, first, out, isolation=checked_isolation(isolation), limits=limits)
        )
    _run(plan, out, workers, scheduler, videos, backend, isolation, limits, part, refresh, progress)


@app.command()
def evaluate(
    sequences: Annotated[list[Path], typer.Argument(help="Folders of recorded sequences (OTB layout).")],
    tracker: Trackers = "ko2012",
    seeds: Seeds = "0:5",
    preset: Preset = "default",
    params: Params = None,
    video: Annotated[
        Path | None,
        typer.Option(help="MP4 of every tracker's boxes at the first seed; a folder for several sequences."),
    ] = None,
    isolation: Isolation = "auto",
) -> None:
    """Run trackers on recorded sequences with true boxes."""
    from pftrack_sim.benchmark import parse_seeds
    from pftrack_sim.benchmark.recorded import evaluate as evaluate_recorded
    from pftrack_sim.benchmark.tracker_runner import checked_isolation
    from pftrack_sim.formats import read_sequence

    contestants = parse_trackers(tracker, preset, params or [])
    chosen = parse_seeds(seeds)
    read = [read_sequence(path) for path in sequences]
    with progress_bar("tracking", sum(len(sequence) for sequence in read)) as tick:
        results = evaluate_recorded(
            read, contestants, chosen, video=video, isolation=checked_isolation(isolation), on_frame=tick
        )
    tables.print_recorded(results)
    if video is not None:
        tables.print_folder(video)
    raise typer.Exit(1 if any(one.failure is not None for one in results) else 0)


@app.command()
def render(
    scenario: Annotated[str, typer.Argument(help="Scenario: a name or the path of a TOML file.")],
    seed: Annotated[int, typer.Option(min=0, help="Root seed of the episode.")] = 0,
    video: Annotated[Path | None, typer.Option(help="MP4 to write.")] = None,
    image: Annotated[Path | None, typer.Option(help="PNG to write: one frame.")] = None,
    at_s: Annotated[float, typer.Option(min=0.0, help="Time of the frame for --image.")] = 0.0,
    truth: Annotated[bool, typer.Option("--truth", help="Draw the true boxes.")] = False,
    tracker: Annotated[
        str | None,
        typer.Option("--trackers", "--tracker", metavar="A,B", help="Draw the boxes of these trackers, and the truth."),
    ] = None,
    preset: Preset = "default",
    params: Params = None,
    settings: Settings = None,
    backend: Backend = None,
    isolation: Isolation = "auto",
) -> None:
    """Render an episode as a video, or a frame as an image."""
    from pftrack_sim import scenario as scenarios
    from pftrack_sim.benchmark.rendering import save_image, save_video
    from pftrack_sim.benchmark.tracker_runner import check_trackers, checked_isolation, make_runners
    from pftrack_sim.trackers.isolation import Limits

    if (video is None) == (image is None):
        raise ParameterError("render needs either --video FILE.mp4 or --image FILE.png")
    loaded = scenarios.load(scenario, parse_settings(settings or []))
    if params and tracker is None:
        raise ParameterError("--param needs --trackers: it is theirs")
    specs = parse_trackers(tracker, preset, params or []) if tracker is not None else []
    check_trackers(specs, checked_isolation(isolation), Limits())
    runners = make_runners(specs, seed=seed, isolation=checked_isolation(isolation))
    with ExitStack() as opened:
        for runner in runners:
            opened.callback(runner.close)
        if video is not None:
            with progress_bar("drawing", loaded.frame_count(seed)) as tick:
                save_video(loaded, seed, video, truth=truth, runners=runners, backend=backend, on_frame=tick)
        if image is not None:
            save_image(loaded, seed, image, at_s=at_s, truth=truth, runners=runners, backend=backend)
    tables.print_folder(video or image)
    failures = [f"{one.spec.label} failed, {one.failure}" for one in runners if one.failure is not None]
    tables.print_lines(failures)
    raise typer.Exit(1 if failures else 0)


def _report(run: Path) -> None:
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.report import write_report
    from pftrack_sim.report.contents import by_episode

    with progress_bar("reading", len(by_episode(RunStore(run).results))) as tick:
        page = write_report(run, on_episode=tick)
    tables.print_folder(page)


@app.command()
def report(
    run: Annotated[Path, typer.Argument(help="Run folder that bench wrote.")],
    figure: Annotated[
        Path | None,
        typer.Option(help="Write one figure for a paper instead: success.pdf, precision.pdf or axis.pdf (.svg, .png)."),
    ] = None,
) -> None:
    """Write report.html, a page with all results of a run."""
    from pftrack_sim.report import write_figure

    if figure is not None:
        tables.print_folder(write_figure(run, figure))
        return
    _report(run)


@app.command("tables")
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


@app.command()
def schema(
    out: Annotated[Path | None, typer.Argument(help="File to write; default is standard output.")] = None,
) -> None:
    """Write the JSON Schema of scenarios, for editors."""
    from pftrack_sim.scenario import editor_schema

    text = json.dumps(editor_schema(), indent=2) + "\n"
    if out is None:
        typer.echo(text, nl=False)
        return
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ParameterError(f"cannot write {out}: {error.strerror}") from None


@app.command()
def doctor(
    check: Annotated[bool, typer.Option("--check", help="Print nothing; exit with 1 if no renderer works.")] = False,
) -> None:
    """Report which renderers work, and what is missing."""
    from pftrack_sim.cli.doctor import print_doctor
    from pftrack_sim.render.doctor import report

    found = report()
    if not check:
        print_doctor(found)
    raise typer.Exit(0 if found.usable else 1)
