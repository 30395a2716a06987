"""Keys: an episode's frames and a tracker's result in it are named by a digest of everything that determines them.

The key of the *frames* is made of the scenario with every default written out, the seed, the simulator's code and the
versions of what renders and computes; the cache of frames is named by it. The key of a *result* adds the tracker with
its code, parameters and latency, the controller, the box that is scored, and the code that scores. What is missing,
stale, shared or foreign in a run folder is set arithmetic on keys.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias, cast

from pftrack_sim.core.code_digest import file_digest
from pftrack_sim.core.data_files import assets_dir

SIMULATOR, SCORING = "code of the simulator", "code of the scores"
"""Entries of `environment` beside the versions of packages."""

_PACKAGE = Path(__file__).parents[1]
_ROOMS: Mapping[str, tuple[Path, ...]] = {
    SIMULATOR: (
        *(_PACKAGE / name for name in ("core", "scenario", "scene", "agents", "camera", "render", "truth")),
        _PACKAGE / "simulation",
        assets_dir(),
    ),
    SCORING: (*(_PACKAGE / name for name in ("score", "env", "policies.py")), Path(__file__).parent / "running"),
}
_VERSIONS = ("mujoco", "mujoco-warp", "numpy", "opencv-python-headless", "opencv-contrib-python-headless", "numba")

_LONGEST = 80

Environment: TypeAlias = Mapping[str, str]


def digest(*parts: object) -> str:
    """SHA-256 of values as canonical JSON, in hexadecimal digits."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def short(key: str) -> str:
    """The beginning of a key, as file names hold it."""
    return key[:16]


def key_of(file: str) -> str:
    """The short key at the end of a file's name: `seed-0003-stay-0123456789abcdef.parquet`."""
    return Path(file).stem.rpartition("-")[2]


def slug(name: str) -> str:
    """A name as part of a file name: no separators, and no `=`, which Parquet readers take for a partition key.

    >>> slug("lee2012/db01"), slug("../../etc/x y")
    ('lee2012-db01', 'etc-x-y')
    """
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name)[:_LONGEST].strip("-.") or "unnamed"


def distinct_slugs(names: Iterable[str]) -> dict[str, str]:
    """A slug for each name, all different even where upper and lower case are the same.

    >>> distinct_slugs(["a/b", "a-b", "A-B"])
    {'a/b': 'a-b', 'a-b': 'a-b-2', 'A-B': 'A-B-3'}
    """
    slugs: dict[str, str] = {}
    taken: set[str] = set()
    for name in dict.fromkeys(names):
        candidate, count = slug(name), 1
        while candidate.lower() in taken:
            count += 1
            candidate = f"{slug(name)}-{count}"
        taken.add(candidate.lower())
        slugs[name] = candidate
    return slugs


@cache
def environment() -> dict[str, str]:
    """What determines results besides what is asked for: digests of code, versions of packages, by name."""
    found = {name: _code_digest(roots) for name, roots in _ROOMS.items()}
    return found | {name: version for name in _VERSIONS if (version := package_version(name))}


def environment_digest(known: Environment, *, scoring: bool) -> str:
    """Digest of an environment; without what scores it is that of what determines frames."""
    return digest(sorted(entry for entry in known.items() if scoring or entry[0] != SCORING))


def package_version(name: str) -> str | None:
    """Version of an installed distribution, or None."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _code_digest(roots: tuple[Path, ...]) -> str:
    found = hashlib.sha256()
    for root in roots:
        # __pycache__ holds compiled kernels too, and more of them with every tracker that is used for the first time.
        files = [root] if root.is_file() else sorted(path for path in root.rglob("*") if path.is_file())
        for path in (path for path in files if path.parent.name != "__pycache__"):
            found.update(f"{path.relative_to(root.parent)}\0{file_digest(path)}".encode())
    return found.hexdigest()


def differences(asked: Mapping[str, Any], stored: Mapping[str, Any], path: str = "") -> Iterator[str]:
    """Where two trees differ, one line each: `scenarios.corridor.axes.noise.gain: 7.5 there, 30 asked for`."""
    for name in dict.fromkeys([*asked, *stored]):
        mine: object = asked.get(name)
        theirs: object = stored.get(name)
        below = f"{path}.{name}" if path else name
        trees = [cast("dict[str, Any]", one) for one in (mine, theirs) if isinstance(one, dict)]
        if len(trees) == 2:
            yield from differences(trees[0], trees[1], below)
        elif mine != theirs:
            yield f"{below}: {_words(theirs)} there, {_words(mine)} asked for"


def _words(value: object) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
