"""Several targets in one episode: truth by name, a tracker each, and one of them whom the episode is about."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim import controllers, policies, scenario, trackers
from pftrack_sim.benchmark import make_plan, run
from pftrack_sim.core import boxes
from pftrack_sim.core.errors import ScenarioError, TrackerError, UnknownNameError
from pftrack_sim.env.base import CameraEnv
from pftrack_sim.simulation.simulation import Simulation
from tests.observing import SMALL_WALK

LEA: dict[str, Any] = {"name": "lea", "path_m": [[5.0, 2.2], [9.0, 2.6], [12.0, 6.0]], "speed_m_s": 1.1}
WALKING: dict[str, Any] = {**SMALL_WALK, "duration_s": 6.0}
SEVERAL: dict[str, Any] = {**WALKING, "targets": [LEA, {"name": "distractor-1"}]}


def episode(overrides: dict[str, Any] | None = None, tree: dict[str, Any] = SEVERAL) -> list[dict[str, Any]]:
    """Information of every frame."""
    env = gym.make("pftrack_sim/Track-v0", scenario=tree, overrides=overrides, image=False)
    _, info = env.reset(seed=0)
    infos, over = [info], False
    while not over:
        _, _, _, over, info = env.step(np.array([1.0, 1.0, 9.0, 9.0]))
        infos.append(info)
    env.close()
    return infos


def test_each_is_told_of_by_name_in_every_frame():
    infos = episode()
    states = {name: [info["targets"][name].state for info in infos] for name in ("target", "lea", "distractor-1")}
    assert all(set(info["targets"]) == set(states) for info in infos)
    assert "visible" in states["lea"]
    assert "out_of_view" in states["distractor-1"]
    for info in infos:
        listed = {one.name: one for one in info["people"]}
        assert all(listed[name] == one for name, one in info["targets"].items())
        assert info["targets"]["target"] is info["truth"]


def test_a_further_target_walks_its_path():
    first, *_, last = (info["targets"]["lea"] for info in episode({"targets.0.path_m": [[5.0, 2.0], [15.0, 3.0]]}))
    start, end = (one.T_world_target[:2, 3] for one in (first, last))
    assert start == pytest.approx([5.0, 2.0], abs=0.03)
    along = (end - start) / np.hypot(*(end - start))
    assert along == pytest.approx(np.array([10.0, 1.0]) / np.hypot(10.0, 1.0), abs=0.01)
    assert np.hypot(*(end - start)) == pytest.approx(1.1 * last.time_s, abs=0.05)


def test_who_is_named_changes_nothing_but_what_is_told():
    plain, named = episode(tree=WALKING), episode(tree={**WALKING, "targets": [{"name": "distractor-1"}]})
    for before, after in zip(plain, named, strict=True):
        seen = {one.name: one for one in before["people"]}
        assert set(before["targets"]) == {"target"}
        assert after["truth"] == before["truth"]
        assert after["targets"]["distractor-1"] == seen.get("distractor-1", after["targets"]["distractor-1"])


def test_an_episode_may_be_about_any_of_them_in_the_same_world():
    plain, about = episode(), episode({"tracked": "lea"})
    for before, after in zip(plain, about, strict=True):
        assert after["truth"] == before["targets"]["lea"]
        assert after["targets"] == before["targets"]


def test_a_target_handed_over_stays_so_when_the_camera_is_retuned():
    loaded = scenario.load(SEVERAL)
    with Simulation(loaded, image=False) as simulation:
        simulation.reset(0)
        simulation.switch_target("lea")
        assert {one.name for one in simulation.advance().people} >= {"target", "lea", "distractor-1"}
        simulation.retune(scenario.load(loaded, {"axes.noise.severity": 1.0}), 0)
        assert simulation.advance().truth.name == "lea"
        assert simulation.reset(0).truth.name == "target"


def test_a_tracker_for_each():
    env = gym.make("pftrack_sim/Track-v0", scenario=SEVERAL, image=False)
    observation, info = env.reset(seed=0)
    names = list(info["targets"])
    followers = {name: policies.TrackingPolicy(trackers.make("oracle"), target=name) for name in names}
    overlaps: dict[str, list[float]] = {name: [] for name in names}
    over = False
    while not over:
        answers = {name: follower(observation, info) for name, follower in followers.items()}
        for name, truth in info["targets"].items():
            overlaps[name] += [boxes.iou(truth.box, answers[name])] if truth.scored else []
        observation, reward, _, over, info = env.step(answers["target"])
        assert reward == pytest.approx(float(info["scored"]))
    assert all(len(found) > 5 and min(found) == 1.0 for found in overlaps.values())
    env.close()


def test_the_robot_follows_one_and_is_handed_over_to_another():
    path_m = [[5.0, 2.2], [9.0, 2.6], [14.0, 6.0], [20.0, 7.0]]
    longer = {"duration_s": 10.0, "targets.0.path_m": path_m, "camera.rate_hz": 20.0}
    env = gym.make("pftrack_sim/Follow-v0", scenario=SEVERAL, overrides=longer, image=False)
    policy = policies.FollowPolicy(trackers.make("oracle"), controllers.make("servo-avoid"))
    observation, info = env.reset(seed=0)
    while info["time_s"] < 4.0:
        observation, *_, info = env.step(policy(observation, info))
    env.unwrapped.switch_target("lea")
    before_m = info["targets"]["lea"].distance_m
    bearings_rad: list[float] = []
    while info.get("outcome") is None:
        observation, *_, info = env.step(policy(observation, info))
        bearings_rad.append(abs(info["bearing_rad"]))
        assert info["truth"] is info["targets"]["lea"]
        assert set(info["targets"]) == {"target", "lea", "distractor-1"}
    assert info["outcome"] == "finished"
    assert np.median(bearings_rad) < 0.1
    assert info["distance_m"] < before_m
    env.close()


def test_who_is_no_target_and_what_is_not_told_are_errors():
    env = gym.make("pftrack_sim/Track-v0", scenario=SEVERAL, image=False)
    observation, info = env.reset(seed=0)
    with pytest.raises(UnknownNameError, match="unknown target 'distractor-2'"):
        policies.TrackingPolicy(trackers.make("oracle"), target="distractor-2")(observation, info)
    with pytest.raises(TrackerError, match=r"'lea', call the policy with \(observation, info\)"):
        policies.TrackingPolicy(trackers.make("oracle"), target="lea")(observation)
    assert isinstance(env.unwrapped, CameraEnv)
    env.close()


def test_a_run_scores_each_under_its_name(tmp_path: Path):
    size = {"camera.width_px": 96, "camera.height_px": 72, "lights.shadows": False, "duration_s": 1.0}
    plan = make_plan(["corridor", SEVERAL], ["oracle", "stay"], [0], overrides=size)
    store = run(plan, tmp_path / "run", videos="none", workers=1)
    results = {(one.scenario, one.condition.name, one.label): one.values for one in store.results}
    conditions = [("corridor", "base"), ("custom", "base"), ("custom", "lea base"), ("custom", "distractor-1 base")]
    assert list(results) == [(*one, label) for one in conditions for label in ("oracle", "stay")]
    overlaps = {one: results[*one, "oracle"]["mean_overlap"] for one in conditions}
    assert overlaps["custom", "lea base"] == overlaps["custom", "base"] == 1.0
    assert results["custom", "lea base", "stay"]["mean_overlap"] != results["custom", "base", "stay"]["mean_overlap"]
    digests = {results[*one, "stay"]["frames_digest"] for one in conditions[1:]}
    assert len(digests) == 1
    chosen = make_plan([SEVERAL], ["stay"], [0], overrides={"tracked": "lea"})
    assert [one.condition.name for one in chosen.episodes()] == ["base"]


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "two of one name": ({"targets.1": LEA}, "targets.1.name: 'lea' is the name of somebody else: choose another"),
    "a look-alike's": ({"targets.0.name": "distractor-7"}, "'distractor-7' is the name of somebody else"),
    "the target's": ({"targets.0.name": "target"}, "'target' is the name of somebody else"),
    "nobody's": ({"targets.1.name": "distractor-5"}, "unknown person without a path_m 'distractor-5'; did you mean"),
    "of a folder": ({"targets.0.name": "a/b"}, "targets.0.name: got 'a/b': string should match"),
    "about nobody": ({"tracked": "lee"}, "tracked: unknown person 'lee'; did you mean 'lea'"),
    "a speed without a path": ({"targets.1.speed_m_s": 1.0}, "has no path_m: it is somebody who is there"),
    "one point": ({"targets.0.path_m": [[3.0, 0.0]]}, "path_m must have at least 2 different points, got 1"),
    "a seat": ({"targets.0.actions": [{"kind": "sit", "at_s": 1.0}]}, "a further target has no seat to sit on"),
    "hands full": (
        {"targets.0.actions": [{"kind": "bend", "at_s": 1.0, "picks_up": "bag"}]},
        "picks up 'bag': it must be in carries",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_mistakes_are_told_when_the_scenario_is_read(what: str):
    change, words = WRONG[what]
    with pytest.raises(ScenarioError) as error:
        scenario.load(SEVERAL, change)
    assert words in str(error.value)


IMPOSSIBLE: dict[str, tuple[dict[str, Any], str]] = {
    "a thing of the place": ({"targets.0.name": "robot"}, "targets: 'robot' names a thing there"),
    "out of the place": ({"targets.0.path_m": [[5.0, 2.0], [9.0, 90.0]]}, "targets.0.path_m: lea would"),
    "into the target": ({"targets.0.path_m": [[3.0, 0.1], [9.0, 0.5]]}, "comes within 0.10 m of the target at"),
    "too short": ({"targets.0.actions": [{"kind": "approach", "at_s": 0.5}]}, "lea.actions.0 (approach, 0.5"),
}


@pytest.mark.parametrize("what", IMPOSSIBLE)
def test_what_cannot_be_in_the_place_is_told_before_anything_is_drawn(what: str):
    change, words = IMPOSSIBLE[what]
    with Simulation(scenario.load(SEVERAL, change), image=False) as simulation, pytest.raises(ScenarioError) as error:
        simulation.reset(0)
    assert words in str(error.value)
