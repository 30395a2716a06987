"""Attributes of frames as VOT names them, from the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy  # it imports its packages at first use
from numpy.typing import NDArray

from pftrack_sim.core.records import Truth
from pftrack_sim.core.types import BoolArray, FloatArray

# Limits are those of `losses.TAGS`; VOT's own attributes are annotated by hand.
_AROUND_S, _SIZE_FACTOR, _LUMINANCE_FACTOR, _MOTION_SIZES = 0.5, 1.25, 1.3, 0.3
_STEP_M, _TURN_RAD = 0.001, 0.001
"""Least motion of the camera between two frames."""


def frame_tags(truths: Sequence[Truth], rate_hz: float) -> Mapping[str, NDArray[np.bool_]]:
    """For each attribute whether a frame has it.

    Args:
        truths: Of the target, in `N` frames.
        rate_hz: Frames per second.

    Returns:
        `(N,)` flags: `size_change` and `illum_change` are changes by a factor of 1.25 and 1.3 within half a second
        before and after, `motion_change` is motion of the centre by 0.3 sizes, sqrt(w h), since the frame before,
        `camera_motion` a step of 1 mm or a turn of 1 mrad since then.
    """
    size = np.array([np.sqrt(truth.amodal_box[2] * truth.amodal_box[3]) for truth in truths])
    seen = np.array([truth.luminance if truth.visible_fraction > 0.5 else np.nan for truth in truths])
    motion = np.array([truth.image_motion_px for truth in truths])
    poses = np.array([truth.T_world_camera for truth in truths])
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    # The angle of the rotation between two frames: |R - I| = 2 sqrt(2) sin(angle / 2) in the Frobenius norm.
    chords = np.linalg.norm(np.diff(poses[:, :3, :3], axis=0), axis=(1, 2)) / np.sqrt(8.0)
    moved = (steps > _STEP_M) | (chords > np.sin(0.5 * _TURN_RAD))
    reach = 2 * round(_AROUND_S * rate_hz) + 1
    return {
        "size_change": _changes(size, reach, _SIZE_FACTOR),
        "illum_change": _changes(seen, reach, _LUMINANCE_FACTOR),
        "motion_change": np.nan_to_num(motion / size) > _MOTION_SIZES,
        "camera_motion": np.concatenate([[False], moved]),
    }


def _changes(values: FloatArray, reach: int, factor: float) -> BoolArray:
    """`(N,)` whether the largest of the values around is more than `factor` times the least; NaN is left out."""
    unknown = np.isnan(values)
    high = scipy.ndimage.maximum_filter1d(np.where(unknown, -np.inf, values), reach, mode="nearest")
    low = scipy.ndimage.minimum_filter1d(np.where(unknown, np.inf, values), reach, mode="nearest")
    return high > factor * low
