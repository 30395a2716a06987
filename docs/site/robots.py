"""Scenarios of robots of `example-robot-data` (pip install example-robot-data), and the picture of docs/your-robot.md.

    python docs/site/robots.py [FOLDER]

writes `runs/robots/NAME.toml` and `docs/pictures/robots.webp`; FOLDER is the package's `robots`, if it is elsewhere.
"""

from __future__ import annotations

import sys
import sysconfig
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import tomli_w

from pftrack_sim import scenario
from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.render.renderer import open_renderer
from pftrack_sim.simulation.simulation import Simulation

ROBOTS: dict[str, dict[str, Any]] = {
    "tiago": {
        "robot": {
            "model": "tiago_description/robots/tiago.urdf",
            "drive": "differential",
            "wheels": ["wheel_left_joint", "wheel_right_joint"],
            "camera_site": "xtion_rgb_optical_frame",
            "pose_deg": {
                "arm_1_joint": 11.5,
                "arm_2_joint": -76.8,
                "arm_3_joint": -11.5,
                "arm_4_joint": 111.2,
                "arm_5_joint": -90.0,
                "arm_6_joint": 78.5,
            },
        }
    },
    "pr2": {
        "robot": {
            "model": "pr2_description/urdf/pr2.urdf",
            "drive": "omni",
            "camera_site": "high_def_optical_frame",
            "pose_deg": {
                **{f"{side}_shoulder_lift_joint": 60.0 for side in "lr"},
                **{f"{side}_elbow_flex_joint": -115.0 for side in "lr"},
                "l_shoulder_pan_joint": 30.0,
                "r_shoulder_pan_joint": -30.0,
            },
        }
    },
    "anymal": {
        "robot": {
            "model": "anymal_c_simple_description/urdf/anymal.urdf",
            "drive": "omni",
            "camera_site": "wide_angle_camera_front_camera",
            # "standing" in its SRDF.
            "pose_deg": {
                **{f"{leg}_HAA": -5.7 if leg[0] == "L" else 5.7 for leg in ("LF", "RF", "LH", "RH")},
                **{f"{leg}_HFE": 40.1 if leg[1] == "F" else -40.1 for leg in ("LF", "RF", "LH", "RH")},
                **{f"{leg}_KFE": -57.3 if leg[1] == "F" else 57.3 for leg in ("LF", "RF", "LH", "RH")},
            },
        },
        "camera": {"fovy_deg": 70.0},
    },
    "a1": {
        "robot": {
            "model": "a1_description/urdf/a1.urdf",
            "drive": "omni",
            # It has no camera: this one is inside its body, 0.26 m above the ground.
            "camera_site": "trunk",
            "pose_deg": {
                **{f"{leg}_thigh_joint": 45.8 for leg in ("FL", "FR", "RL", "RR")},
                **{f"{leg}_calf_joint": -103.7 for leg in ("FL", "FR", "RL", "RR")},
            },
        },
        "camera": {"fovy_deg": 70.0},
    },
}
PICTURE = Path("docs/pictures/robots.webp")
SHOWN = ("tiago", "pr2", "anymal")
SIZE = (400, 300)
_QUALITY = 35


def main(folder: Path) -> None:
    """Write the scenarios and the picture: each robot from outside, and below it what it sees."""
    out = Path("runs/robots")
    out.mkdir(parents=True, exist_ok=True)
    columns = []
    for name, tree in ROBOTS.items():
        own = {**tree["robot"], "model": str(folder / tree["robot"]["model"])}
        file = out / f"{name}.toml"
        file.write_text(tomli_w.dumps({"extends": "follow/plaza", **tree, "robot": own}), encoding="utf-8")
        if name in SHOWN:
            columns.append(views(file))
    sheet = np.concatenate(columns, axis=1)
    cv2.imwrite(str(PICTURE), sheet[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
    print(f"written: {PICTURE} ({sheet.shape[1]} x {sheet.shape[0]}), {out}/*.toml")


def views(file: Path) -> np.ndarray:
    """`(2 H, W, 3)` a robot from outside, and what it sees."""
    size = {"camera.width_px": SIZE[0], "camera.height_px": SIZE[1]}
    with Simulation(scenario.load(file, {**size, "jitter": {}})) as simulation:
        simulation.reset(0)
        for _ in range(45):
            frame = simulation.advance()
        world = simulation.world
        x, y, heading = world.robot_pose()
        eye = np.array([x, y, 1.5]) + 2.6 * np.array([np.cos(heading - 0.9), np.sin(heading - 0.9), 0.0])
        forward = np.array([x, y, 0.62]) - eye
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        pose = np.eye(4)
        pose[:3] = np.column_stack([right, np.cross(forward, right), forward, eye])
        with open_renderer(world.model, *SIZE) as renderer:
            outside = renderer.color(world.data, pose, intrinsics(*SIZE, np.deg2rad(42.0)))
        return np.concatenate([outside, frame.image])


if __name__ == "__main__":
    purelib = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else purelib)
