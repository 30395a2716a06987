"""Loading of scenarios from a name, a file or a dict; all errors are reported at once."""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from pydantic import ValidationError

from pftrack_sim.core.arguments import checked
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.core.inputs import MAX_DEPTH, MAX_TEXT, check_tree
from pftrack_sim.core.text import one_line
from pftrack_sim.scenario import ranges
from pftrack_sim.scenario.files import complete, read_scenario, with_files
from pftrack_sim.scenario.frame_delivery import frame_count
from pftrack_sim.scenario.model import AnyPlace, LightChange, ResolvedScenario
from pftrack_sim.scenario.ranges import KeyPath, Tree, dotted
from pftrack_sim.scenario.robot import Route
from pftrack_sim.scenario.validation import problems

_MAX_OVERRIDES = 1000
_MAX_ALTERNATIVES = 2000  # Ends and alternatives of all ranges
_MAX_PROBLEMS = 40  # That are listed


@dataclass(frozen=True, eq=False)
class Scenario:
    """A validated scenario with its ranges; created by `load`.

    Attributes:
        name: The name in `envs/`, the path, or `"custom"` for a dict.
        tree: Contents of the file with overrides applied; read-only.
    """

    name: str
    tree: Tree

    def resolve(self, seed: int) -> ResolvedScenario:
        """Scenario of one episode, every range drawn from the seed.

        Raises:
            ScenarioError: The values drawn contradict each other.
            ParameterError: The seed is negative.
        """
        drawn = {path: ranges.draw(value, seed, path) for path, value in ranges.walk(self.tree)}
        tree = ranges.replaced(self.tree, drawn)
        try:
            return ResolvedScenario.model_validate(tree)
        except ValidationError as error:
            raise ScenarioError(f"{self.name} at seed {seed}", list(problems(error, tree))) from None

    def with_defaults(self) -> Scenario:
        """The same scenario with the default of everything that its file leaves out; its ranges stay."""
        spans = dict(ranges.walk(self.tree))
        drawn = {path: next(iter(value.values()))[0] for path, value in spans.items()}
        whole = ResolvedScenario.model_validate(ranges.replaced(self.tree, drawn)).model_dump(mode="json")
        return Scenario(self.name, ranges.replaced(whole, spans))

    def frame_count(self, seed: int) -> int:
        """Number of frames delivered in the episode of a seed."""
        return frame_count(self.resolve(seed), seed)


ScenarioLike: TypeAlias = str | Path | Mapping[str, Any] | Scenario


@checked
def load(scenario: ScenarioLike, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Load and validate a scenario.

    Args:
        scenario: A name in `envs/`, a path to a TOML file, a dict of the same shape, or a Scenario.
        overrides: Dotted keys and their values, `{"camera.width_px": 320}`; list items by index
            (`"occluders.0.at_s"`).

    Raises:
        UnknownNameError: No such scenario.
        ScenarioError: The file cannot be read, or keys or values are wrong: all of them at once.
        ParameterError: An argument of another type.
    """
    if isinstance(scenario, Scenario):
        loaded = scenario
    elif isinstance(scenario, Mapping):
        _check_tree("custom", scenario)
        loaded = Scenario("custom", complete("custom", ranges.replaced(scenario, {})))
    else:
        loaded = Scenario(*read_scenario(scenario))
    tree = loaded.tree
    errors: list[str] = []
    if len(overrides or {}) > _MAX_OVERRIDES:
        raise ScenarioError(loaded.name, [f"at most {_MAX_OVERRIDES} overrides, got {len(overrides or {})}"])
    for key, value in (overrides or {}).items():
        _check_tree(loaded.name, {key: value})
        tree, error = _set(tree, key, value)
        errors += [error] if error else []
    if overrides:
        _check_tree(loaded.name, tree)
        tree = with_files(loaded.name, tree, Path())
    # An override that shortens an episode cuts its actions off, now or when this Scenario was loaded.
    whole = not isinstance(scenario, Scenario) and "duration_s" not in (overrides or {})
    errors += _problems(tree, whole=whole)
    if errors:
        more = [f"and {len(errors) - _MAX_PROBLEMS} more"] if len(errors) > _MAX_PROBLEMS else []
        raise ScenarioError(loaded.name, [*errors[:_MAX_PROBLEMS], *more])
    return Scenario(loaded.name, tree)


def _check_tree(name: str, tree: object) -> None:
    try:
        check_tree(tree)
    except ValueError as error:
        raise ScenarioError(name, [str(error)]) from None


def _set(tree: Tree, key: str, value: object) -> tuple[Tree, str | None]:
    """Copy of the tree with one dotted key set, or the same tree and an error message."""
    copied: Tree = ranges.replaced(tree, {})
    parts = key.split(".")
    if len(parts) > MAX_DEPTH or len(key) > MAX_TEXT:
        return tree, f"{one_line(key, 60)}: a key of more than {MAX_DEPTH} levels or {MAX_TEXT} characters"
    node: Any = copied
    for position, part in enumerate(parts):
        last = position == len(parts) - 1
        if ranges.is_list(node):
            if not part.isdigit() or int(part) >= len(node):
                return tree, f"{key}: no item {part!r} in a list of {len(node)}"
            if last:
                node[int(part)] = value
            else:
                node = node[int(part)]
        elif ranges.is_mapping(node) and not ranges.is_range(node):
            if last:
                node[part] = ranges.replaced(value, {})
                for other in _foreign_keys(node) if part == "kind" else ():
                    del node[other]
            else:
                node = node.setdefault(part, {})
        else:
            return tree, f"{key}: {'.'.join(parts[:position])} is a value, not a table"
    return copied, None


def _foreign_keys(table: Tree) -> list[str]:
    """Keys that a route, light change or place of this kind does not have: those of the kind that it had before."""
    for variant in (
        one for union in (Route, LightChange, AnyPlace) for one in typing.get_args(typing.get_args(union)[0])
    ):
        fields = variant.model_fields
        if table["kind"] in typing.get_args(fields["kind"].annotation):
            return [key for key in table if key not in fields]
    return []


def _problems(tree: Tree, *, whole: bool) -> list[str]:
    found: list[str] = []
    spans: list[tuple[KeyPath, list[object]]] = []
    for path, value in ranges.walk(tree):
        wrong = ranges.problem(value)
        if wrong:
            found.append(f"{dotted(path)}: {wrong}")
        else:
            (kind, values), *_ = value.items()
            low, high = values[0], values[-1]
            # A uniform range draws no whole numbers: a key for these must refuse it, whatever its ends.
            spans.append((path, [*values, *([low + 0.5**0.5 * (high - low)] if kind == "uniform" else [])]))
    if found:
        return found
    count = sum(len(values) for _, values in spans)
    if count > _MAX_ALTERNATIVES:
        return [f"the ranges have {count} ends and alternatives together: at most {_MAX_ALTERNATIVES} are checked"]
    base = {path: values[0] for path, values in spans}
    # Every end of every range, and what lies between, must be valid, so that validity does not depend on the seed.
    trials = [base] + [{**base, path: value} for path, values in spans for value in values[1:]]
    for trial in trials:
        if len(found) > _MAX_PROBLEMS:
            break
        candidate = ranges.replaced(tree, trial)
        try:
            settings = ResolvedScenario.model_validate(candidate)
            said = {line.partition(" (")[0] for line in found}
            found += [line for line in settings.late_actions() if whole and line.partition(" (")[0] not in said]
        except ValidationError as error:
            found += [line for line in problems(error, candidate) if line not in found]
    return found
