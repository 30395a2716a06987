"""The shift of the whole image, by phase correlation."""

import cv2
import numpy as np
import pytest

from pftrack_sim.trackers.features.image_shift import COLUMNS, PEAK_RADIUS, ROWS, ImageShift, find_peak
from pftrack_sim.trackers.pftrack.camera_motion import CERTAINTY_MIN


def texture(width: int, height: int, seed: int) -> np.ndarray:
    coarse = np.random.default_rng(seed).integers(0, 256, (height // 8 + 1, width // 8 + 1, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC))


@pytest.mark.parametrize("size", [(320, 240), (641, 480), (90, 60)])
@pytest.mark.parametrize("moved", [(6, -9), (-15, 4), (0, 0)])
def test_the_shift_of_the_image_is_found(size: tuple[int, int], moved: tuple[int, int]):
    (width, height), (x, y) = size, moved
    large = texture(width + 60, height + 60, seed=2)
    subject = ImageShift(certainty_min=0.05)
    assert subject.update(np.ascontiguousarray(large[30 : 30 + height, 30 : 30 + width])).tolist() == [0.0, 0.0]
    found = subject.update(np.ascontiguousarray(large[30 - y : 30 - y + height, 30 - x : 30 - x + width]))
    assert np.abs(found - moved).max() < max(width / COLUMNS, 1.0)


def test_an_unrelated_image_has_no_shift():
    subject = ImageShift(CERTAINTY_MIN)
    subject.update(texture(160, 120, seed=1))
    assert subject.update(texture(160, 120, seed=2)).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("value", [0, 120])
def test_a_uniform_image_has_no_shift(value: int):
    subject = ImageShift(certainty_min=0.0)
    for _ in range(3):
        assert subject.update(np.full((120, 160, 3), value, np.uint8)).tolist() == [0.0, 0.0]


def reference_peak(correlation: np.ndarray) -> tuple[float, float, float]:
    """The same in NumPy."""
    row, column = divmod(int(correlation.argmax()), COLUMNS)
    rows = np.arange(row - PEAK_RADIUS, row + PEAK_RADIUS + 1)
    columns = np.arange(column - PEAK_RADIUS, column + PEAK_RADIUS + 1)
    peak = np.maximum(correlation[np.ix_(rows % ROWS, columns % COLUMNS)], 0.0)
    near = np.asarray(peak[1:-1, 1:-1], dtype=np.float64)
    x, y = (float(near.sum(axis=axis) @ cells[1:-1] / near.sum()) for axis, cells in ((0, columns), (1, rows)))
    return float(peak.sum()), x - COLUMNS if x > COLUMNS / 2 else x, y - ROWS if y > ROWS / 2 else y


@pytest.mark.parametrize("seed", range(20))
def test_the_peak_agrees_with_numpy(seed: int):
    rng = np.random.default_rng(seed)
    correlation = (0.05 * rng.standard_normal((ROWS, COLUMNS))).astype(np.float32)
    correlation[rng.choice([0, ROWS // 2, ROWS - 1]), rng.choice([0, 11, COLUMNS - 1])] = 0.4
    found = np.array(find_peak(correlation))
    # Coordinates of single precision, of cells up to 80.
    assert np.abs(found - reference_peak(correlation)).max() < 1e-4
