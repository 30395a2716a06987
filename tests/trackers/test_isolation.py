"""A tracker in a process of its own: deadlines, bounds, and its end."""

import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pftrack_sim.core.text import describe_error, one_line, printable
from pftrack_sim.trackers.isolation import IsolatedTracker, Limits, TrackerCode, TrackerFault
from pftrack_sim.trackers.isolation import process as parent
from tests.fresh_process import printed

linux = pytest.mark.skipif(sys.platform != "linux", reason="other systems do not contain processes")
IMAGE = np.zeros((9, 12, 3), np.uint8)
LEAVES = "tests.trackers.kept_trackers:leaves_a_child"


@pytest.fixture(params=[True, False])
def namespaces(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    if not request.param:
        monkeypatch.setattr(parent, "namespace_command", tuple)
    return request.param


def test_text_from_outside_is_printable_and_bounded():
    hostile = "\udcff\x00\x1b[2J\u202e" + "x" * 1000
    for text in (printable(hostile), one_line(hostile), describe_error(ValueError(hostile))):
        assert text.isprintable()
        assert len(text.encode()) < 600
    assert printable("two\nlines é 人") == "two\nlines é 人"


@linux
def test_children_in_sessions_of_their_own_end_with_the_tracker(namespaces: bool):
    limits = Limits(frame_s=20.0)
    tracker = IsolatedTracker(TrackerCode(LEAVES, limits=limits), seed=0)
    tracker.init(IMAGE, [1, 2, 3, 4])
    child = Path(f"/proc/{int(tracker.update(IMAGE).box[0])}")
    assert child.exists()
    tracker.close()
    assert not child.exists()


def fails_at_the_second_update(name: str, words: str, limits: Limits, *, sandboxed: bool = False) -> None:
    code = TrackerCode(f"tests.attack.hostile_trackers:{name}", limits=limits, sandboxed=sandboxed)
    tracker = IsolatedTracker(code, seed=0)
    tracker.init(IMAGE, [1, 2, 3, 4])
    tracker.update(IMAGE)
    with pytest.raises(TrackerFault, match=words):
        tracker.update(IMAGE)
    tracker.close()


@linux
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("surrogate_in_exception", r"ValueError: \\udcff"),
        ("half_a_reply", "no answer within 0.5 s"),
        ("takes_shared_memory", "memory limit of 100 MB"),
        ("child_that_holds_everything", "exit code 7"),
        ("segfault", "SIGSEGV"),
        ("occluded_is_text", "cannot be read"),
    ],
)
def test_faults_of_a_tracker_are_named(name: str, words: str, namespaces: bool):
    fails_at_the_second_update(name, words, Limits(frame_s=20.0 if "half" not in name else 0.5, memory_mb=100))


@linux
def test_a_tracker_with_too_many_processes_is_ended():
    limits = Limits(frame_s=20.0, memory_mb=0, processes=5)
    fails_at_the_second_update("takes_memory_in_children", "started 5 processes or more", limits)


@linux
def test_a_process_ends_with_the_one_that_started_it():
    code = f"""
import os
import numpy as np
from pftrack_sim.trackers.isolation import IsolatedTracker, TrackerCode
image = np.zeros((9, 12, 3), np.uint8)
tracker = IsolatedTracker(TrackerCode("{LEAVES}"), seed=0)
tracker.init(image, [1, 2, 3, 4])
print(int(tracker.update(image).box[0]), flush=True)
os.kill(os.getpid(), 9)
"""
    pid = int(printed(code, ends_with=-signal.SIGKILL))
    end_s = time.monotonic() + 20.0
    while Path(f"/proc/{pid}").exists():
        assert time.monotonic() < end_s
        time.sleep(0.02)
