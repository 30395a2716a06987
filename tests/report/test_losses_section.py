"""Losses on the page lead to the video at their moment."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from small_report import until

from pftrack_sim import report
from pftrack_sim.benchmark import RunStore, make_plan, run
from pftrack_sim.benchmark.reading.losses import TAGS
from pftrack_sim.report.contents import contents
from tests.benchmark.small import SMALL


def test_the_data_are_those_of_the_view(lost: Path):
    told, store = contents(RunStore(lost)), RunStore(lost)
    assert [name.replace("-", " ").replace(" ", "_") for name, _ in told["tags"]] == list(TAGS)
    rows = store.query(
        f"SELECT round(time_s, 3), round(lost_s, 3), round(found_s, 3), {', '.join(TAGS)} FROM losses"
    ).rows
    assert len(rows) > 0
    assert [
        (row[2], row[3], row[4], *(bool(row[5] & 1 << k) for k in range(len(TAGS)))) for row in told["losses"]
    ] == rows
    assert {row[0] for row in told["losses"]} == {1}, "the oracle loses nothing"
    seen = store.query("SELECT count(*), sum(occluded::INTEGER) FROM frames JOIN moments USING (label, frame) "
                       "WHERE label = 'stay' AND moments.scored").rows  # fmt: skip
    assert [(row[2], row[4]) for row in told["moments"] if row[0] == 1] == seen


@pytest.mark.slow
def test_one_click_shows_the_video_at_the_loss(show: Callable[..., Any], lost: Path):
    page = show(report.write_report(lost), 1400)
    loss = contents(RunStore(lost))["losses"][0]
    line = page.locator("#losses tbody tr").first
    assert line.locator("th").inner_text() == "stay"
    assert line.locator("a").get_attribute("href").endswith(f".mp4#t={max(loss[2] - 1.0, 0.0):.2f}")
    assert "its loss begins with: " in page.locator("#answers").inner_text(), "one loss is no share of its losses"
    causes = sum(loss[5] >> tag & 1 for tag in range(len(TAGS)))
    assert page.locator("#shares tbody tr").count() == causes, "causes that no loss has are left out"
    shown = f"Math.abs(document.getElementById('video').currentTime - {max(loss[2] - 1.0, 0.0)}) < 0.11"
    page.evaluate("document.getElementById('video').currentTime = 2.9")
    line.locator("a").click()
    until(page, shown)
    page.evaluate("document.getElementById('video').currentTime = 2.9")
    page.locator("#board tbody tr", has_text="stay").locator("a").click()
    until(page, shown)


@pytest.mark.slow
def test_no_table_is_cut_at_400_pixels(show: Callable[..., Any], lost: Path):
    for width in (1400, 400):
        page = show(report.write_report(lost), width)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        fits = "(table) => table.parentElement.scrollWidth <= table.parentElement.clientWidth"
        for table in ("#board", "#shares", "#losses"):
            assert page.locator(table).evaluate(fits), f"{table} at {width} px"
        assert page.evaluate("""[...document.querySelectorAll('.plot .legend')].every((legend) => {
            const bar = legend.closest('.plot').querySelector('.modebar').getBoundingClientRect();
            return legend.getBoundingClientRect().top > bar.bottom;
        })"""), "the tool bar lies over no legend"


@pytest.mark.slow
def test_an_episode_that_ends_with_an_error_is_not_held(show: Callable[..., Any], tmp_path: Path):
    plan = make_plan(["corridor"], ["oracle", "tests.benchmark.faulty_trackers:raises"], [0], overrides=SMALL)
    run(plan, tmp_path / "run", videos="none", workers=0, isolation="never")
    good, bad = show(report.write_report(tmp_path / "run")).locator("#answers li").all_inner_texts()
    assert "holds the target in 1 of 1 episodes" in good
    assert "holds the target in 0 of 1 episodes" in bad
    assert "ends with an error in 1 of 1 episodes" in bad
