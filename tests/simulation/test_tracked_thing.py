"""Targets that are things: how they move, what is told of them, and what is refused."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from room_files import write_toy

from pftrack_sim import scenario
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.scene.thing import half_sizes_m
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.simulation.world import World

BASE: dict[str, Any] = {"duration_s": 6, "lights.shadows": False, "occluders": []}


def world(name: str, overrides: dict[str, Any] | None = None, seed: int = 2) -> World:
    return World(scenario.load(f"objects/{name}", {**BASE, **(overrides or {})}).resolve(seed), seed, draws=False)


def pose(simulated: World) -> tuple[np.ndarray, np.ndarray]:
    body = simulated.model.body("target/body").id
    return simulated.data.xpos[body].copy(), simulated.data.xmat[body].reshape(3, 3).copy()


def test_a_ball_rolls_without_slipping():
    simulated = world("ball", {"target.actions": [], "target.path_m": [[2.5, 1.7], [12.0, 1.7]]})
    turned, way, (place, rotation) = 0.0, 0.0, pose(simulated)
    for _ in range(40):
        simulated.advance()
        last_place, last_rotation, (place, rotation) = place, rotation, pose(simulated)
        step = rotation @ last_rotation.T
        axis = np.array([step[2, 1] - step[1, 2], step[0, 2] - step[2, 0], step[1, 0] - step[0, 1]])
        way += float(np.hypot(*(place - last_place)[:2]))
        turned += float(np.arctan2(np.linalg.norm(axis), np.trace(step) - 1.0))
        assert axis[1] > 0.0, "its top moves forward, which is +x"
        assert place[2] == pytest.approx(0.11)
    assert way > 1.0
    assert turned == pytest.approx(way / 0.11, rel=1e-6)


def test_a_toy_car_faces_along_its_path_and_drives_back_without_turning():
    back = {"kind": "approach", "at_s": 0.5, "distance_m": 0.6, "speed_m_s": 0.8}
    simulated = world("car", {"target.actions": [back]})
    headings, speeds = [], []
    for _ in range(100):
        before = pose(simulated)[0]
        simulated.advance()
        place, rotation = pose(simulated)
        headings.append(np.arctan2(rotation[1, 0], rotation[0, 0]))
        speeds.append(float(rotation[:, 0] @ (place - before)))
        assert rotation[2, 2] == pytest.approx(1.0)
    assert min(speeds) < -0.01 < 0.01 < max(speeds)
    assert np.abs(np.diff(headings)).max() < 0.1


@pytest.mark.parametrize("name", ["juice", "cube", "panda"])
def test_what_is_carried_stays_before_its_bearer_and_is_turned_as_far_as_asked(name: str):
    simulated = world(name, {"target.actions": [], "target.thing.turn_deg": 60, "target.thing.turn_s": 2.0})
    turns = []
    for _ in range(60):
        simulated.advance()
        place, rotation = pose(simulated)
        bearer = simulated.traffic.gait.root_poses[0]
        ahead, aside, _ = (place - bearer[:3, 3]) @ bearer[:3, :3]
        assert 0.3 < ahead < 0.8
        assert abs(aside) < 0.15
        assert 0.8 < place[2] < 1.3
        assert np.hypot(*(np.array(simulated.traffic.crowd.tracked_m) - place[:2])) < 0.2
        forward = rotation.T @ bearer[:3, 0]
        turns.append(np.degrees(np.arctan2(-forward[1], forward[0])))
    assert max(turns) == pytest.approx(60, abs=8)
    assert min(turns) == pytest.approx(-60, abs=8)


def test_the_bearer_is_a_person_of_its_own_and_no_bystander():
    with Simulation(scenario.load("objects/cube", {**BASE, "distractors.count": 0}), image=False) as simulation:
        frame = simulation.reset(2)
        assert [one.name for one in frame.people] == ["target", "bearer"]
        target, bearer = frame.people
        assert target.amodal_box[3] < 0.4 * bearer.amodal_box[3]
        assert 1.0 < target.distance_m < 3.5
        assert simulation.world.bystander_m("target") == np.inf
        root = target.T_world_target
        assert root[2, 3] == 0.0
        assert root[2, 2] == 1.0


def test_a_thing_that_moves_by_itself_has_no_bearer_and_the_robot_collides_with_it():
    simulated = world("ball", {"distractors.count": 0})
    assert simulated.people == ("target",)
    model = simulated.model
    bumper = model.geom("target/body/bumper")
    np.testing.assert_allclose(bumper.size, half_sizes_m(simulated.settings.target.thing))
    tyre = model.geom("robot/tyre-left")
    assert int(bumper.contype[0]) & int(tyre.conaffinity[0]) or int(bumper.conaffinity[0]) & int(tyre.contype[0])
    assert mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "target/pelvis") < 0


@pytest.mark.parametrize("prop", ["car", "ball", "vending-machine", "plain-ball"])
def test_any_prop_is_scaled_to_the_height_asked_for(prop: str):
    simulated = world("car", {"target.thing.prop": prop, "target.thing.height_m": 0.4})
    thing = simulated.settings.target.thing
    assert thing is not None
    assert half_sizes_m(thing)[2] == pytest.approx(0.2)


def test_a_thing_may_be_a_file_of_meshes(tmp_path: Path):
    toy = {"target.thing.model": str(write_toy(tmp_path)), "target.thing.height_m": 0.3, "target.actions": []}
    loaded = scenario.load("objects/car", {**BASE, **toy})
    thing = loaded.resolve(2).target.thing
    assert thing is not None
    assert thing.name == "toy"
    assert half_sizes_m(thing) == pytest.approx([0.3, 0.15, 0.15])
    with Simulation(loaded) as simulation:
        frame = simulation.reset(2)
    x, y, width, height = frame.truth.box
    patch = frame.image[int(y) : int(y + height), int(x) : int(x + width)].astype(int)
    red, blue = (patch[..., one] - patch[..., other] > 60 for one, other in ((0, 2), (2, 0)))
    assert red.mean() > 0.2
    assert blue.mean() > 0.02
    assert np.nonzero(blue)[0].mean() < np.nonzero(red)[0].mean(), "its cabin is on top"


WRONG: list[tuple[str, dict[str, Any], str]] = [
    ("ball", {"target.thing.prop": "bal"}, "unknown prop 'bal'; did you mean 'ball'"),
    ("car", {"target.thing.surface": "paint-blu"}, "unknown surface 'paint-blu'; did you mean 'paint-blue'"),
    ("ball", {"target.thing.height_m": 9}, "target.thing.height_m"),
    ("ball", {"target.thing.heigth_m": 0.2}, "did you mean 'height_m'"),
    ("ball", {"target.thing.moves": "flies"}, "target.thing.moves"),
    ("ball", {"target.init": "torso"}, "needs a person, and the target is a thing ('football')"),
    ("ball", {"target.actions": [{"kind": "crouch", "at_s": 1}]}, "needs legs, and 'football' is rolling"),
    ("cube", {"target.actions": [{"kind": "wave", "at_s": 1}]}, "needs free hands, and 'cube' is carried"),
    ("cube", {"target.carries": [{"item": "bag"}]}, "carries nothing"),
    ("car", {"target.thing.model": "no.glb"}, "target.thing.model: no such file"),
    ("car", {"target.thing.model": __file__}, "not of a kind that is read (.gltf, .glb, .obj, .ply, .stl)"),
    ("car", {"target.thing": {"height_m": 0.3}}, "needs prop, the name of a prop, or model, a file of meshes"),
]


@pytest.mark.parametrize(("name", "overrides", "message"), WRONG)
def test_what_is_impossible_is_refused(name: str, overrides: dict[str, Any], message: str):
    with pytest.raises(ScenarioError) as caught:
        world(name, overrides)
    assert message in str(caught.value)
