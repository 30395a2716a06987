"""The plan of a run, as data: scenarios x conditions x seeds, and the trackers.

A plan is frozen, survives a round trip through JSON, and is stored with the run. `from_names` makes one.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import random
from collections import Counter
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, ValidationError, field_validator, model_validator

from pftrack_sim.benchmark import keys
from pftrack_sim.benchmark.asked.suite import Suite
from pftrack_sim.benchmark.keys import slug
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.text import one_line
from pftrack_sim.scenario import Scenario
from pftrack_sim.scenario import load as load_scenario
from pftrack_sim.scenario.section import NotNegative, Section
from pftrack_sim.trackers.registry import ORACLES, recognises, told

MAX_EPISODES = 1_000_000

EpisodeKind: TypeAlias = Literal["open", "follow"]
"""`"open"`: the robot follows its script, and all trackers share the frames. `"follow"`: a tracker drives the robot in
closed loop, and each has its own episode."""

LATENCY, BOX_NOISE, START = "latency", "box_noise", "start"

RUN_AXES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        LATENCY: ("ms", "time charged to every tracker for each frame; closed loop only"),
        BOX_NOISE: ("share", "share of its sides by which the first box is off at most, by seed (OTB's SRE)"),
        START: (
            "share",
            "share of the episode after which trackers start and scores begin (OTB's TRE); below 0 they see the frames "
            "before it, the last one first (VOT's anchors); open loop only",
        ),
    }
)
"""Axes of the run, not of scenarios: unit, and what a level is."""

ScoredBox: TypeAlias = Literal["box", "amodal_box", "visible_box"]
"""True box that estimates are compared with, by its name in `Truth`."""


class TrackerSpec(Section):
    """Identity of a tracker in a run.

    Attributes:
        name: Its name, or `package.module:factory`.
        latency_ms: Simulated time charged for every frame that it takes, unless the condition sets another.
        controller: Controller that drives the robot with its estimates; None in open loop.
        code: Digests of the code of tracker and controller, and of files named in the parameters.
        allow_truth: Whether one that is not built in may ask for the true box (`trackers.NeedsTruth`).
    """

    name: str
    preset: str = "default"
    params: dict[str, Any] = Field(default_factory=dict)
    controller: str | None = None
    latency_ms: NotNegative = 0.0
    code: dict[str, str] = Field(default_factory=dict)
    allow_truth: bool = False

    @classmethod
    def of(cls, given: str | TrackerSpec, preset: str = "default") -> TrackerSpec:
        """A specification, which is kept, or that of a name."""
        if isinstance(given, TrackerSpec):
            return given
        with parameter_errors("trackers"):
            return cls(name=given, preset=preset)

    @field_validator("params")
    @classmethod
    def _check_params(cls, params: dict[str, Any]) -> dict[str, Any]:
        """Let nothing pass that its JSON would change, such as NaN."""
        for name, value in params.items():
            try:
                json.dumps(value, allow_nan=False)
            except (TypeError, ValueError, RecursionError):
                given = one_line(f"{name}={value!r}", 60)
                raise ValueError(
                    f"a parameter is a finite number, a text, true, false, or a list or table of these, got {given}"
                ) from None
        return params

    @property
    def told(self) -> Literal["", "truth", "detections"]:
        """What it is told of each frame besides its image."""
        return "truth" if self.allow_truth else told(self.name)

    @property
    def arguments(self) -> dict[str, Any]:
        """Parameters that it is made with: in closed loop one that recognises its target also searches it."""
        searches = self.controller is not None and self.preset == "default" and recognises(self.name)
        return {**({"recognition": "search"} if searches else {}), **self.params}

    @property
    def digest(self) -> str:
        """SHA-256 of all of it, with the code that runs."""
        return keys.digest(self.model_dump(mode="json"))

    @property
    def base_label(self) -> str:
        """Name with preset and parameters, for people: `"ko2012"`, `"ko2012[particle_count=300]"`."""
        options = {**({"preset": self.preset} if self.preset != "default" else {}), **self.params}
        inner = ",".join(
            f"{key}={json.dumps(value) if isinstance(value, bool) else value}" for key, value in options.items()
        )
        return self.name + (f"[{inner}]" if inner else "")

    @property
    def label(self) -> str:
        """`base_label` with latency, controller and what it is told: `"ko2012@13ms+servo-avoid"`, `"my:make (truth)"`.

        It is printed and never parsed.
        """
        latency = f"@{self.latency_ms:g}ms" if self.latency_ms else ""
        controller = f"+{self.controller}" if self.controller is not None else ""
        mark = f" ({self.told})" if self.told and self.name not in ORACLES else ""
        return self.base_label + latency + controller + mark


class Condition(Section):
    """One combination of axis levels; without levels the scenario is unchanged.

    Attributes:
        levels: Pairs of an axis and its severity, of `axis.parameter` and its value at severity 1, or of one of
            `RUN_AXES` and its level.
        variant: Name of the other changes of a condition, where its levels do not identify it: `"stranger"`.
    """

    levels: tuple[tuple[str, float], ...] = ()
    variant: str = ""

    @property
    def name(self) -> str:
        """`"jitter=2"`, `"jitter.ground_rms_deg=0.5,light=1"`, `"stranger occlusion=1"`, or `"base"`; never parsed."""
        levels = ",".join(f"{axis}={level:g}" for axis, level in self.levels) or "base"
        return f"{self.variant} {levels}" if self.variant else levels

    @property
    def of_run(self) -> dict[str, float]:
        """The levels of `RUN_AXES` that it has."""
        return {name: level for name, level in self.levels if name in RUN_AXES}

    @cached_property
    def overrides(self) -> dict[str, float]:
        """The dotted keys that the levels set in a scenario."""
        with_severity = {axis for axis, _ in self.levels if "." not in axis}
        dotted: dict[str, float] = {}
        for axis, level in self.levels:
            name, _, parameter = axis.partition(".")
            if name in RUN_AXES:
                continue
            dotted[f"axes.{name}.{parameter or 'severity'}"] = level
            if parameter and name not in with_severity:
                dotted[f"axes.{name}.severity"] = 1.0
        return dotted


class ScenarioSpec(Section):
    """A scenario in a plan: its name, and its whole content with the plan's overrides and every default."""

    name: str
    tree: dict[str, Any]

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content."""
        return keys.digest(self.tree)


class Sweep(Section):
    """Scenarios x conditions x seeds."""

    scenarios: tuple[ScenarioSpec, ...]
    conditions: tuple[Condition, ...] = (Condition(),)
    seeds: tuple[Annotated[int, Field(ge=0)], ...]

    @property
    def episode_count(self) -> int:
        """Number of combinations."""
        return len(self.scenarios) * len(self.conditions) * len(self.seeds)


@dataclass(frozen=True)
class Episode:
    """One episode of a plan.

    Attributes:
        spec: Scenario with the overrides of the plan.
        trackers: Trackers that share its frames; in closed loop the only one.
        environment: Code and versions, see `keys.environment`.
        is_first_seed: Whether it has the first seed of its scenario and condition.
    """

    spec: ScenarioSpec
    condition: Condition
    seed: int
    trackers: tuple[TrackerSpec, ...]
    environment: keys.Environment
    number: int = 0
    is_first_seed: bool = False
    truth: ScoredBox = "box"

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario with the overrides of plan and condition."""
        return load_scenario(Scenario(self.spec.name, self.spec.tree), self.condition.overrides)

    @property
    def kind(self) -> EpisodeKind:
        """Open or closed loop."""
        return _kind(self.trackers)

    @property
    def latency_ms(self) -> float:
        """Latency of its tracker in closed loop."""
        return self.condition.of_run.get(LATENCY, self.trackers[0].latency_ms)

    @property
    def box_noise(self) -> float:
        """Share of its sides by which the first box is off at most."""
        return self.condition.of_run.get(BOX_NOISE, 0.0)

    @property
    def backward(self) -> bool:
        """Whether its last frame is shown first."""
        return self.condition.of_run.get(START, 0.0) < 0.0

    @property
    def first_frame(self) -> int:
        """Frame, in the order in which they are shown, before which no tracker starts and nothing is scored."""
        start = self.condition.of_run.get(START, 0.0)
        return round((1.0 + start if start < 0.0 else start) * self.scenario.frame_count(self.seed))

    @cached_property
    def frames_key(self) -> str:
        """Key of the table of the frames: in closed loop the result's, as the tracker steers."""
        if self.kind == "follow":
            return self.results[0].key
        return keys.digest(self.drawn_key, self.condition.of_run) if self.condition.of_run else self.drawn_key

    @cached_property
    def drawn_key(self) -> str:
        """Key of what is drawn in open loop."""
        drawn_by = keys.environment_digest(self.environment, scoring=False)
        return keys.digest(self.spec.digest, self.condition.overrides, self.seed, drawn_by)

    @cached_property
    def results(self) -> tuple[AskedResult, ...]:
        """The result of each tracker."""
        scored_by = keys.environment_digest(self.environment, scoring=True)
        condition = self.condition.levels, self.condition.variant
        common = keys.digest(self.drawn_key, self.spec.name, condition, self.truth, scored_by)
        return tuple(AskedResult(self, one, keys.digest(common, one.digest)) for one in self.trackers)

    @property
    def frames_table(self) -> str:
        """Path within a run folder of the table of its frames."""
        return f"frames/{self.stem}-{keys.short(self.frames_key)}.parquet"

    @property
    def video(self) -> str:
        """Path within a run folder of its video."""
        return f"videos/{self.path}.mp4"

    @property
    def path(self) -> str:
        """Path of the files that show all its trackers, without a suffix: videos and logs."""
        return f"{self.stem}-{keys.short(keys.digest(*(one.key for one in self.results)))}"

    @property
    def stem(self) -> str:
        """Path of its files within their folders, as far as all of them share it."""
        return f"{slug(self.spec.name)}/{slug(self.condition.name)}/seed-{self.seed:04d}"

    @property
    def name(self) -> str:
        """For people: `"plaza-walk jitter=2 seed 3"`."""
        condition = [self.condition.name] if self.condition != Condition() else []
        driver = [self.trackers[0].label] if self.kind == "follow" else []
        return " ".join([self.spec.name, *condition, f"seed {self.seed}", *driver])


