"""Make plans from names of scenarios and suites, trackers, seeds and axis levels."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast, get_args

from pftrack_sim import scenario as scenarios
from pftrack_sim.benchmark.asked.plan import (
    BOX_NOISE,
    LATENCY,
    RUN_AXES,
    START,
    Condition,
    Plan,
    ScenarioSpec,
    ScoredBox,
    Sweep,
    TrackerSpec,
    make_checked_plan,
    parameter_errors,
)
from pftrack_sim.benchmark.asked.suite import Block, Suite, is_suite, load_suite, suite_names
from pftrack_sim.controllers import code_digest as controller_code
from pftrack_sim.controllers import make as make_controller
from pftrack_sim.core.arguments import checked
from pftrack_sim.core.code_digest import file_digest
from pftrack_sim.core.errors import ParameterError, ScenarioError, UnknownNameError
from pftrack_sim.core.text import one_line
from pftrack_sim.scenario import Scenario, ScenarioLike
from pftrack_sim.scenario.axes import axes_by_name
from pftrack_sim.trackers import code_digest as tracker_code

TRACKERS = ("ko2012", "opencv-mil", "stay")
CLOSED_LOOP_TRACKERS = ("oracle",)
CONTROLLERS = ("servo-avoid",)
SEEDS = tuple(range(5))
"""Defaults of scenarios without a suite."""

MAX_BOX_NOISE = 0.5
MAX_CONDITIONS = 10_000
MAX_LATENCY_MS = 10_000.0
MAX_SEEDS = 1_000_000
_MAX_DIGITS = 18


@checked
def make_plan(
    names: Sequence[ScenarioLike],
    trackers: Sequence[str | TrackerSpec],
    seeds: Iterable[int],
    *,
    axes: Mapping[str, Sequence[float]] | None = None,
    overrides: Mapping[str, Any] | None = None,
    preset: str = "default",
    controllers: Sequence[str] = (),
    latency_ms: Mapping[str, float] | None = None,
    variant: str = "",
) -> Plan:
    """Make the plan of all combinations, and of each further target and camera that a scenario has.

    Overrides of `tracked` or `viewed` choose one target or camera.

    Args:
        names: Scenarios.
        trackers: Names for `trackers.make`, or specifications with presets and parameters.
        seeds: Root seeds.
        axes: For a stress axis its severities, for `axis.parameter` the parameter's values at severity 1, and for one
            of `RUN_AXES` its levels.
        overrides: Dotted keys set in every scenario.
        preset: Preset of every tracker given by its name alone.
        controllers: Controllers that drive the robot, each with every tracker; without one the loop is open.
        latency_ms: Simulated time charged for a frame, by the tracker's name or `base_label`; other trackers are not
            charged. An axis `latency` charges all of them instead.
        variant: Put before the conditions' names.

    Raises:
        UnknownNameError: An unknown scenario, axis, parameter of an axis, tracker or controller.
        ScenarioError: A wrong scenario, override or level.
        ParameterError: No scenario, tracker or seed, one given twice, or an impossible latency.
    """
    for axis, levels in (axes or {}).items():
        if axis in RUN_AXES:
            check_run_axis(axis, levels)
        else:
            _check_axis(axis)
    loaded = [scenarios.load(name, overrides or {}) for name in names]
    specs, chosen = tuple(TrackerSpec.of(one, preset) for one in trackers), tuple(seeds)
    with parameter_errors("plan"):
        sweeps = tuple(
            Sweep(scenarios=tuple(tracked), conditions=tuple(_conditions(axes or {}, name)), seeds=chosen)
            for name, tracked in _each(loaded, variant, overrides or {})
        )
    plan = make_checked_plan(sweeps, _with_controllers(specs, controllers, latency_ms or {}))
    for episode in plan.first_episodes:
        scenario = episode.scenario  # wrong levels are reported now
        axes_on = [axis.partition(".")[0] for axis, level in episode.condition.levels if level and axis not in RUN_AXES]
        settings = scenario.resolve(episode.seed) if axes_on else None
        problems = [scenarios.axis_without_effect(settings, name) for name in dict.fromkeys(axes_on) if settings]
        if any(problems):
            raise ScenarioError(f"{scenario.name} {episode.condition.name}", [line for line in problems if line])
    return plan


def _each(
    loaded: Sequence[Scenario], variant: str, overrides: Mapping[str, Any]
) -> Iterator[tuple[str, list[ScenarioSpec]]]:
    """The scenarios under the name of the variant, and for each further target or camera those that have it."""
    found: dict[str, list[ScenarioSpec]] = {variant: []}
    for one in loaded:
        found[variant].append(ScenarioSpec(name=one.name, tree=one.with_defaults().tree))
        settings = one.resolve(0)
        for key, names in (("tracked", settings.target_names), ("viewed", settings.camera_names)):
            for name in names if key not in overrides else ():
                if name != getattr(settings, key):
                    tree = scenarios.load(one, {key: name}).with_defaults().tree
                    found.setdefault(f"{variant} {name}".strip(), []).append(ScenarioSpec(name=one.name, tree=tree))
    yield from found.items()


def late_events(plan: Plan, changed: Collection[str] | None = None) -> list[str]:
    """A line for each scenario and what begins after its episode, with the times of the first one that it is cut from.

    Of some `changed` keys of scenarios only what these can have cut off.
    """
    lines: dict[tuple[str, ...], str] = {}
    for episode in plan.first_episodes:
        settings = episode.scenario.resolve(episode.seed)
        titles = scenarios.late_events(settings)
        late = [one for one in titles if changed is None or any(_can_cut(key, one) for key in changed)]
        if late:
            what = (episode.spec.name, *(one.rpartition(" at ")[0] for one in late))
            lasts = f"{episode.spec.name} lasts {settings.duration_s:g} s"
            lines.setdefault(what, f"{lasts}, so that these never happen: {', '.join(late)}")
    return list(lines.values())


def _can_cut(key: str, title: str) -> bool:
    """Whether a key of a scenario decides when an event begins, or when its episode ends."""
    table = ".".join(key.split(".")[: 1 if key.startswith("occluders") else 2])
    return key == "duration_s" or title.startswith(table)


def _with_controllers(
    trackers: Sequence[TrackerSpec], controllers: Sequence[str], latency_ms: Mapping[str, float]
) -> tuple[TrackerSpec, ...]:
    """Every tracker with its latency and every controller."""
    check_run_axis(LATENCY, latency_ms.values())
    latencies = {spec.base_label: latency_ms[key] for key, spec in match_trackers(latency_ms, trackers)}
    for name in controllers:
        make_controller(name)  # a wrong name is reported now
    combined = (
        spec.model_copy(update={"latency_ms": latencies.get(spec.base_label, spec.latency_ms), "controller": name})
        for name in controllers or [None]
        for spec in trackers
    )
    return tuple(spec.model_copy(update={"code": code_of(spec)}) for spec in combined)


def code_of(spec: TrackerSpec) -> dict[str, str]:
    """Digests of the code of tracker and controller and of files that a tracker takes, by name."""
    code = {spec.name: tracker_code(spec.name)}
    if spec.controller is not None:
        code[spec.controller] = controller_code(spec.controller)
    for value in spec.params.values():
        if isinstance(value, str) and Path(value).is_file():
            code[value] = file_digest(Path(value))
    return {name: digest for name, digest in code.items() if digest}


def match_trackers(keys: Mapping[str, object], trackers: Sequence[TrackerSpec]) -> list[tuple[str, TrackerSpec]]:
    """Pairs of a key and a tracker that it is given for; a key is a name or a `base_label`, which goes first.

    Raises:
        UnknownNameError: A key of no tracker.
    """
    for key in keys:
        if not any(key in (spec.name, spec.base_label) for spec in trackers):
            known = {name for spec in trackers for name in (spec.name, spec.base_label)}
            raise UnknownNameError("tracker that latency is given for", key, known)
    found = [(spec.base_label if spec.base_label in keys else spec.name, spec) for spec in trackers]
    return [(key, spec) for key, spec in found if key in keys]


def check_run_axis(axis: str, levels: Iterable[float]) -> None:
    """Raise ParameterError for a level that one of `RUN_AXES` cannot have."""
    for level in levels:
        if axis == LATENCY and not 0.0 <= level <= MAX_LATENCY_MS:
            raise ParameterError(f"a latency must be 0 to {MAX_LATENCY_MS:g} ms, got {level:g}")
        if axis == BOX_NOISE and not 0.0 <= level <= MAX_BOX_NOISE:
            raise ParameterError(f"box noise must be a share of the sides in [0, {MAX_BOX_NOISE}], got {level:g}")
        if axis == START and not -1.0 <= level < 1.0:
            raise ParameterError(f"a start must be a share of the episode in [-1, 1), got {level:g}")


@checked
def join_plans(plans: Sequence[Plan], *, suites: tuple[Suite, ...] = (), truth: ScoredBox = "box") -> Plan:
    """Join plans with the same trackers into one.

    Args:
        plans: Each with its own scenarios, conditions and seeds.
        suites: Suites that they were made from, besides their own.
        truth: True box that estimates are compared with.

    Raises:
        ParameterError: Their trackers differ, or an episode is in two of them.
    """
    if len({plan.labels for plan in plans}) != 1:
        raise ParameterError("plans can be joined only if they have the same trackers, in the same order")
    all_suites = tuple(suite for plan in plans for suite in plan.suites) + suites
    sweeps = tuple(sweep for plan in plans for sweep in plan.sweeps)
    return make_checked_plan(sweeps, plans[0].trackers, all_suites, truth)


@checked
def plan_all(
    names: Sequence[str],
    *,
    trackers: Sequence[str | TrackerSpec] | None = None,
    seeds: Iterable[int] | None = None,
    axes: Mapping[str, Sequence[float]] | None = None,
    overrides: Mapping[str, Any] | None = None,
    preset: str | None = None,
    truth: str = "box",
    controllers: Sequence[str] | None = None,
    latency_ms: Mapping[str, float] | None = None,
    closed_loop: bool = False,
) -> Plan:
    """Make the plan of suites and scenarios together.

    Args:
        names: Suites and scenarios, by name or path.
        trackers: None: a suite's own; for scenarios `TRACKERS`, in closed loop `CLOSED_LOOP_TRACKERS`.
        seeds: None: a suite's own; for scenarios `SEEDS`.
        axes: As in `make_plan`; they are added to those of a suite, and replace its levels of the same axis.
        overrides: As in `make_plan`; they are added to those of a suite.
        preset: Preset of every tracker given by its name alone; None: a suite's own; for scenarios `"default"`.
        truth: True box that estimates are compared with: `"box"`, `"amodal_box"` or `"visible_box"`.
        controllers: Controllers of all episodes.
        latency_ms: As in `make_plan`.
        closed_loop: Whether the trackers drive the robot where `controllers` is None: with a suite's own, and with
            `CONTROLLERS` in scenarios. Otherwise the robot follows its script, in suites too.

    Raises:
        UnknownNameError: An unknown suite, scenario, axis, parameter of an axis, box, or controller.
        ScenarioError: A wrong suite, scenario, override or level.
        ParameterError: Nothing to run, something given twice, or suites with different trackers.
    """
    if truth not in get_args(ScoredBox):
        raise UnknownNameError("box of the truth", truth, get_args(ScoredBox))
    suites = [load_suite(name) for name in names if is_suite(name)]
    suites = [suite.part(closed=closed_loop or controllers is not None) for suite in suites]
    fallback = CONTROLLERS if closed_loop else ()
    alone = tuple(name for name in names if not is_suite(name))
    unknown = [name for name in alone if name not in scenarios.names() and not name.endswith(".toml")]
    if unknown:
        raise UnknownNameError("suite or scenario", unknown[0], [*suite_names(), *scenarios.names()])
    if alone or not suites:
        usual = CLOSED_LOOP_TRACKERS if controllers or fallback else TRACKERS
        block = Block.model_construct(scenarios=alone)
        suites.append(Suite.model_construct(name="", seeds=seeds_text(SEEDS), trackers=usual, run=(block,)))
    plans = [
        make_plan(
            block.scenarios,
            trackers if trackers is not None else _with_presets(suite, preset),
            seeds if seeds is not None else parse_seeds(suite.seeds),
            axes={**block.axes, **(axes or {})},
            overrides={**block.changes, **(overrides or {})},
            preset=preset or "default",
            controllers=controllers or suite.controllers or fallback,
            latency_ms=latency_ms,
            variant=block.variant,
        )
        for suite in suites
        for block in suite.run
    ]
    _check_frozen(suites, {name: one.tree["version"] for plan in plans for name, one in plan.scenarios.items()})
    named = tuple(suite for suite in suites if suite.name)
    return join_plans(plans, suites=named, truth=cast("ScoredBox", truth))


def _check_frozen(suites: Iterable[Suite], versions: Mapping[str, int]) -> None:
    """Raise ScenarioError where scenarios of a frozen suite have other versions than it is frozen with."""
    for suite in suites:
        other = [
            f"{name} has version {versions[name]} here, and it is frozen with {frozen}: it is another suite"
            for name, frozen in suite.versions.items()
            if versions.get(name, frozen) != frozen
        ]
        if other:
            raise ScenarioError(suite.name, other)


def _with_presets(suite: Suite, preset: str | None) -> list[TrackerSpec]:
    """A suite's trackers, each with every preset of the suite, or with the given one alone."""
    presets = suite.presets if preset is None else (preset,)
    return [TrackerSpec(name=name, preset=one) for name in suite.trackers for one in presets]


