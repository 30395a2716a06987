"""Tables of profiles in documents."""

import json
from pathlib import Path

import pytest

from pftrack_sim.core.errors import RunError
from pftrack_sim.report.markdown import update_document
from pftrack_sim.report.profiles import changes_or_tiers
from pftrack_sim.score.profile import recorded_quantiles


def test_changes_of_a_profile_are_those_of_a_quarter_or_more(tmp_path: Path):
    path = tmp_path / "runs/hard/profile.json"
    path.parent.mkdir(parents=True)
    base = {"step_p95": 0.1, "size_ratio": 2.0, "sharpness": 100.0, "luma_swing": None}
    hard = {"step_p95": 0.2, "size_ratio": 2.2, "sharpness": 20.0, "luma_swing": 0.3}
    path.write_text(json.dumps({"a jitter=0": base, "a jitter=1": hard, "b base": base, "b light=1": base}))
    changed = "`step_p95` 0.1 -> 0.2, `sharpness` 100 -> 20"
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
