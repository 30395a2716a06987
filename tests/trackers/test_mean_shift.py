"""Mean shift of a box on a colour histogram."""

import numpy as np
import pytest

from pftrack_sim.trackers.features.histogram import epanechnikov_layout, histogram, similarities
from pftrack_sim.trackers.features.mean_shift import mean_shift

LAYOUT = epanechnikov_layout(1, 16)


def blob(x: int, y: int) -> np.ndarray:
    """A disc of two colours on a background of others."""
    rng = np.random.default_rng(0)
    codes = rng.integers(8, 16, (120, 160, 1), dtype=np.uint8)
    v, u = np.mgrid[:120, :160]
    disc = np.hypot(u + 0.5 - x, v + 0.5 - y)
    codes[disc < 20] = 2
    codes[disc < 10] = 5
    return codes


MODEL_BOX = np.array([60.0, 40, 40, 40])
MODEL = histogram(blob(80, 60), MODEL_BOX, LAYOUT)


@pytest.mark.parametrize("shift", [(0, 0), (12, -7), (-15, 10), (3, 18)])
def test_it_climbs_to_the_target(shift: tuple[int, int]):
    codes = blob(80 + shift[0], 60 + shift[1])
    found, similarity = mean_shift(codes, MODEL_BOX, LAYOUT, MODEL, 30)
    assert np.abs(found[:2] - MODEL_BOX[:2] - shift).max() < 1.5
    assert np.array_equal(found[2:], MODEL_BOX[2:])
    assert similarity > 0.97


def test_its_similarity_is_that_of_the_box_it_returns():
    codes = blob(88, 55)
    for count in (0, 1, 5, 30):
        found, similarity = mean_shift(codes, MODEL_BOX, LAYOUT, MODEL, count)
        assert similarity == pytest.approx(similarities(codes, found[None], LAYOUT, MODEL)[0], abs=1e-9)
        assert count or np.array_equal(found, MODEL_BOX)


def test_no_step_lowers_the_similarity_on_the_way_to_a_far_target():
    codes = blob(96, 60)
    reached = [mean_shift(codes, MODEL_BOX, LAYOUT, MODEL, count)[1] for count in range(12)]
    assert np.diff(reached).min() > -0.01
    assert reached[-1] > reached[0] + 0.2


@pytest.mark.parametrize("box", [(300.0, 300, 40, 40), (-20.0, -20, 40, 40), (10.2, 10.7, 0.3, 0.3)])
def test_a_box_without_the_target_stays_finite(box: tuple[float, ...]):
    found, similarity = mean_shift(blob(80, 60), np.array(box), LAYOUT, MODEL, 20)
    assert np.isfinite(found).all()
    assert 0 <= similarity <= 1
