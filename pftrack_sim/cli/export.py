"""The command `export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pftrack_sim.cli import tables
from pftrack_sim.cli.options import MAX_SEEDS, AxisLevels, Backend, BenchSeeds, Settings, Workers
from pftrack_sim.cli.progress import cores, progress_bar
from pftrack_sim.cli.values import parse_axes, parse_names, parse_settings


def export(
    scenarios: Annotated[list[str], typer.Argument(help="Suites or scenarios: names or paths of TOML files.")],
    out: Annotated[Path, typer.Option(help="Folder of the data set; the same command resumes it.")],
    layout: Annotated[
        str, typer.Option("--format", help="otb, lasot, got10k, vot, mot, coco, kitti or webdataset.")
    ] = "otb",
    seeds: BenchSeeds = None,
    axis: AxisLevels = None,
    settings: Settings = None,
    image: Annotated[str, typer.Option(help="png, lossless, jpg, or mp4, a video (--format mot or lasot).")] = "png",
    quality: Annotated[
        int | None,
        typer.Option(help="Of jpg, 1 to 100 (default 95); of mp4 the constant rate factor, 0 to 51 (default 18)."),
    ] = None,
    maps: Annotated[
        str | None, typer.Option("--with", metavar="A,B", help="Beside each image: depth, masks (who is seen), flow.")
    ] = None,
    detections: Annotated[
        bool, typer.Option("--detections", help="Write what the detector finds into det/det.txt; --format mot.")
    ] = False,
    workers: Workers = None,
    backend: Backend = None,
) -> None:
    """Write episodes as a data set in a public layout.

    The truth of everybody in view lies beside each sequence in truth.parquet.
    """
    from pftrack_sim.benchmark import parse_seeds, plan_all
    from pftrack_sim.benchmark.export import export as export_plan
    from pftrack_sim.benchmark.export import sequence_count

    plan = plan_all(
        scenarios,
        trackers=["stay"],
        seeds=parse_seeds(seeds, most=MAX_SEEDS) if seeds is not None else None,
        axes=parse_axes(axis or []),
        overrides=parse_settings(settings or []),
    )
    kinds = parse_names(maps) if maps is not None else []
    chosen = workers if workers is not None else cores()
    with progress_bar("writing sequences", sequence_count(plan)) as tick:
        export_plan(
            plan,
            out,
            layout,
            image=image,
            quality=quality,
            maps=kinds,
            detections=detections,
            workers=chosen,
            backend=backend,
            on_sequence=tick,
        )
    tables.print_folder(out)
