"""A small run, made once; and a browser."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from small_report import HOSTILE, SMALL

from pftrack_sim.benchmark import make_plan, run
from pftrack_sim.trackers import registry


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two trackers, two scenarios, two levels of an axis, two seeds; every episode filmed."""
    path = tmp_path_factory.mktemp("report") / "run"
    plan = make_plan(["corridor", "plaza-walk"], ["oracle", "stay"], [0, 1], axes={"jitter": [0, 2]}, overrides=SMALL)
    run(plan, path, videos="all", workers=0)
    return path


@pytest.fixture(scope="session")
def lost(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first box in every frame: the target walks out of it."""
    path = tmp_path_factory.mktemp("lost") / "run"
    overrides = {**SMALL, "duration_s": 3.0, "camera.rate_hz": 10.0}
    run(make_plan(["plaza-walk"], ["oracle", "stay"], [0], overrides=overrides), path, videos="all", workers=0)
    return path


@pytest.fixture
def hostile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run by a tracker whose name is a script."""
    monkeypatch.setitem(registry._REGISTRY.builtin, HOSTILE, registry._REGISTRY.builtin["stay"])
    plan = make_plan(["corridor"], ["oracle", HOSTILE], [0, 1], overrides=SMALL)
    return run(plan, tmp_path / "run", workers=0, isolation="never").path


@pytest.fixture(scope="session")
def browser(launch_chromium: Callable[..., Any]) -> Iterator[Any]:
    """Debian's Chromium, without a network."""
    browser = launch_chromium("--disable-gpu", "--disable-background-networking", "--disable-component-update")
    yield browser
    browser.close()


@pytest.fixture
def show(browser: Any) -> Iterator[Callable[..., Any]]:
    """Opens a page from disk; no page complains of anything."""
    complaints: list[str] = []

    def opened(file: Path, width: int = 1280) -> Any:
        page = browser.new_page(viewport={"width": width, "height": 900})
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(file.as_uri(), timeout=120_000)
        page.wait_for_selector("body[data-ready=yes]")
        return page

    yield opened
    assert complaints == []
    for context in browser.contexts:
        context.close()
