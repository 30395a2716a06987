"""Histograms, textures and likelihoods against known answers and other libraries."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pftrack_sim.trackers.features.histogram import (
    COLUMNS,
    ROWS,
    BinLayout,
    Feature,
    HistogramModel,
    cell_layout,
    distance_layout,
    epanechnikov_layout,
    histogram,
    histograms,
    similarities,
    uniform_layout,
)
from pftrack_sim.trackers.features.pixel_codes import cs_lbp_codes, hsv_codes, rgb_codes
from pftrack_sim.trackers.papers.ko2012 import log_mixture

LAYOUTS = [
    uniform_layout(3, 16),
    epanechnikov_layout(3, 128),
    uniform_layout(1, 256),
    cell_layout(),
    distance_layout(24, 16, 256),
]
RNG = np.random.default_rng(0)


def random_codes(layout: BinLayout, height: int = 70, width: int = 60, seed: int = 0) -> np.ndarray:
    shape = (height, width, layout.channel_count)
    return np.random.default_rng(seed).integers(0, layout.bin_count, shape, dtype=np.uint8)


@pytest.mark.parametrize("layout", LAYOUTS)
@settings(max_examples=15)
@given(x=st.floats(-30, 60), y=st.floats(-30, 60), w=st.floats(0.5, 90), h=st.floats(0.5, 90))
def test_a_histogram_is_that_of_twice_the_box_in_twice_the_image_and_among_others(
    layout: BinLayout, x: float, y: float, w: float, h: float
):
    codes, box = random_codes(layout), np.array([x, y, w, h])
    found = histogram(codes, box, layout)
    assert found.sum() == pytest.approx(1) or not found.any()
    assert np.array_equal(histogram(codes.repeat(2, axis=0).repeat(2, axis=1), 2 * box, layout), found)
    many = histograms(codes, np.array([box, [1.0, 2, 40, 40]]), layout)
    assert np.allclose(many[0], found * many[0].sum(), rtol=0, atol=1e-12)
    assert -1e-12 <= many[0].sum() <= 1 + 1e-12
    assert many[1].sum() == pytest.approx(1, abs=1e-12)


def test_epanechnikov_histogram_of_whole_pixels_against_numpy():
    """On a box of exactly ROWS x COLUMNS pixels every point is a pixel's centre."""
    layout = epanechnikov_layout(3, 128)
    codes = random_codes(layout)
    v, u = np.mgrid[:ROWS, :COLUMNS]
    radius = ((v + 0.5 - ROWS / 2) / (ROWS / 2)) ** 2 + ((u + 0.5 - COLUMNS / 2) / (COLUMNS / 2)) ** 2
    weights = np.where(radius < 1, 1 - radius, 0)
    cut = codes[5 : 5 + ROWS, 7 : 7 + COLUMNS]
    expected = [np.bincount(cut[..., c].ravel(), weights.ravel(), 128) for c in range(3)]
    expected = np.concatenate([one / one.sum() for one in expected]) / 3
    found = histogram(codes, np.array([7.0, 5, COLUMNS, ROWS]), layout)
    assert np.allclose(found, expected, rtol=0, atol=1e-6)
    assert np.allclose(found.reshape(3, 128).sum(axis=1), 1 / 3, rtol=0, atol=1e-6)


