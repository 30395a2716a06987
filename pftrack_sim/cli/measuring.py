"""The command that measures a robot's own video."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pftrack_sim.cli import tables
from pftrack_sim.cli.progress import progress_bar


def measure(
    material: Annotated[Path, typer.Argument(help="Video, or folder of a recorded sequence or of numbered images.")],
    calibration: Annotated[Path | None, typer.Option(help="Calibration of the camera: YAML of ROS or OpenCV.")] = None,
    fovy_deg: Annotated[
        float | None, typer.Option(min=5.0, max=130.0, help="Vertical field of view, where there is no calibration.")
    ] = None,
    rate_hz: Annotated[
        float | None, typer.Option(min=1.0, max=1000.0, help="Frames per second, against what the file tells.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="TOML to write: a scenario takes it with extends.")] = None,
) -> None:
    """Measure how much a robot's own video shakes.

    Each number is in the units of the stress axes, with a 95 % interval; what the video does not tell is left out, with
    the reason.
    """
    from pftrack_sim.benchmark.kept.files import write_bytes
    from pftrack_sim.measuring.material import read_material
    from pftrack_sim.measuring.measured import as_toml
    from pftrack_sim.measuring.video import measure_video
    from pftrack_sim.report.tables import Table

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
