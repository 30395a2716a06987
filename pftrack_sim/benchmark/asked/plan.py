"""The plan of a run, as data: scenarios x conditions x seeds, and the trackers.

A plan is frozen, survives a round trip through JSON, and has a digest; it is stored with the run. `planning` makes one.
"""

from __future__ import annotations

import bisect
import hashlib
import itertools
import json
import random
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Literal, TypeAlias

from pydantic import Field, ValidationError, model_validator

from pftrack_sim.benchmark.asked.seeds import Seeds
from pftrack_sim.benchmark.asked.suite import Suite
from pftrack_sim.benchmark.kept.files import distinct_slugs
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.scenario import Scenario
from pftrack_sim.scenario import load as load_scenario
from pftrack_sim.scenario.ranges import is_range
from pftrack_sim.scenario.section import NotNegative, Section

MAX_EPISODES = 10**12

EpisodeKind: TypeAlias = Literal["open", "follow"]
"""`"open"`: the robot follows its script, and all trackers share the frames. `"follow"`: a tracker drives the robot in
closed loop, and each has its own episode."""

LATENCY = "latency"
"""Name of the axis of the run (not of scenarios) that charges every tracker the same milliseconds per frame."""

ScoredBox: TypeAlias = Literal["box", "amodal_box", "visible_box"]
"""True box that estimates are compared with, by its name in `Truth`."""


