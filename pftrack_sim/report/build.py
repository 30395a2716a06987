"""Write the report: the page of a run, or of scored result files with sequences in the place of seeds."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

import plotly.offline  # pyright: ignore[reportMissingTypeStubs]
from markupsafe import Markup

import pftrack_sim
from pftrack_sim import score
from pftrack_sim.benchmark import Result, RunStore
from pftrack_sim.benchmark.asked.suite import Suite
from pftrack_sim.benchmark.datasets.results import Scored
from pftrack_sim.benchmark.kept.files import csv_text, write_bytes
from pftrack_sim.benchmark.reference.standing import standings
from pftrack_sim.benchmark.said.claims import evaluate_claims
from pftrack_sim.benchmark.said.readings import misread_trackers
from pftrack_sim.core.arguments import checked
from pftrack_sim.core.errors import RunError
from pftrack_sim.report.contents import contents, scored_contents
from pftrack_sim.report.html import render, write_page
from pftrack_sim.report.standing import standing_remarks, standing_tables
from pftrack_sim.report.strips import strips
from pftrack_sim.report.tables import Table, anchors, benchmark_table, claim_text, paper_tables

_SESSION_KEYS = ("began", "command", "commit", "versions", "python", "platform")


@checked
def write_report(path: Path, *, on_episode: Callable[[], None] = lambda: None) -> Path:
    """Write `report.html` into a run folder.

    The page needs nothing but itself and the videos beside it; it opens from disk, without a network.

    Args:
        path: The run folder.
        on_episode: Called after every episode that was read.

    Returns:
        The page's path.

    Raises:
        RunError: No complete run folder, or one that cannot be written to.
    """
    store = RunStore(path)
    page = _render(
        store.path.resolve().name,
        contents(store, on_episode),
        len({result.seed for result in store.results}) > 1,
        strips=strips(store),
        misread=misread_trackers(store),
        benchmarks=[*((table, ()) for table in anchors(store)), *_standing(store)],
        suites=[_suite(suite, store.results) for suite in store.plan.suites],
        how=_provenance(store),
        scenarios={name: scenario.digest for name, scenario in store.plan.scenarios.items()},
        errors=[result for result in store.results if result.error],
    )
    return write_page(path / "report.html", page)


def write_scored(found: Scored, out: Path, sources: Mapping[str, str]) -> Path:
    """Write `report.html` and `results.csv`, a row for each result file, into a folder.

    Args:
        found: The scores.
        out: The folder; other files in it stay.
        sources: What was scored, by name, for the page's provenance.

    Returns:
        The page's path.

    Raises:
        RunError: The folder is a file, or cannot be written to.
    """
    if out.exists() and not out.is_dir():
        raise RunError(f"{out} is not a folder")
    rows = [
        {"tracker": one.tracker.label, "sequence": one.sequence, "repetition": one.seed, **asdict(one.summary)}
        for one in found.results
    ]
    how = [*sources.items(), ("version", pftrack_sim.__version__)]
    contents, benchmark = scored_contents(found), benchmark_table(found)
    several = len(contents["scenarios"]) > 1
    benchmarks = [(benchmark, ())] if benchmark else []
    page = _render(out.resolve().name, contents, several, benchmarks=benchmarks, how=how, misread=found.misread)
    write_bytes(out / "results.csv", csv_text(list(rows[0]), [list(row.values()) for row in rows]).encode())
    return write_page(out / "report.html", page)


def _render(title: str, data: Mapping[str, Any], several: bool, **values: Any) -> str:
    """The page of `data`, see `contents`; what is not in `values` is left out. Of several units there are intervals."""
    nothing: dict[str, Any] = {
        "misread": (),
        "strips": (),
        "suites": (),
        "scenarios": {},
        "errors": (),
        "benchmarks": (),
    }
    return render(
        "report",
        ["report.js", "viewer.js", "drives.js", plotly.offline.get_plotlyjs(), "drawn.js"],
        title=title,
        has_drives=bool(data["drives"]),
        of_run=data["unit"] == "seed",
        unit=data["unit"],
        brackets=f"; in brackets {score.INTERVALS}" if several else "",
        verdicts=score.VERDICTS,
        least_seeds=score.LEAST_FOR_INTERVAL,
        data=Markup(_script_json(data)),
        definitions=[*score.DEFINITIONS.items(), *(score.FOLLOWING_DEFINITIONS.items() if data["drives"] else ())],
        people=score.PEOPLE_DEFINITIONS if data["people"] else {},
        loss=data["loss"],
        tags=data["tags"],
        **{**nothing, **values},
    )


def _standing(store: RunStore) -> Iterator[tuple[Table, Sequence[str]]]:
    """Tables of where the trackers stand on the frozen suites of a run, the last of each with what is to be said."""
    for found in standings(store):
        *tables, last = standing_tables(found)
        yield from ((table, ()) for table in tables)
        yield last, list(standing_remarks(found, str(store.path)))


def _provenance(store: RunStore) -> list[tuple[str, str]]:
    """The record of the last session, and the renderers of all."""
    session = store.record.sessions[-1].model_dump() if store.record.sessions else {}
    entries = [(name, _words(session[name])) for name in _SESSION_KEYS if session.get(name)]
    graphics = dict.fromkeys(str(result.values["graphics"]) for result in store.results)
    seeds = sorted({result.seed for result in store.results})
    state = "all episodes" if store.finished else "not finished: these are the episodes so far"
    return [("state", state), *entries, ("graphics", "; ".join(graphics)), ("seeds", _words(seeds))]


def _script_json(data: Mapping[str, Any]) -> str:
    """JSON that cannot end the script element around it, whatever names contain."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _words(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {item}" for key, item in cast("Mapping[str, object]", value).items())
    if isinstance(value, list):
        items = cast("list[object]", value)
        return " ".join(str(item) for item in items) if len(items) <= 40 else f"{len(items)} of them"
    return str(value)


def _suite(suite: Suite, results: Sequence[Result]) -> dict[str, Any]:
    """The paper's table beside the results, and the tested claims."""
    claims = [
        (one.statement, one.preset, one.verdict, [f"{claim_text(part)}: {part.verdict}" for part in one.comparisons])
        for one in evaluate_claims(suite, results)
    ]
    tables = list(paper_tables(suite, results))
    return {"title": suite.title, "source": suite.source, "tables": tables, "claims": claims}
