"""Closed-loop runs: tracker and controller in one, latency charged, everything written down."""

import json
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pytest

from pftrack_sim.bench import follow
from pftrack_sim.errors import ParameterError, UnknownNameError

SMALL: dict[str, Any] = {
    "camera.width_px": 96,
    "camera.height_px": 72,
    "lights.shadows": False,
    "duration_s": 1.0,
    "distractors.count": 0,
    "occluders": [],
}
THIS = "test_follow"


class Raises:
    """Works for ten frames."""

    def __init__(self) -> None:
        self.frames = 0

    def reset(self, rig) -> None:
        pass

    def act(self, estimate, proprio):
        self.frames += 1
        if self.frames > 10:
            raise RuntimeError("the motor is on fire")
        return np.zeros(4)


class Unsure(Raises):
    """Commands that are no numbers."""

    def act(self, estimate, proprio):
        return np.full(4, np.nan)


def drives(**more: Any) -> tuple[follow.Drive, ...]:
    given: dict[str, Any] = {
        "names": ["plaza-walk"],
        "tracker_names": ["oracle"],
        "controller_names": ["servo-avoid"],
        "seeds": [1],
        "overrides": SMALL,
        **more,
    }
    return follow.make_drives(**given)


def test_a_run_folder_says_all(tmp_path: Path):
    out = tmp_path / "run"
    results = follow.run(drives(tracker_names=["oracle", "stay"], latency_ms={"stay": 40.0}), out)
    assert [one.drive.tracker for one in results] == ["oracle", "stay"]
    assert results[0].outcome == "finished"
    assert results[0].overlap.mean_overlap == 1.0
    assert 0.0 < results[1].overlap.mean_overlap < 1.0
    record = json.loads((out / "run.json").read_text())
    for row in record["episodes"]:
        table = duckdb.sql(f"SELECT * FROM '{out / row['file']}'").fetchnumpy()
        assert len(table["frame"]) == 30
        gaps = np.hypot(table["robot_x_m"] - table["target_x_m"], table["robot_y_m"] - table["target_y_m"])
        # The camera is not quite above the axle.
        assert np.abs(gaps[1:] - table["distance_m"][:-1]).max() < 0.15
    summary = duckdb.sql(f"SELECT tracker, latency_ms, outcome FROM '{out / 'summary.parquet'}'").fetchall()
    assert summary == [("oracle", 0.0, "finished"), ("stay", 40.0, "finished")]
    assert len(list((out / "videos").glob("*.mp4"))) == 2
    with pytest.raises(ParameterError, match="videos"):
        follow.run(drives(), tmp_path / "other", videos="some")


def test_the_latency_axis_and_the_same_bits_twice():
    late = drives(axes={"latency": [0.0, 55.0]})
    assert [one.latency_ms for one in late] == [0.0, 55.0]
    first, second, slow = (follow.drive(one)[0] for one in (late[0], late[0], late[1]))
    assert first == second
    assert slow.frames_digest != first.frames_digest
    assert slow.overlap.mean_overlap < first.overlap.mean_overlap


@pytest.mark.parametrize(
    ("controller", "says"),
    [("Raises", "frame 10: RuntimeError: the motor is on fire"), ("Unsure", "frame 0: CommandE")],
)
def test_a_controller_that_fails_is_recorded_and_the_robot_stands(controller: str, says: str):
    (one,) = drives(controller_names=[f"{THIS}:{controller}"])
    driven, table = follow.drive(one)
    assert driven.failure is not None
    assert driven.failure.startswith(says)
    assert driven.outcome in ("finished", "lost")
    assert not np.array(table["command"].tolist())[-10:].any()


@pytest.mark.parametrize(
    "wrong",
    [
        {"latency_ms": {"ko2012": 5.0}},
        {"latency_ms": {"oracle": -1.0}},
        {"axes": {"latency": [float("nan")]}},
        {"controller_names": []},
        {"controller_names": ["still", "still"]},
    ],
)
def test_impossible_plans(wrong: dict[str, Any]):
    with pytest.raises(ParameterError):
        drives(**wrong)


def test_unknown_names():
    with pytest.raises(UnknownNameError, match="servo"):
        drives(controller_names=["sevro"])
    with pytest.raises(UnknownNameError, match="oracle"):
        drives(tracker_names=["oracel"])
