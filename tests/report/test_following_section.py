"""Closed-loop episodes on the page."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_report import until

from pftrack_sim import report
from pftrack_sim.benchmark import RunStore, make_plan, run
from pftrack_sim.report.contents import contents
from pftrack_sim.report.following import following_episodes
from pftrack_sim.report.strips import strips
from tests.benchmark.small import SMALL

# The target leaves the narrow view of a robot that stands still, to the side.
ASIDE = {"target.speed_m_s": 1.4, "camera.fovy_deg": 20.0, "target.path_m": [[3.5, 0.0], [4.0, 0.0], [4.5, 6.0]]}


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path, overrides = tmp_path_factory.mktemp("drives") / "run", {**SMALL, **ASIDE, "duration_s": 2.0}
    plan = make_plan(["easy/plaza-walk"], ["oracle"], [0], controllers=["servo-avoid", "still"], overrides=overrides)
    run(plan, path, videos="all")
    return path


def test_the_data_of_the_page_agree_with_the_episode(driven: Path):
    first, second = contents(RunStore(driven))["drives"]
    sql = "SELECT after_distance_m FROM frames WHERE controller = 'still' ORDER BY frame"
    assert second["distance"] == pytest.approx([row[0] for row in RunStore(driven).query(sql).rows], abs=0.006)
    assert np.ptp(second["robot"], axis=1).max() < 0.05  # it stands still
    assert np.ptp(first["robot"], axis=1).max() > 0.2
    assert first["ending"].startswith("driven to the end")
    assert len(second["lost"]) == 1
    assert second["lost"][0]["until"] is None
    assert "out of view; never found again" in second["lost"][0]["why"]


def test_an_open_loop_run_has_no_closed_loop_episodes(finished: Path):
    assert following_episodes(RunStore(finished), {}) == []


@pytest.mark.slow
def test_the_slider_moves_cone_cursor_and_video(driven: Path, show: Callable[..., Any]):
    assert show(report.write_report(driven), 400).evaluate("document.documentElement.scrollWidth") <= 400
    page = show(report.write_report(driven))
    cells = {row.locator("th").inner_text().splitlines()[0]: row.locator("td[data-label^='time to loss']").inner_text()
             for row in page.locator("#board tbody tr").all()}  # fmt: skip
    assert cells["oracle+servo-avoid"] == "never"
    assert float(cells["oracle+still"]) == pytest.approx(
        contents(RunStore(driven))["drives"][1]["lost"][0]["since"], abs=0.11
    )
    assert not page.locator("#h-episode").is_visible(), "no picture is common to all: nothing frame by frame"
    assert page.locator("#drive-distance .annotation-text").all_text_contents() == ["wanted", "limit"]
    assert page.locator("#drive-bearing .annotation-text").all_text_contents() == ["wanted", "limit", "limit"]
    assert page.evaluate("document.getElementById('drive-distance').layout.shapes[0].y0") == 3.0
    page.select_option("#drive", index=1)
    assert "never found again" in page.locator("#drive-told").inner_text()
    until(page, "document.getElementById('drive-video').readyState >= 1")
    page.locator("#drive-time").fill("1.5")
    until(page, "Math.abs(document.getElementById('drive-video').currentTime - 1.55) < 0.05")
    told = contents(RunStore(driven))["drives"][1]
    here = page.evaluate("['x', 'y'].map((axis) => document.getElementById('drive-map').data[4][axis][0])")
    assert here == [told["target"][0][15], told["target"][1][15]]
    cone = page.evaluate("['x', 'y'].map((axis) => document.getElementById('drive-map').data[0][axis])")
    left, right = (np.arctan2(cone[1][k] - cone[1][0], cone[0][k] - cone[0][0]) for k in (1, 2))
    assert left - right == pytest.approx(2 * np.arctan(np.tan(np.deg2rad(10.0)) * 96 / 72))
    assert page.evaluate("document.getElementById('drive-distance').layout.shapes.at(-1).x0") == pytest.approx(
        1.5, abs=0.1
    )


def test_strips_show_no_tracker_that_has_the_truth(driven: Path):
    """With any controller: `oracle+servo-avoid` is the oracle."""
    assert strips(RunStore(driven)) == []
