"""H.264 videos that a browser plays."""

from __future__ import annotations

import os
from fractions import Fraction
from pathlib import Path
from types import TracebackType

import av

from pftrack_sim.core.errors import ParameterError, RunError
from pftrack_sim.core.records import Image


class VideoWriter:
    """Writes frames into an MP4; the file appears under its name only when it is complete.

    Args:
        path: File to write, ending in `.mp4`.
        rate_hz: Frames per second.
        quality: Constant rate factor of H.264: 18 is visually lossless, 28 is small.

    Raises:
        ParameterError: The name does not end in `.mp4`.
        RunError: The folder cannot be written to.
    """

    def __init__(self, path: Path, rate_hz: float, quality: int = 21) -> None:
        if path.suffix.lower() != ".mp4":
            raise ParameterError(f"a video's name must end in .mp4, got {str(path)!r}")
        self.path = path
        self._part = path.with_name(f".{path.stem}.part.mp4")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._container = av.open(str(self._part), "w", options={"movflags": "faststart"})
        except OSError as error:
            raise RunError(f"cannot write the video {path}: {error.strerror or error}") from None
        rate = Fraction(rate_hz).limit_denominator(1001)
        self._stream = self._container.add_stream(
            "libx264", rate=rate, options={"crf": str(quality), "preset": "veryfast", "threads": "1"}
        )
        # The only pixel format that every browser decodes; it needs even sizes.
        self._stream.pix_fmt = "yuv420p"
        self._sized = False

    def add(self, image: Image) -> None:
        """Append a frame `(H, W, 3)` uint8 RGB; all of one size. An odd last row or column is dropped."""
        height, width = (size - size % 2 for size in image.shape[:2])
        if not self._sized:
            self._stream.width, self._stream.height = width, height
            self._sized = True
        frame = av.VideoFrame.from_ndarray(image[:height, :width], format="rgb24")
        for packet in self._stream.encode(frame):
            self._container.mux(packet)

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._sized and kind is None:
            for packet in self._stream.encode():
                self._container.mux(packet)
        self._container.close()
        if self._sized and kind is None:
            os.replace(self._part, self.path)
        else:
            self._part.unlink(missing_ok=True)
