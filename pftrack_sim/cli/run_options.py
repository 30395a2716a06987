"""Options of the commands that make runs, listed once."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, get_type_hints

from pftrack_sim.cli.options import (
    AxisLevels,
    Backend,
    BenchPreset,
    BenchSeeds,
    BenchTrackers,
    FrameLimit,
    Isolation,
    Log,
    MemoryLimit,
    Out,
    Params,
    Part,
    ProgressMode,
    Refresh,
    Scheduler,
    ScoredBox,
    Settings,
    StopOnError,
    Verbose,
    Videos,
    Workers,
)
from pftrack_sim.cli.values import parse_axes, parse_settings, parse_trackers
from pftrack_sim.core.errors import ParameterError

if TYPE_CHECKING:
    from pftrack_sim.benchmark import Plan
    from pftrack_sim.trackers.isolation import Limits


@dataclass(frozen=True)
class RunOptions:
    """What is typed for a run besides its scenarios; each field is an option of the command line."""

    trackers: BenchTrackers = None
    params: Params = None
    seeds: BenchSeeds = None
    axis: AxisLevels = None
    settings: Settings = None
    preset: BenchPreset = None
    truth: ScoredBox = "box"
    out: Out = None
    videos: Videos = "first"
    log: Log = ""
    backend: Backend = None
    workers: Workers = None
    scheduler: Scheduler = None
    part: Part = "1/1"
    isolation: Isolation = "auto"
    frame_limit_s: FrameLimit = 60.0
    memory_limit_mb: MemoryLimit = 4096.0
    refresh: Refresh = False
    stop_on_error: StopOnError = False
    progress: ProgressMode = ""
    verbose: Verbose = False

    @property
    def limits(self) -> Limits:
        """Limits of isolated trackers."""
        from pftrack_sim.trackers.isolation import Limits

        return Limits(self.frame_limit_s, self.memory_limit_mb)

    @property
    def changed(self) -> list[str]:
        """Keys of scenarios that are set or swept."""
        return [*parse_settings(self.settings or []), *(f"axes.{name}" for name in parse_axes(self.axis or []))]

    def plan(self, scenarios: list[str], **more: Any) -> Plan:
        """The plan of these scenarios and options; `more` goes to `plan_all`."""
        from pftrack_sim.benchmark import parse_seeds, plan_all

        if self.params and self.trackers is None:
            raise ParameterError("--param needs --trackers: it is theirs")
        specs = None
        if self.trackers is not None:
            specs = parse_trackers(self.trackers, self.preset or "default", self.params or [])
        return plan_all(
            scenarios,
            trackers=specs,
            seeds=parse_seeds(self.seeds) if self.seeds is not None else None,
            axes=parse_axes(self.axis or []),
            overrides=parse_settings(self.settings or []),
            preset=self.preset,
            truth=self.truth,
            **more,
        )


def with_run_options(command: Callable[..., None]) -> Callable[..., None]:
    """A command whose last parameter, `run`, is typed as the options of `RunOptions`."""
    own = [one for one in inspect.signature(command, eval_str=True).parameters.values() if one.name != "run"]
    hints = get_type_hints(RunOptions, include_extras=True)
    shared = [
        inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=hints[one.name])
        for one in fields(RunOptions)
    ]

    @functools.wraps(command)
    def typed(**values: Any) -> None:
        options = RunOptions(**{one.name: values.pop(one.name) for one in shared})
        command(**values, run=options)

    typed.__signature__ = inspect.Signature(  # pyright: ignore[reportAttributeAccessIssue]
        [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in own] + shared
    )
    return typed
