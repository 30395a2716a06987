"""Loading of scenarios from a name, a file or a dict; all errors are reported at once."""

from __future__ import annotations

import os
import tomllib
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from pydantic import ValidationError

from pftrack_sim.core.arguments import checked
from pftrack_sim.core.calibration import read_calibration
from pftrack_sim.core.data_files import envs_dir
from pftrack_sim.core.errors import ParameterError, ScenarioError, UnknownNameError
from pftrack_sim.core.inputs import MAX_DEPTH, MAX_TEXT, check_tree, is_file, parse_toml, read_bytes
from pftrack_sim.core.named_files import named_digest
from pftrack_sim.core.text import one_line
from pftrack_sim.scenario import ranges
from pftrack_sim.scenario.extends import extended
from pftrack_sim.scenario.frame_delivery import frame_count
from pftrack_sim.scenario.model import AnyPlace, LightChange, ResolvedScenario
from pftrack_sim.scenario.ranges import KeyPath, Tree, dotted
from pftrack_sim.scenario.robot import Route
from pftrack_sim.scenario.validation import problems

MAX_FILE_BYTES = 256 * 1024
MAX_OVERRIDES = 1000
MAX_ALTERNATIVES = 2000
MAX_PROBLEMS = 40
"""Bounds of a scenario's file, its overrides, the ends and alternatives of its ranges, and the problems listed."""


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


def names() -> list[str]:
    """Names of the shipped scenarios, sorted: their paths in `envs/` without `.toml`."""
    root = envs_dir()
    found = (path.relative_to(root).with_suffix("").as_posix() for path in root.rglob("*.toml"))
    return sorted(name for name in found if not name.startswith("suites/"))


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
        tree = _with_files("custom", ranges.replaced(scenario, {}), Path())
        loaded = Scenario("custom", extended("custom", tree, _base, None))
    else:
        loaded = _read(scenario)
    tree = loaded.tree
    errors: list[str] = []
    if len(overrides or {}) > MAX_OVERRIDES:
        raise ScenarioError(loaded.name, [f"at most {MAX_OVERRIDES} overrides, got {len(overrides or {})}"])
    for key, value in (overrides or {}).items():
        _check_tree(loaded.name, {key: value})
        tree, error = _set(tree, key, value)
        errors += [error] if error else []
    if overrides:
        _check_tree(loaded.name, tree)
        tree = _with_files(loaded.name, tree, Path())
    # An override that shortens an episode cuts its actions off, now or when this Scenario was loaded.
    whole = not isinstance(scenario, Scenario) and "duration_s" not in (overrides or {})
    errors += _problems(tree, whole=whole)
    if errors:
        more = [f"and {len(errors) - MAX_PROBLEMS} more"] if len(errors) > MAX_PROBLEMS else []
        raise ScenarioError(loaded.name, [*errors[:MAX_PROBLEMS], *more])
    return Scenario(loaded.name, tree)


def _read(scenario: str | Path) -> Scenario:
    path, name = _located(scenario, Path(scenario))
    tree = _with_files(name, read_toml(path, name), path.parent)
    return Scenario(name, extended(name, tree, _base, path.resolve()))


def _base(name: str, named_in: Path | None) -> tuple[Path, Tree]:
    """Path and tree of a base; a path is relative to the file that names it."""
    path, name = _located(name, Path(name) if named_in is None else named_in.parent / name)
    return path.resolve(), _with_files(name, read_toml(path, name), path.parent)


def _with_files(name: str, tree: Tree, folder: Path) -> Tree:
    """The tree with what the files that it names tell in their place; paths are relative to the folder."""
    for table, key in (("place", "model"), ("robot", "model"), ("robot", "motion")):
        tree = _with_file(name, tree, table, key, folder)
    if ranges.is_mapping(target := tree.get("target")):
        tree = {**tree, "target": _with_file(name, target, "thing", "model", folder, within="target.")}
    tree = {**tree, "camera": _with_calibration(name, tree["camera"], folder, "camera")} if "camera" in tree else tree
    if not ranges.is_list(cameras := tree.get("cameras")):
        return tree
    listed = [_with_calibration(name, one, folder, f"cameras.{index}") for index, one in enumerate(cameras)]
    return {**tree, "cameras": listed}


