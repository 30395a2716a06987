"""A suite's tables and claims, as words."""

from __future__ import annotations

import math
from typing import Any

from pftrack_sim.benchmark.claims import Part, TableRow, beside_the_paper, judge
from pftrack_sim.benchmark.suite import Suite
from pftrack_sim.report.data import Run


def told(suite: Suite, run: Run) -> dict[str, Any]:
    """What the page says of a suite.

    Args:
        suite: One of the plan's.
        run: Its results.
    """
    rows = [row.values for row in run.rows]
    beside = beside_the_paper(suite, rows)
    table = None
    if suite.table is not None:
        table = {
            "title": suite.table.title,
            "columns": suite.table.columns,
            "rows": [{"tracker": row.tracker, "cells": _cells(row)} for row in beside],
        }
    return {
        "title": suite.title,
        "source": suite.source,
        "table": table,
        "claims": [
            {"says": one.says, "verdict": one.verdict, "parts": [part_in_words(part) for part in one.parts]}
            for one in judge(suite, rows)
        ],
    }


def part_in_words(part: Part) -> str:
    """`"ko2012 - ko2012-rgb: 0.053 [0.021, 0.084] (holds, 20 seeds)"`."""
    return (
        f"{part.what}: {_number(part.difference, 3)} [{_number(part.low, 3)}, {_number(part.high, 3)}] "
        f"({part.verdict}, {part.seeds} seeds)"
    )


def _cells(row: TableRow) -> list[dict[str, str]]:
    cells = [
        {
            "printed": _number(printed, 1),
            "ours": _number(ours, 1),
            "interval": f"{_number(low, 1)} to {_number(high, 1)}",
        }
        for printed, ours, low, high in zip(row.printed, row.ours, row.low, row.high, strict=True)
    ]
    mean, low, high = row.ours_mean
    printed = sum(row.printed) / len(row.printed)
    overall = {
        "printed": _number(printed, 1),
        "ours": _number(mean, 1),
        "interval": f"{_number(low, 1)} to {_number(high, 1)}",
    }
    return [*cells, overall]


def _number(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"
