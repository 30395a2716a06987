"""Tables and claims of a suite, as text for the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pftrack_sim.benchmark import Result
from pftrack_sim.benchmark.claims import ClaimComparison, Interval, compare_with_paper, evaluate_claims
from pftrack_sim.benchmark.suite import Suite


def suite_contents(suite: Suite, results: Sequence[Result]) -> dict[str, Any]:
    """The paper's table beside the results, and the tested claims."""
    rows: list[dict[str, Any]] = []
    for row in compare_with_paper(suite, results):
        cells = [_cell(*pair) for pair in zip(row.printed, row.ours, strict=True)]
        rows.append({"tracker": row.tracker, "cells": cells})
    claims: list[dict[str, Any]] = []
    for claim in evaluate_claims(suite, results):
        comparisons = [comparison_text(one) for one in claim.comparisons]
        claims.append({"statement": claim.statement, "verdict": claim.verdict, "comparisons": comparisons})
    table = None
    if suite.table is not None:
        table = {"title": suite.table.title, "columns": suite.table.columns, "rows": rows}
    return {"title": suite.title, "source": suite.source, "table": table, "claims": claims}


def comparison_text(one: ClaimComparison) -> str:
    """`"ko2012 - ko2012-rgb: 0.053 [0.021, 0.084] (holds, 20 seeds)"`."""
    interval = f"{_number(one.difference, 3)} [{_number(one.low, 3)}, {_number(one.high, 3)}]"
    return f"{one.name}: {interval} ({one.verdict}, {one.seeds} seeds)"


def _cell(printed: float, ours: Interval) -> dict[str, str]:
    mean, low, high = (_number(value, 1) for value in ours)
    return {"printed": _number(printed, 1), "ours": mean, "interval": f"{low} to {high}"}


def _number(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"
