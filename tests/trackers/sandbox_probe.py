"""A tracker that tries what a sandbox must refuse, and tells by its box what succeeded."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pftrack_sim.core.records import Estimate


def _connects() -> None:
    socket.create_connection(("127.0.0.1", int(GIVEN["port"])), 2.0).close()


def _sends_datagram() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(b"x", ("192.0.2.1", 53))


def _abstract_socket() -> None:
    with socket.socket(socket.AF_UNIX) as client:
        client.connect("\0" + GIVEN["abstract"])


def _reads_secret() -> None:
    Path("/" + GIVEN["secret"]).read_bytes()


def _knows_the_home_folder() -> None:
    if os.environ["HOME"] == "/tmp":
        raise KeyError


def _writes_beside_itself() -> None:
    Path(__file__).with_name("written.tmp").write_bytes(b"x")


def _writes_to_usr() -> None:
    Path("/usr/written.tmp").write_bytes(b"x")


def _writes_to_root() -> None:
    Path("/written.tmp").write_bytes(b"x")


def _sees_the_run() -> None:
    os.kill(int(GIVEN["pid"]), 0)


def _fills_tmp() -> None:
    with open("/tmp/fill", "wb") as file:
        for _ in range(400):
            file.write(bytes(1024 * 1024))


def _mounts() -> None:
    if os.system("mount -t tmpfs none /tmp 2>/dev/null"):
        raise PermissionError


HARMLESS: tuple[Callable[[], None], ...] = (_connects, _abstract_socket, _reads_secret, _knows_the_home_folder)
"""They succeed outside a sandbox."""

REFUSED = (*HARMLESS, _sends_datagram, _writes_beside_itself, _writes_to_usr, _writes_to_root, _sees_the_run,
           _fills_tmp, _mounts)  # fmt: skip
GIVEN: dict[str, str] = {}


class Probe:
    def init(self, image: np.ndarray, box: np.ndarray) -> None:
        if "all" in GIVEN:
            Path("/tmp/pftrack-sim-private").write_text("mine")

    def update(self, image: np.ndarray) -> Estimate:
        succeeded: list[str] = []
        for attempt in REFUSED if "all" in GIVEN else HARMLESS:
            try:
                attempt()
                succeeded.append(attempt.__name__)
            except (OSError, KeyError):
                continue
        print(" ".join(succeeded) or "nothing", flush=True)  # noqa: T201 - read by the test
        return Estimate([1, 2, 3, 4])


def make(**params: str) -> Probe:
    GIVEN.update(params)
    return Probe()
