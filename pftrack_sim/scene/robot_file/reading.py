"""MJCF and URDF files of robots, read and compiled with the meshes beside them."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from pftrack_sim.core.errors import ParameterError, did_you_mean
from pftrack_sim.core.inputs import is_file, read_bytes
from pftrack_sim.core.text import one_line
from pftrack_sim.scene.robot_file.collada import read_collada
from pftrack_sim.scene.scene_spec import mesh_file

MENAGERIE = "menagerie:"
MAX_TRIANGLES = 500_000
"""Of all meshes of a robot together: every frame draws them."""

_MAX_XML_BYTES, _MAX_MESH_BYTES = 16 << 20, 128 << 20
_HARMLESS_KG, _HARMLESS_KG_M2 = 1e-6, 1e-8  # Of every link: the drive has inertias of its own


def compile_file(model: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Compile the file at a path, or that of `menagerie:NAME`, in the pose of its first keyframe or at rest.

    Raises:
        ParameterError: It cannot be read, is neither MJCF nor URDF, lacks a mesh, or is too large.
    """
    spec, path = read_spec(model)
    for body in spec.bodies[1:]:
        body.explicitinertial, body.mass, body.inertia = True, _HARMLESS_KG, [_HARMLESS_KG_M2] * 3
        body.ipos, body.iquat, body.fullinertia = [0.0] * 3, [1.0, 0.0, 0.0, 0.0], [np.nan] * 6
    compiled: Any = compile_spec(spec, path)
    data = mujoco.MjData(compiled)
    if compiled.nkey:
        mujoco.mj_resetDataKeyframe(compiled, data, 0)
    return compiled, data


