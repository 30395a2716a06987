"""Write the report page of a run."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

import jinja2
import plotly.offline  # pyright: ignore[reportMissingTypeStubs]
from markupsafe import Markup

from pftrack_sim import score
from pftrack_sim.benchmark import Result, RunStore
from pftrack_sim.benchmark.asked.suite import Suite
from pftrack_sim.benchmark.kept.checksums import update_sum
from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.benchmark.said.claims import evaluate_claims
from pftrack_sim.report.contents import contents
from pftrack_sim.report.strips import strips
from pftrack_sim.report.tables import Table, claim_text, paper_table

_PAGE = Path(__file__).parent / "page"
_SESSION_KEYS = ("began", "command", "commit", "versions", "python", "platform")


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
    page = _page(store, contents(store, on_episode))
    target = path / "report.html"
    write_bytes(target, page.encode())
    update_sum(path, target.name)
    return target


def _page(store: RunStore, data: Mapping[str, Any]) -> str:
    return render_page(
        store.path.resolve().name,
        data,
        strips=[asdict(one) for one in strips(store)],
        suites=[_suite(suite, store.results) for suite in store.plan.suites],
        how=_provenance(store),
        scenarios=_hashes(store),
        errors=[result for result in store.results if result.error],
    )


def render_page(
    title: str,
    data: Mapping[str, Any],
    *,
    how: Sequence[tuple[str, str]],
    strips: Sequence[Mapping[str, Any]] = (),
    suites: Sequence[Mapping[str, Any]] = (),
    scenarios: Sequence[tuple[str, str]] = (),
    errors: Sequence[Result] = (),
    benchmark: Table | None = None,
) -> str:
    """The page as HTML.

    Args:
        title: Of the page.
        data: What the page's scripts draw; see `contents`.
        how: Names and words of the provenance.
        strips: Film strips.
        suites: Tables and claims of papers.
        scenarios: Scenarios with their hashes.
        errors: Results of trackers that failed.
        benchmark: What the scorer of a data set's own benchmark computes.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_PAGE), autoescape=True, undefined=jinja2.StrictUndefined
    )
    return environment.get_template("report.html.j2").render(
        title=title,
        style=Markup((_PAGE / "report.css").read_text(encoding="utf-8")),
        scripts=[Markup((_PAGE / f"{name}.js").read_text(encoding="utf-8")) for name in ("report", "viewer", "drives")],
        has_drives=bool(data["drives"]),
        of_run=data["unit"] == "seed",
        plotly=Markup(plotly.offline.get_plotlyjs()),
        data=Markup(_script_json(data)),
        definitions=score.DEFINITIONS,
        following=score.FOLLOWING_DEFINITIONS,
        people=score.PEOPLE_DEFINITIONS if data["people"] else {},
        loss=data["loss"],
        tags=data["tags"],
        strips=strips,
        suites=suites,
        how=how,
        scenarios=scenarios,
        errors=errors,
        benchmark=benchmark,
    )


def _provenance(store: RunStore) -> list[tuple[str, str]]:
    """The record of the last session, and the renderers of all."""
    session = next(reversed(store.record["sessions"]), dict[str, Any]())
    entries = [(name, _words(session[name])) for name in _SESSION_KEYS if session.get(name)]
    entries.insert(0, ("checksums", "not verified: no SHA256SUMS" if store.sums is None else "verified"))
    graphics = dict.fromkeys(str(result.values["graphics"]) for result in store.results)
    seeds = sorted({result.seed for result in store.results})
    state = "all episodes" if store.finished else "not finished: these are the episodes so far"
    return [("state", state), *entries, ("graphics", "; ".join(graphics)), ("seeds", _words(seeds))]


def _hashes(store: RunStore) -> list[tuple[str, str]]:
    """Each scenario with the SHA-256 of its content."""
    return [(name, scenario.digest) for name, scenario in store.plan.scenarios.items()]


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
        (one.statement, one.verdict, [f"{claim_text(part)}: {part.verdict}" for part in one.comparisons])
        for one in evaluate_claims(suite, results)
    ]
    tables = list(paper_table(suite, results))
    return {"title": suite.title, "source": suite.source, "tables": tables, "claims": claims}
