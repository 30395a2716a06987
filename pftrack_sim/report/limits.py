"""Breaking points as tables and as a page: success rates over the levels, and what breaks first."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from pftrack_sim.benchmark import RunStore
from pftrack_sim.benchmark.limits.found import Difference, Limit, Limits
from pftrack_sim.benchmark.limits.scale import is_linear
from pftrack_sim.benchmark.limits.search import examples
from pftrack_sim.core.palette import styles_of
from pftrack_sim.measuring.measured import Level
from pftrack_sim.report.following import video_link
from pftrack_sim.report.html import render, write_page
from pftrack_sim.report.tables import Table, grouped

_WIDTH, _HEIGHT, _LEFT = 600.0, 220.0, 30.0  # of a plot; the level 0 stands at its left edge
_NAME_HEIGHT = 14.0  # of a name at the end of a curve
_GROUPS = 14  # Points of a curve
_TICKS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)

_NOTHING: Mapping[str, Level] = MappingProxyType({})


def limit_tables(found: Limits, measured: Mapping[str, Level] = _NOTHING) -> list[Table]:
    """The breaking points, and where there are any the differences between trackers, and margins.

    `measured` has levels by axis, as a robot's own video has them.
    """
    rows = [
        [_axis_of(one), one.tracker, point_text(one), interval_text(one), str(one.episodes), one.stopped]
        for one in found.limits
    ]
    title = f"Breaking points: {found.success}, in {100 * found.at:g} % of the episodes"
    heads = ["breaking point", "95 % interval", "episodes", "stopped"]
    tables = [Table(title, ["", "tracker"], heads, rows, grouped=True)]
    pairs = [
        [_axis_of(one), f"{one.first} - {one.second}", f"{one.difference:+.3g}", f"{one.low:+.3g} to {one.high:+.3g}"]
        for one in found.differences
    ]
    if pairs:
        tables.append(Table("Differences, paired by seed", ["", "trackers"], ["difference", "95 % interval"], pairs,
                            grouped=True))  # fmt: skip
    margins = margin_table(found.limits, measured)
    return [*tables, margins] if margins is not None else tables


def breaking_tables(found: Limits) -> list[Table]:
    """For every scenario what breaks each tracker: a column for each axis, and the axis that does so first.

    First is the axis with the smallest breaking point in multiples of its typical level, or with what it is known to be
    below; none where a tracker is broken from the start or breaks nowhere.
    """
    tables: list[Table] = []
    for scenario in dict.fromkeys(one.scenario for one in found.limits):
        own = [one for one in found.limits if one.scenario == scenario and not one.mix]
        axes = {one.axis: f"{one.axis} [{one.unit}]" for one in own}
        cells = {(one.tracker, one.axis): _cell(one) for one in own}
        rows = [
            [label, *(cells[label, axis] for axis in axes), _first([one for one in own if one.tracker == label])]
            for label in dict.fromkeys(one.tracker for one in own)
        ]
        tables.append(Table(f"What breaks in {scenario}", ["tracker"], [*axes.values(), "first"], rows))
    return tables


def _cell(one: Limit) -> str:
    if one.breaking_point is not None and one.verdict == "breaks":
        return f"{point_text(one)} ({interval_text(one)})"
    return {"never breaks within the range": f"not by {one.range[1]:.3g}", "breaks": interval_text(one)}.get(
        one.verdict, point_text(one)
    )


def _first(limits: Sequence[Limit]) -> str:
    reached: list[tuple[float, str, str]] = []
    for one in limits:
        below = {"breaks": one.high, "breaks below the lowest level": one.range[0]}.get(one.verdict)
        if one.typical and (level := one.breaking_point or below):
            reached.append((level / one.typical, "at" if one.breaking_point else "below", one.axis))
    if not reached:
        return "-"
    times, where, axis = min(reached)
    return f"{axis}, {where} {times:.2g} x typical"


def _axis_of(one: Limit | Difference) -> str:
    return f"{one.scenario}, {one.axis} [{one.unit}]"


def point_text(one: Limit) -> str:
    """A breaking point, or why there is none."""
    if one.verdict == "not monotone":
        return f"not monotone (p = {one.monotone_p:.3f})"
    if one.verdict != "breaks":
        return one.verdict
    return "-" if one.breaking_point is None else f"{one.breaking_point:.3g}"


def interval_text(one: Limit) -> str:
    """`1.2 to 1.5`, or `above 1.2` and `below 1.5` where an end is open."""
    match one.low, one.high:
        case None, None:
            return "-"
        case None, high:
            return f"below {high:.3g}"
        case low, None:
            return f"above {low:.3g}"
        case low, high:
            return f"{low:.3g} to {high:.3g}"


def margin_table(limits: Sequence[Limit], measured: Mapping[str, Level]) -> Table | None:
    """A row for each breaking point on an axis that was measured; None without any."""
    rows = [
        [
            _axis_of(one),
            one.tracker,
            f"{level.level:.3g} ({level.low:.3g} to {level.high:.3g})",
            point_text(one) if one.verdict != "breaks" else f"{point_text(one)} ({interval_text(one)})",
            margin_text(one, level),
        ]
        for one in limits
        if (level := measured.get(one.axis)) is not None
    ]
    if not rows:
        return None
    sources = ", ".join(dict.fromkeys(level.source for level in measured.values() if level.source))
    title = f"Margins: breaking point over what was measured{f' in {sources}' if sources else ''}"
    return Table(title, ["", "tracker"], ["measured", "breaks at", "margin"], rows, grouped=True)


def margin_text(one: Limit, level: Level) -> str:
    """`2 (1.5 to 2.4)`: the breaking point over the level, with the interval of the ratio.

    The distances of the ends on a logarithmic scale are added in quadrature (Zou and Donner 2008): both estimates are
    independent.
    """
    if level.level <= 0.0:
        return "nothing was measured"
    if one.verdict == "never breaks within the range":
        return f"above {_two_digits(one.range[1] / level.high)}"
    if one.breaking_point is None or one.verdict != "breaks":
        ceiling = one.high if one.verdict in ("breaks", "breaks below the lowest level") else None
        return "-" if ceiling is None or level.low <= 0.0 else f"below {_two_digits(ceiling / level.low)}"
    ratio = one.breaking_point / level.level
    below = above = math.inf
    if one.low is not None:
        below = math.hypot(math.log(one.breaking_point / one.low), math.log(level.high / level.level))
    if one.high is not None and level.low > 0.0:
        above = math.hypot(math.log(one.high / one.breaking_point), math.log(level.level / level.low))
    end = "any" if math.isinf(above) else _two_digits(ratio * math.exp(above))
    return f"{_two_digits(ratio)} ({_two_digits(ratio * math.exp(-below))} to {end})"


def _two_digits(value: float) -> str:
    """`210` and `0.034`, in no exponents."""
    return f"{float(f'{value:.2g}'):g}"


def write_limits_page(path: Path, found: Limits, measured: Mapping[str, Level] = _NOTHING) -> Path:
    """Write `limits.html` into a run folder; it needs nothing but itself and the videos beside it.

    `measured` is that of `limit_tables`.

    Raises:
        RunError: No run folder, or one that cannot be written to.
    """
    store = RunStore(path)
    videos = {
        (one.scenario, one.condition.name, one.seed): link
        for one in examples(store, found)
        if (link := video_link(store, one)) is not None
    }
    styles = styles_of(dict.fromkeys(one.tracker for one in found.limits))
    groups = grouped(found.limits, lambda one: (one.scenario, one.axis))
    page = render(
        "limits",
        [],
        title=path.resolve().name,
        found=found,
        overview=breaking_tables(found) if len(groups) > 1 and len(styles) > 1 else [],
        tables=limit_tables(found),
        margins=margin_table(found.limits, measured),
        styles=styles,
        size=(_WIDTH, _HEIGHT),
        plots=[_plot(group, videos) for group in groups.values()],
        firsts=_firsts(found.limits),
        frontiers=_frontiers(found.limits),
    )
    return write_page(path / "limits.html", page)


def _plot(limits: Sequence[Limit], videos: dict[tuple[str, str, int], str]) -> dict[str, Any]:
    """One plot: curves, points and intervals of all trackers on an axis of a scenario, in its own units."""
    first = limits[0]
    low, high = first.range

    def place(level: float) -> float:
        if level < low:
            return 0.5 * _LEFT
        share = (level - low) / (high - low) if is_linear(first.axis) else math.log(level / low) / math.log(high / low)
        return _LEFT + (_WIDTH - _LEFT - 8.0) * min(share, 1.0)

    def drawn(one: Limit) -> dict[str, Any]:
        points: list[tuple[float, float, float, int, float]] = []
        for own in grouped(one.tried, lambda tried: int(_GROUPS * place(tried.level) / _WIDTH)).values():
            number = sum(tried.episodes for tried in own)
            at = sum(place(tried.level) * tried.episodes for tried in own) / number
            rate = sum(tried.successes for tried in own) / number
            points.append((round(at, 1), round(_height(rate), 1), round(2.0 + math.sqrt(number), 1), number, rate))
        curve = " ".join(f"{place(level):.1f},{_height(rate):.1f}" for level, rate in one.curve if level >= low)
        known = one.low is not None or one.high is not None
        ends = (place(one.low) if one.low else _LEFT, place(one.high) if one.high else _WIDTH - 8.0)
        return {
            "limit": one,
            "point": point_text(one),
            "interval": interval_text(one),
            "curve": curve,
            "end": _height(one.curve[-1][1]) if one.curve else 0.0,
            "points": points,
            "ends": [round(end, 1) for end in ends] if known else None,
            "mark": round(place(one.breaking_point), 1) if one.breaking_point is not None else None,
            "videos": [
                (words, f"{example.level:.3g} {one.unit}, seed {example.seed}", videos[key])
                for words, example in (("held at", one.held), ("failed at", one.failed))
                if example is not None and (key := (one.scenario, example.condition, example.seed)) in videos
            ],
        }

    ticks = np.linspace(low, high, 6) if is_linear(first.axis) else [one for one in _TICKS if low <= one <= high]
    return {
        "scenario": first.scenario,
        "axis": first.axis,
        "unit": first.unit,
        "ticks": [(round(place(float(one)), 1), f"{one:.3g}") for one in ticks],
        "trackers": _named([drawn(one) for one in limits]),
        "height": max(_HEIGHT + 22.0, _NAME_HEIGHT * (len(limits) + 1)),
        "room": 8 * max(len(one.tracker) for one in limits),
    }


def _frontiers(limits: Sequence[Limit]) -> list[dict[str, Any]]:
    """One plot for every scenario in which two axes rise together: where each tracker breaks, in both axes' units."""
    plots: list[dict[str, Any]] = []
    for scenario in dict.fromkeys(one.scenario for one in limits if one.mix):
        own = [one for one in limits if one.scenario == scenario]
        axes = {mixed.axis: mixed for one in own for mixed in one.mix}
        points = {
            tracker: _frontier([one for one in own if one.tracker == tracker], tuple(axes))
            for tracker in dict.fromkeys(one.tracker for one in own)
        }
        most = [
            # 1 where no point has a share of the axis, so that a plot of the other one alone has a scale, too.
            1.05 * max((end[k] for ends in points.values() for one in ends for end in one), default=0.0) or 1.0
            for k in range(2)
        ]

        def place(point: tuple[float, float], most: Sequence[float] = most) -> tuple[float, float]:
            return (round(_WIDTH * point[0] / most[0], 1), round(_HEIGHT * (1.0 - point[1] / most[1]), 1))

        ticks = [[one for one in _TICKS if 0.08 * high <= one <= high] for high in most]
        x, y = axes.values()
        plots.append(
            {
                "scenario": scenario,
                "x": x,
                "y": y,
                "ticks": [(place((one, 0.0))[0], f"{one:g}") for one in ticks[0]],
                "rises": [(place((0.0, one))[1], f"{one:g}") for one in ticks[1]],
                "trackers": [
                    {
                        "tracker": tracker,
                        "line": " ".join("{},{}".format(*place(middle)) for middle, _, _ in ends),
                        "points": [tuple(place(end) for end in one) for one in ends],
                    }
                    for tracker, ends in points.items()
                ],
            }
        )
    return plots


