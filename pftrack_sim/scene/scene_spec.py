"""An MjSpec that takes meshes and textures as whole blocks of memory.

MuJoCo's Python interface copies the vertices and texels of a spec number by number. A scene has half a million
coordinates and 20 million texels: passed as blocks they take a third of the time, and the compiled model is the same.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.scene.layout import HIDDEN_GROUP, SCENERY_GROUP

_TEXTURE_2D = mujoco.mjtTexture.mjTEXTURE_2D
_LINEAR = mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR
BLANK = np.zeros((6, 1, 3), np.uint8)  # In place of every image where nothing is drawn in colour


class SceneSpec(mujoco.MjSpec):
    """A spec whose meshes are binary files in memory, and whose images are written into the compiled model.

    Until then its textures have the size of their image and one colour.

    Attributes:
        draws: Whether the model is drawn in colour; if not, a texture is a single texel, or one for each face.
    """

    def __init__(self, *, draws: bool = True) -> None:
        mujoco.MjSpec.__init__(self)
        # To start threads for a few dozen meshes takes longer than they save.
        self.compiler.usethread = False
        self.draws = draws
        self._mesh_files: dict[str, bytes] = {}
        self._coarse: list[str] = []
        self._images: dict[str, NDArray[np.uint8]] = {}

    def add_mesh_file(self, name: str, content: bytes, *, coarse: bytes | None = None) -> mujoco.MjsMesh:
        """Add an open surface (it encloses no volume to compute an inertia from) with the content of `mesh_file`.

        `coarse` has the same points, and fewer triangles for the distance.
        """
        if coarse is not None:
            self.add_mesh_file(f"{name}/coarse", coarse)
            self._coarse.append(name)
        file = f"{name}.msh"
        self._mesh_files[file] = content
        return self.add_mesh(name=name, file=file, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)

    def add_image(
        self, name: str, image: NDArray[np.uint8], kind: mujoco.mjtTexture = _TEXTURE_2D, **properties: Any
    ) -> None:
        """Add a texture of an `(H, W, 3)` RGB image, which must not change until the spec is compiled.

        The six faces of cubes and skyboxes lie below each other. `properties` are others of MuJoCo's textures.
        """
        if not self.draws:
            image = BLANK[:1] if kind == _TEXTURE_2D else BLANK
        height, width = image.shape[:2]
        flat = mujoco.mjtBuiltin.mjBUILTIN_FLAT
        self.add_texture(name=name, type=kind, width=width, height=height, nchannel=3, builtin=flat, **properties)
        self._images[name] = image

    def add_image_file(self, name: str, file: Path) -> None:
        """Add a 2D texture of an image file in RGB. MuJoCo decodes it once in a process, and copies it from then on."""
        if self.draws:
            self.add_texture(name=name, type=_TEXTURE_2D, file=str(file), colorspace=_LINEAR)
        else:
            self.add_image(name, BLANK)

    def compile(self) -> mujoco.MjModel:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Compile a model with these meshes and images."""
        self.assets = self._mesh_files
        model: Any = mujoco.MjSpec.compile(self)
        for name, image in self._images.items():
            start = int(model.texture(name).adr[0])
            model.tex_data[start : start + image.size] = image.reshape(-1)
        for name in self._coarse:
            # The compiler turns meshes into the axes of their own inertia: those of one geom share their points.
            mesh = model.mesh(name).id
            for points in (model.mesh_vertadr, model.mesh_normaladr, model.mesh_texcoordadr):
                points[mesh - 1] = points[mesh]
        return model


def add_box(
    body: mujoco.MjsBody, name: str, half_m: ArrayLike, centre_m: ArrayLike, *, solid: bool, **properties: Any
) -> mujoco.MjsGeom:
    """Add a box to a body: one that is drawn, or a `solid` one that the robot collides with.

    Solid boxes are hidden as all colliders are: the range finder measures those, not what is drawn.
    """
    return body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=half_m,
        pos=centre_m,
        group=HIDDEN_GROUP if solid else SCENERY_GROUP,
        contype=int(solid),
        conaffinity=2 * solid,
        **properties,
    )


def mesh_file(vertices: ArrayLike, normals: ArrayLike, coordinates: ArrayLike, faces: ArrayLike) -> bytes:
    """Content of a mesh file of MuJoCo (MSH): counts, then all numbers in 32 bits.

    Args:
        vertices: `(V, 3)` [m].
        normals: `(V, 3)` unit vectors.
        coordinates: `(V, 2)` texture coordinates, from the upper left of the image.
        faces: `(F, 3)` vertex indices, counter-clockwise seen from outside.
    """
    numbers = [np.asarray(array, dtype=np.float32) for array in (vertices, normals, coordinates)]
    triangles = np.asarray(faces, dtype=np.int32)
    counts = np.array([len(array) for array in (*numbers, triangles)], dtype=np.int32)
    return b"".join(array.tobytes() for array in (counts, *numbers, triangles))
