"""Loading of scenarios from a name, a file or a dict; all errors are reported at once."""

from __future__ import annotations

import hashlib
import json
import tomllib
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, cast

from pydantic import ValidationError

from pftrack_sim.core.data_files import envs_dir
from pftrack_sim.core.errors import ScenarioError, UnknownNameError
from pftrack_sim.scenario import ranges
from pftrack_sim.scenario.frame_delivery import frame_count
from pftrack_sim.scenario.model import LightChange, ResolvedScenario, Route
from pftrack_sim.scenario.ranges import KeyPath, Tree, dotted
from pftrack_sim.scenario.validation import problems


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

    def frame_count(self, seed: int) -> int:
        """Number of frames delivered in the episode of a seed."""
        return frame_count(self.resolve(seed), seed)

    @property
    def digest(self) -> str:
        """SHA-256 of the contents, independent of the order of keys."""
        return hashlib.sha256(json.dumps(self.tree, sort_keys=True).encode()).hexdigest()


ScenarioLike: TypeAlias = str | Path | Mapping[str, Any] | Scenario


def names() -> list[str]:
    """Names of the shipped scenarios, sorted: their paths in `envs/` without `.toml`."""
    root = envs_dir()
    found = (path.relative_to(root).with_suffix("").as_posix() for path in root.rglob("*.toml"))
    return sorted(name for name in found if not name.startswith("suites/"))


def load(scenario: ScenarioLike, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Load and validate a scenario.

    Args:
        scenario: A name in `envs/`, a path to a TOML file, a dict of the same shape, or a Scenario.
        overrides: Dotted keys and their values, `{"camera.width_px": 320}`; list items by index
            (`"occluders.0.at_s"`).

    Raises:
        UnknownNameError: No such scenario.
        ScenarioError: The file cannot be read, or keys or values are wrong: all of them at once.
    """
    if isinstance(scenario, Scenario):
        loaded = scenario
    elif isinstance(scenario, Mapping):
        loaded = Scenario("custom", ranges.replaced(scenario, {}))
    else:
        loaded = _read(scenario)
    tree = loaded.tree
    errors: list[str] = []
    for key, value in (overrides or {}).items():
        tree, error = _set(tree, key, value)
        errors += [error] if error else []
    # An override that shortens an episode cuts its actions off.
    errors += _problems(tree, whole="duration_s" not in (overrides or {}))
    if errors:
        raise ScenarioError(loaded.name, errors)
    return Scenario(loaded.name, tree)


def _read(scenario: str | Path) -> Scenario:
    shipped = envs_dir() / f"{scenario}.toml"
    if isinstance(scenario, str) and scenario in names():
        path, name = shipped, scenario
    else:
        path, name = Path(scenario), str(scenario)
        if not path.is_file():
            if path.suffix == ".toml" or path.is_dir():
                raise ScenarioError(name, ["no such file" if not path.is_dir() else "is a folder, not a TOML file"])
            raise UnknownNameError("scenario", name, names())
    try:
        return Scenario(name, tomllib.loads(path.read_text(encoding="utf-8")))
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(name, [f"not valid TOML: {error}"]) from None
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(name, [f"cannot be read: {error}"]) from None


def _set(tree: Tree, key: str, value: object) -> tuple[Tree, str | None]:
    """Copy of the tree with one dotted key set, or the same tree and an error message."""
    copied = cast("Tree", ranges.replaced(tree, {}))
    parts = key.split(".")
    node: Any = copied
    for position, part in enumerate(parts):
        last = position == len(parts) - 1
        if isinstance(node, list):
            items = cast("list[Any]", node)
            if not part.isdigit() or int(part) >= len(items):
                return tree, f"{key}: no item {part!r} in a list of {len(items)}"
            if last:
                items[int(part)] = value
            else:
                node = items[int(part)]
        elif isinstance(node, dict) and not ranges.is_range(cast("object", node)):
            table = cast("Tree", node)
            if last:
                table[part] = ranges.replaced(value, {})
                for other in _foreign_keys(table) if part == "kind" else ():
                    del table[other]
            else:
                node = table.setdefault(part, {})
        else:
            return tree, f"{key}: {'.'.join(parts[:position])} is a value, not a table"
    return copied, None


def _foreign_keys(table: Tree) -> list[str]:
    """Keys that a route or a light change of this kind does not have: those of the kind that it had before."""
    for variant in (*typing.get_args(typing.get_args(Route)[0]), *typing.get_args(typing.get_args(LightChange)[0])):
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
            spans.append((path, list(next(iter(value.values())))))
    if found:
        return found
    base = {path: values[0] for path, values in spans}
    # Every end of every range must be valid on its own, so that validity does not depend on the seed.
    trials = [base] + [{**base, path: value} for path, values in spans for value in values[1:]]
    for trial in trials:
        candidate = ranges.replaced(tree, trial)
        try:
            settings = ResolvedScenario.model_validate(candidate)
            found += [line for line in settings.late_actions() if whole and line not in found]
        except ValidationError as error:
            found += [line for line in problems(error, candidate) if line not in found]
    return found