def _with_file(name: str, tree: Tree, table: str, key: str, folder: Path, *, within: str = "") -> Tree:
    """The tree with the whole path of the file at a key of a table, and a digest of it and those that it names.

    Of a choice between files it is the paths of all, and the digests of all.
    """
    own = tree.get(table, {})
    given = own.get(key) if ranges.is_mapping(own) else None
    choice = given.get("choice") if ranges.is_range(given) else None
    files = [one for one in (choice if ranges.is_list(choice) else [given]) if isinstance(one, str)]
    paths = {one: (folder / one).resolve() for one in files if not one.startswith("menagerie:")}
    if not paths:
        return tree
    try:
        if missing := [path for path in paths.values() if not is_file(path)]:
            raise ParameterError(f"no such file: {one_line(str(missing[0]))}")
        digests = [named_digest(path) for path in paths.values()]
    except ParameterError as error:
        raise ScenarioError(name, [f"{within}{table}.{key}: {error}"]) from None
    whole = [str(paths.get(one, one)) if isinstance(one, str) else one for one in choice or [given]]
    found = {key: {"choice": whole} if choice else whole[0], f"{key}_digest": " ".join(digests)}
    return {**tree, table: {**own, **found}}


def _with_calibration(name: str, camera: object, folder: Path, where: str) -> object:
    """The table of a camera with what the file at its key `calibration` tells in its place."""
    if not ranges.is_mapping(camera) or "calibration" not in camera:
        return camera
    own = dict(camera)
    file = own.pop("calibration")
    if file is None:
        return own
    try:
        if not isinstance(file, str):
            raise ParameterError(f"takes the path of a file, got {file!r}")
        found = read_calibration(folder / file)
        if found.size_px is None:
            raise ParameterError(f"{file}: tells no width and height of its images")
        width, height = found.size_px
        (fx, _, cx), (_, fy, cy), _ = found.K.tolist()
        calibrated = {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "distortion": list(found.lens)}
    except ParameterError as error:
        raise ScenarioError(name, [f"{where}.calibration: {error}"]) from None
    size = {"width_px": width, "height_px": height}
    return {**size, **own, "calibrated": {**size, **calibrated}}


def _located(scenario: str | Path, path: Path) -> tuple[Path, str]:
    """The file of a scenario, by its name in `envs/` or else at a path, and its name in messages."""
    if isinstance(scenario, str) and scenario in names():
        return envs_dir() / f"{scenario}.toml", scenario
    name = str(scenario)
    if "\0" in name or not os.path.lexists(path):
        if path.suffix == ".toml":
            raise ScenarioError(one_line(name), ["no such file"])
        raise UnknownNameError("scenario", name, names())
    if path.is_dir():
        raise ScenarioError(name, ["is a folder, not a TOML file"])
    return path, name


def read_toml(path: Path, name: str) -> Tree:
    """Read a TOML file of bounded size and depth; `name` is named in the message.

    Raises:
        ScenarioError: It cannot be read, or is not TOML.
    """
    try:
        return parse_toml(read_bytes(path, MAX_FILE_BYTES).decode())
    except UnicodeDecodeError:
        raise ScenarioError(one_line(name), ["cannot be read: it is no UTF-8 text"]) from None
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(one_line(name), [f"not valid TOML: {one_line(str(error))}"]) from None
    except (OSError, ValueError) as error:
        text = error.strerror if isinstance(error, OSError) else one_line(str(error))
        raise ScenarioError(one_line(name), [f"cannot be read: {text}"]) from None


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
    if count > MAX_ALTERNATIVES:
        return [f"the ranges have {count} ends and alternatives together: at most {MAX_ALTERNATIVES} are checked"]
    base = {path: values[0] for path, values in spans}
    # Every end of every range, and what lies between, must be valid, so that validity does not depend on the seed.
    trials = [base] + [{**base, path: value} for path, values in spans for value in values[1:]]
    for trial in trials:
        if len(found) > MAX_PROBLEMS:
            break
        candidate = ranges.replaced(tree, trial)
        try:
            settings = ResolvedScenario.model_validate(candidate)
            said = {line.partition(" (")[0] for line in found}
            found += [line for line in settings.late_actions() if whole and line.partition(" (")[0] not in said]
        except ValidationError as error:
            found += [line for line in problems(error, candidate) if line not in found]
    return found
