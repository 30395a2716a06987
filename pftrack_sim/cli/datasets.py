"""Commands of data sets: export episodes and results, score result files, and measure how hard sequences are."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pftrack_sim.cli import options, tables
from pftrack_sim.cli.progress import progress_bar
from pftrack_sim.cli.values import parse_axes, parse_names, parse_settings
from pftrack_sim.core.errors import ParameterError

if TYPE_CHECKING:
    from pftrack_sim.scenario import Scenario


def export(
    scenarios: options.ScenarioNames,
    out: Annotated[Path, typer.Option(help="Folder of the data set; the same command resumes it.")],
    layout: Annotated[
        str, typer.Option("--format", help="otb, lasot, got10k, vot, mot, coco, kitti or webdataset.")
    ] = "otb",
    seeds: options.BenchSeeds = None,
    axis: options.AxisLevels = None,
    settings: options.Settings = None,
    image: Annotated[
        str | None,
        typer.Option(
            help="png, lossless, jpg, or mp4, a video (--format mot or lasot); default: jpg of got10k, otb and lasot, "
            "whose readers look for that, else png."
        ),
    ] = None,
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
    workers: options.Workers = options.CORES,
    backend: options.Backend = None,
) -> None:
    """Write episodes as a data set in a public layout.

    The truth of everybody in view lies beside each sequence in truth.parquet.
    """
    from pftrack_sim.benchmark import parse_seeds, plan_all
    from pftrack_sim.benchmark.datasets.export import export as export_plan

    plan = plan_all(
        scenarios,
        trackers=["stay"],
        seeds=parse_seeds(seeds) if seeds is not None else None,
        axes=parse_axes(axis or []),
        overrides=parse_settings(settings or []),
    )
    kinds = parse_names(maps) if maps is not None else []
    with progress_bar("writing sequences", plan.episode_count, resumes=True) as tick:
        export_plan(
            plan,
            out,
            layout,
            image=image,
            quality=quality,
            maps=kinds,
            detections=detections,
            workers=workers,
            backend=backend,
            on_sequence=tick,
        )
    tables.print_folder(out)


def export_results(
    run: Annotated[Path, typer.Argument(help="Run folder that bench wrote.")],
    out: Annotated[Path, typer.Option(help="Folder of the results.")],
    form: Annotated[str, typer.Option("--format", help="otb, got10k, vot or mot.")] = "got10k",
) -> None:
    """Write a run's estimates as result files of a toolkit.

    They belong to the data set that export writes of the same scenarios and seeds.
    """
    from pftrack_sim.benchmark import RunStore
    from pftrack_sim.benchmark.datasets.results import export_results as export_all

    store = RunStore(run)
    with progress_bar("writing results", len(store.results)) as tick:
        export_all(store, out, form, on_result=tick)
    tables.print_folder(out)


def score(
    results: Annotated[Path, typer.Argument(help="Folder of result files, of this or of another toolkit.")],
    dataset: Annotated[Path, typer.Option(help="Folder of the data set, or of one sequence.")],
    layout: options.SequenceLayout = None,
    form: Annotated[
        str | None, typer.Option("--results-format", help="otb, got10k, vot or mot; default: found by the files.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder to write report.html and results.csv into.")] = None,
) -> None:
    """Score result files of other tools against a data set.

    With --out, report.html has leader board, curves, overlap frame by frame and paired differences, and results.csv
    all measures of every file.
    """
    from pftrack_sim.benchmark.datasets.results import score_results
    from pftrack_sim.cli.results import print_scored
    from pftrack_sim.report import write_scored

    found = score_results(results, dataset, layout=layout, form=form)
    print_scored(found)
    if out is not None:
        tables.print_folder(write_scored(found, out, {"results": str(results), "data set": str(dataset)}))


def profile(
    videos: Annotated[
        list[str],
        typer.Argument(help="Scenarios and suites (names or paths of TOML files), and folders of recorded sequences."),
    ],
    seeds: options.Seeds = "0:2",
    axis: options.AxisLevels = None,
    settings: options.Settings = None,
    backend: options.Backend = None,
    layout: options.SequenceLayout = None,
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
    tables.print_tables(*profile_tables(profiles))
    if out is not None:
        numbers = {
            name: {key: None if math.isnan(value) else value for key, value in asdict(one).items()}
            for name, one in profiles.items()
        }
        write_bytes(out / "profile.json", json.dumps(numbers, indent=2).encode())
        tables.print_folder(write_profile_figure(profiles, out / "profile.png"))
