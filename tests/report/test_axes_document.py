"""Tables about the stress axes in documents."""

import json
from pathlib import Path

import pytest

from pftrack_sim.core.errors import RunError
from pftrack_sim.report.axes import axes_rows, profile_rows
from pftrack_sim.report.markdown import update_document
from pftrack_sim.scenario.axes import axes_by_name

DOCUMENT = Path(__file__).parents[2] / "docs/axes.md"


def test_the_document_lists_the_axes_as_they_are(tmp_path: Path):
    copy = tmp_path / "axes.md"
    copy.write_text(DOCUMENT.read_text())
    written, _ = update_document(copy, tmp_path)
    assert written == ["axes"]
    assert copy.read_text() == DOCUMENT.read_text()
    for name, _, law, source in axes_rows():
        assert name.strip("`") in axes_by_name()
        assert law in copy.read_text()
        assert source in copy.read_text()


def test_changes_of_a_profile_are_those_of_a_quarter_or_more(tmp_path: Path):
    path = tmp_path / "runs/hard/profile.json"
    path.parent.mkdir(parents=True)
    base = {"step_p95": 0.1, "size_ratio": 2.0, "sharpness": 100.0, "luma_swing": None}
    hard = {"step_p95": 0.2, "size_ratio": 2.2, "sharpness": 20.0, "luma_swing": 0.3}
    path.write_text(json.dumps({"a jitter=0": base, "a jitter=1": hard, "b base": base, "b light=1": base}))
    changed = "`step_p95` 0.1 -> 0.2, `sharpness` 100 -> 20"
    assert list(profile_rows(path)) == [["a jitter=1", changed], ["b light=1", "none by a quarter"]]
    document = tmp_path / "axes.md"
    document.write_text("<!-- tables of hard -->\n<!-- end -->\n")
    assert update_document(document, tmp_path / "runs") == (["hard"], [])
    assert f"| a jitter=1 | {changed} |" in document.read_text()
    path.write_text("{")
    with pytest.raises(RunError, match="cannot be read"):
        list(profile_rows(path))
