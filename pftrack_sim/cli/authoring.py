"""The commands for those who write scenarios: one to start from, and a look at it from above."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pftrack_sim.cli import options, tables
from pftrack_sim.cli.values import parse_settings
from pftrack_sim.core.errors import ParameterError, ScenarioError


def new(file: Annotated[Path, typer.Argument(help="TOML file to write.")]) -> None:
    """Write a scenario to start from, with every key."""
    from pftrack_sim.scenario.template import template

    if file.suffix != ".toml":
        raise ParameterError(f"a scenario is a .toml file, got {file.name!r}")
    try:
        with file.open("x", encoding="utf-8") as opened:
            opened.write(template())
    except FileExistsError:
        raise ParameterError(f"{file} exists already: it is not overwritten") from None
    tables.print_folder(file)


def draw_map(
    scenario: options.ScenarioName,
    seed: options.EpisodeSeed = 0,
    out: Annotated[Path | None, typer.Option(help="SVG or PNG to write.")] = None,
    settings: options.Settings = None,
) -> None:
    """Draw an episode from above, with what is suspicious.

    Nothing is rendered. Ends with 1 where something is suspicious.
    """
    from pftrack_sim import scenario as scenarios
    from pftrack_sim.report.top_view import draw_from_above
    from pftrack_sim.simulation.overview import overview

    try:
        loaded = scenarios.load(scenario, parse_settings(settings or []))
        found = overview(loaded.resolve(seed), seed)
    except ScenarioError as error:
        raise ScenarioError(error.source, [_with_line(one, scenario) for one in error.problems]) from None
    if out is not None:
        tables.print_folder(draw_from_above(found, f"{loaded.tree['title']}, seed {seed}", out))
    tables.print_lines([_with_line(one, scenario) for one in found.suspicious])
    tables.print_lines([event.title for event in found.events])
    raise typer.Exit(1 if found.suspicious else 0)


def _with_line(problem: str, scenario: str) -> str:
    """A problem with the line of the file that it is about."""
    from pftrack_sim.core.inputs import is_file
    from pftrack_sim.scenario.template import line_of

    path = Path(scenario)
    line = line_of(problem, path.read_text(encoding="utf-8", errors="replace")) if is_file(path) else None
    return problem if line is None else f"{path.name}:{line}: {problem}"
