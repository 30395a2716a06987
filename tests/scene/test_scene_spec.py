"""Meshes and images passed as blocks give the model that MuJoCo's own way gives."""

from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest

from pftrack_sim.scene.scene_spec import SceneSpec, mesh_file

GROUPS = ("mesh_", "tex_", "geom_", "mat_")
FIELDS = [name for name in dir(mujoco.MjModel) if name.startswith(GROUPS) and "path" not in name]
Arrays = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def surface(rng: np.random.Generator, count: int = 60) -> Arrays:
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    faces = np.array([rng.permutation(count)[:3] for _ in range(90)], dtype=np.int32)
    return rng.normal(size=(count, 3)), normals, rng.random((count, 2)), faces


def finish(spec: mujoco.MjSpec) -> mujoco.MjModel:
    for name in ("own", "other"):
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"{name}/mesh", mass=0.0)
    material = spec.add_material(name="cloth")
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "flat"
    return spec.compile()


@pytest.mark.parametrize("seed", range(3))
def test_the_model_is_that_of_numbers_passed_one_by_one(seed: int):
    rng = np.random.default_rng(seed)
    meshes = {"own/mesh": surface(rng), "other/mesh": surface(rng)}
    images = {"flat": rng.integers(0, 256, (6, 10, 3), np.uint8), "sky": rng.integers(0, 256, (48, 8, 3), np.uint8)}
    linear = mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR
    kinds = {"flat": mujoco.mjtTexture.mjTEXTURE_2D, "sky": mujoco.mjtTexture.mjTEXTURE_SKYBOX}
    ours, theirs = SceneSpec(), mujoco.MjSpec()
    for name, arrays in meshes.items():
        ours.add_mesh_file(name, mesh_file(*arrays))
        mesh = theirs.add_mesh(name=name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert, mesh.usernormal, mesh.usertexcoord, mesh.userface = (array.ravel() for array in arrays)
    for name, image in images.items():
        ours.add_image(name, image, kinds[name], colorspace=linear)
        height, width = image.shape[:2]
        form = {"type": kinds[name], "width": width, "height": height, "nchannel": 3, "colorspace": linear}
        theirs.add_texture(name=name, **form).data = image.tobytes()
    ours, theirs = finish(ours), finish(theirs)
    assert "mesh_texcoord" in FIELDS
    assert "tex_data" in FIELDS
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(ours, field), getattr(theirs, field), err_msg=field)


def test_a_mesh_of_the_same_name_is_that_of_its_own_spec():
    """MuJoCo keeps files of meshes by name: a later one of the same name must not be taken for it."""
    for seed in (0, 1, 0):
        vertices, *rest = surface(np.random.default_rng(seed))
        spec = SceneSpec()
        spec.add_mesh_file("own/mesh", mesh_file(vertices, *rest))
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="own/mesh", mass=0.0)
        model = spec.compile()
        turned = model.mesh_vert.astype(float)
        gaps = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
        np.testing.assert_allclose(np.linalg.norm(np.diff(turned, axis=0), axis=1), gaps, rtol=0, atol=1e-5)


def test_an_image_file_gives_the_texels_that_opencv_reads(tmp_path: Path):
    image = np.random.default_rng(0).integers(0, 256, (6, 10, 3), np.uint8)
    for name, spec in (("drawn", SceneSpec()), ("drawn", SceneSpec()), ("blank", SceneSpec(draws=False))):
        file = tmp_path / f"{name}.png"
        cv2.imwrite(str(file), image[:, :, ::-1])
        spec.add_image_file("flat", file)
        model = spec.compile()
        form = model.tex_height[0], model.tex_width[0], model.tex_nchannel[0]
        expected = image if spec.draws else np.zeros((1, 1, 3))
        np.testing.assert_array_equal(model.tex_data.reshape(form), expected)