class TrackerSpec(Section):
    """Identity of a tracker in a run.

    Attributes:
        name: Its name, or `package.module:factory`.
        preset: Its preset.
        params: Its parameters.
        controller: Controller that drives the robot with its estimates; None in open loop.
        latency_ms: Simulated time charged for every frame that it takes, unless the condition sets another.
        code: Digests of the code of tracker and controller, and of files named in the parameters. A run folder is not
            continued with other code.
    """

    name: str
    preset: str = "default"
    params: dict[str, Any] = Field(default_factory=dict)
    controller: str | None = None
    latency_ms: NotNegative = 0.0
    code: dict[str, str] = Field(default_factory=dict)

    @property
    def digest(self) -> str:
        """SHA-256 of all of it, with the code that runs."""
        return hashlib.sha256(json.dumps(self.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()

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
    seeds: Seeds

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
        """SHA-256 of everything but the trackers that decides the content of its files."""
        identity = [self.scenario.name, self.scenario.digest, self.condition.model_dump(mode="json")]
        return hashlib.sha256(json.dumps([*identity, self.seed, self.truth]).encode()).hexdigest()

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

    format: Literal[3] = 3
    sweeps: tuple[Sweep, ...]
    trackers: tuple[TrackerSpec, ...]
    suites: tuple[Suite, ...] = ()
    truth: ScoredBox = "box"

    @model_validator(mode="after")
    def _check_unique(self) -> Plan:
        named: dict[str, list[tuple[str, tuple[object, ...]]]] = {
            "seed": [(str(sweep.seeds), (index,)) for index, sweep in enumerate(self.sweeps) if len(sweep.seeds)],
            "scenario": [
                (scenario.name, (scenario.name, condition.name, sweep.seeds[0]))
                for sweep in self.sweeps
                for scenario in sweep.scenarios
                for condition in sweep.conditions
                if len(sweep.seeds)
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
        """The same plan whatever code runs."""
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
        for setting, (sweep, _, _) in enumerate(self._settings):
            scenario = self._scenario(setting)
            camera = scenario.tree.get("camera", {})
            varies = is_range(scenario.tree.get("duration_s")) or is_range(camera.get("rate_hz"))
            varies = varies or scenario.resolve(sweep.seeds[0]).axes.stream.on
            counted = list(sweep.seeds) if varies and len(sweep.seeds) <= 100 else [sweep.seeds[0]]
            frames = sum(scenario.frame_count(seed) for seed in counted)
            total += frames * len(sweep.seeds) // len(counted)
        return total * len(self._tracker_groups())

    def episodes(self, *, part: tuple[int, int] = (1, 1), shuffle: int | None = None) -> Iterator[Episode]:
        """Every episode in the plan's order, made one at a time.

        Args:
            part: Part k of n: only every n-th episode, from the k-th (1 is the first).
            shuffle: A seed to shuffle the order with; takes memory for all their numbers.
        """
        numbers: Sequence[int] = range(self.episode_count)
        if shuffle is not None:
            numbers = random.Random(shuffle).sample(numbers, len(numbers))
        return (self.episode(number) for number in numbers[part[0] - 1 :: part[1]])

    def episode(self, number: int) -> Episode:
        """The episode at a place in the plan's order."""
        groups = self._tracker_groups()
        setting = bisect.bisect_right(self._starts, number) - 1
        place, group = divmod(number - self._starts[setting], len(groups))
        sweep, _, condition = self._settings[setting]
        seed = sweep.seeds[place]
        path = f"{self._folder(setting)}/{self._file_stem(seed, group)}"
        return Episode(self._scenario(setting), condition, seed, path, groups[group], place == 0, self.truth)

    def present(self, files_in: Callable[[str], Collection[str]]) -> Iterator[tuple[int, Episode]]:
        """Numbers and episodes that have a file, in the plan's order, at no cost for those that have none.

        Args:
            files_in: Names of the files in the folder of a scenario and condition, without their suffixes.
        """
        groups = range(len(self._tracker_groups()))
        for setting, (sweep, _, _) in enumerate(self._settings):
            names = files_in(self._folder(setting))
            seeds = {int(match[1]) for name in names if (match := re.match(r"seed-(\d{4,18})(?:__|$)", name))}
            places = sorted(place for seed in seeds if (place := sweep.seeds.place_of(seed)) is not None)
            for place in places:
                for group in groups:
                    if self._file_stem(sweep.seeds[place], group) in names:
                        number = self._starts[setting] + place * len(groups) + group
                        yield number, self.episode(number)

    @cached_property
    def _settings(self) -> tuple[tuple[Sweep, ScenarioSpec, Condition], ...]:
        """Sweep, scenario and condition of every folder of episodes."""
        return tuple(
            (sweep, scenario, condition)
            for sweep in self.sweeps
            for scenario in sweep.scenarios
            for condition in sweep.conditions
        )

    @cached_property
    def _scenario(self) -> Callable[[int], Scenario]:
        """Scenario of a setting; the last ones are kept, because all seeds share them."""

        @lru_cache(maxsize=64)
        def load(setting: int) -> Scenario:
            _, spec, condition = self._settings[setting]
            return load_scenario(Scenario(spec.name, spec.tree), condition.overrides)

        return load

    @cached_property
    def _starts(self) -> tuple[int, ...]:
        """Number of the first episode of each setting."""
        counts = (len(sweep.seeds) * len(self._tracker_groups()) for sweep, _, _ in self._settings)
        return tuple(itertools.accumulate(counts, initial=0))[:-1]

    def _folder(self, setting: int) -> str:
        """Folder of the episodes of a scenario and condition within `episodes/`."""
        scenarios, conditions, _ = self.slugs
        _, scenario, condition = self._settings[setting]
        return f"{scenarios[scenario.name]}/{conditions[condition.name]}"

    def _file_stem(self, seed: int, group: int) -> str:
        driver = f"__{self.slugs[2][self.labels[group]]}" if self.kind == "follow" else ""
        return f"seed-{seed:04d}{driver}"

    @cached_property
    def slugs(self) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
        """Parts of file names for scenarios, conditions and trackers."""
        return (
            distinct_slugs(scenario.name for sweep in self.sweeps for scenario in sweep.scenarios),
            distinct_slugs(condition.name for sweep in self.sweeps for condition in sweep.conditions),
            distinct_slugs(self.labels),
        )


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
