import math
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from pftrack_sim import controllers
from pftrack_sim.controllers import RobotParameters
from pftrack_sim.controllers.registry import GROUP
from pftrack_sim.controllers.visual_servo import ACCELERATION
from pftrack_sim.core.errors import ControllerError, ParameterError
from pftrack_sim.core.proprioception import PROPRIO_NAMES
from pftrack_sim.core.records import Estimate


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


def test_commands_are_rate_limited():
    controller = controllers.make("servo")
    robot = RobotParameters(rate_hz=20.0, max_speed_m_s=2.0)
    controller.reset(robot)
    rng = np.random.default_rng(1)
    last = np.zeros(4)
    for _ in range(100):
        box = np.concatenate([rng.uniform(0, 500, 2), rng.uniform(20, 300, 2)])
        now = controller.act(Estimate(box), np.zeros(len(PROPRIO_NAMES)))
        assert (np.abs(now - last) * robot.limits * robot.rate_hz <= ACCELERATION + 1e-9).all()
        last = now
