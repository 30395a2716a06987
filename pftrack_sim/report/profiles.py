"""Profiles: tables for the terminal and for documents, and a figure, beside the quantiles of recorded video."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from pftrack_sim.core.errors import RunError
from pftrack_sim.core.palette import COLOURS, Style
from pftrack_sim.report.figure import drawn_figure
from pftrack_sim.report.tables import Table
from pftrack_sim.scenario import load
from pftrack_sim.score.profile import NUMBERS, QUANTILES, Profile, ends_reached, recorded_quantiles

_ABREAST = 5
"""Columns of profiles in one table."""

_NOTES = {
    "<, <<": "below 25 % and 10 % of the recorded sequences",
    ">, >>": "above 75 % and 90 %",
    "_per_s": "rates, of the recorded sequences at 25 frames a second",
}

_LEAST_CHANGE = 0.25

_SHARES = ("stay_overlap", "ncc_to_first", "ncc_to_previous", "colour_change", "distinct_from_surround")
"""Numbers on a linear scale from 0 to 1; the others are drawn on a logarithmic one."""

_MARKERS = "osD^v"


def changes_or_tiers(path: Path) -> Iterator[list[str]]:
    """Head and rows: of what conditions change if a name has one, as `corridor jitter=2`; else of scenarios by tier.

    Args:
        path: `profile.json` of `pftrack-sim profile SCENARIO... --out DIR`.

    Raises:
        RunError: It cannot be read.
        UnknownNameError: A name is none of a scenario.
    """
    try:
        profiles = cast("dict[str, dict[str, float | None]]", json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise RunError(f"{path} cannot be read: {getattr(error, 'strerror', error)}") from None
    if any(" " in name for name in profiles):
        yield ["Condition", "profile: from the base scenario's to"]
        yield from _condition_rows(profiles)
    else:
        yield from _tier_rows(profiles)


def _condition_rows(profiles: Mapping[str, Mapping[str, float | None]]) -> Iterator[list[str]]:
    """Rows of condition, and the numbers of its profile that differ by a quarter from the first of the scenario."""
    bases: dict[str, Mapping[str, Any]] = {}
    for name, numbers in profiles.items():
        base = bases.setdefault(name.partition(" ")[0], numbers)
        if numbers is not base:
            pairs = {key: (base[key], value) for key, value in numbers.items() if base[key] and value is not None}
            changed = [
                f"`{key}` {before:.3g} -> {after:.3g}"
                for key, (before, after) in pairs.items()
                if before and abs(math.log(max(after, 1e-9) / before)) > math.log1p(_LEAST_CHANGE)
            ]
            yield [name, ", ".join(changed) or "none by a quarter"]


def _tier_rows(profiles: Mapping[str, Mapping[str, float | None]]) -> Iterator[list[str]]:
    """Head and rows of a number's medians and, by tier, its least and greatest."""
    tiers = {name: load(name).tree.get("tier", "easy") for name in profiles}
    shown = [tier for tier in ("real", "hard", "easy") if tier in tiers.values()]
    yield [
        *("number", "recorded 25 to 75 %", f"median of {len(tiers)}"),
        *(f"median of {list(tiers.values()).count(tier)} `{tier}`" for tier in shown),
        *("recorded 10 to 90 %", *(f"`{tier}`" for tier in shown), "ends reached"),
    ]
    for key, (low, quarter, _, three_quarters, high) in recorded_quantiles().items():
        values = {name: value for name, numbers in profiles.items() if (value := numbers[key]) is not None}
        by_tier = [[value for name, value in values.items() if tiers[name] == tier] for tier in shown]
        medians = [float(np.median(some)) if some else np.nan for some in (list(values.values()), *by_tier)]
        outside = ["" if quarter <= median <= three_quarters else " (outside)" for median in medians]
        yield [
            *(f"`{key}`", f"{quarter:.3g} to {three_quarters:.3g}"),
            *(f"{median:.3g}{mark}" for median, mark in zip(medians, outside, strict=True)),
            f"{low:.3g} to {high:.3g}",
            *(f"{min(some):.3g} to {max(some):.3g}" if some else "-" for some in by_tier),
            ends_reached(key, list(values.values())),
        ]


