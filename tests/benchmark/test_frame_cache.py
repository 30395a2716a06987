"""Cached frames are those that were drawn, whatever happens to the cache."""

import multiprocessing
import os
from pathlib import Path
from typing import Any

import pytest

from pftrack_sim.benchmark import RunStore, run
from pftrack_sim.benchmark.running import episode, frame_cache
from pftrack_sim.benchmark.running.frame_cache import FrameCache
from pftrack_sim.benchmark.running.rollout import rollout, simulated
from pftrack_sim.benchmark.running.sinks import TruthLog
from pftrack_sim.simulation.simulation import Simulation
from tests.benchmark.small import contents, small_plan

PLAN = small_plan(range(1), ["oracle", "stay"], **{"distractors.count": 1})


def fill(started: Any, path: Path, cache: FrameCache) -> None:
    """Run two episodes as soon as another process is about to do so too."""
    started.wait(200)
    run(small_plan(range(2)), path, videos="none", cache=cache)


def test_a_second_run_takes_the_frames_from_the_cache_until_they_are_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    cache = FrameCache(tmp_path / "cache", 10**9)
    pictures: list[bytes] = []
    picture = episode.picture
    monkeypatch.setattr(
        episode, "picture", lambda *a, **k: (shown := picture(*a, **k), pictures.append(shown.tobytes()))[0]
    )
    drawn = run(PLAN, tmp_path / "drawn", videos="first").path
    filmed = list(pictures)
    run(PLAN, tmp_path / "filling", videos="none", cache=cache)
    (entry,) = (tmp_path / "cache").iterdir()
    assert cache.size_bytes > 4 * 72 * 96 * 3
    resets: list[int] = []
    reset = Simulation.reset
    monkeypatch.setattr(Simulation, "reset", lambda self, seed: (resets.append(seed), reset(self, seed))[1])
    cached = run(PLAN, tmp_path / "cached", videos="first", cache=cache).path
    assert not resets
    assert contents(cached) == contents(drawn)
    frames = "SELECT * EXCLUDE (ms) FROM frames ORDER BY label, frame"
    assert str(RunStore(cached).query(frames)) == str(RunStore(drawn).query(frames))
    # Not the files: x264 encodes one video in a hundred otherwise, of the same pictures.
    assert filmed
    assert pictures == 2 * filmed
    for name, place in (("frames.raw", 3000), ("truth.npz", 60)):
        content = bytearray((entry / name).read_bytes())
        content[place] ^= 255
        (entry / name).write_bytes(content)
        resets.clear()
        again = run(PLAN, tmp_path / f"damaged-{name}", videos="none", cache=cache).path
        assert resets == [0]
        assert contents(again) == contents(drawn)
    (entry / "frames.raw").write_bytes(b"")
    assert cache.open(entry) is None
    assert not entry.exists()


def test_two_writers_of_the_same_episode_leave_one_entry(tmp_path: Path):
    cache, entry = FrameCache(tmp_path / "cache", 10**9), tmp_path / "cache/entry"
    log = TruthLog()
    with (
        Simulation(PLAN.episode(0).scenario) as simulation,
        cache.writer(entry, log) as one,
        cache.writer(entry, log) as other,
    ):
        rollout(simulated(simulation, 0), (), [log, one, other])
    assert list(cache.folder.iterdir()) == [entry]
    cached, again = cache.open(entry), TruthLog()
    assert cached is not None
    rollout(cached.samples(), (), [again])
    assert again.frames_digest == log.frames_digest == cached.frames_digest
    assert again.truths == log.truths


@pytest.mark.slow
def test_two_processes_fill_one_cache_at_once(tmp_path: Path):
    plan, cache = small_plan(range(2)), FrameCache(tmp_path / "cache", 10**9)
    drawn = contents(run(plan, tmp_path / "drawn", videos="none").path)
    processes = multiprocessing.get_context("spawn")
    started = processes.Barrier(2)
    names = ("one", "other")
    fillers = [processes.Process(target=fill, args=(started, tmp_path / name, cache)) for name in names]
    for filler in fillers:
        filler.start()
    for filler in fillers:
        filler.join(200)
    assert [filler.exitcode for filler in fillers] == [0, 0]
    assert len(list(cache.folder.iterdir())) == 2, "one entry for each seed, and nothing half written"
    for name in names:
        assert contents(tmp_path / name) == drawn
    assert contents(run(plan, tmp_path / "cached", videos="none", cache=cache).path) == drawn


def test_the_entries_not_used_for_longest_go_first(tmp_path: Path):
    cache = FrameCache(tmp_path, 350)
    assert cache.size_bytes == 0
    for age, name in enumerate(("new", "middle", "old", ".part-now")):
        (tmp_path / name).mkdir()
        frames = tmp_path / name / "frames.raw"
        frames.write_bytes(bytes(100))
        for path in (frames, tmp_path / name):
            os.utime(path, (1e9 - age, 1e9 - age))
    os.utime(frames)  # An episode that another worker began to write long ago goes on.
    cache.evict()
    assert sorted(one.name for one in tmp_path.iterdir()) == [".part-now", "middle", "new"]


def test_whatever_changes_frames_changes_the_entry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    cache = FrameCache(tmp_path, 1)
    one, other = small_plan(range(2), ["stay"]), small_plan(range(1), ["oracle"], **{"camera.height_m": 1.3})
    entries = {cache.entry(episode.frames_key, None) for plan in (one, other) for episode in plan.episodes()}
    assert len(entries) == 3
    assert cache.entry(small_plan(range(1), ["oracle"]).episode(0).frames_key, None) in entries
    monkeypatch.setattr(frame_cache, "_renderer", lambda *_: "another")
    entries.add(cache.entry(one.episode(0).frames_key, None))
    assert len(entries) == 4
