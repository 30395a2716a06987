"""The command line: its commands, and those that run and read nothing stored."""

from __future__ import annotations

import json
import statistics
import timeit
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from pftrack_sim.cli import authoring, datasets, limits, options, reading, running, tables
from pftrack_sim.cli.examples import epilog
from pftrack_sim.cli.progress import progress_bar
from pftrack_sim.cli.values import check_output, parse_settings, parse_trackers
from pftrack_sim.core.errors import ParameterError, UnknownNameError

app = typer.Typer(
    name="pftrack-sim",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    epilog=epilog(""),
)


class _Command(TyperCommand):
    """A command that refuses a second value for an option that takes one, in place of using the last."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        _, _, order = self.make_parser(ctx).parse_args(list(args))
        once = [one for one in order if one.param_type_name == "option" and not one.multiple]
        for option in once:
            if (count := once.count(option)) > 1:
                raise ParameterError(f"{option.opts[0]} is given {count} times (allowed: once)")
        return super().parse_args(ctx, args)


def _print_version(wanted: bool) -> None:
    if wanted:
        from pftrack_sim import __version__

        typer.echo(f"pftrack-sim {__version__}")
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Track people from a moving robot camera, simulated with exact truth."""


def list_names(
    what: Annotated[str, typer.Argument(help="scenarios, suites, trackers, controllers or axes.")] = "scenarios",
) -> None:
    """List scenarios, suites, trackers, controllers or axes."""
    from rich.table import Table

    from pftrack_sim import controllers, scenario, trackers
    from pftrack_sim.benchmark.asked.plan import RUN_AXES
    from pftrack_sim.benchmark.asked.suite import load_suite, suite_names
    from pftrack_sim.scenario.axes import axes_by_name

    def scenarios() -> Iterator[tuple[str, str]]:
        for name in scenario.names():
            tree = scenario.load(name).tree
            yield name, f"{tree.get('tier', 'easy'):5} {tree['title']}"

    def axes() -> Iterator[tuple[str, str]]:
        for name, (unit, about) in RUN_AXES.items():
            yield name, f"{about} [{unit}]"
        for name, axis in axes_by_name().items():
            typical = f"{axis(severity=1.0).physical:.3g} {axis.unit}"
            about = " ".join((axis.__doc__ or "").split())
            yield (
                name,
                f"{about}\n  severity 1: {axis.headline} = {typical}\n  law: {axis.law}\n  source: {axis.source}",
            )

    listings: dict[str, Callable[[], Iterable[tuple[str, str]]]] = {
        "scenarios": scenarios,
        "suites": lambda: ((name, load_suite(name).title) for name in suite_names()),
        "trackers": lambda: ((name, trackers.describe(name)) for name in trackers.names()),
        "controllers": lambda: ((name, controllers.describe(name)) for name in controllers.names()),
        "axes": axes,
    }
    if what not in listings:
        raise UnknownNameError("listing", what, listings)
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for row in listings[what]():
        table.add_row(*row)
    tables.console.print(table)


def render(
    scenario: options.ScenarioName,
    seed: options.EpisodeSeed = 0,
    video: Annotated[Path | None, typer.Option(help="MP4 to write.")] = None,
    image: Annotated[Path | None, typer.Option(help="PNG or JPEG to write: one frame.")] = None,
    log: Annotated[Path | None, typer.Option(help="Log to write: .rrd (Rerun) or .mcap (ROS 2).")] = None,
    at_s: Annotated[float, typer.Option(min=0.0, help="Time of the frame for --image.")] = 0.0,
    truth: Annotated[bool, typer.Option("--truth", help="Draw the true boxes.")] = False,
    tracker: Annotated[
        str | None,
        typer.Option("--trackers", "--tracker", metavar="A,B", help="Draw the boxes of these trackers, and the truth."),
    ] = None,
    preset: options.Preset = "default",
    params: options.Params = None,
    settings: options.Settings = None,
    backend: options.Backend = None,
    isolation: options.Isolation = "auto",
    allow_truth: options.AllowTruth = "",
) -> None:
    """Render an episode as a video, or a frame as an image."""
    from pftrack_sim import scenario as scenarios
    from pftrack_sim.benchmark.running.filming import save_episode
    from pftrack_sim.benchmark.running.sinks import error_text
    from pftrack_sim.benchmark.running.tracker_runner import check_trackers, checked_isolation, make_runners
    from pftrack_sim.trackers.isolation import Limits

    if (video is None and log is None) == (image is None):
        raise ParameterError("render needs --video FILE.mp4 or --log FILE.mcap (or both), or else --image FILE.png")
    loaded = scenarios.load(scenario, parse_settings(settings or []))
    late = scenarios.late_events(loaded.resolve(seed))
    tables.print_warnings([f"after the end of the episode: {', '.join(late)}"] if late else [])
    if params and tracker is None:
        raise ParameterError("--param needs --trackers: it is theirs")
    specs = parse_trackers(tracker, preset, params or [], allow_truth) if tracker is not None else []
    check_trackers(specs, checked_isolation(isolation), Limits())
    runners = make_runners(specs, seed=seed, isolation=checked_isolation(isolation))
    with ExitStack() as opened:
        for runner in runners:
            opened.callback(runner.close)
        files = {"video": video, "log": log, "image": image}
        with progress_bar("drawing", loaded.frame_count(seed)) as tick:
            save_episode(loaded, seed, **files, at_s=at_s, truth=truth, runners=runners, backend=backend, on_frame=tick)
    for written in (video, log, image):
        if written is not None:
            tables.print_folder(written)
    errors = [error_text(one) for one in runners if one.error is not None]
    tables.print_lines(errors)
    raise typer.Exit(1 if errors else 0)


