"""Whether the line of sight to the target's centre line is covered, seen from above.

The target's centre line is upright, so whether it is behind an upright thing is a question of the ground plan: does
the straight line from the camera to the target's centre cross the thing's footprint?
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def covered_by_box(
    camera_m: Array, target_m: Array, centre_m: Sequence[float] | Array, half_m: Sequence[float] | Array, yaw_rad: float
) -> NDArray[np.bool_]:
    """Whether a standing box comes between camera and target.

    Args:
        camera_m: `(T, 2)` camera on the ground.
        target_m: `(T, 2)` target's centre on the ground.
        centre_m: `(2,)` the box's centre.
        half_m: `(2,)` half sizes along the box's axes.
        yaw_rad: Angle of its first axis to the world's x.

    Returns:
        `(T,)`.
    """
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    axes = np.array([(cos, -sin), (sin, cos)])
    start = (camera_m - np.asarray(centre_m)) @ axes
    step = (target_m - camera_m) @ axes
    step = np.where(np.abs(step) < 1e-12, 1e-12, step)
    middle, reach = -start / step, np.abs(np.asarray(half_m) / step)
    enter = np.maximum((middle - reach).max(axis=1), 0.0)
    leave = np.minimum((middle + reach).min(axis=1), 1.0)
    return enter <= leave


def covered_by_person(camera_m: Array, target_m: Array, person_m: Array, half_width_m: float) -> NDArray[np.bool_]:
    """Whether a person comes between camera and target.

    Args:
        camera_m: `(T, 2)` camera on the ground.
        target_m: `(T, 2)` target's centre on the ground.
        person_m: `(T, 2)` where the person stands.
        half_width_m: Half of the person's width, as seen.

    Returns:
        `(T,)`.
    """
    sight = target_m - camera_m
    distance = np.maximum(np.hypot(*sight.T), 1e-9)
    offset = person_m - camera_m
    along = (offset * sight).sum(axis=1) / distance
    across = (sight[:, 0] * offset[:, 1] - sight[:, 1] * offset[:, 0]) / distance
    return (np.abs(across) <= half_width_m) & (along > 0.0) & (along < distance)


def spans(covered: NDArray[np.bool_], times_s: Array) -> list[tuple[float, float]]:
    """When the line of sight is covered: first and last covered time of each unbroken span."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], covered, [False]]).astype(np.int8)))
    return [(float(times_s[a]), float(times_s[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
