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
from pmviewer.kernels.lights.sky_cells import cell_of
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import L_A, L_AREA, L_B, L_C, light_number, light_vector, load3
from pmviewer.kernels.vector import along, dot, luminance, scale

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_NEWTON_STEPS = 40
_SMALL = _f8(0.1)
"""Radians up to which the series of `_turn` hold to 1e-13."""


@device
def _texel(scene, row, column):
    return load3(scene.sky_texels, (row * scene.sky_width + column) * _i8(3))


@device
def _between(a, b, s):
    r = _f4(1.0) - s
    return a[0] * r + b[0] * s, a[1] * r + b[1] * s, a[2] * r + b[2] * s


@device
def _texels_around(scene, light, d):
    """Row and column of the cell that lies in the unit direction d, away from the scene, and how far down and along it
    is there."""
    x = dot(light_vector(scene, light, L_A), d)
    y = dot(light_vector(scene, light, L_B), d)
    z = dot(light_vector(scene, light, L_C), d)
    width, height = scene.sky_width, scene.sky_height
    turn = _f8(math.atan2(x, -z)) * _f8(0.5 / math.pi)
    turn -= np.floor(turn)
    place = turn * _f8(width) - _f8(0.5)
    if place < _f8(0.0):
        place += _f8(width)
    column = min(_i8(place), width - 1)
    s = _f4(place - _f8(column))
    # atan2 keeps its digits at the poles, where acos loses half of them.
    down = _f8(math.atan2(_f4(math.sqrt(x * x + z * z)), y)) * _f8(1.0 / math.pi) * _f8(height - 1)
    row = min(_i8(down), height - 2)
    return row, column, _f4(down - _f8(row)), s


@device
def image_radiance(scene, light, d):
    """Radiance that arrives against the unit direction d, which points away from the scene."""
    row, column, t, s = _texels_around(scene, light, d)
    following = column + 1
    if following == scene.sky_width:
        following = _i8(0)
    upper = _between(_texel(scene, row, column), _texel(scene, row, following), s)
    lower = _between(_texel(scene, row + 1, column), _texel(scene, row + 1, following), s)
    return _between(upper, lower, t)


@device
def image_pdf(scene, light, L):
    """Density per solid angle with which `sample_image` picks a direction that brings radiance L."""
    return luminance(L) * light_number(scene, light, L_AREA)


@device
def _turn(angle):
    """sin and cos − 1 of an angle: by their series where it is small, as in images of 32 rows and more."""
    if abs(angle) > _SMALL:
        half = math.sin(_f8(0.5) * angle)
        return math.sin(angle), _f8(-2.0) * half * half
    x = angle * angle
    sine = angle * (_f8(1.0) - x / _f8(6.0) * (_f8(1.0) - x / _f8(20.0) * (_f8(1.0) - x / _f8(42.0))))
    return sine, x * _f8(-0.5) * (_f8(1.0) - x / _f8(12.0) * (_f8(1.0) - x / _f8(30.0) * (_f8(1.0) - x / _f8(56.0))))


@device
def _below_height(a, b, sine, cosine, step, t):
    """∫₀ᵗ (a + x·(b − a))·sin(α + step·x) dx · step², and sin and cos of the angle at t; sine, cosine: of α."""
    over, less = _turn(step * t)
    here, there = sine + sine * less + cosine * over, cosine + cosine * less - sine * over
    slope = b - a
    below = step * (a * (sine * over - cosine * less) - slope * t * there) + slope * (here - sine)
    return below, here, there


@device
def _height_in_cell(u, a, b, sine, cosine, step):
    """t in [0, 1] with density proportional to (a + t·(b − a))·sin(α + step·t), and sin and cos of that angle, by
    safeguarded Newton from where the density would be linear; sine, cosine: of α."""
    slope = b - a
    total, there, _ = _below_height(a, b, sine, cosine, step, _f8(1.0))
    low, high = _f8(0.0), _f8(1.0)
    t = _f8(across_cell(_f4(u), _f4(a * sine), _f4(b * there)))
    for _ in range(_NEWTON_STEPS):
        below, here, there = _below_height(a, b, sine, cosine, step, t)
        miss = below - u * total
        if miss > _f8(0.0):
            high = t
        else:
            low = t
        density = (a + slope * t) * here * step * step
        following = _f8(0.5) * (low + high)
        if density > _f8(0.0):
            newton = t - miss / density
            if newton >= low and newton <= high:
                following = newton
        if abs(following - t) <= _f8(1e-7):
            break
        t = following
    return t, here, there


@device
def across_cell(u, a, b):
    """s in [0, 1] with density proportional to a + s·(b − a)."""
    total = a + b
    if not total > _f4(0.0):
        return u
    twice = a + _f4(math.sqrt(a * a + u * (b * b - a * a)))
    if not twice > _f4(0.0):  # the first number where the density begins at 0, as at a pole
        return _f4(0.0)
    return min(u * total / twice, _f4(1.0))


