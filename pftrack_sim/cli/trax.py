"""The command `trax`."""

from __future__ import annotations

from typing import Annotated

import typer

from pftrack_sim.cli.options import Params, Preset
from pftrack_sim.cli.values import parse_trackers
from pftrack_sim.core.errors import ParameterError


def trax(
    tracker: Annotated[str, typer.Argument(help="Tracker: name or name[key=value,...].")],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the tracker.")] = 0,
    preset: Preset = "default",
    params: Params = None,
) -> None:
    """Serve a tracker to a program that speaks TraX.

    It is the command of a tracker in the VOT toolkit; not meant to be typed.
    """
    from pftrack_sim import trackers
    from pftrack_sim.trackers.trax.server import connection, serve

    specs = parse_trackers(tracker, preset, params or [])
    if len(specs) != 1:
        raise ParameterError(f"trax serves one tracker, got {tracker!r}")
    made = trackers.make(specs[0].name, seed=seed, preset=specs[0].preset, **specs[0].params)
    serve(made, specs[0].label, *connection())
