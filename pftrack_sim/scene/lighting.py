"""Time-varying light: sun, sky and lamps follow the scenario's schedule.

Rendered values are display-coded. A change of the light by EV stops multiplies the luminance of the scene by 2**EV,
hence the coded values, and with them the colour of every light, by 2**(EV / 2.2).
"""

from __future__ import annotations

import math
from typing import Literal

import mujoco
import numpy as np

from pftrack_sim.core.photometry import gain
from pftrack_sim.scenario.axes import LightAxis
from pftrack_sim.scenario.model import LightRamp, Lights, LightStep
from pftrack_sim.scene.layout import SKY

_LAMP_LIGHT = "light/lamp"
_LAMP_MATERIAL = "glow-lamp"


def ev(lights: Lights, time_s: float, group: Literal["all", "sun", "lamps"]) -> float:
    """Stops of light of a group at a time, relative to the place's own light.

    `"sun"` and `"lamps"` follow the changes of their group and of `"all"`, `"all"` only the latter; changes add up.
    """
    changes = [change for change in lights.schedule if change.lights in ("all", group)]
    return lights.ev + sum(change.ev * _progress(change, time_s) for change in changes)


def _progress(change: LightStep | LightRamp, time_s: float) -> float:
    """Share of a change that has happened, in [0, 1]."""
    if isinstance(change, LightStep):
        return 1.0 if time_s >= change.at_s else 0.0
    return min(max((time_s - change.from_s) / (change.to_s - change.from_s), 0.0), 1.0)


class Lighting:
    """Sets the lights of a compiled model.

    Lights named "light/lamp..." and materials named "glow-lamp..." are lamps; every other light is sun. Ambient light
    (the headlight's) and the sky's texture belong to the sun or moon; where there are only lamps, they belong to the
    lamps, as their light is reflected by the walls. Every call starts from the model's original light.

    Args:
        axis: Stress axis on top; its colour is applied by the camera.
        rng: Draws the phase of the flicker.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        lights: Lights,
        axis: LightAxis | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        self._axis = axis if axis is not None and axis.on else None
        self._flicker_rad = 2.0 * math.pi * rng.random() if rng is not None else 0.0
        self._model = model
        self._lights = lights
        materials = [model.material(index).name for index in range(model.nmat)]
        self._is_lamp = np.array([model.light(i).name.startswith(_LAMP_LIGHT) for i in range(model.nlight)], dtype=bool)
        self._only_lamps = model.nlight > 0 and bool(self._is_lamp.all())
        self._is_lamp_material = np.array([name.startswith(_LAMP_MATERIAL) for name in materials], dtype=bool)
        self._is_sky = np.array([name == SKY for name in materials], dtype=bool)
        self._diffuse = model.light_diffuse.copy()
        self._ambient = model.light_ambient.copy()
        self._specular = model.light_specular.copy()
        self._emission = model.mat_emission.copy()
        self._headlight = np.array(model.vis.headlight.ambient)

    def apply(self, time_s: float, target_s_m: float = 0.0, exposure_ev: float = 0.0) -> None:
        """Set the model's lights.

        Args:
            time_s: Since the start of the episode.
            target_s_m: Arc length of the target along its path, for pools of lamp light.
            exposure_ev: Stops by which the camera exposes longer. They are applied to everything that emits light, and
                not to the rendered frame, so that details that are saturated at one exposure are visible at another.
        """
        sun = lamps = exposure_ev
        if self._axis is not None:
            stops = self._axis.ev(time_s, target_s_m, self._flicker_rad)
            sun += stops * (self._axis.lights in ("all", "sun"))
            lamps += stops * (self._axis.lights in ("all", "lamps"))
        sun_gain = gain(ev(self._lights, time_s, "sun") + sun)
        lamp_gain = gain(ev(self._lights, time_s, "lamps") + lamps)
        sky_gain = lamp_gain if self._only_lamps else sun_gain
        model = self._model
        light_gains = np.where(self._is_lamp, lamp_gain, sun_gain)[:, None]
        model.light_diffuse[:] = self._diffuse * light_gains
        model.light_ambient[:] = self._ambient * light_gains
        model.light_specular[:] = self._specular * light_gains
        material_gains = np.where(self._is_sky, sky_gain, gain(exposure_ev))
        model.mat_emission[:] = self._emission * np.where(self._is_lamp_material, lamp_gain, material_gains)
        model.vis.headlight.ambient[:] = self._headlight * sky_gain
