"""The learning loops run; that they learn is measured elsewhere."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.slow
def test_the_loop_without_a_framework_runs():
    rewards = rewards_of("train_numpy.py", "--updates", "2", "--envs", "2", "--steps", "15")
    assert len(rewards) == 2
    assert min(rewards) > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("needed", "words"),
    [
        ("stable_baselines3", ["train_sb3.py", "--policy", "CnnPolicy", "--envs", "2"]),
        ("stable_baselines3", ["train_sb3.py", "--policy", "MultiInputPolicy", "--envs", "2"]),
        ("torch", ["train_cleanrl.py", "--envs", "2"]),
        ("torchrl", ["train_torchrl.py"]),
    ],
    ids=["sb3-cnn", "sb3-dict", "cleanrl", "torchrl"],
)
def test_loops_of_public_libraries_run(needed: str, words: list[str]):
    pytest.importorskip(needed, reason="the extra learn is not installed")
    assert rewards_of(*words, "--steps", "16", "--minutes", "0")


def rewards_of(*words: str) -> list[float]:
    """Mean reward of a step of every batch that an example prints; it must not warn of the environments."""
    command = [sys.executable, "-W", "error::UserWarning", str(EXAMPLES / words[0]), *words[1:]]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = [float(one) for one in re.findall(r"mean reward of a step (\d\.\d{3})", done.stdout)]
    assert all(0.0 <= one <= 1.0 for one in found)
    return found
