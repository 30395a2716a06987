"""What a benchmark runs, as data: scenarios x conditions x seeds, and the trackers they are shown to.

A plan is frozen, goes through JSON unchanged, and has a digest; it is saved with the run. `planning` makes one.
"""

from __future__ import annotations

import hashlib
import json
import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, ValidationError, model_validator

from pftrack_sim.benchmark.naming import distinct_slugs
from pftrack_sim.benchmark.suite import Suite
from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.scenario import Scenario
from pftrack_sim.scenario import load as load_scenario
from pftrack_sim.scenario.ranges import is_range
from pftrack_sim.scenario.section import NotNegative, Section

Kind: TypeAlias = Literal["open", "follow"]
"""Kinds of episodes. `"open"`: the robot follows its script, so that one drawing serves every tracker. `"follow"`: the
tracker drives the robot, and so each sees an episode of its own."""

LATENCY = "latency"
"""The stress axis that lies in the run and not in the scenario: milliseconds charged for a frame, whoever tracks."""

ScoredBox: TypeAlias = Literal["box", "amodal_box", "visible_box"]
"""Box of the truth that estimates are compared with, by its name in `Truth`."""

Seed: TypeAlias = Annotated[int, Field(ge=0)]


class TrackerSpec(Section):
    """A tracker as `trackers.make` takes it.

    Attributes:
        name: Its name, or `package.module:factory`.
        preset: Its preset.
        params: Its parameters.
        controller: What drives the robot with its answers; None where the robot follows its script.
        latency_ms: Simulated time charged for every frame that it takes, unless the condition says another.
    """

    name: str
    preset: str = "default"
    params: dict[str, Any] = Field(default_factory=dict)
    controller: str | None = None
    latency_ms: NotNegative = 0.0

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
    """One combination of axis levels; without levels it is the scenario as it is.

    Attributes:
        levels: Pairs of an axis and its severity, of `axis.parameter` and its value at severity 1, or of `latency` and
            milliseconds.
        word: What else is different, where the levels alone do not say it: `"stranger"`.
    """

    levels: tuple[tuple[str, float], ...] = ()
    word: str = ""

    @property
    def name(self) -> str:
        """`"jitter=2"`, `"jitter.ground_rms_deg=0.5,light=1"`, `"stranger occlusion=1"`, or `"base"`."""
        levels = ",".join(f"{axis}={level:g}" for axis, level in self.levels) or "base"
        return f"{self.word} {levels}" if self.word else levels

    @property
    def latency_ms(self) -> float | None:
        """Charged for a frame, or None where every tracker has its own."""
        return dict(self.levels).get(LATENCY)

    @property
    def overrides(self) -> dict[str, float]:
        """The dotted keys that the levels set in a scenario."""
        set_by_hand = {axis for axis, _ in self.levels if "." not in axis}
        keys: dict[str, float] = {}
        for axis, level in self.levels:
            name, _, parameter = axis.partition(".")
            if name == LATENCY:
                continue
            if not parameter:
                keys[f"axes.{name}.severity"] = level
                continue
            keys[f"axes.{name}.{parameter}"] = level
            if name not in set_by_hand:
                keys[f"axes.{name}.severity"] = 1.0
        return keys


class Stage(Section):
    """A scenario in a plan: its name, and all that its file says with the plan's changes."""

    name: str
    tree: dict[str, Any]


class Batch(Section):
    """Scenarios x conditions x seeds."""

    scenarios: tuple[Stage, ...]
    conditions: tuple[Condition, ...] = (Condition(),)
    seeds: tuple[Seed, ...]


