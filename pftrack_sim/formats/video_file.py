"""Frames of a video file, by PyAV."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.error import FFmpegError

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.records import Image
from pftrack_sim.core.text import one_line


def probe(path: Path) -> tuple[int, float | None]:
    """Number of frames, and frames per second where the file tells.

    Raises:
        SequenceError: It is no video.
    """
    try:
        with av.open(str(path)) as opened:
            container: Any = opened
            stream = container.streams.video[0]
            rate = stream.average_rate
            count = sum(1 for packet in container.demux(stream) if packet.size)
    except (FFmpegError, OSError, IndexError) as error:
        problem = getattr(error, "strerror", None) or "it has no video stream"
        raise SequenceError(f"{path}: cannot be read as a video: {one_line(str(problem))}") from None
    return count, float(rate) if rate else None


def decode(path: Path) -> Generator[Image]:
    """Frames `(H, W, 3)` uint8 RGB in the order in which they are shown.

    Raises:
        SequenceError: The file is damaged.
    """
    try:
        with av.open(str(path)) as container:
            for frame in container.decode(video=0):
                yield np.asarray(frame.to_ndarray(format="rgb24"), dtype=np.uint8)
    except (FFmpegError, OSError) as error:
        raise SequenceError(f"{path}: is damaged: {one_line(str(error.strerror or error))}") from None
