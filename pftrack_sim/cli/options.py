"""Options shared by several commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

MAX_SEEDS = 1_000_000  # Of commands that hold something for every seed; bench and follow take any number

Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the scenario; may be repeated."),
]
Seeds = Annotated[str, typer.Option(metavar="SEEDS", help="Seeds: 3, 0:20 (20 excluded) or 1,5,9.")]
Trackers = Annotated[
    str, typer.Option("--trackers", "--tracker", metavar="A,B", help="Trackers: name or name[key=value,...].")
]
Preset = Annotated[str, typer.Option(help="Preset of the trackers: default or paper.")]
Params = Annotated[
    list[str] | None,
    typer.Option(
        "--param",
        metavar="[TRACKER.]KEY=VALUE",
        help="Parameter of one tracker or of all, for example ko2012.particles=true; may be repeated.",
    ),
]
Backend = Annotated[
    str | None,
    typer.Option(
        "--renderer",
        "--backend",
        help="gl, egl, osmesa, warp, or none (follow: no images); default: OpenGL if it loads, else warp.",
    ),
]
BenchTrackers = Annotated[
    str | None,
    typer.Option(
        "--trackers",
        "--tracker",
        metavar="A,B",
        help="Trackers: name or name[key=value,...]; default: a suite's, or ko2012,opencv-mil,stay (follow: oracle).",
    ),
]
BenchSeeds = Annotated[
    str | None,
    typer.Option(metavar="SEEDS", help="3, 0:20 (20 excluded) or 1,5,9; default: 0:3, or a suite's own."),
]
BenchPreset = Annotated[
    str | None, typer.Option(help="Preset of the trackers: default or paper; default: default; a suite's own.")
]
ScoredBox = Annotated[
    str, typer.Option(metavar="BOX", help="Score against the truth's box, amodal_box or visible_box.")
]
Out = Annotated[
    Path | None,
    typer.Option(help="Run folder; the same command resumes it, another one adds to it. Default: a new one in runs/."),
]
Refresh = Annotated[
    bool,
    typer.Option(
        "--refresh", help="Run again the trackers and controllers whose code changed since the run folder was begun."
    ),
]
StopOnError = Annotated[
    bool,
    typer.Option("--stop-on-error", "--stop-on-failure", help="Stop after the first episode in which a tracker fails."),
]
Cache = Annotated[
    bool,
    typer.Option("--cache", help="Keep rendered frames and take them from there: a changed tracker runs at once."),
]
CacheFolder = Annotated[Path | None, typer.Option(help="Folder of --cache; default: ~/.cache/pftrack-sim/frames.")]
CacheLimit = Annotated[
    float, typer.Option(metavar="GB", help="Size of --cache; what was not used for longest goes first.")
]
SequenceLayout = Annotated[
    str | None,
    typer.Option(
        "--format", metavar="LAYOUT", help="otb, lasot, got10k, vot, mot, coco, kitti or webdataset; default: found."
    ),
]
AxisLevels = Annotated[
    list[str] | None,
    typer.Option(
        "--axis",
        metavar="AXIS=0,1,2",
        help="Severities of a stress axis, or AXIS.PARAMETER=5,10 for one of its parameters; may be repeated. "
        "follow: also latency=0,13,55 in ms, for every tracker alike.",
    ),
]
Videos = Annotated[str, typer.Option(help="first (seed of each scenario), all, worst:N (of each tracker), or none.")]
Log = Annotated[
    str,
    typer.Option(
        metavar="A,B", help="Logs of the first seeds (--videos all: of all): rerun, mcap; each needs its extra."
    ),
]
Workers = Annotated[int | None, typer.Option(min=0, help="Worker processes; default: one per core.")]
Scheduler = Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to use instead.")]
Part = Annotated[str, typer.Option(metavar="K/N", help="Only the K-th of N parts; see merge.")]
Isolation = Annotated[
    str,
    typer.Option(
        help="Trackers in separate processes: auto (third-party), always, never; container: third-party, sandboxed."
    ),
]
FrameLimit = Annotated[float, typer.Option(help="Time limit per frame of isolated trackers.")]
MemoryLimit = Annotated[float, typer.Option(help="Memory limit of each isolated tracker; 0 is no limit.")]
ProgressMode = Annotated[str, typer.Option(help="bar, lines, json or quiet; default is bar on a terminal.")]
Verbose = Annotated[
    bool, typer.Option("--verbose", help="Also say what a suite's or scenario's own settings cut off its episodes.")
]
