"""Shading of rays: the colour of each pixel. Texture, sky and light functions are MuJoCo Warp's own."""

# Warp evaluates annotations, so that they stay unquoted; a type checker can neither read nor infer these types.
# pyright: basic, reportInvalidTypeForm=false, reportPrivateUsage=false, reportGeneralTypeIssues=false
# pyright: reportIndexIssue=false, reportCallIssue=false, reportArgumentType=false, reportOperatorIssue=false
# pyright: reportAssignmentType=false, reportAttributeAccessIssue=false, reportPrivateImportUsage=false

import warp as wp

from pftrack_sim.render.warp.rays import (
    GEOM_TYPES,
    Appearance,
    Camera,
    GeomBvh,
    Geoms,
    GeomType,
    caster,
    first_hit,
    ray_of,
)

wp.set_module_options({"enable_backward": False})

_light = caster._make_compute_lighting(caster._make_cast_ray(GEOM_TYPES, first_hit=True))
_sample_texture = caster._make_sample_texture(GEOM_TYPES)


@wp.func
def texture_coordinate(geom_type: int, local: wp.vec3, normal: wp.vec3, size: wp.vec3, repeat: wp.vec2, uniform: bool):
    """Texture coordinate of a point on a geom other than a mesh with coordinates of its own, in repeats."""
    uv = wp.vec2(0.5 * local[0], 0.5 * local[1])
    _offset = wp.vec2(0.0)
    times = repeat
    if geom_type == int(GeomType.PLANE):
        uv, _offset, times = caster._texture_plane(local, size, repeat, uniform)
    elif geom_type == int(GeomType.BOX):
        uv, _offset, times = caster._texture_box(local, normal, size, repeat, uniform)
    elif geom_type == int(GeomType.CYLINDER):
        uv, _offset, times = caster._texture_cylinder(local, normal, size, repeat, uniform)
    elif geom_type == int(GeomType.CAPSULE):
        uv, _offset, times = caster._texture_capsule(local, size, repeat, uniform)
    elif geom_type == int(GeomType.SPHERE) or geom_type == int(GeomType.ELLIPSOID):
        uv, _offset, times = caster._texture_sphere_ellipsoid(
            local, size, repeat, uniform, geom_type == int(GeomType.SPHERE)
        )
    return wp.cw_mul(uv, times)


@wp.func
def offset_on_plane(eye: wp.vec3, direction: wp.vec3, point: wp.vec3, normal: wp.vec3):
    """Vector from a point to where a neighbouring ray meets the tangent plane there; very long if they are parallel."""
    slope = wp.dot(direction, normal)
    if wp.abs(slope) < 1.0e-6:
        slope = 1.0e-6
    return eye + direction * (wp.dot(point - eye, normal) / slope) - point


@wp.func
def mip_level(
    geoms: Geoms,
    appearance: Appearance,
    camera: Camera,
    x: float,
    y: float,
    geom: int,
    material: int,
    point: wp.vec3,
    normal: wp.vec3,
    face: int,
    mesh: int,
):
    """Mip level nearest to log2 of the longer side of a pixel's footprint in texels (OpenGL 4.6, section 8.14).

    OpenGL takes one footprint for two by two pixels: that of the lower left one.
    """
    eye = camera.eye
    left, row = 2.0 * wp.floor(0.5 * x) + 0.5, 2.0 * wp.floor(0.5 * y) + 1.5
    _first, corner, _flat = ray_of(camera, left, row)
    _origin, right, _cosine = ray_of(camera, left + 1.0, row)
    _start, up, _slant = ray_of(camera, left, row - 1.0)
    first = offset_on_plane(eye, corner, point, normal)
    across = offset_on_plane(eye, right, point, normal) - first
    along = offset_on_plane(eye, up, point, normal) - first
    texels = appearance.texture_size[material]
    inverse = wp.transpose(geoms.rotation[0, geom])
    across = inverse @ across
    along = inverse @ along
    repeat = appearance.repeat[material]
    side = wp.vec2(0.0)
    above = wp.vec2(0.0)
    if mesh >= 0 and face >= 0 and appearance.texcoord_start[mesh] >= 0:
        along_u = appearance.face_along_u[appearance.face_start[mesh] + face]
        along_v = appearance.face_along_v[appearance.face_start[mesh] + face]
        side = wp.cw_mul(repeat, wp.vec2(wp.dot(along_u, across), wp.dot(along_v, across)))
        above = wp.cw_mul(repeat, wp.vec2(wp.dot(along_u, along), wp.dot(along_v, along)))
    else:
        local = inverse @ (point - geoms.position[0, geom])
        local_normal = inverse @ normal
        size = geoms.size[0, geom]
        uniform = appearance.uniform[material] != 0
        geom_type = geoms.geom_type[geom]
        here = texture_coordinate(geom_type, local, local_normal, size, repeat, uniform)
        side = texture_coordinate(geom_type, local + across, local_normal, size, repeat, uniform) - here
        above = texture_coordinate(geom_type, local + along, local_normal, size, repeat, uniform) - here
    longest = wp.max(wp.length(wp.cw_mul(side, texels)), wp.length(wp.cw_mul(above, texels)))
    last = float(appearance.texture_levels[material] - 1)
    return int(wp.clamp(wp.log2(wp.max(longest, 1.0e-6)) + 0.5, 0.0, last))


