"""Trackers that start from anchors: frames in the other order, with the truth of each, and scores as VOT has them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim.benchmark import RunStore, TrackerSpec, make_plan, run
from pftrack_sim.benchmark.running.filming import film
from pftrack_sim.benchmark.running.frame_cache import FrameCache
from pftrack_sim.benchmark.said.anchors import anchor_scores
from pftrack_sim.cli.options import anchors
from pftrack_sim.report.tables import anchors as anchor_table
from tests.benchmark.small import SMALL, contents


def test_places_are_even_and_each_runs_where_more_frames_are():
    assert anchors(2) == [0.0, -1.0]
    assert anchors(5) == [0.0, 0.25, 0.5, -0.75, -1.0]


@pytest.mark.slow
def test_a_run_backward_shows_the_same_frames_in_the_other_order(tmp_path: Path):
    specs = [TrackerSpec(name="ko2012", params={"particle_count": 10}), TrackerSpec(name="stay")]
    plan = make_plan(
        ["corridor"], specs, [0, 1], axes={"start": [0.0, -0.5, -1.0]}, overrides={**SMALL, "duration_s": 2.0}
    )
    cache = FrameCache(tmp_path / "cache", 10**9)
    store = run(plan, tmp_path / "run", videos="none", workers=0)
    cached = run(plan, tmp_path / "cached", videos="none", workers=0, cache=cache)
    assert contents(cached.path) == contents(store.path)
    assert len(list(cache.folder.iterdir())) == 2

    def read(start: str) -> dict[str, Any]:
        (one,) = (one for one in store.results if (one.seed, one.label, one.condition.name) == (0, "stay", start))
        return store.frame_columns(one, ("frame", "time_s", "box", "image_motion_px", "scored", "status", "estimate"))

    forward, backward, half = read("start=0"), read("start=-1"), read("start=-0.5")
    count = len(forward["frame"])
    for name in ("box", "scored"):
        assert [*map(str, forward[name][::-1])] == [*map(str, backward[name])]
    np.testing.assert_allclose(forward["time_s"], backward["time_s"], atol=1e-9)
    np.testing.assert_allclose(forward["image_motion_px"][:0:-1], backward["image_motion_px"][1:])
    assert backward["image_motion_px"][0] == 0.0
    assert list(half["status"]) == ["waiting"] * (count // 2) + ["init"] + ["ok"] * (count // 2 - 1)
    assert str(half["estimate"][-1]) == str(forward["box"][count // 2 - 1])
    with RunStore.begin(tmp_path / "run", plan) as opened:
        assert film(opened, [one for one in opened.results if one.condition.name == "start=-1"][:1])[0].is_file()
    found = anchor_scores(store)
    assert found is not None
    assert {key: list(own) for key, own in found[0].items()} == {("base", one.label): [0, 1] for one in specs}
    assert found[1] == (10, 21)
    (table,) = anchor_table(store)
    assert [row[1:3] for row in table.rows] == [[one.label, "2"] for one in specs]


def test_forward_starts_have_no_such_scores(tmp_path: Path):
    plan = make_plan(["corridor"], ["stay"], [0], axes={"start": [0.0, 0.5]}, overrides=SMALL)
    assert anchor_scores(run(plan, tmp_path / "run", videos="none", workers=0)) is None
