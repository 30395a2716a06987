import math
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from pftrack_sim import controllers
from pftrack_sim.controllers import RobotParameters
from pftrack_sim.controllers.registry import GROUP
from pftrack_sim.core.errors import ControllerError, ParameterError


class Spinner:
    """Turns on the spot."""

    def __init__(self, rate: float = 1.0) -> None:
        self.rate = rate

    def reset(self, robot) -> None:
        pass

    def act(self, estimate, proprio) -> np.ndarray:
        return np.array([0.0, self.rate, 0.0, 0.0])


def test_a_factory_by_its_path_makes_a_controller_or_is_named():
    """What else can be wrong with a factory is tested for trackers, whose registry is of the same kind."""
    assert controllers.make(f"{__name__}:Spinner", rate=0.5).act(None, None).tolist() == [0.0, 0.5, 0.0, 0.0]
    with pytest.raises(ControllerError, match="must make an object with reset and act, got dict"):
        controllers.make("builtins:dict")
    with pytest.raises(ParameterError, match="did you mean 'rate'"):
        controllers.make(f"{__name__}:Spinner", rat=0.5)


def test_installed_controllers_are_listed_and_cannot_take_builtin_names(monkeypatch: pytest.MonkeyPatch):
    points = [EntryPoint("spinner", f"{__name__}:Spinner", GROUP), EntryPoint("servo", f"{__name__}:Spinner", GROUP)]
    monkeypatch.setattr("pftrack_sim.core.plugins.entry_points", lambda group: points if group == GROUP else [])
    assert "spinner" in controllers.names()
    assert "spinner" in controllers.describe("spinner").lower()
    assert controllers.make("spinner").act(None, None)[1] == 1.0
    assert type(controllers.make("servo")).__name__ == "TargetSearch"


@pytest.mark.parametrize(
    "wrong",
    [
        {"fovy_rad": math.pi},
        {"rate_hz": 0.0},
        {"max_speed_m_s": math.nan},
        {"image_size": (0, 480)},
        {"camera_height_m": 0.0},
    ],
)
def test_invalid_robot_parameters_are_refused(wrong: dict):
    with pytest.raises(ParameterError, match="robot parameters"):
        RobotParameters(**wrong)
