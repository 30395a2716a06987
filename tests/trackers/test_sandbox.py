"""`--isolation container`: what a tracker in the sandbox can reach."""

import os
import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.trackers.isolation import IsolatedTracker, Limits, TrackerCode, TrackerProcesses, sandbox
from tests.trackers import sandbox_probe
from tests.trackers.test_isolation import fails_at_the_second_update
from tests.trackers.test_kept_processes import played

IMAGE = np.zeros((9, 12, 3), np.uint8)


def sandbox_works() -> bool:
    try:
        sandbox.check_sandbox()
    except ParameterError:
        return False
    return True


sandboxed = pytest.mark.skipif(not sandbox_works(), reason="needs bubblewrap")


def _said(sandboxed: bool, params: dict[str, Any]) -> str | None:
    limits = Limits(memory_mb=300)
    code = TrackerCode(f"{sandbox_probe.__name__}:make", params=params, limits=limits, sandboxed=sandboxed)
    tracker = IsolatedTracker(code, seed=0)
    try:
        tracker.init(IMAGE, [1, 2, 3, 4])
        tracker.update(IMAGE)
    finally:
        tracker.close()
    return tracker.printed


@pytest.mark.slow
@sandboxed
def test_what_a_sandbox_refuses(tmp_path: Path):
    (tmp_path / "secret").write_text("1")
    name = f"pftrack-sim-test-{os.getpid()}"
    with socket.create_server(("127.0.0.1", 0)) as server, socket.socket(socket.AF_UNIX) as abstract:
        abstract.bind("\0" + name)
        abstract.listen()
        given = {
            "port": str(server.getsockname()[1]),
            "abstract": name,
            "pid": str(os.getpid()),
            # Without its first character: files that parameters name can be read.
            "secret": str(tmp_path / "secret")[1:],
        }
        assert _said(False, given) == " ".join(one.__name__ for one in sandbox_probe.HARMLESS)
        assert _said(True, {**given, "all": "yes"}) == "nothing"
        assert _said(True, {**given, "folder": str(tmp_path)}) == "_reads_secret"
    assert not Path("/tmp/pftrack-sim-private").exists()


@pytest.mark.slow
@sandboxed
def test_a_sandbox_is_kept_and_gives_the_same_bits():
    with TrackerProcesses() as processes:
        inside = [played(processes, "reads_seed", seed, sandboxed=True) for seed in (5, 9, 5)]
        assert [len(kept) for kept in processes._idle.values()] == [1]
    assert inside == [played(None, "reads_seed", seed) for seed in (5, 9, 5)]


@pytest.mark.slow
@sandboxed
@pytest.mark.parametrize(("name", "words"), [("segfault", "SIGSEGV"), ("takes_shared_memory", "limit of 100 MB")])
def test_faults_in_a_sandbox_are_named(name: str, words: str):
    fails_at_the_second_update(name, words, Limits(memory_mb=100), sandboxed=True)


def test_without_bubblewrap_the_error_names_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    check = sandbox.check_sandbox.__wrapped__
    monkeypatch.setattr(sandbox.sys, "platform", "linux")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ParameterError, match=r"install bubblewrap .*apt install bubblewrap"):
        check()
    (tmp_path / "bwrap").write_text("#!/bin/sh\necho no permission to make namespaces >&2\nexit 1\n")
    (tmp_path / "bwrap").chmod(0o755)
    with pytest.raises(ParameterError, match=r"does not work here \(no permission to make namespaces\)"):
        check()
    monkeypatch.setattr(sandbox.sys, "platform", "darwin")
    with pytest.raises(ParameterError, match="Linux only"):
        check()