@wp.func
def color_at(
    geoms: Geoms,
    appearance: Appearance,
    textures: wp.array(dtype=wp.Texture2D),
    bvh: GeomBvh,
    casters: GeomBvh,
    camera: Camera,
    x: float,
    y: float,
):
    """RGB through image point x, y, 0 to 1."""
    origin, direction, cosine = ray_of(camera, x, y)
    geom, distance, normal, u, v, face, mesh = first_hit(
        geoms, appearance, bvh, origin, direction, (camera.far - camera.near) / cosine
    )
    color = wp.vec3(0.0)
    if geom < 0:
        if appearance.sky >= 0:
            color = appearance.sky_brightness * caster.sample_skybox(
                textures[appearance.sky], 1.0 / float(appearance.sky_width), direction
            )
        return wp.min(color, wp.vec3(1.0))
    rotation = geoms.rotation[0, geom]
    face_normal = normal
    if mesh >= 0 and face >= 0:
        flat = wp.transpose(rotation) @ normal
        corners = appearance.face_normal[appearance.face_start[mesh] + face]
        start = appearance.normal_start[mesh]
        smooth = (
            caster.vertex_normal(appearance.normal[start + corners[0]], flat) * u
            + caster.vertex_normal(appearance.normal[start + corners[1]], flat) * v
            + caster.vertex_normal(appearance.normal[start + corners[2]], flat) * (1.0 - u - v)
        )
        normal = wp.normalize(rotation @ smooth)
    point = origin + direction * distance
    rgba, material = caster._geom_rgba(geoms.material, geoms.rgba, appearance.rgba, 0, geom)
    base = wp.vec3(rgba[0], rgba[1], rgba[2])
    specular = float(0.5)
    shininess = float(64.0)
    emission = float(0.0)
    texel = wp.vec3(1.0)
    if material >= 0:
        specular = appearance.specular[material]
        shininess = appearance.shininess[material] * 128.0
        emission = appearance.emission[material]
        texture = appearance.texture[material]
        if texture >= 0:
            level = mip_level(geoms, appearance, camera, x, y, geom, material, point, face_normal, face, mesh)
            # fmt: off
            texel = _sample_texture(
                geoms.geom_type, appearance.face_start, geom, geoms.size[0, geom],
                appearance.repeat[material], appearance.uniform[material] != 0, textures[texture + level],
                geoms.position[0, geom], rotation,
                appearance.face_texcoord, appearance.texcoord, appearance.texcoord_start,
                point, normal, u, v, face, mesh,
            )
            # fmt: on
    color = base * emission + wp.cw_mul(base, appearance.ambient)
    # As in MuJoCo, all lights without shadows are one render pass, and each light with shadows adds a pass. As in
    # OpenGL's fixed pipeline, each pass saturates before it is multiplied with the texture.
    shadowed = wp.vec3(0.0)
    highlight = wp.vec3(0.0)
    for light in range(appearance.lights):
        # fmt: off
        diffuse, specular_light = _light(
            geoms.geom_type, geoms.data, geoms.material, geoms.size, geoms.rgba,
            geoms.none_int, geoms.none_edge, geoms.none_float,
            appearance.rgba, geoms.position, geoms.rotation, geoms.none_points,
            casters.count > 0, casters.id, -1, casters.count, 0, casters.geoms, 0, geoms.mesh,
            geoms.none_ids, geoms.none_rgba, geoms.none_int, geoms.none_int, geoms.none_ids, geoms.none_roots,
            True, appearance.light_type[light], appearance.light_shadow[light] != 0,
            appearance.light_position[light], appearance.light_direction[light],
            appearance.light_attenuation[light], appearance.light_cutoff[light], appearance.light_exponent[light],
            appearance.light_diffuse[light], appearance.light_specular[light],
            normal, point, -direction, specular, shininess,
            True, 0.0, True, False, True,
        )
        # fmt: on
        if appearance.light_shadow[light] != 0:
            shadowed += wp.min(wp.cw_mul(base, diffuse), wp.vec3(1.0))
        else:
            color += wp.cw_mul(base, diffuse)
        highlight += specular_light
    color = wp.cw_mul(wp.min(color, wp.vec3(1.0)) + shadowed, texel) + highlight
    return wp.max(wp.min(color, wp.vec3(1.0)), wp.vec3(0.0))


@wp.kernel
def cast_color(
    geoms: Geoms,
    appearance: Appearance,
    textures: wp.array(dtype=wp.Texture2D),
    bvh: GeomBvh,
    casters: GeomBvh,
    camera: Camera,
    width: int,
    samples: int,
    image: wp.array2d(dtype=wp.uint8),
):
    """RGB of each pixel, the mean of samples x samples rays."""
    pixel = wp.tid()
    total = wp.vec3(0.0)
    step = 1.0 / float(samples)
    for sample in range(samples * samples):
        x = float(pixel % width) + (float(sample % samples) + 0.5) * step
        y = float(pixel // width) + (float(sample // samples) + 0.5) * step
        total += color_at(geoms, appearance, textures, bvh, casters, camera, x, y)
    total = total * (255.0 * step * step)
    for channel in range(3):
        image[pixel, channel] = wp.uint8(total[channel] + 0.5)
