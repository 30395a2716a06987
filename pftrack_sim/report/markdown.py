"""Tables of runs as Markdown, written into documents between markers that name the run folder."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

from pftrack_sim import score
from pftrack_sim.benchmark import Result, RunStore
from pftrack_sim.benchmark.asked.suite import Suite
from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.benchmark.limits.found import LIMITS, read_limits
from pftrack_sim.benchmark.reference.standing import board
from pftrack_sim.benchmark.said.claims import REFERENCES, evaluate_claims
from pftrack_sim.core.errors import RunError
from pftrack_sim.report.limits import breaking_tables
from pftrack_sim.report.profiles import changes_or_tiers
from pftrack_sim.report.standing import standing_tables
from pftrack_sim.report.tables import (
    Table,
    anchors,
    axes,
    claim_text,
    following,
    grouped,
    number_text,
    over_seeds,
    paper_tables,
    people,
    place_of,
    range_text,
    row_name,
)
from pftrack_sim.scenario.axes import axes_by_name

_BLOCK = re.compile(
    r"(?P<begin><!-- (?P<kind>tables|list) of (?P<name>[^\s>]+) -->\n).*?(?P<end><!-- end -->)", re.DOTALL
)

_MOST_COLUMNS = 12
"""Columns, for scenarios and conditions, above which a table of overlaps has none."""

_BESIDE_OVERLAP = {
    "skill": "skill",
    "tracked at >= 0.5": "success",
    ">= 0.3": "success_30",
    "centre inside": "centre_inside",
}


def update_document(document: Path, runs: Path, only: str | None = None) -> tuple[list[str], list[str]]:
    """Replace every block `<!-- tables of NAME -->` ... `<!-- end -->` by the tables of the folder `runs/NAME`.

    The folder is that of a run, of `limit`, or of `profile`: of conditions, or of scenarios, which are shown by tier.
    Where there is none, NAME may be a frozen suite: its reference results are shown. A block `<!-- list of axes -->`
    gets the stress axes, `<!-- list of measures -->` the definitions of the tables' columns.

    Args:
        document: Markdown file.
        runs: Folder that holds the run folders.
        only: Name of the one block of a folder that is replaced; None: all.

    Returns:
        Names of the blocks written, and of those left as they are because there is no such folder.

    Raises:
        RunError: The document cannot be read or written, has no block, or a run folder cannot be read.
    """
    try:
        text = document.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RunError(f"{document} cannot be read: {getattr(error, 'strerror', error)}") from None
    written: list[str] = []
    kept: list[str] = []

    def replaced(block: re.Match[str]) -> str:
        name, is_list = block["name"], block["kind"] == "list"
        if not is_list and only not in (None, name):
            return block[0]
        body = _list(name) if is_list else _tables_of(runs, name)
        if body is None:
            kept.append(name)
            return block[0]
        written.append(name)
        return f"{block['begin']}\n{body}\n{block['end']}"

    updated = _BLOCK.sub(replaced, text)
    if not written and not kept:
        raise RunError(f"{document} has no block <!-- tables of NAME --> ... <!-- end -->")
    write_bytes(document, updated.encode())
    return written, kept


def _tables_of(runs: Path, name: str) -> str | None:
    """Tables of the folder of a name, or of the suite that has it; None for neither."""
    folder = runs / name
    if (folder / "profile.json").is_file():
        heads, *rows = changes_or_tiers(folder / "profile.json")
        return _table(heads, rows)
    if (folder / LIMITS).is_file():
        return "\n".join(map(_markdown, breaking_tables(read_limits(folder))))
    if (folder / "run.json").is_file():
        return tables(RunStore(folder))
    found = board(name)
    return None if found is None else "".join(map(_markdown, standing_tables(found)))


def _list(name: str) -> str | None:
    """The stress axes, with what severity 1 is, or the definitions of the tables' columns; None for another name."""
    if name == "axes":
        rows = [
            [f"`{one}`", f"{axis(severity=1.0).physical:.3g} {axis.unit}", axis.law, axis.source]
            for one, axis in axes_by_name().items()
        ]
        return _table(["Axis", "severity 1", "law", "reference"], rows)
    if name != "measures":
        return None
    kinds = {
        "Overlap": score.DEFINITIONS,
        "Following": score.FOLLOWING_DEFINITIONS,
        "Everybody in view": score.PEOPLE_DEFINITIONS,
    }
    return "".join(
        f"- {kind}: {'; '.join(f'*{word}*: {meaning}' for word, meaning in words.items())}.\n"
        for kind, words in kinds.items()
    )


def tables(store: RunStore) -> str:
    """Tables of a run: of overlaps, of following, of everybody in view, and of its suites with their claims."""
    results, suites = store.results, store.plan.suites
    places = list(dict.fromkeys(place_of(result) for result in results))
    wide = len(places) > _MOST_COLUMNS or any(suite.tables for suite in suites)
    found = [*axes(store), *anchors(store), *following(results), *people(results)]
    parts = [_overlaps(results, [] if wide else places), *map(_markdown, found)]
    for suite in suites:
        parts += [_markdown(one) for one in paper_tables(suite, results)]
        parts += _claims(suite, results)
    return "\n".join(parts)


def _overlaps(results: Sequence[Result], places: Sequence[str]) -> str:
    """Overlap by tracker in descending order, at each place and over all, and what stands beside it.

    In open loop the references are rows, since all trackers have the same frames.
    """
    closed = results[0].following is not None
    beside = {**_BESIDE_OVERLAP, **({_words(name): name for name in REFERENCES} if closed else {})}

    def cells(measure: str, own: Sequence[Result]) -> list[str]:
        return [number_text(over_seeds(measure, [one for one in own if place_of(one) == name]).mean) for name in places]

    rows: list[tuple[float, list[str]]] = []
    for label, own in grouped(results, lambda one: one.label).items():
        mean = score.mean_summary([result.measures for result in own])
        others = [number_text(getattr(mean, name)) for name in beside.values()]
        overall = over_seeds("mean_overlap", own)
        known = [*cells("mean_overlap", own), str(overall.seeds), range_text(overall)]
        rows.append((overall.mean, [f"`{row_name(label, own)}`", *known, *others]))
    rows.sort(key=lambda row: (math.isnan(row[0]), -row[0]))
    references = [
        [_words(name), *cells(name, results), str(found.seeds), number_text(found.mean), *["-"] * len(beside)]
        for name, found in ((name, over_seeds(name, results)) for name in (() if closed else REFERENCES))
    ]
    return _table(["Mean overlap", *places, "seeds", "mean", *beside], [*(row for _, row in rows), *references])


def _words(name: str) -> str:
    return name.replace("_", " ")


def _markdown(table: Table) -> str:
    """A table with its title as the head of its first column; definitions are elsewhere in the document."""
    of_trackers = table.names[-1].startswith("tracker")

    def cells(row: Sequence[str]) -> list[str]:
        *place, name = row[: len(table.names)]
        return [", ".join([*place, f"`{name}`" if of_trackers else name]), *row[len(table.names) :]]

    return _table([table.title, *table.numbers], [cells(row) for row in table.rows])


def _claims(suite: Suite, results: Sequence[Result]) -> list[str]:
    rows = [
        [claim.statement, claim.preset, claim.verdict, "; ".join(map(claim_text, claim.comparisons))]
        for claim in evaluate_claims(suite, results)
    ]
    heads = ["Claim of the paper", "Preset", "Verdict", "Difference (95 % interval over seeds)"]
    return [_table(heads, rows)] if rows else []


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |\n" for line in lines)
