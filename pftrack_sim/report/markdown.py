"""Tables of runs as Markdown, written into documents between markers that name the run folder."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from pftrack_sim import score
from pftrack_sim.benchmark import Result, RunStore
from pftrack_sim.benchmark.asked.suite import Suite
from pftrack_sim.benchmark.claims import REFERENCES, Interval, compare_with_paper, evaluate_claims
from pftrack_sim.benchmark.degradation import TITLES, degradation, table_rows
from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.core import random_streams
from pftrack_sim.core.errors import RunError
from pftrack_sim.report.axes import axes_rows
from pftrack_sim.report.profile_tables import profile_table

_BLOCK = re.compile(r"(?P<begin><!-- tables of (?P<name>[^\s>]+) -->\n)(?P<body>.*?)(?P<end><!-- end -->)", re.DOTALL)

_LIST = re.compile(
    r"(?P<begin><!-- list of (?P<name>axes|measures) -->\n)(?P<body>.*?)(?P<end><!-- end -->)", re.DOTALL
)

_FOLLOWING = {
    "success": "success",
    "tracked": "tracking_rate",
    "within": "within",
    "collided": "collision",
    "RMS of distance [m]": "distance_rms_m",
    "RMS of bearing [deg]": "bearing_rms_deg",
}
_PROPORTIONS = ("success", "collision")

_COVERING = ("occlusion", "distractors")
"""Axes that hide the target, over which recoveries are shown."""

_MOST_COLUMNS = 12
"""Columns, for scenarios and conditions, above which the table of overlaps is too wide to read and left out."""

_BESIDE_OVERLAP = {
    "skill": "skill",
    "tracked at >= 0.5": "success",
    ">= 0.3": "success_30",
    "centre inside": "centre_inside",
}


def update_document(document: Path, runs: Path) -> tuple[list[str], list[str]]:
    """Replace every block `<!-- tables of NAME -->` ... `<!-- end -->` by the tables of the folder `runs/NAME`.

    The folder is that of a run, or of `profile`: of conditions, or of scenarios, which are shown by tier. A block
    `<!-- list of axes -->` gets the stress axes, `<!-- list of measures -->` the definitions of the tables' columns.

    Args:
        document: Markdown file.
        runs: Folder that holds the run folders.

    Returns:
        Names of the blocks written, and of those left as they are because there is no such folder.

    Raises:
        RunError: The document cannot be read or written, has no block, or a run folder cannot be read.
    """
    try:
        text = document.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RunError(f"{document} cannot be read: {error}") from None
    written: list[str] = []
    kept: list[str] = []

    def replaced(block: re.Match[str]) -> str:
        folder = runs / block["name"]
        if (folder / "profile.json").is_file():
            heads, *rows = profile_table(folder / "profile.json")
            body = _table(heads, rows)
        elif (folder / "run.json").is_file():
            body = tables(RunStore(folder))
        else:
            kept.append(block["name"])
            return block[0]
        written.append(block["name"])
        return f"{block['begin']}\n{body}\n{block['end']}"

    def listed(block: re.Match[str]) -> str:
        written.append(block["name"])
        body = _measures() if block["name"] == "measures" else _axes_list()
        return f"{block['begin']}\n{body}\n{block['end']}"

    updated = _LIST.sub(listed, _BLOCK.sub(replaced, text))
    if not written and not kept:
        raise RunError(f"{document} has no block <!-- tables of NAME --> ... <!-- end -->")
    write_bytes(document, updated.encode())
    return written, kept


def _axes_list() -> str:
    return _table(["Axis", "severity 1", "law", "reference"], list(axes_rows()))


def _measures() -> str:
    """The definitions of the tables' columns, a line for each kind of table."""
    kinds = {
        "Overlap": score.DEFINITIONS,
        "Following": score.FOLLOWING_DEFINITIONS,
        "Everybody in view": score.PEOPLE_DEFINITIONS,
    }
    return "".join(
        f"- {kind}: {'; '.join(f'*{name}*: {meaning}' for name, meaning in words.items())}.\n"
        for kind, words in kinds.items()
    )


def tables(store: RunStore) -> str:
    """Tables of a run: of overlaps, of following, of everybody in view, and of its suites with their claims."""
    results = store.results
    columns = list(dict.fromkeys(_column(result) for result in results))
    wide = len(columns) > _MOST_COLUMNS or any(suite.table for suite in store.plan.suites)
    parts = [_overlaps(results, [] if wide else columns), *_axes(store)]
    if any(result.following for result in results):
        parts.append(_following(results))
    if any(not math.isnan(result.number("hota")) for result in results):
        parts.append(_people(results))
    for suite in store.plan.suites:
        parts += _suite(suite, results)
    return "\n".join(parts)


