"""The examples that each command's help ends with are command lines that work."""

import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest
import typer

from pftrack_sim.cli.app import app
from pftrack_sim.cli.examples import EXAMPLES
from tests.cli.test_cli import pftrack_sim

GROUP: Any = typer.main.get_command(app)
SETTINGS = ("camera.width_px=96", "camera.height_px=72", "camera.rate_hz=10", "duration_s=1", "lights.shadows=false")
SMALL = [word for one in SETTINGS for word in ("--set", one)]
DRAWING = ("render", "profile", "bench", "follow", "limit", "export")
SERVING = ("studio", "trax")
WHOLE = ("submit",)
"""A whole frozen suite has to be run first, which takes 20 minutes."""


def test_every_command_has_examples():
    assert set(EXAMPLES) == {"", *GROUP.commands}
    assert all(2 <= len(lines) <= 3 and len(set(lines)) == len(lines) for lines in EXAMPLES.values())


@pytest.mark.parametrize("line", sorted({line for lines in EXAMPLES.values() for line in lines}))
def test_examples_are_parsed(line: str):
    command, *words = shlex.split(line)
    GROUP.commands[command].make_context(command, words)


@pytest.mark.parametrize("command", ["", "bench", "query"])
def test_the_help_ends_with_them_unbroken(command: str):
    said = pftrack_sim(*command.split(), "--help").stdout
    assert said.rstrip().endswith("\n".join(f"    pftrack-sim {line}" for line in EXAMPLES[command]))


@pytest.mark.slow
def test_examples_run_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "results.md").write_text("<!-- tables of first -->\n<!-- end -->\n")
    ran: set[str] = set()
    for command, lines in EXAMPLES.items():
        for line in lines if command not in ("", *SERVING, *WHOLE) else ():
            if "runs/v2" in line and not (tmp_path / "runs/v2").exists():
                shutil.copytree(tmp_path / "runs/v1", tmp_path / "runs/v2")
            words = shlex.split(line)
            done = pftrack_sim(*words, *(SMALL if words[0] in DRAWING else []), cwd=tmp_path)
            assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
            ran.add(line)
    assert set(EXAMPLES[""]) <= ran
    assert "ko2012" in (tmp_path / "results.md").read_text()