@dataclass(frozen=True)
class AskedResult:
    """A tracker's result in an episode that is asked for, with its key."""

    episode: Episode
    tracker: TrackerSpec
    key: str

    @property
    def path(self) -> str:
        """Path of its files within their folders, without a suffix; it ends in the short key."""
        return f"{self.episode.stem}-{slug(self.tracker.label)}-{keys.short(self.key)}"

    @property
    def table(self) -> str:
        """Path within a run folder of its table."""
        return f"episodes/{self.path}.parquet"

    @property
    def tables(self) -> tuple[str, str]:
        """Paths within a run folder of its table and of that of its frames."""
        return self.table, self.episode.frames_table


def _kind(trackers: tuple[TrackerSpec, ...]) -> EpisodeKind:
    return "open" if trackers[0].controller is None else "follow"


class Plan(Section):
    """Everything that a run does.

    Attributes:
        trackers: The trackers, in the order of the tables.
        suites: The suites it was made from, with their tables and claims.
        environment: Code and versions that it is run with.
    """

    sweeps: tuple[Sweep, ...]
    trackers: tuple[TrackerSpec, ...]
    suites: tuple[Suite, ...] = ()
    truth: ScoredBox = "box"
    environment: dict[str, str] = Field(default_factory=keys.environment)

    @model_validator(mode="after")
    def _check_unique(self) -> Plan:
        count = sum(sweep.episode_count for sweep in self.sweeps) * max(len(self.trackers), 1)
        if count > MAX_EPISODES:
            raise ValueError(f"a plan has at most {MAX_EPISODES} episodes, got {count}")
        cells = [
            (scenario.name, condition.name, seed)
            for sweep in self.sweeps
            for scenario, condition, seed in itertools.product(sweep.scenarios, sweep.conditions, sweep.seeds)
        ]
        seeds = [_repeated(sweep.seeds) for sweep in self.sweeps]
        given = {
            "seed": ([seed for sweep in self.sweeps for seed in sweep.seeds], list(itertools.chain(*seeds))),
            "scenario": (cells, [f"{name} {what}".removesuffix(" base") for name, what, _ in _repeated(cells)]),
            "tracker": (self.labels, _repeated(self.labels)),
        }
        for kind, (all_of_them, repeated) in given.items():
            if not all_of_them:
                raise ValueError(f"a plan needs at least one {kind}")
            if repeated:
                raise ValueError(f"{kind} given twice: {', '.join(map(str, dict.fromkeys(repeated)))}")
        if len({tracker.controller is None for tracker in self.trackers}) > 1:
            raise ValueError("either every tracker needs a controller, or none may have one")
        swept = {name for sweep in self.sweeps for condition in sweep.conditions for name in condition.of_run}
        if self.kind == "open" and (LATENCY in swept or any(tracker.latency_ms for tracker in self.trackers)):
            raise ValueError("latency is charged only where the tracker drives the robot: see follow")
        if self.kind == "follow" and START in swept:
            raise ValueError("trackers start later only in open loop: where they drive, the robot would stand still")
        return self

    @property
    def kind(self) -> EpisodeKind:
        """Open or closed loop."""
        return _kind(self.trackers)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the trackers."""
        return tuple(tracker.label for tracker in self.trackers)

    @property
    def scenarios(self) -> dict[str, ScenarioSpec]:
        """Every scenario by name."""
        return {scenario.name: scenario for sweep in self.sweeps for scenario in sweep.scenarios}

    @property
    def conditions(self) -> dict[str, Condition]:
        """Every condition by name."""
        return {condition.name: condition for sweep in self.sweeps for condition in sweep.conditions}

    @property
    def episode_count(self) -> int:
        """Number of episodes."""
        groups = 1 if self.kind == "open" else len(self.trackers)
        return groups * sum(sweep.episode_count for sweep in self.sweeps)

    @property
    def first_episodes(self) -> list[Episode]:
        """The first episode of each scenario and condition."""
        return list({(one.spec.name, one.condition.name): one for one in reversed(self._episodes)}.values())[::-1]

    @cached_property
    def frame_count(self) -> int:
        """Number of frames, if every seed of a scenario and condition had as many as the first one."""
        counts = Counter((one.spec.name, one.condition.name) for one in self._episodes)
        return sum(
            one.scenario.frame_count(one.seed) * counts[one.spec.name, one.condition.name]
            for one in self.first_episodes
        )

    def episodes(self, *, part: tuple[int, int] = (1, 1), shuffle: int | None = None) -> Sequence[Episode]:
        """Every episode in the plan's order.

        Args:
            part: Part k of n, a random sample: every n-th episode of the plan's order would hold the same trackers
                and seeds again and again.
            shuffle: A seed to shuffle the order with, and to draw the parts by.
        """
        if shuffle is None and part == (1, 1):
            return self._episodes
        numbers = range(len(self._episodes))
        drawn = random.Random(shuffle or 0).sample(numbers, len(numbers))[part[0] - 1 :: part[1]]
        return [self._episodes[number] for number in (sorted(drawn) if shuffle is None else drawn)]

    def episode(self, number: int) -> Episode:
        """The episode at a place in the plan's order."""
        return self._episodes[number]

    @cached_property
    def _episodes(self) -> tuple[Episode, ...]:
        groups = [self.trackers] if self.kind == "open" else [(tracker,) for tracker in self.trackers]
        made: list[Episode] = []
        for sweep in self.sweeps:
            for cell in itertools.product(sweep.scenarios, sweep.conditions, sweep.seeds):
                for trackers in groups:
                    first = cell[2] == sweep.seeds[0]
                    made.append(Episode(*cell, trackers, self.environment, len(made), first, self.truth))
        return tuple(made)

    @cached_property
    def asked(self) -> dict[str, AskedResult]:
        """Every result by its short key, in the plan's order."""
        return {keys.short(one.key): one for episode in self._episodes for one in episode.results}


