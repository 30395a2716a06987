"""What runs on the device: geom and depth of each pixel, its colour, and boxes around people.

All kernels are in this one module: Warp compiles module by module, so what they share is compiled once.
"""

# Warp reads annotations as values: they stay unquoted, and look odd to a type checker.
# pyright: reportInvalidTypeForm=false, reportPrivateUsage=false, reportGeneralTypeIssues=false
# pyright: reportIndexIssue=false, reportCallIssue=false, reportArgumentType=false, reportOperatorIssue=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false, reportPrivateImportUsage=false

import warp as wp

from pftrack_sim.render.warp.rays import Cameras, Geoms, Looks, Tree, hit, ray_of
from pftrack_sim.render.warp.shading import colour_of

wp.set_module_options({"enable_backward": False})


@wp.kernel
def cast_ids(
    geoms: Geoms,
    looks: Looks,
    tree: Tree,
    cameras: Cameras,
    left: int,
    top: int,
    width: int,
    ids: wp.array2d(dtype=int),
    nearness: wp.array2d(dtype=float),
):
    """Geom and 1 / depth of each pixel of a rectangle; -1 and 0 where there is none."""
    world, pixel = wp.tid()
    x = float(left + pixel % width) + 0.5
    y = float(top + pixel // width) + 0.5
    origin, direction, cosine = ray_of(cameras, world, x, y)
    geom, far, _normal, _u, _v, _face, _mesh = hit(
        geoms, looks, tree, world, origin, direction, (cameras.far - cameras.near) / cosine
    )
    ids[world, pixel] = geom
    nearness[world, pixel] = 0.0
    if geom >= 0:
        nearness[world, pixel] = 1.0 / (cameras.near + far * cosine)


@wp.kernel
def cast_colour(
    geoms: Geoms,
    looks: Looks,
    textures: wp.array(dtype=wp.Texture2D),
    tree: Tree,
    casters: Tree,
    cameras: Cameras,
    shadows: bool,
    width: int,
    samples: int,
    image: wp.array3d(dtype=wp.uint8),
):
    """Colour of each pixel, the mean of samples x samples rays."""
    world, pixel = wp.tid()
    total = wp.vec3(0.0)
    step = 1.0 / float(samples)
    for sample in range(samples * samples):
        x = float(pixel % width) + (float(sample % samples) + 0.5) * step
        y = float(pixel // width) + (float(sample // samples) + 0.5) * step
        total += colour_of(geoms, looks, textures, tree, casters, cameras, shadows, world, x, y)
    total = total * (255.0 * step * step)
    for channel in range(3):
        image[world, pixel, channel] = wp.uint8(total[channel] + 0.5)


@wp.kernel
def roots_of(tree: wp.uint64, roots: wp.array(dtype=int)):
    """Where the group of each world begins in a tree."""
    world = wp.tid()
    roots[world] = wp.bvh_get_group_root(tree, world)


@wp.kernel
def boxes_of(ids: wp.array2d(dtype=int), person: wp.array(dtype=int), width: int, boxes: wp.array3d(dtype=int)):
    """First and last column and row of each person's visible pixels: left, top, right, bottom, and their number."""
    world, pixel = wp.tid()
    geom = ids[world, pixel]
    if geom < 0:
        return
    who = person[geom]
    if who < 0:
        return
    column = pixel % width
    row = pixel // width
    wp.atomic_min(boxes, world, who, 0, column)
    wp.atomic_min(boxes, world, who, 1, row)
    wp.atomic_max(boxes, world, who, 2, column)
    wp.atomic_max(boxes, world, who, 3, row)
    wp.atomic_add(boxes, world, who, 4, 1)
