"""The public contract of the environments, checked on every one of them."""

import ctypes
import math
import pickle
import sys
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import ClipAction, FlattenObservation, RescaleAction

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim import scenario
from pftrack_sim.core.errors import BoxError, CommandError, ParameterError, ScenarioError
from pftrack_sim.core.records import Estimate
from tests.fresh_process import printed
from tests.observing import TINY

IDS = ["pftrack_sim/Track-v0", "pftrack_sim/Follow-v0", "pftrack_sim/TrackAndFollow-v0"]
# Worlds of suites' episodes are long in the making.
NAMES = [pytest.param(name, marks=pytest.mark.slow) if "/" in name else name for name in scenario.names()]
SMALL: dict[str, Any] = {**TINY, "duration_s": 0.5, "distractors.count": 1, "occluders": []}


def make(env_id: str = IDS[0], name: str = "plaza-walk", **more: Any) -> gym.Env[Any, Any]:
    overrides = {**SMALL, **more.pop("overrides", {})}
    return gym.make(env_id, scenario=name, overrides=overrides, **more)


@pytest.fixture
def env():
    made = make()
    yield made
    made.close()


@pytest.mark.parametrize("given", [{"render_mode": "rgb_array"}, {"image": False}], ids=["images", "without"])
@pytest.mark.parametrize("env_id", IDS)
def test_gymnasium_checker_passes_without_warnings(env_id: str, given: dict[str, Any], monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")  # it opens a window
    env = make(env_id, "corridor", **given)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # The boxes of actions are in pixels; `RescaleAction` normalises them for those who learn.
        warnings.filterwarnings("ignore", message=".*symmetric and normalized space.*")
        check_env(env.unwrapped)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("env_id", [*(pytest.param(one, marks=pytest.mark.slow) for one in IDS[:2]), IDS[2]])
def test_same_seed_same_bits(env_id: str, name: str):
    runs = []
    for _ in range(2):
        env = make(env_id, name)
        env.action_space.seed(5)
        (observation, info), reward, seen = env.reset(seed=11), 0.0, []
        for _ in range(5):
            pixels, sensed = observation["image"].tobytes(), observation["proprio"].tobytes()
            seen.append((pixels, sensed, pickle.dumps(info["people"]), reward))
            observation, reward, _, _, info = env.step(env.action_space.sample())
        env.close()
        runs.append(seen)
    assert runs[0] == runs[1]


@pytest.mark.slow
def test_detections_are_of_everybody_in_the_frame_unless_the_detector_is_stressed(env: gym.Env[Any, Any]):
    _, info = env.reset(seed=3)
    for _ in range(3):
        expected = sorted(one.box.tolist() for one in info["people"] if one.scored)
        assert sorted(info["detections"].boxes.tolist()) == expected
        info = env.step(np.array([1.0, 2.0, 3.0, 4.0]))[-1]
    stressed = make(overrides={"axes.detector.severity": 2.0, "axes.detector.height_px": 10.0})
    stressed.reset(seed=3)
    runs = [stressed.step(np.zeros(4))[-1]["detections"] for _ in range(3)]
    stressed.reset(seed=3)
    assert runs == [stressed.step(np.zeros(4))[-1]["detections"] for _ in range(3)]
    assert runs[-1].age_s == pytest.approx(2.0 / 30.0)
    stressed.close()
    blind = make(overrides={"axes.detector.severity": 0.1, "axes.detector.height_px": 3.0}, image=False)
    blind.reset(seed=3)
    assert len(blind.step(np.zeros(4))[-1]["detections"]), "without images contrast does not matter"
    blind.close()


def test_episodes_are_independent(env: gym.Env[Any, Any]):
    def episode(seed: int) -> list[bytes]:
        observation, _ = env.reset(seed=seed)
        images = [observation["image"].tobytes()]
        for _ in range(6):
            images.append(env.step(np.array([1.0, 2.0, 3.0, 4.0]))[0]["image"].tobytes())
        return images

    fresh = episode(3)
    episode(4)
    assert episode(3) == fresh


@pytest.mark.slow
def test_an_episode_does_not_depend_on_those_before_it_in_its_process():
    code = (
        "import hashlib, pickle, sys\n"
        "import gymnasium as gym, pftrack_sim\n"
        "for episode in sys.argv[1:]:\n"
        "    name, seed, patches = episode.split(':')\n"
        f"    given = {SMALL!r} | {{'lights.patches': float(patches)}}\n"
        "    env = gym.make('pftrack_sim/Track-v0', scenario=name, overrides=given)\n"
        "    env.reset(seed=int(seed) + 1)\n"
        "    observation, info = env.reset(seed=int(seed))\n"
        "    found = hashlib.sha1(observation['image'].tobytes())\n"
        "    observation, _, _, _, info = env.step([0.0, 0.0, 5.0, 5.0])\n"
        "    found.update(observation['image'].tobytes() + pickle.dumps(tuple(info['people'])))\n"
        "    print(episode, found.hexdigest())\n"
        "    env.close()\n"
    )
    episodes = ["plaza-walk:3:0.0", "street-night:3:0.4", "plaza-walk:7:0.4", "warehouse:3:0.0", "follow/plaza:3:0.0"]
    forwards, backwards = (sorted(printed(code, *order).splitlines()) for order in (episodes, episodes[::-1]))
    assert forwards == backwards
    assert len({line.split()[1] for line in forwards}) == len(episodes)


def test_the_first_frame_holds_the_box_and_the_others_do_not(env: gym.Env[Any, Any]):
    observation, info = env.reset(seed=1)
    assert observation["first"] == 1
    np.testing.assert_array_equal(observation["init_box"], info["truth"].box)
    observation, *_ = env.step(observation["init_box"])
    assert observation["first"] == 0
    assert not observation["init_box"].any()


def test_reward_is_the_overlap_with_the_frame_that_was_shown(env: gym.Env[Any, Any]):
    _, info = env.reset(seed=1)
    while True:
        truth = info["truth"]
        _, reward, terminated, truncated, info = env.step(truth.box)
        assert reward == pytest.approx(1.0 if truth.box[2:].all() else 0.0)
        assert info["scored"] == (truth.state == "visible")
        assert not terminated
        if truncated:
            break
    assert info["frame"] == 15
    _, info = env.reset(seed=1)
    shifted = info["truth"].box + np.array([info["truth"].box[2] / 2, 0, 0, 0])
    assert env.step(shifted)[1] == pytest.approx(1 / 3, abs=1e-9)


@pytest.mark.parametrize(
    ("action", "words"),
    [
        ([0, 0, np.nan, 1], "finite"),
        ([0, np.inf, 1, 1], "finite"),
        ([0, 0, -1, 1], ">= 0"),
        ([0, 0, 1], r"shape \(4,\)"),
        ([[0, 0, 1, 1]], r"shape \(4,\)"),
        ("box", "four numbers"),
    ],
)
def test_invalid_boxes_are_errors(env: gym.Env[Any, Any], action: object, words: str):
    env.reset(seed=1)
    with pytest.raises(BoxError, match=words):
        env.unwrapped.step(action)


@pytest.mark.parametrize("options", [{"seed": 3}, 3, "fast"])
def test_options_of_a_reset_are_errors_that_draw_no_seed(env: gym.Env[Any, Any], options: Any):
    env.reset(seed=5)
    before = env.unwrapped.np_random.bit_generator.state
    with pytest.raises(ParameterError, match=f"reset takes no options, got {options!r}"):
        env.reset(seed=6, options=options)
    assert env.unwrapped.np_random.bit_generator.state == before


def test_invalid_commands_are_errors_and_large_ones_clipped():
    env = make(IDS[1])
    env.reset(seed=1)
    for wrong in ([0, 0, math.nan, 0], [0, math.inf, 0, 0]):
        with pytest.raises(CommandError, match="finite"):
            env.unwrapped.step(wrong)
    assert env.unwrapped.simulation.world.time_s == 0.0, "nothing moves"
    with pytest.raises(CommandError, match="shape"):
        env.unwrapped.step([0, 0, 0])
    info = env.unwrapped.step([5, 0, 0, -5])[4]
    np.testing.assert_array_equal(info["command"], [1, 0, 0, -1])
    env.close()
    env = make(IDS[2])
    env.reset(seed=1)
    with pytest.raises(ParameterError, match="'box' and 'command'"):
        env.unwrapped.step({"box": [0, 0, 1, 1]})
    env.close()


def test_both_scores_of_one_episode():
    env = make(IDS[2])
    _, info = env.reset(seed=1)
    _, reward, _, _, info = env.step({"box": info["truth"].box, "command": np.zeros(4, np.float32)})
    assert info["overlap"] == pytest.approx(1.0)
    assert reward == pytest.approx(0.5 * (info["overlap"] + info["following"]))
    env.close()


def test_the_image_keeps_its_size():
    env = make(overrides={"camera.width_px": {"choice": [64, 96, 128, 160]}})
    env.reset(seed=0)
    other = next(s for s in range(1, 99) if env.unwrapped.scenario.resolve(s) != env.unwrapped.scenario.resolve(0))
    with pytest.raises(ScenarioError, match="image size must not change"):
        env.reset(seed=other)
    env.close()


def test_render_shows_the_answered_frame_and_leaves_the_observation_alone():
    env = make(render_mode="rgb_array")
    observation, info = env.reset(seed=1)
    before = observation["image"].copy()
    picture = env.render()
    assert picture.shape == before.shape
    assert picture.dtype == np.uint8
    assert (picture != before).any()
    env.step(info["truth"].box)
    assert (env.render() != picture).any()
    np.testing.assert_array_equal(observation["image"], before)
    env.close()


def test_render_shows_an_estimate_with_its_particles_for_one_step():
    env = make(render_mode="rgb_array")
    _, info = env.reset(seed=1)
    box = info["truth"].box
    estimate = Estimate(box, particles=box + np.linspace([-9, -9, 0, 0], [9, 9, 0, 0], 40))
    pictures = []
    for shown in ({"mine": Estimate(box)}, {"mine": estimate}):
        env.reset(seed=1)
        env.unwrapped.show(shown)
        env.step(box)
        pictures.append(env.render().astype(int))
    assert 10 < (pictures[1] != pictures[0]).any(axis=2).sum() <= 40
    env.close()


def test_the_legend_names_the_action_and_not_the_tracker_of_an_earlier_step():
    env = make(render_mode="rgb_array", overrides={"camera.width_px": 480, "camera.height_px": 360})  # has names
    pictures = []
    for shown in ({"mine": Estimate([9.0, 9.0, 9.0, 9.0])}, None):
        env.reset(seed=1)
        if shown is not None:
            env.unwrapped.show(shown)
        env.step(np.array([9.0, 9.0, 9.0, 9.0]))
        pictures.append(env.render())
    assert (pictures[1] != pictures[0]).any()
    env.close()


@pytest.mark.parametrize("name", NAMES)
def test_every_scenario_starts_with_the_target_in_view_and_the_robot_on_the_ground(name: str):
    env = gym.make(IDS[0], scenario=name, overrides={"camera.width_px": 160, "camera.height_px": 120}, image=False)
    for seed in range(3):
        _, info = env.reset(seed=seed)
        assert info["truth"].state == "visible", seed
        assert info["truth"].truncation < 0.2, seed
        world = env.unwrapped.simulation.world
        bodies = world.model.geom_bodyid[world.data.contact.geom].flat
        assert {world.model.body(body).name.split("/")[0] for body in bodies} == {"ground", "robot"}
    env.close()


def test_wrappers_record_videos_and_statistics(tmp_path):
    env = gym.wrappers.RecordEpisodeStatistics(make(render_mode="rgb_array"))
    env = gym.wrappers.RecordVideo(env, str(tmp_path), disable_logger=True)
    _, info = env.reset(seed=1)
    done = False
    while not done:
        _, _, _, done, info = env.step(info["truth"].box)
    env.close()
    assert info["episode"]["l"] == 15
    assert [path.suffix for path in tmp_path.iterdir()] == [".mp4"]


@pytest.mark.parametrize("mode", ["sync", pytest.param("async", marks=pytest.mark.slow)])
def test_vector_environments(mode: str):
    kwargs = {"context": "spawn"} if mode == "async" else {}
    envs = gym.make_vec(
        IDS[0], num_envs=2, vectorization_mode=mode, vector_kwargs=kwargs, scenario="plaza-walk", overrides=SMALL
    )
    observation, info = envs.reset(seed=[4, 5])
    assert observation["image"].shape == (2, 72, 96, 3)
    observation, reward, _, _, info = envs.step(np.stack([truth.box for truth in info["truth"]]))
    np.testing.assert_allclose(reward, 1.0)
    alone = make()
    alone.reset(seed=5)
    expected = alone.step(np.array([0.0, 0, 1, 1]))[0]["image"]
    np.testing.assert_array_equal(observation["image"][1], expected)
    alone.close()
    envs.close()


@pytest.mark.parametrize("env_id", IDS)
def test_vector_environments_take_samples_of_their_action_space(env_id: str):
    envs = gym.make_vec(env_id, num_envs=2, vectorization_mode="sync", scenario="plaza-walk", overrides=SMALL)
    envs.action_space.seed(1)
    envs.reset(seed=1)
    for _ in range(3):
        action = envs.action_space.sample()
        assert action in envs.action_space
        assert envs.step(action)[1].shape == (2,)
    envs.close()


def test_wrappers_of_gymnasium_take_the_space_of_boxes():
    env = FlattenObservation(ClipAction(RescaleAction(make(), -1.0, 1.0)))
    flat, info = env.reset(seed=4)
    assert flat.shape == env.observation_space.shape
    x, y, width, height = info["truth"].box
    action = np.array([x / 96, y / 72, width / 96, height / 72]) * 2.0 - 1.0
    assert abs(env.step(action)[1] - 1.0) < 1e-9
    env.close()


def test_a_pickled_environment_starts_anew_with_the_same_bits():
    env = make()
    first = env.reset(seed=3)[0]["image"]
    copied = pickle.loads(pickle.dumps(env))
    with pytest.raises(gym.error.ResetNeeded):
        copied.unwrapped.step([0.0, 0.0, 1.0, 1.0])
    np.testing.assert_array_equal(copied.reset(seed=3)[0]["image"], first)
    copied.close()


@pytest.mark.slow
@pytest.mark.skipif(
    sys.platform != "linux" or not hasattr(ctypes.CDLL(None), "mallinfo2"),
    reason="asks glibc (2.33 or later) for the memory in use",
)
def test_resets_do_not_grow_memory():
    code = (
        "import ctypes, gc, sys\n"
        "import gymnasium as gym, pftrack_sim\n"
        "class Mallinfo2(ctypes.Structure):\n"
        "    names = 'arena ordblks smblks hblks hblkhd usmblks fsmblks uordblks fordblks keepcost'.split()\n"
        "    _fields_ = [(name, ctypes.c_size_t) for name in names]\n"
        "mallinfo2 = ctypes.CDLL(None).mallinfo2\n"
        "mallinfo2.restype = Mallinfo2\n"
        f"env = gym.make('pftrack_sim/Track-v0', scenario='corridor', overrides={SMALL!r})\n"
        "megabytes, objects = [], []\n"
        "for seed in range(120):\n"
        "    env.reset(seed=seed)\n"
        "    gc.collect()\n"
        "    now = mallinfo2()\n"
        "    megabytes.append((now.uordblks + now.hblkhd) / 2**20)\n"
        "    objects.append(sys.getallocatedblocks())\n"
        "from statistics import median\n"
        "print(median(megabytes[60:]) - median(megabytes[:60]), max(objects[60:]) - max(objects[:60]))"
    )
    grown_mb, grown_objects = map(float, printed(code).split())
    # What is allocated, not what the process holds: the allocator keeps or returns a freed model (15 MB) as it likes.
    # A tenth of a megabyte or a hundred Python objects kept per reset show; one episode with a larger model does not.
    assert grown_mb < 4
    assert grown_objects < 6000


def test_import_only_registers_the_environments():
    code = (
        "import os, sys, threading; before = dict(os.environ); import pftrack_sim\n"
        "assert dict(os.environ) == before\n"
        "assert threading.active_count() == 1\n"
        "assert not {'mujoco', 'numba', 'cv2', 'duckdb', 'av'} & set(sys.modules)\n"
        "import gymnasium; assert 'pftrack_sim/Track-v0' in gymnasium.registry\n"
        "import cv2; before = dict(os.environ)  # OpenCV sets LD_LIBRARY_PATH for itself\n"
        f"env = gymnasium.make('pftrack_sim/Track-v0', scenario='corridor', overrides={SMALL!r}); env.reset(seed=0)\n"
        "env.close()\n"
        "assert dict(os.environ) == before, set(os.environ) ^ set(before)"
    )
    printed(code)


@pytest.mark.parametrize(
    ("changes", "read", "words"),
    [
        ({"camera.width_px": {"choice": [64, 96]}}, lambda one: one.camera.width_px, "size of 'camera'"),
        (
            {"robot.range_finder.beams": {"integer": [5, 40]}},
            lambda one: one.robot.range_finder.beams,
            "robot.range_finder.beams",
        ),
        ({"cameras": [{"name": "a"}], "viewed": {"choice": ["camera", "a"]}}, lambda one: one.viewed, "viewed"),
    ],
)
def test_an_observation_that_would_change_with_the_seed_is_refused(
    changes: dict[str, Any], read: Callable[[scenario.ResolvedScenario], object], words: str
):
    env = make(overrides=changes, image=False)
    loaded = scenario.load("plaza-walk", {**SMALL, **changes})
    values = {seed: read(loaded.resolve(seed)) for seed in range(20)}
    same, other = (
        next(seed for seed in values if seed and (values[seed] == values[0]) is alike) for alike in (True, False)
    )
    with pytest.raises(ScenarioError, match=rf"{words}.*: the observation must not change with the seed, got"):
        env.reset(seed=other)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(np.zeros(4))
    env.close()
    env = make(overrides=changes, image=False)
    assert env.observation_space.contains(env.reset(seed=same)[0])
    env.close()
