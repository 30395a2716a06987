"""Patches against OpenCV's warp, and the mixture of three Gaussians against what it was fed."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pftrack_sim.trackers.appearance.template import (
    MixtureNumbers,
    PixelMixture,
    grid,
    huber,
    patches,
    read_patches,
)

NUMBERS = MixtureNumbers(
    half_life=10.0,
    sigma_wandering=0.3,
    sigma_stable=0.3,
    sigma_fixed=0.3,
    sigma_min=0.05,
    share_min=0.001,
    restart_share=0.1,
    outlier_c=1.3,
)


def normalised(values: np.ndarray) -> np.ndarray:
    return (values - values.mean()) / values.std()


@pytest.mark.parametrize("angle", [0.0, 0.4, -2.0])
def test_a_patch_is_the_image_under_the_motion(angle: float):
    rng = np.random.default_rng(0)
    grey = cv2.GaussianBlur(rng.integers(0, 255, (80, 90), dtype=np.uint8), (0, 0), 2.0)
    rows, columns = 9, 7
    ux, uy = 30.0 * math.cos(angle), 30.0 * math.sin(angle)
    vx, vy = -24.0 * math.sin(angle), 24.0 * math.cos(angle)
    placement = np.array([[44.3, 40.1, ux, uy, vx, vy]])
    v, u = np.meshgrid((np.arange(rows) + 0.5) / rows - 0.5, (np.arange(columns) + 0.5) / columns - 0.5, indexing="ij")
    x, y = 44.3 + u * ux + v * vx - 0.5, 40.1 + u * uy + v * vy - 0.5  # OpenCV has pixel centres at whole numbers
    wanted = cv2.remap(
        grey.astype(np.float32),
        x.astype(np.float32),
        y.astype(np.float32),
        cv2.INTER_LINEAR,
        None,
        cv2.BORDER_REPLICATE,
    )
    found = read_patches(grey, placement, (rows, columns))[0]
    assert np.abs(found - normalised(wanted).ravel()).max() < 0.02


def test_brightness_and_contrast_do_not_matter():
    rng = np.random.default_rng(1)
    grey = rng.integers(60, 120, (60, 60), dtype=np.uint8)
    placement = np.array([[30.0, 30.0, 20.0, 0.0, 0.0, 24.0]])
    brighter = (1.5 * grey + 30).astype(np.uint8)
    one, other = (read_patches(image, placement, (12, 10)) for image in (grey, brighter))
    assert np.abs(one - other).max() < 0.05
    assert abs(one.mean()) < 1e-5
    assert one.std() == pytest.approx(1.0, abs=1e-4)


def test_a_flat_patch_is_zero_and_beyond_the_image_its_edge_repeats():
    flat = np.full((40, 40, 3), 90, np.uint8)
    assert not patches(flat, np.array([[20.0, 20, 10, 0, 0, 10]]), (5, 5)).any()
    step = np.zeros((40, 40, 3), np.uint8)
    step[:, 20:] = 200
    inside, outside = patches(step, np.array([[20.0, 20, 10, 0, 0, 10], [-40.0, 20, 10, 0, 0, 10]]), (5, 5))
    assert inside.any()
    assert not outside.any()


@given(st.floats(2, 400), st.floats(2, 400), st.integers(4, 2000))
def test_a_grid_has_about_the_points_asked_for(width: float, height: float, count: int):
    rows, columns = grid(width, height, count)
    assert min(rows, columns) >= 2
    assert rows * columns <= 2 * count + 4


@settings(max_examples=60)
@given(st.floats(-20, 20), st.floats(0.1, 5))
def test_huber_is_a_parabola_and_then_its_tangent(x: float, c: float):
    value = float(huber(np.array([x]), c)[0])
    assert value == pytest.approx(0.5 * x * x if abs(x) <= c else c * abs(x) - 0.5 * c * c)


def test_stable_component_learns_mean_and_spread_of_what_it_sees():
    rng = np.random.default_rng(2)
    truth = rng.normal(size=400)
    model = PixelMixture(truth.astype(np.float32), NUMBERS)
    for _ in range(200):
        model.learn((truth + 0.1 * rng.normal(size=400)).astype(np.float32))
    # The mean of the last ~14 frames: 0.1 / sqrt(2 * 14) of scatter.
    assert np.abs(model.means[1] - truth).mean() < 0.03
    assert abs(np.median(model.sigmas[1]) / 0.1 - 1.0) < 0.25
    assert model.means[2].tolist() == truth.astype(np.float32).tolist()


def test_after_a_change_the_wandering_explains_it_first_and_the_stable_takes_over():
    rng = np.random.default_rng(3)
    before, after = rng.normal(size=300), rng.normal(size=300) + 4.0
    model = PixelMixture(before.astype(np.float32), NUMBERS)
    for _ in range(60):
        model.learn((before + 0.05 * rng.normal(size=300)).astype(np.float32))
    held = model.shares.mean(axis=1)
    assert held[1] > held[0]
    for _ in range(5):
        model.learn((after + 0.05 * rng.normal(size=300)).astype(np.float32))
    assert np.abs(model.means[0] - after).mean() < 0.1
    assert np.abs(model.means[1] - before).mean() < np.abs(model.means[1] - after).mean()
    for _ in range(150):
        model.learn((after + 0.05 * rng.normal(size=300)).astype(np.float32))
    assert np.abs(model.means[1] - after).mean() < 0.1
    assert np.abs(model.shares.sum(axis=0) - 1.0).max() < 1e-12


def test_likelihood_is_the_product_over_the_pixels_as_written():
    rng = np.random.default_rng(4)
    model = PixelMixture(rng.normal(size=50).astype(np.float32), NUMBERS)
    for _ in range(4):
        model.learn(rng.normal(size=50).astype(np.float32))
    seen = rng.normal(size=(6, 50)).astype(np.float32)
    x = np.abs(seen[:, None] - model.means) / model.sigmas
    for robust in (False, True):
        rho = huber(x, 1.3) if robust else 0.5 * x**2
        wanted = np.log((model.shares / model.sigmas * np.exp(-rho)).sum(axis=1)).sum(axis=1)
        found = model.log_likelihood(seen, robust=robust)
        assert np.abs((found - wanted) / wanted).max() < 1e-4


def test_outliers_are_counted_by_hand():
    model = PixelMixture(np.zeros(10, np.float32), NUMBERS)
    patch = np.zeros(10, np.float32)
    patch[:3] = 0.3 * 1.31  # just beyond c = 1.3 standard deviations
    patch[3:6] = 0.3 * 1.29
    for rule in ("most", "stable", "all"):
        assert model.outlier_share(patch, rule) == pytest.approx(0.3)
    model.means[0] = 5.0
    assert model.outlier_share(patch, "most") == 1.0
    assert model.outlier_share(patch, "stable") == pytest.approx(0.3)
    assert model.outlier_share(patch, "all") == pytest.approx(0.3)


def test_error_is_about_one_where_the_model_predicts_as_well_as_it_says():
    rng = np.random.default_rng(5)
    wide = MixtureNumbers(10.0, 0.3, 0.3, 0.3, 0.05, 0.001, 0.1, 1e6)
    model = PixelMixture(np.zeros(20_000, np.float32), wide)
    assert model.error((0.3 * rng.normal(size=20_000)).astype(np.float32)) == pytest.approx(1.0, abs=0.05)
    assert model.error(np.zeros(20_000, np.float32)) == 0.0