@checked
def parse_seeds(text: str) -> list[int]:
    """Parse seeds of the command line: `3`, `0:20` (20 excluded), `1,5,9`, and mixtures.

    Raises:
        ParameterError: Another form, too many, or one given twice.

    >>> parse_seeds("0:3,7")
    [0, 1, 2, 7]
    """
    seeds: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d+)\s*(?::\s*(\d+)\s*)?", part)
        if match and max(len(number) for number in match.groups() if number) > _MAX_DIGITS:
            raise ParameterError(f"a seed has at most {_MAX_DIGITS} digits")
        span = range(int(match[1]), int(match[2] or int(match[1]) + 1)) if match else range(0)
        if match and not span:
            raise ParameterError(f"seeds {part.strip()} are none: the second number is excluded")
        if not match:
            raise ParameterError(f"seeds are written 3, 0:20 (20 excluded) or 1,5,9; got {one_line(text, 60)!r}")
        if len(seeds) + len(span) > MAX_SEEDS:
            raise ParameterError(f"at most {MAX_SEEDS} seeds are run, got {len(seeds) + len(span)}")
        seeds += span
    if len(set(seeds)) < len(seeds):
        raise ParameterError(f"seed given twice: {Counter(seeds).most_common(1)[0][0]}")
    return seeds


