"""Light that changes during an episode: sun, sky and lamps follow the scenario's schedule.

Rendered values are display-coded. A change of the light by EV stops multiplies the luminance of the scene by 2**EV,
hence the coded values, and with them every light's colour, by 2**(EV / 2.2).
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import mujoco
import numpy as np

from pftrack_sim.photometry import gain
from pftrack_sim.scenario.model import LightRamp, Lights, LightStep

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
    lamps; every other light is sun. The light from everywhere (the headlight's ambient part) is sky where there is a
    sun or moon, and lamplight thrown back by the walls where there is none.

    Args:
        model: The compiled scene.
        lights: The scenario's lights.
    """

    def __init__(self, model: mujoco.MjModel, lights: Lights) -> None:
        self._model = model
        self._lights = lights
        names = [model.light(index).name for index in range(model.nlight)]
        self._is_lamp = np.array([name.startswith(_LAMP) for name in names], dtype=bool)
        self._sky_group: Group = "lamps" if len(names) > 0 and bool(self._is_lamp.all()) else "sun"
        self._shining = np.array(
            [model.material(index).name.startswith(_SHINING) for index in range(model.nmat)], dtype=bool
        )
        self._diffuse = model.light_diffuse.copy()
        self._ambient = model.light_ambient.copy()
        self._specular = model.light_specular.copy()
        self._emission = model.mat_emission.copy()
        self._sky = np.array(model.vis.headlight.ambient)

    def apply(self, time_s: float) -> None:
        """Set the model's lights for this time since the start of the episode."""
        self._set(gain(ev(self._lights, time_s, "sun")), gain(ev(self._lights, time_s, "lamps")))

    def restore(self) -> None:
        """Give the model back the light it had."""
        self._set(1.0, 1.0)

    def _set(self, sun: float, lamps: float) -> None:
        model = self._model
        factor = np.where(self._is_lamp, lamps, sun)[:, None]
        model.light_diffuse[:] = self._diffuse * factor
        model.light_ambient[:] = self._ambient * factor
        model.light_specular[:] = self._specular * factor
        model.mat_emission[:] = self._emission * np.where(self._shining, lamps, 1.0)
        model.vis.headlight.ambient[:] = self._sky * (lamps if self._sky_group == "lamps" else sun)
