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

from pftrack_sim.errors import RunError
from pftrack_sim.report.contents import contents
from pftrack_sim.report.data import Run, read_run
from pftrack_sim.report.strips import strips

_PAGE = Path(__file__).parent / "page"
_HOW = ("finished", "command", "python", "platform", "graphics", "preset", "seeds", "versions")


def write_report(path: Path, *, on_row: Callable[[], None] = lambda: None) -> Path:
    """Write `report.html` into a run folder.

    The page needs nothing but itself and the videos beside it; it opens from disk, without a network.

    Args:
        path: The run folder.
        on_row: Called after every row of the summary that was read.

    Returns:
        The page's path.

    Raises:
        RunError: No complete run folder, or one that cannot be written to.
    """
    run = read_run(path)
    page = _page(run, contents(run, on_row))
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
        plotly=Markup(plotly.offline.get_plotlyjs()),
        data=Markup(_script_json(data)),
        strips=[asdict(one) for one in strips(run)],
        suites=run.record.get("suites", []),
        how=[(name, _words(run.record[name])) for name in _HOW if name in run.record],
        scenarios=run.record.get("scenarios", {}),
        failures=[(row.tracker, row.key, row.values["failure"]) for row in run.rows if row.values.get("failure")],
    )


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
