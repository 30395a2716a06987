"""Commands and their options. What they do lives in the rooms below; here is only reading and printing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from pftrack_sim.cli import progress, tables
from pftrack_sim.cli.values import parse_axes, parse_latency, parse_names, parse_settings
from pftrack_sim.errors import ParameterError

app = typer.Typer(
    name="pftrack-sim",
    help="Tracking people from a moving robot camera, simulated with exact truth.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a key of the scenario; may be repeated.")
]
Seeds = Annotated[str, typer.Option(metavar="SEEDS", help="Seeds: 3, 0:20 (20 excluded) or 1,5,9.")]
Trackers = Annotated[str, typer.Option("--trackers", "--tracker", metavar="A,B", help="Trackers, by name.")]
Preset = Annotated[str, typer.Option(help="Preset of the trackers: default or paper.")]
Backend = Annotated[
    str | None,
    typer.Option("--renderer", "--backend", help="gl, egl, osmesa or warp; default: OpenGL if it loads, else warp."),
]


@app.command("list")
def list_names(
    what: Annotated[str, typer.Argument(help="scenarios, trackers, controllers or axes.")] = "scenarios",
) -> None:
    """List what there is by name."""
    tables.print_names(what)


@app.command()
def bench(
    scenarios: Annotated[list[str], typer.Argument(help="Scenarios: names or paths of TOML files.")],
    trackers: Trackers = "ko2012,opencv-mil,stay",
    seeds: Seeds = "0:3",
    axis: Annotated[
        list[str] | None,
        typer.Option("--axis", metavar="AXIS=0,1,2", help="Severities of a stress axis; may be repeated."),
    ] = None,
    settings: Settings = None,
    preset: Preset = "default",
    out: Annotated[Path | None, typer.Option(help="Run folder to make; default is a new one in runs/.")] = None,
    videos: Annotated[str, typer.Option(help="first (seed of each scenario), all, or none.")] = "first",
    backend: Backend = None,
) -> None:
    """Run trackers on scenarios: every frame is drawn once and shown to all of them."""
    from pftrack_sim.bench import make_plan, new_run_path, parse_seeds, run

    plan = make_plan(
        scenarios,
        parse_names(trackers),
        parse_seeds(seeds),
        axes=parse_axes(axis or []),
        overrides=parse_settings(settings or []),
        preset=preset,
    )
    path = out if out is not None else new_run_path(plan)
    with progress.bar("drawing and tracking", plan.frame_count) as tick:
        results = run(plan, path, videos=videos, backend=backend, on_frame=tick)
    tables.print_bench(results)
    tables.print_folder(path)


@app.command()
def follow(
    scenarios: Annotated[list[str], typer.Argument(help="Scenarios: names or paths of TOML files.")],
    trackers: Trackers = "oracle",
    controllers: Annotated[
        str, typer.Option("--controllers", "--controller", metavar="A,B", help="Controllers, by name.")
    ] = "servo-avoid",
    seeds: Seeds = "0:3",
    latency: Annotated[
        str, typer.Option(metavar="A=55,B=7", help="ms charged per frame, by tracker; or paper: the printed figures.")
    ] = "",
    axis: Annotated[
        list[str] | None,
        typer.Option("--axis", metavar="AXIS=0,1,2", help="Severities of a stress axis, or latency=0,13,55 in ms."),
    ] = None,
    settings: Settings = None,
    out: Annotated[Path | None, typer.Option(help="Run folder to make; default is a new one in runs/.")] = None,
    videos: Annotated[str, typer.Option(help="first (seed of each scenario), all, or none.")] = "first",
    backend: Backend = None,
) -> None:
    """Let trackers drive the robot: overlap and following are scored on the same episode."""
    from pftrack_sim.bench import follow as closed
    from pftrack_sim.bench import new_run_path, parse_seeds
    from pftrack_sim.bench.plan import Plan

    names = parse_names(trackers)
    drives = closed.make_drives(
        scenarios,
        names,
        parse_names(controllers),
        parse_seeds(seeds),
        axes=parse_axes(axis or []),
        overrides=parse_settings(settings or []),
        latency_ms=parse_latency(latency, names),
    )
    path = out if out is not None else new_run_path(Plan((drives[0].episode,), (names[0],)))
    total = sum(one.episode.scenario.resolve(one.episode.seed).frame_count for one in drives)
    with progress.bar("driving", total) as tick:
        results = closed.run(drives, path, videos=videos, backend=backend, on_frame=tick)
    tables.print_follow(results)
    tables.print_folder(path)


@app.command()
def evaluate(
    sequences: Annotated[list[Path], typer.Argument(help="Folders of recorded sequences (OTB layout).")],
    tracker: Trackers = "ko2012",
    seeds: Seeds = "0:5",
    preset: Preset = "default",
) -> None:
    """Run trackers on recorded sequences with known boxes."""
    from pftrack_sim.bench import parse_seeds
    from pftrack_sim.bench.recorded import evaluate as evaluate_recorded
    from pftrack_sim.formats import read_sequence

    names = parse_names(tracker)
    chosen = parse_seeds(seeds)
    read = [read_sequence(path) for path in sequences]
    total = sum(len(sequence) for sequence in read) * len(names) * len(chosen)
    with progress.bar("tracking", total) as tick:
        results = evaluate_recorded(read, names, chosen, preset=preset, on_frame=tick)
    tables.print_recorded(results)


@app.command()
def render(
    scenario: Annotated[str, typer.Argument(help="Scenario: a name or the path of a TOML file.")],
    seed: Annotated[int, typer.Option(min=0, help="Root seed of the episode.")] = 0,
    video: Annotated[Path | None, typer.Option(help="MP4 to write.")] = None,
    image: Annotated[Path | None, typer.Option(help="PNG to write: one frame.")] = None,
    at_s: Annotated[float, typer.Option(min=0.0, help="Time of the frame for --image.")] = 0.0,
    truth: Annotated[bool, typer.Option("--truth", help="Draw the truth's boxes.")] = False,
    settings: Settings = None,
    backend: Backend = None,
) -> None:
    """Look at a scenario: write its episode as a video, or one of its frames."""
    from pftrack_sim import scenario as scenarios
    from pftrack_sim.bench.show import save_image, save_video

    if (video is None) == (image is None):
        raise ParameterError("render needs either --video FILE.mp4 or --image FILE.png")
    loaded = scenarios.load(scenario, parse_settings(settings or []))
    settled = loaded.resolve(seed)
    if video is not None:
        with progress.bar("drawing", settled.frame_count) as tick:
            save_video(loaded, seed, video, truth=truth, backend=backend, on_frame=tick)
    if image is not None:
        save_image(loaded, seed, image, at_s=at_s, truth=truth, backend=backend)
    tables.print_folder(video or image)


@app.command()
def schema(
    out: Annotated[Path | None, typer.Argument(help="File to write; default is standard output.")] = None,
) -> None:
    """Write the JSON Schema of scenario files, from which editors complete their keys."""
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
    check: Annotated[bool, typer.Option("--check", help="Say nothing; exit with 1 if nothing can draw.")] = False,
) -> None:
    """Say what draws the frames on this machine, and what is missing."""
    from pftrack_sim.render.doctor import report

    found = report()
    if not check:
        tables.print_doctor(found)
    raise typer.Exit(0 if found.usable else 1)
