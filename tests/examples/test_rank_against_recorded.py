"""The example that compares the ranks of a board with those on recorded sequences."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import spearmanr

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "rank_against_recorded.py"


@pytest.fixture
def example(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    monkeypatch.syspath_prepend(str(EXAMPLE.parent))  # where Python looks when it runs the file
    return runpy.run_path(str(EXAMPLE))


def overlaps(generator: np.random.Generator, expected: np.ndarray, count: int, spread: float) -> np.ndarray:
    """`(T, count)` overlaps whose means scatter about the expected ones."""
    return expected[:, None] + generator.normal(0.0, spread, (len(expected), count))


def coverage(example: dict[str, Any], runs: int, apart: float = 0.1, spread: float = 0.25) -> tuple[float, float]:
    """Shares of intervals that cover the correlation of the expected overlaps, and of corrections that help.

    20 trackers on 12 sequences, which scatter by `spread`, and 18 seeds; the expected overlaps of the two sides are
    `apart`.
    """
    generator, found = np.random.default_rng(0), []
    for _ in range(runs):
        drawn = generator.uniform(0.1, 0.8, 20)
        real = drawn + generator.normal(0.0, apart, 20)
        true = spearmanr(real, drawn).statistic
        both = overlaps(generator, real, 12, spread), overlaps(generator, drawn, 18, 0.08)
        value, low, high = example["agreement"](*both)
        measured = spearmanr(*(one.mean(axis=1) for one in both)).statistic
        found.append((low <= true <= high, abs(value - true) < abs(measured - true)))
    covered, nearer = np.mean(found, axis=0).tolist()
    return covered, nearer


def test_the_interval_covers_the_correlation_without_noise(example: dict[str, Any]):
    covered, nearer = coverage(example, 40)
    assert covered >= 35 / 40, "95 % of 40 are 38"
    assert nearer >= 0.5


def test_halves_of_sequences_agree_no_better_than_their_noise_lets_them(example: dict[str, Any]):
    generator, drawn = np.random.default_rng(0), np.linspace(0.1, 0.8, 20)
    alike, apart = (overlaps(generator, drawn, 12, spread) for spread in (1e-6, 0.5))
    exact = np.tile(drawn[:, None], 18)
    assert example["agreement_of_halves"](alike, exact) == pytest.approx((1.0, 1.0))
    halves, with_board = example["agreement_of_halves"](apart, exact)
    assert 0.2 < halves < with_board < 0.95, "the board has no noise, the other half has"


@pytest.mark.slow
def test_it_compares_the_board_with_sequences_of_one_s_own(tmp_path: Path):
    command = [sys.executable, "-c", "from pftrack_sim.cli import main; main()", "export", "corridor", "--seeds", "0:5"]
    short = ("duration_s=0.5", "camera.width_px=96", "camera.height_px=72", "lights.shadows=false")
    command += ["--format", "otb", "--out", str(tmp_path / "own"), *(part for one in short for part in ("--set", one))]
    subprocess.run(command, check=True, capture_output=True, cwd=ROOT)
    done = subprocess.run(
        [sys.executable, str(EXAMPLE), str(tmp_path / "own")], check=False, capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0].split() == ["tracker", "recorded", "standard-1"]
    assert "stay" in done.stdout
    assert "oracle" not in done.stdout, "it knows the truth"
    assert "5 sequences, 18 seeds\nHalf of the sequences and standard-1: " in done.stdout


def test_few_sequences_have_no_interval(example: dict[str, Any]):
    drawn = {label: np.full(18, 0.1 * level) for level, label in enumerate("abc")}
    real = {label: overlaps[:2] + 0.1 for label, overlaps in drawn.items()}
    assert example["report"](real, drawn, "own").splitlines()[-1] == "Spearman 1.00: 3 trackers, 2 sequences, 18 seeds"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "nowhere: no such folder"),
        (["nowhere", "--suite", "other"], "of 0 trackers that need only images"),
        (["nowhere", "--seeds", "5:2"], "--seeds"),
    ],
)
def test_wrong_arguments_end_with_one_error(arguments: list[str], said: str):
    done = subprocess.run(
        [sys.executable, str(EXAMPLE), *arguments], check=False, capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("rank_against_recorded.py: error: ")
    assert said in done.stderr.splitlines()[-1]
