"""Third-party trackers that attack the run, each in one way, from their second update (frame 2) on."""

from __future__ import annotations

import ctypes
import gc
import json
import mmap
import os
import signal
import socket
import stat
import struct
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pftrack_sim.core.records import Estimate

ATTACKS: dict[str, Callable[..., Any]] = {}
"""Every attack by its name; each is called with the image and the number of the update."""

BAD_FRAME = 2
MARK = b"hostile"
FINE = Estimate([1, 2, 30, 40])


class Hostile:
    def __init__(self, attack: Callable[..., Any]) -> None:
        self._attack = attack

    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        self._seen, self._box = 0, np.array(box)
        if sys.platform == "linux":
            ctypes.CDLL(None).prctl(15, MARK, 0, 0, 0)  # the name of this process and its children

    def update(self, image: np.ndarray) -> Any:
        self._seen += 1
        return self._attack(image) if self._seen >= BAD_FRAME else Estimate(self._box)


def attack(function: Callable[[np.ndarray], Any]) -> Callable[..., Hostile]:
    """A factory of trackers that call the function."""
    ATTACKS[function.__name__] = function
    return lambda **_: Hostile(function)


# Replies ----------------------------------------------------------------------------------------------------------


def _sockets() -> list[int]:
    return [fd for fd in range(3, 256) if _is_socket(fd)]


def _is_socket(fd: int) -> bool:
    try:
        return stat.S_ISSOCK(os.fstat(fd).st_mode)
    except OSError:
        return False


def _inject(content: bytes) -> None:
    for fd in _sockets():
        os.write(fd, content)


def _message(content: bytes) -> bytes:
    return struct.pack("!Q", len(content)) + content


@attack
def half_a_reply(image: np.ndarray) -> Any:
    _inject(struct.pack("!Q", 1000) + b"0123456789")
    time.sleep(3600)


@attack
def half_a_length(image: np.ndarray) -> Any:
    _inject(b"\0\0\0")
    time.sleep(3600)


@attack
def half_a_reply_of_multiprocessing(image: np.ndarray) -> Any:
    _inject(struct.pack("!i", 1000) + b"0123456789")
    time.sleep(3600)


@attack
def endless_reply(image: np.ndarray) -> Any:
    _inject(struct.pack("!Q", 2**63))
    while True:
        _inject(b"x" * 65536)


@attack
def reply_drip(image: np.ndarray) -> Any:
    """A byte a moment: every read succeeds, the message never ends."""
    _inject(struct.pack("!Q", 10_000_000))
    while True:
        _inject(b" ")
        time.sleep(0.05)


@attack
def deep_reply(image: np.ndarray) -> Any:
    _inject(_message(b"[" * 200_000))
    return FINE


@attack
def reply_that_is_no_json(image: np.ndarray) -> Any:
    _inject(_message(b"\xff\xfe nonsense"))
    return FINE


@attack
def reply_that_is_a_list(image: np.ndarray) -> Any:
    _inject(_message(b"[1, 2, 3]"))
    return FINE


def _reply(**changes: Any) -> bytes:
    fine = {"ms": 1.0, "box": [1, 2, 30, 40], "confidence": 1.0, "occluded": False, "particles": None}
    return _message(json.dumps({**fine, **changes}).encode())


@attack
def occluded_is_text(image: np.ndarray) -> Any:
    _inject(_reply(occluded="perhaps"))
    return FINE


@attack
def confidence_is_a_table(image: np.ndarray) -> Any:
    _inject(_reply(confidence={"a": 1}))
    return FINE


@attack
def time_is_nan(image: np.ndarray) -> Any:
    _inject(_reply(ms=float("nan")))
    return FINE


@attack
def time_is_negative(image: np.ndarray) -> Any:
    _inject(_reply(ms=-1e300))
    return FINE


@attack
def particles_are_ragged(image: np.ndarray) -> Any:
    _inject(_reply(particles=[[1, 2], [3], "x"]))
    return FINE


@attack
def error_is_a_tree(image: np.ndarray) -> Any:
    _inject(_message(json.dumps({"error": {"a": ["\udcff"] * 10_000}}).encode()))
    return FINE


# Texts ------------------------------------------------------------------------------------------------------------


@attack
def surrogate_in_exception(image: np.ndarray) -> Any:
    raise ValueError("\udcff")


@attack
def endless_exception(image: np.ndarray) -> Any:
    raise ValueError("x" * 50_000_000)


@attack
def terminal_codes_in_exception(image: np.ndarray) -> Any:
    raise ValueError("\x1b[2J\x00\r\nline two\u202egnp")


@attack
def formula_in_exception(image: np.ndarray) -> Any:
    raise ValueError('=HYPERLINK("http://x")</script><script>alert(1)</script>\' OR 1=1 --')


class Unspeakable(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no message")


@attack
def exception_without_text(image: np.ndarray) -> Any:
    raise Unspeakable


@attack
def base_exception(image: np.ndarray) -> Any:
    raise KeyboardInterrupt


@attack
def prints_without_end(image: np.ndarray) -> Any:
    while True:
        os.write(1, b"\xff\x00\x1b[31m" * 8192)


@attack
def prints_surrogates(image: np.ndarray) -> Any:
    os.write(1, b"\xed\xb3\xbf\xff\xfe\x00\x1b]0;title\x07" * 20)
    return FINE


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
    arrays = [np.ones(10_000_000) for _ in range(100)]
    return Estimate([float(len(arrays)), 0, 5, 5])


@attack
def takes_shared_memory(image: np.ndarray) -> Any:
    """Pages that the limit of the data segment does not count."""
    taken: list[mmap.mmap] = []
    for _ in range(100):
        taken.append(mmap.mmap(-1, 32 * 1024 * 1024))
        for offset in range(0, len(taken[-1]), 4096):
            taken[-1][offset] = 1
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


for _name, _function in list(ATTACKS.items()):
    globals()[_name] = attack(_function)
