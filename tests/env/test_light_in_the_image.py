"""The light axis, measured in rendered frames."""

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.camera.sensor import Sensor
from pftrack_sim.core.photometry import DISPLAY_GAMMA, LUMINANCE
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.scenario import model
from pftrack_sim.scenario.axes import Axes, LightAxis
from pftrack_sim.scene.build import build_stage
from pftrack_sim.scene.lighting import Lighting

WIDTH, HEIGHT, RATE_HZ = 64, 48, 30.0
K = intrinsics(WIDTH, HEIGHT, np.deg2rad(50.0))
FACING = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 2.0], [0, 0, 0, 1]], dtype=np.float64)
"""Camera 2 m above the card, looking down."""


class Card:
    """A grey card below the camera and a grey sky above it."""

    def __init__(self) -> None:
        spec = mujoco.MjSpec()
        spec.stat.extent = 1.0
        spec.visual.headlight.ambient = [0.2, 0.2, 0.2]
        spec.visual.headlight.diffuse = spec.visual.headlight.specular = [0.0, 0.0, 0.0]
        light = spec.worldbody.add_light(name="light/sun", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
        light.dir, light.diffuse, light.castshadow = [0.0, 0.0, -1.0], [0.5, 0.5, 0.5], False
        light.ambient = light.specular = [0.0, 0.0, 0.0]
        sky = spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=8, height=48, nchannel=3)
        sky.data = np.full(8 * 48 * 3, 170, dtype=np.uint8).tobytes()
        spec.add_material(name="sky").emission = 1.0
        spec.add_material(name="card", rgba=[0.8, 0.8, 0.8, 1.0], specular=0.0)
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=[5.0, 5.0, 0.01], material="card", contype=0, conaffinity=0
        )
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.neutral = Lighting(self.model, model.Lights())
        self.renderer = Rasteriser(self.model, WIDTH, HEIGHT)

    def draw(self, pose: np.ndarray = FACING) -> np.ndarray:
        return self.renderer.color(self.data, pose, K)

    def shoot(self, axis: LightAxis, frames: int) -> np.ndarray:
        """`(frames, 3)` mean linear red, green and blue, as the simulation exposes them."""
        lighting = Lighting(self.model, model.Lights(), axis, np.random.default_rng(0))
        sensor = Sensor(model.Sensor(psf_sigma_px=0.0, level=0.0), Axes(light=axis), 0)
        means = []
        for index in range(frames):
            lighting.apply(index / RATE_HZ, 0.0, sensor.settle(index / RATE_HZ))
            means.append(linear(sensor.expose(self.draw(), index / RATE_HZ)))
        self.neutral.apply(0.0)
        return np.array(means)

    def stops(self, axis: LightAxis, frames: int) -> np.ndarray:
        """`(frames,)` luminance relative to the first frame."""
        luminance = self.shoot(axis, frames) @ LUMINANCE
        return np.log2(luminance / luminance[0])


def linear(image: np.ndarray) -> np.ndarray:
    return ((image / 255.0) ** DISPLAY_GAMMA).mean(axis=(0, 1))


@pytest.fixture(scope="module")
def card() -> Iterator[Card]:
    made = Card()
    yield made
    made.renderer.close()


@pytest.mark.parametrize("what", ["card", "sky"])
def test_luminance_follows_stops(card: Card, what: str):
    pose = FACING if what == "card" else FACING @ np.diag([1.0, -1.0, -1.0, 1.0])
    base = linear(card.draw(pose)) @ LUMINANCE
    before = card.model.tex_data.copy()
    for stops in (-4.0, -2.5, -1.0, -0.3, 0.4, 0.0):
        lighting = Lighting(card.model, model.Lights(ev=stops))
        lighting.apply(0.0)
        measured = np.log2(linear(card.draw(pose)) @ LUMINANCE / base)
        card.neutral.apply(0.0)
        assert measured == pytest.approx(stops, abs=0.05)
    assert linear(card.draw(pose)) @ LUMINANCE == base
    np.testing.assert_array_equal(card.model.tex_data, before)


@pytest.mark.parametrize("severity", [0.5, 1.0, 2.0])
def test_a_step_has_the_given_depth_and_times(card: Card, severity: float):
    axis = LightAxis(
        auto_exposure=False, severity=severity, parts=("change",), dim_ev=1.2, at_s=0.5, hold_s=1.0, every_s=2.0
    )
    stops = card.stops(axis, 90)
    time_s = np.arange(90) / RATE_HZ
    dimmed = ((time_s >= 0.5 - 1e-6) & (time_s < 1.5 - 1e-6)) | (time_s >= 2.5 - 1e-6)
    assert abs(stops[~dimmed]).max() == 0.0
    assert abs(stops[dimmed] + severity * 1.2).max() < 0.05


