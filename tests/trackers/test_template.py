"""Grey patches and the mixture of their pixels, against slow and plain writings of the same."""

import math

import cv2
import numpy as np
import pytest

from pftrack_sim.trackers.features.patches import PatchSampler, grid_shape, sample_patches
from pftrack_sim.trackers.features.pixel_mixture import MixtureSettings, OutlierRule, PixelMixture, huber

SETTINGS = MixtureSettings(
    half_life=20.0,
    sigma_wandering=0.5,
    sigma_stable=0.5,
    sigma_fixed=0.5,
    sigma_min=0.1,
    share_min=0.001,
    outlier_c=1.3,
)


def slow_patch(grey: np.ndarray, placement: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """A patch as its definition says it, point by point."""
    centre, across, down = placement[:2], placement[2:4], placement[4:]
    padded = np.pad(grey.astype(np.float64), 200, mode="edge")
    values: list[float] = []
    for i in range(rows):
        for j in range(columns):
            point = centre + ((j + 0.5) / columns - 0.5) * across + ((i + 0.5) / rows - 0.5) * down
            x, y = point - 0.5 + 200
            left, upper = math.floor(x), math.floor(y)
            a, b = x - left, y - upper
            quad = padded[upper : upper + 2, left : left + 2]
            values.append(float(np.array([1 - b, b]) @ quad @ np.array([1 - a, a])))
    patch = np.array(values)
    return (patch - patch.mean()) / patch.std() if patch.std() > 0.05 else np.zeros_like(patch)


def placements(count: int, seed: int = 0) -> np.ndarray:
    """`(N, 6)` turned and sheared templates in and partly outside an image of 60x50."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-5, 65, count), rng.uniform(-5, 55, count), rng.normal(0, 15, (count, 4))])


def test_patches_against_a_slow_writing():
    grey = np.random.default_rng(1).integers(0, 256, (50, 60), dtype=np.uint8)
    placed = placements(40)
    found = sample_patches(grey, placed, (7, 5))
    assert found.shape == (40, 35)
    expected = np.array([slow_patch(grey, one, 7, 5) for one in placed])
    assert np.allclose(found, expected, rtol=0, atol=2e-5)


def test_upright_patches_against_opencv():
    grey = np.random.default_rng(2).integers(0, 256, (50, 60), dtype=np.uint8)
    columns, rows, x, y, w, h = 8, 12, 10.25, 6.5, 20.0, 30.0
    across = (x + (np.arange(columns) + 0.5) / columns * w - 0.5).astype(np.float32)
    down = (y + (np.arange(rows) + 0.5) / rows * h - 0.5).astype(np.float32)
    expected = cv2.remap(grey.astype(np.float32), *np.meshgrid(across, down), cv2.INTER_LINEAR)
    expected = (expected - expected.mean()) / expected.std()
    found = sample_patches(grey, np.array([[x + w / 2, y + h / 2, w, 0, 0, h]]), (rows, columns))[0]
    # OpenCV may round positions to a 32nd of a pixel.
    assert np.abs(found.reshape(rows, columns) - expected).max() < 0.15
    assert np.corrcoef(found, expected.ravel())[0, 1] > 0.999


def test_brightness_and_contrast_do_not_matter():
    grey = np.random.default_rng(1).integers(0, 100, (50, 60), dtype=np.uint8)
    placed = placements(10, seed=4)
    assert np.allclose(
        sample_patches(grey, placed, (6, 6)), sample_patches(2 * grey + 31, placed, (6, 6)), rtol=0, atol=1e-4
    )


def test_a_wall_of_one_grey_is_nothing():
    flat = np.full((50, 60), 77, np.uint8)
    assert (sample_patches(flat, placements(5), (6, 6)) == 0).all()


@pytest.mark.parametrize(("size", "count"), [((80, 160), 400), ((2, 2), 400), ((500, 3), 100), ((30, 20), 4)])
def test_the_grid_has_about_the_points_asked_for(size: tuple[float, float], count: int):
    rows, columns = grid_shape(*size, count)
    assert rows >= 2
    assert columns >= 2
    assert 0.6 * count <= rows * columns <= 1.4 * count


def test_a_view_of_a_small_template_reads_the_image_itself():
    image = np.random.default_rng(1).integers(0, 256, (50, 60, 3), dtype=np.uint8)
    placed = placements(20)
    found = PatchSampler(image, (12.0, 14.0), (10, 9)).patches(placed)
    whole = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    assert np.allclose(found, sample_patches(whole, placed, (10, 9)), rtol=0, atol=1e-5)


def test_what_was_read_before_does_not_matter():
    image = np.random.default_rng(1).integers(0, 256, (200, 260, 3), dtype=np.uint8)
    upright = np.array([[130.0, 100.0, 40, 0, 0, 50], [60, 50, 40, 0, 0, 50], [250, 190, 40, 0, 0, 50]])
    fresh = [PatchSampler(image, (40.0, 50.0), (12, 10)).patches(one[None])[0] for one in upright]
    used = PatchSampler(image, (40.0, 50.0), (12, 10))
    for one, expected in zip([*upright, upright[0]], [*fresh, fresh[0]], strict=True):
        assert np.allclose(used.patches(one[None])[0], expected, rtol=0, atol=1e-5)


def test_a_large_template_does_not_alias():
    """Stripes of one pixel are grey from afar: a coarse template sees only the slow gradient under them."""
    slow = np.tile(np.linspace(60, 180, 240), (240, 1))
    stripes = np.where(np.arange(240) % 2, 50, -50)
    image = np.repeat((slow + stripes)[..., None], 3, axis=2).astype(np.uint8)
    placed = np.array([[120.0, 120, 200, 0, 0, 200]])
    found = PatchSampler(image, (200.0, 200.0), (10, 10)).patches(placed)[0]
    expected = slow_patch(slow.astype(np.uint8), placed[0], 10, 10)
    assert np.abs(found - expected).max() < 0.1


def test_huber_by_hand():
    """Eq. 12."""
    x = np.array([0.0, 1.0, -1.0, 1.3, 2.0, -2.0])
    expected = [0, 0.5, 0.5, 0.845, 1.3 * 2 - 0.845, 1.3 * 2 - 0.845]
    assert np.allclose(huber(x, 1.3), expected, rtol=0, atol=1e-12)
    assert huber(np.array([1.3 + 1e-9]), 1.3)[0] == pytest.approx(0.845, abs=1e-8)


@pytest.fixture
def mixture() -> PixelMixture:
    """Ten pixels; W, S and F expect 1, 2 and 3, give or take a half."""
    model = PixelMixture(np.zeros(10, np.float32), SETTINGS)
    model.means[:] = np.array([[1.0], [2.0], [3.0]])
    return model


# Limits are 0.65 away: W explains 0.35..1.65, S 1.35..2.65, F 2.35..3.65.
@pytest.mark.parametrize(
    ("patch", "most", "stable", "none"),
    [
        ([1.0] * 10, 1.0, 1.0, 0.0),
        ([2.0] * 10, 1.0, 0.0, 0.0),
        ([2.5] * 10, 1.0, 0.0, 0.0),
        ([1.5] * 5 + [2.5] * 5, 0.5, 0.0, 0.0),
        ([2.0] * 7 + [9.0] * 3, 1.0, 0.3, 0.3),
        ([1.64] * 9 + [3.66], 1.0, 0.1, 0.1),
        ([-5.0] * 10, 1.0, 1.0, 1.0),
    ],
)
def test_outliers_are_counted(patch: list[float], most: float, stable: float, none: float, mixture: PixelMixture):
    rules: tuple[tuple[OutlierRule, float], ...] = (("most", most), ("stable", stable), ("all", none))
    for rule, expected in rules:
        assert mixture.outlier_share(np.array(patch, np.float32), rule) == pytest.approx(expected)


def test_the_prediction_error_is_one_where_pixels_are_as_far_off_as_said():
    """Eq. 10."""
    first = np.linspace(-1, 1, 50).astype(np.float32)
    model = PixelMixture(first, SETTINGS)
    assert model.prediction_error(first) == pytest.approx(0, abs=1e-9)
    assert model.prediction_error(first + np.float32(0.5)) == pytest.approx(1, abs=1e-5)
    x = 2.0 * np.ones(50)
    assert model.prediction_error(first + np.float32(1.0)) == pytest.approx(2 * huber(x, 1.3)[0], abs=1e-5)


@pytest.mark.parametrize("robust", [False, True])
def test_the_likelihood_against_a_plain_writing(robust: bool):
    rng = np.random.default_rng(0)
    model = PixelMixture(rng.standard_normal(83).astype(np.float32), SETTINGS)
    for _ in range(5):
        model.learn(rng.standard_normal(83).astype(np.float32))
    seen = rng.standard_normal((30, 83)).astype(np.float32)
    x = (seen[:, None, :] - model.means) / model.sigmas
    loss = huber(x, SETTINGS.outlier_c) if robust else 0.5 * x**2
    expected = np.log(np.sum(model.shares / model.sigmas * np.exp(-loss), axis=1)).sum(axis=1)
    assert np.allclose(model.log_likelihood(seen, robust=robust), expected, rtol=1e-5, atol=1e-2)


def test_the_impossible_is_finite():
    model = PixelMixture(np.zeros(40, np.float32), SETTINGS)
    found = model.log_likelihood(np.array([[0.0] * 40, [1e6] * 40], np.float32), robust=False)
    assert np.isfinite(found).all()
    assert found[0] > found[1]


def test_the_stable_component_finds_mean_and_spread():
    """Patches that vary about a picture other than the first: S learns both, F keeps the first, W is the last."""
    rng = np.random.default_rng(5)
    picture, spread = rng.standard_normal(300), 0.3
    first = (picture + rng.normal(0, spread, 300)).astype(np.float32)
    model = PixelMixture(first, MixtureSettings(60.0, 0.5, 0.5, 0.5, 0.05, 0.001, 1.3))
    for _ in range(400):
        patch = (picture + rng.normal(0, spread, 300)).astype(np.float32)
        model.learn(patch)
    assert abs(np.mean(model.means[1] - picture)) < 0.02
    assert np.sqrt(np.mean((model.means[1] - picture) ** 2)) < 0.1
    assert model.sigmas[1].mean() == pytest.approx(spread, abs=0.06)
    assert np.array_equal(model.means[2], first)
    assert np.array_equal(model.means[0], patch)
    assert np.array_equal(model.sigmas[[0, 2]], np.full((2, 300), 0.5))


def test_two_pictures_in_turn_get_a_component_each():
    """What was first comes back every third frame: F explains it then, and S what is between."""
    rng = np.random.default_rng(6)
    first, other = np.full(200, -1.0, np.float32), 1.0
    model = PixelMixture(first, MixtureSettings(60.0, 0.05, 0.5, 0.2, 0.05, 0.001, 1.3))
    for frame in range(600):
        centre = -1.0 if frame % 3 == 0 else other
        model.learn((centre + rng.normal(0, 0.15, 200)).astype(np.float32))
    assert model.means[1].mean() == pytest.approx(other, abs=0.1)
    assert model.shares[2].mean() == pytest.approx(1 / 3, abs=0.08)


def test_shares_are_shares_whatever_is_seen():
    rng = np.random.default_rng(7)
    model = PixelMixture(np.zeros(60, np.float32), SETTINGS)
    for frame in range(200):
        model.learn((rng.normal(0, 10.0 ** rng.integers(-2, 3), 60) + frame % 7).astype(np.float32))
        assert np.allclose(model.shares.sum(axis=0), 1, rtol=0, atol=1e-12)
        assert model.shares.min() >= 0.99 * SETTINGS.share_min
        assert model.sigmas.min() >= SETTINGS.sigma_min
        assert np.isfinite(model.means).all()


@pytest.mark.parametrize("half_life", [1.0, 5.0, 40.0])
def test_what_was_seen_counts_half_after_the_half_life(half_life: float):
    """A component that explains nothing any more loses half its share in that many frames."""
    numbers = MixtureSettings(half_life, 0.1, 0.1, 0.1, 0.1, 1e-9, 1.3)
    model = PixelMixture(np.zeros(3, np.float32), numbers)
    for _ in range(round(half_life)):
        model.learn(np.full(3, 8.0, np.float32))
        # W is the last patch: it takes all from the second frame on; in the first, all three are as far off.
        model.means[0] = 8.0
    lost = model.shares[2, 0] - (1 - 0.5 ** (1 / half_life)) / 3 * 0.5 ** (1 - 1 / half_life)
    assert lost == pytest.approx(0.5 / 3, rel=1e-6)


def test_likeness_is_a_correlation():
    first = np.random.default_rng(0).standard_normal(50).astype(np.float32)
    model = PixelMixture(first, SETTINGS)
    assert model.similarity(first) == pytest.approx(1)
    assert model.similarity(3 * first) == pytest.approx(1)
    assert model.similarity(-first) == 0
    assert model.similarity(np.zeros(50, np.float32)) == 0
