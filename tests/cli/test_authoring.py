"""`pftrack-sim new` and `pftrack-sim map`."""

from pathlib import Path

import cv2
import pytest
from test_cli import pftrack_sim, refused, succeeds


def test_a_new_scenario_is_drawn_from_above_and_never_overwritten(tmp_path: Path):
    succeeds("new", "own.toml", cwd=tmp_path)
    text = (tmp_path / "own.toml").read_text()
    assert "exists already" in refused("new", "own.toml", cwd=tmp_path)
    assert (tmp_path / "own.toml").read_text() == text
    for name in ("map.png", "map.svg", "again.svg"):
        done = pftrack_sim("map", "own.toml", "--seed", "3", "--out", name, cwd=tmp_path)
        assert (done.returncode, done.stderr) == (0, "")
    assert cv2.imread(str(tmp_path / "map.png")).std() > 10.0
    assert (tmp_path / "map.svg").read_text().startswith("<?xml")
    assert (tmp_path / "map.svg").read_bytes() == (tmp_path / "again.svg").read_bytes()


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        ('path = "auto"', 1, "own.toml:{line}: target.path_m: the target is at the end of its 7.1 m"),
        ("height_px = 480", 2, "own.toml:{line}: camera.height_px: got 'tall'"),
    ],
)
def test_a_problem_is_told_with_its_line(tmp_path: Path, change: str, code: int, words: str):
    pftrack_sim("new", "own.toml", cwd=tmp_path)
    file = tmp_path / "own.toml"
    others = {'path = "auto"': "path_m = [[5, 8], [12, 9]]", "height_px = 480": 'height_px = "tall"'}
    line = file.read_text().splitlines().index(change) + 1
    file.write_text(file.read_text().replace(f"\n{change}\n", f"\n{others[change]}\n"))
    done = pftrack_sim("map", "own.toml", cwd=tmp_path)
    assert done.returncode == code
    assert words.format(line=line) in done.stdout + done.stderr


def test_another_kind_of_file_is_refused():
    refused("new", "own.yaml")
    assert "an .svg or .png, got 'map.pdf'" in refused("map", "plaza-walk", "--out", "map.pdf")
