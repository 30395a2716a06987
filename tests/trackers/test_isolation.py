"""A tracker in a process of its own: deadlines, bounds, and its end."""

import os
import signal
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim.core.records import Estimate
from pftrack_sim.core.text import describe_error, one_line, printable
from pftrack_sim.trackers.isolation import IsolatedTracker, Limits, TrackerFault, fork_server, supervisor
from pftrack_sim.trackers.isolation.channel import ChannelError, receive, send

linux = pytest.mark.skipif(sys.platform != "linux", reason="other systems do not contain processes")
IMAGE = np.zeros((9, 12, 3), np.uint8)


class Leaves:
    """Leaves a child in a session of its own, which tells its id by the box, and dies at the second update."""

    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        read, write = os.pipe()
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                os.write(write, os.readlink("/proc/self").encode())
                time.sleep(3600)
            os._exit(0)
        self.child = int(os.read(read, 100))

    def update(self, image: np.ndarray) -> Estimate:
        return Estimate([self.child, 0, 5, 5])


def leaves(**_: Any) -> Leaves:
    return Leaves()


def test_a_message_has_a_deadline_and_a_bound():
    ours, theirs = socket.socketpair()
    with ours, theirs:
        send(theirs, b"whole")
        assert receive(ours, limit_bytes=5) == b"whole"
    for part in (b"", b"\0\0\0", struct.pack("!Q", 1000), struct.pack("!Q", 1000) + b"0123456789"):
        ours, theirs = socket.socketpair()
        with ours, theirs:
            theirs.sendall(part)
            with pytest.raises(TimeoutError):
                receive(ours, limit_bytes=2000, limit_s=0.02)
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(struct.pack("!Q", 2**63))
        with pytest.raises(ChannelError, match="at most 2000"):
            receive(ours, limit_bytes=2000, limit_s=1.0)
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(struct.pack("!Q", 8) + b"half")
        theirs.close()
        with pytest.raises(EOFError):
            receive(ours, limit_bytes=2000, limit_s=1.0)


def test_a_message_that_nobody_reads_has_a_deadline():
    ours, theirs = socket.socketpair()
    with ours, theirs, pytest.raises(TimeoutError):
        send(ours, bytes(10_000_000), limit_s=0.02)


def test_text_from_outside_is_printable_and_bounded():
    hostile = "\udcff\x00\x1b[2J\u202e" + "x" * 1000
    for text in (printable(hostile), one_line(hostile), describe_error(ValueError(hostile))):
        assert text.isprintable()
        assert len(text.encode()) < 600
    assert printable("two\nlines é 人") == "two\nlines é 人"


@linux
@pytest.mark.parametrize("namespaces", [True, False])
def test_children_in_sessions_of_their_own_end_with_the_tracker(namespaces: bool):
    limits = Limits(frame_s=20.0, namespaces=namespaces)
    tracker = IsolatedTracker(f"{__name__}:leaves", seed=0, preset="default", params={}, limits=limits)
    tracker.init(IMAGE, [1, 2, 3, 4])
    child = Path(f"/proc/{int(tracker.update(IMAGE).box[0])}")
    assert child.exists()
    tracker.close()
    assert not child.exists()


@linux
@pytest.mark.parametrize("namespaces", [True, False])
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
    limits = Limits(frame_s=20.0 if "half" not in name else 0.5, memory_mb=100, namespaces=namespaces)
    tracker = IsolatedTracker(
        f"tests.attack.hostile_trackers:{name}", seed=0, preset="default", params={}, limits=limits
    )
    tracker.init(IMAGE, [1, 2, 3, 4])
    tracker.update(IMAGE)
    with pytest.raises(TrackerFault, match=words):
        tracker.update(IMAGE)
    tracker.close()


@linux
def test_a_tracker_with_too_many_processes_is_ended(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(supervisor, "MAX_PROCESSES", 5)
    read, write = os.pipe()
    life, _ = socket.socketpair()
    init = subprocess.Popen(["sh", "-c", "for i in 1 2 3 4 5; do sleep 3600 & done; wait"], start_new_session=True)
    assert supervisor._watch(life, read, init.pid, 0.0) == {"processes": 5}
    os.killpg(init.pid, signal.SIGKILL)
    init.wait()
    os.close(read)
    os.close(write)


@linux
@pytest.mark.slow
def test_a_server_of_forks_that_was_stopped_or_killed_is_replaced(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(fork_server, "_ANSWER_S", 1.0)
    for number in (signal.SIGSTOP, signal.SIGKILL):
        assert played() == [1, 2, 3, 4]
        server = fork_server._server
        assert server is not None
        os.kill(server._process.pid, number)
        assert played() == [1, 2, 3, 4]
        assert fork_server._server is not server


def played() -> list[float]:
    tracker = IsolatedTracker("stay", seed=0, preset="default", params={}, limits=Limits())
    tracker.init(IMAGE, [1, 2, 3, 4])
    box = tracker.update(IMAGE).box
    tracker.close()
    return box.tolist()
