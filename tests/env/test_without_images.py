"""`image=False`: the same truth without pixels, and without any OpenGL library."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import observing
import pytest

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim import controllers, policies, scenario, trackers
from pftrack_sim.core.errors import ParameterError, TrackerError
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.simulation.world import World
from pftrack_sim.wrappers import BoxObservation
from tests.fresh_process import WITHOUT_OPENGL, printed

SMALL = {**observing.SMALL, "duration_s": 1.0}
GEOMETRY_AXES = {f"axes.{name}.severity": 1.0 for name in ("jitter", "blur", "rolling_shutter", "distortion", "stream")}


def test_the_model_has_the_same_shapes_and_blank_textures():
    resolved = scenario.load("easy/warehouse").resolve(3)  # with a pillar, and boxes whose texture has six faces
    drawn, bare = World(resolved, 3).model, World(resolved, 3, draws=False).model
    for field in ("geom_type", "geom_size", "geom_rgba", "geom_matid", "mat_texid", "mesh_vert", "mesh_face"):
        np.testing.assert_array_equal(getattr(bare, field), getattr(drawn, field))
    assert bare.ntexdata < 100 < drawn.ntexdata
    assert not bare.tex_data.any()


@pytest.mark.parametrize(
    ("name", "more", "seed"),
    [
        ("plaza-walk", {}, 1),
        ("corridor", GEOMETRY_AXES, 2),
        pytest.param("warehouse", GEOMETRY_AXES, 3, marks=pytest.mark.slow),
        pytest.param("street-night", {"axes.occlusion.severity": 1.0, "axes.occlusion.end_s": 6.0}, 4,
                     marks=pytest.mark.slow),
        pytest.param("plaza-walk", {"target.init": "torso", "camera.width_px": 640, "camera.height_px": 480}, 5,
                     marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_the_truth_is_that_of_rendered_frames(name: str, more: dict[str, Any], seed: int):
    resolved = scenario.load(name, {**SMALL, "duration_s": 6.0, **more})
    with Simulation(resolved) as drawn, Simulation(resolved, image=False) as bare:
        pairs = [(drawn.reset(seed), bare.reset(seed))]
        pairs += [(drawn.advance(), bare.advance()) for _ in range(12)]
    compared = 0
    for rendered, frame in pairs:
        assert not frame.image.any()
        assert frame.image.shape == rendered.image.shape
        assert frame.time_s == rendered.time_s
        assert len(rendered.people) == len(frame.people)
        for theirs, ours in zip(rendered.people, frame.people, strict=True):
            assert np.isnan(ours.luminance)
            assert replace(ours, luminance=0.0) == replace(theirs, luminance=0.0)
            compared += ours.scored
    assert compared > 13


@pytest.fixture
def env():
    made = gym.make("pftrack_sim/Follow-v0", scenario="corridor", overrides=SMALL, image=False)
    yield made
    made.close()


@pytest.mark.parametrize("env_id", ["Track-v0", "TrackAndFollow-v0"])
def test_observations_of_all_environments_have_no_image(env_id: str):
    made = gym.make(f"pftrack_sim/{env_id}", scenario="corridor", overrides=SMALL, image=False)
    assert made.reset(seed=1)[0].keys() == {"init_box", "first", "proprio"}
    assert made.step(made.action_space.sample())[0].keys() == {"init_box", "first", "proprio"}
    made.close()


def test_commands_lead_to_the_same_poses_and_rewards(env: gym.Env[Any, Any]):
    drawn = gym.make("pftrack_sim/Follow-v0", scenario="corridor", overrides=SMALL)
    rng = np.random.default_rng(0)
    for made in (env, drawn):
        made.reset(seed=4)
    for _ in range(10):
        command = rng.uniform(-1.0, 1.0, 4)
        bare, reward, *_, info = env.step(command)
        seen, expected, *_, drawn_info = drawn.step(command)
        assert reward == expected
        np.testing.assert_array_equal(bare["proprio"], seen["proprio"])
        np.testing.assert_array_equal(info["truth"].T_world_target, drawn_info["truth"].T_world_target)
    drawn.close()


def test_policies_follow_without_images(env: gym.Env[Any, Any]):
    policy = policies.FollowPolicy(trackers.make("oracle"), controllers.make("servo"))
    observation, info = env.reset(seed=1)
    command = policy(observation, info)
    assert np.abs(command).max() > 0.0
    np.testing.assert_array_equal(policy.estimate.box, info["truth"].box)
    with pytest.raises(TrackerError, match="image=False"):
        policies.TrackingPolicy(trackers.make("stay"))(observation, info)
    learner = BoxObservation(env)
    assert learner.reset(seed=1)[0] in learner.observation_space


def test_a_copy_has_no_images_either(env: gym.Env[Any, Any]):
    expected = env.reset(seed=3)[1]["truth"]
    copied = pickle.loads(pickle.dumps(env.unwrapped))
    assert copied.reset(seed=3)[1]["truth"].visible_fraction == expected.visible_fraction


def test_what_needs_pixels_is_refused(env: gym.Env[Any, Any]):
    with pytest.raises(ParameterError, match="leave out render_mode"):
        gym.make("pftrack_sim/Track-v0", image=False, render_mode="rgb_array")
    with pytest.raises(ParameterError, match="leave out the backend 'egl'"):
        gym.make("pftrack_sim/Track-v0", image=False, backend="egl")


def test_no_opengl_library_is_loaded():
    code = (
        "import gymnasium as gym, numpy as np, pftrack_sim\n"
        f"env = gym.make('pftrack_sim/Follow-v0', scenario='corridor', overrides={SMALL!r}, image=False)\n"
        "env.reset(seed=0)\n"
        "assert env.step(np.zeros(4))[4]['truth'].visible_fraction > 0.5\n"
        "import os; loaded = open('/proc/self/maps').read() if os.path.exists('/proc/self/maps') else ''\n"
        "assert not [name for name in ('libEGL', 'libOSMesa', 'libGLX', 'warp') if name in loaded]"
    )
    printed(code, **WITHOUT_OPENGL)


def test_others_are_those_of_their_frame_whenever_they_are_asked_for():
    detected = {**SMALL, "axes.detector.severity": 1.0}
    late, now = (
        gym.make("pftrack_sim/Follow-v0", scenario="plaza-walk", overrides=detected, image=False) for _ in "12"
    )
    kept, expected = [late.reset(seed=3)[1]], [now.reset(seed=3)[1]]
    for _ in range(6):
        kept.append(late.step(np.zeros(4))[4])
        expected.append(now.step(np.zeros(4))[4])
        assert len(expected[-1]["people"]) > 1
        expected[-1]["detections"].boxes  # noqa: B018 - read while the frame is the last
    # A later episode, in another model, does not change what an earlier frame shows.
    late.reset(seed=5)
    for mine, theirs in zip(kept[::-1], expected[::-1], strict=True):
        assert mine["people"] == theirs["people"]
        assert mine["detections"] == theirs["detections"]
    assert {one.name for one in kept[-1]["people"]} == set(now.unwrapped.simulation.silhouettes) | {"target"}
    late.close()
    now.close()
