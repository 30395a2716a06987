"""The contents of a run folder."""

import json
from pathlib import Path
from typing import Any

import av
import duckdb
import numpy as np
import pytest

from pftrack_sim.benchmark import Plan, make_plan, plan_all, run
from pftrack_sim.benchmark.running.frame_cache import FrameCache
from pftrack_sim.benchmark.running.progress import RunProgress
from pftrack_sim.core import boxes
from pftrack_sim.core.errors import RunError, UnknownNameError
from tests.benchmark import small

SMALL: dict[str, Any] = {**small.SMALL, "camera.rate_hz": 30, "duration_s": 0.6, "distractors.count": 1}


def rows(path: Path, query: str) -> list[tuple[Any, ...]]:
    return duckdb.sql(query.replace("{}", str(path))).fetchall()


def test_a_run_folder_holds_plan_frames_scores_and_videos(tmp_path: Path):
    seen: list[RunProgress] = []
    plan = make_plan(["warehouse"], ["oracle", "stay"], [0, 1], overrides=SMALL)
    results = run(plan, tmp_path / "out", on_progress=seen.append).results
    assert seen[-1].frames == plan.frame_count == 36
    assert [one.done for one in seen if one.episode] == [1, 2]
    assert seen[-1].means["oracle"] == 1.0
    assert seen[-1].left_s == 0.0
    assert [(one.seed, one.label) for one in results] == [(0, "oracle"), (0, "stay"), (1, "oracle"), (1, "stay")]
    assert all(one.measures.mean_overlap == 1.0 for one in results if one.label == "oracle")
    record = json.loads((tmp_path / "out/run.json").read_text())
    assert Plan.model_validate(record["plan"]) == plan
    assert record["finished"]
    assert record["sessions"][0]["versions"]["mujoco"].startswith("4.")
    frames = "SELECT count(*), min(len(estimate)) FROM '{}/out/episodes/*/*/*.parquet' WHERE tracker = 'oracle'"
    assert rows(tmp_path, frames) == [(36, 4)]
    assert rows(tmp_path, "SELECT count(*), min(len(box)) FROM '{}/out/frames/*/*/*.parquet'") == [(36, 4)]
    summary = rows(tmp_path, "SELECT tracker, avg(mean_overlap) FROM '{}/out/summary.parquet' GROUP BY 1 ORDER BY 1")
    assert summary[0] == ("oracle", 1.0)
    videos = list((tmp_path / "out/videos").rglob("*.mp4"))
    assert [video.parent for video in videos] == [tmp_path / "out/videos/warehouse/base"]
    with av.open(str(videos[0])) as opened:
        stream = opened.streams.video[0]
        assert (stream.codec_context.name, stream.frames, stream.width) == ("h264", 18, 96)
    assert not list((tmp_path / "out").rglob("*.part*"))


def test_an_exception_ends_only_its_own_tracker(tmp_path: Path):
    overrides = {**SMALL, "camera.width_px": 160, "camera.height_px": 120}
    alone = run(make_plan(["corridor"], ["ko2012"], [4], overrides=overrides), tmp_path / "a", videos="none")
    names = ["tests.benchmark.faulty_trackers:raises", "ko2012"]
    plan = make_plan(["corridor"], names, [4], overrides=overrides)
    both = run(plan, tmp_path / "b", videos="none", isolation="never").results
    query = "SELECT * EXCLUDE ms FROM '{}/episodes/*/*/*.parquet' WHERE tracker = 'ko2012' ORDER BY frame"
    assert str(rows(tmp_path / "a", query)) == str(rows(tmp_path / "b", query))
    assert alone.results[0].measures.mean_overlap == both[1].measures.mean_overlap
    assert both[0].error is not None
    assert both[0].error.startswith("frame 2: ValueError: lost my way (faulty_trackers.py, line ")
    assert both[1].error is None


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path):
    (tmp_path / "mine.txt").write_text("precious")
    with pytest.raises(RunError, match="not an empty folder"):
        run(make_plan(["plaza-walk"], ["stay"], [0], overrides=SMALL), tmp_path)
    assert [one.read_text() for one in tmp_path.iterdir()] == ["precious"]


@pytest.mark.parametrize("box", ["box", "amodal_box", "visible_box"])
def test_scores_are_against_the_box_that_was_asked_for(tmp_path: Path, box: str):
    plan = plan_all(["warehouse"], trackers=["stay"], seeds=[0], overrides=SMALL, truth=box)
    store = run(plan, tmp_path / "out", workers=0, videos="none")
    found = store.query(f"SELECT estimate, {box}, overlap FROM frames WHERE scored").rows
    said, true, overlap = (np.array([one[index] for one in found], dtype=np.float64) for index in range(3))
    assert len(found) > 5
    assert np.allclose(overlap, np.minimum(boxes.pairwise_iou(said, true), 1.0), rtol=0, atol=1e-12)


def test_an_unknown_box_is_named():
    with pytest.raises(UnknownNameError, match=r"unknown box of the truth 'visible'; did you mean 'visible_box'\?"):
        plan_all(["warehouse"], truth="visible")


def test_first_boxes_and_starts_are_axes_of_the_run_on_the_same_frames(tmp_path: Path):
    cache = FrameCache(tmp_path / "cache", 10**9)
    axes = {"box_noise": (0.0, 0.2), "start": (0.0, 0.5)}
    slow = {**SMALL, "duration_s": 0.8, "camera.rate_hz": 10}
    plan = make_plan(["corridor"], ["oracle", "stay"], [0, 1], axes=axes, overrides=slow)
    store = run(plan, tmp_path / "run", videos="none", cache=cache)
    base = run(make_plan(["corridor"], ["stay"], [0], overrides=slow), tmp_path / "base", videos="none", cache=cache)
    assert len(list(cache.folder.iterdir())) == 2, "an entry for each seed"
    assert len({one.values["frames_digest"] for one in store.results if one.seed == 0}) == 1
    overlaps = {
        (one.condition.name, one.seed, one.label): (one.number("mean_overlap"), one.number("frames"))
        for one in store.results
    }
    assert overlaps["box_noise=0,start=0", 0, "stay"] == (
        base.results[0].number("mean_overlap"),
        base.results[0].number("frames"),
    )
    assert overlaps["box_noise=0.2,start=0", 0, "stay"][0] != overlaps["box_noise=0,start=0", 0, "stay"][0]
    assert overlaps["box_noise=0.2,start=0", 0, "oracle"] == (1.0, 7.0)
    assert overlaps["box_noise=0.2,start=0.5", 0, "oracle"] == (1.0, 3.0)
    rows = store.query(
        "SELECT count(*), count(*) FILTER (scored), min(frame) FILTER (status = 'init') FROM frames "
        "WHERE condition = 'box_noise=0,start=0.5' AND label = 'stay' AND seed = 1"
    ).rows
    assert rows == [(8, 4, 4)]
