"""Tables in documents are those of the run folders that their markers name."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from pftrack_sim import score
from pftrack_sim.benchmark import RunStore, make_plan, plan_all, run
from pftrack_sim.benchmark.asked.from_names import join_plans
from pftrack_sim.core.errors import RunError
from pftrack_sim.report import write_report
from pftrack_sim.report.markdown import tables, update_document
from pftrack_sim.report.profiles import changes_or_tiers
from pftrack_sim.scenario.axes import axes_by_name
from pftrack_sim.score.profile import recorded_quantiles
from tests.benchmark.small import SMALL

AXES = Path(__file__).parents[2] / "docs/axes.md"

SUITE = """
title = "T"
seeds = "0:2"
trackers = ["oracle", "stay"]
[[run]]
scenarios = ["corridor"]
changes = { duration_s = 0.3, "camera.width_px" = 64, "camera.height_px" = 48, "lights.shadows" = false }
[[tables]]
title = "Table 1"
columns = ["corridor"]
printed = { oracle = [99.0], stay = [11.0] }
[[claims]]
kind = "beats"
statement = "Truth | beats a constant box."
tracker = "oracle"
others = ["stay"]
"""


def test_overlaps_are_those_of_the_summary(finished: Path):
    lines = tables(RunStore(finished)).splitlines()
    assert lines[0].startswith("| Mean overlap | corridor jitter=0 | corridor jitter=2 | plaza-walk jitter=0 |")
    assert lines[2].startswith("| `oracle` | 1.000 |")
    stay = [one.number("mean_overlap") for one in RunStore(finished).results if one.label == "stay"]
    assert f"| 2 | {np.mean(stay):.3f} (" in lines[3]
    assert lines[4].startswith("| stay |")
    assert f"| {np.mean(stay):.3f} | - |" in lines[4]
    assert lines[5].startswith("| fixed size |")


def test_other_settings_without_levels_have_a_column_of_their_own(tmp_path: Path):
    dark = {**SMALL, "lights.ev": -2.0}
    plans = [make_plan(["corridor"], ["stay"], [0], overrides=SMALL)]
    plans += [make_plan(["corridor"], ["stay"], [0], overrides=dark, variant="dark")]
    store = run(join_plans(plans), tmp_path / "run", videos="none", workers=0)
    assert tables(store).splitlines()[0].startswith("| Mean overlap | corridor | corridor dark base |")


def test_skill_and_shares_of_frames_stand_beside_the_mean_overlap(finished: Path):
    text = tables(RunStore(finished))
    heads, _, *rows = text.splitlines()[:4]
    assert heads.endswith("| seeds | mean | skill | tracked at >= 0.5 | >= 0.3 | centre inside |")
    cells = {row.split("|")[1].strip(): [cell.strip() for cell in row.split("|")[-5:-1]] for row in rows}
    assert cells["`oracle`"] == ["1.000"] * 4
    assert cells["`stay`"][0] == "0.000"


def test_definitions_are_listed_where_a_document_asks_for_them(tmp_path: Path):
    document = tmp_path / "results.md"
    document.write_text("<!-- list of measures -->\n<!-- end -->\n")
    assert update_document(document, tmp_path) == (["measures"], [])
    assert f"*skill*: {score.DEFINITIONS['skill']}" in document.read_text()


def test_blocks_with_a_run_folder_are_replaced_and_others_kept(finished: Path, tmp_path: Path):
    shutil.copytree(finished, tmp_path / "runs/first")
    document = tmp_path / "results.md"
    document.write_text(
        "Before.\n<!-- tables of first -->\nold\n<!-- end -->\nBetween.\n"
        "<!-- tables of absent -->\nkept\n<!-- end -->\nAfter.\n"
    )
    assert update_document(document, tmp_path / "runs") == (["first"], ["absent"])
    text = document.read_text()
    assert "old" not in text
    assert "| `oracle` | 1.000 |" in text
    ends = ("Before.", "Between.", "kept", "After.")
    assert tuple(line for line in text.splitlines() if line in ends) == ends
    update_document(document, tmp_path / "runs")
    assert document.read_text() == text
    (tmp_path / "runs/absent").mkdir()
    (tmp_path / "runs/absent/run.json").write_text("a run that is not finished")
    assert update_document(document, tmp_path / "runs", "first") == (["first"], [])
    assert document.read_text() == text
    with pytest.raises(RunError):
        update_document(document, tmp_path / "runs")


def test_documents_and_the_page_have_a_suite_s_table_and_its_claims(tmp_path: Path):
    (tmp_path / "tiny.toml").write_text(SUITE)
    plan = plan_all([str(tmp_path / "tiny.toml")])
    run(plan, tmp_path / "run", videos="none", workers=0)
    text = tables(RunStore(tmp_path / "run"))
    assert "| Table 1: printed / simulated | seeds | corridor | mean |" in text
    assert "| `oracle` | 2 | 99.0 / 100.0 | 99.0 / 100.0 (100.0, 100.0) |" in text
    assert "Truth \\| beats a constant box. |" in text
    page = write_report(tmp_path / "run").read_text()
    assert 'id="h-suite-1">T<' in page
    assert '<tr><th scope="row">oracle</th><td>2</td><td>99.0 / 100.0</td>' in page
    assert (
        '<td>Truth | beats a constant box.</td><td>default</td><td class="verdict-needs">needs 10 seeds</td>'
        "<td>oracle - stay +0." in page
    )


def test_a_suite_with_nothing_to_compare_has_no_heading(tmp_path: Path):
    (tmp_path / "bare.toml").write_text(SUITE.partition("[[tables]]")[0])
    run(plan_all([str(tmp_path / "bare.toml")]), tmp_path / "run", videos="none", workers=0)
    assert "h-suite" not in write_report(tmp_path / "run").read_text()


def test_a_document_without_blocks_is_refused(tmp_path: Path):
    document = tmp_path / "results.md"
    with pytest.raises(RunError, match="cannot be read"):
        update_document(document, tmp_path)
    document.write_text("# Results\n")
    with pytest.raises(RunError, match="has no block"):
        update_document(document, tmp_path)
    assert document.read_text() == "# Results\n"


def test_overlaps_of_too_many_conditions_have_no_columns(monkeypatch: pytest.MonkeyPatch, finished: Path):
    store = RunStore(finished)
    assert "| Mean overlap | corridor jitter=0 |" in tables(store)
    monkeypatch.setattr("pftrack_sim.report.markdown._MOST_COLUMNS", 0)
    assert "| Mean overlap | seeds | mean |" in tables(store)


def test_the_document_lists_the_axes_as_they_are(tmp_path: Path):
    copy = tmp_path / "axes.md"
    copy.write_text(AXES.read_text())
    written, _ = update_document(copy, tmp_path)
    assert written == ["axes"]
    assert copy.read_text() == AXES.read_text()
    for name, axis in axes_by_name().items():
        assert f"| `{name}` |" in copy.read_text()
        assert axis.law in copy.read_text()


def test_changes_of_a_profile_are_those_of_a_quarter_or_more(tmp_path: Path):
    path = tmp_path / "runs/hard/profile.json"
    path.parent.mkdir(parents=True)
    base = {"step_p95_per_s": 0.1, "size_ratio": 2.0, "sharpness": 100.0, "luma_swing": None}
    hard = {"step_p95_per_s": 0.2, "size_ratio": 2.2, "sharpness": 20.0, "luma_swing": 0.3}
    path.write_text(json.dumps({"a jitter=0": base, "a jitter=1": hard, "b base": base, "b light=1": base}))
    changed = "`step_p95_per_s` 0.1 -> 0.2, `sharpness` 100 -> 20"
    assert list(changes_or_tiers(path))[1:] == [["a jitter=1", changed], ["b light=1", "none by a quarter"]]
    document = tmp_path / "axes.md"
    document.write_text("<!-- tables of hard -->\n<!-- end -->\n")
    assert update_document(document, tmp_path / "runs") == (["hard"], [])
    assert f"| a jitter=1 | {changed} |" in document.read_text()
    path.write_text("{")
    with pytest.raises(RunError, match="cannot be read"):
        update_document(document, tmp_path / "runs")


def test_scenarios_are_tabled_by_tier_with_the_ends_that_they_reach(tmp_path: Path):
    quantiles = recorded_quantiles()
    low, median, high = ({key: ends[index] for key, ends in quantiles.items()} for index in (0, 2, 4))
    path = tmp_path / "runs/tiers/profile.json"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps({"plaza-walk": median, "hard/park": {**high, "sharpness": None}, "easy/corridor": low}))
    document = tmp_path / "profile.md"
    document.write_text("<!-- tables of tiers -->\n<!-- end -->\n")
    assert update_document(document, tmp_path / "runs") == (["tiers"], [])
    lines = document.read_text().splitlines()
    heads, _, *rows = [line.strip("| ").split(" | ") for line in lines if line.startswith("|")]
    assert heads[2:6] == ["median of 3", "median of 1 `real`", "median of 1 `hard`", "median of 1 `easy`"]
    assert [row[0] for row in rows] == [f"`{key}`" for key in quantiles]
    ends = {row[0].strip("`"): row[-1] for row in rows}
    assert {key for key, reached in ends.items() if reached != "both"} == {"sharpness"}
    assert ends["sharpness"] == "low"
    assert rows[0][2:6] == ["0.103", "0.103", "0.373 (outside)", "0.018 (outside)"]
