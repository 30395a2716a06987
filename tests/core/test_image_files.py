"""Images from outside: equal to what OpenCV decodes, and refused by their header where they are too large."""

import struct

import cv2
import numpy as np
import pytest

from pftrack_sim.core.image_files import MAX_PIXELS, decode

PICTURE = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)


def encoded(suffix: str, *settings: int) -> bytes:
    return cv2.imencode(suffix, PICTURE, settings)[1].tobytes()


def with_size(suffix: str, width_px: int, height_px: int) -> bytes:
    """An image that announces another size than it has."""
    content = bytearray(encoded(suffix))
    if suffix == ".jpg":
        struct.pack_into(">HH", content, content.index(b"\xff\xc0") + 5, height_px, width_px)
    elif suffix == ".png":
        struct.pack_into(">II", content, 16, width_px, height_px)
    else:
        struct.pack_into("<ii", content, 18, width_px, height_px)
    return bytes(content)


@pytest.mark.parametrize("suffix", [".bmp", ".jpg", ".png"])
def test_an_image_is_what_the_decoder_makes_of_it(suffix: str):
    content = encoded(suffix)
    expected = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR_RGB)
    assert expected is not None
    np.testing.assert_array_equal(decode(content), expected)


def test_a_progressive_jpeg_with_long_segments_before_its_size_is_read():
    content = encoded(".jpg", cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    comment = b"\xff\xff\xfe" + struct.pack(">H", 2 + 9) + b"\xff\xc0\x00\x11\x08\xff\xff\xff\xff"
    assert decode(content[:2] + comment + content[2:]).shape == PICTURE.shape


@pytest.mark.parametrize("suffix", [".bmp", ".jpg", ".png"])
@pytest.mark.parametrize("size", [(30000, 30000), (MAX_PIXELS // 1024 + 1, 1024)])
def test_too_many_pixels_are_refused_before_they_are_decoded(suffix: str, size: tuple[int, int]):
    with pytest.raises(ValueError, match=f"{size[0]} x {size[1]} pixels.*1 to {MAX_PIXELS}"):
        decode(with_size(suffix, *size))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"BM",
        b"\x89PNG\r\n\x1a\n",
        b"\xff\xd8\xff",
        b"\xff\xd8\xff\xc0\x00",
        b"\xff\xd8" + b"\xff\xe0\x00\x02" * 100_000,
        encoded(".png")[:60],
        encoded(".webp"),
    ],
)
def test_what_is_no_image_is_said(content: bytes):
    with pytest.raises(ValueError, match="not an image in BMP, JPEG or PNG"):
        decode(content)
