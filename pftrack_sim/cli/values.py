"""Values as they are typed at the command line; what has another form is a `ParameterError` with an example."""

from __future__ import annotations

import itertools
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.core.inputs import parse_toml
from pftrack_sim.core.text import one_line

if TYPE_CHECKING:
    from pftrack_sim.benchmark import TrackerSpec


_COMMA_OUTSIDE_BRACKETS = r",(?![^\[\]]*\])"


def parse_names(text: str) -> list[str]:
    """Names between commas; commas in brackets belong to a name.

    >>> parse_names("ko2012[alpha=0.3,particles=true], stay")
    ['ko2012[alpha=0.3,particles=true]', 'stay']
    """
    names = [name.strip() for name in re.split(_COMMA_OUTSIDE_BRACKETS, text) if name.strip()]
    if not names:
        raise ParameterError(f"expected names between commas, got {text!r}")
    return names


def parse_settings(
    pairs: Sequence[str], *, option: str = "--set", example: str = "camera.width_px=320"
) -> dict[str, Any]:
    """`KEY=VALUE` pairs; a value is read as TOML (numbers, true, lists, tables) or `True`, or else as plain text.

    >>> parse_settings(["camera.width_px=320", "lights.shadows=false", "blur=True", "robot.gaze=forward"])
    {'camera.width_px': 320, 'lights.shadows': False, 'blur': True, 'robot.gaze': 'forward'}
    """
    settings: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals or not key.strip():
            raise ParameterError(f"{option} takes KEY=VALUE, for example {example}; got {pair!r}")
        settings[key.strip()] = _value(text)
    return settings


def _by_tracker(given: Mapping[str, Any], trackers: Sequence[str]) -> dict[str, dict[str, Any]]:
    """By the tracker's name, what is given as `KEY` for every tracker, and as `TRACKER.KEY` for one.

    >>> _by_tracker({"particles": True, "opencv-vit.model": "vit.onnx"}, ["ko2012", "opencv-vit"])
    {'ko2012': {'particles': True}, 'opencv-vit': {'particles': True, 'model': 'vit.onnx'}}
    """
    found: dict[str, dict[str, Any]] = {}
    for key, value in given.items():
        # A factory that is spelled out has dots of its own: the last one divides.
        tracker, _, name = key.rpartition(".")
        if tracker and tracker not in trackers:
            raise UnknownNameError("tracker before a parameter's name", tracker, trackers)
        for one in [tracker] if tracker else trackers:
            found.setdefault(one, {})[name] = value
    return found


def parse_search(pairs: Sequence[str], trackers: Sequence[str]) -> dict[str, list[dict[str, Any]]]:
    """By the tracker's name, all combinations of `[TRACKER.]KEY=VALUE,VALUE` pairs.

    >>> parse_search(["ko2012.alpha=0.1,0.3"], ["ko2012", "stay"])
    {'ko2012': [{'alpha': 0.1}, {'alpha': 0.3}]}
    """
    given: dict[str, list[Any]] = {}
    for pair in pairs:
        key, _, text = pair.partition("=")
        values = [_value(one.strip()) for one in re.split(_COMMA_OUTSIDE_BRACKETS, text)]
        if not key.strip() or len(values) < 2:
            raise ParameterError(
                f"--search takes [TRACKER.]KEY=VALUE,VALUE, for example ko2012.alpha=0.1,0.3; got {pair!r}"
            )
        given[key.strip()] = values
    return {
        one: [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]
        for one, grid in _by_tracker(given, trackers).items()
    }