def seeds_text(seeds: Iterable[int]) -> str:
    """Seeds as the command line takes them.

    >>> seeds_text([7, 0, 1, 2])
    '0:3,7'
    """
    spans: list[list[int]] = []
    for seed in sorted(seeds):
        if spans and spans[-1][1] == seed:
            spans[-1][1] += 1
        else:
            spans.append([seed, seed + 1])
    return ",".join(f"{start}:{stop}" if stop > start + 1 else str(start) for start, stop in spans)


def _check_axis(axis: str) -> None:
    name, dot, parameter = axis.partition(".")
    known = axes_by_name()
    if name not in known:
        raise UnknownNameError("axis", name, [*known, *RUN_AXES])
    if dot and parameter not in known[name].model_fields:
        raise UnknownNameError(f"parameter of the axis {name}", parameter, known[name].model_fields)


def _conditions(axes: Mapping[str, Sequence[float]], variant: str) -> Iterator[Condition]:
    count = math.prod(len(levels) for levels in axes.values())
    if count > MAX_CONDITIONS:
        raise ParameterError(f"the levels of the axes make {count} conditions: at most {MAX_CONDITIONS} are run")
    for axis, levels in axes.items():
        if not all(map(math.isfinite, levels)):
            raise ParameterError(f"levels of the axis {axis} must be finite numbers, got {', '.join(map(str, levels))}")
    for levels in itertools.product(*axes.values()):
        yield Condition(levels=tuple(zip(axes, (float(level) for level in levels), strict=True)), variant=variant)
