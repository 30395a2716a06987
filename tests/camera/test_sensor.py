import cv2
import numpy as np
import pytest

from pftrack_sim.camera.sensor import Sensor, sampled_sigma
from pftrack_sim.scenario import model
from pftrack_sim.scenario.axes import Axes

SIGMAS = [0.3, 0.5, 0.8, 1.5, 3.0, 5.0]


def expose(image: np.ndarray, sigma_px: float) -> np.ndarray:
    return Sensor(model.Sensor(psf_sigma_px=sigma_px, level=0.0), Axes(), 0).expose(image, 0.0)


@pytest.mark.parametrize("sigma_px", SIGMAS)
@pytest.mark.parametrize("axis", [0, 1])
def test_an_edge_is_blurred_by_the_given_sigma(sigma_px: float, axis: int):
    image = np.zeros((121, 121, 3), dtype=np.uint8)
    image[(slice(60, None), slice(None))[:: 1 if axis == 0 else -1]] = 255
    profile = expose(image, sigma_px).astype(np.float64).mean(axis=(1 - axis, 2))
    line = np.diff(profile) / 255.0  # the derivative of an edge is the line-spread function
    places = np.arange(len(line)) - 59.0
    assert line.sum() == pytest.approx(1.0)
    assert places @ line == pytest.approx(0.0, abs=0.02)
    assert np.sqrt(places**2 @ line) == pytest.approx(sigma_px, rel=0.04)


def test_a_point_is_blurred_isotropically_with_constant_sum():
    image = np.zeros((41, 41, 3), dtype=np.uint8)
    image[19:22, 19:22] = 255
    spread = expose(image, 1.2).astype(np.float64)[..., 0]
    assert spread.sum() == pytest.approx(9 * 255, rel=0.03)
    assert abs(spread - spread.T).max() <= 1
    assert abs(spread - spread[::-1, ::-1]).max() <= 1


def test_a_lens_without_blur_changes_nothing():
    image = np.random.default_rng(0).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    assert expose(image, 0.0) is image


@pytest.mark.parametrize("sigma_px", [0.05, 0.5, 5.0])
def test_blur_keeps_shape_and_type_and_the_argument(sigma_px: float):
    image = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)
    before = image.copy()
    out = expose(image, sigma_px)
    assert (out.shape, out.dtype) == (image.shape, np.uint8)
    assert (image == before).all()
    assert out.flags.writeable
    assert not np.shares_memory(out, image)
    assert (expose(image, sigma_px) == out).all()


@pytest.mark.parametrize("sigma_px", [0.1, 0.3, 0.4, 0.5])
@pytest.mark.parametrize("size", [(1, 1), (1, 9), (24, 33)])
def test_a_narrow_blur_gives_no_weight_to_pixels_two_columns_away(size: tuple[int, int], sigma_px: float):
    rng = np.random.default_rng(sum(size))
    sigma = sampled_sigma(sigma_px, 2)
    for image in (rng.integers(0, 256, (*size, 3), dtype=np.uint8), 255 * rng.integers(0, 2, (*size, 3), np.uint8)):
        wide = cv2.GaussianBlur(image, (5, 5), sigma, borderType=cv2.BORDER_REPLICATE)
        assert np.array_equal(expose(image, sigma_px), wide)


def test_a_uniform_image_stays_uniform():
    image = np.full((30, 40, 3), (10, 128, 255), dtype=np.uint8)
    assert (expose(image, 2.0) == image).all()


@pytest.mark.parametrize("stream", [0.0, 1.0])
def test_a_grey_camera_has_the_luma_in_all_channels(stream: float):
    image = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)
    axes = Axes.model_validate({"stream": {"severity": stream}})
    coloured, grey = (
        Sensor(model.Sensor(psf_sigma_px=0.0, level=0.0), Axes() if not grey else axes, 0, grey=grey).read(image, 0)
        for grey in (False, True)
    )
    assert coloured is image
    assert (grey == grey[..., :1]).all()
    luma = image @ np.array([0.299, 0.587, 0.114])
    assert np.abs(grey[..., 0] - luma).max() <= (1.0 if stream == 0.0 else 60.0)