def schema(
    out: Annotated[Path | None, typer.Argument(help="File to write; default is standard output.")] = None,
) -> None:
    """Write the JSON Schema of scenarios, for editors."""
    from pftrack_sim.scenario import editor_schema

    text = json.dumps(editor_schema(), indent=2) + "\n"
    if out is None:
        typer.echo(text, nl=False)
    else:
        check_output("the schema", out, (".json",))
        out.write_text(text, encoding="utf-8")


def doctor(
    check: Annotated[bool, typer.Option("--check", help="Print nothing; exit with 1 if no renderer works.")] = False,
) -> None:
    """Report which renderers work, and what is missing."""
    from pftrack_sim.core.errors import RenderError
    from pftrack_sim.render.doctor import report

    found = report()
    if not check:
        tables.print_lines(found.lines())
        for name in [*([found.chosen.backend] if found.chosen else []), *(["warp"] if found.warp else [])]:
            try:
                result = f"takes {_frame_ms(name):.0f} ms"
            except RenderError as error:
                result = f"fails: {error}"
            tables.print_lines([f"{name}: a frame of 320x240 with its truth {result}"])
    raise typer.Exit(0 if found.usable else 1)


def _frame_ms(backend: str) -> float:
    """Median time of a frame of `plaza-walk` with its truth at 320x240 [ms]; the first frames are not timed."""
    from pftrack_sim.scenario import load
    from pftrack_sim.simulation.simulation import Simulation

    scenario = load("plaza-walk", {"camera.width_px": 320, "camera.height_px": 240})
    with Simulation(scenario, backend=backend) as simulation:
        simulation.reset(0)
        simulation.advance()
        return 1e3 * statistics.median(timeit.repeat(simulation.advance, number=1, repeat=5))


def trax(
    tracker: Annotated[str, typer.Argument(help="Tracker: name or name[key=value,...].")],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the tracker.")] = 0,
    preset: options.Preset = "default",
    params: options.Params = None,
) -> None:
    """Serve a tracker to a program that speaks TraX.

    It is the command of a tracker in the VOT toolkit; not meant to be typed.
    """
    from pftrack_sim import trackers
    from pftrack_sim.trackers.trax.server import serve

    specs = parse_trackers(tracker, preset, params or [])
    if len(specs) != 1:
        raise ParameterError(f"trax serves one tracker, got {tracker!r}")
    made = trackers.make(specs[0].name, seed=seed, preset=specs[0].preset, **specs[0].params)
    serve(made, specs[0].label)


# In the order of the help.
for name, command in {
    "list": list_names,
    "new": authoring.new,
    "map": authoring.draw_map,
    "render": render,
    "studio": running.studio,
    "profile": datasets.profile,
    "bench": running.bench,
    "follow": running.follow,
    "limit": limits.limit,
    "measure": authoring.measure,
    "film": running.film,
    "evaluate": running.evaluate,
    "export": datasets.export,
    "export-results": datasets.export_results,
    "score": datasets.score,
    "compare": reading.compare,
    "report": reading.report,
    "submit": reading.submit,
    "query": reading.query,
    "check": reading.check,
    "merge": reading.merge,
    "tables": reading.update_tables,
    "trax": trax,
    "schema": schema,
    "doctor": doctor,
}.items():
    app.command(name, cls=_Command, epilog=epilog(name))(command)
