import math
from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from pftrack_sim.agents.robot.drive import camera_pose
from pftrack_sim.scenario.robot import Robot, StillRoute
from pftrack_sim.scene.layout import HIDDEN_ROBOT_GROUP, ROBOT_GROUP
from pftrack_sim.scene.robot_file.motorised import GRAVITY_M_S2, mast_of
from pftrack_sim.scene.robot_file.roles import Roles

MOUNTS = ("mount-left", "mount-right", "caster-front", "caster-rear")


@pytest.mark.parametrize("degree", [True, False])
@pytest.mark.parametrize(
    ("height_m", "tilt_deg", "mount"),
    [(0.3, 0.0, "front"), (1.25, 0.0, "left"), (1.25, -30.0, "right"), (1.6, 20.0, "front"), (3.0, 0.0, "left")],
)
def test_robot_at_rest_is_level_with_the_camera_at_its_height(lab: Callable, height_m, tilt_deg, mount, degree):
    world = lab(height_m=height_m, tilt_deg=tilt_deg, mount=mount, degree=degree)
    rest = world.run(2.0)
    assert np.abs(rest[:, 5] - height_m).max() < 0.01
    assert np.ptp(rest[:, 5]) < 1e-5  # starts at equilibrium
    assert np.abs(rest[:, 6] - math.radians(tilt_deg)).max() < math.radians(0.2)
    assert np.abs(rest[:, 7]).max() < math.radians(0.2)
    up = world.data.body("robot/base").xmat.reshape(3, 3)[:, 2]
    assert math.acos(min(1.0, up[2])) < math.radians(0.1)
    yaw = {"front": 0.0, "left": math.pi / 2, "right": -math.pi / 2}[mount]
    forward = camera_pose(world.model, world.data)[:3, 2]
    assert abs(math.atan2(forward[1], forward[0]) - yaw) < 1e-3


@pytest.mark.parametrize("steps", [9, 16])
def test_robot_stays_upright_under_random_commands(lab: Callable, steps: int):
    world = lab(steps=steps)
    rng = np.random.default_rng(4)
    for _ in range(120):
        rows = world.run(0.5, **dict(zip(("forward", "turn", "pan", "tilt"), rng.uniform(-3, 3, 4), strict=True)))
        assert np.isfinite(rows).all()
        assert world.data.body("robot/base").xmat[8] > math.cos(math.radians(6.0))
        assert np.abs(world.data.qvel[:2]).max() < 2.0
        assert np.abs(rows[:, 5] - 1.25).max() < 0.1
    assert not world.data.warning.number.any()


def test_robot_with_a_tall_mast_stays_upright_in_hard_turns(lab: Callable):
    world = lab(height_m=3.0)
    for turn in (1.6, -1.6, 1.6, -1.6):
        world.run(1.5, forward=1.6, turn=turn)
        world.run(0.5, forward=-1.6)
    assert world.data.body("robot/base").xmat[8] > math.cos(math.radians(10.0))


def test_robot_geoms_collide_only_with_scenery_and_people(lab: Callable):
    model = lab().model
    on_robot = np.array([model.body(body).name.startswith("robot/") for body in model.geom_bodyid])
    colliding = model.geom_contype != 0
    assert (model.geom_contype[on_robot & colliding] == 2).all()
    assert (model.geom_conaffinity[on_robot & colliding] == 5).all()
    assert set(model.geom_group[on_robot]) == {ROBOT_GROUP, HIDDEN_ROBOT_GROUP}
    assert (model.geom_conaffinity[on_robot & ~colliding] == 0).all()


@pytest.mark.parametrize("mount", ["front", "left", "right"])
@pytest.mark.parametrize(("fovy_deg", "tilt_deg"), [(50.0, 0.0), (100.0, 0.0), (50.0, -45.0), (50.0, 45.0)])
def test_robot_is_out_of_the_camera_s_view_at_rest(lab: Callable, mount, fovy_deg, tilt_deg):
    world = lab(mount=mount, fovy_deg=fovy_deg, tilt_deg=tilt_deg)
    model, data = world.model, world.data
    T = camera_pose(world.model, data)
    half = math.tan(math.radians(fovy_deg) / 2)
    visible_groups = np.zeros(6, dtype=np.uint8)
    visible_groups[[0, ROBOT_GROUP]] = 1
    hit = np.zeros(1, dtype=np.int32)
    for u in np.linspace(-4 / 3, 4 / 3, 41) * half:
        for v in np.linspace(-1, 1, 31) * half:
            ray = T[:3, :3] @ np.array([u, v, 1.0])
            mujoco.mj_ray(model, data, T[:3, 3], ray, visible_groups, 1, -1, hit)
            owner = model.body(model.geom_bodyid[hit[0]]).name if hit[0] >= 0 else "none"
            assert not owner.startswith("robot/"), owner


@pytest.mark.parametrize("height_m", [0.6, 1.25])
def test_what_the_file_says_of_the_mast_is_what_is_compiled(lab: Callable, height_m: float):
    model = lab(height_m=height_m).model
    mast = mast_of(Roles.of(Robot(route=StillRoute(kind="still"))))
    pole_kg = mast.kg_m * mast.length_m(height_m, 0.0)
    base, pan = (model.body(f"robot/{name}") for name in ("base", "pan"))
    unsprung = sum(model.body(f"robot/{name}").subtreemass[0] for name in MOUNTS)
    assert mast.carried_kg(pole_kg) == pytest.approx(base.subtreemass[0] - unsprung, abs=1e-12)
    assert mast.head_kg == pan.subtreemass[0]
    assert pan.pos[2] == mast.length_m(height_m, 0.0)
    assert -model.opt.gravity[2] == GRAVITY_M_S2


@pytest.mark.parametrize(("height_m", "geoms"), [(0.7, 1), (1.25, 3)])
def test_short_masts_have_no_pole_and_no_clamp(lab: Callable, height_m: float, geoms: int):
    shortest, model = lab(height_m=0.3).model, lab(height_m=height_m).model
    assert model.body("robot/mast").geomnum[0] - shortest.body("robot/mast").geomnum[0] == geoms
