import math

import numpy as np
import pytest

from pftrack_sim import controllers
from pftrack_sim.controllers import RobotParameters
from pftrack_sim.controllers.registry import GROUP
from pftrack_sim.core.errors import ControllerError, ParameterError

THIS = "third_party_controllers"


def test_a_factory_by_its_path():
    controller = controllers.make(f"{THIS}:Spinner", rate=0.5)
    assert controller.act(None, None).tolist() == [0.0, 0.5, 0.0, 0.0]


@pytest.mark.parametrize(
    ("name", "says"),
    [
        (f"{THIS}:Spiner", "did you mean 'Spinner'"),
        (f"{THIS}:", "expected package.module:factory"),
        ("no_such_module:x", "ModuleNotFoundError"),
        (f"{THIS}:NUMBER", "cannot be called"),
        (f"{THIS}:broken", "RuntimeError: no motor"),
        (f"{THIS}:nothing", "must make an object with reset and act, got dict"),
    ],
)
def test_errors_of_third_party_factories_are_reported(name: str, says: str):
    with pytest.raises(ControllerError, match=says):
        controllers.make(name)


def test_parameters_of_third_party_factories_are_checked():
    with pytest.raises(ParameterError, match="did you mean 'rate'"):
        controllers.make(f"{THIS}:Spinner", rat=0.5)


def test_installed_controllers_are_listed_and_cannot_take_builtin_names(monkeypatch: pytest.MonkeyPatch):
    from importlib.metadata import EntryPoint

    points = [EntryPoint("spinner", f"{THIS}:Spinner", GROUP), EntryPoint("servo", f"{THIS}:Spinner", GROUP)]
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
    from pftrack_sim.controllers.visual_servo import ACCELERATION
    from pftrack_sim.core.proprioception import PROPRIO_NAMES
    from pftrack_sim.core.records import Estimate

    rng = np.random.default_rng(1)
    last = np.zeros(4)
    for _ in range(100):
        box = np.concatenate([rng.uniform(0, 500, 2), rng.uniform(20, 300, 2)])
        now = controller.act(Estimate(box), np.zeros(len(PROPRIO_NAMES)))
        assert (np.abs(now - last) * robot.limits * robot.rate_hz <= ACCELERATION + 1e-9).all()
        last = now
