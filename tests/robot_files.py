"""Small robots as MJCF and URDF, written by tests."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

PAN_AT, TILT_AT, LENS_AT = np.array([0.1, 0.05, 0.6]), np.array([0.0, -0.02, 0.1]), np.array([0.08, 0.03, 0.02])
"""Axis of the pan joint on the body, of the tilt joint on the pan, and the camera on the tilt [m]."""

EYE = '<camera name="eye" pos="0.08 0.03 0.02" xyaxes="0 -1 0 0 0 1"/>'
MJCF = f"""<mujoco model="cart">
  <compiler angle="degree"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <light pos="0 0 3"/>
    <geom type="plane" size="5 5 0.1"/>
    <body name="cart" pos="0.5 -0.3 0.25" euler="0 0 0">
      <freejoint/>
      <geom name="box" type="box" size="0.3 0.2 0.1"/>
      <geom name="flag" type="box" size="0.01 0.01 0.2" pos="-0.28 0 0.3" contype="0" conaffinity="0"/>
      <body name="left" pos="0 0.25 -0.1"><joint name="wheel_l" axis="0 1 0"/><geom type="sphere" size="0.15"/></body>
      <body name="right" pos="0 -0.25 -0.1"><joint name="wheel_r" axis="0 -1 0"/><geom size="0.15"/></body>
      <frame pos="0.05 0 0"><body name="neck" pos="0.05 0.05 0.35">
        <joint name="neck_pan" axis="0 0 -1" range="-100 100"/>
        <geom type="cylinder" size="0.03 0.05" pos="0 0 0.05"/>
        <body name="face" pos="0 -0.02 0.1">
          <joint name="neck_tilt" axis="0 1 0" range="-40 30"/>
          <geom type="box" size="0.05 0.05 0.03"/>
          {EYE}
        </body>
      </body></frame>
      <body name="arm" pos="0.2 0 0.1"><joint name="lift" axis="0 1 0"/><geom type="capsule" size="0.02 0.1"/></body>
    </body>
  </worldbody>
  <actuator><motor joint="lift"/></actuator>
  <keyframe><key qpos="0.5 -0.3 0.25 1 0 0 0 0 0 0 0 0.4"/></keyframe>
</mujoco>
"""

URDF = """<?xml version="1.0"?>
<robot name="cart">
  <link name="base_link">
    <visual><geometry><mesh filename="package://cart_description/meshes/body.dae"/></geometry></visual>
    <collision><geometry><box size="0.6 0.4 0.2"/></geometry></collision>
  </link>
  <link name="wheel_l"><collision><geometry><sphere radius="0.15"/></geometry></collision></link>
  <joint name="wheel_l" type="continuous"><parent link="base_link"/><child link="wheel_l"/>
    <origin xyz="0 0.25 -0.1"/><axis xyz="0 1 0"/></joint>
  <link name="wheel_r"><collision><geometry><sphere radius="0.15"/></geometry></collision></link>
  <joint name="wheel_r" type="continuous"><parent link="base_link"/><child link="wheel_r"/>
    <origin xyz="0 -0.25 -0.1"/><axis xyz="0 -1 0"/></joint>
  <link name="neck"><visual><geometry><mesh filename="meshes/body.stl"/></geometry></visual></link>
  <joint name="neck_pan" type="revolute"><parent link="base_link"/><child link="neck"/>
    <origin xyz="0.1 0.05 0.35"/><axis xyz="0 0 -1"/>
    <limit lower="-1.7453" upper="1.7453" effort="1" velocity="1"/></joint>
  <link name="face"/>
  <joint name="neck_tilt" type="revolute"><parent link="neck"/><child link="face"/>
    <origin xyz="0 -0.02 0.1"/><axis xyz="0 1 0"/><limit lower="-0.698" upper="0.5236" effort="1" velocity="1"/></joint>
  <link name="camera_link"/>
  <joint name="camera_fixed" type="fixed"><parent link="face"/><child link="camera_link"/>
    <origin xyz="0.08 0.03 0.02"/></joint>
  <link name="camera_optical_frame"/>
  <joint name="optical_fixed" type="fixed"><parent link="camera_link"/><child link="camera_optical_frame"/>
    <origin rpy="-1.5707963267948966 0 -1.5707963267948966"/></joint>
</robot>
"""

_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def write_mjcf(folder: Path, text: str = MJCF) -> Path:
    """A cart with a head as MJCF."""
    file = folder / "cart.xml"
    file.write_text(text)
    return file


def write_urdf(folder: Path, text: str = URDF) -> Path:
    """The same cart as URDF, with a COLLADA and an STL mesh of one name in two places."""
    root = folder / "cart_description"
    (root / "meshes").mkdir(parents=True)
    (root / "urdf" / "meshes").mkdir(parents=True)
    (root / "meshes" / "body.dae").write_text(dae((0.3, 0.2, 0.1)))
    (root / "urdf" / "meshes" / "body.stl").write_bytes(stl((0.02, 0.02, 0.04)))
    file = root / "urdf" / "cart.urdf"
    file.write_text(text)
    return file


def stl(half: tuple[float, float, float]) -> bytes:
    """A box as binary STL."""
    points = _CORNERS * half
    triangles = [points[[a, *pair]] for a, b, c, d in _QUADS for pair in ((b, c), (c, d))]
    records = [struct.pack("<12fH", 0.0, 0.0, 0.0, *triangle.ravel(), 0) for triangle in triangles]
    return bytes(80) + struct.pack("<I", len(records)) + b"".join(records)


def dae(half: tuple[float, float, float]) -> str:
    """A box as COLLADA in millimetres, of quadrilaterals, turned and shifted back by its scene."""
    turned = _CORNERS * half @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) - (0.0, 0.0, 0.5)
    unused = [9e3, 9e3, 9e3]
    numbers = " ".join(f"{number:.9g}" for number in [*(1000.0 * turned).ravel(), *unused])
    indices = " ".join(f"{corner} 0" for quad in _QUADS for corner in quad)

    def accessor(source: str, count: int) -> str:
        names = "".join(f'<param name="{name}" type="float"/>' for name in "XYZ")
        words = f'<accessor source="#{source}" count="{count}" stride="3">{names}</accessor>'
        return f"<technique_common>{words}</technique_common>"

    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="millimeter" meter="0.001"/></asset>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="a" count="27">{numbers}</float_array>{accessor("a", 9)}</source>
    <source id="n"><float_array id="b" count="3">0 0 1</float_array>{accessor("b", 1)}</source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <polylist count="6"><input semantic="VERTEX" source="#v" offset="0"/>
      <input semantic="NORMAL" source="#n" offset="1"/>
      <vcount>4 4 4 4 4 4</vcount><p>{indices}</p></polylist>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node><translate>0 0 500</translate>
    <node><rotate>0 0 1 90</rotate><instance_geometry url="#g"/></node>
  </node></visual_scene></library_visual_scenes>
</COLLADA>"""
