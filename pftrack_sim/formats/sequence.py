"""Recorded sequences: true boxes in memory, images read on demand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.records import Image, frozen_array
from pftrack_sim.core.types import FloatArray


@dataclass(frozen=True, eq=False)
class RecordedSequence:
    """Images of a folder with one true box each.

    Attributes:
        name: Name of the folder.
        paths: `N` image files in order.
        truth: `(N, 4)` boxes x, y, w, h [px], read-only; NaN rows where the target is absent; the first
            row is finite.
    """

    name: str
    paths: tuple[Path, ...]
    truth: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "truth", frozen_array(self.truth, (len(self.paths), 4)))

    def __len__(self) -> int:
        return len(self.paths)

    def image(self, index: int) -> Image:
        """Read one image.

        Args:
            index: From 0 to N - 1.

        Returns:
            `(H, W, 3)` uint8 RGB.

        Raises:
            IndexError: There is no such frame.
            SequenceError: The file cannot be read as an image.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"{self.name} has frames 0 to {len(self) - 1}, got {index}")
        path = self.paths[index]
        try:
            data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
        except OSError as error:
            raise SequenceError(f"{path}: cannot be read: {error.strerror}") from None
        try:
            bgr = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
        except cv2.error:
            bgr = None
        if bgr is None:
            raise SequenceError(f"{path}: is not an image, or it is damaged")
        return cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)  # pyright: ignore[reportReturnType]
