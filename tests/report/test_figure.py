"""Figures for papers."""

import itertools

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text

from pftrack_sim.report.figure import _write_names


@pytest.mark.parametrize("spread", [0.0, 0.05, 0.9])
def test_no_name_covers_another_however_near_the_points_are(spread: float):
    axes = Figure(figsize=(4.6, 3.2), layout="constrained").add_subplot()
    axes.set(xscale="log", xlim=(0.3, 30.0), ylim=(0.0, 1.0))
    places = 0.5 + spread * (np.random.default_rng(0).random((16, 2)) - 0.5)
    points = {f"tracker-{k}": (3.0 * 10 ** (x - 0.5), y) for k, (x, y) in enumerate(places.tolist())}
    for x, y in points.values():
        axes.plot(x, y, "o")
    _write_names(points, dict.fromkeys(points, "black"), axes)
    axes.figure.draw_without_rendering()
    boxes = [Text.get_window_extent(one) for one in axes.texts if isinstance(one, Annotation)]
    assert len(boxes) == 16
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
    inside = axes.get_window_extent().padded(1.0)
    assert all(inside.contains(*corner) for box in boxes for corner in box.corners())
