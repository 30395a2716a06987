"""When an episode counts as a success: `overlap >= 0.5 for 90 % of the episode`, or `followed to the end`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

from pftrack_sim.benchmark.asked.plan import EpisodeKind
from pftrack_sim.benchmark.reading.store import RunStore
from pftrack_sim.core.errors import ParameterError, UnknownNameError
from pftrack_sim.core.text import one_line

TRACKED = "overlap >= 0.5 for 90 % of the episode"
FOLLOWED = "followed to the end"

MEASURES: Mapping[str, str] = MappingProxyType({"overlap": ">=", "centre_error_px": "<="})
"""Columns of a frame that a success may be made of, and on which side of a bound they are good."""

_FORM = re.compile(r"(\w+)\s*(>=|<=|[<>=]+)\s*(\d+(?:\.\d*)?|\.\d+)\s+for\s+(\d+(?:\.\d*)?)\s*%\s+of\s+the\s+episode")
_SHARE = """
SELECT scenario, condition, seed, label, bool_and({whole}) AND 100 * count(*) FILTER ({good}) >= {percent} * count(*)
FROM (SELECT *, min(frame) FILTER (scored) OVER (PARTITION BY scenario, condition, seed, label) AS first FROM frames)
JOIN summary USING (scenario, condition, seed, label)
WHERE scored AND frame > first GROUP BY ALL
"""
_WHOLE: Mapping[EpisodeKind, str] = MappingProxyType({"open": "true", "follow": "outcome = 'finished'"})
"""Whether an episode is whole: of a drive that ends early, frames are missing, which cannot be good."""

_FOLLOWED = "SELECT scenario, condition, seed, label, follow_success = 1 FROM summary"

Outcomes: TypeAlias = Mapping[tuple[str, str, int, str], bool]
"""Whether a tracker succeeded, by scenario, condition, seed and the tracker's label; unknown where it never could."""


@dataclass(frozen=True)
class Success:
    """A criterion: its words, and the query that applies it to every episode of a run."""

    text: str
    query: str

    def outcomes(self, store: RunStore) -> Outcomes:
        """The outcomes of all episodes that are there.

        The frames that count are those in which the target can be seen, without the first one.
        """
        rows = store.query(self.query).rows
        return {(scenario, condition, seed, label): bool(good) for scenario, condition, seed, label, good in rows}


def parse_success(text: str | None, kind: EpisodeKind) -> Success:
    """A criterion as it is typed; None: `TRACKED`, in closed loop `FOLLOWED`.

    Raises:
        ParameterError: Another form, or a bound or share that is never or always reached.
        UnknownNameError: Another measure.

    >>> parse_success("overlap >= 0.3 for 80% of the episode", "open").text
    'overlap >= 0.3 for 80 % of the episode'
    """
    words = " ".join((text if text is not None else FOLLOWED if kind == "follow" else TRACKED).split())
    if words == FOLLOWED:
        if kind == "open":
            raise ParameterError(f"{FOLLOWED!r} is a success of the robot: it needs --follow")
        return Success(words, _FOLLOWED)
    match = _FORM.fullmatch(words)
    if not match:
        raise ParameterError(
            f"--success takes MEASURE >= X for Y % of the episode, such as {TRACKED!r}, or with --follow {FOLLOWED!r}; "
            f"got {one_line(words, 80)!r}"
        )
    measure, sign, bound, percent = match.groups()
    if measure not in MEASURES:
        raise UnknownNameError("measure of --success", measure, MEASURES)
    if sign != MEASURES[measure]:
        raise ParameterError(f"{measure} is good where it is {MEASURES[measure]} a bound, got {sign!r}")
    if measure == "overlap" and not 0.0 < float(bound) <= 1.0:
        raise ParameterError(f"an overlap lies between 0 and 1, and 0 is always reached; got {bound}")
    if not 0.0 < float(percent) <= 100.0:
        raise ParameterError(f"the share of the episode must be above 0 and at most 100 %, got {percent} %")
    # DuckDB takes NaN for the greatest number.
    good = f"{measure} {sign} {bound} AND NOT isnan({measure})"
    return Success(
        f"{measure} {sign} {bound} for {percent} % of the episode",
        _SHARE.format(good=good, percent=percent, whole=_WHOLE[kind]),
    )
