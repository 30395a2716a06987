"""Means over rectangles against sums over pixels."""

import numpy as np
import pytest

from pftrack_sim.trackers.features.integral import integral_image, rectangle_means

IMAGE = np.random.default_rng(0).integers(0, 256, (13, 17, 3), dtype=np.uint8)


def means(box: tuple[float, ...], rectangle: tuple[float, ...], channel: int = 0) -> float:
    return float(rectangle_means(integral_image(IMAGE), np.array([box]), np.array([rectangle]))[0, 0, channel])


@pytest.mark.parametrize("channel", range(3))
def test_whole_pixels_give_their_mean(channel: int):
    assert means((2.0, 3.0, 10.0, 8.0), (0.2, 0.25, 0.5, 0.5), channel) == pytest.approx(
        IMAGE[5:9, 4:9, channel].mean(), abs=1e-9
    )


def test_parts_of_pixels_count_by_their_area():
    """As an image drawn four times as large, in which the same rectangle has whole pixels."""
    large = IMAGE.repeat(4, axis=0).repeat(4, axis=1)
    assert means((2.25, 3.5, 4.75, 6.0), (0.0, 0.0, 1.0, 1.0), 1) == pytest.approx(
        large[14:38, 9:28, 1].mean(), abs=1e-9
    )


@pytest.mark.parametrize(
    ("rectangle", "rows", "columns"), [((-0.5, 0.0, 1.0, 1.0), 4, 2), ((-0.25, -0.25, 1.5, 1.5), 5, 5)]
)
def test_only_the_part_inside_the_image_counts(rectangle: tuple[float, ...], rows: int, columns: int):
    assert means((0.0, 0.0, 4.0, 4.0), rectangle) == pytest.approx(IMAGE[:rows, :columns, 0].mean(), abs=1e-9)


def test_a_rectangle_outside_the_image_has_mean_0():
    assert means((-50.0, 0.0, 4.0, 4.0), (0.0, 0.0, 1.0, 1.0)) == 0.0
