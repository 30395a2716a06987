"""An MjSpec that takes meshes and textures as whole blocks of memory.

MuJoCo's Python interface copies the vertices and texels of a spec number by number. A scene has half a million
coordinates and 20 million texels: passed as blocks they take a third of the time, and the compiled model is the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim.core.types import IntArray
from pftrack_sim.scene.layout import HIDDEN_GROUP, PEOPLE_CONAFFINITY, PEOPLE_CONTYPE, SCENERY_GROUP

_TEXTURE_2D = mujoco.mjtTexture.mjTEXTURE_2D
_LINEAR = mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR
LEVELS = 3  # Of detail, where a mesh has several
_SHARED = ("vertadr", "vertnum", "normaladr", "normalnum", "texcoordadr", "texcoordnum")
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
        self._levels: dict[str, list[int]] = {}
        self._images: dict[str, NDArray[np.uint8]] = {}

    def add_mesh_file(self, name: str, content: bytes) -> mujoco.MjsMesh:
        """Add an open surface (it encloses no volume to compute an inertia from) with the content of `mesh_file`."""
        file = f"{name}.msh"
        self._mesh_files[file] = content
        return self.add_mesh(name=name, file=file, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)

    def add_detailed_mesh(
        self,
        name: str,
        vertices: ArrayLike,
        normals: ArrayLike,
        coordinates: ArrayLike,
        levels: Sequence[NDArray[np.int32]],
    ) -> None:
        """Add a mesh, whose points are those of `mesh_file`, with several sets of triangles, the finest first.

        The coarser ones become meshes of their own, directly before it, the coarsest first: see `geom_meshes`.
        """
        for level in reversed(range(1, len(levels))):
            self.add_mesh_file(f"{name}/coarse-{level}", _PLACEHOLDER)
        self.add_mesh_file(name, mesh_file(vertices, normals, coordinates, np.concatenate(levels)))
        self._levels[name] = [len(faces) for faces in levels]

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
        shared = [getattr(model, f"mesh_{what}") for what in _SHARED]
        for name, counts in self._levels.items():
            # One mesh to the compiler, which turns each into the axes of its own inertia.
            mesh = model.mesh(name).id
            first = int(model.mesh_faceadr[mesh])
            for level, count in enumerate(counts):
                for points in shared:
                    points[mesh - level] = points[mesh]
                model.mesh_faceadr[mesh - level], model.mesh_facenum[mesh - level] = first, count
                first += count
        return model


def geom_meshes(model: Any) -> IntArray:
    """`(3, ngeom)` mesh of each geom by level of detail, the finest first; the same where there is no coarser one."""
    meshes, points = np.array(model.geom_dataid), model.mesh_vertadr
    levels = [meshes]
    for level in range(1, LEVELS):
        before = np.maximum(meshes - level, 0)
        shares = (meshes >= level) & (points[before] == points[meshes]) if len(points) else np.zeros(len(meshes), bool)
        levels.append(np.where(shares, before, levels[-1]))
    return np.stack(levels)


NO_CONTACT: dict[str, Any] = {"contype": 0, "conaffinity": 0, "mass": 0.0}
"""Properties of geoms that are drawn and collide with nothing."""


def add_mesh_geom(body: mujoco.MjsBody, name: str, *, group: int = SCENERY_GROUP, **properties: Any) -> mujoco.MjsGeom:
    """Add the mesh of a name to a body, as a geom of the same name that is drawn and collides with nothing."""
    return body.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, group=group, **NO_CONTACT, **properties
    )


def add_bumper(body: mujoco.MjsBody, name: str, **shape: Any) -> None:
    """Add a hidden shape of a person, or of what moves like one: it collides with robots only."""
    bits = {"contype": PEOPLE_CONTYPE, "conaffinity": PEOPLE_CONAFFINITY}
    body.add_geom(name=f"{name}/bumper", group=HIDDEN_GROUP, mass=0.0, castshadow=False, **bits, **shape)


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


_PLACEHOLDER = mesh_file([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 0, 1]] * 4, [[0, 0]] * 4, [[0, 1, 2]])
