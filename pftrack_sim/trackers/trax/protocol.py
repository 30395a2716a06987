"""Messages, regions and images of the TraX protocol (Cehovin 2017, "TraX: the visual Tracking eXchange protocol").

A message is a line `@@TRAX:kind "argument" ... "key=value" ...`; all other lines are output of the program. Written
against the public specification and compared with the reference implementation (PyPI: `vot-trax`), whose client ends
its own process by a segmentation fault at a malformed greeting.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from pftrack_sim.core.boxes import Box, mask_box, polygon_box
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.core.records import Image
from pftrack_sim.core.text import one_line

MAX_LINE_BYTES = 256 * 1024 * 1024
_PREFIX = "@@TRAX:"
_MESSAGE = re.compile(r"[a-z]+(?=\s|$)")
_TOKEN = re.compile(r'\s*(?:"([^"\\]*(?:\\.[^"\\]*)*)"|([^\s"]+))')
_PROPERTY = re.compile(r"([A-Za-z0-9._]{1,64})=(.*)", re.DOTALL)
_ESCAPED = re.compile(r"\\(.)")
_PNG_OPTIONS = (cv2.IMWRITE_PNG_COMPRESSION, 1)


@dataclass(frozen=True)
class Message:
    """A message: its kind (`hello`, `initialize`, `frame`, `state`, `quit`), arguments, and named properties."""

    kind: str
    arguments: tuple[str, ...] = ()
    properties: Mapping[str, str] = field(default_factory=dict[str, str])

    def encode(self) -> bytes:
        """The line, with its end."""
        named = [f"{key}={value}" for key, value in self.properties.items()]
        quoted = "".join(f' "{_escape(text)}"' for text in (*self.arguments, *named))
        return f"{_PREFIX}{self.kind}{quoted}\n".encode()


def _escape(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def parse(line: bytes) -> Message | None:
    r"""Message of a line; None if the line is output of the program.

    Raises:
        TrackerError: It begins as a message and is none.

    >>> parse(b'@@TRAX:state "1,2,3,4" "confidence=0.5"\n')
    Message(kind='state', arguments=('1,2,3,4',), properties={'confidence': '0.5'})
    """
    if not line.startswith(_PREFIX.encode()):
        return None
    text = line.decode(errors="replace")[len(_PREFIX) :].rstrip()
    kind = _MESSAGE.match(text)
    if kind is None:
        raise TrackerError(f"a TraX message without a kind: {one_line(text, 60)!r}")
    arguments: list[str] = []
    properties: dict[str, str] = {}
    position = kind.end()
    while position < len(text):
        token = _TOKEN.match(text, position)
        if token is None:
            raise TrackerError(f"a TraX message whose quotes do not match: {one_line(text, 60)!r}")
        position = token.end()
        value = token[2] if token[1] is None else _ESCAPED.sub(lambda one: "\n" if one[1] == "n" else one[1], token[1])
        named = _PROPERTY.fullmatch(value)
        if named:
            properties[named[1]] = named[2]
        else:
            arguments.append(value)
    return Message(kind[0], tuple(arguments), properties)


def encode_box(box: Box, formats: Collection[str]) -> str:
    """A box [px] as the first of rectangle, polygon and mask that is in `formats`.

    Raises:
        TrackerError: None of them is.
    """
    x, y, w, h = (float(value) for value in box)
    if "rectangle" in formats:
        return _numbers(x, y, w, h)
    if "polygon" in formats:
        return _numbers(x, y, x + w, y, x + w, y + h, x, y + h)
    if "mask" in formats:
        left, top = max(round(x), 0), max(round(y), 0)
        width, height = max(round(x + w) - left, 1), max(round(y + h) - top, 1)
        return f"mask:{left},{top},{width},{height},0,{width * height}"
    raise TrackerError(f"it takes no rectangle, polygon or mask, but {', '.join(formats) or 'nothing'}")


def _numbers(*values: float) -> str:
    return ",".join(f"{value:.4f}" for value in values)


def decode_box(region: str) -> Box | None:
    """The box [px] around a region; None for an empty one, and for a special code (the target is lost).

    Args:
        region: `x,y,w,h`; a polygon `x,y,x,y,x,y,...`; `mask:x,y,w,h,...` followed by the lengths of runs of pixels
            outside and inside by turns, row by row; or one number, a special code.

    Raises:
        TrackerError: Something else, or numbers that are not finite.

    >>> decode_box("3,2,5,2,4,7").tolist(), decode_box("mask:10,20,5,4,7,2,3,2").tolist()
    ([3.0, 2.0, 2.0, 5.0], [12.0, 21.0, 2.0, 2.0])
    """
    is_mask = region.startswith("mask:")
    try:
        values = np.array([float(one) for one in region.removeprefix("mask:").split(",")])
    except ValueError:
        values = np.zeros(0)
    box: Box | None = None
    if not np.isfinite(values).all():
        pass
    elif is_mask:
        box = mask_box(values)
    elif values.size == 4:
        box = values
    elif values.size >= 6 and values.size % 2 == 0:
        box = polygon_box(values)
    elif values.size == 1:
        return None
    if box is None or (box[2:] < 0.0).any():
        raise TrackerError(f"a region that is no rectangle, polygon or mask: {one_line(region, 60)!r}")
    return box if (box[2:] > 0.0).all() else None


def encode_png(image: Image) -> bytes:
    """`(H, W, 3)` uint8 RGB as PNG."""
    done, encoded = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), _PNG_OPTIONS)
    if not done:
        raise TrackerError("the image cannot be encoded as PNG")
    return encoded.tobytes()


def encode_raw(image: Image) -> str:
    """`(H, W, 3)` uint8 RGB as an image of the kind `memory`."""
    height, width = image.shape[:2]
    return f"image:{width};{height};rgb;{base64.b64encode(np.ascontiguousarray(image).data).decode()}"


def encode_buffer(image: Image) -> str:
    """`(H, W, 3)` uint8 RGB as an image of the kind `buffer`, losslessly."""
    return f"data:image/png;{base64.b64encode(encode_png(image)).decode()}"


def encode_path(path: Path) -> str:
    """An image of the kind `path`."""
    return f"file://{path.absolute()}"