def test_a_ramp_has_the_given_rate(card: Card):
    ramp = {"dim_ev": 2.0, "rate_ev_s": 2.0, "at_s": 0.2, "hold_s": 0.5, "every_s": 4.0}
    stops = card.stops(LightAxis(auto_exposure=False, parts=("change",), severity=1.0, **ramp), 45)
    expected = -np.clip(2.0 * (np.arange(45) / RATE_HZ - 0.2), 0.0, 2.0)
    assert abs(stops - expected).max() < 0.05


@pytest.mark.parametrize(("hertz", "depth"), [(2.0, 0.3), (6.5, 0.1), (11.0, 0.2)])
def test_flicker_has_the_given_frequency_and_depth(card: Card, hertz: float, depth: float):
    axis = LightAxis(auto_exposure=False, severity=1.0, parts=("flicker",), flicker_hz=hertz, flicker_depth=depth)
    luminance = card.shoot(axis, 120) @ LUMINANCE
    power = np.abs(np.fft.rfft(luminance - luminance.mean())) ** 2
    assert np.fft.rfftfreq(120, 1 / RATE_HZ)[power.argmax()] == pytest.approx(hertz)
    modulation = np.sqrt(2.0 * power.sum() * 2.0) / 120 / luminance.mean()
    assert modulation == pytest.approx(depth, rel=0.05)


@pytest.mark.parametrize("lag_s", [0.3, 0.8])
def test_auto_exposure_restores_the_luminance_with_the_given_lag(card: Card, lag_s: float):
    axis = LightAxis(
        severity=1.0, parts=("change",), dim_ev=2.0, at_s=0.5, hold_s=6.0, every_s=9.0, auto_exposure=True,
        exposure_lag_s=lag_s,
    )  # fmt: skip
    stops = card.stops(axis, 150)
    since_s = np.arange(150) / RATE_HZ - 0.5
    assert abs(stops[since_s < -1e-6]).max() < 0.05
    after = since_s > -1e-6
    assert abs(stops[after] + 2.0 * np.exp(-since_s[after] / lag_s)).max() < 0.07
    assert abs(stops[-10:]).max() < 0.05


def test_auto_exposure_is_limited_to_its_range(card: Card):
    axis = LightAxis(
        severity=1.0, parts=("change",), dim_ev=3.0, at_s=0.2, hold_s=6.0, every_s=9.0, auto_exposure=True,
        exposure_lag_s=0.0, exposure_range_ev=1.0,
    )  # fmt: skip
    assert card.stops(axis, 12)[-1] == pytest.approx(-2.0, abs=0.05)


@pytest.mark.parametrize("kelvin", [2900.0, 4200.0, 12000.0])
def test_light_is_tinted_and_white_balance_restores_it_with_the_given_lag(card: Card, kelvin: float):
    course = {
        "severity": 1.0,
        "parts": ("colour",),
        "temperature_k": kelvin,
        "at_s": 0.5,
        "hold_s": 6.0,
        "every_s": 9.0,
    }
    tinted = card.shoot(LightAxis.model_validate(course), 30)
    warm = tinted[-1] / tinted[0]
    assert (np.diff(warm) < 0.0).all() if kelvin < 6504.0 else (np.diff(warm) > 0.0).all()
    assert np.log2(LUMINANCE @ warm) == pytest.approx(0.0, abs=0.05)

    lag_s = 0.6
    on = LightAxis.model_validate({**course, "auto_white_balance": True, "white_balance_lag_s": lag_s})
    balanced = card.shoot(on, 150)
    excess = np.log2(balanced[:, 0] / balanced[:, 2])
    since_s = np.arange(150) / RATE_HZ - 0.5
    after = since_s > -1e-6
    expected = np.log2(warm[0] / warm[2]) * np.exp(-since_s[after] / lag_s)
    assert abs(excess[after] - expected).max() < 0.15
    assert abs(excess[-10:]).max() < 0.05


def test_patches_of_shade_are_added_to_those_of_the_place():
    def meshes(**keys: object) -> int:
        given = {f"axes.light.{key}": value for key, value in keys.items()}
        return len(build_stage(scenario.load("easy/plaza-walk", given).resolve(0), 0, 0.01)[0].meshes)

    assert meshes(severity=1.0, parts=["change"]) == meshes(severity=0.0) == meshes(severity=1.0, patch_share=0.0)
    assert meshes(severity=1.0) > meshes(severity=0.0)
    assert LightAxis(severity=4.0).shade == pytest.approx(0.8)


def test_a_dark_frame_shows_the_noise_of_the_sensor():
    bright, dark = np.full((48, 64, 3), 200, np.uint8), np.full((48, 64, 3), 16, np.uint8)
    noisy, plain = (
        Sensor(model.Sensor(psf_sigma_px=0.0, level=0.0), Axes(light=LightAxis(severity=1.0, parts=parts)), 0)
        for parts in (("noise",), ("change",))
    )
    assert (plain.read(dark, 3) == dark).all()
    spreads = [noisy.read(image, 3).std() / image.mean() for image in (bright, dark)]
    assert spreads[0] < 0.02
    assert spreads[1] > 0.1
    assert (noisy.read(dark, 3) == noisy.read(dark, 3)).all()
    assert not LightAxis(severity=0.0).noisy