def _repeated(values: Sequence[Any]) -> list[Any]:
    return [value for value, count in Counter(values).items() if count > 1]


def make_checked_plan(
    sweeps: tuple[Sweep, ...],
    trackers: tuple[TrackerSpec, ...],
    suites: tuple[Suite, ...] = (),
    truth: ScoredBox = "box",
    environment: keys.Environment | None = None,
) -> Plan:
    """Make a plan; without an environment it is run with the code and the versions of now.

    Raises:
        ParameterError: Nothing to run, or something given twice.
    """
    with parameter_errors("plan"):
        known = dict(environment or keys.environment())
        return Plan(sweeps=sweeps, trackers=trackers, suites=suites, truth=truth, environment=known)


@contextlib.contextmanager
def parameter_errors(what: str) -> Generator[None]:
    """Raise ParameterError in place of the block's ValidationError; `what` names what is made in the message."""
    try:
        yield
    except ValidationError as error:
        first = error.errors()[0]
        if first["type"] == "value_error":  # a check of this module, which says it all
            raise ParameterError(first["msg"].removeprefix("Value error, ")) from None
        given = one_line(repr(first["input"]), 60)
        raise ParameterError(f"{what}: {first['msg'][:1].lower()}{first['msg'][1:]}, got {given}") from None
