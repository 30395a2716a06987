"""MuJoCo Warp's ray intersections, the arrays on the device that they read, and the first hit of a ray.

MuJoCo Warp's ready-made rendering kernel is not used: it compiles the number of lights and the ambient light into its
code (a compilation per scene, and no schedules of lights), has no geoms without a shadow, and casts whole images only.
"""

# Warp evaluates annotations, so that they stay unquoted; a type checker can neither read nor infer these types.
# pyright: basic, reportInvalidTypeForm=false, reportPrivateUsage=false, reportGeneralTypeIssues=false
# pyright: reportIndexIssue=false, reportCallIssue=false, reportArgumentType=false, reportOperatorIssue=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false, reportPrivateImportUsage=false

import sys
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from typing import Any

import warp as wp

_PACKAGE = "mujoco_warp"


def _import_parts(*names: str) -> list[Any]:
    """Import modules of MuJoCo Warp without the package's own `__init__`.

    The `__init__` prepares some 700 functions of the simulation, which takes two seconds; the ray caster alone takes a
    quarter of a second. A later `import mujoco_warp` still runs it.
    """
    if _PACKAGE in sys.modules:
        return [import_module(name) for name in names]
    spec = find_spec(_PACKAGE)
    if spec is None:
        raise ModuleNotFoundError(f"No module named {_PACKAGE!r}", name=_PACKAGE)
    sys.modules[_PACKAGE] = module_from_spec(spec)
    try:
        return [import_module(name) for name in names]
    finally:
        del sys.modules[_PACKAGE]


# Warp prints a greeting to standard output, which is for results.
wp.config.log_level = max(wp.config.log_level, wp.LOG_ERROR)

caster, _types = _import_parts(f"{_PACKAGE}._src.render", f"{_PACKAGE}._src.types")
GeomType: Any = _types.GeomType

GEOM_TYPES = tuple(
    sorted(int(GeomType[name]) for name in ("PLANE", "SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH"))
)
"""Types of geoms that can be drawn."""

_cast_ray = caster._make_cast_ray(GEOM_TYPES, first_hit=False)


@wp.struct
class Geoms:
    """Shapes, materials and poses of the geoms.

    The `none_` arrays stand for height fields and flexes, which MuJoCo Warp's functions take and scenes do not have.
    """

    geom_type: wp.array(dtype=int)
    data: wp.array2d(dtype=int)
    material: wp.array2d(dtype=int)
    size: wp.array2d(dtype=wp.vec3)
    rgba: wp.array2d(dtype=wp.vec4)
    position: wp.array2d(dtype=wp.vec3)
    rotation: wp.array2d(dtype=wp.mat33)
    mesh: wp.array(dtype=wp.uint64)
    none_int: wp.array(dtype=int)
    none_float: wp.array(dtype=float)
    none_edge: wp.array(dtype=wp.vec2i)
    none_points: wp.array2d(dtype=wp.vec3)
    none_ids: wp.array(dtype=wp.uint64)
    none_rgba: wp.array(dtype=wp.vec4)
    none_roots: wp.array2d(dtype=int)


@wp.struct
class Appearance:
    """Materials, texture coordinates of meshes, sky and lights."""

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
    sky: int
    sky_width: int
    sky_brightness: float
    ambient: wp.vec3
    lights: int
    light_type: wp.array(dtype=int)
    light_shadow: wp.array(dtype=int)
    light_position: wp.array(dtype=wp.vec3)
    light_direction: wp.array(dtype=wp.vec3)
    light_attenuation: wp.array(dtype=wp.vec3)
    light_cutoff: wp.array(dtype=float)
    light_exponent: wp.array(dtype=float)
    light_diffuse: wp.array(dtype=wp.vec3)
    light_specular: wp.array(dtype=wp.vec3)


@wp.struct
class GeomBvh:
    """Bounding volume hierarchy of some geoms."""

    id: wp.uint64
    geoms: wp.array(dtype=int)
    count: int


@wp.struct
class Camera:
    """x right, y down, z forward."""

    eye: wp.vec3
    rotation: wp.mat33
    focal_centre: wp.vec4
    near: float
    far: float


@wp.func
def ray_of(camera: Camera, x: float, y: float):
    """Ray through image point x, y [px]: its point on the near plane, direction, and cosine to the optical axis."""
    lens = camera.focal_centre
    local = wp.normalize(wp.vec3((x - lens[2]) / lens[0], (y - lens[3]) / lens[1], 1.0))
    direction = camera.rotation @ local
    return camera.eye + direction * (camera.near / local[2]), direction, local[2]


@wp.func
def first_hit(geoms: Geoms, appearance: Appearance, bvh: GeomBvh, origin: wp.vec3, direction: wp.vec3, reach: float):
    """First hit of a ray: geom, distance, normal, barycentric coordinates, face, mesh."""
    # fmt: off
    return _cast_ray(
        geoms.geom_type, geoms.data, geoms.material, geoms.size, geoms.rgba,
        geoms.none_int, geoms.none_edge, geoms.none_float,
        appearance.rgba, geoms.position, geoms.rotation, geoms.none_points,
        bvh.id, -1, 0, bvh.count, 0, bvh.geoms, geoms.mesh,
        geoms.none_ids, geoms.none_rgba, geoms.none_int, geoms.none_int, geoms.none_ids, geoms.none_roots,
        origin, direction, reach, True,
    )
    # fmt: on
