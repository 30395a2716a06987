"""Paths of the shipped scenarios and assets, inside the wheel or at the root of a checkout, and of the user's cache."""

from __future__ import annotations

import os
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).resolve().parents[1]


def _root() -> Path:
    shipped = _PACKAGE / "_data"
    return shipped if shipped.is_dir() else _PACKAGE.parent


def envs_dir() -> Path:
    """Folder of the shipped scenarios (TOML files)."""
    return _root() / "envs"


def assets_dir() -> Path:
    """Folder of the shipped textures and MJCF fragments."""
    return _root() / "assets"


def cache_dir() -> Path:
    """`$XDG_CACHE_HOME/pftrack-sim`, or `~/.cache/pftrack-sim`."""
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "pftrack-sim"


@cache
def asset_table(name: str) -> dict[str, Any]:
    """The values of a TOML file among the assets, read once; callers must not change them."""
    return tomllib.loads((assets_dir() / f"{name}.toml").read_text(encoding="utf-8"))
