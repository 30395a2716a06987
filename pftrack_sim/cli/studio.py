"""`pftrack-sim studio`: a live view in the browser."""

from __future__ import annotations

from typing import Annotated

import typer

from pftrack_sim.cli.options import Backend, Isolation, Preset, Settings
from pftrack_sim.cli.values import parse_settings, parse_trackers


def studio(
    scenario: Annotated[str, typer.Argument(help="Scenario: a name or the path of a TOML file.")] = "plaza-walk",
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
    from pftrack_sim.benchmark.tracker_runner import check_trackers, checked_isolation
    from pftrack_sim.studio import Settings as StudioSettings
    from pftrack_sim.studio import Studio
    from pftrack_sim.trackers.isolation import Limits

    specs = tuple(parse_trackers(trackers, preset)) if trackers else ()
    checked = checked_isolation(isolation)
    check_trackers(specs, checked, Limits())
    size = {"camera.width_px": 320, "camera.height_px": 240}
    chosen = StudioSettings(scenario, seed, {**size, **parse_settings(settings or [])}, specs, robot)
    with Studio(
        chosen, host=host, port=port, most_pages=pages, backend=backend, isolation=checked, playing=not paused
    ) as opened:
        typer.echo(f"The studio is at {opened.address}\nCtrl-C ends it.")
        if port not in (0, opened.port):
            typer.echo(f"Port {port} is in use.")
        opened.wait()
