"""`pftrack-sim studio`: a live view in the browser."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pftrack_sim.cli.options import Backend, Isolation, Preset, Settings
from pftrack_sim.cli.values import parse_settings, parse_trackers
from pftrack_sim.core.errors import ParameterError

if TYPE_CHECKING:
    from pftrack_sim.studio.recording import Source


def studio(
    scenario: Annotated[
        str,
        typer.Argument(help="Scenario: a name or a TOML file; or a video, the folder of a sequence, or camera:0."),
    ] = "plaza-walk",
    box: Annotated[
        str | None,
        typer.Option(metavar="X,Y,W,H", help="Box in a video's first frame, or a file of boxes; without: draw one."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Root seed of the episode.")] = 0,
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
    preset: Preset = "default",
    settings: Settings = None,
    backend: Backend = None,
    isolation: Isolation = "auto",
) -> None:
    """Watch trackers live in the browser.

    Frames have 320 x 240 pixels unless --set says otherwise.
    """
    from pftrack_sim.benchmark.running.tracker_runner import check_trackers, checked_isolation
    from pftrack_sim.studio import Settings as StudioSettings
    from pftrack_sim.studio import Studio
    from pftrack_sim.trackers.isolation import Limits

    specs = tuple(parse_trackers(trackers, preset)) if trackers else ()
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
