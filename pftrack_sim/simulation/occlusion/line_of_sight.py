"""Whether something covers the line of sight to the target's centre line, in plan view.

The target's centre line is vertical: an upright thing covers it where the straight line from the camera to the target
crosses the thing's footprint.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pftrack_sim.core.types import BoolArray, FloatArray


def line_in_box(
    start: FloatArray, end: FloatArray, centre_m: Sequence[float] | FloatArray, half_m: Sequence[float], yaw_rad: float
) -> tuple[FloatArray, FloatArray]:
    """Shares of the ways from start to end `(T, 2)` at which the infinite lines enter and leave a box, `(T,)` each.

    A line misses the box where it leaves before it enters.
    """
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    axes = np.array([(cos, -sin), (sin, cos)])
    local = (start - np.asarray(centre_m)) @ axes
    step = (end - start) @ axes
    step = np.where(np.abs(step) < 1e-12, 1e-12, step)
    middle, reach = -local / step, np.abs(np.asarray(half_m) / step)
    return (middle - reach).max(axis=1), (middle + reach).min(axis=1)


def covered_by_box(
    camera_m: FloatArray,
    target_m: FloatArray,
    centre_m: Sequence[float] | FloatArray,
    half_m: Sequence[float],
    yaw_rad: float,
) -> BoolArray:
    """`(T,)` whether a static box is between camera and target, both at `(T, 2)` points on the ground.

    The box has its centre at `(2,)` and half sizes `(2,)` along its axes, the first of which is at an angle to the
    world's x.
    """
    enter, leave = line_in_box(camera_m, target_m, centre_m, half_m, yaw_rad)
    return np.maximum(enter, 0.0) <= np.minimum(leave, 1.0)


def covered_by_person(
    camera_m: FloatArray, target_m: FloatArray, person_m: FloatArray, half_width_m: float
) -> BoolArray:
    """`(T,)` whether a person at `(T, 2)` of a given apparent half width is between camera and target `(T, 2)`."""
    sight = target_m - camera_m
    distance = np.maximum(np.hypot(*sight.T), 1e-9)
    offset = person_m - camera_m
    along = (offset * sight).sum(axis=1) / distance
    across = (sight[:, 0] * offset[:, 1] - sight[:, 1] * offset[:, 0]) / distance
    return (np.abs(across) <= half_width_m) & (along > 0.0) & (along < distance)


def spans(covered: BoolArray, times_s: FloatArray) -> list[tuple[float, float]]:
    """First and last covered time of each uninterrupted occlusion."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], covered, [False]]).astype(np.int8)))
    return [(float(times_s[a]), float(times_s[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
