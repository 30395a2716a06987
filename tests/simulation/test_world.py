"""Laws of the world: nested clocks, and random draws that are paired across conditions."""

import functools
from typing import Any

import mujoco
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.agents.clock import PHYSICS_HZ, TICK_HZ, Clock
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.simulation.world import World

BASE: dict[str, Any] = {"duration_s": 3, "lights.shadows": False}
FREE: dict[str, Any] = {"occluders": []}
"""Planning occlusions takes half of the time."""


def world(overrides: dict[str, Any] | None = None, seed: int = 5, name: str = "plaza-walk") -> World:
    return World(scenario.load(name, {**BASE, **(overrides or {})}).resolve(seed), seed)


@functools.cache
def plain_walk() -> tuple[np.ndarray, np.ndarray]:
    return walk()


def walk(overrides: dict[str, Any] | None = None, frames: int = 30, **more: Any) -> tuple[np.ndarray, np.ndarray]:
    """`(N, 4, 4)` poses of the target and of the camera."""
    simulated = world(overrides, **more)
    targets, cameras = [], []
    for _ in range(frames):
        simulated.advance()
        targets.append(simulated.root_poses()[0])
        cameras.append(simulated.camera_pose())
    return np.array(targets), np.array(cameras)


@pytest.mark.parametrize("rate_hz", [5.0, 12.5, 15.0, 20.0, 25.0, 29.97, 30.0, 60.0, 200.0])
def test_frames_ticks_and_steps_are_nested(rate_hz: float):
    clock = Clock.for_rate(rate_hz)
    assert 1.0 / clock.tick_s >= TICK_HZ - 1e-9
    assert 1.0 / clock.step_s >= PHYSICS_HZ - 1e-9
    assert (clock.ticks - 1) * rate_hz < TICK_HZ  # no more than needed
    assert clock.ticks * clock.tick_s == pytest.approx(1.0 / rate_hz, rel=1e-12)
    assert clock.time_s(1000 * clock.ticks) == pytest.approx(1000 / rate_hz, rel=1e-14)


def test_a_late_command_waits_over_as_many_ticks_as_its_delay(monkeypatch: pytest.MonkeyPatch):
    simulated = world({**FREE, "camera.rate_hz": 10.0})  # three ticks of 33 ms
    delays_s: list[float] = []
    update = simulated.robot.update

    def recorded(*given: Any) -> None:
        delays_s.append(given[-1])
        update(*given)

    monkeypatch.setattr(simulated.robot, "update", recorded)
    simulated.advance(np.array([1.0, 0.0, 0.0, 0.0]), delay_s=0.05)
    np.testing.assert_allclose(delays_s, [1 / 30, 0.05 - 1 / 30, 0.0], atol=1e-12)


def test_the_time_of_a_frame_is_its_index_over_the_rate():
    simulated = world(FREE)
    for _ in range(45):
        simulated.advance()
    assert simulated.time_s == 1.5
    assert simulated.data.time == pytest.approx(1.5, abs=1e-9)


@pytest.mark.parametrize(
    "overrides",
    [
        {"distractors.count": 1},
        {"distractors.similarity": 1.0},
        {"axes.jitter.severity": 2.0, "axes.jitter.sources": ["wind", "ground"]},
        {"lights.ev": -2.0},
        {"camera.width_px": 96, "camera.height_px": 72},
    ],
    ids=lambda overrides: next(iter(overrides)),
)
def test_target_and_robot_do_not_depend_on_other_conditions(overrides: dict[str, Any]):
    for before, after in zip(plain_walk(), walk(overrides), strict=True):
        np.testing.assert_array_equal(before, after)


def test_a_rough_road_shakes_the_robot_and_no_pedestrian():
    smooth, rough = world(FREE), world({**FREE, "axes.jitter": {"sources": ["road"], "road_class": "C"}})
    for _ in range(30):
        smooth.advance()
        rough.advance()
    np.testing.assert_array_equal(smooth.root_poses()[0], rough.root_poses()[0])
    assert abs(smooth.camera_pose() - rough.camera_pose()).max() > 1e-4
    assert abs(smooth.camera_pose() - rough.camera_pose()).max() < 0.1


def test_distractors_do_not_depend_on_their_number():
    few, many = (world({**FREE, "distractors.count": count}) for count in (2, 3))

    def texture_of(of: World, name: str) -> bytes:
        model = of.model
        body = next(i for i in range(model.nbody) if model.body(i).name == f"{name}/torso")
        material = model.geom_matid[np.flatnonzero(model.geom_bodyid == body)[0]]
        texture = model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]
        start = model.tex_adr[texture]
        size = model.tex_width[texture] * model.tex_height[texture] * model.tex_nchannel[texture]
        return model.tex_data[start : start + size].tobytes()

    for name in ("target", "distractor-1", "distractor-2"):
        assert texture_of(few, name) == texture_of(many, name)
    assert texture_of(many, "distractor-3") != texture_of(many, "distractor-2")


def test_seeds_differ():
    assert not np.array_equal(walk(frames=5)[0], walk(frames=5, seed=6)[0])


def test_a_robot_that_would_start_in_furniture_is_an_error_before_the_first_frame():
    with pytest.raises(ScenarioError, match=r"robot\.route: the robot would run into 'plant-4' at -5\.5"):
        world({"robot.route.distance_m": 5.5}, 0, "easy/corridor")
