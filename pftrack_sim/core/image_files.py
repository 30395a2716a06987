"""Image files: encoded, and those from outside decoded where their header announces no more pixels than are read."""

from __future__ import annotations

import struct

import cv2
import numpy as np

from pftrack_sim.core.records import Image

MAX_PIXELS = 1 << 25
"""The most that an image or a frame may have: 8K video fits; 100 MB once decoded."""

MAX_FILE_BYTES = 256 << 20
"""The most that is read of a file."""

_MAX_SEGMENTS = 1000
_JPEG_NO_SIZE = (0xC4, 0xC8, 0xCC)


def check_pixels(width_px: int, height_px: int) -> None:
    """Check the size of an image before memory is taken for it.

    Raises:
        ValueError: It has no pixels, or more than `MAX_PIXELS`.
    """
    if not (width_px > 0 and height_px > 0 and width_px * height_px <= MAX_PIXELS):
        raise ValueError(f"has {width_px} x {height_px} pixels: images have 1 to {MAX_PIXELS} pixels")


def encode(image: Image, suffix: str, *settings: int) -> bytes:
    """Content of an image file of `(H, W, 3)` uint8 RGB.

    Args:
        image: The image.
        suffix: Of the file: `".png"`.
        settings: Of OpenCV, in pairs: `cv2.IMWRITE_JPEG_QUALITY, 90`.
    """
    return cv2.imencode(suffix, cv2.cvtColor(image, cv2.COLOR_RGB2BGR), settings)[1].tobytes()


def decode(content: bytes) -> Image:
    """`(H, W, 3)` uint8 RGB of the content of a BMP, JPEG or PNG file.

    Raises:
        ValueError: It is no such image, is damaged, or has more pixels than `MAX_PIXELS`.
    """
    problem = "is not an image in BMP, JPEG or PNG, or it is damaged"
    try:
        size = _announced_size(content)
    except struct.error:
        size = None
    if size is None:
        raise ValueError(problem)
    check_pixels(*size)
    try:
        image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), cv2.IMREAD_COLOR_RGB)
    except cv2.error:
        image = None
    if image is None:
        raise ValueError(problem)
    return np.asarray(image, dtype=np.uint8)


def _announced_size(content: bytes) -> tuple[int, int] | None:
    """Width and height in the header; None for anything but BMP, JPEG and PNG."""
    if content.startswith(b"\x89PNG\r\n\x1a\n"):
        width, height = struct.unpack_from(">II", content, 16)
        return width, height
    if content.startswith(b"BM"):
        is_core_header = struct.unpack_from("<I", content, 14) == (12,)
        width, height = struct.unpack_from("<HH" if is_core_header else "<ii", content, 18)
        return width, abs(height)
    return _jpeg_size(content) if content.startswith(b"\xff\xd8\xff") else None


def _jpeg_size(content: bytes) -> tuple[int, int] | None:
    """Width and height in the first start of a frame, which decoders take, too."""
    place = 2
    for _ in range(_MAX_SEGMENTS):
        place = content.find(b"\xff", place)
        while place >= 0 and content[place : place + 1] == b"\xff":
            place += 1
        (marker,) = struct.unpack_from("B", content, place)
        if 0xC0 <= marker <= 0xCF and marker not in _JPEG_NO_SIZE:
            height, width = struct.unpack_from(">HH", content, place + 4)
            return width, height
        has_length = marker not in (0x00, 0x01) and not 0xD0 <= marker <= 0xD9
        place += 1 + (struct.unpack_from(">H", content, place + 1)[0] if has_length else 0)
    return None
