"""Exposure of the first frame, curve of tones, vignette and bloom."""

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.camera.sensor import Sensor
from pftrack_sim.core.photometry import DISPLAY_GAMMA
from pftrack_sim.scenario import model
from pftrack_sim.scenario.axes import Axes
from pftrack_sim.simulation.simulation import Simulation

PLAIN = {"psf_sigma_px": 0.0, "vignette": 0.0, "bloom": 0.0, "white_balance_ev": 0.0}


def developed(first: np.ndarray, *later: np.ndarray, **keys: float) -> list[np.ndarray]:
    """What a sensor that sees images one after the other delivers."""
    sensor = Sensor(model.Sensor.model_validate(PLAIN | keys), Axes(), 0)
    return [sensor.read(sensor.expose(image, index / 30.0), index) for index, image in enumerate((first, *later))]


def picture(level: float) -> np.ndarray:
    noise = np.random.default_rng(1).normal(level, 0.3 * level, (120, 160, 1))
    return np.repeat(np.clip(noise, 0, 255).astype(np.uint8), 3, axis=2)


@pytest.mark.parametrize("drawn", [60.0, 80.0, 110.0])
def test_a_dim_first_frame_gets_the_level_aimed_at(drawn: float):
    (image,) = developed(picture(drawn), level=115.0)
    assert image.mean() == pytest.approx(115.0, abs=2.0)


def test_a_night_stays_dark_and_a_bright_day_bright():
    night, day = (developed(picture(level))[0] for level in (18.0, 150.0))
    assert 30.0 < night.mean() < 70.0
    assert 140.0 < day.mean() < 165.0


def test_the_exposure_is_held():
    first, darker = developed(picture(100.0), picture(50.0))
    assert darker.mean() < 0.6 * first.mean()


@pytest.mark.parametrize("drawn", [40.0, 120.0])
def test_order_is_kept_and_only_white_becomes_white(drawn: float):
    ramp = np.repeat(np.arange(256, dtype=np.uint8).reshape(4, 64, 1), 3, axis=2)
    toned = developed(picture(drawn), ramp)[1][..., 0].ravel().astype(int)
    assert (np.diff(toned) >= 0).all()
    assert toned[0] == 0
    assert toned[255] == 255
    assert (toned[:250] < 255).all()


def test_the_corners_lose_the_share_of_the_vignette():
    card = np.full((48, 64, 3), 120, np.uint8)
    (image,) = developed(card, vignette=0.2)
    assert image[0, 0, 0] / image[24, 32, 0] == pytest.approx(0.8, abs=0.02)


def test_lamps_bloom_and_grey_does_not():
    night = picture(20.0)
    night[50:70, 70:90] = 255
    plain, bloomed = developed(night)[0], developed(night, bloom=1.0)[0]
    gained = bloomed.astype(int) - plain
    assert gained[46, 80].min() > 10
    assert (gained[:10, :20] == 0).all()
    assert (developed(picture(60.0))[0] == developed(picture(60.0), bloom=1.0)[0]).all()


def test_the_white_balance_drifts_from_that_of_the_first_frame():
    card = np.full((48, 64, 3), 120, np.uint8)
    still, drifting = (
        np.array(developed(*[card] * 900, white_balance_ev=ev))[:, 24, 32].astype(float) for ev in (0, 0.2)
    )
    assert (still == still[0]).all()
    assert (drifting[0] == still[0]).all()
    assert (drifting[:, 1] == still[:, 1]).all()
    red, blue = (np.log2(drifting[:, channel] / (255 - drifting[:, channel])) for channel in (0, 2))
    assert DISPLAY_GAMMA * red.std() == pytest.approx(0.2, rel=0.35)
    assert abs(np.corrcoef(red, blue)[0, 1]) < 0.9
    assert abs(np.diff(drifting[:, ::2], axis=0)).max() <= 2.0, "slowly"


def test_level_0_is_the_picture_as_drawn():
    image = picture(60.0)
    assert (developed(image, level=0.0, vignette=0.3, bloom=1.0)[0] == image).all()


@pytest.mark.parametrize("lost", [0.0, 0.6])
def test_a_resumed_episode_has_the_exposure_of_its_first_frame(lost: float):
    keys = {"axes.stream.severity": lost, "camera.width_px": 80, "camera.height_px": 60}
    with Simulation(scenario.load("corridor", keys)) as simulation:
        simulation.reset(2)
        while (frame := simulation.advance()).index < 6:
            pass
        again = simulation.resume(2, [None] * simulation.periods)
        assert (again.image == frame.image).all()
