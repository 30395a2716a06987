"""Time that a tracker takes is charged to the simulation."""

import hashlib
import math

import gymnasium as gym
import numpy as np
import pytest

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim import controllers, policies, scenario, trackers
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.records import Estimate

SMALL = {"camera.width_px": 96, "camera.height_px": 72, "lights.shadows": False, "duration_s": 1.0, "occluders": []}
RATE_HZ = 30.0


class Numbered:
    """A policy whose answers carry the number of the frame that they were worked out from."""

    def __init__(self) -> None:
        self.seen: list[int] = []
        self.estimate: Estimate | None = None

    def reset(self) -> None:
        self.seen.clear()

    def __call__(self, observation, info=None):
        self.seen.append(observation)
        self.estimate = Estimate(np.array([observation, 0.0, 1.0, 1.0]))
        return {"box": self.estimate.box, "command": np.full(4, observation + 1.0)}


@pytest.mark.parametrize("latency_ms", [0.0, 7.0, 13.0, 33.0, 55.0, 100.0, 250.0])
def test_answers_are_as_old_as_they_would_be(latency_ms: float):
    numbered = Numbered()
    late = policies.LatencyWrapper(numbered, latency_ms, RATE_HZ)  # pyright: ignore[reportArgumentType]
    free_s, ready = 0.0, [(0.0, 0, True)]
    for frame in range(40):
        action = late(frame)  # pyright: ignore[reportArgumentType]
        now_s = frame / RATE_HZ
        if now_s > free_s - 1e-9:
            free_s = now_s + latency_ms * 1e-3
            ready.append((free_s, frame, False))
        done = [one for one in ready if one[0] <= now_s + 1.0 / RATE_HZ + 1e-9]
        given_s, source, selected = done[-1]
        assert action["box"][0] == source
        assert action["command"][0] == (0.0 if selected else source + 1.0)
        if now_s < given_s - 1e-9:
            assert math.isclose(action["late_s"], given_s - now_s, abs_tol=1e-9)
        else:
            assert "late_s" not in action
    assert numbered.seen == list(range(0, 40, policies.frames_taken(latency_ms, RATE_HZ)))


def test_a_slow_tracker_calls_its_controller_less_often():
    settings = scenario.load("plaza-walk").resolve(0)
    assert policies.rig_of(settings).rate_hz == 30.0
    assert policies.rig_of(settings, 55.0).rate_hz == 15.0
    assert policies.rig_of(settings).max_turn_rad_s == math.radians(settings.robot.max_turn_deg_s)


@pytest.mark.parametrize("wrong", [-1.0, math.nan, math.inf])
def test_impossible_latencies(wrong: float):
    with pytest.raises(ParameterError, match="latency"):
        policies.LatencyWrapper(Numbered(), wrong, RATE_HZ)  # pyright: ignore[reportArgumentType]


def play(wrap, steps: int = 20) -> str:
    """A digest of the frames and scores of an episode."""
    env = gym.make("pftrack_sim/TrackAndFollow-v0", scenario="plaza-walk", overrides=SMALL)
    settings = scenario.load("plaza-walk", SMALL).resolve(2)
    policy = policies.TrackAndFollowPolicy(
        trackers.make("oracle"), controllers.make("servo-avoid"), policies.rig_of(settings)
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
