"""Triangles of COLLADA files (`.dae`), the meshes of most ROS robots, which MuJoCo does not read."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator

import cv2
import numpy as np

from pftrack_sim.core.types import FloatArray, IntArray

_LISTS = ("triangles", "polylist", "polygons")
_TRANSFORMS = ("matrix", "translate", "scale", "rotate")


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
    geometries = {one.get("id", ""): list(_triangles(one)) for one in root.iter("geometry")}
    places = [one for scene in root.iter("visual_scene") for one in _instances(scene, np.eye(4))]
    places = places or [(name, np.eye(4)) for name in geometries]
    placed = [
        (vertices @ pose[:3, :3].T + pose[:3, 3], faces)
        for name, pose in places
        for vertices, faces in geometries.get(name, ())
    ]
    if not placed:
        raise ValueError("holds no triangles")
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in placed)])
    unit = root.find("asset/unit")
    scale = float(unit.get("meter", "1")) if unit is not None else 1.0
    faces = np.concatenate([faces + start for (_, faces), start in zip(placed, starts, strict=False)])
    # Several meshes may share their vertices.
    used, corners = np.unique(faces, return_inverse=True)
    return scale * np.concatenate([vertices for vertices, _ in placed])[used], corners.reshape(-1, 3)


def _triangles(geometry: ET.Element) -> Iterator[tuple[FloatArray, IntArray]]:
    """Vertices and triangles of each list of a geometry; polygons are taken as convex."""
    points: dict[str, FloatArray] = {}
    for source in geometry.iter("source"):
        if (values := source.find("float_array")) is not None:
            points[source.get("id", "")] = _numbers(values)
    for vertices in geometry.iter("vertices"):
        for one in vertices.iterfind("input[@semantic='POSITION']"):
            points[vertices.get("id", "")] = points[_name(one, "source")]
    for primitives in (one for one in geometry.iter() if one.tag in _LISTS):
        inputs = primitives.findall("input")
        stride = 1 + max(int(one.get("offset", "0")) for one in inputs)
        vertex = next(one for one in inputs if one.get("semantic") == "VERTEX")
        lists = [
            _numbers(one).astype(np.intp)[int(vertex.get("offset", "0")) :: stride] for one in primitives.iter("p")
        ]
        indices, counts = np.concatenate(lists), primitives.find("vcount")
        if primitives.tag == "triangles":
            sizes = np.full(len(indices) // 3, 3)
        else:
            sizes = np.array([len(one) for one in lists]) if counts is None else _numbers(counts).astype(np.intp)
        # A fan around the first corner of each polygon.
        fans: IntArray = np.maximum(sizes - 2, 0)
        first = np.repeat(np.cumsum(sizes) - sizes, fans)
        second: IntArray = first + 1 + np.arange(int(fans.sum())) - np.repeat(np.cumsum(fans) - fans, fans)
        faces = np.stack([indices[first], indices[second], indices[second + 1]], axis=1)
        yield points[_name(vertex, "source")].reshape(-1, 3), faces


def _instances(node: ET.Element, parent: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Ids of the geometries below a node, with their `(4, 4)` poses."""
    pose = parent.copy()
    for child in node:
        numbers = _numbers(child) if child.tag in _TRANSFORMS else np.empty(0)
        if child.tag == "matrix":
            pose = pose @ numbers.reshape(4, 4)
        elif child.tag == "translate":
            pose[:3, 3] += pose[:3, :3] @ numbers
        elif child.tag == "scale":
            pose[:3, :3] *= numbers
        elif child.tag == "rotate":
            axis = numbers[:3] / np.linalg.norm(numbers[:3])
            pose[:3, :3] = pose[:3, :3] @ cv2.Rodrigues(np.deg2rad(numbers[3]) * axis)[0]
        elif child.tag == "node":
            yield from _instances(child, pose)
        elif child.tag == "instance_geometry":
            yield _name(child, "url"), pose


def _numbers(element: ET.Element) -> FloatArray:
    return np.array((element.text or "").split(), dtype=np.float64)


def _name(element: ET.Element, key: str) -> str:
    return element.get(key, "").removeprefix("#")
