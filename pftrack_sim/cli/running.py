"""Commands that run trackers: on suites and scenarios, on recorded sequences, and live in the browser."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pftrack_sim.cli import options, tables
from pftrack_sim.cli.options import RunOptions, with_run_options
from pftrack_sim.cli.progress import progress_bar, show_run
from pftrack_sim.cli.reading import write_page
from pftrack_sim.cli.values import (
    check_output,
    parse_latency,
    parse_names,
    parse_part,
    parse_search,
    parse_settings,
    parse_trackers,
)
from pftrack_sim.core.errors import ParameterError, RunError

if TYPE_CHECKING:
    from pftrack_sim.benchmark import Plan, RunStore
    from pftrack_sim.benchmark.running.frame_cache import FrameCache
    from pftrack_sim.studio.recording import Source

MAX_CACHE_GB = 1e6
_WORST = 5


@with_run_options
def bench(
    scenarios: options.ScenarioNames,
    cache: Annotated[
        bool,
        typer.Option("--cache", help="Keep rendered frames and take them from there: a changed tracker runs at once."),
    ] = False,
    cache_folder: Annotated[
        Path | None, typer.Option(help="Folder of --cache; default: ~/.cache/pftrack-sim/frames.")
    ] = None,
    cache_gb: Annotated[
        float, typer.Option(metavar="GB", help="Size of --cache; what was not used for longest goes first.")
    ] = 20.0,
    *,
    run: RunOptions,
) -> None:
    """Run trackers in open loop on suites or scenarios.

    Every frame is rendered once for all trackers. The same command with another --seeds, --trackers or --axis adds to
    a run folder; your own tracker is module:factory, for example my_tracker:make.
    """
    from pftrack_sim.benchmark.running.frame_cache import FrameCache
    from pftrack_sim.core.data_files import cache_dir

    if not 0.0 <= cache_gb <= MAX_CACHE_GB:
        raise ParameterError(f"--cache-gb must be 0 to {MAX_CACHE_GB:g}, got {cache_gb:g}")
    kept = FrameCache(cache_folder or cache_dir() / "frames", round(cache_gb * 1e9)) if cache or cache_folder else None
    _run(*_searched(scenarios, run, kept), kept)


def _searched(
    scenarios: list[str], asked: RunOptions, cache: FrameCache | None = None, **more: Any
) -> tuple[Plan, RunOptions]:
    """The plan of these scenarios; where a search is asked for, with the parameters that are best on its seeds."""
    from pftrack_sim.benchmark import new_run_path, parse_seeds
    from pftrack_sim.report.tables import grouped, over_seeds, range_text

    plan, search, seeds = asked.plan(scenarios, **more), asked.search or [], asked.search_seeds
    if not search and seeds is None:
        return plan, asked
    specs = asked.specs
    if not search or seeds is None or specs is None:
        raise ParameterError(
            "a search needs --trackers, --search and --search-seeds, for example --search-seeds 100:110"
        )
    if shared := sorted({one.seed for one in plan.episodes()} & set(parse_seeds(seeds))):
        raise ParameterError(f"--search-seeds must be none of the seeds of the report, got {shared[0]} in both")
    grids = parse_search(search, [one.name for one in specs])
    asked = replace(asked, out=asked.out or new_run_path(plan))
    assert asked.out is not None
    path = asked.out.with_name(f"{asked.out.name}-search")
    tried = {
        spec.base_label: [spec.model_copy(update={"params": {**spec.params, **more}}) for more in grids[spec.name]]
        for spec in specs
        if spec.name in grids
    }
    searched = asked.plan(scenarios, [one for own in tried.values() for one in own], seeds, **more)
    measure = "mean_overlap" if plan.kind == "open" else "follow_tracking_rate"
    found = _execute(searched, replace(asked, videos="none", log=""), path, cache)
    of_each = grouped(found.results, lambda one: one.tracker.base_label)
    means = {label: over_seeds(measure, own) for label, own in of_each.items()}
    best = {label: max(own, key=lambda one: means[one.base_label].mean) for label, own in tried.items()}
    tables.print_lines(
        f"{one.base_label}: the best of {len(tried[label])} on seeds {seeds}, {measure} "
        f"{range_text(means[one.base_label])}; all: {path}"
        for label, one in best.items()
    )
    return asked.plan(scenarios, [best.get(spec.base_label, spec) for spec in specs], **more), asked


def _run(plan: Plan, asked: RunOptions, cache: FrameCache | None = None) -> None:
    """Run a plan, print its results, and write the report."""
    from pftrack_sim.benchmark import RunStore, new_run_path
    from pftrack_sim.benchmark.asked.from_names import late_events
    from pftrack_sim.benchmark.asked.union import held_besides
    from pftrack_sim.benchmark.kept.folder import is_run
    from pftrack_sim.cli.results import print_next, print_run, print_standing, print_tracebacks
    from pftrack_sim.core.text import one_line

    tables.print_warnings(late_events(plan, None if asked.verbose else asked.changed))
    path = asked.out if asked.out is not None else new_run_path(plan)
    more = held_besides(RunStore(path).plan, plan) if is_run(path) else ""
    if more:
        tables.print_warnings([f"{path} holds more than is asked for, and all of it is run and shown: {more}"])
    finished = _execute(plan, asked, path, cache)
    print_run(plan, finished)
    print_standing(finished)
    tables.print_folder(path)
    write_page(path)
    print_tracebacks(finished)
    opened = {(one.tracker.name, file, size) for one, files in finished.opened() for file, size in files.items()}
    tables.print_warnings(
        [
            f"{tracker} opened {one_line(file)}: {size} are too many to read: it counts by its size, not by its content"
            for tracker, file, size in sorted(opened)
            if size.endswith(" bytes")
        ]
    )
    if cache is not None:
        size_gb, limit_gb = cache.size_bytes / 1e9, cache.limit_bytes / 1e9
        tables.print_lines([f"cache: {size_gb:.2f} GB of {limit_gb:g} GB in {cache.folder}"])
    if asked.stop_on_error and not finished.finished:
        tables.print_lines(["stopped after the first error; without --stop-on-error the same command runs the rest"])
    print_next(finished)
    raise typer.Exit(1 if any(one.error for one in finished.results) else 0)


def _execute(plan: Plan, asked: RunOptions, path: Path, cache: FrameCache | None) -> RunStore:
    """Say what a plan is, and run it."""
    from pftrack_sim.benchmark import run

    counts = {"episode": plan.episode_count, "tracker": len(plan.trackers), "worker": asked.workers}
    if len(plan.conditions) > 1:
        counts = {"episode": counts.pop("episode"), "condition": len(plan.conditions), **counts}
    what = ", ".join(f"{count} {name}{'s' if count != 1 else ''}" for name, count in counts.items())
    with show_run(asked.progress, path, what) as on_progress:
        return run(
            plan,
            path,
            workers=asked.workers,
            scheduler=asked.scheduler,
            videos=asked.videos,
            logs=parse_names(asked.log) if asked.log else (),
            backend=asked.backend,
            isolation=asked.isolation,
            limits=asked.limits,
            part=parse_part(asked.part),
            refresh=asked.refresh,
            stop_on_error=asked.stop_on_error,
            cache=cache,
            on_progress=on_progress,
        )


@with_run_options
def follow(
    scenarios: options.ScenarioNames,
    controllers: Annotated[
        str | None,
        typer.Option(
            "--controllers",
            "--controller",
            metavar="A,B",
            help="Controllers, by name; default: servo-avoid, or a suite's own.",
        ),
    ] = None,
    latency: Annotated[
        str,
        typer.Option(
            metavar="A=55,B=measured",
            help="ms charged per frame, by tracker (measured: once, here); or for all: measured or paper (as printed).",
        ),
    ] = "",
    *,
    run: RunOptions,
) -> None:
    """Run trackers in closed loop: their boxes drive the robot.

    A controller turns the boxes into commands; overlap and following are scored.
    """
    from pftrack_sim import scenario as all_scenarios
    from pftrack_sim.benchmark.running.latency import resolve_latencies
    from pftrack_sim.benchmark.running.tracker_runner import checked_isolation

    chosen = parse_names(controllers) if controllers is not None else None
    charged: dict[str, float] = {}
    if latency:
        plan = run.plan(scenarios, controllers=chosen, latency_ms={}, closed_loop=True)
        stage = plan.sweeps[0].scenarios[0]
        first = all_scenarios.Scenario(stage.name, stage.tree)
        given = parse_latency(latency, list(dict.fromkeys(one.name for one in plan.trackers)))
        isolation = checked_isolation(run.isolation)
        charged = resolve_latencies(given, plan.trackers, first, run.out, isolation=isolation, limits=run.limits)
    _run(*_searched(scenarios, run, controllers=chosen, latency_ms=charged, closed_loop=True))


def film(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    worst: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="How many episodes of each tracker, the worst first; default: 5, with --failed all."
        ),
    ] = None,
    tracker: Annotated[str | None, typer.Option(help="Only the worst of this tracker: its name or label.")] = None,
    loss: Annotated[bool, typer.Option("--loss", help="Only episodes that end with the target lost.")] = False,
    failed: Annotated[bool, typer.Option("--failed", help="Only drives without success, with their causes.")] = False,
    backend: options.Backend = None,
) -> None:
    """Film the worst episodes of a run.

    The frames are drawn again; the boxes are the stored ones, and no tracker runs.
    """
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.benchmark.reading.failures import failures
    from pftrack_sim.benchmark.running.filming import film as film_results
    from pftrack_sim.benchmark.running.filming import worst as worst_of
    from pftrack_sim.cli.results import where
    from pftrack_sim.report.tables import causes

    kept = RunStore(run)
    if failed and kept.plan.kind != "follow":
        raise RunError(f"--failed asks for drives, and {run} was run in open loop; --loss asks for lost targets")
    found = failures(kept) if failed else {}
    results = [one for one in kept.results if not failed or one.key in found]
    count = worst if worst is not None else max(len(results), 1) if failed else _WORST
    chosen = worst_of(results, count, tracker=tracker, lost=loss) if results or not failed else []
    with RunStore.begin(run, kept.plan) as store, progress_bar("filming", len(chosen)) as tick:
        film_results(store, chosen, backend=backend, on_episode=tick)
        store.write_summary()
        videos = {one.key: store.video_of(one) for one in chosen}
    if not chosen:
        none = "no drive failed" if failed else "no episode to film: the target is not lost, or never visible"
        tables.print_lines([none])
    elif failed:
        tables.print_tables(*causes([found[one.key] for one in chosen]))
        tables.print_lines(f"{one.label} {where(one)}, {found[one.key].statement}: {videos[one.key]}" for one in chosen)
    else:
        tables.print_lines(f"{one.label} {one.number('mean_overlap'):.3f}: {videos[one.key]}" for one in chosen)


def evaluate(
    sequences: Annotated[
        list[Path], typer.Argument(help="Sequences: folders, see --format, or of data sets; ROS 2 bags or video files.")
    ],
    tracker: Annotated[
        str, typer.Option("--trackers", "--tracker", metavar="A,B", help="Trackers: name or name[key=value,...].")
    ] = "ko2012",
    seeds: options.Seeds = "0:5",
    preset: options.Preset = "default",
    params: options.Params = None,
    video: Annotated[
        Path | None,
        typer.Option(help="MP4 of every tracker's boxes at the first seed; a folder for several sequences."),
    ] = None,
    layout: options.SequenceLayout = None,
    topics: Annotated[
        str,
        typer.Option(
            metavar="IMAGES,BOXES", help="Topics of a ROS 2 bag or MCAP file, where it has several of a kind."
        ),
    ] = "",
    box: Annotated[
        str | None,
        typer.Option(metavar="X,Y,W,H|FILE", help="Box of a video's first frame, or a file with it or one per frame."),
    ] = None,
    box_noise: options.BoxNoise = 0.0,
    starts: options.Starts = 1,
    isolation: options.Isolation = "auto",
    allow_truth: options.AllowTruth = "",
) -> None:
    """Run trackers on recorded sequences with true boxes."""
    from pftrack_sim.benchmark import parse_seeds
    from pftrack_sim.benchmark.datasets.recorded import evaluate as evaluate_recorded
    from pftrack_sim.benchmark.running.tracker_runner import checked_isolation
    from pftrack_sim.cli.results import print_recorded
    from pftrack_sim.formats import given_boxes, read_sequences

    contestants = parse_trackers(tracker, preset, params or [], allow_truth)
    chosen = parse_seeds(seeds)
    if video is not None and video.suffix:
        check_output("--video", video, (".mp4",), *sequences)
    boxes = given_boxes(box) if box is not None else None
    named = parse_names(topics) if topics else ()
    read = [one for path in sequences for one in read_sequences(path, layout, named, boxes)]
    with progress_bar("tracking", sum(len(sequence) for sequence in read)) as tick:
        results = evaluate_recorded(
            read,
            contestants,
            chosen,
            box_noise=box_noise,
            starts=options.starts(starts),
            video=video,
            isolation=checked_isolation(isolation),
            on_frame=tick,
        )
    print_recorded(results)
    if video is not None:
        tables.print_folder(video)
    raise typer.Exit(1 if any(one.error is not None for one in results) else 0)


def studio(
    scenario: Annotated[
        str,
        typer.Argument(help="Scenario: a name or a TOML file; or a video, the folder of a sequence, or camera:0."),
    ] = "plaza-walk",
    box: Annotated[
        str | None,
        typer.Option(metavar="X,Y,W,H", help="Box in a video's first frame, or a file of boxes; without: draw one."),
    ] = None,
    seed: options.EpisodeSeed = 0,
    trackers: Annotated[
        str, typer.Option("--trackers", "--tracker", metavar="A,B", help="Trackers that run from the start.")
    ] = "ko2012,pftrack",
    robot: Annotated[str, typer.Option(help="Who drives: script, hand, or a controller by name.")] = "script",
    host: Annotated[str, typer.Option(help="Address to bind; elsewhere than this machine the address has a token.")] = (
        "127.0.0.1"
    ),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port, or the next free one above; 0: any.")] = 8765,
    pages: Annotated[int, typer.Option(min=1, max=100, help="How many pages may be open at once.")] = 4,
    paused: Annotated[bool, typer.Option("--paused", help="Do not play from the start.")] = False,
    preset: options.Preset = "default",
    settings: options.Settings = None,
    backend: options.Backend = None,
    isolation: options.Isolation = "auto",
    allow_truth: options.AllowTruth = "",
) -> None:
    """Watch trackers live in the browser.

    Frames have 320 x 240 pixels unless --set says otherwise.
    """
    from pftrack_sim.benchmark.running.tracker_runner import check_trackers, checked_isolation
    from pftrack_sim.studio import Settings as StudioSettings
    from pftrack_sim.studio import Studio
    from pftrack_sim.trackers.isolation import Limits

    specs = tuple(parse_trackers(trackers, preset, allow_truth=allow_truth)) if trackers else ()
    checked = checked_isolation(isolation)
    check_trackers(specs, checked, Limits())
    given = parse_settings(settings or [])
    source = _source(scenario, box)
    if source is not None and (given or robot != "script"):
        raise ParameterError("a recording has no scenario and no robot: --set and --robot are for scenarios")
    size = {"camera.width_px": 320, "camera.height_px": 240}
    chosen = StudioSettings(scenario, seed, {} if source is not None else {**size, **given}, specs, robot)
    with Studio(
        chosen,
        host=host,
        port=port,
        most_pages=pages,
        backend=backend,
        isolation=checked,
        playing=not paused,
        open_source=source,
    ) as opened:
        typer.echo(f"The studio is at {opened.address}\nCtrl-C ends it.")
        if port not in (0, opened.port):
            typer.echo(f"Port {port} is in use.")
        opened.wait()


def _source(name: str, box: str | None) -> Callable[[], Source] | None:
    """What opens the recording of a name; None for a scenario.

    Raises:
        ParameterError: No such file, or `--box` for something without a first frame of its own.
        SequenceError: It is damaged, or in no known layout.
    """
    from pftrack_sim.formats import given_boxes, read_sequence, read_video, ros2
    from pftrack_sim.studio.recording import Camera

    path = Path(name)
    if name.startswith("camera:") and name[7:].isdecimal():
        if box is not None:
            raise ParameterError("--box is for video files: draw the box of a camera's picture on the page")
        return lambda: Camera(int(name[7:]))
    if path.suffix not in ("", ".toml") and not path.exists():
        raise ParameterError(f"{name}: no such file; scenarios have names without a suffix, or end in .toml")
    if path.suffix == ".toml" or not path.exists():
        if box is not None:
            raise ParameterError(f"--box is for video files, got {name!r}")
        return None
    if box is None and path.is_file() and ros2.find(path) is None:
        sequence = read_video(path)
    else:
        sequence = read_sequence(path, boxes=None if box is None else given_boxes(box))
    return lambda: sequence
