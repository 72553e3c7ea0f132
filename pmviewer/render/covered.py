"""What a density estimate over a disc is multiplied by where surfaces do not cover the disc (E4, E6).

A part of a look-up's disc lies beyond the edge of the surface, in a wall, or on what stores no photons. None are found
there, and the photons' power over the area of the disc is too little: edges of surfaces, corners of rooms, and small
things come out dark, in a rim as wide as the radius. Power over the area that is covered is right as far as the light
is even.

The factor is the reciprocal of the share that is covered. Where the triangle that the look-up is made on covers most of
the disc, its edges tell how much, and short rays through the disc look for surfaces beyond them. Elsewhere points of
the disc are drawn until some of them are covered: how many it takes, over that number, has the reciprocal as its mean.

A place counts where the photons of a look-up would: within the disc and its thickness, on a surface that faces like the
place (`pmviewer.maps.search.sides`) and stores photons.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.accel.opacity import lets_pass, over_opacity
from pmviewer.kernels.bsdf.scattering import STORED, bsdf_at, keeps
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.dimensions import COVERED_FILTER_SALT, COVERED_SALT
from pmviewer.kernels.media.medium import has_media
from pmviewer.kernels.memory import bits_of_float
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.scene import load3, material_of
from pmviewer.kernels.surface import face, leave
from pmviewer.kernels.vector import along, basis, dot, scale, sub
from pmviewer.maps.estimate.filters import CONSTANT, filter_weight
from pmviewer.maps.photon_words import decode_normal, encode_arrival
from pmviewer.maps.search.in_disc import FLAT
from pmviewer.maps.search.sides import is_apart
from pmviewer.render.cast import Ray, cast
from pmviewer.render.cut import Triangle, clears, cut_by, holds, turn_of

ENOUGH, ENOUGH_GATHERED, ENOUGH_KEPT = 3, 1, 12
"""Covered points that are waited for where a map is shown, where a gather ray ends, one of many, and where many rays
get the same."""
TRIED, TRIED_MORE = 8, 8
"""Points that are tried at most: so many for each of these, and so many more."""

MOSTLY, LITTLE = 0.4, 0.1
"""Of a disc, what the look-up's own triangle has to cover, or the mean would be a few percent off; what one ray is
enough for."""
LAYERS = 4
"""Surfaces that are counted at most, one above the other."""
_LEAST_COSINE = 0.1
"""Bound on what a surface that leans away is larger than seen from above."""

_f4 = np.float32
_i8 = np.int64
_u4 = np.uint32
_UNIT = _f4(2.0**-15)
_GOLDEN = _f4(0.6180339887498949)


class Spot(NamedTuple):
    """A point of a surface that maps are looked up at: prim, int64, the primitive, −1 where it isn't known; p, the
    point; n, the unit normal on the side that is asked about."""

    prim: Any
    p: Any
    n: Any


@specialised
def _is_plain_triangle(scene, prim):
    """Whether the primitive is a triangle as `Triangle` says."""
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
def _area(scene, eye, at, hit, off):
    """How much surface there is for each of the disc where a ray from above met some; `off`: off the plane."""
    n, m = at.n, face(hit.ng, at.n)
    if off and is_apart(decode_normal(encode_arrival(m, m)), sub(hit.p, at.p), n):
        return _f4(0.0)
    material = material_of(scene, hit.prim)
    if at.prim < 0 or material != material_of(scene, at.prim):
        b = bsdf_at(scene, hit.prim, material, hit.u, hit.v, hit.p, hit.ng, hit.ns, n, eye.glossy, None)
        if keeps(scene, material, b, hit.ng, n, eye.glossy) & STORED == 0:
            return _f4(0.0)
    area = _f4(1.0) / max(dot(m, n), _f4(_LEAST_COSINE))
    return over_opacity(scene, hit.prim, hit.u, hit.v, hit.p, (area, area, area))[0]


@device
def _surface(scene, eye, at, x, y, radius):
    """How much surface there is above or below a point of the disc of that radius: area seen from above counts 1, what
    leans away more. (x, y): the point, relative to the radius."""
    n, height = at.n, eye.flatness * radius
    s, t = basis(n)
    reach2 = (_f4(1.0) - x * x - y * y) * radius * radius
    o = along(along(along(at.p, s, x * radius), t, y * radius), n, height)
    down, top, total = scale(n, _f4(-1.0)), height, _f4(0.0)
    for _ in range(LAYERS):
        hit = cast(scene, Ray(o, down, _f4(0.0), top + height, _any_medium(scene), None))
        if hit.prim < 0:
            break
        top -= hit.t
        if top * top < reach2:
            total += _area(scene, eye, at, hit, abs(top) > _f4(FLAT) * height)
        if top <= _f4(FLAT) * height:  # below the plane of the look-up there is hardly ever more
            break
        o = leave(hit.p, hit.ng, hit.gap, down[0], down[1], down[2])
    return total


@device
def _triangle_of(scene, at, radius):
    corner = (_f4(0.0), _f4(0.0))
    known = _is_plain_triangle(scene, at.prim)
    if not known:
        return Triangle(known, corner, corner, corner)
    s, t = basis(at.n)
    one, first = _f4(1.0) / radius, _i8(at.prim) * 9
    a, b = sub(load3(scene.vertices, first), at.p), sub(load3(scene.vertices, first + 3), at.p)
    c = sub(load3(scene.vertices, first + 6), at.p)
    return Triangle(
        known,
        (one * dot(a, s), one * dot(a, t)),
        (one * dot(b, s), one * dot(b, t)),
        (one * dot(c, s), one * dot(c, t)),
    )


@device
def _weight(eye, x, y):
    """Of a point of the unit disc by the filter of look-ups, 0 outside."""
    x2 = x * x + y * y
    if x2 >= _f4(1.0):
        return _f4(0.0)
    return filter_weight(eye.filter, eye.cone_k, x2)


@device
def _met_beyond(scene, eye, at, radius, cut, u):
    """How much surface there is in what is cut off, as a share of the disc, told by one or two rays. u: a number in
    [0, 1)."""
    if not cut.share > _f4(0.0):
        return _f4(0.0)
    rays = 1 if cut.share < _f4(LITTLE) else 2
    met, tried = _f4(0.0), _f4(0.0)
    for k in range(rays):
        angle = cut.low + (cut.high - cut.low) * (u + _f4(k)) / _f4(rays)
        cos, sin = _f4(math.cos(angle)), _f4(math.sin(angle))
        edge = cut.d / cos
        width = max(_f4(1.0) - edge * edge, _f4(0.0))  # of area per angle
        u += _GOLDEN
        u -= _f4(math.floor(u))
        r = _f4(math.sqrt(edge * edge + width * u))
        x, y = r * (cos * cut.outx + sin * cut.x), r * (cos * cut.outy + sin * cut.y)
        tried += width
        met += width * _surface(scene, eye, at, x, y, radius)
    return cut.share * met / tried if tried > _f4(0.0) else cut.share


@device
def _share_by_edges(scene, eye, at, radius, triangle, u):
    """The share of the disc that is covered, where the triangle covers most of it; 0 where it covers little."""
    a, b, c = triangle.a, triangle.b, triangle.c
    turn = _f4(math.copysign(_f4(1.0), turn_of(a, b, c[0], c[1])))
    first, second, third = cut_by(a, b, turn), cut_by(b, c, turn), cut_by(c, a, turn)
    share = _f4(1.0) - first.share - second.share - third.share
    if share < _f4(MOSTLY):
        return _f4(0.0)
    for k in range(3):  # a loop, so that it is compiled once
        cut = first
        if k == 1:
            cut = second
        elif k == 2:
            cut = third
        share += _met_beyond(scene, eye, at, radius, cut, u)
    return share


@device
def _factor_by_waiting(scene, eye, at, radius, triangle, key, enough):
    """How many points it takes until some of them are covered, over their number."""
    tried, met, area = _f4(0.0), _i8(0), _f4(0.0)
    most = _f4(TRIED) * _f4(enough) + _f4(TRIED_MORE)
    k = _u4(0)
    while met < enough and tried < most:
        k += _u4(1)
        # Points that fill the disc evenly would be met too soon: after half of their distance in the mean.
        u = hash3(key, k, _u4(COVERED_SALT))
        x, y = _f4(_u4(u & _u4(0xFFFF))) * _UNIT - _f4(1.0), _f4(_u4(u >> _u4(16))) * _UNIT - _f4(1.0)
        w = _weight(eye, x, y)
        if eye.filter == CONSTANT:
            if w == _f4(0.0):
                continue
        elif unit_float(hash3(u, k, _u4(COVERED_FILTER_SALT))) * filter_weight(eye.filter, eye.cone_k, _f4(0.0)) >= w:
            continue
        tried += _f4(1.0)
        found = _f4(1.0)
        if not holds(triangle, x, y):
            found = _surface(scene, eye, at, x, y, radius)
        if found > _f4(0.0):
            met += 1
            area += found
    return tried / max(area, _f4(1.0))


@device
def over_covered(scene, eye, at, radius, enough):
    """What a density estimate over the disc of that radius around a Spot is multiplied by for what surfaces leave of
    the disc uncovered. 1 where `eye.covered` is 0, or the radius. `enough`: covered points that are waited for."""
    if eye.covered == 0 or not radius > _f4(0.0):
        return _f4(1.0)
    triangle = _triangle_of(scene, at, radius)
    a, b, c = triangle.a, triangle.b, triangle.c
    if triangle.known and clears(a, b) and clears(b, c) and clears(c, a):
        return _f4(1.0)
    # What many rays get must not depend on whose sample asks first.
    index = _u4(eye.index) if at.prim >= 0 else _u4(0)
    key = hash3(bits_of_float(at.p[0]), bits_of_float(at.p[1]), _u4(bits_of_float(at.p[2]) ^ index))
    if triangle.known and eye.filter == CONSTANT:
        share = _share_by_edges(scene, eye, at, radius, triangle, unit_float(key))
        if share > _f4(0.0):
            return _f4(1.0) / share
    return _factor_by_waiting(scene, eye, at, radius, triangle, key, enough)
