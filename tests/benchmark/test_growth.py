"""Runs grow by seeds, trackers, levels and videos; what was there stays as it is."""

from pathlib import Path
from typing import Any

import pytest

from pftrack_sim.benchmark import Plan, RunStore, make_plan, parse_seeds, run
from pftrack_sim.benchmark.asked.growth import grown, held_besides
from pftrack_sim.benchmark.filming import film, worst
from pftrack_sim.benchmark.kept.check import check
from pftrack_sim.core.errors import ParameterError, RunError
from tests.benchmark.small import SMALL

STILL = "tests.benchmark.test_growth:still"


class Still:
    def init(self, image: Any, box: Any) -> None:
        self.box = box

    def update(self, image: Any) -> Any:
        from pftrack_sim.core.records import Estimate

        return Estimate(self.box)


def still(**_: Any) -> Still:
    return Still()


def plan_of(seeds: str, trackers: list[str], axes: dict[str, list[float]] | None = None, **more: Any) -> Plan:
    changes = {**SMALL, **more.pop("changes", {})}
    return make_plan(["corridor"], trackers, parse_seeds(seeds), axes=axes or {}, overrides=changes, **more)


def files(path: Path) -> dict[str, tuple[int, bytes]]:
    found = sorted((path / "episodes").rglob("*.parquet"))
    return {str(file.relative_to(path)): (file.stat().st_mtime_ns, file.read_bytes()) for file in found}


def rows(path: Path, where: str) -> list[tuple[Any, ...]]:
    query = f"SELECT * FROM frames WHERE {where} ORDER BY condition, seed, label, frame"
    return [tuple(str(cell) for cell in row) for row in RunStore(path).query(query).rows]


@pytest.mark.slow
def test_a_run_grows_and_what_was_there_stays(tmp_path: Path):
    out, jitter = tmp_path / "run", {"jitter": [0.0]}
    run(plan_of("0", ["oracle"], jitter), out, videos="none")
    first = files(out)
    run(plan_of("0:2", ["oracle"], jitter), out, videos="none")
    second = files(out)
    assert second.items() >= first.items()
    assert len(second) == 2
    run(plan_of("1", ["oracle"], {"jitter": [0.0, 1.0]}), out, videos="none")
    third = files(out)
    assert third.items() >= second.items()
    assert sorted(set(third) - set(second)) == ["episodes/corridor/jitter-1/seed-0001.parquet"]
    before = rows(out, "tracker = 'oracle'")
    run(plan_of("0", ["stay"], jitter), out, videos="worst:1")
    assert rows(out, "tracker = 'oracle'") == before
    counts = RunStore(out).query("SELECT tracker, count(*) FROM summary GROUP BY tracker ORDER BY tracker").rows
    assert counts == [("oracle", 3), ("stay", 3)]
    assert check(out).good, check(out).problems
    videos = {file.relative_to(out / "videos").with_suffix("") for file in (out / "videos").rglob("*.mp4")}
    assert 1 <= len(videos) <= 2
    at_once = tmp_path / "at-once"
    run(grown(plan_of("0:2", ["oracle"], jitter), RunStore(out).plan), at_once, videos="none")
    everything = "SELECT * EXCLUDE (ms) FROM frames ORDER BY condition, seed, label, frame"
    assert str(RunStore(at_once).query(everything)) == str(RunStore(out).query(everything))


def test_what_a_folder_holds_besides_is_named():
    stored = plan_of("0:8", ["stay", "ncc"], {"jitter": [0.0, 2.0]})
    assert held_besides(stored, stored) == ""
    assert held_besides(stored, plan_of("0:9", ["oracle", "ncc", "stay"], {"jitter": [2.0, 0.0, 1.0]})) == ""
    named = held_besides(stored, plan_of("2:4,9", ["ncc"], {"jitter": [0.0]}))
    assert named == "conditions jitter=2; trackers stay; seeds 0:2,4:8"


def test_a_plan_that_contradicts_the_folder_is_refused(tmp_path: Path):
    stored = plan_of("0:2", ["stay"])
    for other in (plan_of("0", ["stay"], changes={"duration_s": 0.5}), plan_of("0", ["stay"], controllers=["still"])):
        with pytest.raises(ParameterError, match=r"there|differ"):
            grown(stored, other)
    assert grown(stored, plan_of("1", ["stay"])) is stored
    run(stored, tmp_path / "run", videos="none")
    with pytest.raises(RunError, match="holds another plan"):
        run(plan_of("0", ["stay"], changes={"duration_s": 0.5}), tmp_path / "run", videos="none")


@pytest.mark.slow
def test_a_run_that_is_interrupted_while_it_grows_is_readable_and_goes_on(tmp_path: Path):
    out = tmp_path / "run"
    run(plan_of("0:2", ["oracle"]), out, videos="none")
    run(plan_of("0:2", ["stay"]), out, videos="none", part=(1, 2))
    assert check(out).problems == ("episodes/corridor/base/seed-0001.parquet: lacks stay",)
    assert not RunStore(out).finished
    assert [(one.seed, one.label) for one in RunStore(out).results] == [(0, "oracle"), (0, "stay"), (1, "oracle")]
    run(plan_of("0:2", ["stay"]), out, videos="none")
    assert check(out).good
    assert RunStore(out).finished


@pytest.mark.slow
@pytest.mark.parametrize("loop", ["open", "follow"])
def test_the_worst_episodes_are_filmed_from_what_is_stored(tmp_path: Path, loop: str):
    out = tmp_path / "run"
    controllers = ["servo"] if loop == "follow" else []
    latency = {"latency_ms": {STILL: 30.0}} if loop == "follow" else {}
    plan = plan_of("0:3", [STILL], controllers=controllers, changes={"duration_s": 0.8}, **latency)
    run(plan, out, videos="none", isolation="never")
    store = RunStore(out)
    (lowest,) = worst(store.results, 1, tracker=STILL)
    assert lowest.number("mean_overlap") == min(one.number("mean_overlap") for one in store.results)
    with RunStore.begin(out, plan) as writing:
        (video,) = film(writing, [lowest])
        writing.write_summary()
    assert video == RunStore(out).video_of(lowest)
    assert video.stat().st_size > 1000
    assert check(out).good
    with pytest.raises(ParameterError, match=">= 1"):
        worst(store.results, 0)


@pytest.mark.slow
@pytest.mark.parametrize("loop", ["open", "follow"])
def test_a_film_of_other_frames_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, loop: str):
    controllers = ["servo"] if loop == "follow" else []
    plan = plan_of("0:1", [STILL], controllers=controllers)
    run(plan, tmp_path, videos="none", isolation="never")
    with RunStore.begin(tmp_path, plan) as writing:
        columns = RunStore.frame_columns
        with monkeypatch.context() as changed:
            changed.setattr("pftrack_sim.benchmark.filming.TruthLog.frames_digest", property(lambda _: "other"))
            with pytest.raises(RunError, match="are not those that the trackers saw"):
                film(writing, writing.results)
        # One frame fewer is stored than is drawn.
        shortened = lambda *given: {name: column[:-1] for name, column in columns(*given).items()}  # noqa: E731
        monkeypatch.setattr(RunStore, "frame_columns", shortened)
        with pytest.raises(RunError, match="are not those that the trackers saw"):
            film(writing, writing.results)
    assert not list(tmp_path.rglob("*.mp4"))