def _value(text: str) -> Any:
    """A value in TOML, or a boolean as Python writes it; other text is a string."""
    if text in ("True", "False"):
        return text == "True"
    try:
        return parse_toml(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
    except ValueError as error:
        raise ParameterError(f"{one_line(text, 60)}: {error}") from None


def parse_trackers(text: str, preset: str, pairs: Sequence[str] = (), allow_truth: str = "") -> list[TrackerSpec]:
    """Trackers between commas, each with parameters in brackets where it has some; `preset` is one of these.

    `pairs` are parameters typed elsewhere; those in brackets go before them. `allow_truth` has names between commas.

    >>> [one.label for one in parse_trackers("stay, ko2012[preset=paper,particle_count=50]", "default")]
    ['stay', 'ko2012[preset=paper,particle_count=50]']
    """
    from pftrack_sim.benchmark import TrackerSpec
    from pftrack_sim.benchmark.asked.plan import parameter_errors

    found: list[tuple[str, str, dict[str, Any]]] = []
    for part in parse_names(text):
        match = re.fullmatch(r"([^\[\]]+)(?:\[([^\[\]]*)\])?", part)
        inside = [pair for pair in (match[2] or "").split(",") if pair] if match else []
        if not match or any("=" not in pair for pair in inside):
            raise ParameterError(
                f"--trackers takes names, with parameters in brackets: ko2012[particle_count=50]; got {text!r}"
            )
        params = {key.strip(): _value(value) for key, _, value in (pair.partition("=") for pair in inside)}
        chosen = str(params.pop("preset", preset))
        found.append((match[1].strip(), chosen, params))
    named = [name for name, _, _ in found]
    elsewhere = _by_tracker(parse_settings(pairs, option="--param", example="ko2012.particle_count=200"), named)
    if any("preset" in params for params in elsewhere.values()):
        raise ParameterError("the preset is no --param: give --preset, or ko2012[preset=paper]")
    told = parse_names(allow_truth) if allow_truth else []
    for name in told:
        if name not in named:
            raise UnknownNameError("tracker that --allow-truth names", name, named)
    with parameter_errors("trackers"):
        return [
            TrackerSpec(
                name=name, preset=chosen, params={**elsewhere.get(name, {}), **params}, allow_truth=name in told
            )
            for name, chosen, params in found
        ]


def check_output(option: str, out: Path, suffixes: Sequence[str], *read: Path) -> None:
    """Raise ParameterError for a file of another kind, or for one that is read: writing it would destroy it."""
    if out.suffix.lower() not in suffixes:
        raise ParameterError(f"{option} is a {' or '.join(suffixes)} file, got {out.name!r}")
    if any(out.resolve() == one.resolve() for one in read):
        raise ParameterError(f"{option} is what is read, {out}: name another file")


def parse_part(text: str) -> tuple[int, int]:
    """`K/N`.

    >>> parse_part("2/4")
    (2, 4)
    """
    match = re.fullmatch(r"(\d+)/(\d+)", text.strip())
    if not match:
        raise ParameterError(f"--part takes K/N, for example 1/4 on the first of four machines; got {text!r}")
    return int(match[1]), int(match[2])


def parse_latency(text: str, trackers: Sequence[str]) -> dict[str, float | None]:
    """`TRACKER=MS` pairs between commas; `measured` for MS is None.

    Alone, `measured` is for all trackers but those that are told the truth, `paper` for what the papers print.

    TRACKER is a name, or a name with its parameters: `ko2012[particle_count=50]=12`.

    >>> parse_latency("lee2012=55, stay=7", ["lee2012", "stay"])
    {'lee2012': 55.0, 'stay': 7.0}
    >>> parse_latency("ko2012[preset=paper,particle_count=50]=12", [])
    {'ko2012[preset=paper,particle_count=50]': 12.0}
    >>> parse_latency("stay=measured", ["stay"])
    {'stay': None}
    >>> parse_latency("paper", ["ko2012", "stay"])
    {'ko2012': 100.0}
    >>> parse_latency("measured", ["ko2012", "oracle"])
    {'ko2012': None}
    """
    if text.strip() == "measured":
        from pftrack_sim.trackers.registry import told

        return {name: None for name in trackers if told(name) != "truth"}
    if text.strip() == "paper":
        from pftrack_sim.policies import PAPER_MS

        return {name: PAPER_MS[name] for name in trackers if name in PAPER_MS}
    found: dict[str, float | None] = {}
    for pair in parse_names(text):
        name, equals, number = (part.strip() for part in pair.rpartition("="))
        try:
            found[name] = None if equals and number == "measured" else float(number if equals else "")
        except ValueError:
            raise ParameterError(
                "--latency takes TRACKER=MILLISECONDS or TRACKER=measured between commas, or measured or paper for "
                f"all; got {pair!r}"
            ) from None
    return found


def parse_ranges(pairs: Sequence[str]) -> dict[str, tuple[float, float] | None]:
    """`AXIS` and `AXIS=LOW:HIGH`, in the unit of the axis.

    >>> parse_ranges(["jitter", "occlusion=0.2:3"])
    {'jitter': None, 'occlusion': (0.2, 3.0)}
    """
    ranges: dict[str, tuple[float, float] | None] = {}
    for pair in pairs:
        name, equals, text = (part.strip() for part in pair.partition("="))
        try:
            low, high = (float(end) for end in text.split(":")) if equals else (0.0, 0.0)
        except ValueError:
            raise ParameterError(
                f"--axis takes AXIS, or AXIS=LOW:HIGH in its unit, for example jitter=0.5:5; got {one_line(pair, 60)!r}"
            ) from None
        if name in ranges:
            raise ParameterError(f"--axis {name} is given twice")
        ranges[name] = (low, high) if equals else None
    return ranges


def parse_percent(text: str, option: str) -> float:
    """A share, as `10%`.

    >>> parse_percent("10%", "--width")
    0.1
    """
    match = re.fullmatch(r"\s*(\d+(?:\.\d*)?)\s*%\s*", text)
    if not match:
        raise ParameterError(f"{option} takes a percentage, for example 10%; got {one_line(text, 60)!r}")
    return float(match[1]) / 100.0


def parse_axes(pairs: Sequence[str]) -> dict[str, list[float]]:
    """`AXIS=0,1,2` and `AXIS.PARAMETER=5,10` pairs.

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
