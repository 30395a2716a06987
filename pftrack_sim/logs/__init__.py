"""Logs of episodes for the viewers of robotics: Rerun recordings, and MCAP files of ROS 2 messages."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from pftrack_sim.core.errors import ParameterError, RunError, UnknownNameError
from pftrack_sim.logs.frame import LogFrame, LogInfo

__all__ = ["FORMATS", "LogFrame", "LogInfo", "check_formats", "log_format", "log_writer"]


@dataclass(frozen=True)
class LogFormat:
    """Suffix of the files, and the library that writes them with the extra that it is in."""

    suffix: str
    library: str
    extra: str


FORMATS = {"mcap": LogFormat(".mcap", "mcap_ros2", "ros2"), "rerun": LogFormat(".rrd", "rerun", "rerun")}


def check_formats(names: Sequence[str]) -> None:
    """Check names of formats, and that their libraries are installed, before anything is written.

    Raises:
        UnknownNameError: No such format.
        RunError: Its library is missing.
    """
    for name in names:
        if name not in FORMATS:
            raise UnknownNameError("log", name, FORMATS)
        if importlib.util.find_spec(FORMATS[name].library) is None:
            raise RunError(f"the log {name} needs the extra: pip install 'pftrack-sim[{FORMATS[name].extra}]'")


def log_format(path: Path) -> str:
    """Name of the format of a file, by its suffix.

    Raises:
        ParameterError: Another suffix.
    """
    for name, known in FORMATS.items():
        if path.suffix.lower() == known.suffix:
            return name
    suffixes = " or ".join(known.suffix for known in FORMATS.values())
    raise ParameterError(f"a log's name must end in {suffixes}, got {str(path)!r}")


def log_writer(name: str, path: Path, info: LogInfo) -> AbstractContextManager[Callable[[LogFrame], None]]:
    """Writer of a log in one of `FORMATS`: a function that adds a frame; the file is complete when the context ends.

    Raises:
        UnknownNameError: No such format.
        RunError: Its library is missing.
    """
    check_formats([name])
    module = importlib.import_module(f"pftrack_sim.logs.{'ros2' if name == 'mcap' else 'rerun_log'}")
    return module.writer(path, info)
