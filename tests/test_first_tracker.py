"""The tutorial about a tracker of one's own ends as it says: a measured difference between two versions."""

import re
import tomllib
from pathlib import Path

import pytest
from blocks import blocks, run_page

DOCUMENT = Path(__file__).parent.parent / "docs/first-tracker.md"


@pytest.mark.slow
def test_code_and_commands_run_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    said = run_page(DOCUMENT, tmp_path)
    assert "SCALES = (0.98" in (tmp_path / "my_tracker.py").read_text()
    printed = re.search(r"my_tracker:make in v2 is better than .* by 0\.\d{3} \(.*\), 10 seeds", said)
    assert printed is not None, said
    assert (tmp_path / "runs/v2/comparison.html").is_file()
    assert (tmp_path / "look.mp4").is_file()
    assert (tmp_path / "look.jpg").is_file()


def test_the_document_is_code_and_commands():
    found = blocks(DOCUMENT)
    assert [language for language, _, _ in found] == ["python", "sh", "sh", "python", "sh", "sh", "toml"]
    for language, _, block in found:
        if language == "python":
            compile(block, str(DOCUMENT), "exec")
        elif language == "toml":
            assert "pftrack_sim.trackers" in tomllib.loads(block)["project"]["entry-points"]
