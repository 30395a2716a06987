"""Recorded motion of a base: the camera, the robot's own parts and its IMU move as recorded."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pftrack_sim import scenario
from pftrack_sim.agents.robot.motion import rotation_of
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.core.proprioception import PROPRIO_INDEX
from pftrack_sim.scene.layout import body_owners
from pftrack_sim.simulation.simulation import Simulation

HEAD = "time_s,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg\n"
TIMES_S = np.arange(0.0, 20.0, 0.01)
WAY = np.stack([0.5 * TIMES_S, 0.0 * TIMES_S, 0.3 + 0.0 * TIMES_S], axis=1)
HEADING_RAD = 0.5


def swing(size: float, hz: float) -> np.ndarray:
    return size * np.sin(2.0 * np.pi * hz * TIMES_S)


# The robot walks 0.5 m/s in a direction; x of the shaking is along its heading.
SHAKEN = {"x": swing(0.01, 4.0), "z": swing(0.02, 2.0), "roll": swing(0.05, 2.0), "pitch": 0.1 + swing(0.03, 3.0)}


def recording(path: Path, form: str = "degrees") -> str:
    cos, sin = np.cos(HEADING_RAD), np.sin(HEADING_RAD)
    along = 0.5 * TIMES_S + SHAKEN["x"]
    places = np.stack([cos * along, sin * along, 0.3 + SHAKEN["z"]], axis=1)
    angles = np.stack([SHAKEN["roll"], SHAKEN["pitch"], np.full_like(TIMES_S, HEADING_RAD)], axis=1)
    quaternions = Rotation.from_matrix(rotation_of(angles)).as_quat(scalar_first=True)
    head, columns = {
        "degrees": ("time_s,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg", [TIMES_S + 7.0, places, np.degrees(angles)]),
        "radians": ("time_s,x_m,y_m,z_m,roll_rad,pitch_rad,yaw_rad", [TIMES_S, places, angles]),
        "quaternions": ("time_s, x_m, y_m, z_m, qw, qx, qy, qz", [TIMES_S - 3.0, places, quaternions]),
    }[form]
    rows = np.column_stack(columns)
    with path.open("w") as file:
        file.write(head + "\n")
        np.savetxt(file, rows, delimiter=",", fmt="%.12g")
    return str(path)


def episode(frames: int, **robot: Any) -> list[tuple[Any, ...]]:
    """Truth, proprioception, robot's pose and places of its geoms."""
    overrides = {f"robot.{key}": value for key, value in robot.items()}
    size = {"camera.width_px": 160, "camera.height_px": 120, "lights.shadows": False}
    with Simulation(scenario.load("plaza-walk", size | overrides), image=False) as simulation:
        simulation.reset(3)
        world, found = simulation.world, []
        own = np.array([one == "robot" for one in body_owners(world.model)])[world.model.geom_bodyid]
        own &= world.model.geom_group < 3
        for _ in range(frames):
            truth = simulation.advance().truth
            found.append((truth, world.proprio(), world.robot_pose(), world.data.geom_xpos[own].copy()))
    return found


@pytest.mark.parametrize("form", ["degrees", "radians", "quaternions"])
def test_camera_and_robot_move_as_recorded_without_the_way(tmp_path: Path, form: str):
    still, moved = episode(60), episode(60, motion=recording(tmp_path / "walk.csv", form))
    for (one, _, pose, places), (two, _, _, shaken) in zip(still, moved, strict=True):
        time_s = one.time_s
        at = {name: np.interp(time_s, TIMES_S, values) for name, values in SHAKEN.items()}
        motion, base = np.eye(4), np.eye(4)
        motion[:3, :3] = rotation_of(np.array([at["roll"], at["pitch"], 0.0]))
        motion[:3, 3] = at["x"], 0.0, at["z"]
        base[:3, :3], base[:2, 3] = rotation_of(np.array([0.0, 0.0, pose[2]])), pose[:2]
        wanted = base @ motion @ np.linalg.inv(base)
        if time_s > 0.5:  # the first half second has no second around it
            assert np.abs(two.T_world_camera - wanted @ one.T_world_camera).max() < 2e-3
        found = two.T_world_camera @ np.linalg.inv(one.T_world_camera)
        assert np.abs(places @ found[:3, :3].T + found[:3, 3] - shaken).max() < 1e-6
        assert one.T_world_target == pytest.approx(two.T_world_target)


def test_the_imu_feels_it(tmp_path: Path):
    still, moved = episode(90), episode(90, motion=recording(tmp_path / "walk.csv"))
    felt, rest = (np.array([proprio for _, proprio, *_ in one]) for one in (moved, still))
    gyro = [PROPRIO_INDEX[f"gyro_{axis}_rad_s"] for axis in "xy"]
    # Amplitude times 2 pi f over the square root of 2.
    spread = (felt - rest)[15:, gyro].std(axis=0)
    assert spread == pytest.approx(2 * np.pi * np.array([0.05 * 2.0, 0.03 * 3.0]) / np.sqrt(2), rel=0.12)
    up = PROPRIO_INDEX["accelerometer_z_m_s2"]
    assert (felt - rest)[15:, up].std() == pytest.approx(0.02 * (4.0 * np.pi) ** 2 / np.sqrt(2.0), rel=0.15)
    others = np.setdiff1d(
        np.arange(felt.shape[1]), [PROPRIO_INDEX[n] for n in PROPRIO_INDEX if "gyro" in n or "acc" in n]
    )
    assert np.array_equal(felt[:, others], rest[:, others])


def test_boxes_are_those_that_the_shaken_camera_sees(tmp_path: Path):
    moved = episode(20, motion=recording(tmp_path / "walk.csv"))
    for truth, *_ in moved:
        middle = truth.T_world_target[:3, 3] + (0.0, 0.0, 0.9)
        local = truth.T_world_camera[:3, :3].T @ (middle - truth.T_world_camera[:3, 3])
        x, y = (truth.K @ local)[:2] / local[2]
        left, top, width, height = truth.amodal_box
        assert left < x < left + width
        assert top + 0.3 * height < y < top + 0.7 * height


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,x_m,y_m\n0,0,0\n", "needs columns time_s"),
        ("", "needs columns time_s"),
        ("time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n0.1,0,0,0,2,0,0,0\n", "length 1, got 2"),
        (f"{HEAD}0,0,0,0,1,0,0\n0,0,0,0,2,0,0\n", "times that rise"),
        (f"{HEAD}0,0,0,0,1,0,0\n1,0,0,0,2,0,0\n", "up to 0.2 s a row"),
        (f"{HEAD}0,0,0,0,1,0,a\n", "all of numbers"),
        (f"{HEAD}0,0,0,0,1,0,nan\n0.1,0,0,0,2,0,0\n", "finite numbers"),
    ],
)
def test_what_is_no_recording_is_said(tmp_path: Path, text: str, said: str):
    (tmp_path / "walk.csv").write_text(text)
    with pytest.raises(ScenarioError, match=f"robot.motion: .*{said}"):
        episode(1, motion=str(tmp_path / "walk.csv"))
    with pytest.raises(ScenarioError, match=r"robot\.motion: no such file"):
        scenario.load("plaza-walk", {"robot.motion": str(tmp_path / "none.csv")})
