"""Laws of sitting: seats stand where people sit down, and what cannot happen is said before the first frame."""

import mujoco
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scene.places.seats import SEAT_M
from pftrack_sim.simulation.world import World

BARE = {"camera.width_px": 32, "camera.height_px": 24, "lights.shadows": False, "distractors.count": 0}
SIT = {"kind": "sit", "at_s": 1.0, "duration_s": 8.0, "side": "right"}
HALL = {**BARE, "duration_s": 12.0, "target.actions": [SIT], "groups": []}


def lowest_m(world: World, part: str, person: str = "target") -> float:
    """Height of the lowest vertex of a part of a person."""
    model, data = world.model, world.data
    mujoco.mj_kinematics(model, data)
    heights = []
    for geom in np.flatnonzero(model.geom_bodyid == model.body(f"{person}/{part}").id).tolist():
        if model.geom_group[geom] == 1:
            mesh = int(model.geom_dataid[geom])
            first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            vertices: FloatArray = model.mesh_vert[first : first + count]
            heights.append((vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])[:, 2].min())
    return float(min(heights))


@pytest.mark.parametrize("height_m", [1.5, pytest.param(2.0, marks=pytest.mark.slow)])
def test_the_target_sits_on_its_bench_with_its_feet_on_the_ground_and_rises(height_m: float):
    world = World(scenario.load("hall", {**HALL, "target.height_m": height_m}).resolve(0), 0)
    walked: list[float] = []
    for _ in range(int(9.5 * 30)):
        world.advance()
        walked.append(world.traffic.crowd.target_s_m)
        if len(walked) == 150:
            assert SEAT_M - 0.025 < lowest_m(world, "pelvis") < SEAT_M + 0.05
            for part in ("left-foot", "right-foot"):
                assert abs(lowest_m(world, part)) < 0.01
            seat = world.data.body("seat-1").xpos[:2]
            assert np.hypot(*(seat - world.root_poses()[0, :2, 3])) < 0.1
    assert np.ptp(walked[110:260]) == 0.0
    assert walked[-1] > walked[200]
    assert lowest_m(world, "pelvis") > 0.65


@pytest.mark.slow
def test_people_of_a_group_sit_on_their_bench():
    bench = {"kind": "sit", "at_m": [15.0, -4.1], "heading_deg": 90.0}
    world = World(scenario.load("hall", {**HALL, "target.actions": [], "groups": [bench]}).resolve(0), 0)
    for person in ("member-1", "member-2"):
        assert abs(lowest_m(world, "pelvis", person) - SEAT_M) < 0.06


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"target.actions": [SIT], "robot.route.offset_m": -0.6}, "the robot would run into 'seat-1'"),
        ({"groups": [{"kind": "stand", "at_m": [6.0, 0.4]}]}, "groups.0: comes within"),
        ({"groups": [{"kind": "sit", "at_m": [10.0, 6.2]}]}, "no room"),
    ],
)  # fmt: skip
def test_what_cannot_happen_is_said_before_the_first_frame(changes: dict[str, object], message: str):
    with pytest.raises(ScenarioError, match=message):
        World(scenario.load("hall", {**HALL, "target.actions": [], **changes}).resolve(0), 0)
