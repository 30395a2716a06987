"""The examples run with the command in their docstring."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHORT = [f"{key}={value}" for key, value in {
    "duration_s": 0.3, "camera.width_px": 64, "camera.height_px": 48, "lights.shadows": "false", "distractors.count": 0,
}.items()]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("example", ["my_tracker", "my_controller"])
def test_a_plug_in_runs_by_the_command_it_shows(example: str, tmp_path: Path):
    told = ast.get_docstring(ast.parse((ROOT / "examples" / f"{example}.py").read_text()))
    assert told is not None
    setting, program, *arguments = told.splitlines()[-1].split()
    assert (setting, program) == ("PYTHONPATH=examples", "pftrack-sim")
    for key_value in SHORT:
        arguments += ["--set", key_value]
    arguments += ["--seeds", "3", "--videos", "none", "--out", str(tmp_path / "run")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "examples"), str(ROOT)])}
    command = [sys.executable, "-c", "from pftrack_sim.cli import main; main()", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert example in done.stdout
