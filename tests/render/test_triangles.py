"""Triangles of a model's geoms for the truth without images."""

import mujoco
import numpy as np

from pftrack_sim.render.triangles import model_triangles

MODEL = mujoco.MjModel.from_xml_string("""
<mujoco>
  <asset><mesh name="wedge" vertex="0 0 0  1 0 0  0 2 0  0 0 3"/></asset>
  <worldbody>
    <geom type="plane" size="0 2 1"/>
    <geom type="sphere" size="0.5"/>
    <geom type="mesh" mesh="wedge"/>
    <geom type="capsule" size="0.2 1"/>
    <geom type="mesh" mesh="wedge"/>
    <geom type="box" size="1 2 3"/>
  </worldbody>
</mujoco>""")


def test_each_geom_has_the_triangles_of_its_shape():
    drawn = np.array([True, True, True, False, True, True])
    found = model_triangles(MODEL, drawn)
    assert found.vertices.dtype == np.float64
    assert found.faces.dtype == np.int32
    counts = np.diff(found.face_starts)
    assert (counts > 0).tolist() == drawn.tolist()
    for geom in range(MODEL.ngeom):
        vertices = found.vertices[found.vertex_starts[geom] : found.vertex_starts[geom + 1]]
        faces = found.faces[found.face_starts[geom] : found.face_starts[geom + 1]]
        if drawn[geom]:
            assert faces.max() == len(vertices) - 1
    mesh = found.vertices[found.vertex_starts[2] : found.vertex_starts[3]]
    np.testing.assert_array_equal(mesh, MODEL.mesh_vert.astype(np.float64))
