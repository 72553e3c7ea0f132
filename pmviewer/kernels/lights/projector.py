"""Projectors (T1): a point that throws a picture through a pyramid, as Mitsuba 3's `projector`.

The picture has on the plane at distance 1 the irradiance E(x, y), in W/m² on what faces the projector's axis there. A
direction at the angle θ off the axis meets that plane under cos θ at the distance 1/cos θ, so that the intensity is

    I(ω) = E(x, y)/cos³θ,   dω = cos³θ dx dy,   Φ = ∫ E dx dy

and photons with exactly the intensity's luminance as density are places on the plane with that of E. All start with one
luminance, as those of an image environment.

E is bilinear in cells between lines across the picture, which need not be evenly spaced; where two lines coincide it
jumps. All numbers of a projector lie in a row: the columns' places as shares of the width, from the picture's left; the
rows' from its top; the irradiance where they cross; the cumulative shares of the luminance in the rows of cells, and of
the cells within each row. Seen from the projector, up being y, the picture's left is on the side of x.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.lights.environment import across_cell
from pmviewer.kernels.memory import load_f4, load_i8
from pmviewer.kernels.scene import (
    L_A,
    L_AREA,
    L_B,
    L_C,
    L_FIRST,
    L_FLIP,
    L_LENGTH,
    L_RADIUS,
    PROJECTOR_COLUMNS,
    light_number,
    light_vector,
    load3,
)
from pmviewer.kernels.table import find_interval
from pmviewer.kernels.vector import along, cross, dot, luminance, scale, sub

_f4 = np.float32
_i8 = np.int64
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))


@device
def _picture(scene, light):
    """Where the projector's numbers begin, how many columns and how many rows it has."""
    row = _i8(light_number(scene, light, L_FIRST)) * PROJECTOR_COLUMNS
    return (
        load_i8(scene.projectors, row),
        load_i8(scene.projectors, row + _i8(1)),
        load_i8(scene.projectors, row + _i8(2)),
    )


@device
def _axes(scene, light):
    """Towards the picture's left, towards its top, and where the projector looks."""
    x, y = light_vector(scene, light, L_B), light_vector(scene, light, L_C)
    return x, y, scale(cross(x, y), light_number(scene, light, L_FLIP))


@device
def _between(a, b, s):
    r = _f4(1.0) - s
    return a[0] * r + b[0] * s, a[1] * r + b[1] * s, a[2] * r + b[2] * s


@device
def _corner(scene, picture, column, row):
    first, width, height = picture
    return load3(scene.projector_numbers, first + width + height + (row * width + column) * _i8(3))


@device
def _in_cell(scene, picture, column, row, s, t):
    """E at the shares s and t of a cell's width and height."""
    upper = _between(_corner(scene, picture, column, row), _corner(scene, picture, column + _i8(1), row), s)
    row += _i8(1)
    lower = _between(_corner(scene, picture, column, row), _corner(scene, picture, column + _i8(1), row), s)
    return _between(upper, lower, t)


@device
def _cell(scene, first, count, place):
    """The cell that a place between `count` lines lies in, and the share of its width before it."""
    cell = find_interval(scene.projector_numbers, count - _i8(1), first + _i8(1), place)
    low = load_f4(scene.projector_numbers, first + cell)
    wide = load_f4(scene.projector_numbers, first + cell + _i8(1)) - low
    share = _f4(1.0)
    if place - low < wide:
        share = (place - low) / wide
    return cell, share


@device
def projector_intensity(scene, light, d):
    """I of the unit direction d that leaves the projector."""
    x, y, z = _axes(scene, light)
    ahead = dot(z, d)
    if not ahead > _f4(0.0):
        return _BLACK
    u = _f4(0.5) - _f4(0.5) * dot(x, d) / (ahead * light_number(scene, light, L_RADIUS))
    v = _f4(0.5) - _f4(0.5) * dot(y, d) / (ahead * light_number(scene, light, L_LENGTH))
    if not (u >= _f4(0.0) and u <= _f4(1.0) and v >= _f4(0.0) and v <= _f4(1.0)):
        return _BLACK
    picture = _picture(scene, light)
    first, width, height = picture
    column, s = _cell(scene, first, width, u)
    row, t = _cell(scene, first + width, height, v)
    return scale(_in_cell(scene, picture, column, row, s, t), _f4(1.0) / (ahead * ahead * ahead))


@device
def sample_projector(scene, light, x):
    """The direction from x to the projector, as `pmviewer.kernels.lights.light.sample_one_light`."""
    p = light_vector(scene, light, L_A)
    offset = sub(p, x)
    distance2 = dot(offset, offset)
    if not distance2 > _f4(0.0):
        return (_f4(0.0), _f4(0.0), _f4(1.0)), p, _BLACK, _f4(0.0), False
    inv = _f4(1.0) / _f4(math.sqrt(distance2))
    wi = scale(offset, inv)
    L = projector_intensity(scene, light, (-wi[0], -wi[1], -wi[2]))
    pdf = _f4(1.0) if luminance(L) > _f4(0.0) else _f4(0.0)
    return wi, p, scale(L, inv * inv), pdf, False


@device
def projector_spread(scene, light, d):
    """1/p of the direction d, p being the density with which `emit_projector` draws it; 0 where p is."""
    Y = luminance(projector_intensity(scene, light, d))
    return light_number(scene, light, L_AREA) / Y if _f4(0.0) < Y else _f4(0.0)


@device
def _picked(scene, first, count, u):
    """The entry of a cumulative table that u belongs to, and u stretched to [0, 1) within it."""
    entry = find_interval(scene.projector_numbers, count, first, u)
    low = _f4(0.0) if entry == 0 else load_f4(scene.projector_numbers, first + entry - _i8(1))
    return entry, (u - low) / (load_f4(scene.projector_numbers, first + entry) - low)


@device
def _place(scene, first, cell, share):
    """How far from the middle the place is, in half widths, the first line's side being positive."""
    low = load_f4(scene.projector_numbers, first + cell)
    wide = load_f4(scene.projector_numbers, first + cell + _i8(1)) - low
    return _f4(1.0) - _f4(2.0) * (low + share * wide)


@device
def emit_projector(scene, light, u, v):
    """Origin, unit direction and power (luminance 1) of a photon; directions have the density of the intensity."""
    picture = _picture(scene, light)
    first, width, height = picture
    tables = first + width + height + width * height * _i8(3)
    row, u = _picked(scene, tables, height - _i8(1), u)
    cells = width - _i8(1)
    column, v = _picked(scene, tables + height - _i8(1) + row * cells, cells, v)
    a0 = luminance(_corner(scene, picture, column, row))
    a1 = luminance(_corner(scene, picture, column + _i8(1), row))
    b0 = luminance(_corner(scene, picture, column, row + _i8(1)))
    b1 = luminance(_corner(scene, picture, column + _i8(1), row + _i8(1)))
    t = across_cell(u, a0 + a1, b0 + b1)
    s = across_cell(v, a0 + t * (b0 - a0), a1 + t * (b1 - a1))
    E = _in_cell(scene, picture, column, row, s, t)
    x, y, z = _axes(scene, light)
    d = along(z, x, _place(scene, first, column, s) * light_number(scene, light, L_RADIUS))
    d = along(d, y, _place(scene, first + width, row, t) * light_number(scene, light, L_LENGTH))
    d = scale(d, _f4(1.0) / _f4(math.sqrt(dot(d, d))))
    Y = luminance(E)
    inv = _f4(0.0)
    if _f4(0.0) < Y:
        inv = _f4(1.0) / Y
    return light_vector(scene, light, L_A), d, scale(E, inv)
