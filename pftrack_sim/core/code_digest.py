"""Digests of code: a changed tracker is not mistaken for the one that ran.

What a module imports is read from its source, without running it. What else a process loads and opens it knows itself,
see `OpenedFiles`.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import importlib.util
import os
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from typing import Any

from pftrack_sim.core.inputs import is_file

MAX_CODE_BYTES = 1 << 30
"""A larger file that a tracker opens counts by its size."""

_SYSTEM = ("/dev", "/etc", "/lib", "/lib64", "/proc", "/run", "/sys", "/usr/lib", "/usr/lib64", "/usr/local/lib",
           "/usr/local/share", "/usr/share")  # fmt: skip

_MACHINE_CODE = (".nbi", ".nbc")  # Numba's


def code_digest(module: str, own: str = "") -> str:
    """SHA-256 of the source of a module, by its dotted name, and of what it imports outside installed packages.

    An installed module (in site-packages) counts with its file and the version of its distribution. Imports are read
    from the source, so that modules imported under computed names are missed. The same on every machine with the same
    code; empty if the module has no source.

    Args:
        module: The module.
        own: A package of this one that the module is in. Of what it imports, the modules in there count and no others.
    """
    found = _find(module)
    if found is None or found.origin is None or not Path(found.origin).is_file():
        return ""
    installed = not own and _is_installed(Path(found.origin))
    version = _distribution_version(module.partition(".")[0]) if installed else ""
    return _digest(_sources([module], root=module, own=own), version)


def command_digest(words: Sequence[str]) -> str:
    """SHA-256 of the files that a command names, and of what the Python files among them import.

    A program that is looked up on the PATH does not count; the module after `-m` does.

    Args:
        words: Program and arguments.

    Returns:
        Hexadecimal digits; empty if no file is named.
    """
    files: set[tuple[str, Path]] = set()
    for place, word in enumerate(words):
        path = Path(word)
        if place and words[place - 1] == "-m":
            files |= _sources([word], root=word, search=["", *sys.path])
        elif path.is_file() and (place or path.name != word):
            files.add((path.name, path))
            if path.suffix == ".py":
                files |= _sources(_imports(path, ""), search=[str(path.parent), *sys.path])
    return _digest(files) if files else ""


def _digest(files: Iterable[tuple[str, Path]], version: str = "") -> str:
    digest = hashlib.sha256()
    for name, path in sorted(files):
        digest.update(f"{name}\0".encode())
        digest.update(bytes.fromhex(file_digest(path)))
    digest.update(version.encode())
    return digest.hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file's contents."""
    with path.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


def opened_digest(path: Path) -> str:
    """SHA-256 of a file, `"N bytes"` if it is larger than `MAX_CODE_BYTES`, and nothing where there is none to read."""
    try:
        size = path.stat().st_size if is_file(path) else -1
        return "" if size < 0 else file_digest(path) if size <= MAX_CODE_BYTES else f"{size} bytes"
    except OSError:
        return ""


def opened_file(name: str) -> Path:
    """The file of a name that `OpenedFiles` gives, here; it may be absent."""
    return next((path for folder in sys.path if is_file(path := Path(folder) / name)), Path(name))


