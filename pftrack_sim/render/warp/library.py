"""The part of MuJoCo Warp that casts rays, without the part that moves bodies.

Importing `mujoco_warp` prepares some 700 functions of its simulation and takes two seconds, nine tenths of the time to
a first picture; its ray caster alone takes a quarter of a second. The package's own `__init__` is therefore passed over
here, and left to run when somebody imports `mujoco_warp` itself.
"""

import sys
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from typing import Any

import warp as wp

_PACKAGE = "mujoco_warp"


def _parts(*names: str) -> list[Any]:
    """Modules of the package by name."""
    if _PACKAGE in sys.modules:
        return [import_module(name) for name in names]
    spec = find_spec(_PACKAGE)
    if spec is None:
        raise ModuleNotFoundError(f"No module named {_PACKAGE!r}", name=_PACKAGE)
    sys.modules[_PACKAGE] = module_from_spec(spec)
    try:
        return [import_module(name) for name in names]
    finally:
        del sys.modules[_PACKAGE]


# Warp greets on standard output, which belongs to whoever asked for results there.
wp.config.log_level = max(wp.config.log_level, wp.LOG_ERROR)

caster, _types = _parts(f"{_PACKAGE}._src.render", f"{_PACKAGE}._src.types")
GeomType: Any = _types.GeomType
