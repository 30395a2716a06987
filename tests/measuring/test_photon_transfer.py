"""The gain of a sensor is told by images as it gives them, and by no others."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.camera.noise import Noise
from pftrack_sim.core.photometry import gain as tone_gain
from pftrack_sim.measuring.material import read_material
from pftrack_sim.measuring.measured import read_levels
from pftrack_sim.measuring.video import measure_video
from pftrack_sim.scenario.axes import NoiseAxis
from tests.measuring.test_measure import as_toml, measured, value_of


def noisy(gain: float, stops: float = 1.5, shift: int = 0, frames: int = 24) -> list[np.ndarray]:
    """Clouds under a sensor's noise and a curve of tones, moved by whole pixels from frame to frame."""
    places = np.random.default_rng(0).uniform(10.0, 245.0, (8, 20)).astype(np.float32)
    clouds = cv2.resize(places, (480, 160), interpolation=cv2.INTER_LINEAR).astype(np.uint8)
    codes = np.linspace(1e-6, 1.0 - 1e-6, 256)
    tone = np.rint(255.0 / (1.0 + (1.0 - codes) / codes / tone_gain(stops))).astype(np.uint8)  # as film's
    sensor = Noise(NoiseAxis(severity=1.0, gain=gain), 0)
    views = (np.repeat(clouds[:, shift * index :][:, :320, None], 3, axis=2) for index in range(frames))
    return [tone[sensor.read(np.ascontiguousarray(view), index)] for index, view in enumerate(views)]


@pytest.mark.parametrize(("gain", "stops", "shift"), [(2.0, 0.0, 0), (2.0, 2.5, 3), (8.0, 1.5, 0), (20.0, 0.5, 3)])
def test_the_gain_is_told_under_any_curve_of_tones(tmp_path: Path, gain: float, stops: float, shift: int):
    found = measured(tmp_path, noisy(gain, stops, shift))
    one = value_of(found, "noise")
    assert one.low < gain < one.high
    assert one.high < 3.0 * one.low
    (tmp_path / "mine.toml").write_text(as_toml(found))
    axis = scenario.load({"extends": ["corridor", str(tmp_path / "mine.toml")]}).resolve(0).axes.noise
    assert axis.physical == pytest.approx(one.value, rel=1e-3) == read_levels(tmp_path / "mine.toml")["noise"].level


def test_what_is_no_noise_of_single_pixels_tells_no_gain(tmp_path: Path):
    for name, images, said in (
        ("smoothed", [cv2.GaussianBlur(one, (0, 0), 1.0) for one in noisy(8.0)], "change alike"),
        ("none", noisy(0.01), "no law of photons"),
        ("most", noisy(120.0), "outside 0.4 to 45"),
        ("frozen", noisy(8.0)[:1] * 24, "needs flat parts"),
        ("uniform", [one.clip(100, 110) for one in noisy(8.0)], "needs flat parts"),
    ):
        found = measured(tmp_path / name, images)
        assert said in found.left_out["noise"], name
        assert "noise" not in as_toml(found).split("[")


def test_compressed_images_tell_no_gain(tmp_path: Path):
    for index, image in enumerate(noisy(8.0, frames=12), start=1):
        cv2.imwrite(str(tmp_path / f"{index:04}.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, 98])
    assert "take noise away" in measure_video(read_material(tmp_path, 25.0)).left_out["noise"]
