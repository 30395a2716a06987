"""The depth image of an observation."""

import gymnasium as gym
import numpy as np
import pytest

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim import scenario
from pftrack_sim.camera.distortion import Lens
from pftrack_sim.simulation.simulation import Simulation

SIZE = {"camera.width_px": 96, "camera.height_px": 72}
FISHEYE = {"fx": 46.0, "fy": 46.0, "cx": 48.0, "cy": 35.0, "distortion": [0.01, -0.005, 0.001, 0.0]}
LENSES = {
    "pinhole": {},
    "barrel": {"axes.distortion.severity": 2.0},
    "fisheye": {"camera.calibrated": {**FISHEYE, "width_px": 96, "height_px": 72}},
    "wide fisheye": {"camera.calibrated": {**FISHEYE, "fx": 30.0, "fy": 30.0, "width_px": 96, "height_px": 72}},
}


@pytest.mark.parametrize("image", [True, False])
def test_it_is_there_on_request_and_changes_nothing_else(image: bool):
    make = {"scenario": "warehouse", "overrides": SIZE, "image": image}
    plain, deep = gym.make("pftrack_sim/Follow-v0", **make), gym.make("pftrack_sim/Follow-v0", **make, depth=True)
    for step in range(3):
        answers = [env.step(np.zeros(4)) if step else env.reset(seed=1) for env in (plain, deep)]
        depth = answers[1][0].pop("depth")
        assert answers[0][0].keys() == answers[1][0].keys()
        assert all(np.array_equal(answers[0][0][key], answers[1][0][key]) for key in answers[0][0])
        assert answers[0][-1]["truth"] == answers[1][-1]["truth"]
        assert deep.observation_space["depth"].contains(depth)
        assert depth.shape == (72, 96)
    plain.close()
    deep.close()


@pytest.mark.parametrize("lens", LENSES)
def test_each_pixel_is_as_far_as_what_its_ray_meets(lens: str):
    """The floor, by the plane z = 0, where nothing else is; and the target, by an independent pinhole."""
    with Simulation(scenario.load("corridor", SIZE | LENSES[lens]), image=False) as simulation:
        simulation.reset(2)
        truth, depth = simulation.advance().truth, simulation.depth()
        bend = Lens(truth.K, truth.distortion.tolist(), (96, 72))
        rows, columns = np.mgrid[:72, :96] + 0.5
        rays = bend.rays(np.dstack([columns, rows]))
        world = rays @ truth.T_world_camera[:3, :3].T
        with np.errstate(divide="ignore"):
            ground = np.where(world[..., 2] < 0.0, -truth.T_world_camera[2, 3] / world[..., 2], np.inf)
        assert (depth < ground + 0.02).all()
        assert (np.abs(depth - ground) < 0.01).sum() > 300
        seen = simulation.silhouettes["target"]
        visible = np.zeros((72, 96), dtype=bool)
        visible[seen.rect.slices] = seen.visible
        points = (rays * depth[..., None])[visible] @ truth.T_world_camera[:3, :3].T + truth.T_world_camera[:3, 3]
        local = (points - truth.T_world_target[:3, 3]) @ truth.T_world_target[:3, :3]
        assert np.abs(local[:, :2]).max() < 0.6
        assert local[:, 2].min() > -0.05
        assert local[:, 2].max() < 2.1
