"""Calibration files of cameras, as ROS (`camera_info`), OpenCV (`FileStorage`) and Kalibr write them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.inputs import read_bytes
from pftrack_sim.core.types import FloatArray

_MOST_BYTES = 1 << 20
_COUNTS = (0, 4, 5, 8, 12, 14)
_BROWN = ("", "plumb_bob", "radtan", "none", "rational_polynomial")
_EQUIDISTANT = ("equidistant", "fisheye")
_POSE = re.compile(r"^\s*- \[.*\]\s*$\n?", re.MULTILINE)  # Rows of Kalibr's poses, which OpenCV cannot read


@dataclass(frozen=True, eq=False)
class Calibration:
    """A pinhole camera with a lens.

    Attributes:
        K: `(3, 3)` camera matrix [px], in OpenCV's convention: the middle of the first pixel is at (0, 0).
        distortion: 0, 4, 5, 8, 12 or 14 coefficients in OpenCV's order, or the 4 of an equidistant lens.
        size_px: Width and height of the image; None if the file does not tell.
        model: Name of the distortion's model; empty if the file does not tell.
    """

    K: FloatArray
    distortion: FloatArray
    size_px: tuple[int, int] | None
    model: str

    @property
    def equidistant(self) -> bool:
        """Whether the lens is one of `cv2.fisheye`."""
        return self.model in _EQUIDISTANT

    @property
    def lens(self) -> tuple[float, ...]:
        """k1, k2, p1, p2, k3, with k4, k5, k6 where one is not 0; or the four of an equidistant lens.

        Raises:
            ParameterError: A lens of another model.
        """
        if self.equidistant and len(self.distortion) == 4:
            return tuple(self.distortion.tolist())
        if self.model not in _BROWN or self.distortion[8:].any():
            name = f"{self.model or 'one'} with {len(self.distortion)} coefficients"
            raise ParameterError(
                "a lens of the model plumb_bob (k1, k2, p1, p2, k3), rational_polynomial (k4, k5, k6, too) or "
                f"equidistant (4) is needed, got {name}"
            )
        count = 8 if self.distortion[5:].any() else 5
        return tuple(np.append(self.distortion, np.zeros(8))[:count].tolist())


def read_calibration(path: Path) -> Calibration:
    """Read a calibration in YAML; of several cameras of Kalibr the first, `cam0`.

    Raises:
        ParameterError: It cannot be read, or has another content.
    """
    storage = yaml_storage(path)
    try:
        kalibr = storage.getNode("cam0")
        if kalibr.isMap():
            fx, fy, cx, cy = (*numbers_of(kalibr.getNode("intrinsics")), *[np.nan] * 4)[:4]
            matrix = np.array([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])
            distortion, size = (numbers_of(kalibr.getNode(key)) for key in ("distortion_coeffs", "resolution"))
            model = kalibr.getNode("distortion_model").string()
            camera = kalibr.getNode("camera_model").string()
        else:
            matrix, distortion = (
                numbers_of(storage.getNode(key)) for key in ("camera_matrix", "distortion_coefficients")
            )
            size = np.array([storage.getNode(key).real() for key in ("image_width", "image_height")])
            model = storage.getNode("distortion_model").string()
            camera = ""
            if storage.getNode("fisheye_model").real() == 1.0:  # of OpenCV's own calibration program
                model = "equidistant"
    except (SystemError, ValueError, cv2.error):
        raise ParameterError(f"{path}: cannot be read as a calibration in YAML") from None
    if camera not in ("", "pinhole"):
        raise ParameterError(f"{path}: cam0 is no pinhole with a lens: camera_model is {camera}")
    if len(matrix) != 9 or not np.isfinite(matrix).all() or min(matrix[0], matrix[4]) <= 0.0:
        raise ParameterError(
            f"{path}: needs camera_matrix with 9 numbers, as ROS and OpenCV write it, or cam0 of Kalibr; "
            f"got {len(matrix)} numbers, focal lengths {matrix[:1].tolist()} and {matrix[4:5].tolist()}"
        )
    if matrix[[1, 3, 6, 7]].any() or matrix[8] != 1.0:
        raise ParameterError(f"{path}: camera_matrix is none of a pinhole without skew: {matrix.tolist()}")
    if len(distortion) not in _COUNTS or not np.isfinite(distortion).all():
        raise ParameterError(f"{path}: distortion coefficients are 4, 5, 8, 12 or 14 numbers, got {len(distortion)}")
    whole = (int(size[0]), int(size[1])) if len(size) == 2 and size.any() else None
    return Calibration(matrix.reshape(3, 3), distortion, whole, model)


def yaml_storage(path: Path) -> cv2.FileStorage:
    """A small YAML file, as OpenCV reads it.

    Raises:
        ParameterError: It cannot be read, or is not YAML.
    """
    try:
        text = _POSE.sub("", read_bytes(path, _MOST_BYTES).decode())
        text = text if text.startswith("%YAML") else f"%YAML:1.0\n---\n{text}"
        flags = cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML
        return cv2.FileStorage(text, flags)
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (SystemError, ValueError, cv2.error):  # text that is no UTF-8 is a ValueError
        raise ParameterError(f"{path}: cannot be read as a calibration or map in YAML") from None


def numbers_of(node: cv2.FileNode) -> FloatArray:
    """Numbers of a list, or of the `data` of a table; none if it is neither."""
    data = node.getNode("data") if node.isMap() else node
    return np.array([data.at(index).real() for index in range(data.size())] if data.isSeq() else [], dtype=np.float64)
