"""Lat-long image environments (T1), as Mitsuba 3's `envmap`: radiance, sampling by luminance, photons.

The image's columns go round once, texel centres at (i + ½)/width; rows run from pole to pole, the first and the last
one lying on the poles. In the image's own frame its middle is the direction (0, 0, 1), its top (0, 1, 0).
Radiance is interpolated bilinearly between texels, and directions are sampled with exactly its luminance as density:

    pdf(ω) = Y(L(ω)) / T,   T = ∫ Y(L) dω

so that every sample of an unoccluded sky counts the same, and all photons have one power. A cell lies between two rows
and two columns of texel centres. With α its upper angle, β its height and A, B the means of the luminance on its upper
and lower edge, it holds the share ∫₀¹ (A + t·(B − A))·sin(α + tβ) dt; the tables have the cumulative shares of the rows
of cells, and of the cells within each row.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.lights.distant import behind_scene, outside
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import L_A, L_AREA, L_B, L_C, light_number, light_vector, load3
from pmviewer.kernels.table import find_interval
from pmviewer.kernels.vector import along, dot, luminance, scale

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_NEWTON_STEPS = 40


@device
def _texel(scene, row, column):
    return load3(scene.sky_texels, (row * scene.sky_width + column) * _i8(3))


@device
def _between(a, b, s):
    r = _f4(1.0) - s
    return a[0] * r + b[0] * s, a[1] * r + b[1] * s, a[2] * r + b[2] * s


@device
def image_radiance(scene, light, d):
    """Radiance that arrives against the unit direction d, which points away from the scene."""
    x = dot(light_vector(scene, light, L_A), d)
    y = dot(light_vector(scene, light, L_B), d)
    z = dot(light_vector(scene, light, L_C), d)
    width, height = scene.sky_width, scene.sky_height
    turn = _f8(math.atan2(x, -z)) * _f8(0.5 / math.pi)
    turn -= math.floor(turn)
    place = turn * _f8(width) - _f8(0.5)
    if place < _f8(0.0):
        place += _f8(width)
    column = min(_i8(place), width - 1)
    s = _f4(place - _f8(column))
    # atan2 keeps its digits at the poles, where acos loses half of them.
    down = _f8(math.atan2(_f4(math.sqrt(x * x + z * z)), y)) * _f8(1.0 / math.pi) * _f8(height - 1)
    row = min(_i8(down), height - 2)
    t = _f4(down - _f8(row))
    following = column + 1
    if following == width:
        following = _i8(0)
    upper = _between(_texel(scene, row, column), _texel(scene, row, following), s)
    lower = _between(_texel(scene, row + 1, column), _texel(scene, row + 1, following), s)
    return _between(upper, lower, t)


@device
def image_pdf(scene, light, L):
    """Density per solid angle with which `sample_image` picks a direction that brings radiance L."""
    return luminance(L) * light_number(scene, light, L_AREA)


@device
def _share(a, slope, angle, step, t):
    """∫ of (a + slope·t)·sin(angle + step·t) from 0 to t, times step²."""
    here = angle + step * t
    return step * (a * math.cos(angle) - (a + slope * t) * math.cos(here)) + slope * (math.sin(here) - math.sin(angle))


@device
def _height_in_cell(u, a, b, angle, step):
    """t in [0, 1] with density proportional to (a + t·(b − a))·sin(angle + step·t); safeguarded Newton."""
    slope = b - a
    total = _share(a, slope, angle, step, _f8(1.0))
    low, high, t = _f8(0.0), _f8(1.0), u
    for _ in range(_NEWTON_STEPS):
        miss = _share(a, slope, angle, step, t) - u * total
        if miss > _f8(0.0):
            high = t
        else:
            low = t
        density = (a + slope * t) * math.sin(angle + step * t) * step * step
        following = _f8(0.5) * (low + high)
        if density > _f8(0.0):
            newton = t - miss / density
            if newton > low and newton < high:
                following = newton
        if abs(following - t) <= _f8(1e-7):
            return following
        t = following
    return t


@device
def across_cell(u, a, b):
    """s in [0, 1] with density proportional to a + s·(b − a)."""
    total = a + b
    if not total > _f4(0.0):
        return u
    root = _f4(math.sqrt(a * a + u * (b * b - a * a)))
    return min(u * total / (a + root), _f4(1.0))


@device
def image_direction(scene, light, u, v):
    """A unit direction away from the scene with the density of the image's luminance."""
    width, rows = scene.sky_width, scene.sky_height - 1
    row = find_interval(scene.sky_rows, rows, _i8(0), u)
    low = _f4(0.0) if row == 0 else load_f4(scene.sky_rows, row - 1)
    u = (u - low) / (load_f4(scene.sky_rows, row) - low)
    first = row * width
    column = find_interval(scene.sky_cells, width, first, v)
    low = _f4(0.0) if column == 0 else load_f4(scene.sky_cells, first + column - 1)
    v = (v - low) / (load_f4(scene.sky_cells, first + column) - low)
    following = column + 1
    if following == width:
        following = _i8(0)
    a0, a1 = luminance(_texel(scene, row, column)), luminance(_texel(scene, row, following))
    b0, b1 = luminance(_texel(scene, row + 1, column)), luminance(_texel(scene, row + 1, following))
    step = _f8(math.pi) / _f8(rows)
    t = _height_in_cell(_f8(u), _f8(a0 + a1), _f8(b0 + b1), step * _f8(row), step)
    f = _f4(t)
    s = across_cell(v, a0 + f * (b0 - a0), a1 + f * (b1 - a1))
    theta = step * (_f8(row) + t)
    phi = _f8(2.0 * math.pi) * (_f8(column) + _f8(0.5) + _f8(s)) / _f8(width)
    r = math.sin(theta)
    d = scale(light_vector(scene, light, L_A), _f4(r * math.sin(phi)))
    d = along(d, light_vector(scene, light, L_B), _f4(math.cos(theta)))
    return along(d, light_vector(scene, light, L_C), _f4(-r * math.cos(phi)))


@device
def sample_image(scene, light, x, u, v):
    """As `pmviewer.kernels.lights.light.sample_one_light`."""
    wi = image_direction(scene, light, u, v)
    L = image_radiance(scene, light, wi)
    return wi, outside(scene, x, wi), L, image_pdf(scene, light, L), True


@device
def emit_image(scene, light, position, direction):
    """Origin, unit direction and power (luminance 1) of a photon: direction by the image, origin on a disc."""
    wi = image_direction(scene, light, direction[0], direction[1])
    L = image_radiance(scene, light, wi)
    d = scale(wi, _f4(-1.0))
    Y = luminance(L)
    inv = _f4(0.0)
    if _f4(0.0) < Y:
        inv = _f4(1.0) / Y
    return behind_scene(scene, d, position[0], position[1]), d, scale(L, inv)
