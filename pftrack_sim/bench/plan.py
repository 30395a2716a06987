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

from pftrack_sim.bench.naming import distinct_slugs
from pftrack_sim.bench.suite import Suite
from pftrack_sim.errors import ParameterError, RunError
from pftrack_sim.scenario import Scenario
from pftrack_sim.scenario import load as load_scenario
from pftrack_sim.scenario.ranges import is_range
from pftrack_sim.scenario.section import Section

Kind: TypeAlias = Literal["open"]
"""Kinds of episodes. `"open"`: the robot follows its script, so that one drawing serves every tracker."""

ScoredBox: TypeAlias = Literal["box", "amodal_box", "visible_box"]
"""Box of the truth that estimates are compared with, by its name in `Truth`."""

Seed: TypeAlias = Annotated[int, Field(ge=0)]


class Contestant(Section):
    """A tracker as `trackers.make` takes it.

    Attributes:
        name: Its name, or `package.module:factory`.
        preset: Its preset.
        params: Its parameters.
    """

    name: str
    preset: str = "default"
    params: dict[str, Any] = Field(default_factory=dict)

    @property
    def label(self) -> str:
        """How tables call it: `"ko2012"`, `"ko2012[particle_count=300]"`."""
        said = {**({"preset": self.preset} if self.preset != "default" else {}), **self.params}
        inner = ",".join(
            f"{key}={json.dumps(value) if isinstance(value, bool) else value}" for key, value in said.items()
        )
        return f"{self.name}[{inner}]" if inner else self.name


class Condition(Section):
    """One combination of axis levels; without levels it is the scenario as it is.

    Attributes:
        levels: Pairs of an axis and its severity, or of `axis.parameter` and its value at severity 1.
    """

    levels: tuple[tuple[str, float], ...] = ()

    @property
    def name(self) -> str:
        """`"jitter=2"`, `"jitter.ground_rms_deg=0.5,light=1"`, or `"base"`."""
        return ",".join(f"{axis}={level:g}" for axis, level in self.levels) or "base"

    @property
    def overrides(self) -> dict[str, float]:
        """The dotted keys that the levels set."""
        set_by_hand = {axis for axis, _ in self.levels if "." not in axis}
        keys: dict[str, float] = {}
        for axis, level in self.levels:
            name, _, parameter = axis.partition(".")
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

    kind: Kind = "open"
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
        leads: Whether it has the first seed of its scenario and condition.
        kind: How it is run.
        truth: What estimates are compared with.
    """

    scenario: Scenario
    condition: Condition
    seed: int
    path: str
    leads: bool = False
    kind: Kind = "open"
    truth: ScoredBox = "box"

    @property
    def name(self) -> str:
        """For people: `"plaza-walk jitter=2 seed 3"`."""
        return " ".join(
            [self.scenario.name, *([self.condition.name] if self.condition.levels else []), f"seed {self.seed}"]
        )


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
    trackers: tuple[Contestant, ...]
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
        return self

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
        return sum(len(one.scenarios) * len(one.conditions) * len(one.seeds) for one in self.batches)

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
        return total

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
        for batch, scenario, condition in self._settings():
            folder = f"{scenario_slugs[scenario.name]}/{condition_slugs[condition.name]}"
            for seed in batch.seeds:
                path = f"{folder}/seed-{seed:04d}"
                yield Episode(scenario, condition, seed, path, seed == batch.seeds[0], batch.kind, self.truth)

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
            batch["conditions"] = [Condition(levels=one["levels"]).name for one in batch["conditions"]]
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
    trackers: tuple[Contestant, ...],
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
