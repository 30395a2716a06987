"""Level of the stream axis: frames lost or repeated, their rate, and the quality of their compression."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import scipy

from pftrack_sim.core.image_files import MAX_FILE_BYTES
from pftrack_sim.core.inputs import read_bytes
from pftrack_sim.formats.images import ImageFiles
from pftrack_sim.measuring.material import Material
from pftrack_sim.measuring.measured import Quantity
from pftrack_sim.measuring.motion import Step


def measure_stream(material: Material, steps: Sequence[Step]) -> tuple[list[Quantity], list[str]]:
    """Rate, share of lost frames and JPEG quality; and doubts about the times."""
    count, step = len(material.times_s), material.step_s
    rate = 1.0 / step
    found: list[Quantity] = []
    if material.rated:
        found = [Quantity("frames per second", rate, rate, rate, "Hz", count, settings={"camera.rate_hz": rate})]
    settings: dict[str, object] = {}
    doubts = list(material.doubts)
    if material.timed:
        intervals = np.diff(material.times_s) / step
        uneven = float(np.mean(np.abs(intervals - np.rint(intervals)) > 0.1))
        if uneven > 0.05:
            doubts.append(f"{100 * uneven:.0f} % of the frames come at uneven times: the rate is their usual one")
        else:
            gaps = np.rint(intervals).astype(int) - 1
            found.append(_lost(int(gaps.sum()), gaps[gaps > 0], count + int(gaps.sum())))
            settings |= found[-1].settings
    still = [one.difference for one in steps]
    repeated = float(np.mean(np.array(still) < 0.02 * np.median(still)))
    if repeated > 0.005:
        found.append(
            Quantity("repeated frames", repeated, *_share(round(repeated * len(still)), len(still)), "share", count)
        )
        doubts.append(f"{100 * repeated:.1f} % of the frames repeat the one before: turns there are taken for none")
    if isinstance(material.images, ImageFiles) and (
        quality := jpeg_quality(read_bytes(material.images.paths[0], MAX_FILE_BYTES))
    ):
        found.append(Quantity("JPEG quality", quality, quality, quality, "of 100", 1))
        settings["axes.stream.jpeg_quality"] = quality
    if settings and material.rated:  # a stream of an unknown rate would lose frames
        settings = {"axes.stream.dropped_share": 0.0, "axes.stream.jpeg_quality": 100, **settings}
        settings |= {"camera.rate_hz": rate, "axes.stream.severity": 1.0, "axes.stream.rate_hz": rate}
        found[0] = replace(found[0], settings=settings)
    return found, doubts


def _lost(lost: int, bursts: np.ndarray, sent: int) -> Quantity:
    """Share of lost frames; bursts, not frames, are taken for independent (Clopper and Pearson 1934)."""
    mean = float(bursts.mean()) if len(bursts) else 1.0
    low, high = _share(len(bursts), max(1, round(sent / mean)))
    settings = {"axes.stream.dropped_share": min(0.9, lost / sent), "axes.stream.burst_frames": mean}
    return Quantity("lost frames", lost / sent, low, high, "share of frames", sent, "stream", settings)


def _share(hits: int, trials: int) -> tuple[float, float]:
    interval = scipy.stats.binomtest(hits, trials).proportion_ci(0.95)
    return float(interval.low), float(interval.high)


def jpeg_quality(content: bytes) -> int | None:
    """Quality from 1 to 100 of a JPEG file that scales the standard's table; None for other files and tables."""
    return _qualities().get(_luminance_table(content)) if content.startswith(b"\xff\xd8") else None


def _luminance_table(content: bytes) -> bytes:
    """Number and content of the first table in a JPEG file, which is that of luminance."""
    place = content.find(b"\xff\xdb")
    return content[place + 4 : place + 69] if place >= 0 else b""


@cache
def _qualities() -> dict[bytes, int]:
    """Qualities by their tables: OpenCV scales those of ITU-T T.81, K.1, as most do."""
    grey = np.zeros((8, 8), np.uint8)
    written = ((one, cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, one])[1]) for one in range(1, 101))
    return {_luminance_table(content.tobytes()): quality for quality, content in written}
