"""Commands that run trackers: on suites and scenarios in open and closed loop, and on recorded sequences."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pftrack_sim.cli import tables
from pftrack_sim.cli.options import (
    MAX_SEEDS,
    AxisLevels,
    Backend,
    BenchPreset,
    BenchSeeds,
    BenchTrackers,
    FrameLimit,
    Isolation,
    Log,
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
    SequenceLayout,
    Settings,
    StopOnError,
    Trackers,
    Videos,
    Workers,
)
from pftrack_sim.cli.progress import cores, progress_bar, show_run
from pftrack_sim.cli.reading import write_page
from pftrack_sim.cli.values import parse_axes, parse_latency, parse_names, parse_part, parse_settings, parse_trackers

if TYPE_CHECKING:
    from pftrack_sim.benchmark import Plan
    from pftrack_sim.trackers.isolation import Limits


def bench(
    scenarios: Annotated[list[str], typer.Argument(help="Suites or scenarios: names or paths of TOML files.")],
    trackers: BenchTrackers = None,
    seeds: BenchSeeds = None,
    axis: AxisLevels = None,
    settings: Settings = None,
    preset: BenchPreset = None,
    truth: ScoredBox = "box",
    out: Out = None,
    videos: Videos = "first",
    log: Log = "",
    backend: Backend = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    part: Part = "1/1",
    isolation: Isolation = "auto",
    frame_limit_s: FrameLimit = 60.0,
    memory_limit_mb: MemoryLimit = 4096.0,
    refresh: Refresh = False,
    stop_on_error: StopOnError = False,
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
    _run(plan, out, workers, scheduler, videos, log, backend, isolation, limits, part, refresh, stop_on_error, progress)


def _run(
    plan: Plan,
    out: Path | None,
    workers: int | None,
    scheduler: str | None,
    videos: str,
    log: str,
    backend: str | None,
    isolation: str,
    limits: Limits,
    part: str,
    refresh: bool,
    stop_on_error: bool,
    progress: str,
) -> None:
    """Run a plan, print its results, and write the report."""
    from pftrack_sim.benchmark import new_run_path, run
    from pftrack_sim.benchmark.planning import late_events

    tables.print_warnings(late_events(plan))
    path = out if out is not None else new_run_path(plan)
    with show_run(progress, path) as on_progress:
        finished = run(
            plan,
            path,
            workers=workers if workers is not None else cores(),
            scheduler=scheduler,
            videos=videos,
            logs=parse_names(log) if log else (),
            backend=backend,
            isolation=isolation,
            limits=limits,
            part=parse_part(part),
            refresh=refresh,
            stop_on_error=stop_on_error,
            on_progress=on_progress,
        )
    tables.print_bench(finished.results)
    tables.print_axes(finished)
    tables.print_follow(finished.results)
    tables.print_suites(plan, finished.results)
    tables.print_folder(path)
    write_page(path)
    tables.print_tracebacks(finished)
    if stop_on_error and not finished.finished:
        tables.print_lines(["stopped after the first error; without --stop-on-error the same command runs the rest"])
    raise typer.Exit(1 if any(one.error for one in finished.results) else 0)


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
    log: Log = "",
    backend: Backend = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    part: Part = "1/1",
    isolation: Isolation = "auto",
    frame_limit_s: FrameLimit = 60.0,
    memory_limit_mb: MemoryLimit = 4096.0,
    refresh: Refresh = False,
    stop_on_error: StopOnError = False,
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
    _run(plan, out, workers, scheduler, videos, log, backend, isolation, limits, part, refresh, stop_on_error, progress)


def film(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    worst: Annotated[int, typer.Option(metavar="N", help="How many episodes of each tracker, the worst first.")] = 5,
    tracker: Annotated[str | None, typer.Option(help="Only the worst of this tracker: its name or label.")] = None,
    loss: Annotated[bool, typer.Option("--loss", help="Only episodes that end with the target lost.")] = False,
    backend: Backend = None,
) -> None:
    """Film the worst episodes of a run that has been run.

    The frames are drawn again; the boxes are the stored ones, and no tracker runs.
    """
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.benchmark.filming import film as film_results
    from pftrack_sim.benchmark.filming import worst as worst_of

    chosen = worst_of(RunStore(run).results, worst, tracker=tracker, lost=loss)
    with RunStore.begin(run, RunStore(run).plan) as store, progress_bar("filming", len(chosen)) as tick:
        videos = film_results(store, chosen, backend=backend, on_episode=tick)
        store.write_summary()
    tables.print_lines(f"{one.label} {one.number('mean_overlap'):.3f}: {store.video_of(one)}" for one in chosen)
    tables.print_lines([] if videos else ["no episode to film: the target is not lost, or never visible"])


def evaluate(
    sequences: Annotated[
        list[Path], typer.Argument(help="Sequences: folders, see --format, or of data sets; MCAP or video files.")
    ],
    tracker: Trackers = "ko2012",
    seeds: Seeds = "0:5",
    preset: Preset = "default",
    params: Params = None,
    video: Annotated[
        Path | None,
        typer.Option(help="MP4 of every tracker's boxes at the first seed; a folder for several sequences."),
    ] = None,
    layout: SequenceLayout = None,
    topics: Annotated[
        str, typer.Option(metavar="IMAGES,BOXES", help="Topics of an MCAP file, where it has several of a kind.")
    ] = "",
    box: Annotated[
        str | None,
        typer.Option(metavar="X,Y,W,H|FILE", help="Box of a video's first frame, or a file with it or one per frame."),
    ] = None,
    isolation: Isolation = "auto",
) -> None:
    """Run trackers on recorded sequences with true boxes."""
    from pftrack_sim.benchmark import parse_seeds
    from pftrack_sim.benchmark.recorded import evaluate as evaluate_recorded
    from pftrack_sim.benchmark.tracker_runner import checked_isolation
    from pftrack_sim.formats import read_sequences
    from pftrack_sim.formats.video import given_boxes

    contestants = parse_trackers(tracker, preset, params or [])
    chosen = list(parse_seeds(seeds, most=MAX_SEEDS))
    boxes = given_boxes(box) if box is not None else None
    named = parse_names(topics) if topics else ()
    read = [one for path in sequences for one in read_sequences(path, layout, named, boxes)]
    with progress_bar("tracking", sum(len(sequence) for sequence in read)) as tick:
        results = evaluate_recorded(
            read, contestants, chosen, video=video, isolation=checked_isolation(isolation), on_frame=tick
        )
    tables.print_recorded(results)
    if video is not None:
        tables.print_folder(video)
    raise typer.Exit(1 if any(one.error is not None for one in results) else 0)