def test_cells_cover_their_part_of_the_box():
    layout = cell_layout()
    codes = np.zeros((ROWS, COLUMNS, 1), np.uint8)
    codes[:12, 18:] = 5  # the upper right of the 16 cells
    found = histogram(codes, np.array([0.0, 0, COLUMNS, ROWS]), layout).reshape(4, 4, 16)
    assert found[0, 3, 5] == pytest.approx(1 / 16)
    assert found[..., 5].sum() == pytest.approx(1 / 16)
    assert found[..., 0].sum() == pytest.approx(15 / 16)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_bhattacharyya_agrees_with_opencv(layout: BinLayout):
    one, other = (random_codes(layout, seed=seed) // (1 + seed) for seed in (0, 1))
    box = np.array([4.2, 3.1, 41.0, 55.5])
    p, q = histogram(one, box, layout), histogram(other, box, layout)
    distance = np.sqrt(1 - similarities(one, box[None], layout, q)[0])
    theirs = cv2.compareHist(p.astype(np.float32), q.astype(np.float32), cv2.HISTCMP_BHATTACHARYYA)
    assert abs(distance - theirs) < 1e-4


@pytest.mark.parametrize("layout", LAYOUTS)
@given(seed=st.integers(0, 10_000))
@settings(max_examples=20)
def test_similarity_is_one_with_itself_and_symmetric(layout: BinLayout, seed: int):
    box = np.array([3.0, 2, 50, 60])
    one, other = random_codes(layout, seed=seed), random_codes(layout, seed=seed + 1)
    p, q = histogram(one, box, layout), histogram(other, box, layout)
    assert similarities(one, box[None], layout, p)[0] == pytest.approx(1, abs=1e-6)
    forth, back = similarities(one, box[None], layout, q)[0], similarities(other, box[None], layout, p)[0]
    assert abs(forth - back) < 1e-6
    assert 0 <= forth <= 1


def test_points_outside_the_image_match_nothing():
    layout = uniform_layout(1, 4)
    codes = np.zeros((40, 40, 1), np.uint8)
    model = histogram(codes, np.array([0.0, 0, 40, 40]), layout)
    boxes = np.array(
        [[0.0, 0, 40, 40], [20, 0, 40, 40], [20, 20, 40, 40], [90, 0, 40, 40], [0, 1e15, 40, 40], [-1e15, 0, 40, 40]]
    )
    expected = [1, np.sqrt(0.5), 0.5, 0, 0, 0]
    assert np.allclose(similarities(codes, boxes, layout, model), expected, rtol=0, atol=1e-6)
    assert histogram(codes, boxes[3], layout).sum() == 0


@pytest.mark.parametrize(
    ("gradient", "code"),
    [((0, 1), 0b0011), ((0, -1), 0b1000), ((-1, 0), 0b1110), ((1, 0), 0b0000), ((0, 0), 0), ((-1, 1), 0b0111)],
    ids=["brighter to the right", "to the left", "upwards", "downwards", "flat", "up and right"],
)
def test_cs_lbp_of_known_gradients(gradient: tuple[int, int], code: int):
    v, u = np.mgrid[-3:4, -3:4]
    grey = (100 + gradient[0] * v + gradient[1] * u).astype(np.uint8)
    codes = cs_lbp_codes(np.repeat(grey[..., None], 3, axis=2))
    assert (codes[1:-1, 1:-1] == code).all()


def test_known_colours_have_known_codes():
    image = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [0, 0, 0], [255, 255, 255]]], np.uint8)
    assert hsv_codes(image, 128)[0].tolist() == [
        [0, 127, 127],
        [128 // 3, 127, 127],
        [2 * 128 // 3, 127, 127],
        [0, 0, 0],
        [0, 0, 127],
    ]
    assert rgb_codes(image, 8)[0].tolist() == [[7, 0, 0], [0, 7, 0], [0, 0, 7], [0, 0, 0], [7, 7, 7]]


def test_codes_are_below_the_bin_count():
    image = RNG.integers(0, 256, (200, 200, 3), dtype=np.uint8)
    for count in (1, 8, 128, 256):
        assert hsv_codes(image, count).max() < count
        assert rgb_codes(image, count).max() == count - 1


def test_similarities_do_not_depend_on_the_cropped_region():
    """Only the part of the image that the boxes touch is converted."""
    image = RNG.integers(0, 256, (80, 100, 3), dtype=np.uint8)
    features = [
        Feature(cs_lbp_codes, cell_layout()),
        Feature(lambda i: hsv_codes(i, 32), uniform_layout(3, 32)),
    ]
    model = HistogramModel(features, image, np.array([30.0, 20, 20, 30]))
    boxes = RNG.uniform([-20, -20, 5, 5], [110, 90, 60, 60], (40, 4))
    together = model.similarities(model.encode(image, boxes), boxes)
    each = boxes[:, None]
    alone = np.concatenate([model.similarities(model.encode(image, box), box) for box in each], axis=1)
    assert together.shape == (2, 40)
    assert np.abs(together - alone).max() < 1e-6
    whole = np.stack(
        [similarities(f.encode(image), boxes, f.layout, h) for f, h in zip(features, model.histograms, strict=True)]
    )
    assert np.abs(together - whole).max() < 1e-6


@pytest.mark.parametrize("form", ["linear", "exponential"])
def test_likelihood_increases_with_similarity(form: str):
    alike = np.stack([np.linspace(0, 1, 11), np.linspace(0, 1, 11)])
    logs = log_mixture(alike, np.array([0.6, 0.4]), form, np.array([20.0, 30.0]))  # pyright: ignore[reportArgumentType]
    assert (np.diff(logs) > 0).all()
    assert logs[-1] == pytest.approx(0)


def test_likelihood_matches_hand_computed_values():
    alike, shares, sharpness = np.array([[0.81], [0.5]]), np.array([0.6, 0.4]), np.array([10.0, 4.0])
    linear = log_mixture(alike, shares, "linear", sharpness)[0]
    assert linear == pytest.approx(np.log(0.6 * 0.81 + 0.4 * 0.5))
    exponential = log_mixture(alike, shares, "exponential", sharpness)[0]
    assert exponential == pytest.approx(np.log(0.6 * np.exp(-1.9) + 0.4 * np.exp(-2.0)))
    assert log_mixture(np.zeros((2, 1)), shares, "linear", sharpness)[0] == -np.inf
