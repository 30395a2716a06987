"""Files written for tests: a map, an MJCF scene and a GLB of the same room of 8 m x 6 m with a table; and a toy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import trimesh

TABLE = (1.0, 0.5, 0.8)  # Middle x, y and half width [m]; 0.9 m high
WALLS = [((0, 3, 1.3), (4, 0.1, 1.3)), ((0, -3, 1.3), (4, 0.1, 1.3)), ((4, 0, 1.3), (0.1, 3.1, 1.3)),
         ((-4, 0, 1.3), (0.1, 3.1, 1.3))]  # fmt: skip


def write_map(folder: Path, yaw_rad: float = 0.0, **changes: Any) -> Path:
    """A room between walls; around it all is unknown."""
    image = np.full((180, 220), 205, np.uint8)
    image[28:152, 28:192] = 0
    image[30:150, 30:190] = 254
    x, y, half = TABLE
    row, column, size = int(90 - 20 * y), int(110 + 20 * x), int(20 * half)
    image[row - size : row + size, column - size : column + size] = 0
    cv2.imwrite(str(folder / "map.pgm"), image)
    keys = {"image": "map.pgm", "resolution": 0.05, "origin": f"[-5.5, -4.5, {yaw_rad}]", "negate": 0,
            "occupied_thresh": 0.65, "free_thresh": 0.196}  # fmt: skip
    text = "".join(f"{key}: {value}\n" for key, value in {**keys, **changes}.items())
    (folder / "map.yaml").write_text(text)
    return folder / "map.yaml"


def write_mjcf(folder: Path, floor_m: float = 0.4, more: str = "") -> Path:
    """The room on a floor at some height, with a door that swings, an actuator and a lamp."""
    x, y, half = TABLE
    walls = "".join(
        f'<geom name="wall-{k}" type="box" pos="{a} {b} {c + floor_m}" size="{i} {j} {h}" material="paint"/>'
        for k, ((a, b, c), (i, j, h)) in enumerate(WALLS)
    )
    (folder / "room.xml").write_text(f"""
<mujoco><asset><texture name="t" type="cube" builtin="checker" rgb1=".7 .5 .4" rgb2=".5 .6 .7" width="32" height="192"/>
<material name="paint" texture="t" texuniform="true" texrepeat="2 2"/></asset><worldbody>
<light pos="0 0 2.5" dir="0 0 -1" diffuse=".6 .6 .6"/>
<geom name="floor" type="plane" pos="0 0 {floor_m}" size="4 3 .1"/>{walls}
<body name="table" pos="{x} {y} {floor_m}"><geom type="box" pos="0 0 .45" size="{half} {half} .45"/></body>
<body name="lamp" pos="0 0 {floor_m + 2.3}"><geom type="sphere" size=".2" group="1"/></body>
<body name="door" pos="3.88 -2 {floor_m}"><joint name="hinge"/><geom type="box" pos="0 0 1" size=".02 .4 1" group="3"/>
</body>{more}</worldbody><actuator><motor joint="hinge"/></actuator></mujoco>""")
    return folder / "room.xml"


def write_glb(folder: Path, scale: float = 1.0, *, floor: bool = True) -> Path:
    """The room with y up, as glTF has it: one-sided walls that face inwards, and a textured table."""
    x, y, half = TABLE
    scene, up = trimesh.Scene(), trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0))
    table = trimesh.creation.box((2 * half, 2 * half, 0.9), trimesh.transformations.translation_matrix((x, y, 0.45)))
    parts = {"table": table}
    if floor:
        parts["floor"] = trimesh.creation.box((8, 6, 0.1), trimesh.transformations.translation_matrix((0, 0, -0.05)))
    for number, (middle, half_m) in enumerate(WALLS):
        wall = trimesh.creation.box(2.0 * np.array(half_m), trimesh.transformations.translation_matrix(middle))
        inwards = (wall.face_normals @ np.multiply(middle, (1, 1, 0))) < -0.5
        wall.update_faces(inwards)
        parts[f"wall {number}"] = wall
    for name, mesh in parts.items():
        mesh.visual = trimesh.visual.ColorVisuals(mesh, face_colors=(180, 120 if name == "table" else 180, 90, 255))
        mesh.apply_transform(up).apply_scale(scale)
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    (folder / "room.glb").write_bytes(scene.export(file_type="glb"))
    return folder / "room.glb"


WRITERS = {"map": write_map, "mjcf": write_mjcf, "mesh": write_glb}


def scenario_of(kind: str, model: Path, **place: Any) -> dict[str, Any]:
    """A target that walks behind the table, before a robot that stands."""
    return {
        "title": "own room",
        "duration_s": 4.0,
        "place": {"kind": kind, "model": str(model), **place},
        "robot": {"route": {"kind": "still", "start_m": [-2.8, -1.5], "heading_deg": 20}},
        "camera": {"width_px": 320, "height_px": 240, "rate_hz": 30},
        "lights": {"shadows": False},
        "target": {"path_m": [[1.9, -2.0], [2.5, -1.0], [2.5, 2.0]], "speed_m_s": 0.8},
        "distractors": {"count": 0},
    }


def write_toy(folder: Path) -> Path:
    """A red block with a blue cabin, as long as 2, as wide as 1 and as high as 1 unit, y up."""
    block, cabin = trimesh.creation.box((2.0, 0.6, 1.0)), trimesh.creation.box((0.8, 0.4, 0.8))
    cabin.apply_translation((-0.2, 0.5, 0.0))
    for mesh, colour in ((block, [200, 30, 30, 255]), (cabin, [30, 30, 200, 255])):
        mesh.visual = trimesh.visual.ColorVisuals(mesh, face_colors=[colour] * 12)
    trimesh.Scene([block, cabin]).export(folder / "toy.glb")
    return folder / "toy.glb"
