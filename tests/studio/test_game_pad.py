"""A game pad as pygame would report it."""

import importlib
import sys

import numpy as np
import pytest

from pftrack_sim.studio.game_pad import GamePad


class Stick:
    """A pad with two sticks and two triggers."""

    def __init__(self, axes: list[float]) -> None:
        self.axes = axes

    def get_numaxes(self) -> int:
        return len(self.axes)

    def get_axis(self, axis: int) -> float:
        return self.axes[axis]


@pytest.mark.parametrize("triggers", [True, False])
def test_sticks_give_the_command_once_per_change(triggers: bool, monkeypatch: pytest.MonkeyPatch):
    pygame = pytest.importorskip("pygame")
    stick = Stick([0.0] * (6 if triggers else 4))
    connected: list[Stick] = []
    monkeypatch.setattr(pygame.joystick, "get_count", lambda: len(connected))
    monkeypatch.setattr(pygame.joystick, "Joystick", lambda number: connected[number])
    pad = GamePad()
    assert pad.read() is None, "there is none"
    connected.append(stick)
    assert pad.read() is None, "at rest"
    stick.axes[0], stick.axes[1] = 0.5, -1.0
    stick.axes[3 if triggers else 2] = -0.25
    stick.axes[4 if triggers else 3] = 0.1
    np.testing.assert_array_equal(pad.read(), [1.0, -0.5, 0.25, 0.0])
    assert pad.read() is None
    stick.axes[:] = [0.0] * len(stick.axes)
    np.testing.assert_array_equal(pad.read(), np.zeros(4))
    connected.clear()
    assert pad.read() is None
    pygame.display.quit()


def test_without_pygame_there_is_no_pad(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ImportError):
        importlib.import_module("pygame")
    assert GamePad().read() is None
