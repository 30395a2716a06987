"""What a model takes over from the one drawn before changes no pixel."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from render_stage import WIDTH, K, build, looking, new_spec

from pftrack_sim.render.gl.context import open_context
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.render.gl.resources import Resources
from pftrack_sim.scene.layout import SKY

HEIGHT = 240
_FACES = [0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2]
POSE = looking((0.0, 0.0, 1.2), (4.0, 0.0, 1.0))


def cloth(seed: int, *, size: int = 16, meshes: int = 3, sky: bool = True, samples: int = 0) -> mujoco.MjModel:
    """Textured tetrahedra in front of the camera, under a sky."""
    rng, spec = np.random.default_rng(seed), new_spec(samples=samples)
    kinds = {"image": mujoco.mjtTexture.mjTEXTURE_2D} | ({"sky": mujoco.mjtTexture.mjTEXTURE_SKYBOX} if sky else {})
    for name, kind in kinds.items():
        shape = (6 * size if name == "sky" else size, size, 3)
        texture = spec.add_texture(name=name, type=kind, width=size, height=shape[0], nchannel=3)
        texture.data = rng.integers(0, 256, shape, np.uint8).tobytes()
    material = spec.add_material(name="cloth", emission=0.8, texrepeat=rng.uniform(1.0, 3.0, 2).tolist())
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "image"
    spec.add_material(name=SKY, emission=1.0)
    for index in range(meshes):
        corners = rng.uniform(-0.6, 0.6, (4, 3))
        spec.add_mesh(name=f"mesh-{index}", uservert=corners.ravel(), usertexcoord=rng.random(8), userface=_FACES)
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"mesh-{index}", material="cloth",
            pos=[4.0, 1.2 * (index - 1), 1.2], contype=0, conaffinity=0,
        )  # fmt: skip
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[9, 9, 1], material="cloth")
    return spec.compile()


MODELS = {
    "other content": lambda: cloth(2),
    "larger textures": lambda: cloth(2, size=64),
    "fewer meshes": lambda: cloth(2, meshes=1),
    "more meshes": lambda: cloth(2, meshes=5),
    "no sky": lambda: cloth(2, sky=False),
    "multisampling": lambda: cloth(2, samples=4),
    "another scene": lambda: build(3).model,
}


def picture(renderer: Rasteriser, model: mujoco.MjModel) -> np.ndarray:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return renderer.color(data, POSE, K)


@pytest.mark.parametrize("name", MODELS)
def test_a_model_is_drawn_as_if_none_had_been_drawn_before(name: str):
    model = MODELS[name]()
    with Rasteriser(model, WIDTH, HEIGHT) as fresh:
        expected = picture(fresh, model)
    with Rasteriser(cloth(1), WIDTH, HEIGHT) as renderer:
        for other in (cloth(1), build(3).model, cloth(1)):
            renderer.rebind(other)
            picture(renderer, other)
        renderer.rebind(model)
        np.testing.assert_array_equal(picture(renderer, model), expected)


def test_a_sky_that_was_darkened_is_not_taken_over():
    model = cloth(1)
    with Rasteriser(model, WIDTH, HEIGHT) as renderer:
        expected = picture(renderer, model)
        model.mat_emission[model.material(SKY).id] = 0.5
        assert (picture(renderer, model) != expected).any()
        renderer.rebind(cloth(1))
        np.testing.assert_array_equal(picture(renderer, cloth(1)), expected)


def test_only_what_differs_is_uploaded(monkeypatch: pytest.MonkeyPatch):
    uploaded: list[str] = []

    def upload_texture(_model: mujoco.MjModel, _context: mujoco.MjrContext, texture: int) -> None:
        uploaded.append(f"texture {texture}")

    def upload_mesh(_model: mujoco.MjModel, _context: mujoco.MjrContext, mesh: int) -> None:
        uploaded.append(f"mesh {mesh}")

    monkeypatch.setattr(mujoco, "mjr_uploadTexture", upload_texture)
    monkeypatch.setattr(mujoco, "mjr_uploadMesh", upload_mesh)
    model = cloth(1)
    with open_context().current():
        resources = Resources(model, (WIDTH, HEIGHT))
        assert resources.replace(cloth(1))
        assert uploaded == []
        changed = cloth(1)
        changed.tex_data[changed.tex_adr[1] + 5] += 1
        changed.mesh_texcoord[changed.mesh_texcoordadr[2], 0] += 0.5
        assert resources.replace(changed)
        assert uploaded == ["texture 1", "mesh 2"]
        assert not resources.replace(cloth(1, meshes=5))
        assert resources.replace(changed)
        assert len(uploaded) == 2
        resources.free()
