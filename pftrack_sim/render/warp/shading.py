"""What colour arrives along a ray: texture, sky, lamps and their shadows.

Textures, sky and light are MuJoCo Warp's own functions; which level of detail of a texture is read, is decided here.
"""

# Warp reads annotations as values: they stay unquoted, and look odd to a type checker.
# pyright: reportInvalidTypeForm=false, reportPrivateUsage=false, reportGeneralTypeIssues=false
# pyright: reportIndexIssue=false, reportCallIssue=false, reportArgumentType=false, reportOperatorIssue=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false, reportPrivateImportUsage=false

import warp as wp

from pftrack_sim.render.warp.library import GeomType, caster
from pftrack_sim.render.warp.rays import KINDS, Cameras, Geoms, Looks, Tree, hit, ray_of

_lit = caster._make_compute_lighting(caster._make_cast_ray(KINDS, first_hit=True))
_texture = caster._make_sample_texture(KINDS)


@wp.func
def spot(kind: int, local: wp.vec3, normal: wp.vec3, size: wp.vec3, repeat: wp.vec2, uniform: bool):
    """Where a point of a geom lies on its texture, in repeats of it: all but meshes that say so themselves."""
    uv = wp.vec2(0.5 * local[0], 0.5 * local[1])
    _offset = wp.vec2(0.0)
    times = repeat
    if kind == int(GeomType.PLANE):
        uv, _offset, times = caster._texture_plane(local, size, repeat, uniform)
    elif kind == int(GeomType.BOX):
        uv, _offset, times = caster._texture_box(local, normal, size, repeat, uniform)
    elif kind == int(GeomType.CYLINDER):
        uv, _offset, times = caster._texture_cylinder(local, normal, size, repeat, uniform)
    elif kind == int(GeomType.CAPSULE):
        uv, _offset, times = caster._texture_capsule(local, size, repeat, uniform)
    elif kind == int(GeomType.SPHERE) or kind == int(GeomType.ELLIPSOID):
        uv, _offset, times = caster._texture_sphere_ellipsoid(
            local, size, repeat, uniform, kind == int(GeomType.SPHERE)
        )
    return wp.cw_mul(uv, times)


@wp.func
def step_on_plane(eye: wp.vec3, direction: wp.vec3, point: wp.vec3, normal: wp.vec3):
    """How far from a point a neighbouring ray meets the plane that touches the surface there; far off if never."""
    slope = wp.dot(direction, normal)
    if wp.abs(slope) < 1.0e-6:
        slope = 1.0e-6
    return eye + direction * (wp.dot(point - eye, normal) / slope) - point


@wp.func
def mip_level(
    geoms: Geoms,
    looks: Looks,
    cameras: Cameras,
    world: int,
    x: float,
    y: float,
    geom: int,
    material: int,
    point: wp.vec3,
    normal: wp.vec3,
    face: int,
    mesh: int,
):
    """Which level of detail one pixel's footprint on a surface asks for.

    The larger of its two sides counts, as in OpenGL 4.6, 8.14.1: log2 of its length in texels.
    """
    eye = cameras.eye[world]
    _origin, right, _cosine = ray_of(cameras, world, x + 1.0, y)
    _start, down, _slant = ray_of(cameras, world, x, y + 1.0)
    across = step_on_plane(eye, right, point, normal)
    along = step_on_plane(eye, down, point, normal)
    texels = looks.texture_size[material]
    inverse = wp.transpose(geoms.turn[0, geom])
    across = inverse @ across
    along = inverse @ along
    repeat = looks.repeat[material]
    side = wp.vec2(0.0)
    below = wp.vec2(0.0)
    if mesh >= 0 and face >= 0 and looks.texcoord_start[mesh] >= 0:
        along_u = looks.face_along_u[looks.face_start[mesh] + face]
        along_v = looks.face_along_v[looks.face_start[mesh] + face]
        side = wp.cw_mul(repeat, wp.vec2(wp.dot(along_u, across), wp.dot(along_v, across)))
        below = wp.cw_mul(repeat, wp.vec2(wp.dot(along_u, along), wp.dot(along_v, along)))
    else:
        local = inverse @ (point - geoms.position[0, geom])
        facing = inverse @ normal
        size = geoms.size[0, geom]
        uniform = looks.uniform[material] != 0
        kind = geoms.kind[geom]
        here = spot(kind, local, facing, size, repeat, uniform)
        side = spot(kind, local + across, facing, size, repeat, uniform) - here
        below = spot(kind, local + along, facing, size, repeat, uniform) - here
    longest = wp.max(wp.length(wp.cw_mul(side, texels)), wp.length(wp.cw_mul(below, texels)))
    last = float(looks.texture_levels[material] - 1)
    return wp.clamp(wp.log2(wp.max(longest, 1.0e-6)), 0.0, last)


