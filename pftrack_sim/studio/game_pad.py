"""A game pad that drives the robot, read by pygame (extra `human`) in the server's process."""

from __future__ import annotations

import importlib
import os
from functools import cached_property
from typing import Any
from unittest import mock

import numpy as np

from pftrack_sim.core.types import FloatArray

_DEAD = 0.15  # Deflection up to which a stick is at rest
# Horizontal and vertical axes of the sticks, as SDL counts them; with triggers, these are axes 2 and 5.
_LEFT, _RIGHT, _RIGHT_BESIDE_TRIGGERS = (0, 1), (2, 3), (3, 4)


class GamePad:
    """The first game pad on this machine: the left stick moves the base, the right one pans and tilts the camera.

    One thread reads it. Where pygame is missing, there is none.
    """

    def __init__(self) -> None:
        self._stick: Any = None
        self._last = np.zeros(4)

    def read(self) -> FloatArray | None:
        """`(4,)` command in [-1, 1]: forward, turn, pan, tilt; None where it is what it was."""
        if not self._connected():
            return None
        count = self._stick.get_numaxes()
        right = _RIGHT_BESIDE_TRIGGERS if count > max(_RIGHT_BESIDE_TRIGGERS) else _RIGHT
        axes = [self._stick.get_axis(axis) if axis < count else 0.0 for axis in (*_LEFT, *right)]
        across, along, pan, tilt = (0.0 if abs(value) < _DEAD else float(np.clip(value, -1.0, 1.0)) for value in axes)
        command = -np.array([along, across, pan, tilt])  # sticks count right and down
        if np.array_equal(command, self._last):
            return None
        self._last = command
        return command.copy()

    def _connected(self) -> bool:
        pygame = self._pygame
        if pygame is None:
            return False
        pygame.event.pump()
        if pygame.joystick.get_count() == 0:
            self._stick = None
        elif self._stick is None:
            self._stick = pygame.joystick.Joystick(0)
        return self._stick is not None

    @cached_property
    def _pygame(self) -> Any:
        """The module, which reads pads from now on; None where it is missing."""
        try:
            pygame: Any = importlib.import_module("pygame")
        except ImportError:
            return None
        # SDL reads pads with the events of a display, and without a window in front only where it is told to.
        with mock.patch.dict(os.environ, {"SDL_VIDEODRIVER": "dummy", "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1"}):
            if not pygame.display.get_init():
                pygame.display.init()
            pygame.joystick.init()
        return pygame
