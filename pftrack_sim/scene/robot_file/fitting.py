"""A robot of a file on a base of its own: rigid but for the joints of its head and its wheels, standing on the ground.

The base slides along x and y and turns, by strong velocity servos (`assets/planar_base.xml`). What else moves in the
file is held in the pose of its first keyframe, or at rest; masses, motors and sensors of the file are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from pftrack_sim.core.data_files import assets_dir
from pftrack_sim.core.errors import ParameterError
from pftrack_sim.core.types import BoolArray, FloatArray
from pftrack_sim.scene.compiled_model import colours, mesh_corners, quaternion, texture_image
from pftrack_sim.scene.layout import GROUND, HIDDEN_ROBOT_GROUP, ROBOT_GROUP
from pftrack_sim.scene.robot_file.reading import compile_file
from pftrack_sim.scene.robot_file.roles import (
    Hinge,
    Roles,
    ancestors,
    head_hinge,
    hinges_of,
    locate_camera,
    named_hinge,
    read_hinge,
    set_pose,
)
from pftrack_sim.scene.scene_spec import SceneSpec, mesh_file

_PAN, _TILT = ("pan", "pan"), ("head", "tilt")  # Body and joint of planar_base.xml
_WHEELS = ("wheel-left", "axle-left"), ("wheel-right", "axle-right")
_GEOM, _COLOUR = mujoco.mjtGeom, mujoco.mjtTextureRole.mjTEXROLE_RGB
_SHAPES = [
    int(getattr(_GEOM, f"mjGEOM_{name}")) for name in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")
]
_DRAWN_GROUPS = (0, 1, 2)  # As MuJoCo's own viewer shows them
_UP, _LEFT = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
_LOWEST_M, _HIGHEST_M = 0.05, 5.0
_LENS_M = 0.02  # What is this near to the optical centre is the camera's own housing, and not drawn
_PAN_RAD, _TILT_RAD = math.radians(200.0), math.radians(75.0)  # Either way, of a joint without limits
_WHEEL_M, _LEAST_WHEEL_M = 0.1, 0.01  # Radius of wheels that are not named, and the least one


@dataclass(frozen=True, eq=False)
class FittedRobot:
    """A robot of a file with its roles, in the frame of its base: x forward, z up, on the ground.

    Attributes:
        model: The file's model.
        positions_m: `(G, 3)` places of its geoms.
        rotations: `(G, 3, 3)` their rotations.
        owners: Names of the bodies of the base that its bodies belong to.
        drawn: `(G,)` geoms that are drawn.
        solid: `(G,)` geoms that collide.
        T_base_camera: `(4, 4)` pose of the camera at rest, OpenCV axes.
        camera_owner: Name of the body of the base that carries the camera.
        hinges: By names of the body and the joint of the base.
        radius_m: Of the circle around what collides.
        pans: Whether a joint of the file pans the camera.
        tilts: Whether one tilts it.
    """

    model: Any
    positions_m: FloatArray
    rotations: FloatArray
    owners: tuple[str, ...]
    drawn: BoolArray
    solid: BoolArray
    T_base_camera: FloatArray
    camera_owner: str
    hinges: dict[tuple[str, str], Hinge]
    radius_m: float
    pans: bool
    tilts: bool


@lru_cache(maxsize=4)
def fit(roles: Roles) -> FittedRobot:
    """Read a robot's file and find its roles.

    Raises:
        ParameterError: It cannot be read, has no camera, lacks a joint that is named, or is of an impossible size.
    """
    compiled, data = compile_file(roles.model)
    model: Any = compiled
    set_pose(model, data, roles.pose_deg)
    camera, pose = locate_camera(model, data, roles.camera_site, roles.camera_rpy_deg)
    turning = hinges_of(model)
    moving = [joint for body in ancestors(model, camera) for joint in turning if model.jnt_bodyid[joint] == body]
    pan = head_hinge(model, data, "robot.pan", roles.pan, moving, _UP)
    nearer = moving if pan is None else moving[: moving.index(pan)]
    tilt = head_hinge(model, data, "robot.tilt", roles.tilt, nearer, pose[:3, 0])
    wheels = [named_hinge(model, "robot.wheels", name, turning) for name in roles.wheels or ()]
    wheels.sort(key=lambda joint: -float(data.xanchor[joint, 1]))
    drawn, solid = _shown(model)
    below, above = (float(one) for one in _supports(model, data, drawn | solid, np.stack([-_UP, _UP])))
    if not _LOWEST_M <= below + above <= _HIGHEST_M:
        unit = "millimetres" if below + above > _HIGHEST_M else "kilometres"
        raise ParameterError(
            f"{roles.model}: the robot is {below + above:.3g} m high, allowed are {_LOWEST_M:g} to {_HIGHEST_M:g} m: "
            f"are its numbers {unit}? Give positions and sizes in metres, and meshes a scale ('0.001 0.001 0.001')"
        )
    roots = np.flatnonzero(model.body_parentid[1:] == 0) + 1
    middle = data.xanchor[wheels].mean(axis=0) if wheels else data.xpos[roots].mean(axis=0)
    origin = np.array([middle[0], middle[1], -below])
    around = np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False)
    sides = np.stack([np.cos(around), np.sin(around), np.zeros(32)], axis=1)
    radius_m = float((_supports(model, data, solid, sides) - sides @ origin).max())
    drawn &= ~_housing(model, data, pose[:3, 3])
    pose[:3, 3] -= origin
    ahead = pose[:3, 2]
    azimuth, elevation = math.atan2(ahead[1], ahead[0]), math.asin(max(-1.0, min(1.0, float(ahead[2]))))
    turns = pan is None and roles.drive in ("planar", "omni")
    pan_hinge = read_hinge(model, data, pan, _UP, azimuth, _PAN_RAD, origin)
    if turns:
        pan_hinge = pan_hinge._replace(range_rad=(azimuth - _PAN_RAD, azimuth + _PAN_RAD))
    hinges = {_PAN: pan_hinge, _TILT: read_hinge(model, data, tilt, pose[:3, 0], elevation, _TILT_RAD, origin)}
    for names, joint, side in zip(_WHEELS, wheels or (None, None), (1.0, -1.0), strict=True):
        hinges[names] = read_hinge(model, data, joint, _LEFT, 0.0, 0.0, origin)
        if joint is None:
            hinges[names] = hinges[names]._replace(anchor_m=np.array([0.0, side * radius_m, _WHEEL_M]))
    left, right = (hinges[names].anchor_m.tolist() for names in _WHEELS)
    if min(left[2], left[1] - right[1]) < _LEAST_WHEEL_M:
        raise ParameterError(
            f"robot.wheels: {roles.wheels} are {left[2]:.3g} m above the ground and {left[1] - right[1]:.3g} m apart: "
            "the joints of a left and a right wheel are needed"
        )
    moved = {hinge.body: body for (body, joint), hinge in hinges.items() if not turns or (body, joint) not in _WHEELS}
    hull = "pan" if turns else "base"
    owners = [next((moved[one] for one in ancestors(model, body) if one in moved), hull) for body in range(model.nbody)]
    return FittedRobot(
        model=model,
        positions_m=data.geom_xpos - origin,
        rotations=data.geom_xmat.reshape(-1, 3, 3).copy(),
        owners=tuple(owners),
        drawn=drawn,
        solid=solid,
        T_base_camera=pose,
        camera_owner=owners[camera],
        hinges=hinges,
        radius_m=radius_m,
        pans=pan is not None,
        tilts=tilt is not None,
    )


def _shown(model: Any) -> tuple[BoolArray, BoolArray]:
    """`(G,)` geoms of links that are drawn, and those that collide.

    What collides is drawn only where its link has nothing that is drawn alone. A robot without colliders collides with
    what is drawn.
    """
    rigid = np.isin(model.geom_type, _SHAPES) & (model.geom_bodyid > 0)
    solid = rigid & ((model.geom_contype | model.geom_conaffinity) != 0)
    drawn = rigid & np.isin(model.geom_group, _DRAWN_GROUPS) & (colours(model)[:, 3] > 0.0)
    drawn &= ~solid | ~np.isin(model.geom_bodyid, model.geom_bodyid[drawn & ~solid])
    if not drawn.any() and not solid.any():
        raise ParameterError("robot.model: the robot has no shape: none of its geoms is drawn or collides")
    return drawn, solid if solid.any() else drawn.copy()


def _supports(model: Any, data: mujoco.MjData, geoms: BoolArray, directions: FloatArray) -> FloatArray:
    """`(K,)` how far geoms reach along `(K, 3)` unit vectors [m]."""
    reach = np.full(len(directions), -np.inf)
    for geom in np.flatnonzero(geoms).tolist():
        local, size = directions @ data.geom_xmat[geom].reshape(3, 3), model.geom_size[geom]
        match int(model.geom_type[geom]):
            case _GEOM.mjGEOM_MESH:
                first, mesh = int(model.mesh_vertadr[model.geom_dataid[geom]]), int(model.geom_dataid[geom])
                own = (local @ model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])].T).max(axis=1)
            case _GEOM.mjGEOM_BOX:
                own = np.abs(local) @ size
            case _GEOM.mjGEOM_CYLINDER:
                own = size[0] * np.hypot(local[:, 0], local[:, 1]) + size[1] * np.abs(local[:, 2])
            case _GEOM.mjGEOM_CAPSULE:
                own = size[0] + size[1] * np.abs(local[:, 2])
            case _GEOM.mjGEOM_SPHERE:
                own = np.full(len(directions), size[0])
            case _:
                own = np.linalg.norm(local * size, axis=1)
        reach = np.maximum(reach, directions @ data.geom_xpos[geom] + own)
    return reach


def _housing(model: Any, data: mujoco.MjData, centre_m: FloatArray) -> BoolArray:
    """`(G,)` geoms whose bounding box has the optical centre in it, or nearly: they would be seen from inside."""
    rotations, boxes = data.geom_xmat.reshape(-1, 3, 3), np.array(model.geom_aabb).reshape(-1, 2, 3)
    local = np.einsum("nji,nj->ni", rotations, centre_m - data.geom_xpos)
    return (np.abs(local - boxes[:, 0]) <= boxes[:, 1] + _LENS_M).all(axis=1)


def add_fitted(spec: SceneSpec, fitted: FittedRobot, fovy_deg: float) -> None:
    """Add a robot on its base, with the names of joints, motors, sensors and camera that `assets/robot.xml` has."""
    base = mujoco.MjSpec.from_file(str(assets_dir() / "planar_base.xml"))
    anchors = {"base": np.zeros(3), **{body: hinge.anchor_m for (body, _), hinge in fitted.hinges.items()}}
    for (name, joint_name), hinge in fitted.hinges.items():
        body, joint = base.body(name), base.joint(joint_name)
        body.pos, joint.axis = hinge.anchor_m - anchors["pan" if name == "head" else "base"], hinge.axis
        if (name, joint_name) in (_PAN, _TILT):
            joint.ref, joint.range, joint.limited = hinge.rest_rad, hinge.range_rad, True
    spec.attach(base, prefix="robot/", frame=spec.worldbody.add_frame())
    bodies = {name: spec.body(f"robot/{name}") for name in anchors}
    for body in bodies.values():
        # Feet and wheels would rub on it.
        spec.add_exclude(bodyname1=GROUND, bodyname2=body.name)
    model, shown = fitted.model, fitted.drawn | fitted.solid
    materials = _add_materials(spec, model, np.unique(model.geom_matid[shown]).tolist())
    meshes = set[int](model.geom_dataid[shown & (model.geom_type == int(_GEOM.mjGEOM_MESH))].tolist())
    for mesh in sorted(meshes):
        spec.add_mesh_file(f"robot/mesh-{mesh}", _mesh(fitted, mesh))
    for geom in np.flatnonzero(shown).tolist():
        owner = fitted.owners[int(model.geom_bodyid[geom])]
        drawn, solid = bool(fitted.drawn[geom]), bool(fitted.solid[geom])
        kind, mesh = mujoco.mjtGeom(int(model.geom_type[geom])), int(model.geom_dataid[geom])
        is_mesh = kind == _GEOM.mjGEOM_MESH
        bodies[owner].add_geom(
            name=f"robot/geom-{geom}",
            type=kind,
            pos=fitted.positions_m[geom] - anchors[owner],
            quat=quaternion(fitted.rotations[geom]),
            rgba=model.geom_rgba[geom],
            material=materials.get(int(model.geom_matid[geom]), ""),
            group=ROBOT_GROUP if drawn else HIDDEN_ROBOT_GROUP,
            contype=2 * solid,
            conaffinity=5 * solid,
            **({"meshname": f"robot/mesh-{mesh}"} if is_mesh else {"size": model.geom_size[geom]}),
        )
    pose, owner = fitted.T_base_camera, fitted.camera_owner
    place, quat = pose[:3, 3] - anchors[owner], quaternion(pose[:3, :3] * (1.0, -1.0, -1.0))
    bodies[owner].add_camera(name="robot/camera", pos=place, quat=quat, fovy=fovy_deg)


def _add_materials(spec: SceneSpec, model: Any, used: list[int]) -> dict[int, str]:
    """Add materials and their textures; names by index."""
    names, textures = {index: f"robot/material-{index}" for index in used if index >= 0}, set[int]()
    for index, name in names.items():
        material = spec.add_material(name=name, rgba=model.mat_rgba[index], texrepeat=model.mat_texrepeat[index])
        material.specular, material.shininess = model.mat_specular[index], model.mat_shininess[index]
        material.texuniform = bool(model.mat_texuniform[index])
        texture = int(model.mat_texid[index, _COLOUR])
        if texture < 0:
            continue
        material.textures[_COLOUR] = image_name = f"robot/texture-{texture}"
        if texture not in textures:
            textures.add(texture)
            kind = mujoco.mjtTexture(int(model.tex_type[texture]))
            spec.add_image(image_name, texture_image(model, texture), kind)
    return names


@lru_cache(maxsize=256)
def _mesh(fitted: FittedRobot, mesh: int) -> bytes:
    return mesh_file(*mesh_corners(fitted.model, mesh))
