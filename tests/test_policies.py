"""The processing time of a tracker is charged to the simulation."""

import hashlib
import math

import gymnasium as gym
import numpy as np
import pytest

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim import controllers, policies, scenario, trackers
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.proprioception import PROPRIO_INDEX
from pftrack_sim.core.records import Estimate
from pftrack_sim.simulation.simulation import Simulation

SMALL = {"camera.width_px": 96, "camera.height_px": 72, "lights.shadows": False, "duration_s": 1.0, "occluders": []}
RATE_HZ = 30.0


class Numbered:
    """A policy whose actions carry the number of the frame that they were computed from."""

    def __init__(self) -> None:
        self.seen: list[int] = []
        self.estimate: Estimate | None = None

    def reset(self) -> None:
        self.seen.clear()

    def __call__(self, observation, info=None):
        frame = observation["frame"]
        self.seen.append(frame)
        self.estimate = Estimate(np.array([frame, 0.0, 1.0, 1.0]))
        return {"box": self.estimate.box, "command": np.full(4, frame + 1.0)}


LOST = [number for number in range(90) if number % 11 not in (3, 4, 5, 6) and number % 7 != 2]
"""Numbers of the frames that arrive over a lossy stream."""


@pytest.mark.parametrize("arrived", [list(range(40)), LOST])
@pytest.mark.parametrize("latency_ms", [0.0, 7.0, 13.0, 33.0, 55.0, 90.0, 100.0, 250.0])
def test_results_are_as_old_as_the_latency_says(latency_ms: float, arrived: list[int]):
    """Over frames that arrive regularly and irregularly: what counts is time, not the number of frames."""
    numbered = Numbered()
    wrapper = policies.LatencyWrapper(numbered, latency_ms, RATE_HZ)  # pyright: ignore[reportArgumentType]
    free_s, results, taken = 0.0, [(0.0, 0, 0.0)], []
    for frame in arrived:
        time_s = frame / RATE_HZ
        action = wrapper({"frame": frame, "first": frame == 0}, {"time_s": time_s})
        if time_s >= free_s - 1e-9:
            free_s = time_s + latency_ms * 1e-3
            results.append((free_s, frame, frame + 1.0))
            taken.append(frame)
        due = [one for one in results if one[0] <= time_s + 1.0 / RATE_HZ + 1e-9]
        assert action["box"][0] == due[-1][1]
        given = [one for one in results if one[0] <= time_s + action.get("late_s", 0.0) + 1e-9]
        assert action["command"][0] == given[-1][2] == results[-1][2]
        assert time_s + action.get("late_s", 0.0) == pytest.approx(max(results[-1][0], time_s), abs=1e-9)
    assert numbered.seen == taken


def test_a_lossy_stream_does_not_make_a_tracker_slower():
    """A tracker that takes 90 ms is idle again after 90 ms, and takes the next frame that arrives."""
    numbered = Numbered()
    wrapper = policies.LatencyWrapper(numbered, 90.0, RATE_HZ)  # pyright: ignore[reportArgumentType]
    for frame in (0, 10, 20, 21, 30, 33):
        wrapper({"frame": frame, "first": frame == 0}, {"time_s": frame / RATE_HZ})
    assert numbered.seen == [0, 10, 20, 30, 33]


def test_a_target_that_appears_while_the_tracker_is_busy_is_selected_at_once():
    numbered = Numbered()
    wrapper = policies.LatencyWrapper(numbered, 100.0, RATE_HZ)  # pyright: ignore[reportArgumentType]
    for frame in range(4):
        action = wrapper({"frame": frame, "first": frame == 1}, {"time_s": frame / RATE_HZ})
        assert action["box"][0] == min(frame, 1)
    assert numbered.seen == [0, 1]


def test_a_slow_tracker_calls_its_controller_less_often():
    settings = scenario.load("plaza-walk").resolve(0)
    assert policies.robot_parameters(settings).rate_hz == 30.0
    assert policies.robot_parameters(settings, 55.0).rate_hz == 15.0
    assert policies.robot_parameters(settings).max_turn_rad_s == math.radians(settings.robot.max_turn_deg_s)


