"""What rays are cast at, as the device holds it, and how one ray finds what it meets first.

Intersections are MuJoCo Warp's own functions. Its ready-made kernel is not used because it bakes number of lights and
ambient light into the code (a compilation per scene, none of the scenario's schedules), has no geoms without a shadow,
and always casts the whole image.
"""

# Warp reads annotations as values: they stay unquoted, and look odd to a type checker.
# pyright: reportInvalidTypeForm=false, reportPrivateUsage=false, reportGeneralTypeIssues=false
# pyright: reportIndexIssue=false, reportCallIssue=false, reportArgumentType=false, reportOperatorIssue=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false, reportPrivateImportUsage=false

import warp as wp

from pftrack_sim.render.warp.library import GeomType, caster

KINDS = tuple(
    sorted(
        int(kind)
        for kind in (
            GeomType.PLANE,
            GeomType.SPHERE,
            GeomType.CAPSULE,
            GeomType.ELLIPSOID,
            GeomType.CYLINDER,
            GeomType.BOX,
            GeomType.MESH,
        )
    )
)
"""Types of geoms that can be drawn."""

_nearest = caster._make_cast_ray(KINDS, first_hit=False)


@wp.struct
class Geoms:
    """Shapes, looks and positions of the geoms of all worlds, one after the other."""

    kind: wp.array(dtype=int)
    data: wp.array2d(dtype=int)
    material: wp.array2d(dtype=int)
    size: wp.array2d(dtype=wp.vec3)
    rgba: wp.array2d(dtype=wp.vec4)
    position: wp.array2d(dtype=wp.vec3)
    turn: wp.array2d(dtype=wp.mat33)
    mesh: wp.array(dtype=wp.uint64)
    none_int: wp.array(dtype=int)
    none_float: wp.array(dtype=float)
    none_edge: wp.array(dtype=wp.vec2i)
    none_points: wp.array2d(dtype=wp.vec3)
    none_ids: wp.array(dtype=wp.uint64)
    none_rgba: wp.array(dtype=wp.vec4)
    none_roots: wp.array2d(dtype=int)


@wp.struct
class Looks:
    """Materials, how textures lie on meshes, and lights."""

    rgba: wp.array2d(dtype=wp.vec4)
    texture: wp.array(dtype=int)
    texture_levels: wp.array(dtype=int)
    texture_size: wp.array(dtype=wp.vec2)
    repeat: wp.array(dtype=wp.vec2)
    uniform: wp.array(dtype=int)
    emission: wp.array(dtype=float)
    specular: wp.array(dtype=float)
    shininess: wp.array(dtype=float)
    face_start: wp.array(dtype=int)
    face_texcoord: wp.array(dtype=wp.vec3i)
    face_along_u: wp.array(dtype=wp.vec3)
    face_along_v: wp.array(dtype=wp.vec3)
    texcoord: wp.array(dtype=wp.vec2)
    texcoord_start: wp.array(dtype=int)
    face_normal: wp.array(dtype=wp.vec3i)
    normal_start: wp.array(dtype=int)
    normal: wp.array(dtype=wp.vec3)
    sky: wp.array(dtype=int)
    sky_width: wp.array(dtype=int)
    sky_brightness: wp.array(dtype=float)
    ambient: wp.array(dtype=wp.vec3)
    light_start: wp.array(dtype=int)
    light_count: wp.array(dtype=int)
    light_kind: wp.array(dtype=int)
    light_shadow: wp.array(dtype=int)
    light_position: wp.array(dtype=wp.vec3)
    light_direction: wp.array(dtype=wp.vec3)
    light_attenuation: wp.array(dtype=wp.vec3)
    light_cutoff: wp.array(dtype=float)
    light_exponent: wp.array(dtype=float)
    light_diffuse: wp.array(dtype=wp.vec3)
    light_specular: wp.array(dtype=wp.vec3)


@wp.struct
class Tree:
    """Bounding boxes of some geoms: a group per world."""

    id: wp.uint64
    roots: wp.array(dtype=int)
    geoms: wp.array(dtype=int)
    count: int


@wp.struct
class Cameras:
    """One camera per world; camera axes as OpenCV."""

    eye: wp.array(dtype=wp.vec3)
    turn: wp.array(dtype=wp.mat33)
    focal_centre: wp.array(dtype=wp.vec4)
    near: float
    far: float


@wp.func
def ray_of(cameras: Cameras, world: int, x: float, y: float):
    """Where the ray through image point x, y [px] crosses the near plane, its direction, and the cosine to the axis."""
    lens = cameras.focal_centre[world]
    local = wp.normalize(wp.vec3((x - lens[2]) / lens[0], (y - lens[3]) / lens[1], 1.0))
    direction = cameras.turn[world] @ local
    return cameras.eye[world] + direction * (cameras.near / local[2]), direction, local[2]


@wp.func
def hit(geoms: Geoms, looks: Looks, tree: Tree, world: int, origin: wp.vec3, direction: wp.vec3, reach: float):
    """What a ray meets first: geom, distance, normal, barycentric coordinates, face, mesh."""
    return _nearest(
        geoms.kind,
        geoms.data,
        geoms.material,
        geoms.size,
        geoms.rgba,
        geoms.none_int,
        geoms.none_edge,
        geoms.none_float,
        looks.rgba,
        geoms.position,
        geoms.turn,
        geoms.none_points,
        tree.id,
        tree.roots[world],
        0,
        tree.count,
        0,
        tree.geoms,
        geoms.mesh,
        geoms.none_ids,
        geoms.none_rgba,
        geoms.none_int,
        geoms.none_int,
        geoms.none_ids,
        geoms.none_roots,
        origin,
        direction,
        reach,
        True,
    )
