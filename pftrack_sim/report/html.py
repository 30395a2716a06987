"""Pages as HTML that needs nothing but itself and the videos beside it, and runs no script but its own."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from pftrack_sim.benchmark.kept.checksums import Checksums
from pftrack_sim.benchmark.kept.files import write_bytes
from pftrack_sim.benchmark.kept.folder import is_run

_PAGE = Path(__file__).parent / "page"


def render(template: str, scripts: Sequence[str], **values: Any) -> str:
    """A page from a template of the folder `page`; all `values` are text there unless they are `Markup`.

    The page runs `scripts` alone: names of files, or programs.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_PAGE), autoescape=True, undefined=jinja2.StrictUndefined
    )
    sources = [_source(one) if one.endswith(".js") else one for one in scripts]
    digests = (base64.b64encode(hashlib.sha256(one.encode()).digest()).decode() for one in sources)
    allowed = {
        "default-src": "'none'",
        "script-src": " ".join(f"'sha256-{digest}'" for digest in digests),
        "style-src": "'unsafe-inline'",
        "img-src": "data: blob:",
        "media-src": "'self' file: data:",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    return environment.get_template(f"{template}.html.j2").render(
        policy="; ".join(f"{kind} {sources}" for kind, sources in allowed.items()),
        style=Markup(_source("report.css")),
        scripts=[Markup(one) for one in sources],
        **values,
    )


def write_page(target: Path, page: str) -> Path:
    """Write a page; where it lies in a run folder, the folder's checksums have it."""
    write_bytes(target, page.encode())
    if is_run(target.parent):
        Checksums(target.parent).update(target.name)
    return target


def _source(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")