@device
def _around(turn):
    """sin and cos of so many turns, to the last digits of float32: by the angle to the nearest quarter."""
    quarter = np.floor(_f8(4.0) * turn + _f8(0.5))
    rest = _f4((turn - _f8(0.25) * quarter) * _f8(2.0 * math.pi))
    sine, cosine = _f4(math.sin(rest)), _f4(math.cos(rest))
    if _i8(quarter) & 1 != 0:
        sine, cosine = cosine, -sine
    if _i8(quarter) & 2 != 0:
        sine, cosine = -sine, -cosine
    return sine, cosine


@device
def _in_cell(scene, light, row, column, u, v):
    """A unit direction away from the scene, by two numbers of [0, 1) within a cell, with the density of the image's
    luminance there, and the radiance from there."""
    width, rows = scene.sky_width, scene.sky_height - 1
    following = column + 1
    if following == width:
        following = _i8(0)
    a0, a1 = _texel(scene, row, column), _texel(scene, row, following)
    b0, b1 = _texel(scene, row + 1, column), _texel(scene, row + 1, following)
    step = _f8(math.pi) / _f8(rows)
    top = step * _f8(row)
    upper, lower = _f8(luminance(a0)) + _f8(luminance(a1)), _f8(luminance(b0)) + _f8(luminance(b1))
    t, r, y = _height_in_cell(_f8(u), upper, lower, math.sin(top), math.cos(top), step)
    left, right = _between(a0, b0, _f4(t)), _between(a1, b1, _f4(t))
    s = across_cell(v, luminance(left), luminance(right))
    sine, cosine = _around((_f8(column) + _f8(0.5) + _f8(s)) / _f8(width))
    d = scale(light_vector(scene, light, L_A), _f4(r) * sine)
    d = along(d, light_vector(scene, light, L_B), _f4(y))
    return along(d, light_vector(scene, light, L_C), _f4(-r) * cosine), _between(left, right, s)


@device
def _part_of(low, high, n):
    """Which of n equal parts of [0, 1) both numbers lie in, −1 if they lie in different ones."""
    part = min(_i8(low * _f4(n)), n - 1)
    return part if high * _f4(n) <= _f4(part + 1) else _i8(-1)


@device
def cell_of_square(scene, light, d, n):
    """Row and column, of n × n cells of the unit square, of the numbers u, v with which `sample_image` picks the unit
    direction d. Most texels' numbers lie in one cell; the others' are computed."""
    width, rows = scene.sky_width, scene.sky_height - 1
    row, column, t, s = _texels_around(scene, light, d)
    first = row * width
    u_low = _f4(0.0) if row == 0 else load_f4(scene.sky_rows, row - 1)
    v_low = _f4(0.0) if column == 0 else load_f4(scene.sky_cells, first + column - 1)
    u_high, v_high = load_f4(scene.sky_rows, row), load_f4(scene.sky_cells, first + column)
    i, j = _part_of(u_low, u_high, n), _part_of(v_low, v_high, n)
    if i >= 0 and j >= 0:
        return i, j
    following = column + 1
    if following == width:
        following = _i8(0)
    a0, a1 = _texel(scene, row, column), _texel(scene, row, following)
    b0, b1 = _texel(scene, row + 1, column), _texel(scene, row + 1, following)
    if i < 0:
        step = _f8(math.pi) / _f8(rows)
        top = step * _f8(row)
        upper, lower = _f8(luminance(a0)) + _f8(luminance(a1)), _f8(luminance(b0)) + _f8(luminance(b1))
        sine, cosine = math.sin(top), math.cos(top)
        below, _, _ = _below_height(upper, lower, sine, cosine, step, _f8(t))
        whole, _, _ = _below_height(upper, lower, sine, cosine, step, _f8(1.0))
        u = _f4(below / whole) if whole > _f8(0.0) else t
        i = min(_i8((u_low + u * (u_high - u_low)) * _f4(n)), n - 1)
    if j < 0:
        left, right = luminance(_between(a0, b0, t)), luminance(_between(a1, b1, t))
        v = s
        if left + right > _f4(0.0):
            v = s * (_f4(2.0) * left + s * (right - left)) / (left + right)
        j = min(_i8((v_low + v * (v_high - v_low)) * _f4(n)), n - 1)
    return i, j


@device
def sample_image(scene, light, x, u, v):
    """As `pmviewer.kernels.lights.light.sample_one_light`."""
    row, column, u, v = cell_of(scene, u, v)
    return sample_cell(scene, light, x, row, column, u, v)


@device
def sample_cell(scene, light, x, row, column, u, v):
    """What `sample_image` returns, from the cell that its numbers fall to and what these are within it
    (`pmviewer.kernels.lights.sky_cells`)."""
    wi, L = _in_cell(scene, light, row, column, u, v)
    return wi, outside(scene, x, wi), L, image_pdf(scene, light, L), True


@device
def emit_image(scene, light, position, direction):
    """Origin, unit direction and power (luminance 1) of a photon: direction by the image, origin on a disc."""
    row, column, u, v = cell_of(scene, direction[0], direction[1])
    wi, L = _in_cell(scene, light, row, column, u, v)
    d = scale(wi, _f4(-1.0))
    Y = luminance(L)
    inv = _f4(0.0)
    if _f4(0.0) < Y:
        inv = _f4(1.0) / Y
    return behind_scene(scene, d, position[0], position[1]), d, scale(L, inv)
