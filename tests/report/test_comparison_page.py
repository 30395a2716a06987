"""The page of a comparison: the numbers of `compare_runs`, and the episodes that got worse as videos side by side."""

import html
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from small_report import until

from pftrack_sim import report, score
from pftrack_sim.benchmark import RunStore
from pftrack_sim.benchmark.reading.losses import TAGS
from pftrack_sim.benchmark.said.comparison import MEASURES, compare_runs
from pftrack_sim.cli import reading, results, tables
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.report.comparison import _parting_s
from pftrack_sim.report.tables import Table


@pytest.mark.slow
def test_it_shows_differences_and_videos_at_the_moment_of_parting(show: Callable[..., Any], lost: Path, tmp_path: Path):
    store = RunStore(lost)
    found = compare_runs(store, store, ["oracle", "stay"])
    target = report.write_comparison(store, store, found, tmp_path / "comparison.html")
    assert target.stat().st_size < 100_000
    oracle = {row.condition: row.first for row in found.tags}
    assert oracle
    assert set(oracle) <= set(TAGS)
    assert set(oracle.values()) == {1.0}
    for width in (1400, 400):
        page = show(target, width)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert (
            "1 seed cannot show a difference between stay and oracle, 10 are needed: -"
            in page.locator(".statement").inner_text()
        )
        assert page.locator("#differences tbody tr").count() == 1
        assert page.locator("#differences tfoot .scale").inner_text().split()[1] == "0", "an axis under the bars"
        assert page.locator("section[aria-labelledby=h-largest] article polyline").count() == 2
        assert page.locator("article polyline").count() == 2, "the largest difference is not shown twice"
        assert page.locator("article video").count() == 1, "both saw the same episode: one video has both boxes"
        start = float(page.locator("article").get_attribute("data-start"))
        until(page, f"Math.abs(document.querySelector('video').currentTime - {start}) < 0.11")
        page.locator("svg.overlaps").click()
        until(page, "Math.abs(document.querySelector('video').currentTime - 1.45) < 0.11")
    with pytest.raises(ParameterError, match=r"end in \.html"):
        report.write_comparison(store, store, found, tmp_path / "comparison.txt")


def test_videos_of_two_runs_have_the_look_of_their_curves_beside_them(lost: Path, tmp_path: Path):
    other = tmp_path / "other"
    shutil.copytree(lost, other)
    first, second = RunStore(lost), RunStore(other)
    found = compare_runs(first, second, ["oracle", "stay"])
    page = report.write_comparison(first, second, found, tmp_path / "comparison.html").read_text()
    assert page.count("<video") == 2
    assert page.count('<figcaption><span class="swatch ') == 2
    for marker in ("circle", "square"):
        assert f'<span class="swatch {marker}" style="background: #888888">' in page
    assert page.count("<polyline") == 2 * page.count('stroke="#888888" stroke-dasharray="8 4"')


def test_every_measure_that_runs_are_compared_by_is_defined(lost: Path, tmp_path: Path):
    assert set(score.MEASURE_DEFINITIONS) >= set(MEASURES)
    store = RunStore(lost)
    found = compare_runs(store, store, ["oracle", "stay"], measure="success")
    page = report.write_comparison(store, store, found, tmp_path / "a.html").read_text()
    assert html.escape(score.MEASURE_DEFINITIONS["success"]) in page


def test_names_that_are_markup_stay_text_and_runs_without_video_say_so(hostile: Path, tmp_path: Path):
    store = RunStore(hostile)
    page = report.write_comparison(store, store, compare_runs(store, store), tmp_path / "a.html").read_text()
    assert "<script>document" not in page
    assert "&lt;script&gt;document" in page


def test_the_statement_has_a_verdict_only_where_the_seeds_show_it(lost: Path):
    store = RunStore(lost)
    found = compare_runs(store, store, ["oracle", "stay"])
    shown = score.SeedMean((-0.03,) * 20, -0.03, -0.05, -0.01, 0.001)
    worse, even = (
        replace(found, rows=(replace(found.rows[0], difference=one),)) for one in (shown, replace(shown, p=0.2))
    )
    assert worse.statement == "stay is worse than oracle by 0.030 (0.010 to 0.050), 20 seeds"
    assert even.statement == "stay and oracle cannot be told apart: -0.030 (-0.050 to -0.010), 20 seeds"


def test_no_column_of_the_printed_comparison_is_cut_at_80_columns(
    lost: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    store = RunStore(lost)
    found = compare_runs(store, store, ["oracle", "stay"])
    difference = score.SeedMean((-0.9,) * 9, -0.9, -0.95, -0.85, float("nan"))
    row = replace(found.rows[0], condition="jitter=2,light=0", difference=difference)
    monkeypatch.setattr(tables, "console", Console(width=80, markup=False, highlight=False))
    results.print_comparison(replace(found, rows=(row,)))
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert next(line for line in lines if "first  second" in line).endswith("verdict")
    assert {" ".join(line.split()[-2:]) for line in lines} >= {"- needs", "10 seeds"}
    assert any("-0.950 to -0.850" in line for line in lines)
    heads = [f"my_long_tracker_{k}" for k in range(8)]
    tables.print_tables(Table("many", ("place",), heads, [["here", *(f"0.{k}99" for k in range(8))]]))
    printed = capsys.readouterr().out
    assert all(f"my_long_tracker_{k}" in printed and f"0.{k}99" in printed for k in range(8)), printed


def test_overlaps_part_where_the_second_falls_behind():
    time_s = np.arange(40) / 10.0
    first, second = np.full(40, 0.8), np.where(time_s < 2.0, 0.8, 0.1)
    assert _parting_s(time_s, first, second) == pytest.approx(2.0, abs=0.3)
    assert _parting_s(time_s, second, first) == 0.0


def test_compare_and_report_say_where_it_fails(lost: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    reading.compare(lost, trackers="oracle,stay", html=tmp_path / "page.html")
    printed = capsys.readouterr().out
    assert "1 seed cannot show a difference between stay and oracle" in printed
    assert f"written: {tmp_path / 'page.html'}" in printed
    assert "oracle never loses the target." in printed
    causes = r"\d+% of the losses begin with: .* of all \d+ frames\)\."
    told = re.search(rf"stay loses the target [1-9]\d* times? in 1 of 1 episode; {causes}", printed)
    assert told is not None, printed
    page = (tmp_path / "page.html").read_text()
    assert told[0] in page
    assert html.unescape(page).count('/report.html#h-losses"') == 1
    reading.report(lost)
    printed = capsys.readouterr().out
    assert "Share of the losses that begin with" in printed
    assert "of all frames" in printed
