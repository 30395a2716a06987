"""Maps beside the images of a sequence, as PNG: depth, masks and optical flow.

Depth and flow are in the format of KITTI (Menze & Geiger 2015): depth is value / 256 m in 16 bits, 0 where it is
unknown; flow is (value - 32768) / 64 px across and down in the red and green channel, blue is 1 where it is known.
Masks hold the identity of the person that a pixel shows in 16 bits, 0 for none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.errors import UnknownNameError
from pftrack_sim.core.types import BoolArray, FloatArray

MapKind: TypeAlias = Literal["depth", "masks", "flow"]
MAP_KINDS: tuple[MapKind, ...] = get_args(MapKind)
_PER_METRE, _PER_PIXEL, _ZERO, _LARGEST = 256.0, 64.0, 32768.0, 65535.0


def check_maps(names: Sequence[str]) -> tuple[MapKind, ...]:
    """Return kinds of maps, each once; raises UnknownNameError for any other name."""
    for name in names:
        if name not in MAP_KINDS:
            raise UnknownNameError("map", name, MAP_KINDS)
    return tuple(kind for kind in MAP_KINDS if kind in names)


def encode_depth(depth_m: FloatArray) -> bytes:
    """PNG of `(H, W)` depth [m]; what is beyond 255.99 m, or infinite, is unknown."""
    values = np.round(depth_m * _PER_METRE)
    return _png(np.where(values <= _LARGEST, values, 0.0).astype(np.uint16))


def encode_masks(identities: NDArray[np.uint16]) -> bytes:
    """PNG of `(H, W)` identities; 0 for none."""
    return _png(identities)


def encode_flow(flow: FloatArray, known: BoolArray) -> bytes:
    """PNG of `(H, W, 2)` motion [px] where it is known; of more than 511 px it is unknown."""
    values = np.round(flow * _PER_PIXEL + _ZERO)
    kept = known & ((values >= 0.0) & (values <= _LARGEST)).all(axis=2)
    across, down = (np.where(kept, values[..., axis], 0.0) for axis in (0, 1))
    # OpenCV's channels are blue, green, red.
    return _png(np.stack([kept, down, across], axis=2).astype(np.uint16))


def _png(values: NDArray[np.uint16]) -> bytes:
    _, encoded = cv2.imencode(".png", values)
    return encoded.tobytes()
