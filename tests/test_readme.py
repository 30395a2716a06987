"""The README is true: its code blocks run as they stand."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

README = Path(__file__).parent.parent / "README.md"


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.mark.slow
def test_commands_and_python_run_in_order(tmp_path: Path):
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    (tmp_path / "runs").mkdir()
    commands = [line for block in blocks("sh") for line in block.splitlines()]
    assert commands
    for command in commands:
        done = subprocess.run(command, shell=True, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, f"{command}\n{done.stderr}"
    programs = blocks("python")
    assert len(programs) == 1
    for program in programs:
        done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, f"{program}\n{done.stderr}"


def test_pictures_and_pages_are_there():
    found = re.findall(r"\]\((?!https:)(.*?)\)", README.read_text(encoding="utf-8"))
    assert "docs/pictures/story.webp" in found
    assert [name for name in found if not (README.parent / name).is_file()] == []


def test_it_stays_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 95


def test_make_knows_the_commands():
    makefile = (README.parent / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"`?make (\w+)", README.read_text(encoding="utf-8")):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
