"""The command `profile`: how hard scenarios and recorded sequences are, whatever the tracker."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from pftrack_sim.cli import tables
from pftrack_sim.cli.options import MAX_SEEDS, Backend, Seeds, SequenceLayout, Settings
from pftrack_sim.cli.progress import progress_bar
from pftrack_sim.cli.values import parse_axes, parse_settings
from pftrack_sim.core.errors import ParameterError

if TYPE_CHECKING:
    from pftrack_sim.scenario import Scenario
    from pftrack_sim.score.profile import Profile

_ABREAST = 5
"""Columns of profiles in one table."""


def profile(
    videos: Annotated[
        list[str],
        typer.Argument(help="Scenarios and suites (names or paths of TOML files), and folders of recorded sequences."),
    ],
    seeds: Seeds = "0:2",
    axis: Annotated[
        list[str] | None,
        typer.Option("--axis", metavar="AXIS=0,1,2", help="Severities of a stress axis, as for bench."),
    ] = None,
    settings: Settings = None,
    backend: Backend = None,
    layout: SequenceLayout = None,
    out: Annotated[Path | None, typer.Option(help="Folder for profile.json and the figure profile.png.")] = None,
) -> None:
    """Measure how hard scenarios and sequences are.

    Their numbers are printed beside the quantiles of recorded video.
    """
    from pftrack_sim import scenario as scenarios
    from pftrack_sim.benchmark import parse_seeds, plan_all
    from pftrack_sim.benchmark.kept.files import write_bytes
    from pftrack_sim.benchmark.profiling import profile_scenario, profile_sequence
    from pftrack_sim.formats import read_sequence
    from pftrack_sim.report.figure import require_matplotlib
    from pftrack_sim.report.profile import write_profile_figure

    if out is not None:
        require_matplotlib()
    folders = {name for name in videos if name not in scenarios.names() and Path(name).is_dir()}
    sequences = [read_sequence(name, layout) for name in videos if name in folders]
    loaded: list[Scenario] = []
    if simulated := [name for name in videos if name not in folders]:
        axes, overrides = parse_axes(axis or []), parse_settings(settings or [])
        plan = plan_all(simulated, trackers=["stay"], seeds=[0], axes=axes, overrides=overrides)
        for one in plan.episodes():
            condition = f" {one.condition.name}" if one.condition.levels else ""
            loaded.append(replace(one.scenario, name=one.scenario.name + condition))
    names = [one.name for one in (*loaded, *sequences)]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise ParameterError(f"given twice, or several of one name: {', '.join(repeated)}")
    chosen = list(parse_seeds(seeds, most=MAX_SEEDS))
    frames = sum(len(one) for one in sequences) + sum(one.frame_count(seed) for one in loaded for seed in chosen)
    with progress_bar("measuring", frames) as tick:
        profiles = {one.name: profile_scenario(one, chosen, backend=backend, on_frame=tick) for one in loaded}
        profiles |= {one.name: profile_sequence(one, on_frame=tick) for one in sequences}
    _print(profiles)
    if out is not None:
        text = json.dumps({name: _json_numbers(one) for name, one in profiles.items()}, indent=2)
        write_bytes(out / "profile.json", text.encode())
        tables.print_folder(write_profile_figure(profiles, out / "profile.png"))


def _json_numbers(one: Profile) -> dict[str, float | None]:
    """The numbers, with null for those that are unknown."""
    return {name: None if math.isnan(value) else value for name, value in asdict(one).items()}


def _print(profiles: Mapping[str, Profile]) -> None:
    """Print profiles beside the quantiles of recorded video; numbers outside of its middle half are marked."""
    from pftrack_sim.report.tables import Table
    from pftrack_sim.score.profile import QUANTILES, ends_reached, recorded_quantiles

    recorded = recorded_quantiles()
    columns = {name: {key: getattr(one, key) for key in recorded} for name, one in profiles.items()}
    if len(columns) > 1:
        columns["median"] = {key: _median([column[key] for column in columns.values()]) for key in recorded}
    names = list(columns)
    for first in range(0, len(names), _ABREAST):
        shown = names[first : first + _ABREAST]
        heads = (
            *(f"{share:.0%}" for share in QUANTILES),
            *(name.replace("/", "/\n").replace(" ", "\n") for name in shown),
        )
        rows = [
            [key, *map(_short, quantiles), *(_marked(columns[name][key], quantiles) for name in shown)]
            for key, quantiles in recorded.items()
        ]
        title = "Profile, after the quantiles of 48 recorded sequences"
        tables.print_table(Table(title, ("number",), heads, rows))
    if len(profiles) > 1:
        rows: list[list[str]] = []
        for key, (low, *_, high) in recorded.items():
            values = [value for one in profiles.values() if not math.isnan(value := getattr(one, key))] or [math.nan]
            rows.append([key, *map(_short, (low, high, min(values), max(values))), ends_reached(key, values)])
        title = "Least and greatest, and which ends of the recorded 10 to 90 % they reach"
        tables.print_table(Table(title, ("number",), ("10%", "90%", "least", "greatest", "ends"), rows))
    tables.print_lines(["< below 25 %, << below 10 %, > above 75 %, >> above 90 % of the recorded sequences"])


def _marked(value: float, quantiles: Sequence[float]) -> str:
    low, quarter, _, three_quarters, high = quantiles
    below, above = (value < low) + (value < quarter), (value > high) + (value > three_quarters)
    mark = "<" * below + ">" * above
    return f"{_short(value)} {mark:2}"


def _short(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.0f}" if value >= 100.0 else f"{value:.3f}"


def _median(values: Sequence[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return float(np.median(known)) if known else math.nan
