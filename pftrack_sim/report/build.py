"""Put the page together."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import jinja2
import plotly.offline
from markupsafe import Markup

from pftrack_sim.core.errors import RunError
from pftrack_sim.report.contents import contents
from pftrack_sim.report.data import Run, read_run
from pftrack_sim.report.strips import strips
from pftrack_sim.report.suites import told
from pftrack_sim.scenario import Scenario

_PAGE = Path(__file__).parent / "page"
_HOW = ("began", "command", "commit", "versions", "python", "platform")


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
    run = read_run(path)
    page = _page(run, contents(run, on_episode))
    target, part = path / "report.html", path / ".report.html.part"
    try:
        part.write_text(page, encoding="utf-8")
        os.replace(part, target)
    except OSError as error:
        raise RunError(f"cannot write {target}: {error.strerror or error}") from None
    return target


def _page(run: Run, data: Mapping[str, Any]) -> str:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_PAGE), autoescape=True, undefined=jinja2.StrictUndefined
    )
    return environment.get_template("report.html.j2").render(
        title=run.path.resolve().name,
        style=Markup((_PAGE / "report.css").read_text(encoding="utf-8")),
        script=Markup((_PAGE / "report.js").read_text(encoding="utf-8")),
        drives_script=Markup((_PAGE / "drives.js").read_text(encoding="utf-8")),
        has_drives=bool(data["drives"]),
        plotly=Markup(plotly.offline.get_plotlyjs()),
        data=Markup(_script_json(data)),
        strips=[asdict(one) for one in strips(run)],
        suites=[told(suite, run) for suite in run.plan.suites],
        how=_how(run),
        scenarios=_hashes(run),
        failures=[(row.tracker, row.key, row.values["failure"]) for row in run.rows if row.values.get("failure")],
    )


def _how(run: Run) -> list[tuple[str, str]]:
    """What the last session says of itself, and what all of them drew with."""
    session = run.record["sessions"][-1]
    said = [(name, _words(session[name])) for name in _HOW if session.get(name)]
    graphics = dict.fromkeys(str(row.values["graphics"]) for row in run.rows)
    seeds = sorted({row.key.seed for row in run.rows})
    state = "all episodes" if run.record["finished"] else "not finished: these are the episodes so far"
    return [("state", state), *said, ("graphics", "; ".join(graphics)), ("seeds", _words(seeds))]


def _hashes(run: Run) -> list[tuple[str, str]]:
    """Each scenario with the SHA-256 of what it says."""
    stages = {stage.name: stage.tree for batch in run.plan.batches for stage in batch.scenarios}
    return [(name, Scenario(name, tree).digest) for name, tree in stages.items()]


def _script_json(data: Mapping[str, Any]) -> str:
    """JSON that cannot end the script element it stands in, whatever the names say."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {one}" for key, one in value.items())
    if isinstance(value, list):
        return " ".join(str(one) for one in value) if len(value) <= 40 else f"{len(value)} of them"
    return str(value)