def _frontier(limits: Sequence[Limit], axes: tuple[str, ...]) -> list[tuple[tuple[float, float], ...]]:
    """Breaking point and both ends of its interval in two axes, from the first axis alone to the second alone.

    An open end is that of the range.
    """
    found: list[tuple[float, tuple[tuple[float, float], ...]]] = []
    for one in limits:
        if one.breaking_point is None:
            continue
        ends = one.breaking_point, one.low or 0.0, one.high or one.range[1]
        factors = {mixed.axis: mixed.share * mixed.typical for mixed in one.mix} or {one.axis: 1.0}
        x, y = (factors.get(axis, 0.0) for axis in axes)
        found.append((math.atan2(y, x), tuple((end * x, end * y) for end in ends)))
    return [points for _, points in sorted(found)]


def _named(trackers: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Trackers with the height of their names, each at the end of its curve but not over another."""
    order = sorted(trackers, key=lambda one: one["end"])
    lowest = -math.inf
    for one in order:
        lowest = one["name_y"] = max(lowest + _NAME_HEIGHT, one["end"] + 4.0)
    highest = max(_HEIGHT, _NAME_HEIGHT * len(order))
    for one in reversed(order):  # back into the plot
        one["name_y"] = round(min(one["name_y"], highest), 1)
        highest = one["name_y"] - _NAME_HEIGHT
    return trackers


def _height(rate: float) -> float:
    return 8.0 + (_HEIGHT - 16.0) * (1.0 - rate)


def _firsts(limits: Sequence[Limit]) -> list[dict[str, Any]]:
    """For every scenario and tracker its axes, by what breaks it first in typical levels, as bars [percent]."""
    groups = grouped((one for one in limits if one.typical is not None), lambda one: (one.scenario, one.tracker))
    most = max((one.range[1] / one.typical for own in groups.values() for one in own if one.typical), default=1.0)

    def share(level: float, typical: float) -> float:
        """Bars are logarithmic, from a 16th of what is typical on."""
        return round(100.0 * min(1.0, max(0.0, math.log(16.0 * level / typical) / math.log(16.0 * most))), 1)

    def bar(one: Limit) -> dict[str, Any]:
        assert one.typical is not None
        reached = one.breaking_point
        if reached is None:
            reached = one.range[1] if one.verdict == "never breaks within the range" else one.low or 0.0
        ends = (one.low or one.range[0], one.high or one.range[1])
        return {
            "axis": one.axis,
            "text": f"{point_text(one)} {one.unit}" if one.breaking_point is not None else _cell(one),
            "times": f"{reached / one.typical:.2g}" if reached else "0",
            "bar": share(reached, one.typical) if reached else 0.0,
            "ends": [share(end, one.typical) for end in ends] if one.verdict == "breaks" else None,
            "sort": reached / one.typical,
        }

    return [
        {"scenario": scenario, "tracker": tracker, "typical": share(1.0, 1.0),
         "bars": sorted(map(bar, own), key=lambda one: one["sort"])}
        for (scenario, tracker), own in groups.items()
    ]  # fmt: skip