class OpenedFiles:
    """Files that this process has opened since, to read them, outside Python, installed packages and the system.

    Modules under computed names, weights and settings are among them. Python does not see what a library opens in C.

    Attributes:
        found: Their `opened_digest` by name: within the folder of Python's path that a file lies in, else the path.
    """

    def __init__(self) -> None:
        self.found: dict[str, str] = {}
        self._new: set[str] = set()
        self._seen: set[str] = set()
        folders = {name(one) for one in sys.path if one for name in (os.path.abspath, os.path.realpath)}
        self._folders = sorted(folders, key=len, reverse=True)
        self._others = tuple(f"{folder}{os.sep}" for folder in (*_installed_folders(), *_SYSTEM))
        sys.addaudithook(self._note)

    def _note(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, _, flags = arguments
        elif event == "import":  # of an extension
            path, flags = arguments[1], 0
        elif event == "ctypes.dlopen":
            path, flags = arguments[0], 0
        else:
            return
        if path and not isinstance(path, int):
            name = os.fsdecode(path)
            if flags & os.O_CREAT:  # its own, as a log
                self._seen.add(os.path.abspath(name))
            elif name not in self._seen:
                with suppress(OSError):  # the working folder is gone
                    self._new.add(os.path.abspath(name))

    def take(self) -> dict[str, str]:
        """Those found since the last call."""
        new, self._new = self._new - self._seen, set()
        self._seen |= new
        taken: dict[str, str] = {}
        for path in sorted(new):
            # Of a module that was compiled before, only that file is opened.
            source = importlib.util.source_from_cache(path) if path.endswith(".pyc") and "__pycache__" in path else path
            real = os.path.realpath(source)
            kept = not real.startswith(self._others) and not real.endswith(_MACHINE_CODE)
            if kept and (digest := opened_digest(Path(real))):
                # By the name that it was opened by: a link may lead elsewhere later.
                inside = next((one for one in self._folders if source.startswith(one + os.sep)), None)
                taken[source if inside is None else os.path.relpath(source, inside)] = digest
        self.found |= taken
        return taken


def _sources(
    modules: Iterable[str], root: str = "", search: list[str] | None = None, own: str = ""
) -> set[tuple[str, Path]]:
    """Names and files of modules and of everything they import; installed ones are left out, except `root`.

    Where `own` is a package, those in it count, and no others.
    """
    seen: set[tuple[str, Path]] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        found = _find(name, search) if name.startswith(f"{own}." if own else "") else None
        if found is None or found.origin is None:
            continue
        path = Path(found.origin)
        installed = name != root and not own and _is_installed(path)
        if installed or path.suffix != ".py" or not path.is_file() or (name, path) in seen:
            continue
        seen.add((name, path))
        waiting += [".".join(name.split(".")[:count]) for count in range(1, name.count(".") + 1)]
        waiting += _imports(path, name if found.submodule_search_locations is not None else name.rpartition(".")[0])
    return seen


def _imports(path: Path, package: str) -> Iterator[str]:
    """Dotted names that a file may import; `from a import b` gives both `a` and `a.b`."""
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")[: package.count(".") + 2 - node.level] if node.level else []
            base = ".".join([*parents, *([node.module] if node.module else [])])
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _find(name: str, search: list[str] | None = None) -> ModuleSpec | None:
    """Where a module lies; unlike `importlib.util.find_spec` it imports no parent package."""
    if not name or name.partition(".")[0] in sys.stdlib_module_names:
        return None
    locations: list[str] | None = None
    found = None
    for part in name.split("."):
        if found is not None and locations is None:
            return None  # a module has no parts
        # The part alone: a dotted name of a namespace package would ask for its imported parent.
        found = PathFinder.find_spec(part, locations if locations is not None else search)
        if found is None:
            return None
        locations = list(found.submodule_search_locations) if found.submodule_search_locations is not None else None
    return found


def _is_installed(path: Path) -> bool:
    """Whether a file belongs to Python, to an installed distribution, or to this package."""
    return any(path.resolve().is_relative_to(folder) for folder in _installed_folders())


@cache
def _installed_folders() -> tuple[Path, ...]:
    folders = [*(sysconfig.get_path(key) for key in ("stdlib", "purelib", "platlib")), Path(__file__).parents[1]]
    return tuple(Path(folder).resolve() for folder in folders)


@cache  # it reads the records of everything that is installed
def _distribution_version(package: str) -> str:
    names = importlib.metadata.packages_distributions().get(package, [])
    return " ".join(f"{name} {importlib.metadata.version(name)}" for name in sorted(names))
