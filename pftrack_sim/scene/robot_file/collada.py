"""Triangles of COLLADA files (`.dae`), the meshes of most ROS robots, which MuJoCo does not read."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator

import numpy as np

from pftrack_sim.core.types import FloatArray, IntArray

_SIZES = {"triangles": 3, "polylist": 0, "polygons": 0}


def read_collada(content: bytes) -> tuple[FloatArray, IntArray]:
    """`(V, 3)` vertices [m] and `(F, 3)` triangles of all geometry of a file, placed by its scene.

    Colours and textures are left out; the up axis is that of the numbers, as in RViz.

    Raises:
        ValueError: It is no COLLADA, or holds no triangles.
    """
    try:
        root = ET.fromstring(content)
    except ET.ParseError as error:
        raise ValueError(f"no COLLADA: {error}") from None
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    unit = root.find("asset/unit")
    scale = float(unit.get("meter", "1")) if unit is not None else 1.0
    geometries = {one.get("id"): list(_triangles(one)) for one in root.iter("geometry")}
    placed = [
        (vertices @ pose[:3, :3].T + pose[:3, 3], faces)
        for scene in root.iter("visual_scene")
        for url, pose in _instances(scene, np.eye(4))
        for vertices, faces in geometries.get(url, ())
    ]
    if not placed:
        placed = [pair for pairs in geometries.values() for pair in pairs]
    if not placed:
        raise ValueError("holds no triangles")
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in placed)])
    faces = [faces + start for (_, faces), start in zip(placed, starts, strict=False)]
    return scale * np.concatenate([vertices for vertices, _ in placed]), np.concatenate(faces)


def _triangles(geometry: ET.Element) -> Iterator[tuple[FloatArray, IntArray]]:
    """Vertices and triangles of each list of a geometry; polygons are taken as convex."""
    sources = {
        source.get("id"): np.array((values.text or "").split(), dtype=np.float64)
        for source in geometry.iter("source")
        if (values := source.find("float_array")) is not None
    }
    for vertices in geometry.iter("vertices"):
        for one in vertices.iterfind("input[@semantic='POSITION']"):
            sources[vertices.get("id")] = sources[_id(one.get("source"))]
    for list_ in (one for one in geometry.iter() if one.tag in _SIZES):
        inputs = list_.findall("input")
        stride = 1 + max((int(one.get("offset", 0)) for one in inputs), default=0)
        (offset, source) = next(
            (int(one.get("offset", 0)), _id(one.get("source"))) for one in inputs if one.get("semantic") == "VERTEX"
        )
        lists = [np.array((one.text or "").split(), dtype=np.intp)[offset::stride] for one in list_.iter("p")]
        indices = np.concatenate([np.empty(0, dtype=np.intp), *lists])
        counts = list_.find("vcount")
        if list_.tag == "triangles":
            faces = indices[: len(indices) // 3 * 3].reshape(-1, 3)
        else:
            sizes = [len(one) for one in lists] if counts is None else [int(one) for one in (counts.text or "").split()]
            faces = _fans(indices, np.array(sizes, dtype=np.intp))
        yield sources[source].reshape(-1, 3), faces


def _fans(indices: IntArray, sizes: IntArray) -> IntArray:
    """`(F, 3)` triangles of polygons of these sizes."""
    count = np.maximum(sizes - 2, 0)
    first = np.repeat(np.cumsum(sizes) - sizes, count)
    step: IntArray = np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count)
    return np.stack([indices[first], indices[first + step + 1], indices[first + step + 2]], axis=1)


def _instances(node: ET.Element, parent: FloatArray) -> Iterator[tuple[str | None, FloatArray]]:
    """Ids of the geometries below a node, with their poses."""
    pose = parent.copy()
    for child in node:
        numbers = np.array((child.text or "").split(), dtype=np.float64) if child.tag in _TRANSFORMS else np.empty(0)
        if child.tag == "matrix":
            pose = pose @ numbers.reshape(4, 4)
        elif child.tag == "translate":
            pose[:3, 3] += pose[:3, :3] @ numbers
        elif child.tag == "scale":
            pose[:3, :3] *= numbers
        elif child.tag == "rotate":
            pose[:3, :3] = pose[:3, :3] @ _rotation(numbers)
        elif child.tag == "node":
            yield from _instances(child, pose)
        elif child.tag == "instance_geometry":
            yield _id(child.get("url")), pose


_TRANSFORMS = ("matrix", "translate", "scale", "rotate")


def _rotation(axis_angle: FloatArray) -> FloatArray:
    """Rotation about x, y, z by an angle in degrees."""
    x, y, z = axis_angle[:3] / np.linalg.norm(axis_angle[:3])
    angle = np.deg2rad(axis_angle[3])
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def _id(url: str | None) -> str | None:
    return url.removeprefix("#") if url is not None else None
