"""Files of scenarios: found by name or path, with the scenarios that they extend and the files that they name."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import TypeGuard

from pftrack_sim.core.calibration import read_calibration
from pftrack_sim.core.data_files import envs_dir
from pftrack_sim.core.errors import ParameterError, ScenarioError, UnknownNameError
from pftrack_sim.core.inputs import is_file, parse_toml, read_bytes
from pftrack_sim.core.named_files import named_digest
from pftrack_sim.core.text import one_line
from pftrack_sim.scenario.ranges import Tree, is_list, is_mapping, is_range

EXTENDS = "extends"
"""Key of a scenario that names others, and holds only what differs."""
MEASURED = "measured"
"""Table that `pftrack-sim measure` writes beside the axes: where their numbers are from. No part of a scenario."""

_MOST_BYTES = 256 * 1024
_MOST_BASES = 16  # Of a scenario, those of its bases among them


def names() -> list[str]:
    """Names of the shipped scenarios, sorted: their paths in `envs/` without `.toml`."""
    root = envs_dir()
    found = (path.relative_to(root).with_suffix("").as_posix() for path in root.rglob("*.toml"))
    return sorted(name for name in found if not name.startswith("suites/"))


def read_scenario(scenario: str | Path) -> tuple[str, Tree]:
    """Name and tree of a shipped scenario or of the file at a path, see `complete`."""
    path, name = _located(scenario, Path(scenario))
    return name, complete(name, read_toml(path, name), path)


def complete(scenario: str, tree: Tree, path: Path | None = None) -> Tree:
    """A tree with those of its bases below it, and with what the files that both name tell in their place.

    Tables of bases are merged, everything else is replaced; of several bases a later one wins. Paths are relative to
    the file at `path`, which holds the tree, or else to the working folder.

    Raises:
        ScenarioError: An unknown base, a cycle, more than 16 bases, or a file that cannot be read.
    """
    count = 0

    def below(name: str, tree: Tree, file: Path | None, chain: tuple[Path, ...]) -> Tree:
        nonlocal count
        tree = with_files(name, tree, Path() if file is None else file.parent)
        beside, chain = (Path(), chain) if file is None else (file.resolve().parent, (*chain, file.resolve()))
        given = tree.get(EXTENDS, [])
        bases = [given] if isinstance(given, str) else given
        if not is_list(bases) or not all(isinstance(one, str) for one in bases):
            raise ScenarioError(
                scenario, [f"{EXTENDS}: takes a scenario's name or path, or a list of them, got {given!r}"]
            )
        merged: Tree = {}
        for base in bases:
            count += 1
            try:
                found, base_name = _located(base, beside / base)
            except UnknownNameError as error:
                raise ScenarioError(scenario, [f"{EXTENDS}: {error}"]) from None
            cycle = found.resolve() in chain
            if cycle or count > _MOST_BASES:
                wrong = "a scenario extends itself" if cycle else f"more than {_MOST_BASES} bases"
                words = " -> ".join(one_line(one.name, 60) for one in (*chain, found.resolve())[-6:])
                raise ScenarioError(scenario, [f"{EXTENDS}: {wrong}: {words}"])
            merged = _merged(merged, below(base_name, read_toml(found, base_name), found, chain))
        own = {key: value for key, value in tree.items() if key not in (EXTENDS, MEASURED)}
        return _merged(merged, own)

    return below(scenario, tree, path, ())


def _merged(base: Tree, own: Tree) -> Tree:
    result = dict(base)
    for key, value in own.items():
        below = base.get(key)
        # A table of another kind, as a route's, has other keys.
        if _is_table(value) and _is_table(below) and value.get("kind", below.get("kind")) == below.get("kind"):
            result[key] = _merged(below, value)
        else:
            result[key] = value
    return result


def _is_table(value: object) -> TypeGuard[Tree]:
    return is_mapping(value) and not is_range(value)


def with_files(name: str, tree: Tree, folder: Path) -> Tree:
    """The tree with what the files that it names tell in their place; paths are relative to the folder."""
    for table, key in (("place", "model"), ("robot", "model"), ("robot", "motion")):
        tree = _with_file(name, tree, table, key, folder)
    if is_mapping(target := tree.get("target")):
        tree = {**tree, "target": _with_file(name, target, "thing", "model", folder, within="target.")}
    tree = {**tree, "camera": _with_calibration(name, tree["camera"], folder, "camera")} if "camera" in tree else tree
    if not is_list(cameras := tree.get("cameras")):
        return tree
    listed = [_with_calibration(name, one, folder, f"cameras.{index}") for index, one in enumerate(cameras)]
    return {**tree, "cameras": listed}


def _with_file(name: str, tree: Tree, table: str, key: str, folder: Path, *, within: str = "") -> Tree:
    """The tree with the whole path of the file at a key of a table, and a digest of it and those that it names.

    Of a choice between files it is the paths of all, and the digests of all.
    """
    own = tree.get(table, {})
    given = own.get(key) if is_mapping(own) else None
    choice = given.get("choice") if is_range(given) else None
    files = [one for one in (choice if is_list(choice) else [given]) if isinstance(one, str)]
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
    if not is_mapping(camera) or "calibration" not in camera:
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
        return parse_toml(read_bytes(path, _MOST_BYTES).decode())
    except UnicodeDecodeError:
        raise ScenarioError(one_line(name), ["cannot be read: it is no UTF-8 text"]) from None
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(one_line(name), [f"not valid TOML: {one_line(str(error))}"]) from None
    except (OSError, ValueError) as error:
        text = error.strerror if isinstance(error, OSError) else one_line(str(error))
        raise ScenarioError(one_line(name), [f"cannot be read: {text}"]) from None
