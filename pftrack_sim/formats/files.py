"""Text files of boxes and other numbers, and JSON, as layouts have them."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Generator
from pathlib import Path
from typing import Annotated, TypeAlias, TypeVar

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from pftrack_sim.core.errors import SequenceError
from pftrack_sim.core.inputs import read_bytes
from pftrack_sim.core.text import one_line
from pftrack_sim.core.types import FloatArray

MAX_BYTES = 64 << 20


def number_rows(path: Path, what: str, count: int, *, more: bool = False) -> FloatArray:
    """`(N, count)` numbers, one row per line, separated by commas, tabs or spaces; NaN is a number.

    Args:
        path: Text file.
        what: What a line holds, for messages: `"x, y, w, h"`.
        count: Numbers in a line.
        more: Whether a line may have further numbers, which are ignored.

    Raises:
        SequenceError: The file is missing, empty, or no text; a line is something else.
    """
    lines = read_text(path).rstrip().splitlines()
    if not lines:
        raise SequenceError(f"{path}: is empty")
    rows = np.empty((len(lines), count))
    for index, line in enumerate(lines):
        fields = re.split(r"\s*,\s*|\s+", line.strip())
        try:
            numbers = [float(field) for field in fields]
        except ValueError:
            numbers = []
        if len(numbers) < count or (len(numbers) > count and not more):
            raise SequenceError(f"{path}, line {index + 1}: expected {what}, got {line.strip()[:60]!r}")
        if np.isinf(numbers).any():
            raise SequenceError(f"{path}, line {index + 1}: expected finite numbers or NaN, got {line.strip()[:60]!r}")
        rows[index] = numbers[:count]
    return rows


@contextlib.contextmanager
def reading(path: Path, missing: str = "no such file") -> Generator[None]:
    """Raises SequenceError about a file or folder that cannot be read in the block."""
    try:
        yield
    except FileNotFoundError:
        raise SequenceError(f"{path}: {missing}") from None
    except OSError as error:
        raise SequenceError(f"{path}: cannot be read: {error.strerror or error}") from None


def read_text(path: Path) -> str:
    """A text file; raises SequenceError where it cannot be read, or is none."""
    try:
        with reading(path):
            return read_bytes(path, MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise SequenceError(f"{path}: is not a text file") from None


JsonNumber: TypeAlias = Annotated[float, Field(allow_inf_nan=False)]
JsonBox: TypeAlias = tuple[JsonNumber, JsonNumber, JsonNumber, JsonNumber]
_Content = TypeVar("_Content", bound=BaseModel)


def json_content(where: Path | str, content: bytes, kind: type[_Content]) -> _Content:
    """JSON as a model; `where` names it in messages.

    Raises:
        SequenceError: It is no JSON, or lacks something, or holds something else there.
    """
    try:
        return kind.model_validate_json(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise SequenceError(f"{where}: {place}{': ' * bool(place)}{one_line(first['msg'])}") from None


def present_boxes(rows: FloatArray, *, first_pixel: float = 0.0) -> FloatArray:
    """`(N, 4)` 0-based boxes; NaN rows where a number is NaN or a size is not positive: the target is absent."""
    boxes = rows - np.array([first_pixel, first_pixel, 0.0, 0.0])
    boxes[~(rows[:, 2:] > 0.0).all(axis=1) | np.isnan(rows).any(axis=1)] = np.nan
    return boxes


def box_lines(boxes: FloatArray, *, first_pixel: float = 0.0) -> str:
    """Boxes as lines `x,y,w,h`; `0,0,0,0` where the target is absent. Five decimals are 1e-5 px."""
    shifted = boxes + np.array([first_pixel, first_pixel, 0.0, 0.0])
    shifted[np.isnan(boxes).any(axis=1)] = 0.0
    return "".join(",".join(number(value) for value in row) + "\n" for row in shifted.tolist())


def number(value: float) -> str:
    """A number with at most five decimals.

    >>> number(10.0), number(0.25), number(-0.000001)
    ('10', '0.25', '0')
    """
    text = f"{value:.5f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
