"""A tracker's process is kept between episodes: it loads once, and an episode knows nothing of earlier ones."""

import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pftrack_sim.trackers.isolation import IsolatedTracker, TrackerCode, TrackerFault, TrackerProcesses
from pftrack_sim.trackers.isolation import process as parent

linux = pytest.mark.skipif(sys.platform != "linux", reason="other systems start a process for each episode")
IMAGE = np.zeros((9, 12, 3), np.uint8)
SEEDS = (5, 9, 5)


def played(
    processes: TrackerProcesses | None, factory: str, seed: int, log: Path | None = None, *, sandboxed: bool = False
) -> list[float]:
    params = {} if log is None else {"log": str(log)}
    code = TrackerCode(f"tests.trackers.kept_trackers:{factory}", params=params, sandboxed=sandboxed)
    tracker = IsolatedTracker(code, seed=seed, processes=processes)
    try:
        tracker.init(IMAGE, [1, 2, 3, 4])
        return [value for _ in range(2) for value in tracker.update(IMAGE).box]
    finally:
        tracker.close()


@linux
@pytest.mark.parametrize(
    ("factory", "log"),
    [
        ("reads_seed", {"loaded": 1, "made": 1 + len(SEEDS)}),
        ("with_reset", {"made": 1}),
        ("with_thread", {"made": 1 + len(SEEDS)}),
    ],
)
def test_the_same_seed_gives_the_same_bits_after_any_episodes(tmp_path: Path, factory: str, log: dict[str, int]):
    """As in a process of its own for each episode; what is slow happens once."""
    alone = {seed: played(None, factory, seed) for seed in (5, 9)}
    with TrackerProcesses() as processes:
        kept = [played(processes, factory, seed, tmp_path / "log") for seed in SEEDS]
    assert kept == [alone[seed] for seed in SEEDS]
    assert alone[5] != alone[9]
    words = [line.split()[0] for line in (tmp_path / "log").read_text().splitlines()]
    assert {word: words.count(word) for word in words} == log


MODULE = """
import os, pathlib, threading
from tests.trackers.kept_trackers import Leaky
with pathlib.Path({log!r}).open("a") as file:
    file.write(f"{{os.getpid()}}\\n")
class Numbered(Leaky):
    def update(self, image):
        return type(super().update(image))([os.getpid(), 1, 2, 3])
def make(*, seed, **_):
    threading.Thread(target=threading.Event().wait, daemon=True).start()
    return Numbered(seed)
"""


@linux
def test_the_next_process_of_a_tracker_that_cannot_be_forked_imports_it_early(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(parent, "namespace_command", tuple)  # one numbering of processes
    log = tmp_path / "log"
    (tmp_path / "numbered_module.py").write_text(MODULE.format(log=str(log)))
    with TrackerProcesses() as processes:

        def serving(seed: int) -> float:
            tracker = IsolatedTracker(TrackerCode("numbered_module:make"), seed=seed, processes=processes)
            tracker.init(IMAGE, [1, 2, 3, 4])
            number = tracker.update(IMAGE).box[0]
            tracker.close()
            return number

        first, second = serving(1), serving(2)
        until_s = time.monotonic() + 60.0
        while len(log.read_text().splitlines()) < 3 and time.monotonic() < until_s:
            time.sleep(0.01)
        imported = [float(line) for line in log.read_text().splitlines()]
        assert set(imported[:3]) >= {first, second}
        ready = next(one for one in imported if one not in (first, second))
        assert serving(3) == ready
    assert not Path(f"/proc/{ready:.0f}").exists()


@linux
def test_what_an_episode_started_ends_with_it_while_its_process_is_kept(monkeypatch: pytest.MonkeyPatch):
    for command in (parent.namespace_command, tuple):
        monkeypatch.setattr(parent, "namespace_command", command)
        with TrackerProcesses() as processes:
            for _ in range(2):
                child = int(played(processes, "leaves_a_child", 0)[0])
                assert child > 0
                assert not Path(f"/proc/{child}").exists()


@linux
def test_what_is_printed_is_kept_per_episode():
    said: list[str | None] = []
    with TrackerProcesses() as processes:
        for seed in (1, 2, 3):
            code = TrackerCode("tests.trackers.kept_trackers:prints")
            tracker = IsolatedTracker(code, seed=seed, processes=processes)
            tracker.init(IMAGE, [1, 2, 3, 4])
            tracker.close()
            said.append(tracker.printed)
    assert said == [f"my seed is {seed}" for seed in (1, 2, 3)]


@linux
def test_only_a_tracker_that_failed_is_loaded_again(tmp_path: Path):
    log = tmp_path / "log"
    with TrackerProcesses() as processes:
        for _ in range(2):
            with pytest.raises(TrackerFault, match=r"lost my way \(kept_trackers.py, line \d+, in look\)") as caught:
                played(processes, "raises", 0, log)
            assert "in update" in caught.value.traceback
            assert 'raise ValueError("lost my way")' in caught.value.traceback
            assert "child.py" not in caught.value.traceback
    assert len(log.read_text().splitlines()) == 2 * 2, "each time in advance and for the episode"
