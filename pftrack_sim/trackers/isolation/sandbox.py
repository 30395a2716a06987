"""A sandbox for trackers that are not trusted: bubblewrap (`bwrap`), which needs no privileges and no image.

Inside there is no network and no process of the host; the file system is empty but for what Python and the tracker
are read from, read-only, and a private `/tmp` in memory. Environment variables are left behind.
"""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.text import one_line

INSTALL = (
    "install bubblewrap (Debian, Ubuntu: apt install bubblewrap; Fedora: dnf install bubblewrap; "
    "Arch: pacman -S bubblewrap)"
)
_PROBE_S = 30.0
_SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64")
_SETTINGS = ("alternatives", "fonts", "group", "ld.so.cache", "ld.so.conf", "ld.so.conf.d", "localtime", "passwd")
"""In `/etc`."""

_VARIABLES = ("LANG", "LC_ALL", "LC_CTYPE", "LP_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS",
              "OPENBLAS_CORETYPE", "OPENBLAS_NUM_THREADS", "PATH", "PYTHONHASHSEED", "TZ")  # fmt: skip
_MAX_TMP_MB = 1024.0


@functools.cache
def check_sandbox() -> None:
    """Make a sandbox once.

    Raises:
        ParameterError: There is none here; the message says what to install or to allow.
    """
    needed = "isolation 'container' needs a sandbox"
    if sys.platform != "linux":
        raise ParameterError(f"{needed}, which exists on Linux only")
    if shutil.which("bwrap") is None:
        raise ParameterError(f"{needed}: {INSTALL}")
    try:
        probe = [*_bwrap(1.0), *_binds([]), *_CLOSED, "--", "/usr/bin/true"]
        found = subprocess.run(probe, capture_output=True, timeout=_PROBE_S, check=False)
        problem = found.stderr.decode(errors="replace") if found.returncode else ""
    except (OSError, subprocess.TimeoutExpired) as error:
        problem = str(error)
    if problem:
        raise ParameterError(
            f"{needed}, and bubblewrap does not work here ({one_line(problem)}): unprivileged user namespaces must be "
            "allowed (sysctl kernel.unprivileged_userns_clone=1; Ubuntu 24.04 and later: an AppArmor profile for bwrap)"
        )


def sandbox_command(params: Mapping[str, Any], memory_mb: float) -> tuple[list[str], list[str]]:
    """Command line that runs Python in a sandbox, to be followed by Python's arguments, and the path of its modules.

    Readable are Python, the folders on its path, this package, and the files and folders that parameters name.

    Args:
        params: Parameters of the tracker.
        memory_mb: Memory limit of the tracker, which bounds its `/tmp` too; 0 is no limit.

    Raises:
        ParameterError: There is no sandbox here.
    """
    check_sandbox()
    package = str(Path(__file__).resolve().parents[3])
    path = [*(os.path.realpath(one) for one in sys.path if os.path.exists(one or ".")), package]
    named = [one for one in params.values() if isinstance(one, str) and os.path.exists(one) and os.path.isabs(one)]
    readable = [*path, sys.prefix, sys.base_prefix, *named]
    here = os.getcwd()
    variables = {name: os.environ[name] for name in _VARIABLES if name in os.environ} | {
        "HOME": "/tmp",
        "NUMBA_CACHE_DIR": "/tmp/numba",
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONPATH": os.pathsep.join(path),
    }
    settings = [word for name, value in variables.items() for word in ("--setenv", name, value)]
    inside = here if _is_within(here, path) else "/tmp"
    python = os.path.realpath(sys.executable)
    # No site: the path holds everything that the parent has found.
    words = [*_bwrap(memory_mb or _MAX_TMP_MB), *_binds(readable), *settings, *_CLOSED]
    return [*words, "--chdir", inside, "--", python, "-s", "-S", "-P"], path


_CLOSED = ("--remount-ro", "/dev", "--remount-ro", "/")


def _bwrap(tmp_mb: float) -> list[str]:
    size = str(int(min(tmp_mb, _MAX_TMP_MB) * 1024 * 1024))
    # The supervisor is the first process: a tracker that kills all others does not end it.
    return [
        *("bwrap", "--unshare-all", "--new-session", "--as-pid-1", "--cap-drop", "ALL"),
        *("--clearenv", "--proc", "/proc", "--dev", "/dev"),
        *("--size", size, "--tmpfs", "/dev/shm", "--size", size, "--tmpfs", "/tmp"),
    ]


def _binds(readable: Iterable[str]) -> Sequence[str]:
    words: list[str] = []
    for one in [*_SYSTEM, *(f"/etc/{name}" for name in _SETTINGS)]:
        words += ["--ro-bind-try", one, one]
    folders: list[str] = []
    for one in sorted({os.path.realpath(one) for one in readable} - {"/"}):
        if not _is_within(one, folders):
            folders.append(one)
            words += ["--ro-bind", one, one]
    for one in sorted({*readable}):
        if not _is_within(one, [*_SYSTEM, *folders]):  # a name through a link
            words += ["--ro-bind", os.path.realpath(one), one]
    return words


def _is_within(path: str, folders: Iterable[str]) -> bool:
    return any(Path(path).is_relative_to(one) for one in folders)