@dataclass(frozen=True)
class Episode:
    """One episode of a plan.

    Attributes:
        scenario: With the changes of the plan and the condition.
        condition: Axis levels.
        seed: Root seed.
        path: Where its files lie within `episodes/` and `videos/`, without their suffix.
        trackers: Who is shown it; where the tracker drives, that one alone.
        leads: Whether it has the first seed of its scenario and condition.
        kind: How it is run.
        truth: What estimates are compared with.
    """

    scenario: Scenario
    condition: Condition
    seed: int
    path: str
    trackers: tuple[TrackerSpec, ...]
    leads: bool = False
    truth: ScoredBox = "box"

    @property
    def kind(self) -> Kind:
        """How it is run."""
        return _kind(self.trackers)

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of its trackers in tables."""
        return tuple(one.label for one in self.trackers)

    @property
    def latency_ms(self) -> float:
        """Latency of its tracker in closed loop."""
        by_condition = self.condition.latency_ms
        return self.trackers[0].latency_ms if by_condition is None else by_condition

    @property
    def name(self) -> str:
        """For people: `"plaza-walk jitter=2 seed 3"`."""
        condition = [self.condition.name] if self.condition != Condition() else []
        driver = self.labels if self.kind == "follow" else ()
        return " ".join([self.scenario.name, *condition, f"seed {self.seed}", *driver])


def _kind(trackers: tuple[TrackerSpec, ...]) -> Kind:
    return "open" if trackers[0].controller is None else "follow"


class Plan(Section):
    """Everything a run will do.

    Attributes:
        batches: What is drawn.
        trackers: Who is shown it, in the order of the tables.
        suites: The suites it was made from, with their tables and claims.
        truth: What estimates are compared with.
    """

    format: Literal[1] = 1
    batches: tuple[Batch, ...]
    trackers: tuple[TrackerSpec, ...]
    suites: tuple[Suite, ...] = ()
    truth: ScoredBox = "box"

    @model_validator(mode="after")
    def _everything_once(self) -> Plan:
        for what, given in {
            "seed": [(index, seed) for index, batch in enumerate(self.batches) for seed in batch.seeds],
            "scenario": [
                (stage.name, condition.name, seed)
                for batch in self.batches
                for stage in batch.scenarios
                for condition in batch.conditions
                for seed in batch.seeds[:1]
            ],
            "tracker": [(tracker.label,) for tracker in self.trackers],
        }.items():
            if not given:
                raise ValueError(f"a plan needs at least one {what}")
            seen: set[tuple[object, ...]] = set()
            twice = [one for one in given if one in seen or seen.add(one)]
            if twice:
                named = dict.fromkeys(str(one[-1] if what == "seed" else one[0]) for one in twice)
                raise ValueError(f"{what} given twice: {', '.join(named)}")
        if len({one.controller is None for one in self.trackers}) > 1:
            raise ValueError("either every tracker needs a controller, or none may have one")
        late = any(one.latency_ms for one in self.trackers)
        late = late or any(one.latency_ms is not None for batch in self.batches for one in batch.conditions)
        if late and self.kind == "open":
            raise ValueError("latency is charged only where the tracker drives the robot: see follow")
        return self

    @property
    def kind(self) -> Kind:
        """How its episodes are run."""
        return _kind(self.trackers)

    @property
    def digest(self) -> str:
        """SHA-256 of the plan's canonical JSON."""
        return hashlib.sha256(json.dumps(self.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the trackers in tables."""
        return tuple(tracker.label for tracker in self.trackers)

    @property
    def episode_count(self) -> int:
        """Number of episodes."""
        shown = len(self._shown())
        return shown * sum(len(one.scenarios) * len(one.conditions) * len(one.seeds) for one in self.batches)

    def _shown(self) -> list[tuple[TrackerSpec, ...]]:
        """Who shares an episode."""
        return [self.trackers] if self.kind == "open" else [(one,) for one in self.trackers]

    @cached_property
    def frame_count(self) -> int:
        """Frames that will be drawn. Where many seeds have different lengths, as many as the first has."""
        total = 0
        for batch, scenario, _ in self._settings():
            camera = scenario.tree.get("camera", {})
            varies = is_range(scenario.tree.get("duration_s")) or is_range(camera.get("rate_hz"))
            varies = varies or scenario.resolve(batch.seeds[0]).axes.stream.on
            counted = batch.seeds if varies and len(batch.seeds) <= 100 else batch.seeds[:1]
            frames = sum(scenario.frame_count(seed) for seed in counted)
            total += frames * len(batch.seeds) // len(counted)
        return total * len(self._shown())

    def episodes(self, *, shuffle: int | None = None) -> Iterator[Episode]:
        """Every episode, in the plan's order, made as it is asked for.

        Args:
            shuffle: A seed to shuffle the order with.
        """
        if shuffle is not None:
            mixed = list(self.episodes())
            random.Random(shuffle).shuffle(mixed)
            yield from mixed
            return
        scenario_slugs = distinct_slugs(stage.name for batch in self.batches for stage in batch.scenarios)
        condition_slugs = distinct_slugs(one.name for batch in self.batches for one in batch.conditions)
        driver_slugs = distinct_slugs(self.labels)
        for batch, scenario, condition in self._settings():
            folder = f"{scenario_slugs[scenario.name]}/{condition_slugs[condition.name]}"
            for seed in batch.seeds:
                for trackers in self._shown():
                    driver = f"__{driver_slugs[trackers[0].label]}" if self.kind == "follow" else ""
                    path = f"{folder}/seed-{seed:04d}{driver}"
                    yield Episode(scenario, condition, seed, path, trackers, seed == batch.seeds[0], self.truth)

    def _settings(self) -> Iterator[tuple[Batch, Scenario, Condition]]:
        for batch in self.batches:
            for stage in batch.scenarios:
                for condition in batch.conditions:
                    yield batch, load_scenario(Scenario(stage.name, stage.tree), condition.overrides), condition


def read_plan(record: object, source: str) -> Plan:
    """The plan that a JSON record says.

    Args:
        record: What `json.loads` made of it.
        source: Where it comes from, for the message.

    Raises:
        RunError: It is no plan.
    """
    try:
        return Plan.model_validate(record)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise RunError(f"{source}: not a plan this version can read: {where or 'plan'}: {first['msg']}") from None


def differences(mine: Plan, theirs: Plan, *, limit: int = 5) -> list[str]:
    """What differs between two plans, one line each: `"trackers: stay here, ko2012 there"`."""
    here, there = mine.model_dump(mode="json"), theirs.model_dump(mode="json")
    for record, plan in ((here, mine), (there, theirs)):
        # By name, so that a line speaks of the scenario and not of its number.
        record["trackers"] = list(plan.labels)
        for batch in record["batches"]:
            batch["scenarios"] = {stage["name"]: stage["tree"] for stage in batch["scenarios"]}
            batch["conditions"] = [Condition.model_validate(one).name for one in batch["conditions"]]
        if len(record["batches"]) == 1:
            record |= record.pop("batches")[0]
    found = list(_differences("", here, there))
    return found[:limit] + ([f"and {len(found) - limit} more"] if len(found) > limit else [])


def _differences(path: str, here: Any, there: Any) -> Iterator[str]:
    if here == there:
        return
    if isinstance(here, Mapping) and isinstance(there, Mapping) and set(here) & set(there):
        for key in dict.fromkeys([*here, *there]):
            yield from _differences(f"{path}.{key}" if path else str(key), here.get(key), there.get(key))
        return
    yield f"{path}: {_short(there)} there, {_short(here)} asked for"


def _short(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, Mapping):
        value = list(value)
    text = ", ".join(str(one) for one in value) if isinstance(value, list) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def checked_plan(
    batches: tuple[Batch, ...],
    trackers: tuple[TrackerSpec, ...],
    suites: tuple[Suite, ...] = (),
    truth: ScoredBox = "box",
) -> Plan:
    """A plan, or one clear message.

    Raises:
        ParameterError: Nothing to run, or something given twice.
    """
    try:
        return Plan(batches=batches, trackers=trackers, suites=suites, truth=truth)
    except ValidationError as error:
        raise ParameterError(str(error.errors()[0]["msg"]).removeprefix("Value error, ")) from None
