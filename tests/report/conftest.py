"""A small run, made once; and a browser."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import duckdb
import pytest
from small_report import HOSTILE, SMALL

from pftrack_sim.benchmark import RunStore, make_plan, run


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two trackers, two scenarios, two levels of an axis, two seeds; every episode filmed."""
    path = tmp_path_factory.mktemp("report") / "run"
    plan = make_plan(["corridor", "plaza-walk"], ["oracle", "stay"], [0, 1], axes={"jitter": [0, 2]}, overrides=SMALL)
    run(plan, path, videos="all", workers=0)
    return path


@pytest.fixture
def hostile(finished: Path, tmp_path: Path) -> Path:
    """The same run by a tracker whose name is a script."""
    path = tmp_path / "run"
    shutil.copytree(finished, path)
    plan = RunStore(path).plan
    renamed = tuple(one if one.name == "oracle" else one.model_copy(update={"name": HOSTILE}) for one in plan.trackers)
    changed_plan = plan.model_copy(update={"trackers": renamed})
    record = json.loads((path / "run.json").read_text())
    record |= {"plan": changed_plan.model_dump(mode="json"), "plan_sha256": changed_plan.digest}
    (path / "run.json").write_text(json.dumps(record))
    changed = path / "changed.parquet"
    for file in [path / "summary.parquet", *(path / "episodes").rglob("*.parquet")]:
        duckdb.execute(
            f"COPY (SELECT * REPLACE (CASE label WHEN 'stay' THEN $name ELSE label END AS label) FROM '{file}') "
            f"TO '{changed}' (FORMAT parquet)",
            {"name": HOSTILE},
        )
        changed.replace(file)
    return path


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Debian's Chromium, without a network."""
    found = next(
        (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
    )
    if found is None:
        pytest.skip("no Chromium here: install Debian's package chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]
        browser = playwright.chromium.launch(executable_path=found, args=options)
        yield browser
        browser.close()
