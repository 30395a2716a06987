"""A run leaves a folder that says everything, and the same plan gives the same scores."""

import json
from pathlib import Path
from typing import Any

import av
import duckdb
import numpy as np
import pytest

from pftrack_sim.bench import make_plan, run
from pftrack_sim.errors import ParameterError, RunError, UnknownNameError

SMALL: dict[str, Any] = {
    "camera.width_px": 96,
    "camera.height_px": 72,
    "lights.shadows": False,
    "duration_s": 0.6,
    "distractors.count": 1,
}


class Raises:
    """A stranger's tracker that breaks at its third frame."""

    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        self.seen = 0

    def update(self, image: np.ndarray) -> Any:
        image[:] = 0  # its own copy: nobody else may notice
        self.seen += 1
        if self.seen == 3:
            raise ValueError("lost my way")
        from pftrack_sim.records import Estimate

        return Estimate([0, 0, 5, 5])


def breaking(**_: Any) -> Raises:
    return Raises()


def rows(path: Path, query: str) -> list[tuple[Any, ...]]:
    return duckdb.sql(query.replace("{}", str(path))).fetchall()


def test_a_run_folder_tells_everything(tmp_path: Path):
    ticks: list[int] = []
    plan = make_plan(["warehouse"], ["oracle", "stay"], [0, 1], overrides=SMALL)
    results = run(plan, tmp_path / "out", on_frame=lambda: ticks.append(1))
    assert len(ticks) == plan.frame_count == 36
    assert [(one.seed, one.tracker) for one in results] == [(0, "oracle"), (0, "stay"), (1, "oracle"), (1, "stay")]
    assert all(one.summary.mean_overlap == 1.0 for one in results if one.tracker == "oracle")
    record = json.loads((tmp_path / "out/run.json").read_text())
    assert record["seeds"] == [0, 1]
    assert record["graphics"]
    assert record["versions"]["mujoco"].startswith("4.")
    assert len(record["episodes"]) == 4
    assert all((tmp_path / "out" / one["file"]).is_file() for one in record["episodes"])
    frames = rows(tmp_path, "SELECT count(*), min(len(box)), avg(overlap) FROM '{}/out/episodes/*oracle.parquet'")
    assert frames[0][:2] == (36, 4)
    summary = rows(tmp_path, "SELECT tracker, avg(mean_overlap) FROM '{}/out/summary.parquet' GROUP BY 1 ORDER BY 1")
    assert summary[0] == ("oracle", 1.0)
    videos = list((tmp_path / "out/videos").iterdir())
    assert [path.name for path in videos] == ["warehouse__seed-0000.mp4"]
    with av.open(str(videos[0])) as opened:
        stream = opened.streams.video[0]
        assert (stream.codec_context.name, stream.frames, stream.width) == ("h264", 18, 96)
    assert not list((tmp_path / "out").rglob("*.part*"))


def test_same_plan_same_scores_and_a_broken_tracker_hurts_only_itself(tmp_path: Path):
    overrides = {**SMALL, "camera.width_px": 160, "camera.height_px": 120}
    alone = run(make_plan(["corridor"], ["ko2012"], [4], overrides=overrides), tmp_path / "a", videos="none")
    names = ["tests.bench.test_run:breaking", "ko2012"]
    both = run(make_plan(["corridor"], names, [4], overrides=overrides), tmp_path / "b", videos="none")
    query = "SELECT frame, overlap, estimate FROM '{}/episodes/*__ko2012.parquet' ORDER BY 1"
    assert rows(tmp_path / "a", query) == rows(tmp_path / "b", query)
    assert alone[0].summary.mean_overlap == both[1].summary.mean_overlap
    assert both[0].failure == "frame 3: ValueError: lost my way"
    assert both[1].failure is None
    digests = [json.loads((tmp_path / run_name / "run.json").read_text())["frames_digest"] for run_name in "ab"]
    assert digests[0] == digests[1]


def test_nothing_is_written_when_a_name_is_wrong(tmp_path: Path):
    plan = make_plan(["plaza-walk"], ["ko2021"], [0], overrides=SMALL)
    with pytest.raises(UnknownNameError, match="did you mean 'ko2012'"):
        run(plan, tmp_path / "out")
    good = make_plan(["plaza-walk"], ["stay"], [0], overrides=SMALL)
    with pytest.raises(ParameterError, match="videos must be one of"):
        run(good, tmp_path / "out", videos="some")
    assert not (tmp_path / "out").exists()
    (tmp_path / "full").mkdir()
    (tmp_path / "full/mine.txt").write_text("precious")
    with pytest.raises(RunError, match="not an empty folder"):
        run(good, tmp_path / "full")
    assert (tmp_path / "full/mine.txt").read_text() == "precious"
