"""The command that measures a robot's own video or inertial sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pftrack_sim.cli import tables
from pftrack_sim.cli.progress import progress_bar
from pftrack_sim.cli.values import check_output
from pftrack_sim.core.errors import ParameterError


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
    tables.print_table(Table(f"Measured in {found.source}", ["quantity"], heads, rows))
    tables.print_lines([f"left out: {name}: {why}" for name, why in found.left_out.items()])
    tables.print_warnings(found.doubts)
    if out is not None:
        write_bytes(out, as_toml(found).encode())
        tables.print_folder(out)
