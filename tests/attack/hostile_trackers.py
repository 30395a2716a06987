"""Attacks by values, time, memory and processes, and by name those of `hostile_replies`."""

from __future__ import annotations

import ctypes
import gc
import json
import mmap
import os
import signal
import socket
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim.core.records import Estimate
from tests.attack import hostile_replies as _replies
from tests.attack.hostile import ATTACKS, FINE, attack

# Values -----------------------------------------------------------------------------------------------------------


@attack
def enormous_box(image: np.ndarray) -> Any:
    return Estimate([-1e308, -1e308, 1e308, 1e308])


@attack
def nan_box(image: np.ndarray) -> Any:
    return Estimate([np.nan, 0, 5, 5])


@attack
def millions_of_particles(image: np.ndarray) -> Any:
    return Estimate([1, 2, 30, 40], particles=np.full((2_000_000, 4), np.nan))


class Liar(Estimate):
    @property
    def box(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return [object()] * 4


@attack
def estimate_that_lies(image: np.ndarray) -> Any:
    return Liar.__new__(Liar)


@attack
def no_estimate(image: np.ndarray) -> Any:
    return "a box"


@attack
def writes_into_its_image(image: np.ndarray) -> Any:
    image[:] = 0
    return FINE


# Time and memory --------------------------------------------------------------------------------------------------


@attack
def never_returns(image: np.ndarray) -> Any:
    while True:
        pass


@attack
def ignores_signals(image: np.ndarray) -> Any:
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT, signal.SIGALRM):
        signal.signal(number, signal.SIG_IGN)
    time.sleep(3600)


@attack
def takes_memory(image: np.ndarray) -> Any:
    arrays = [np.empty(10_000_000) for _ in range(100)]
    return Estimate([float(len(arrays)), 0, 5, 5])


@attack
def takes_shared_memory(image: np.ndarray) -> Any:
    """Pages that the limit of the data segment does not count."""
    taken: list[mmap.mmap] = []
    for _ in range(100):
        taken.append(mmap.mmap(-1, 32 * 1024 * 1024))
        taken[-1][::4096] = bytes([1]) * (len(taken[-1]) // 4096)
        time.sleep(0.05)
    return Estimate([float(len(taken)), 0, 5, 5])


@attack
def takes_memory_in_children(image: np.ndarray) -> Any:
    for _ in range(8):
        if os.fork() == 0:
            os.setsid()
            kept = np.ones(12_000_000)
            time.sleep(3600)
            os._exit(int(kept[0]))
    time.sleep(3600)


@attack
def fills_the_disk(image: np.ndarray) -> Any:
    with open("/tmp/.pftrack-attack" if os.access("/tmp", os.W_OK) else os.devnull, "wb") as file:
        os.unlink(file.name)
        for _ in range(400):
            file.write(bytes(1024 * 1024))
    return FINE


@attack
def recursion(image: np.ndarray) -> Any:
    return recursion_deeper()


def recursion_deeper() -> Any:
    return recursion_deeper()


# Processes --------------------------------------------------------------------------------------------------------


def _ancestors() -> list[int]:
    """The parents' ids as `/proc` tells them, without this process, up to but without the first one."""
    found: list[int] = []
    pid = int(os.readlink("/proc/self")) if sys.platform == "linux" else os.getppid()
    while True:
        try:
            pid = int(Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[1])
        except OSError:
            return found
        if pid <= 1 or b"pytest" in Path(f"/proc/{pid}/cmdline").read_bytes():
            return found
        found.append(pid)


def _signal_all(number: int) -> None:
    for pid in [os.getppid(), *_ancestors()]:
        try:
            os.kill(pid, number)
        except OSError:
            continue


@attack
def kills_its_ancestors(image: np.ndarray) -> Any:
    _signal_all(signal.SIGKILL)
    return FINE


@attack
def stops_its_ancestors(image: np.ndarray) -> Any:
    _signal_all(signal.SIGSTOP)
    return FINE


@attack
def stops_itself(image: np.ndarray) -> Any:
    os.kill(os.getpid(), signal.SIGSTOP)
    return FINE


@attack
def child_in_its_own_session(image: np.ndarray) -> Any:
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            ctypes.CDLL(None).prctl(1, 0, 0, 0, 0)
            time.sleep(3600)
        os._exit(0)
    return FINE


@attack
def child_that_holds_everything(image: np.ndarray) -> Any:
    """The child keeps sockets and standard output, the tracker dies."""
    if os.fork() == 0:
        time.sleep(3600)
    os._exit(7)


@attack
def many_children(image: np.ndarray) -> Any:
    for _ in range(40):
        if os.fork() == 0:
            os.setsid()
            time.sleep(3600)
    return FINE


@attack
def many_threads(image: np.ndarray) -> Any:
    for _ in range(100):
        threading.Thread(target=time.sleep, args=(3600,)).start()
    return FINE


@attack
def closes_every_descriptor(image: np.ndarray) -> Any:
    os.closerange(0, 256)
    return FINE


@attack
def segfault(image: np.ndarray) -> Any:
    return ctypes.string_at(0)


@attack
def abort(image: np.ndarray) -> Any:
    os.abort()


@attack
def sys_exit(image: np.ndarray) -> Any:
    sys.exit(0)


@attack
def os_exit(image: np.ndarray) -> Any:
    os._exit(0)


@attack
def poisons_its_interpreter(image: np.ndarray) -> Any:
    """What other trackers share in one process: random state, working folder, environment, modules, signals."""
    np.random.seed(0)  # noqa: NPY002 - a hostile tracker does
    os.chdir("/")
    os.environ.clear()
    Estimate.__init__ = None  # pyright: ignore[reportAttributeAccessIssue]
    json.dumps = None  # pyright: ignore[reportAttributeAccessIssue]
    for one in gc.get_objects():
        if isinstance(one, socket.socket):
            one.close()
    return FINE


# One module to name as `module:factory`.
globals().update({name: getattr(_replies, name) for name in ATTACKS if hasattr(_replies, name)})
