"""What a density estimate over a disc is multiplied by where surfaces do not cover the disc (E4, E6).

A part of a look-up's disc lies beyond the edge of the surface, in a wall, or on what stores no photons. None are found
there, and the photons' power over the area of the disc is too little: edges of surfaces, corners of rooms, and small
things come out dark, in a rim as wide as the radius. Power over the area that is covered is right as far as the light
is even. The factor is the reciprocal of the share that is covered, found by points of the disc: how many it takes until
some of them are covered, over that number, has that reciprocal as its mean. Points on the triangle that the look-up is
made on cost nothing, others a short ray through the disc.

A place counts where the photons of a look-up would: within the disc and its thickness, on a surface that faces like the
place (`pmviewer.maps.search.sides`) and stores photons.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.accel.opacity import lets_pass, over_opacity
from pmviewer.kernels.bsdf.scattering import STORED, bsdf_at, keeps
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.media.medium import has_media
from pmviewer.kernels.memory import bits_of_float
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.scene import load3, material_of
from pmviewer.kernels.surface import face
from pmviewer.kernels.vector import along, basis, dot, scale, sub
from pmviewer.maps.estimate.filters import CONSTANT, filter_weight
from pmviewer.maps.photon_words import decode_normal, encode_arrival
from pmviewer.maps.search.in_disc import FLAT
from pmviewer.maps.search.sides import is_apart
from pmviewer.render.cast import Ray, cast

ENOUGH, ENOUGH_GATHERED, ENOUGH_KEPT = 3, 1, 12
"""Covered points that are waited for where a map is shown, where a gather ray ends, one of many, and where many rays
get the same."""
TRIED, TRIED_MORE = 8, 8
"""Points that are tried at most: so many for each of these, and so many more."""

_LEAST_COSINE = 0.1
"""Bound on what a surface that leans away is larger than seen from above."""

_f4 = np.float32
_i8 = np.int64
_u4 = np.uint32
_UNIT = _f4(2.0**-15)


class Spot(NamedTuple):
    """A point of a surface that maps are looked up at: prim, int64, the primitive, −1 where it isn't known; p, the
    point; n, the unit normal on the side that is asked about."""

    prim: Any
    p: Any
    n: Any


@device
def _corner(scene, prim, k, p, s, t):
    """A corner of a triangle in the plane's coordinates around p."""
    q = sub(load3(scene.vertices, _i8(prim) * 9 + 3 * k), p)
    return dot(q, s), dot(q, t)


@device
def _turn(a, b, x, y):
    """Twice the area of the triangle from a to b to (x, y)."""
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])


@device
def _clears(a, b, r2):
    """Whether the line through a and b is at least √r2 away from the origin."""
    turn = _turn(a, b, _f4(0.0), _f4(0.0))
    x, y = b[0] - a[0], b[1] - a[1]
    return turn * turn >= r2 * (x * x + y * y)


@device
def _within(a, b, c, x, y):
    """Whether the triangle holds (x, y)."""
    first, second, third = _turn(a, b, x, y), _turn(b, c, x, y), _turn(c, a, x, y)
    low, high = min(first, min(second, third)), max(first, max(second, third))
    return low >= _f4(0.0) or high <= _f4(0.0)


@specialised
def _is_plain_triangle(scene, prim):
    """Whether the primitive is a triangle whose corners the scene has as they are, and that stops all rays."""
    if lets_pass(scene):
        return lambda scene, prim: False
    return lambda scene, prim: prim >= 0 and prim < scene.n_triangles


@specialised
def _any_medium(scene):
    """For a ray of which nobody asks what it went through."""
    if has_media(scene):
        return lambda scene: _i8(-1)
    return lambda scene: None


@device
def _surface(scene, eye, at, x, y, radius):
    """How much surface there is above or below a point of the disc of that radius: area seen from above counts 1, what
    leans away more. (x, y): the point, relative to the radius."""
    n, height = at.n, eye.flatness * radius
    s, t = basis(n)
    o = along(along(along(at.p, s, x * radius), t, y * radius), n, height)
    hit = cast(scene, Ray(o, scale(n, _f4(-1.0)), _f4(0.0), _f4(2.0) * height, _any_medium(scene), None))
    if hit.prim < 0:
        return _f4(0.0)
    m, above = face(hit.ng, n), height - hit.t
    if (x * x + y * y) * radius * radius + above * above >= radius * radius:
        return _f4(0.0)
    if abs(above) > _f4(FLAT) * height and is_apart(decode_normal(encode_arrival(m, m)), sub(hit.p, at.p), n):
        return _f4(0.0)
    material = material_of(scene, hit.prim)
    if at.prim < 0 or material != material_of(scene, at.prim):
        b = bsdf_at(scene, hit.prim, material, hit.u, hit.v, hit.p, hit.ng, hit.ns, n, eye.glossy, None)
        if keeps(scene, material, b, hit.ng, n, eye.glossy) & STORED == 0:
            return _f4(0.0)
    area = _f4(1.0) / max(dot(m, n), _f4(_LEAST_COSINE))
    return over_opacity(scene, hit.prim, hit.u, hit.v, hit.p, (area, area, area))[0]


@device
def over_covered(scene, eye, at, radius, enough):
    """What a density estimate over the disc of that radius around a Spot is multiplied by for what surfaces leave of
    the disc uncovered. 1 where `eye.covered` is 0, or the radius. `enough`: covered points that are waited for."""
    if eye.covered == 0 or not radius > _f4(0.0):
        return _f4(1.0)
    s, t = basis(at.n)
    plain = _is_plain_triangle(scene, at.prim)
    a = b = c = (_f4(0.0), _f4(0.0))
    if plain:
        a, b, c = (
            _corner(scene, at.prim, 0, at.p, s, t),
            _corner(scene, at.prim, 1, at.p, s, t),
            _corner(scene, at.prim, 2, at.p, s, t),
        )
        r2 = radius * radius
        if _clears(a, b, r2) and _clears(b, c, r2) and _clears(c, a, r2):
            return _f4(1.0)
    key = hash3(bits_of_float(at.p[0]), bits_of_float(at.p[1]), bits_of_float(at.p[2]))
    tried, met, area = _f4(0.0), _i8(0), _f4(0.0)
    most = _f4(TRIED) * _f4(enough) + _f4(TRIED_MORE)
    k = _u4(0)
    while met < enough and tried < most:
        k += _u4(1)
        # Points of a sequence that fills the disc evenly would be met too soon: in the mean after half a period.
        u = hash3(key, eye.index, k)
        x, y = _f4(_u4(u & _u4(0xFFFF))) * _UNIT - _f4(1.0), _f4(_u4(u >> _u4(16))) * _UNIT - _f4(1.0)
        x2 = x * x + y * y
        if x2 >= _f4(1.0):
            continue
        if eye.filter != CONSTANT:
            w = filter_weight(eye.filter, eye.cone_k, x2)
            if unit_float(hash3(u, eye.index, k)) * filter_weight(eye.filter, eye.cone_k, _f4(0.0)) >= w:
                continue
        tried += _f4(1.0)
        found = _f4(1.0)
        if not (plain and _within(a, b, c, x * radius, y * radius)):
            found = _surface(scene, eye, at, x, y, radius)
        if found > _f4(0.0):
            met += 1
            area += found
    return tried / max(area, _f4(1.0))