@wp.func
def colour_of(
    geoms: Geoms,
    looks: Looks,
    textures: wp.array(dtype=wp.Texture2D),
    tree: Tree,
    casters: Tree,
    cameras: Cameras,
    shadows: bool,
    world: int,
    x: float,
    y: float,
):
    """Light that arrives through image point x, y: 0 to 1."""
    origin, direction, cosine = ray_of(cameras, world, x, y)
    geom, far, normal, u, v, face, mesh = hit(
        geoms, looks, tree, world, origin, direction, (cameras.far - cameras.near) / cosine
    )
    colour = wp.vec3(0.0)
    if geom < 0:
        if looks.sky[world] >= 0:
            colour = looks.sky_brightness[world] * caster.sample_skybox(
                textures[looks.sky[world]], 1.0 / float(looks.sky_width[world]), direction
            )
        return colour
    turn = geoms.turn[0, geom]
    touching = normal
    if mesh >= 0 and face >= 0:
        flat = wp.transpose(turn) @ normal
        corners = looks.face_normal[looks.face_start[mesh] + face]
        start = looks.normal_start[mesh]
        smooth = (
            caster.vertex_normal(looks.normal[start + corners[0]], flat) * u
            + caster.vertex_normal(looks.normal[start + corners[1]], flat) * v
            + caster.vertex_normal(looks.normal[start + corners[2]], flat) * (1.0 - u - v)
        )
        normal = wp.normalize(turn @ smooth)
    point = origin + direction * far
    paint, material = caster._geom_rgba(geoms.material, geoms.rgba, looks.rgba, 0, geom)
    base = wp.vec3(paint[0], paint[1], paint[2])
    specular = float(0.5)
    shine = float(64.0)
    glow = float(0.0)
    texel = wp.vec3(1.0)
    if material >= 0:
        specular = looks.specular[material]
        shine = looks.shininess[material] * 128.0
        glow = looks.emission[material]
        texture = looks.texture[material]
        if texture >= 0:
            level = mip_level(geoms, looks, cameras, world, x, y, geom, material, point, touching, face, mesh)
            finer = int(level)
            blend = level - float(finer)
            seen = wp.vec3(0.0)
            layers = wp.int32(1)
            if blend > 0.0:
                layers = 2
            for layer in range(layers):
                weight = 1.0 - blend
                if layer == 1:
                    weight = blend
                seen += weight * _texture(
                    geoms.kind,
                    looks.face_start,
                    geom,
                    geoms.size[0, geom],
                    looks.repeat[material],
                    looks.uniform[material] != 0,
                    textures[texture + finer + layer],
                    geoms.position[0, geom],
                    turn,
                    looks.face_texcoord,
                    looks.texcoord,
                    looks.texcoord_start,
                    point,
                    normal,
                    u,
                    v,
                    face,
                    mesh,
                )
            texel = seen
    colour = base * glow + wp.cw_mul(base, looks.ambient[world])
    # MuJoCo draws all lights without a shadow at once, and adds a drawing for each light with one. As OpenGL's fixed
    # pipeline does, what is lit saturates in each drawing before the texture is laid over it.
    apart = wp.vec3(0.0)
    highlight = wp.vec3(0.0)
    for index in range(looks.light_count[world]):
        light = looks.light_start[world] + index
        diffuse, gloss = _lit(
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
            shadows and casters.count > 0,
            casters.id,
            casters.roots[world],
            casters.count,
            0,
            casters.geoms,
            0,
            geoms.mesh,
            geoms.none_ids,
            geoms.none_rgba,
            geoms.none_int,
            geoms.none_int,
            geoms.none_ids,
            geoms.none_roots,
            True,
            looks.light_kind[light],
            looks.light_shadow[light] != 0,
            looks.light_position[light],
            looks.light_direction[light],
            looks.light_attenuation[light],
            looks.light_cutoff[light],
            looks.light_exponent[light],
            looks.light_diffuse[light],
            looks.light_specular[light],
            normal,
            point,
            -direction,
            specular,
            shine,
            True,
            0.0,
            True,
            False,
            True,
        )
        if looks.light_shadow[light] != 0:
            apart += wp.min(wp.cw_mul(base, diffuse), wp.vec3(1.0))
        else:
            colour += wp.cw_mul(base, diffuse)
        highlight += gloss
    colour = wp.cw_mul(wp.min(colour, wp.vec3(1.0)) + apart, texel) + highlight
    return wp.max(wp.min(colour, wp.vec3(1.0)), wp.vec3(0.0))
