"""Area lights whose radiance is a texture (T1): where they emit, how much, and the density of that choice.

`light_point` maps the unit square to a light's surface, keeping ratios of areas. For a textured rectangle, sphere,
disk or cylinder a table over that square, made by `pmviewer.scene.emission`, says how bright each of its cells is.
Points are picked by it, so photons start with nearly equal powers and light samples look where it is bright. Radiance
itself comes from the texture. Mesh lights pick their points uniformly; flat rectangles of two triangles count as
rectangles.

Scenes without textured lights compile none of this: their records have no field `light_textures`.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.accel.opacity import lets_pass, over_opacity
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.memory import load_f4, load_i4, load_i8
from pmviewer.kernels.scene import (
    DISK,
    L_A,
    L_B,
    L_C,
    L_COUNT,
    L_FIRST,
    L_KIND,
    L_LENGTH,
    L_RADIANCE,
    L_RADIUS,
    LIGHT_TEXTURE_COLUMNS,
    LT_COLUMNS,
    LT_FIRST,
    LT_ROWS,
    LT_TEXTURE,
    MESH,
    PARALLELOGRAM,
    SPHERE,
    light_number,
    light_vector,
)
from pmviewer.kernels.table import find_interval
from pmviewer.kernels.textures.texture import texture_rgb
from pmviewer.kernels.textures.uv import azimuth, barycentrics, disk_uv, hit_uv, in_frame, sphere_uv
from pmviewer.kernels.vector import basis, cross, dot, sub
from pmviewer.kernels.warp import square_to_triangle

_f4 = np.float32
_BELOW_ONE = _f4(0.99999994)


@device
def _setting(scene, light, column):
    if scene.light_textures == 0:
        return np.int64(-1)
    return load_i8(scene.light_textures, light * LIGHT_TEXTURE_COLUMNS + column)


@specialised
def spread(scene, light, u, v):
    """Uniform numbers (u, v) as those that `light_point` shall get, and the density per area relative to a uniform one:
    (u, v, 1) for a light without texture."""
    if not has(scene, "light_textures"):
        return lambda scene, light, u, v: (u, v, _f4(1.0))
    return lambda scene, light, u, v: _spread_by_table(scene, light, u, v)


@specialised
def area_density(scene, light, p):
    """The density that `spread` returns when `light_point` makes the point p."""
    if not has(scene, "light_textures"):
        return lambda scene, light, p: _f4(1.0)
    return lambda scene, light, p: _density_by_table(scene, light, p)


@specialised
def radiance_from(scene, light, p, u, v):
    """Radiance that an area light emits at its point p = `light_point`(u, v), on the side that emits."""
    if not has(scene, "light_textures"):
        return lambda scene, light, p, u, v: light_vector(scene, light, L_RADIANCE)
    return lambda scene, light, p, u, v: _textured_from(scene, light, p, u, v)


@specialised
def emission_at(scene, light, prim, p):
    """The radiance of what a ray has hit there, on the light's primitive `prim`: where the surface lets rays pass, the
    same over its opacity, because that many are stopped."""
    if lets_pass(scene) and not has(scene, "light_textures"):
        return lambda scene, light, prim, p: _uncovered(scene, prim, p, light_vector(scene, light, L_RADIANCE))
    if lets_pass(scene):
        return lambda scene, light, prim, p: _uncovered(scene, prim, p, _textured_at(scene, light, prim, p))
    if not has(scene, "light_textures"):
        return lambda scene, light, prim, p: light_vector(scene, light, L_RADIANCE)
    return lambda scene, light, prim, p: _textured_at(scene, light, prim, p)


@device
def _uncovered(scene, prim, p, radiance):
    b1, b2 = barycentrics(scene, prim, p)
    return over_opacity(scene, prim, b1, b2, p, radiance)


@device
def _cell(scene, first, count, u):
    """An entry of a cumulative table, its probability, and the place of u in it."""
    k = find_interval(scene.light_tables, count, first, u)
    low = _f4(0.0) if k == 0 else load_f4(scene.light_tables, first + k - 1)
    width = load_f4(scene.light_tables, first + k) - low
    place = _f4(0.5)
    if width > _f4(0.0):
        place = max(_f4(0.0), min((u - low) / width, _BELOW_ONE))
    return k, width, place


@device
def _spread_by_table(scene, light, u, v):
    first = _setting(scene, light, LT_FIRST)
    if first < 0:
        return u, v, _f4(1.0)
    rows, columns = _setting(scene, light, LT_ROWS), _setting(scene, light, LT_COLUMNS)
    j, p_row, y = _cell(scene, first, rows, v)
    i, p_column, x = _cell(scene, first + rows + j * columns, columns, u)
    u, v = (_f4(i) + x) / _f4(columns), (_f4(j) + y) / _f4(rows)
    return min(u, _BELOW_ONE), min(v, _BELOW_ONE), p_row * _f4(rows) * p_column * _f4(columns)


@device
def _entry(scene, first, k):
    high = load_f4(scene.light_tables, first + k)
    return high if k == 0 else high - load_f4(scene.light_tables, first + k - 1)


@device
def _density_by_table(scene, light, p):
    first = _setting(scene, light, LT_FIRST)
    if first < 0:
        return _f4(1.0)
    rows, columns = _setting(scene, light, LT_ROWS), _setting(scene, light, LT_COLUMNS)
    u, v = _square_of(scene, light, p)
    i = max(np.int64(0), min(np.int64(u * _f4(columns)), columns - 1))
    j = max(np.int64(0), min(np.int64(v * _f4(rows)), rows - 1))
    p_row, p_column = _entry(scene, first, j), _entry(scene, first + rows + j * columns, i)
    return p_row * _f4(rows) * p_column * _f4(columns)


@device
def _on_rectangle(scene, light, p):
    b, c = light_vector(scene, light, L_B), light_vector(scene, light, L_C)
    d, n = sub(p, light_vector(scene, light, L_A)), cross(b, c)
    inv = _f4(1.0) / dot(n, n)
    return dot(cross(d, c), n) * inv, dot(cross(b, d), n) * inv


@device
def disk_to_square(x, y):
    """Inverse of `square_to_disk`."""
    r = _f4(math.sqrt(x * x + y * y))
    a, b = _f4(0.0), _f4(0.0)
    if abs(x) > abs(y):
        a = _f4(math.copysign(r, x))
        b = a * _f4(math.atan(y / x)) * _f4(4.0 / math.pi)
    elif r > _f4(0.0):
        b = _f4(math.copysign(r, y))
        a = b * _f4(math.atan(x / y)) * _f4(4.0 / math.pi)
    half = _f4(0.5)
    return half * (a + _f4(1.0)), half * (b + _f4(1.0))


@device
def _square_of(scene, light, p):
    """The numbers that `light_point` maps to the point p of a rectangle, sphere, disk or cylinder."""
    kind = np.int32(light_number(scene, light, L_KIND))
    if kind == PARALLELOGRAM:
        return _on_rectangle(scene, light, p)
    d = sub(p, light_vector(scene, light, L_A))
    radius = light_number(scene, light, L_RADIUS)
    if kind == SPHERE:
        return _f4(0.5) * (_f4(1.0) - d[2] / radius), azimuth(d[0], d[1])
    axis = light_vector(scene, light, L_B)
    s, t = basis(axis)
    if kind == DISK:
        return disk_to_square(dot(d, s) / radius, dot(d, t) / radius)
    return azimuth(dot(d, s), dot(d, t)), dot(d, axis) / light_number(scene, light, L_LENGTH)


@device
def _light_uv(scene, light, p):
    """Texture coordinates of the point p of a rectangle, sphere, disk or cylinder.

    `light_frames` has the axes of round lights and of rectangles u0, ∂u/∂s, ∂u/∂t, v0, ∂v/∂s, ∂v/∂t over the edges.
    """
    frame = light * 9
    kind = np.int32(light_number(scene, light, L_KIND))
    if kind == PARALLELOGRAM:
        s, t = _on_rectangle(scene, light, p)
        f = scene.light_frames
        return (
            load_f4(f, frame) + s * load_f4(f, frame + 1) + t * load_f4(f, frame + 2),
            load_f4(f, frame + 3) + s * load_f4(f, frame + 4) + t * load_f4(f, frame + 5),
        )
    radius = light_number(scene, light, L_RADIUS)
    d = sub(p, light_vector(scene, light, L_A))
    x, y, z = in_frame(scene.light_frames, frame, d)
    if kind == SPHERE:
        return sphere_uv(x / radius, y / radius, z / radius)
    if kind == DISK:
        return disk_uv(x, y, radius)
    return azimuth(x, y), z / light_number(scene, light, L_LENGTH)


@device
def picked_triangle(scene, light, u):
    """A triangle of a mesh that is a light, by area, and u stretched to [0, 1) for another use."""
    first = np.int64(light_number(scene, light, L_FIRST))
    count = np.int64(light_number(scene, light, L_COUNT))
    k = find_interval(scene.light_triangle_cdf, count, first, u)
    low = _f4(0.0) if k == 0 else load_f4(scene.light_triangle_cdf, first + k - 1)
    width = load_f4(scene.light_triangle_cdf, first + k) - low
    if width > _f4(0.0):
        u = min((u - low) / width, _BELOW_ONE)
    return np.int64(load_i4(scene.light_triangles, first + k)), u


@device
def _textured_from(scene, light, p, u, v):
    texture = _setting(scene, light, LT_TEXTURE)
    if texture < 0:
        return light_vector(scene, light, L_RADIANCE)
    if np.int32(light_number(scene, light, L_KIND)) == MESH:
        triangle, u = picked_triangle(scene, light, u)
        b1, b2 = square_to_triangle(u, v)
        s, t = hit_uv(scene, triangle, b1, b2, p)
        return texture_rgb(scene, texture, s, t)
    s, t = _light_uv(scene, light, p)
    return texture_rgb(scene, texture, s, t)


@device
def _textured_at(scene, light, prim, p):
    texture = _setting(scene, light, LT_TEXTURE)
    if texture < 0:
        return light_vector(scene, light, L_RADIANCE)
    if np.int32(light_number(scene, light, L_KIND)) == MESH:
        b1, b2 = barycentrics(scene, prim, p)
        s, t = hit_uv(scene, prim, b1, b2, p)
        return texture_rgb(scene, texture, s, t)
    s, t = _light_uv(scene, light, p)
    return texture_rgb(scene, texture, s, t)
