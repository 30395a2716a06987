"""Images of sequences, read when they are asked for: numbered files of a folder, frames of a video or of a bag."""

from __future__ import annotations

import contextlib
import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.error import FFmpegError

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.image_files import MAX_FILE_BYTES, MAX_PIXELS, decode
from pftrack_sim.core.inputs import read_bytes
from pftrack_sim.core.records import Image
from pftrack_sim.core.text import one_line
from pftrack_sim.core.types import FloatArray
from pftrack_sim.formats.files import reading

SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png")
VIDEO = "frames.mp4"
"""Name of the video that an exported sequence may have in the folder of its images."""


class Images(ABC):
    """The images of a sequence."""

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def read(self, index: int) -> Image:
        """`(H, W, 3)` uint8 RGB.

        Raises:
            SequenceError: It cannot be read as an image.
        """

    @abstractmethod
    def where(self, index: int) -> str:
        """File of an image, for messages."""


class ImageFiles(Images):
    """One file for each image."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self.paths = tuple(paths)

    def __len__(self) -> int:
        return len(self.paths)

    def read(self, index: int) -> Image:
        """See `Images`."""
        path = self.paths[index]
        with reading(path):
            return decoded_image(path, read_bytes(path, MAX_FILE_BYTES))

    def where(self, index: int) -> str:
        """See `Images`."""
        return str(self.paths[index])


class ImageStream(Images):
    """Images that are read one after the other: `begin` gives those from an index on, and going back begins anew."""

    def __init__(self, path: Path, count: int, begin: Callable[[int], Iterator[Image]]) -> None:
        self._path, self._count, self._begin = path, count, begin
        self._next, self._images = 0, begin(0)

    def __len__(self) -> int:
        return self._count

    def read(self, index: int) -> Image:
        """See `Images`."""
        if index < self._next:
            self._next, self._images = index, self._begin(index)
        for image in self._images:
            self._next += 1
            if self._next == index + 1:
                return image
        raise SequenceError(f"{self._path}: frame {index + 1} cannot be decoded")

    def where(self, index: int) -> str:
        """See `Images`."""
        return f"{self._path}: frame {index + 1}"


def images_in(folder: Path) -> Images:
    """Images of a folder: the frames of the file `VIDEO` where it has one, else its numbered images.

    Raises:
        SequenceError: As `numbered_images`, or the file is no video.
    """
    return video(folder / VIDEO)[0] if (folder / VIDEO).is_file() else ImageFiles(numbered_images(folder))


def numbered_images(folder: Path) -> list[Path]:
    """Images of a folder in the order of their numbers, without gaps.

    Raises:
        SequenceError: The folder is missing or has no images; a name is no number; a number is missing or twice there.
    """
    with reading(folder, "no such folder of images"):
        found = [
            entry for entry in folder.iterdir() if entry.suffix.lower() in SUFFIXES and not entry.name.startswith(".")
        ]
    if not found:
        raise SequenceError(f"{folder}: no images ({', '.join(SUFFIXES)})")
    for entry in found:
        if not (entry.stem.isascii() and entry.stem.isdigit()):
            raise SequenceError(f"{entry}: an image's name must be its number, like 0001.jpg")
    numbered = sorted((int(entry.stem), entry) for entry in found)
    for (number, path), (following, other) in itertools.pairwise(numbered):
        if following == number:
            raise SequenceError(f"{folder}: {path.name} and {other.name} have the same number")
        if following != number + 1:
            raise SequenceError(f"{folder}: image {number + 1} is missing between {path.name} and {other.name}")
    return [path for _, path in numbered]


def image_suffix(folder: Path) -> str:
    """Suffix of the images of a sequence that is written; they all have the same."""
    return next(path.suffix for path in sorted(folder.iterdir()) if path.suffix in (*SUFFIXES, Path(VIDEO).suffix))


def decoded_image(where: Path | str, content: bytes) -> Image:
    """`(H, W, 3)` uint8 RGB of the content of an image file; `where` names it in the SequenceError that it raises."""
    try:
        return decode(content)
    except ValueError as error:
        raise SequenceError(f"{where}: {error}") from None


def video(path: Path) -> tuple[Images, float | None]:
    """Frames of a video file, and how many there are per second where the file tells.

    Raises:
        SequenceError: It is no video, or its frames have more than `MAX_PIXELS` pixels.
    """
    with _opened_video(path) as (container, stream):
        rate = stream.average_rate
        count = sum(1 for packet in container.demux(stream) if packet.size)
    return ImageStream(path, count, partial(_decode, path)), float(rate) if rate else None


def video_times(path: Path) -> FloatArray:
    """`(N,)` times of the frames of a video [s], the first at 0; empty where the file does not tell them.

    Raises:
        SequenceError: It is no video.
    """
    with _opened_video(path) as (container, stream):
        stamps = [packet.pts for packet in container.demux(stream) if packet.size]
        if None in stamps or not stamps:
            return np.zeros(0)
        times = np.sort(np.array(stamps, dtype=np.float64)) * float(stream.time_base)
    return times - times[0]


def _decode(path: Path, first: int) -> Iterator[Image]:
    with _opened_video(path) as (container, stream):
        for frame in itertools.islice(container.decode(stream), first, None):
            yield np.asarray(frame.to_ndarray(format="rgb24"), dtype=np.uint8)


@contextlib.contextmanager
def _opened_video(path: Path) -> Generator[tuple[Any, Any]]:
    """The container and its first video stream, whose decoder refuses larger frames than the container announces."""
    limit = {"max_pixels": str(MAX_PIXELS)}
    try:
        with av.open(str(path), options=limit) as container:
            stream = container.streams.video[0]
            stream.codec_context.options = limit
            yield container, stream
    except (FileNotFoundError, PermissionError) as error:
        raise SequenceError(f"{path}: cannot be read: {error.strerror}") from None
    except (FFmpegError, OSError, IndexError) as error:
        problem = one_line(str(getattr(error, "strerror", None) or "it has no video stream"))
        raise SequenceError(
            f"{path}: cannot be read as a video: {problem} (frames of more than {MAX_PIXELS} pixels are refused)"
        ) from None
