"""The learning loops run; that they learn is measured elsewhere."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.slow
def test_the_loop_without_a_framework_runs():
    command = [sys.executable, str(EXAMPLES / "train_numpy.py"), "--updates", "2", "--envs", "2", "--steps", "15"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    rewards = [float(found) for found in re.findall(r"mean reward of a step (\d\.\d{3})", done.stdout)]
    assert len(rewards) == 2
    assert all(0.0 < one <= 1.0 for one in rewards)
