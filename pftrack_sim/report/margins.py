"""Margins: breaking points over the levels that were measured in a robot's own video."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pftrack_sim.benchmark.limits.found import Limit
from pftrack_sim.measuring.measured import Level
from pftrack_sim.report.tables import Table


def margin_table(limits: Sequence[Limit], measured: Mapping[str, Level]) -> Table | None:
    """A row for each breaking point on an axis that was measured; None without any."""
    rows = [
        [
            f"{one.scenario}, {one.axis} [{one.unit}]",
            one.tracker,
            f"{level.level:.3g} ({level.low:.3g} to {level.high:.3g})",
            _point(one),
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
        return f"above {one.range[1] / level.high:.2g}"
    if one.breaking_point is None or one.verdict != "breaks":
        ceiling = one.high if one.verdict in ("breaks", "breaks below the lowest level") else None
        return "-" if ceiling is None or level.low <= 0.0 else f"below {ceiling / level.low:.2g}"
    ratio = one.breaking_point / level.level
    below = above = math.inf
    if one.low is not None:
        below = math.hypot(math.log(one.breaking_point / one.low), math.log(level.high / level.level))
    if one.high is not None and level.low > 0.0:
        above = math.hypot(math.log(one.high / one.breaking_point), math.log(level.level / level.low))
    ends = f"{ratio * math.exp(-below):.2g} to {'any' if math.isinf(above) else f'{ratio * math.exp(above):.2g}'}"
    return f"{ratio:.2g} ({ends})"


def _point(one: Limit) -> str:
    if one.verdict != "breaks" or one.breaking_point is None:
        return one.verdict
    ends = ["?" if end is None else f"{end:.3g}" for end in (one.low, one.high)]
    return f"{one.breaking_point:.3g} ({ends[0]} to {ends[1]})"
