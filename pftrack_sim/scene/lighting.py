"""Light that changes during an episode: sun, sky and lamps follow the scenario's schedule.

Rendered values are display-coded. A change of the light by EV stops multiplies the luminance of the scene by 2**EV,
hence the coded values, and with them every light's colour, by 2**(EV / 2.2).
"""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import mujoco
import numpy as np

from pftrack_sim.core.photometry import gain
from pftrack_sim.scenario.axes import LightAxis
from pftrack_sim.scenario.model import LightRamp, Lights, LightStep
from pftrack_sim.scene.layout import SKY

Group: TypeAlias = Literal["all", "sun", "lamps"]

_LAMP = "light/lamp"
_SHINING = "glow-lamp"


def ev(lights: Lights, time_s: float, group: Group) -> float:
    """Stops of light of one group at one time, relative to the place's own light.

    Args:
        lights: The scenario's lights; the stops of its changes add up.
        time_s: Time since the start of the episode.
        group: `"sun"` and `"lamps"` follow changes of their own and of `"all"`; `"all"` only those of `"all"`.
    """
    changes = [change for change in lights.schedule if change.lights in ("all", group)]
    return lights.ev + sum(change.ev * _progress(change, time_s) for change in changes)


def _progress(change: LightStep | LightRamp, time_s: float) -> float:
    """Share of a change that has happened, in [0, 1]."""
    if isinstance(change, LightStep):
        return 1.0 if time_s >= change.at_s else 0.0
    return float(np.clip((time_s - change.from_s) / (change.to_s - change.from_s), 0.0, 1.0))


class Lighting:
    """Sets the lights of a model as the schedule has them.

    What the model held when this was made is the base; every call starts from it, so calls may come in any order and
    `restore` leaves the model as it was found. Lights named "light/lamp..." and materials named "glow-lamp..." are
    lamps; every other light is sun. The light from everywhere (the headlight's ambient part) and the sky's picture go
    with the sun or moon, or with the lamps where there are only lamps: it is lamplight thrown back by the walls then.

    Args:
        model: The compiled scene.
        lights: The scenario's lights.
        axis: Stress axis that comes on top; its colour is the camera's business.
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
        names = [model.light(index).name for index in range(model.nlight)]
        self._is_lamp = np.array([name.startswith(_LAMP) for name in names], dtype=bool)
        self._sky_group: Group = "lamps" if len(names) > 0 and bool(self._is_lamp.all()) else "sun"
        self._shining = np.array(
            [model.material(index).name.startswith(_SHINING) for index in range(model.nmat)], dtype=bool
        )
        self._is_sky = np.array([model.material(index).name == SKY for index in range(model.nmat)], dtype=bool)
        self._diffuse = model.light_diffuse.copy()
        self._ambient = model.light_ambient.copy()
        self._specular = model.light_specular.copy()
        self._emission = model.mat_emission.copy()
        self._sky = np.array(model.vis.headlight.ambient)

    def apply(self, time_s: float, walked_m: float = 0.0, exposure_ev: float = 0.0) -> None:
        """Set the model's lights.

        Args:
            time_s: Since the start of the episode.
            walked_m: How far the target has come along its path, for pools of lamp light.
            exposure_ev: Stops by which the camera exposes longer. They act on everything that shines, and here rather
                than on the drawn frame, so that what is too bright for one exposure has its details in another.
        """
        added = {"sun": exposure_ev, "lamps": exposure_ev}
        if self._axis is not None:
            stops = self._axis.ev(time_s, walked_m, self._flicker_rad)
            added = {key: one + stops * (self._axis.lights in ("all", key)) for key, one in added.items()}
        sun = gain(ev(self._lights, time_s, "sun") + added["sun"])
        self._set(sun, gain(ev(self._lights, time_s, "lamps") + added["lamps"]), gain(exposure_ev))

    def restore(self) -> None:
        """Give the model back the light it had."""
        self._set(1.0, 1.0, 1.0)

    def _set(self, sun: float, lamps: float, signs: float) -> None:
        model = self._model
        factor = np.where(self._is_lamp, lamps, sun)[:, None]
        model.light_diffuse[:] = self._diffuse * factor
        model.light_ambient[:] = self._ambient * factor
        model.light_specular[:] = self._specular * factor
        model.mat_emission[:] = self._emission * np.where(
            self._shining, lamps, np.where(self._is_sky, self._sky_brightness(sun, lamps), signs)
        )
        model.vis.headlight.ambient[:] = self._sky * self._sky_brightness(sun, lamps)

    def _sky_brightness(self, sun: float, lamps: float) -> float:
        return lamps if self._sky_group == "lamps" else sun
