"""The command `profile`: how hard scenarios and recorded sequences are, whatever the tracker."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pftrack_sim.cli import tables
from pftrack_sim.cli.options import Backend, Seeds, SequenceLayout, Settings
from pftrack_sim.cli.progress import progress_bar
from pftrack_sim.cli.values import parse_axes, parse_settings
from pftrack_sim.core.errors import ParameterError

if TYPE_CHECKING:
    from pftrack_sim.scenario import Scenario
    from pftrack_sim.score.profile import Profile


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
    from pftrack_sim.benchmark.said.profiling import profile_scenario, profile_sequence
    from pftrack_sim.formats import read_sequence
    from pftrack_sim.report.figure import require_matplotlib
    from pftrack_sim.report.profiles import profile_tables, write_profile_figure

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
    chosen = parse_seeds(seeds)
    frames = sum(len(one) for one in sequences) + sum(one.frame_count(seed) for one in loaded for seed in chosen)
    with progress_bar("measuring", frames) as tick:
        profiles = {one.name: profile_scenario(one, chosen, backend=backend, on_frame=tick) for one in loaded}
        profiles |= {one.name: profile_sequence(one, on_frame=tick) for one in sequences}
    for table in profile_tables(profiles):
        tables.print_table(table)
    if out is not None:
        text = json.dumps({name: _json_numbers(one) for name, one in profiles.items()}, indent=2)
        write_bytes(out / "profile.json", text.encode())
        tables.print_folder(write_profile_figure(profiles, out / "profile.png"))


def _json_numbers(one: Profile) -> dict[str, float | None]:
    """The numbers, with null for those that are unknown."""
    return {name: None if math.isnan(value) else value for name, value in asdict(one).items()}
