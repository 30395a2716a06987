"""A small scene for tests of `render`: people made of all types of geoms among pillars, and a camera anywhere.

Run as a program, it prints a digest of images and truth, to compare processes and OpenGL libraries.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from dataclasses import dataclass

import mujoco
import numpy as np

from pftrack_sim.camera.pinhole import intrinsics
from pftrack_sim.core.records import Truth
from pftrack_sim.render.gl.context import open_context
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.scene.layout import HIDDEN_GROUP, PEOPLE_GROUP, ROBOT_GROUP, SCENERY_GROUP
from pftrack_sim.truth.observer import TruthObserver

WIDTH, HEIGHT, FOVY = 320, 240, 0.9
K = intrinsics(WIDTH, HEIGHT, FOVY)
NEAR, FAR = 0.05, 120.0
Geom = mujoco.mjtGeom


@dataclass(frozen=True, eq=False)
class Stage:
    """A compiled scene; people are moved by `place`."""

    model: mujoco.MjModel
    data: mujoco.MjData
    people: tuple[str, ...]
    parts: dict[str, np.ndarray]

    def place(self, name: str, at: tuple[float, float, float], yaw: float = 0.0) -> None:
        """Move a person's feet to a point."""
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
        for body in np.flatnonzero([self.model.body(i).name.startswith(f"{name}/") for i in range(self.model.nbody)]):
            mocap = self.model.body_mocapid[body]
            self.data.mocap_pos[mocap] = turn @ self.parts[self.model.body(body).name] + at
            self.data.mocap_quat[mocap] = (np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2))
        mujoco.mj_forward(self.model, self.data)

    def roots(self) -> np.ndarray:
        """`(P, 4, 4)` poses below each pelvis."""
        poses = np.tile(np.eye(4), (len(self.people), 1, 1))
        for index, name in enumerate(self.people):
            poses[index, :2, 3] = self.data.body(f"{name}/pelvis").xpos[:2]
        return poses

    def owner(self, geom: int) -> str:
        """Name of the person or thing that a geom belongs to."""
        return self.model.body(self.model.geom_bodyid[geom]).name.split("/")[0]


def new_spec(*, slices: int = 12, samples: int = 0) -> mujoco.MjSpec:
    """A spec with the visual settings of the simulation."""
    spec = mujoco.MjSpec()
    spec.stat.extent = 1.0
    spec.visual.map.znear, spec.visual.map.zfar, spec.visual.map.shadowclip = NEAR, FAR, 8.0
    quality = spec.visual.quality
    quality.numslices, quality.numstacks, quality.offsamples, quality.shadowsize = slices, slices, samples, 512
    spec.visual.headlight.active = 0
    return spec


def build(
    seed: int = 0, *, people: int = 3, pillars: int = 4, samples: int = 0, ground: bool = True, slices: int = 12
) -> Stage:
    """People and pillars at random places in front of a camera at the origin."""
    rng = np.random.default_rng(seed)
    spec = new_spec(samples=samples, slices=slices)
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.4, 0.6, 0.9],
        rgb2=[0.9, 0.9, 1.0],
        width=32,
        height=192,
    )
    world = spec.worldbody
    world.add_light(
        pos=[0, 0, 9],
        dir=[0.3, 0.2, -1],
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        castshadow=True,
        ambient=[0.3] * 3,
    )
    if ground:
        world.add_body(name="ground").add_geom(
            type=Geom.mjGEOM_BOX, size=[60, 60, 0.5], pos=[0, 0, -0.5], rgba=[0.5, 0.5, 0.4, 1], group=SCENERY_GROUP
        )
    # A wall that only collides must occlude nothing.
    world.add_body(name="ghost", pos=[1, 0, 1]).add_geom(type=Geom.mjGEOM_BOX, size=[0.1, 5, 5], group=HIDDEN_GROUP)
    for index in range(pillars):
        spot = [rng.uniform(2, 8), rng.uniform(-2.5, 2.5), 1.0]
        kind = Geom.mjGEOM_BOX if index % 2 else Geom.mjGEOM_CYLINDER
        size = [rng.uniform(0.05, 0.3), rng.uniform(0.2, 1.2), 1.0] if index % 2 else [rng.uniform(0.05, 0.3), 1.0, 0]
        body = world.add_body(name=f"pillar-{index + 1}", pos=spot)
        body.add_geom(type=kind, size=size, rgba=[*rng.uniform(0.1, 1, 3), 1], group=SCENERY_GROUP)
    mast = world.add_body(name="robot/mast", pos=[0.6, rng.uniform(-0.3, 0.3), 0.9])
    mast.add_geom(type=Geom.mjGEOM_CAPSULE, size=[0.02, 0.2, 0], rgba=[0.1, 0.1, 0.1, 1], group=ROBOT_GROUP)
    vertices = rng.normal(size=(40, 3))
    vertices *= 0.2 / np.linalg.norm(vertices, axis=1, keepdims=True)
    spec.add_mesh(name="torso", uservert=(vertices * (0.7, 1.0, 1.6)).ravel())
    names = ("target", *(f"distractor-{index}" for index in range(1, people)))
    parts = {}
    for name in names:
        for part, height, side, geom in _anatomy():
            body = world.add_body(name=f"{name}/{part}", mocap=True)
            body.add_geom(rgba=[*rng.uniform(0.1, 1, 3), 1], group=PEOPLE_GROUP, **geom)
            parts[f"{name}/{part}"] = np.array([0.0, side, height])
        # The hull of a limb that only collides must not count.
        world_body = spec.body(f"{name}/torso")
        world_body.add_geom(type=Geom.mjGEOM_BOX, size=[0.5, 0.5, 0.9], group=HIDDEN_GROUP)
    world.add_camera(name="eye", fovy=float(np.rad2deg(FOVY)))
    spec.visual.global_.offwidth, spec.visual.global_.offheight = WIDTH, HEIGHT
    model = spec.compile()
    stage = Stage(model, mujoco.MjData(model), names, parts)
    for name in names:
        at = (rng.uniform(2.5, 9), rng.uniform(-2, 2), rng.uniform(-0.02, 0.05))
        stage.place(name, at, rng.uniform(-3, 3))
    return stage


