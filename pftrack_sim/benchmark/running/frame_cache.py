"""Cache of rendered frames with their truth, so that a changed tracker costs only the tracker.

<folder>/<digest>/frames.raw    every frame, `(N, H, W, 3)` uint8 RGB, not compressed: decoding would cost more
<folder>/<digest>/truth.npz     truth of everybody in every frame, shape and digest of the frames

The digest is of the key of the frames, see `keys`, and of what draws here. Entries appear whole, and any number of
workers may read and write.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import tempfile
import zlib
from collections.abc import Generator, Iterator
from dataclasses import dataclass, fields
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import mujoco
import numpy as np

from pftrack_sim.benchmark.keys import digest
from pftrack_sim.benchmark.running.rollout import Sample, Sink
from pftrack_sim.benchmark.running.sinks import TruthLog
from pftrack_sim.core.errors import ParameterError, RenderError
from pftrack_sim.core.records import Frame, Truth
from pftrack_sim.render.renderer import open_renderer

_FIELDS = [one for one in fields(Truth) if one.name != "occluders"]  # these are arrays as they are
_MODEL = "<mujoco><worldbody><geom size='1'/></worldbody></mujoco>"


@dataclass(frozen=True)
class FrameCache:
    """A folder of rendered episodes.

    Attributes:
        folder: Made when the first entry is written.
        limit_bytes: When entries take more than this, those that were not used for longest go.

    Raises:
        ParameterError: The limit is not positive.
    """

    folder: Path
    limit_bytes: int

    def __post_init__(self) -> None:
        if self.limit_bytes <= 0:
            raise ParameterError(f"the cache's limit must be > 0 GB, got {self.limit_bytes / 1e9:g}")

    @property
    def size_bytes(self) -> int:
        """Size of all entries."""
        return sum(size for _, size, _ in self._entries())

    def entry(self, frames_key: str, backend: str | None) -> Path:
        """Folder of an episode by the key of its frames, whether it exists or not."""
        return self.folder / digest(frames_key, _renderer(backend))[:40]

    def open(self, entry: Path) -> CachedEpisode | None:
        """The episode of an entry; None if there is none, or one that is damaged: that is removed."""
        try:
            found = CachedEpisode(entry)
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, EOFError, BadZipFile, zlib.error):
            shutil.rmtree(entry, ignore_errors=True)
            return None
        with contextlib.suppress(OSError):
            os.utime(entry)
        return found

    @contextlib.contextmanager
    def writer(self, entry: Path, log: TruthLog) -> Generator[Sink]:
        """Give a sink that writes frames as an entry; it appears at the end of the block, and old ones make room.

        At the end `log` has the truth of the frames. What cannot be written costs the entry, not the run.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            part = Path(tempfile.mkdtemp(prefix=".part-", dir=self.folder))
            file = open(part / "frames.raw", "wb", buffering=0)  # noqa: SIM115 - closed below
        except OSError:
            yield lambda _: None
            return
        shape: tuple[int, ...] = ()
        whole = True

        def write(sample: Sample) -> None:
            nonlocal shape, whole
            shape, image = sample.image.shape, np.ascontiguousarray(sample.image)
            try:
                whole = file.write(image.data) == image.nbytes and whole
            except OSError:
                whole = False

        try:
            with file:
                yield write
            if whole:
                with contextlib.suppress(OSError):  # a full disk, or another worker wrote the same episode
                    _write_truth(part / "truth.npz", log, shape)
                    part.rename(entry)
                self.evict()
        finally:
            shutil.rmtree(part, ignore_errors=True)

    def evict(self) -> None:
        """Remove the entries that were not used for longest until the rest is within the limit."""
        entries = sorted(self._entries())
        size = sum(one for _, one, _ in entries)
        for _, one, entry in entries:
            if size <= self.limit_bytes:
                break
            shutil.rmtree(entry, ignore_errors=True)
            size -= one

    def _entries(self) -> Iterator[tuple[float, int, Path]]:
        """Time of the last use, size and folder of each entry, also of one that is being written."""
        for entry in self.folder.iterdir() if self.folder.is_dir() else ():
            with contextlib.suppress(OSError):  # another process removes it
                files = [file.stat() for file in entry.iterdir()]
                used = max(one.st_mtime for one in (entry.stat(), *files))
                yield used, sum(one.st_size for one in files), entry


class DamagedEntry(Exception):
    """The frames of an entry are not those that were written; it has been removed."""


class CachedEpisode:
    """Frames and truth of one entry.

    Raises:
        OSError: It is absent or cannot be read.
        ValueError, KeyError, BadZipFile: It is damaged.
    """

    def __init__(self, entry: Path) -> None:
        with np.load(entry / "truth.npz", allow_pickle=False) as arrays:
            self._truth: dict[str, Any] = {name: arrays[name] for name in arrays.files}
        self.frames_digest = str(self._truth.pop("frames_digest"))
        self.graphics = str(self._truth.pop("graphics"))
        shape = tuple(self._truth.pop("shape").tolist())
        self._times_s: list[float] = self._truth.pop("times_s").tolist()
        self._counts: list[int] = self._truth.pop("counts").tolist()
        self._images: Any = np.memmap(entry / "frames.raw", np.uint8, "r", shape=shape)

    def samples(self) -> Iterator[Sample]:
        """The frames as they were drawn. They are not verified here: compare their digest with `frames_digest`."""
        rows = {name: array.tolist() if array.ndim == 1 else list(array) for name, array in self._truth.items()}
        rows["occluders"] = [tuple(json.loads(text)) for text in rows["occluders"]]
        truths = (Truth(**dict(zip(rows, values, strict=True))) for values in zip(*rows.values(), strict=True))
        for index, (time_s, count) in enumerate(zip(self._times_s, self._counts, strict=True)):
            people = tuple(islice(truths, count))
            frame = Frame(index, time_s, np.asarray(self._images[index]), people[0], people)
            yield Sample(time_s, frame.image, frame.truth.box, frame.truth.visible_fraction, frame)


def _write_truth(path: Path, log: TruthLog, shape: tuple[int, ...]) -> None:
    people = [one for there in log.people for one in there]
    arrays: dict[str, Any] = {one.name: np.array([getattr(truth, one.name) for truth in people]) for one in _FIELDS}
    np.savez_compressed(
        path,
        **arrays,
        occluders=np.array([json.dumps(truth.occluders) for truth in people]),
        times_s=np.array([truth.time_s for truth in log.truths]),
        counts=np.array([len(there) for there in log.people]),
        shape=np.array([len(log.people), *shape]),
        frames_digest=np.array(log.frames_digest),
        graphics=np.array(log.graphics),
    )


@cache
def _renderer(backend: str | None) -> str:
    """What draws here when this backend is asked for."""
    try:
        with open_renderer(mujoco.MjModel.from_xml_string(_MODEL), 16, 16, backend) as renderer:
            return renderer.description
    except RenderError:
        return f"none for {backend}"
