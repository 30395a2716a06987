"""The plan of a run, as data: scenarios x conditions x seeds, and the trackers.

A plan is frozen, survives a round trip through JSON, and has a digest; it is stored with the run. `planning` makes one.
"""

from __future__ import annotations

import hashlib
import json
import random
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal, TypeAlias, cast

from pydantic import Field, ValidationError, model_validator

from pftrack_sim.benchmark.files import distinct_slugs
from pftrack_sim.benchmark.suite import Suite
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.scenario import Scenario
from pftrack_sim.scenario import load as load_scenario
from pftrack_sim.scenario.ranges import is_range
from pftrack_sim.scenario.section import NotNegative, Section

MAX_EPISODES = 10_000_000

EpisodeKind: TypeAlias = Literal["open", "follow"]
"""`"open"`: the robot follows its script, and all trackers share the frames. `"follow"`: a tracker drives the robot in
closed loop, and each has its own episode."""

LATENCY = "latency"
"""Name of the axis of the run (not of scenarios) that charges every tracker the same milliseconds per frame."""

ScoredBox: TypeAlias = Literal["box", "amodal_box", "visible_box"]
"""True box that estimates are compared with, by its name in `Truth`."""

Seed: TypeAlias = Annotated[int, Field(ge=0)]


class TrackerSpec(Section):
    """Identity of a tracker in a run.

    Attributes:
        name: Its name, or `package.module:factory`.
        preset: Its preset.
        params: Its parameters.
        controller: Controller that drives the robot with its estimates; None in open loop.
        latency_ms: Simulated time charged for every frame that it takes, unless the condition sets another.
        code: Digests of what runs and is not part of this package: the code of a third-party tracker and controller,
            and files named in the parameters. A run folder is not continued with other code.
    """

    name: str
    preset: str = "default"
    params: dict[str, Any] = Field(default_factory=dict)
    controller: str | None = None
    latency_ms: NotNegative = 0.0
    code: dict[str, str] = Field(default_factory=dict)

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
        """`base_label` with latency and controller: `"ko2012@13ms+servo-avoid"`. It is printed and never parsed."""
        latency = f"@{self.latency_ms:g}ms" if self.latency_ms else ""
        controller = f"+{self.controller}" if self.controller is not None else ""
        return self.base_label + latency + controller


class Condition(Section):
    """One combination of axis levels; without levels the scenario is unchanged.

    Attributes:
        levels: Pairs of an axis and its severity, of `axis.parameter` and its value at severity 1, or of `latency` and
            milliseconds.
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
    def latency_ms(self) -> float | None:
        """Latency charged to every tracker, or None where each has its own."""
        return dict(self.levels).get(LATENCY)

    @property
    def overrides(self) -> dict[str, float]:
        """The dotted keys that the levels set in a scenario."""
        with_severity = {axis for axis, _ in self.levels if "." not in axis}
        keys: dict[str, float] = {}
        for axis, level in self.levels:
            name, _, parameter = axis.partition(".")
            if name == LATENCY:
                continue
            keys[f"axes.{name}.{parameter or 'severity'}"] = level
            if parameter and name not in with_severity:
                keys[f"axes.{name}.severity"] = 1.0
        return keys


class ScenarioSpec(Section):
    """A scenario in a plan: its name, and its whole content with the plan's overrides."""

    name: str
    tree: dict[str, Any]


class Sweep(Section):
    """Scenarios x conditions x seeds."""

    scenarios: tuple[ScenarioSpec, ...]
    conditions: tuple[Condition, ...] = (Condition(),)
    seeds: tuple[Seed, ...]

    @property
    def episode_count(self) -> int:
        """Number of combinations."""
        return len(self.scenarios) * len(self.conditions) * len(self.seeds)