def _anatomy() -> list[tuple[str, float, float, dict]]:
    """Part, height, lateral offset and geom, of all types."""
    leg = {"type": Geom.mjGEOM_CAPSULE, "size": [0.07, 0.33, 0]}
    arm = {"type": Geom.mjGEOM_CYLINDER, "size": [0.045, 0.28, 0]}
    return [
        ("pelvis", 0.95, 0.0, {"type": Geom.mjGEOM_ELLIPSOID, "size": [0.13, 0.17, 0.14]}),
        ("torso", 1.25, 0.0, {"type": Geom.mjGEOM_MESH, "meshname": "torso"}),
        ("head", 1.62, 0.0, {"type": Geom.mjGEOM_SPHERE, "size": [0.11, 0, 0]}),
        ("left-leg", 0.45, 0.1, leg),
        ("right-leg", 0.45, -0.1, leg),
        ("left-arm", 1.15, 0.26, arm),
        ("right-arm", 1.15, -0.26, arm),
        ("left-foot", 0.04, 0.1, {"type": Geom.mjGEOM_BOX, "size": [0.13, 0.05, 0.04]}),
        ("right-foot", 0.04, -0.1, {"type": Geom.mjGEOM_BOX, "size": [0.13, 0.05, 0.04]}),
    ]


def looking(eye: tuple[float, float, float], at: tuple[float, float, float], roll: float = 0.0) -> np.ndarray:
    """`(4, 4)` T_world_camera of a camera at `eye` that looks at a point."""
    forward = np.subtract(at, eye) / np.linalg.norm(np.subtract(at, eye))
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    pose = np.eye(4)
    turn = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    pose[:3, :3] = np.column_stack([right, down, forward]) @ turn
    pose[:3, 3] = eye
    return pose


def facing(yaw: float = 0.0, at: tuple[float, float, float] = (0.0, 0.0, 0.0), pitch: float = 0.0) -> np.ndarray:
    """`(4, 4)` T_world_camera of a camera that looks along x, turned to the left and up by angles."""
    cos, sin, up, out = np.cos(yaw), np.sin(yaw), np.sin(pitch), np.cos(pitch)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 2], pose[:3, 3] = (sin, -cos, 0.0), (out * cos, out * sin, up), at
    pose[:3, 1] = np.cross(pose[:3, 2], pose[:3, 0])
    return pose


def random_view(rng: np.random.Generator) -> np.ndarray:
    """A camera near the origin that looks roughly along x with some roll."""
    eye = tuple(rng.normal(size=3) * 0.3 + (0.0, 0.0, 1.2))
    return looking(eye, (5.0, *rng.normal(size=2) * 0.7 + (0.0, 1.0)), rng.normal() * 0.1)


def plain_values(truth: Truth) -> list:
    """A truth as plain values that compare bit for bit."""
    arrays = [truth.box, truth.amodal_box, truth.visible_box, truth.T_world_camera, truth.T_world_target, truth.K]
    numbers = [truth.visible_fraction, truth.truncation, truth.distance_m, truth.image_motion_px, truth.luminance]
    return [
        truth.name,
        truth.state,
        list(truth.occluders),
        [array.tobytes().hex() for array in arrays],
        [float(number).hex() for number in numbers],
    ]


def digest(backend: str | None, samples: int = 0) -> dict:
    """Hash of images, and truth, of a few scenes."""
    pictures = hashlib.sha256()
    truths: list = []
    renderer = None
    for seed in range(4):
        stage = build(seed, samples=samples)
        if renderer is None:
            renderer = Rasteriser(stage.model, WIDTH, HEIGHT, open_context(backend))
        else:
            renderer.rebind(stage.model)
        observer = TruthObserver(stage.model, stage.people, K, (WIDTH, HEIGHT))
        rng = np.random.default_rng(seed)
        for frame in range(3):
            pose = random_view(rng)
            image = renderer.color(stage.data, pose, K)
            pictures.update(image.tobytes())
            truths.append(
                [plain_values(one) for one in observer.observe(stage.data, pose, image, frame / 30, stage.roots())]
            )
    assert renderer is not None
    used = renderer.info.backend
    renderer.close()
    return {"backend": used, "pictures": pictures.hexdigest(), "truths": truths}


if __name__ == "__main__":
    before = dict(os.environ)
    backend_name, multisamples = (sys.argv[1] if sys.argv[1] != "any" else None), int(sys.argv[2])
    result = digest(backend_name, multisamples)
    result["environment_unchanged"] = before == dict(os.environ)
    sys.stdout.write(json.dumps(result) + "\n")
