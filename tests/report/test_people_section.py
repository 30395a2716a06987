"""Scores of everybody in view, in the page, in Markdown and in the terminal, where a tracker follows several people."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from small_report import SMALL

from pftrack_sim import report
from pftrack_sim.benchmark import RunStore, make_plan, run
from pftrack_sim.cli.results import print_bench
from pftrack_sim.report.contents import contents
from pftrack_sim.report.markdown import tables
from pftrack_sim.score import PEOPLE_DEFINITIONS


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> RunStore:
    detector = {"axes.detector.severity": 1.0, "axes.detector.height_px": 6.0}
    overrides = {**SMALL, **detector, "camera.rate_hz": 10.0, "distractors.count": 2}
    plan = make_plan(["corridor"], ["stay", "chau2011"], [0, 1], overrides=overrides)
    return run(plan, tmp_path_factory.mktemp("crowd") / "run", videos="none", workers=0)


@pytest.mark.slow
def test_the_page_has_a_table_of_everybody_in_view(show: Callable[..., Any], crowd: RunStore):
    scores = [one.number("hota") for one in crowd.results if one.label == "chau2011 (detections)"]
    assert len(scores) == 2
    assert min(scores) > 0.0
    page = show(report.write_report(crowd.path))
    assert page.locator("#people thead th").all_inner_texts() == ["tracker", "seeds", *PEOPLE_DEFINITIONS]
    (row,) = page.locator("#people tbody tr").all()
    cells = row.locator("td").all_inner_texts()
    assert row.locator("th").inner_text().startswith("chau2011 (detections)")
    assert (cells[0], cells[1].split("\n")[0]) == ("2", f"{sum(scores) / 2:.2f}")
    assert page.locator("#board tbody tr").count() == 2


def test_markdown_and_terminal_have_it_too(crowd: RunStore, capsys: pytest.CaptureFixture[str]):
    (row,) = [one for one in tables(crowd).splitlines() if one.startswith("| corridor, `chau2011 (detections)` |")]
    chau = [one for one in crowd.results if one.label == "chau2011 (detections)"]
    cells = [cell.strip().split(" ")[0] for cell in row.split("|")[3:-1]]
    assert cells[:5] == [f"{sum(one.number(name.lower()) for one in chau) / 2:.3f}" for name in PEOPLE_DEFINITIONS][:5]
    print_bench(crowd.results)
    assert f"HOTA: {PEOPLE_DEFINITIONS['HOTA']}" in capsys.readouterr().out


def test_a_run_without_such_trackers_has_no_such_table(finished: Path):
    store = RunStore(finished)
    assert contents(store)["people"] == []
    assert "Everybody in view" not in tables(store)
