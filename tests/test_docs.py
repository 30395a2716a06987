"""The site: its Python blocks run as they stand, and its navigation knows every page."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"
PAGES = [DOCS / "index.md", DOCS / "studio.md", *sorted((DOCS / "environments").glob("*.md"))]


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_python_blocks_run(page: Path, tmp_path: Path):
    for program in re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL):
        done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, f"{program}\n{done.stderr}"


@pytest.mark.slow
def test_the_site_builds_with_every_page_and_link(tmp_path: Path):
    pytest.importorskip("mkdocs", reason="the extra docs is not installed")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=DOCS.parent, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "site" / "cli" / "index.html").read_text(encoding="utf-8")
    assert "pftrack-sim studio" in text
    assert "Root seed of the episode" in text
    track = (tmp_path / "site" / "environments" / "track" / "index.html").read_text(encoding="utf-8")
    assert "BoundingBox(640, 480)" in track
    assert "rgb_array_list" in track