@pytest.mark.parametrize("wrong", [-1.0, math.nan, math.inf])
def test_impossible_latencies(wrong: float):
    with pytest.raises(ParameterError, match="latency"):
        policies.LatencyWrapper(Numbered(), wrong, RATE_HZ)  # pyright: ignore[reportArgumentType]


def play(wrap, steps: int = 20) -> str:
    """A digest of the frames and scores of an episode."""
    env = gym.make("pftrack_sim/TrackAndFollow-v0", scenario="plaza-walk", overrides=SMALL)
    settings = scenario.load("plaza-walk", SMALL).resolve(2)
    policy = policies.TrackAndFollowPolicy(
        trackers.make("oracle"), controllers.make("servo-avoid"), policies.robot_parameters(settings)
    )
    policy = wrap(policy)
    digest = hashlib.sha256()
    observation, info = env.reset(seed=2)
    for _ in range(steps):
        observation, reward, _, _, info = env.step(policy(observation, info))
        digest.update(np.ascontiguousarray(observation["image"]).tobytes())
        digest.update(np.array([reward, info["overlap"], info["distance_m"]]).tobytes())
    env.close()
    return digest.hexdigest()


def test_no_latency_is_the_same_to_the_bit_and_some_is_not():
    plain = play(lambda policy: policy)
    assert play(lambda policy: policies.LatencyWrapper(policy, 0.0, RATE_HZ)) == plain
    assert play(lambda policy: policies.LatencyWrapper(policy, 7.0, RATE_HZ)) != plain


@pytest.mark.parametrize("up_m", [-0.6, 0.6])
def test_a_controller_knows_height_and_direction_of_the_camera_that_is_looked_through(up_m: float):
    other = {"name": "other", "up_m": up_m, "ahead_m": 0.3, "pan_deg": -60.0, "tilt_deg": -15.0}
    for viewed in ("camera", "other"):
        changes = {**SMALL, "camera.tilt_deg": 10.0, "cameras": [other], "viewed": viewed}
        with Simulation(scenario.load("plaza-walk", changes), image=False) as simulation:
            pose = simulation.reset(1).truth.T_world_camera
            told, world = policies.robot_parameters(simulation.settings), simulation.world
            pan, tilt = told.gaze_rad(world.proprio())
            heading = world.robot_pose()[2]
        assert told.camera_height_m == pytest.approx(pose[2, 3], abs=0.02)
        bearing = math.remainder(heading + pan - math.atan2(pose[1, 2], pose[0, 2]), 2.0 * math.pi)
        assert bearing == pytest.approx(0.0, abs=0.03)
        assert tilt == pytest.approx(math.asin(pose[2, 2]), abs=0.03)


def test_a_robot_follows_by_a_camera_that_looks_to_the_side():
    env = gym.make(
        "pftrack_sim/TrackAndFollow-v0",
        scenario="follow/plaza",
        overrides={"duration_s": 15.0, "cameras": [{"name": "side", "pan_deg": -25.0}], "viewed": "side"},
        image=False,
    )
    observation, info = env.reset(seed=3)
    robot = policies.robot_parameters(env.unwrapped.simulation.settings)
    policy = policies.TrackAndFollowPolicy(trackers.make("oracle"), controllers.make("servo-avoid"), robot)
    distances_m, pans_deg = [], []
    for _ in range(445):
        observation, _, _, _, info = env.step(policy(observation, info))
        distances_m.append(info["distance_m"])
        pans_deg.append(math.degrees(observation["proprio"][PROPRIO_INDEX["pan_rad"]]))
    env.close()
    assert np.median(pans_deg) == pytest.approx(25.0, abs=8.0)
    assert max(distances_m) < 5.0
    assert info["truth"].visible_fraction > 0.5