def profile_tables(profiles: Mapping[str, Profile]) -> Iterator[Table]:
    """Profiles beside the quantiles of recorded video; numbers outside of its middle half are marked."""
    recorded = recorded_quantiles()
    columns = {name: {key: getattr(one, key) for key in recorded} for name, one in profiles.items()}
    if len(columns) > 1:
        columns["median"] = {key: _median([column[key] for column in columns.values()]) for key in recorded}
    names = list(columns)
    for first in range(0, len(names), _ABREAST):
        shown = names[first : first + _ABREAST]
        heads = (
            *(f"{share:.0%}" for share in QUANTILES),
            *(name.replace("/", "/\n").replace(" ", "\n") for name in shown),
        )
        rows = [
            [key, *map(_short, quantiles), *(_marked(columns[name][key], quantiles) for name in shown)]
            for key, quantiles in recorded.items()
        ]
        title = "Profile, after the quantiles of 48 recorded sequences"
        yield Table(title, ("number",), heads, rows, _NOTES)
    if len(profiles) > 1:
        rows: list[list[str]] = []
        for key, (low, *_, high) in recorded.items():
            values = [value for one in profiles.values() if not math.isnan(value := getattr(one, key))] or [math.nan]
            rows.append([key, *map(_short, (low, high, min(values), max(values))), ends_reached(key, values)])
        title = "Least and greatest, and which ends of the recorded 10 to 90 % they reach"
        yield Table(title, ("number",), ("10%", "90%", "least", "greatest", "ends"), rows)


def _marked(value: float, quantiles: Sequence[float]) -> str:
    low, quarter, _, three_quarters, high = quantiles
    below, above = (value < low) + (value < quarter), (value > high) + (value > three_quarters)
    mark = "<" * below + ">" * above
    return f"{_short(value)} {mark:2}"


def _short(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.0f}" if value >= 100.0 else f"{value:.3f}"


def _median(values: Sequence[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return float(np.median(known)) if known else math.nan


def write_profile_figure(profiles: Mapping[str, Profile], target: Path) -> Path:
    """Draw profiles beside those of recorded video: bands from 10 to 90 % and from 25 to 75 %, a line at the median.

    Args:
        profiles: Profiles by name of the scenario or sequence.
        target: File ending in `.png`, `.svg` or `.pdf`.

    Raises:
        ParameterError: matplotlib is not installed.
        RunError: The file cannot be written.
    """
    high_inch = 0.55 * len(NUMBERS) + 0.3 + 0.2 * -(-len(profiles) // 4)
    with drawn_figure(target, (8.0, high_inch), dpi=150) as figure:
        strips: Any = figure.subplots(len(NUMBERS), 1)
        for strip, name in zip(strips, NUMBERS, strict=True):
            _draw_strip(strip, name, {label: getattr(one, name) for label, one in profiles.items()})
        figure.legend(
            *strips[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=7, frameon=False
        )
    return target


def _draw_strip(strip: Any, name: str, values: Mapping[str, float]) -> None:
    """Draw one number of all profiles, by their labels."""
    from matplotlib.ticker import LogLocator, NullLocator

    low, quarter, median, three_quarters, high = recorded_quantiles()[name]
    strip.axvspan(low, high, color="#e8e8e8", lw=0)
    strip.axvspan(quarter, three_quarters, color="#c8c8c8", lw=0)
    strip.axvline(median, color="#808080", lw=1)
    if name in _SHARES:
        ends = (0.0, 1.0)
    else:
        known = [value for value in values.values() if value > 0.0]
        ends = (0.8 * min(low, *known), 1.25 * max(high, *known))
        strip.set_xscale("log")
        strip.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        strip.xaxis.set_major_formatter("{x:g}")
        strip.xaxis.set_minor_locator(NullLocator())
    strip.set(xlim=ends, ylim=(0, 1), yticks=[])
    for index, (label, value) in enumerate(values.items()):
        colour, marker = COLOURS[index % len(COLOURS)], _MARKERS[index // len(COLOURS) % len(_MARKERS)]
        # Spread over the height of the strip, so that equal numbers can be told apart; 0 lies at the left end.
        height, place = (index + 1) / (len(values) + 1), np.clip(value, *ends)
        strip.plot([place], [height], marker, ms=4, color=Style(colour).hexadecimal, label=label, clip_on=False)
    strip.set_ylabel(name, rotation=0, ha="right", va="center", fontsize=8)
    strip.tick_params(labelsize=6, pad=1, which="both")
    strip.spines[["top", "left", "right"]].set_visible(False)
