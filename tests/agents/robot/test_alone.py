"""The robot's own model gives the bits of the scene's while nothing but the ground is near."""

import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.agents.robot.drive import Equilibrium
from pftrack_sim.scene.build import compile_robot_alone
from pftrack_sim.scene.robot import RobotForm
from pftrack_sim.simulation.world import World

SMALL = {"duration_s": 3, "distractors.count": 2, "axes.jitter.severity": 1.0}


@pytest.mark.parametrize("rate_hz", [12, pytest.param(30, marks=pytest.mark.slow)])
def test_steps_alone_are_those_in_the_scene_to_the_bit(rate_hz: int):
    settings = scenario.load("corridor", SMALL | {"camera.rate_hz": rate_hz}).resolve(5)
    worlds = World(settings, 5), World(settings, 5)
    worlds[1].robot._vicinity.may_touch = lambda data: True
    alone, touched = [], []
    for frame in range(4 * rate_hz):
        for world in worlds:
            # Into the wall in the end.
            world.advance(np.array([1.0, 0.4 if frame > rate_hz else 0.0, 0.3, 0.1]))
        mine, theirs = (world.data for world in worlds)
        for name in ("time", "qpos", "qvel", "ctrl", "sensordata", "geom_xpos", "geom_xmat"):
            np.testing.assert_array_equal(getattr(mine, name), getattr(theirs, name), err_msg=name)
        assert worlds[0].camera_pose().tobytes() == worlds[1].camera_pose().tobytes()
        assert worlds[0].proprio().tobytes() == worlds[1].proprio().tobytes()
        assert worlds[0].collision() == worlds[1].collision()
        alone.append(worlds[0].robot._stepped_alone)
        touched.append(worlds[0].collision() is not None)
    assert any(alone)
    assert any(touched)
    assert not (np.array(alone) & np.array(touched)).any()


def test_the_equilibrium_is_simulated_once_for_each_direction_of_the_head_whatever_else_is_in_the_model():
    world = World(scenario.load("corridor", SMALL).resolve(5), 5, draws=False)
    form = RobotForm.of(world.settings.robot, world.settings.camera)
    alone, among = Equilibrium(compile_robot_alone(form, world.clock.step_s)), Equilibrium(world.model)
    ahead, aside = alone.at(np.zeros(2)), alone.at(np.array([0.3, 0.0]))
    assert (aside != ahead).any()
    assert alone.at(np.zeros(2)) is ahead
    assert alone.at(np.array([-0.0, 0.0])) is not ahead
    assert among.centre_of_mass_m == alone.centre_of_mass_m > 0.1
