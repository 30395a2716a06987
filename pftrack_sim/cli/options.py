"""Options shared by several commands, and those of the commands that make runs."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from pftrack_sim.cli.values import parse_axes, parse_settings, parse_trackers
from pftrack_sim.core.errors import ParameterError

if TYPE_CHECKING:
    from pftrack_sim.benchmark import Plan, TrackerSpec
    from pftrack_sim.trackers.isolation import Limits

ScenarioName = Annotated[str, typer.Argument(help="Scenario: a name or the path of a TOML file.")]
ScenarioNames = Annotated[list[str], typer.Argument(help="Suites or scenarios: names or paths of TOML files.")]
EpisodeSeed = Annotated[int, typer.Option(min=0, help="Root seed of the episode.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the scenario; may be repeated."),
]
Seeds = Annotated[str, typer.Option(metavar="SEEDS", help="Seeds: 3, 0:20 (20 excluded) or 1,5,9.")]
BenchSeeds = Annotated[
    str | None,
    typer.Option(metavar="SEEDS", help="3, 0:20 (20 excluded) or 1,5,9; default: 0:5, or a suite's own."),
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
        help="Severities of a stress axis, or AXIS.PARAMETER=5,10 for one of its parameters; may be repeated: "
        "the levels of several axes are crossed, each with each. "
        "Axes of the run: box_noise, start (see --box-noise, --starts); follow: latency=0,13,55 in ms.",
    ),
]
BoxNoise = Annotated[
    float,
    typer.Option(
        metavar="SHARE",
        help="Trackers start from boxes whose centre and sides are off by up to this share, by seed (OTB's SRE).",
    ),
]
Starts = Annotated[
    int,
    typer.Option(
        min=1, max=10_000, metavar="K", help="They start at K moments, a K-th of the episode apart (OTB's TRE)."
    ),
]
Workers = Annotated[int, typer.Option(min=0, show_default=False, help="Worker processes; default: one per core.")]
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
"""Number of cores available to this process."""

Isolation = Annotated[
    str,
    typer.Option(
        help="Trackers in separate processes: auto (third-party), always, never; container: third-party, sandboxed."
    ),
]
AllowTruth = Annotated[
    str,
    typer.Option(metavar="A,B", help="Trackers of your own that may ask for the true box; their rows are marked."),
]


@dataclass(frozen=True)
class RunOptions:
    """What is typed for a run besides its scenarios; each field is an option of the command line."""

    trackers: Annotated[
        str | None,
        typer.Option(
            "--trackers",
            "--tracker",
            metavar="A,B",
            help="Trackers: name or name[key=value,...]; default: a suite's, or ko2012,opencv-mil,stay (follow: "
            "oracle).",
        ),
    ] = None
    params: Params = None
    seeds: BenchSeeds = None
    axis: AxisLevels = None
    box_noise: BoxNoise = 0.0
    starts: Starts = 1
    anchors: Annotated[
        int | None,
        typer.Option(
            min=2,
            max=10_000,
            metavar="K",
            help="They start at K moments from the first to the last frame, and run forward from those of the first "
            "half and backward from the others (VOT 2020's anchors, one each 50 frames): accuracy, robustness, EAO.",
        ),
    ] = None
    settings: Settings = None
    preset: Annotated[
        str | None, typer.Option(help="Preset of the trackers: default or paper; default: default; a suite's own.")
    ] = None
    truth: Annotated[
        str, typer.Option(metavar="BOX", help="Score against the truth's box, amodal_box or visible_box.")
    ] = "box"
    out: Annotated[
        Path | None,
        typer.Option(
            help="Run folder; the same command resumes it, another one adds to it. Default: a new one in runs/."
        ),
    ] = None
    videos: Annotated[
        str, typer.Option(help="first (seed of each scenario), all, worst:N (of each tracker), or none.")
    ] = "first"
    log: Annotated[
        str,
        typer.Option(
            metavar="A,B", help="Logs of the first seeds (--videos all: of all): rerun, mcap; each needs its extra."
        ),
    ] = ""
    backend: Backend = None
    workers: Workers = CORES
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to use instead.")] = None
    part: Annotated[str, typer.Option(metavar="K/N", help="Only the K-th of N parts; see merge.")] = "1/1"
    isolation: Isolation = "auto"
    allow_truth: AllowTruth = ""
    frame_limit_s: Annotated[float, typer.Option(help="Time limit per frame of isolated trackers.")] = 60.0
    memory_limit_mb: Annotated[float, typer.Option(help="Memory limit of each isolated tracker; 0 is no limit.")] = (
        4096.0
    )
    refresh: Annotated[
        bool,
        typer.Option(
            "--refresh", help="Run again what is in the folder under the same name but was made with other code."
        ),
    ] = False
    stop_on_error: Annotated[
        bool,
        typer.Option(
            "--stop-on-error", "--stop-on-failure", help="Stop after the first episode in which a tracker fails."
        ),
    ] = False
    progress: Annotated[str, typer.Option(help="bar, lines, json or quiet; default is bar on a terminal.")] = ""
    verbose: Annotated[
        bool,
        typer.Option("--verbose", help="Also say what a suite's or scenario's own settings cut off its episodes."),
    ] = False
    search: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[TRACKER.]KEY=V,V",
            help="Try these values of a tracker's parameter on --search-seeds; the best run on --seeds. May be "
            "repeated.",
        ),
    ] = None
    search_seeds: Annotated[str | None, typer.Option(metavar="SEEDS", help="Seeds of --search; none of --seeds.")] = (
        None
    )

    @property
    def limits(self) -> Limits:
        """Limits of isolated trackers."""
        from pftrack_sim.trackers.isolation import Limits

        return Limits(self.frame_limit_s, self.memory_limit_mb)

    @property
    def changed(self) -> list[str]:
        """Keys of scenarios that are set or swept."""
        return [*parse_settings(self.settings or []), *(f"axes.{name}" for name in self.axes)]

    @property
    def axes(self) -> dict[str, list[float]]:
        """Levels of all axes, those of `--box-noise`, `--starts` and `--anchors` among them."""
        axes = parse_axes(self.axis or [])
        for name, option, levels in (
            ("box_noise", "--box-noise", [self.box_noise]),
            ("start", "--starts", starts(self.starts)),
            ("start", "--anchors", anchors(self.anchors) if self.anchors else [0.0]),
        ):
            if levels != [0.0]:
                if name in axes:
                    raise ParameterError(f"{option} and another option set the axis {name}: give one")
                axes[name] = levels
        return axes

    @property
    def specs(self) -> list[TrackerSpec] | None:
        """The trackers; None: a suite's own, or the usual ones."""
        if self.trackers is not None:
            return parse_trackers(self.trackers, self.preset or "default", self.params or [], self.allow_truth)
        if self.params:
            raise ParameterError("--param needs --trackers: it is theirs")
        if self.allow_truth:
            raise ParameterError("--allow-truth needs --trackers: it names some of them")
        return None

    def plan(
        self, scenarios: list[str], trackers: list[TrackerSpec] | None = None, seeds: str | None = None, **more: Any
    ) -> Plan:
        """The plan of these scenarios and options, but for other trackers and seeds; `more` goes to `plan_all`."""
        from pftrack_sim.benchmark import parse_seeds, plan_all

        chosen = seeds or self.seeds
        return plan_all(
            scenarios,
            trackers=trackers or self.specs,
            seeds=parse_seeds(chosen) if chosen is not None else None,
            axes=self.axes,
            overrides=parse_settings(self.settings or []),
            preset=self.preset,
            truth=self.truth,
            **more,
        )


def starts(count: int) -> list[float]:
    """Shares of an episode at which trackers start, so many, from 0 on."""
    return [place / count for place in range(count)]


def anchors(count: int) -> list[float]:
    """Levels of the axis `start` for so many anchors, below 0 for those from which trackers run backward."""
    places = [place / (count - 1) for place in range(count)]
    return [place if place <= 0.5 else -place for place in places]


def with_run_options(command: Callable[..., None], left_out: Sequence[str] = ()) -> Callable[..., None]:
    """A command whose last parameter, `run`, is typed as the options of `RunOptions`, but for those left out."""
    own = [one for one in inspect.signature(command, eval_str=True).parameters.values() if one.name != "run"]
    hints = get_type_hints(RunOptions, include_extras=True)
    shared = [
        inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=hints[one.name])
        for one in fields(RunOptions)
        if one.name not in left_out
    ]

    @functools.wraps(command)
    def typed(**values: Any) -> None:
        options = RunOptions(**{one.name: values.pop(one.name) for one in shared})
        command(**values, run=options)

    typed.__signature__ = inspect.Signature(  # pyright: ignore[reportAttributeAccessIssue]
        [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in own] + shared
    )
    return typed
