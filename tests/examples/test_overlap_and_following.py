"""The example that correlates overlap and following, on real and synthetic runs."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import cv2
import duckdb
import numpy as np
import pytest
from scipy.stats import spearmanr

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "overlap_and_following.py"


def compared(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(EXAMPLE), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)


def written(folder: Path, column: str, rows: list[tuple[str, int, float]]) -> Path:
    folder.mkdir()
    values = ", ".join(
        f"('{tracker.partition('@')[0]}', 'default', '{{}}', '{tracker}', '', 'corridor', {seed}, {value})"
        for tracker, seed, value in rows
    )
    columns = f"tracker, preset, params, label, condition, scenario, seed, {column}"
    table = f"SELECT * FROM (VALUES {values}) AS t({columns})"
    duckdb.execute(f"COPY ({table}) TO '{folder / 'summary.parquet'}' (FORMAT parquet)")
    return folder


@pytest.mark.slow
def test_correlation_is_over_the_episodes_that_all_trackers_have(tmp_path: Path):
    seeds = range(6)
    overlaps = {"a": 0.2, "b": 0.5, "c": 0.9}
    opened = written(tmp_path / "open", "mean_overlap", [(one, s, v) for one, v in overlaps.items() for s in seeds])
    # Seed 5 would turn the order round, but c has not driven it.
    followed = {"a@13ms+servo": 0.0, "b@13ms+servo": 0.0, "c@13ms+servo": 1.0}
    drives = [(one, seed, value) for one, value in followed.items() for seed in range(5)]
    drives += [("a@13ms+servo", 5, 1.0), ("b@13ms+servo", 5, 1.0)]
    closed = written(tmp_path / "closed", "follow_success", drives)
    done = compared(opened, closed, "--out", tmp_path / "scatter.png")
    assert done.returncode == 0, done.stderr
    assert "Spearman 0.866, without noise 0.866 (0.866 to 0.866): 3 points, 5 episodes each" in done.stdout
    picture = cv2.imread(str(tmp_path / "scatter.png"))
    assert picture is not None
    assert picture.std() > 10.0


def test_measures_between_0_and_1_are_drawn(tmp_path: Path):
    seeds = range(3)
    overlaps, within = {"a": 0.2, "b": 0.5, "c": 0.9}, {"a": 0.3, "b": 0.1, "c": 0.8}
    opened = written(tmp_path / "open", "mean_overlap", [(one, s, v) for one, v in overlaps.items() for s in seeds])
    shares = [(one, seed, value + 0.01 * seed) for one, value in within.items() for seed in seeds]
    closed = written(tmp_path / "closed", "follow_within", shares)
    done = compared(opened, closed, "--measure", "follow_within", "--out", tmp_path / "scatter.png")
    assert done.returncode == 0, done.stderr
    assert "Spearman 0.500: 3 points, 3 episodes each" in done.stdout, "three episodes have no interval"
    assert (tmp_path / "scatter.png").stat().st_size > 5000


def test_runs_without_common_trackers_are_errors(tmp_path: Path):
    opened = written(tmp_path / "open", "mean_overlap", [("a", 0, 0.5)])
    closed = written(tmp_path / "closed", "follow_success", [("b", 0, 1.0)])
    done = compared(opened, closed, "--out", tmp_path / "scatter.png")
    assert done.returncode == 1
    assert "share 0 trackers and conditions and 0 whole episodes" in done.stderr
    assert not (tmp_path / "scatter.png").exists()


def test_a_folder_that_is_no_finished_run_is_an_error(tmp_path: Path):
    opened = written(tmp_path / "open", "mean_overlap", [("a", 0, 0.5)])
    done = compared(opened, tmp_path / "nowhere")
    assert done.returncode == 2
    assert done.stderr.endswith(f"{tmp_path / 'nowhere'} is no finished run: it has no summary.parquet\n")


@pytest.mark.slow
def test_runs_of_bench_and_follow_fit_together(tmp_path: Path):
    short = ["duration_s=0.3", "camera.width_px=64", "camera.height_px=48", "lights.shadows=false"]
    for word in ("bench", "follow"):
        command = [sys.executable, "-c", "from pftrack_sim.cli import main; main()", word, "corridor"]
        command += ["--trackers", "oracle,ko2012,stay"]
        command += ["--axis", "jitter=0,1", "--seeds", "0:2", "--videos", "none", "--out", str(tmp_path / word)]
        command += [part for one in short for part in ("--set", one)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
        assert done.returncode == 0, done.stdout + done.stderr
    done = compared(
        tmp_path / "bench",
        tmp_path / "follow",
        *("--measure", "follow_within", "--predictors", "--out", tmp_path / "scatter.png"),
    )
    assert done.returncode == 0, done.stderr
    assert "6 points, 2 episodes each" in done.stdout
    (said,) = [line for line in done.stdout.splitlines() if line.startswith("Spearman")]
    rows = [line for line in done.stdout.splitlines() if "; " in line]
    assert [row.split()[0] for row in rows] == ["mean_overlap", "first_loss_s", "not_lost", "confidence_auc"]
    assert said in rows[0], "the overlap by its frames is that of the summary"


def coverage(spread: float, runs: int) -> tuple[float, ...]:
    """Mean correlation, shares of intervals and of bootstrap percentiles that cover it, and of corrections that help.

    40 points of 20 episodes, whose following scatters by `spread` about their overlap.
    """
    example, found = runpy.run_path(str(EXAMPLE)), []
    generator, resampling = np.random.default_rng(0), np.random.default_rng(1)
    for _ in range(runs):
        level = generator.uniform(0.1, 0.9, (40, 1))
        expected = np.clip(level + generator.normal(0.0, spread, (40, 1)), 0.05, 0.95)
        true = spearmanr(level, expected).statistic
        overlap = level + generator.normal(0.0, 0.2, (40, 20))
        pairs = example["Pairs"]([], overlap, generator.beta(2.0 * expected, 2.0 * (1.0 - expected), (40, 20)))
        rho = example["spearman"](pairs)
        measured, (value, low, high) = rho(np.full((1, 20), 0.05))[0], example["interval_of"](rho, 20)
        first, last = np.quantile(rho(resampling.multinomial(20, np.full(20, 0.05), 500) / 20), (0.025, 0.975))
        found.append((true, low <= true <= high, first <= true <= last, abs(value - true) < abs(measured - true)))
    return tuple(np.mean(found, axis=0).tolist())


def test_the_interval_covers_the_correlation_without_noise():
    _, covered, _, nearer = coverage(0.12, 40)
    assert covered >= 35 / 40, "95 % of 40 are 38"
    assert nearer >= 30 / 40, "the value without noise is nearer to the true one"
