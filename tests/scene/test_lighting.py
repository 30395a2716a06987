from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pftrack_sim.core.photometry import DISPLAY_GAMMA, gain
from pftrack_sim.scenario.model import Lights
from pftrack_sim.scene.lighting import Lighting, ev
from pftrack_sim.scene.scene_spec import SceneSpec

SCHEDULE = Lights.model_validate(
    {
        "ev": 0.5,
        "schedule": [
            {"kind": "step", "at_s": 2.0, "ev": -1.0, "lights": "lamps"},
            {"kind": "ramp", "from_s": 4.0, "to_s": 8.0, "ev": 2.0, "lights": "sun"},
            {"kind": "step", "at_s": 10.0, "ev": -0.25, "lights": "all"},
        ],
    }
)


def small_model(*lights: str) -> mujoco.MjModel:
    spec = SceneSpec()
    spec.visual.headlight.ambient = [0.2, 0.3, 0.4]
    for name in lights:
        light = spec.worldbody.add_light(name=f"light/{name}")
        light.diffuse = [0.5, 0.4, 0.3]
        light.ambient = [0.1, 0.1, 0.1]
        light.specular = [0.05, 0.05, 0.05]
    for name, emission in (("glow-lamp", 0.8), ("glow", 0.6), ("paint", 0.0)):
        spec.add_material(name=name).emission = emission
    return spec.compile()


def state(model: mujoco.MjModel) -> np.ndarray:
    fields = (model.light_diffuse, model.light_ambient, model.light_specular, model.mat_emission)
    return np.concatenate([np.ravel(field) for field in fields] + [np.array(model.vis.headlight.ambient)])


@pytest.mark.parametrize(
    ("time_s", "sun", "lamps", "both"),
    [
        (0.0, 0.5, 0.5, 0.5),
        (1.999, 0.5, 0.5, 0.5),
        (2.0, 0.5, -0.5, 0.5),
        (4.0, 0.5, -0.5, 0.5),
        (5.0, 1.0, -0.5, 0.5),
        (8.0, 2.5, -0.5, 0.5),
        (9.9, 2.5, -0.5, 0.5),
        (10.0, 2.25, -0.75, 0.25),
        (1e6, 2.25, -0.75, 0.25),
    ],
)
def test_steps_and_ramps_add_up_by_group(time_s: float, sun: float, lamps: float, both: float) -> None:
    assert abs(ev(SCHEDULE, time_s, "sun") - sun) < 1e-12
    assert abs(ev(SCHEDULE, time_s, "lamps") - lamps) < 1e-12
    assert abs(ev(SCHEDULE, time_s, "all") - both) < 1e-12


@given(st.floats(0.0, 30.0), st.floats(0.0, 30.0))
def test_a_rising_ramp_never_falls(first: float, second: float) -> None:
    lights = Lights.model_validate({"schedule": [{"kind": "ramp", "from_s": 3.0, "to_s": 9.0, "ev": 1.5}]})
    early, late = sorted((first, second))
    assert 0.0 <= ev(lights, early, "sun") <= ev(lights, late, "sun") <= 1.5


@given(st.floats(-6.0, 5.0), st.floats(-6.0, 5.0))
def test_gain_is_linear_light_through_the_display_gamma(first: float, second: float) -> None:
    assert abs(gain(first) ** DISPLAY_GAMMA / 2.0**first - 1.0) < 1e-9
    assert abs(gain(first) * gain(second) / gain(first + second) - 1.0) < 1e-9


def test_sun_and_sky_change_together_and_lamps_independently() -> None:
    model = small_model("sun", "lamp-1")
    base = state(model)
    Lighting(model, SCHEDULE).apply(8.0)
    sun, lamps = gain(2.5), gain(-0.5)
    np.testing.assert_allclose(model.light_diffuse, np.outer([sun, lamps], [0.5, 0.4, 0.3]), rtol=0, atol=1e-6)
    np.testing.assert_allclose(model.light_ambient, np.outer([sun, lamps], [0.1] * 3), rtol=0, atol=1e-6)
    np.testing.assert_allclose(model.vis.headlight.ambient, sun * np.array([0.2, 0.3, 0.4]), rtol=0, atol=1e-6)
    np.testing.assert_allclose(model.mat_emission, [0.8 * lamps, 0.6, 0.0], rtol=0, atol=1e-6)
    assert np.abs(state(model) - base).max() > 0.1


def test_ambient_light_follows_the_lamps_where_there_is_no_sun() -> None:
    model = small_model("lamp-1", "lamp-above")
    Lighting(model, SCHEDULE).apply(3.0)
    np.testing.assert_allclose(model.vis.headlight.ambient, gain(-0.5) * np.array([0.2, 0.3, 0.4]), rtol=0, atol=1e-6)


@pytest.mark.parametrize("names", [("sun", "lamp-1"), ("lamp-1",), ("moon",)])
def test_applying_is_idempotent_in_any_order(names: tuple[str, ...]) -> None:
    model = small_model(*names)
    lighting = Lighting(model, SCHEDULE)
    lighting.apply(5.5)
    once = state(model)
    for time_s in (12.0, 0.0, 7.3, 5.5, 5.5):
        lighting.apply(time_s)
    np.testing.assert_array_equal(state(model), once)


def test_no_schedule_changes_nothing() -> None:
    model = small_model("sun", "lamp-1")
    before = state(model)
    Lighting(model, Lights()).apply(4.0)
    np.testing.assert_array_equal(state(model), before)