def compile_spec(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile the spec of a file; what MuJoCo finds wrong raises `ParameterError`."""
    try:
        return spec.compile()
    except (ValueError, FileNotFoundError) as error:
        raise ParameterError(f"{path}: cannot be compiled: {one_line(str(error), 300)}") from None


def read_spec(model: str) -> tuple[mujoco.MjSpec, Path]:
    """The spec of the file at a path, or of `menagerie:NAME`, and its path; errors are those of `compile_file`."""
    path = _menagerie(model.removeprefix(MENAGERIE)) if model.startswith(MENAGERIE) else Path(model)
    try:
        text = _content(path, _MAX_XML_BYTES).decode()
    except UnicodeDecodeError:
        raise ParameterError(f"{path}: is neither MJCF nor URDF: no UTF-8 text") from None
    try:
        root = ET.fromstring(text)
        xacro = any("xacro" in one.tag or any("${" in value for value in one.attrib.values()) for one in root.iter())
    except ET.ParseError as error:
        xacro, root = "<xacro:" in text, ET.Element("")
        if not xacro:
            raise ParameterError(f"{path}: is neither MJCF nor URDF: {error}") from None
    if xacro:
        raise ParameterError(f"{path}: holds xacro: expand it first, xacro {path.name} > robot.urdf")
    if root.tag not in ("mujoco", "robot"):
        raise ParameterError(f"{path}: takes MJCF (<mujoco>) or URDF (<robot>), got <{one_line(root.tag, 60)}>")
    try:
        spec = mujoco.MjSpec.from_file(str(path)) if root.tag == "mujoco" else _urdf(root, path)
        _check_meshes(spec, path)
    except (ValueError, FileNotFoundError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(f"{path}: cannot be compiled: {one_line(str(error), 300)}") from None
    return spec, path


def _menagerie(name: str) -> Path:
    """The robot's file in MuJoCo Menagerie, downloaded at its first use."""
    try:
        import mujoco_menagerie  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ParameterError(
            f"{MENAGERIE}{name} needs the package mujoco-menagerie: pip install 'pftrack-sim[menagerie]'"
        ) from None
    package: Any = mujoco_menagerie
    if name not in package.names():
        near = did_you_mean(name, package.names())
        raise ParameterError(f"{MENAGERIE}{name}: MuJoCo Menagerie has no such robot{near}")
    try:
        robot = package.get(name)
        return Path(robot.xml(robot.default_model))
    except (package.MenagerieError, OSError) as error:
        raise ParameterError(f"{MENAGERIE}{name}: cannot be downloaded: {one_line(str(error), 200)}") from None


def _urdf(root: ET.Element, path: Path) -> mujoco.MjSpec:
    """The spec of a URDF with all its links and visual meshes, which it reads into memory."""
    files: dict[str, str] = {}
    assets: dict[str, bytes] = {}
    for mesh in root.iter("mesh"):
        given = mesh.get("filename", "")
        if given not in files:
            found = next(filter(is_file, _places(given, path.resolve())), None)
            if found is None:
                raise ParameterError(
                    f"{path}: no mesh {given!r} beside it, in a folder above it or in ROS_PACKAGE_PATH"
                )
            # MuJoCo names meshes after their files, which may have the same name in several folders.
            suffix = found.suffix.lower()
            files[given] = f"{found.stem}-{len(files)}{'.msh' if suffix == '.dae' else suffix}"
            content = _content(found, _MAX_MESH_BYTES)
            if suffix == ".dae":
                try:
                    vertices, faces = read_collada(content)
                except ImportError:
                    raise ParameterError(f"{found}: COLLADA needs the extra: pip install 'pftrack-sim[mesh]'") from None
                except ValueError as error:
                    raise ParameterError(f"{found}: cannot be read as COLLADA: {error}") from None
                content = mesh_file(vertices, np.empty((0, 3)), np.empty((0, 2)), faces)
            assets[files[given]] = content
        mesh.set("filename", files[given])
    for own in root.findall("mujoco"):
        root.remove(own)
    options = {"discardvisual": "false", "fusestatic": "false", "strippath": "false"}
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", options)
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    spec.assets = assets
    return spec


def _places(given: str, path: Path) -> Iterator[Path]:
    """Where a mesh of a URDF may be; `package://` names a folder above it or one in `ROS_PACKAGE_PATH`."""
    file = given.removeprefix("file://")
    if not file.startswith("package://"):
        yield path.parent / file
        return
    file = file.removeprefix("package://")
    ros = [Path(one) for one in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if one]
    for folder in (*path.parents, *ros):
        yield folder / file
        yield folder / file.partition("/")[2]


def _content(file: Path, most_bytes: int) -> bytes:
    try:
        return read_bytes(file, most_bytes)
    except OSError as error:
        raise ParameterError(f"{file}: cannot be read: {error.strerror or error}") from None


def _check_meshes(spec: mujoco.MjSpec, path: Path) -> None:
    """Count triangles, before MuJoCo takes minutes to compile them."""
    folder, total = Path(spec.modelfiledir) / spec.compiler.meshdir, 0
    for mesh in spec.meshes:
        # A flat one has no volume to weigh.
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        if not mesh.file:
            continue
        content: bytes | None = spec.assets.get(mesh.file)
        file = folder / mesh.file
        if content is None and not is_file(file):
            raise ParameterError(f"{path}: no mesh {str(file)!r}")
        found = _triangles(file.suffix.lower(), _content(file, _MAX_MESH_BYTES) if content is None else content)
        total += found
        if total > MAX_TRIANGLES:
            raise ParameterError(
                f"{path}: its meshes have more than {MAX_TRIANGLES:,} triangles together, {file.name} alone {found:,}: "
                "simplify them, for example in Blender (Decimate) or MeshLab (Quadric Edge Collapse)"
            )


def _triangles(suffix: str, content: bytes) -> int:
    if suffix == ".stl":
        return max(len(content) - 84, 0) // 50
    if suffix == ".msh":
        return int(np.frombuffer(content, np.int32, 4)[3]) if len(content) >= 16 else 0
    return content.count(b"\nf ")