@dataclass(frozen=True)
class Episode:
    """One episode of a plan.

    Attributes:
        scenario: With the overrides of the plan and the condition.
        condition: Axis levels.
        seed: Root seed.
        path: Path of its files within `episodes/` and `videos/`, without their suffix.
        trackers: Trackers that share its frames; in closed loop the only one.
        is_first_seed: Whether it has the first seed of its scenario and condition.
        truth: True box that estimates are compared with.
    """

    scenario: Scenario
    condition: Condition
    seed: int
    path: str
    trackers: tuple[TrackerSpec, ...]
    is_first_seed: bool = False
    truth: ScoredBox = "box"

    @property
    def kind(self) -> EpisodeKind:
        """Open or closed loop."""
        return _kind(self.trackers)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of its trackers."""
        return tuple(tracker.label for tracker in self.trackers)

    @property
    def latency_ms(self) -> float:
        """Latency of its tracker in closed loop."""
        by_condition = self.condition.latency_ms
        return self.trackers[0].latency_ms if by_condition is None else by_condition

    @property
    def digest(self) -> str:
        """SHA-256 of everything that decides the content of its files."""
        trackers = [tracker.model_dump(mode="json") for tracker in self.trackers]
        identity = [self.scenario.name, self.scenario.digest, self.condition.model_dump(mode="json")]
        return hashlib.sha256(json.dumps([*identity, self.seed, self.truth, trackers]).encode()).hexdigest()

    @property
    def name(self) -> str:
        """For people: `"plaza-walk jitter=2 seed 3"`."""
        condition = [self.condition.name] if self.condition != Condition() else []
        driver = self.labels if self.kind == "follow" else ()
        return " ".join([self.scenario.name, *condition, f"seed {self.seed}", *driver])


def _kind(trackers: tuple[TrackerSpec, ...]) -> EpisodeKind:
    return "open" if trackers[0].controller is None else "follow"


class Plan(Section):
    """Everything that a run does.

    Attributes:
        sweeps: The episodes.
        trackers: The trackers, in the order of the tables.
        suites: The suites it was made from, with their tables and claims.
        truth: True box that estimates are compared with.
    """

    format: Literal[2] = 2
    sweeps: tuple[Sweep, ...]
    trackers: tuple[TrackerSpec, ...]
    suites: tuple[Suite, ...] = ()
    truth: ScoredBox = "box"

    @model_validator(mode="after")
    def _check_unique(self) -> Plan:
        named: dict[str, list[tuple[str, tuple[object, ...]]]] = {
            "seed": [(str(seed), (index, seed)) for index, sweep in enumerate(self.sweeps) for seed in sweep.seeds],
            "scenario": [
                (scenario.name, (scenario.name, condition.name, seed))
                for sweep in self.sweeps
                for scenario in sweep.scenarios
                for condition in sweep.conditions
                for seed in sweep.seeds[:1]
            ],
            "tracker": [(tracker.label, (tracker.label,)) for tracker in self.trackers],
        }
        count = sum(sweep.episode_count for sweep in self.sweeps) * max(len(self.trackers), 1)
        if count > MAX_EPISODES:
            raise ValueError(f"a plan has at most {MAX_EPISODES} episodes, got {count}")
        for kind, given in named.items():
            if not given:
                raise ValueError(f"a plan needs at least one {kind}")
            counts = Counter(key for _, key in given)
            repeated = dict.fromkeys(name for name, key in given if counts[key] > 1)
            if repeated:
                raise ValueError(f"{kind} given twice: {', '.join(repeated)}")
        if len({tracker.controller is None for tracker in self.trackers}) > 1:
            raise ValueError("either every tracker needs a controller, or none may have one")
        latencies = [condition.latency_ms for sweep in self.sweeps for condition in sweep.conditions]
        charged = any(tracker.latency_ms for tracker in self.trackers) or any(one is not None for one in latencies)
        if charged and self.kind == "open":
            raise ValueError("latency is charged only where the tracker drives the robot: see follow")
        return self

    @property
    def kind(self) -> EpisodeKind:
        """Open or closed loop."""
        return _kind(self.trackers)

    @property
    def digest(self) -> str:
        """SHA-256 of the plan's canonical JSON."""
        return hashlib.sha256(json.dumps(self.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()

    def without_code(self) -> Plan:
        """The same plan whatever third-party code runs."""
        trackers = tuple(tracker.model_copy(update={"code": {}}) for tracker in self.trackers)
        return Plan(sweeps=self.sweeps, trackers=trackers, suites=self.suites, truth=self.truth)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the trackers."""
        return tuple(tracker.label for tracker in self.trackers)

    @property
    def episode_count(self) -> int:
        """Number of episodes."""
        return len(self._tracker_groups()) * sum(sweep.episode_count for sweep in self.sweeps)

    def _tracker_groups(self) -> list[tuple[TrackerSpec, ...]]:
        """Trackers that share an episode."""
        return [self.trackers] if self.kind == "open" else [(tracker,) for tracker in self.trackers]

    @cached_property
    def frame_count(self) -> int:
        """Number of frames; an estimate from the first seed where many seeds have different lengths."""
        total = 0
        for sweep, scenario, _ in self._settings():
            camera = scenario.tree.get("camera", {})
            varies = is_range(scenario.tree.get("duration_s")) or is_range(camera.get("rate_hz"))
            varies = varies or scenario.resolve(sweep.seeds[0]).axes.stream.on
            counted = sweep.seeds if varies and len(sweep.seeds) <= 100 else sweep.seeds[:1]
            frames = sum(scenario.frame_count(seed) for seed in counted)
            total += frames * len(sweep.seeds) // len(counted)
        return total * len(self._tracker_groups())

    def episodes(self, *, shuffle: int | None = None) -> Iterator[Episode]:
        """Every episode in the plan's order, made one at a time.

        Args:
            shuffle: A seed to shuffle the order with.
        """
        if shuffle is not None:
            mixed = list(self.episodes())
            random.Random(shuffle).shuffle(mixed)
            yield from mixed
            return
        scenario_slugs = distinct_slugs(scenario.name for sweep in self.sweeps for scenario in sweep.scenarios)
        condition_slugs = distinct_slugs(condition.name for sweep in self.sweeps for condition in sweep.conditions)
        tracker_slugs = distinct_slugs(self.labels)
        for sweep, scenario, condition in self._settings():
            folder = f"{scenario_slugs[scenario.name]}/{condition_slugs[condition.name]}"
            for seed in sweep.seeds:
                for trackers in self._tracker_groups():
                    driver = f"__{tracker_slugs[trackers[0].label]}" if self.kind == "follow" else ""
                    path = f"{folder}/seed-{seed:04d}{driver}"
                    yield Episode(scenario, condition, seed, path, trackers, seed == sweep.seeds[0], self.truth)

    def _settings(self) -> Iterator[tuple[Sweep, Scenario, Condition]]:
        for sweep in self.sweeps:
            for scenario in sweep.scenarios:
                for condition in sweep.conditions:
                    yield sweep, load_scenario(Scenario(scenario.name, scenario.tree), condition.overrides), condition


def make_checked_plan(
    sweeps: tuple[Sweep, ...],
    trackers: tuple[TrackerSpec, ...],
    suites: tuple[Suite, ...] = (),
    truth: ScoredBox = "box",
) -> Plan:
    """Make a plan.

    Raises:
        ParameterError: Nothing to run, or something given twice.
    """
    try:
        return Plan(sweeps=sweeps, trackers=trackers, suites=suites, truth=truth)
    except ValidationError as error:
        raise ParameterError(str(error.errors()[0]["msg"]).removeprefix("Value error, ")) from None


def read_plan(record: object, source: str) -> Plan:
    """Make a plan of its JSON record; `source` is named in the message.

    Raises:
        RunError: It is no plan.
    """
    try:
        return Plan.model_validate(record)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise RunError(f"{source}: not a plan this version can read: {where or 'plan'}: {first['msg']}") from None


def differences(given: Plan, stored: Plan, *, limit: int = 5) -> list[str]:
    """Differences of two plans, one line each: `"trackers: stay there, ko2012 asked for"`."""
    found = list(_differences("", _by_name(given), _by_name(stored)))
    return found[:limit] + ([f"and {len(found) - limit} more"] if len(found) > limit else [])


def _by_name(plan: Plan) -> dict[str, Any]:
    """The plan's record with names as keys, so that a difference is reported with the name and not the index."""
    record: dict[str, Any] = {**plan.model_dump(mode="json"), "trackers": list(plan.labels)}
    record["code"] = {name: digest[:12] for tracker in plan.trackers for name, digest in tracker.code.items()}
    for values, sweep in zip(record["sweeps"], plan.sweeps, strict=True):
        values["scenarios"] = {scenario.name: scenario.tree for scenario in sweep.scenarios}
        values["conditions"] = [condition.name for condition in sweep.conditions]
    return record | record.pop("sweeps")[0] if len(plan.sweeps) == 1 else record


def _differences(path: str, given: Any, stored: Any) -> Iterator[str]:
    if given == stored:
        return
    if isinstance(given, Mapping) and isinstance(stored, Mapping):
        mine, theirs = cast("Mapping[str, Any]", given), cast("Mapping[str, Any]", stored)
        if set(mine) & set(theirs):
            for key in dict.fromkeys([*mine, *theirs]):
                yield from _differences(f"{path}.{key}" if path else key, mine.get(key), theirs.get(key))
            return
    yield f"{path}: {_short(stored)} there, {_short(given)} asked for"


def _short(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, (Mapping, list)):
        value = ", ".join(str(item) for item in cast("list[object]", value))
    text = str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
