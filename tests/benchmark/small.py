"""Small episodes, a small suite, and the comparison of two runs."""

from pathlib import Path
from typing import Any

import tomli_w

from pftrack_sim.benchmark import Plan, RunStore, make_plan
from pftrack_sim.benchmark.kept.checksums import SUMS, TABLES_OF_RESULTS, Checksums
from pftrack_sim.core.code_digest import file_digest
from pftrack_sim.scenario import load

SMALL: dict[str, Any] = {
    "camera.width_px": 96,
    "camera.height_px": 72,
    "camera.rate_hz": 10,
    "lights.shadows": False,
    "duration_s": 0.4,
    "distractors.count": 0,
    "place.clutter": 0.0,
    "occluders": [],
}


def settings(changes: dict[str, Any]) -> list[str]:
    """The same on the command line."""
    return [word for key, value in changes.items() for word in ("--set", f"{key}={str(value).lower()}")]


def small_plan(seeds: range, trackers: list[Any] | None = None, **overrides: Any) -> Plan:
    return make_plan(["corridor"], trackers or ["oracle", "stay"], list(seeds), overrides={**SMALL, **overrides})


def frozen_suite(path: Path, changes: dict[str, Any] | None = None, **versions: int) -> str:
    """Write a frozen suite with a part in each loop; `versions` of scenarios may be others than there are."""
    parts = {"open": "corridor", "closed": "follow/plaza"}
    tree = {
        "title": "T",
        "seeds": "0:5",
        "trackers": ["ncc", "stay"],
        "controllers": ["servo"],
        "versions": {name: load(name).tree["version"] for name in parts.values()} | versions,
        "run": [{"loop": loop, "scenarios": [name], "changes": changes or {}} for loop, name in parts.items()],
    }
    path.write_text(tomli_w.dumps(tree))
    return str(path)


def contents(path: Path) -> list[tuple[Any, ...]]:
    """For every result the digest of all rows (times are not in it) and of all pixels."""
    with RunStore(path).database() as database:
        rows = database.sql("SELECT file, content_sha256, frames_digest FROM summary ORDER BY number, place")
        return rows.fetchall()


def with_sums(folder: Path, *, finished: bool = True) -> None:
    """Write the checksums of a run folder's files as they are; those of an unfinished session name results only."""
    names = [name for name in Checksums(folder).there() if finished or name.startswith(TABLES_OF_RESULTS)]
    (folder / SUMS).write_text("".join(f"{file_digest(folder / name)}  {name}\n" for name in names))
