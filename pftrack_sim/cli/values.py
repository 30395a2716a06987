"""Values as they are typed at the command line."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from typing import Any

from pftrack_sim.errors import ParameterError


def parse_names(text: str) -> list[str]:
    """Names between commas.

    >>> parse_names("ko2012, stay")
    ['ko2012', 'stay']
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise ParameterError(f"expected names between commas, got {text!r}")
    return names


def parse_settings(pairs: Sequence[str]) -> dict[str, Any]:
    """`KEY=VALUE` pairs; a value is read as TOML (numbers, true, lists, tables), or else as plain text.

    Raises:
        ParameterError: Not of that form.

    >>> parse_settings(["camera.width_px=320", "lights.shadows=false", "robot.gaze=forward"])
    {'camera.width_px': 320, 'lights.shadows': False, 'robot.gaze': 'forward'}
    """
    settings: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals or not key.strip():
            raise ParameterError(f"--set takes KEY=VALUE, for example camera.width_px=320; got {pair!r}")
        try:
            value = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            value = text
        settings[key.strip()] = value
    return settings


def parse_latency(text: str, trackers: Sequence[str]) -> dict[str, float]:
    """`TRACKER=MS` pairs between commas, or `paper` for the figures that the papers print.

    Raises:
        ParameterError: Not of that form.

    >>> parse_latency("lee2012=55, stay=7", ["lee2012", "stay"])
    {'lee2012': 55.0, 'stay': 7.0}
    >>> parse_latency("paper", ["ko2012", "stay"])
    {'ko2012': 100.0}
    """
    if text.strip() == "paper":
        from pftrack_sim.policies import PAPER_MS

        return {name: PAPER_MS[name] for name in trackers if name in PAPER_MS}
    found: dict[str, float] = {}
    for pair in (one for one in text.split(",") if one.strip()):
        name, _, number = pair.partition("=")
        try:
            found[name.strip()] = float(number)
        except ValueError:
            raise ParameterError(
                f"--latency takes TRACKER=MILLISECONDS between commas, or paper; got {pair.strip()!r}"
            ) from None
    return found


def parse_axes(pairs: Sequence[str]) -> dict[str, list[float]]:
    """`AXIS=0,1,2` pairs.

    Raises:
        ParameterError: Not of that form.

    >>> parse_axes(["jitter=0,1.5"])
    {'jitter': [0.0, 1.5]}
    """
    axes: dict[str, list[float]] = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        try:
            levels = [float(level) for level in text.split(",")]
        except ValueError:
            levels = []
        if not equals or not name.strip() or not levels:
            raise ParameterError(f"--axis takes AXIS=LEVEL,LEVEL, for example jitter=0,1,2; got {pair!r}")
        if name.strip() in axes:
            raise ParameterError(f"--axis {name.strip()} is given twice")
        axes[name.strip()] = levels
    return axes
