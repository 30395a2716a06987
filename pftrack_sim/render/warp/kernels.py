"""Kernels: geom and inverse depth of each pixel, its color, and the visible boxes of people.

All kernels are in one module, because Warp compiles per module: functions they share are compiled once.
"""

# Warp evaluates annotations, so that they stay unquoted; a type checker cannot read them.
# pyright: reportInvalidTypeForm=false, reportPrivateUsage=false, reportGeneralTypeIssues=false
# pyright: reportIndexIssue=false, reportCallIssue=false, reportArgumentType=false, reportOperatorIssue=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false, reportPrivateImportUsage=false

import warp as wp

from pftrack_sim.render.warp.rays import Appearance, Cameras, GeomBvh, Geoms, first_hit, ray_of
from pftrack_sim.render.warp.shading import color_at

wp.set_module_options({"enable_backward": False})


@wp.kernel
def cast_ids(
    geoms: Geoms,
    appearance: Appearance,
    bvh: GeomBvh,
    cameras: Cameras,
    left: int,
    top: int,
    width: int,
    ids: wp.array2d(dtype=int),
    inverse_depth: wp.array2d(dtype=float),
):
    """Geom and inverse depth at each pixel of a rectangle; -1 and 0 where there is none."""
    world, pixel = wp.tid()
    x = float(left + pixel % width) + 0.5
    y = float(top + pixel // width) + 0.5
    origin, direction, cosine = ray_of(cameras, world, x, y)
    geom, distance, _normal, _u, _v, _face, _mesh = first_hit(
        geoms, appearance, bvh, world, origin, direction, (cameras.far - cameras.near) / cosine
    )
    ids[world, pixel] = geom
    inverse_depth[world, pixel] = 0.0
    if geom >= 0:
        inverse_depth[world, pixel] = 1.0 / (cameras.near + distance * cosine)


@wp.kernel
def cast_color(
    geoms: Geoms,
    appearance: Appearance,
    textures: wp.array(dtype=wp.Texture2D),
    bvh: GeomBvh,
    casters: GeomBvh,
    cameras: Cameras,
    width: int,
    samples: int,
    image: wp.array3d(dtype=wp.uint8),
):
    """RGB of each pixel, the mean of samples x samples rays."""
    world, pixel = wp.tid()
    total = wp.vec3(0.0)
    step = 1.0 / float(samples)
    for sample in range(samples * samples):
        x = float(pixel % width) + (float(sample % samples) + 0.5) * step
        y = float(pixel // width) + (float(sample // samples) + 0.5) * step
        total += color_at(geoms, appearance, textures, bvh, casters, cameras, world, x, y)
    total = total * (255.0 * step * step)
    for channel in range(3):
        image[world, pixel, channel] = wp.uint8(total[channel] + 0.5)


@wp.kernel
def roots_of(bvh: wp.uint64, roots: wp.array(dtype=int)):
    """Root of each world's group in a bounding volume hierarchy."""
    world = wp.tid()
    roots[world] = wp.bvh_get_group_root(bvh, world)


@wp.kernel
def person_extents(
    ids: wp.array2d(dtype=int), person_of_geom: wp.array(dtype=int), width: int, extents: wp.array3d(dtype=int)
):
    """First column and row, last column and row, and number of each person's visible pixels."""
    world, pixel = wp.tid()
    geom = ids[world, pixel]
    if geom < 0:
        return
    person = person_of_geom[geom]
    if person < 0:
        return
    column = pixel % width
    row = pixel // width
    wp.atomic_min(extents, world, person, 0, column)
    wp.atomic_min(extents, world, person, 1, row)
    wp.atomic_max(extents, world, person, 2, column)
    wp.atomic_max(extents, world, person, 3, row)
    wp.atomic_add(extents, world, person, 4, 1)
