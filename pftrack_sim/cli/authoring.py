"""The commands for those who write scenarios: one to start from, a look from above, and a robot's own shake."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pftrack_sim.cli import options, tables
from pftrack_sim.cli.progress import progress_bar
from pftrack_sim.cli.values import check_output, parse_settings
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


def measure(
    material: Annotated[
        Path,
        typer.Argument(
            help="Video; folder of a recorded sequence or of numbered images; CSV or ROS 2 bag of an inertial sensor."
        ),
    ],
    calibration: Annotated[Path | None, typer.Option(help="Calibration of the camera: YAML of ROS or OpenCV.")] = None,
    fovy_deg: Annotated[
        float | None, typer.Option(min=5.0, max=130.0, help="Vertical field of view, where there is no calibration.")
    ] = None,
    rate_hz: Annotated[
        float | None, typer.Option(min=1.0, max=1000.0, help="Frames per second, against what the file tells.")
    ] = None,
    topic: Annotated[str | None, typer.Option(help="Of a bag with several inertial sensors.")] = None,
    out: Annotated[Path | None, typer.Option(help="TOML to write: a scenario takes it with extends.")] = None,
) -> None:
    """Measure a robot's shake, from its video or gyroscope.

    Each number is in the units of the stress axes, with a 95 % interval; what the material does not tell is left out,
    with the reason.
    """
    from pftrack_sim.benchmark.kept.files import write_bytes
    from pftrack_sim.measuring.imu import measure_imu
    from pftrack_sim.measuring.imu_log import is_imu, read_imu
    from pftrack_sim.measuring.material import read_material
    from pftrack_sim.measuring.measured import as_toml
    from pftrack_sim.measuring.video import measure_video
    from pftrack_sim.report.tables import Table

    if out is not None:
        check_output("--out", out, (".toml",), material)
    given = {"--calibration": calibration, "--fovy-deg": fovy_deg, "--rate-hz": rate_hz}
    if is_imu(material):
        if wrong := [name for name, value in given.items() if value is not None]:
            raise ParameterError(f"{wrong[0]} is of a camera, and {material} is a log of an inertial sensor")
        found = measure_imu(read_imu(material, topic))
    else:
        frames = read_material(material, rate_hz)
        with progress_bar("measuring", len(frames.images)) as tick:
            found = measure_video(frames, fovy_deg, calibration, on_frame=tick)
    rows = [
        [one.name, f"{one.value:.3g}", "exact" if one.low == one.high else f"{one.low:.3g} to {one.high:.3g}", one.unit,
         str(one.frames)]
        for one in found.quantities
    ]  # fmt: skip
    heads = ["value", "95 % interval", "unit", "frames"]
    tables.print_tables(Table(f"Measured in {found.source}", ["quantity"], heads, rows))
    tables.print_lines([f"left out: {name}: {why}" for name, why in found.left_out.items()])
    tables.print_warnings(found.doubts)
    if out is not None:
        write_bytes(out, as_toml(found).encode())
        tables.print_folder(out)