def _suite(suite: Suite, results: Sequence[Result]) -> Iterator[str]:
    if suite.table is not None:
        heads = [name.rpartition("/")[2] for name in suite.table.columns]
        rows: list[list[str]] = []
        for row in compare_with_paper(suite, results):
            ours = [*(number_text(one[0], 1) for one in row.ours[:-1]), _ranged(row.ours[-1], 1)]
            cells = [f"{number_text(printed, 1)} / {own}" for printed, own in zip(row.printed, ours, strict=True)]
            rows.append([f"`{row.tracker}`", *cells])
        yield _table([f"{suite.table.title}: printed / simulated", *heads, "mean"], rows)
    claims = evaluate_claims(suite, results)
    if claims:
        rows = [
            [
                claim.statement,
                claim.verdict,
                "; ".join(f"{one.name} {_ranged((one.difference, one.low, one.high), 3)}" for one in claim.comparisons),
            ]
            for claim in claims
        ]
        yield _table(["Claim of the paper", "Verdict", "Difference (95 % interval over seeds)"], rows)


def _overlaps(results: Sequence[Result], columns: Sequence[str]) -> str:
    """Overlap by tracker in descending order, in each scenario and condition and over all, and what stands beside it.

    In open loop the references are rows, since all trackers have the same frames.
    """
    closed = results[0].following is not None
    beside = {**_BESIDE_OVERLAP, **({name: name for name in REFERENCES} if closed else {})}

    def cells(measure: str, own: Sequence[Result]) -> list[str]:
        means = [interval(measure, [one for one in own if _column(one) == name])[0] for name in columns]
        return [number_text(mean, 3) for mean in means]

    rows: list[tuple[float, list[str]]] = []
    for label in dict.fromkeys(result.label for result in results):
        own = [result for result in results if result.label == label]
        mean = score.mean_summary([result.measures for result in own])
        overall = _ranged(interval("mean_overlap", own), 3)
        others = [number_text(getattr(mean, name), 3) for name in beside.values()]
        rows.append((mean.mean_overlap, [f"`{label}`", *cells("mean_overlap", own), overall, *others]))
    rows.sort(key=lambda row: (math.isnan(row[0]), -row[0]))
    references = [
        [name, *cells(name, results), number_text(interval(name, results)[0], 3), *["-"] * len(beside)]
        for name in (() if closed else REFERENCES)
    ]
    return _table(["Mean overlap", *columns, "mean", *beside], [*(row for _, row in rows), *references])


def _axes(store: RunStore) -> Iterator[str]:
    """Scores over every axis with at least two levels, a row for each."""
    found = degradation(store).curves
    for measure, title in TITLES.items():
        rows = table_rows(found, measure)
        if measure == "recovered":
            rows = [row for row in rows if row.at.axis.split()[-1] in _COVERING]
        if rows:
            labels = list(rows[0].means)
            cells = [
                [
                    f"{row.at.axis}",
                    f"{row.at.level:g}",
                    f"{row.at.x:g}",
                    *(number_text(row.means[one], 3) for one in labels),
                ]
                for row in rows
            ]
            yield f"{title}:\n\n" + _table(["Axis", "level", "in its unit", *labels], cells)


def _following(results: Sequence[Result]) -> str:
    """Measures of following by scenario, condition and tracker."""
    rows: list[list[str]] = []
    for column, label in dict.fromkeys((_column(result), result.label) for result in results):
        own = [result for result in results if (_column(result), result.label) == (column, label)]
        cells = [_ranged(interval(f"follow_{name}", own, name in _PROPORTIONS), 2) for name in _FOLLOWING.values()]
        rows.append([f"{column}, `{label}`", str(len(own)), *cells])
    return _table(["Following", "seeds", *_FOLLOWING], rows)


def _people(results: Sequence[Result]) -> str:
    """Scores of everybody in view by scenario, condition and tracker of several people."""
    groups: dict[tuple[str, str], list[Result]] = {}
    for result in results:
        if not math.isnan(result.number("hota")):
            groups.setdefault((_column(result), result.label), []).append(result)
    rows = [
        [
            f"{column}, `{label}`",
            str(len(own)),
            *(
                _ranged(interval(name.lower(), own), 1 if name == "switches" else 3)
                for name in score.PEOPLE_DEFINITIONS
            ),
        ]
        for (column, label), own in groups.items()
    ]
    return _table(["Everybody in view", "seeds", *score.PEOPLE_DEFINITIONS], rows)


def _column(result: Result) -> str:
    return result.scenario if not result.condition.levels else f"{result.scenario} {result.condition.name}"


def interval(measure: str, results: Sequence[Result], proportion: bool = False) -> Interval:
    """Mean of a measure over results that have it, and its 95 % interval; NaN where none has."""
    values = [value for result in results if not math.isnan(value := result.number(measure))]
    if not values:
        return math.nan, math.nan, math.nan
    rng = random_streams.stream(0, "bootstrap")
    low, high = score.proportion_interval(values) if proportion else score.bootstrap_interval(values, rng)
    return sum(values) / len(values), low, high


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |\n" for line in lines)


def _ranged(interval: Interval, digits: int) -> str:
    mean, low, high = (number_text(value, digits) for value in interval)
    return mean if low == "-" else f"{mean} ({low} to {high})"


def number_text(value: float, digits: int) -> str:
    """A number with so many decimals, or `-` for NaN."""
    return "-" if math.isnan(value) else f"{value:.{digits}f}"
