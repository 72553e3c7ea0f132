"""How much light comes through the media on a straight way, across boundaries that are no surfaces."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.media.glow import glow_medium
from pmviewer.kernels.media.medium import MOST_BOUNDARIES, is_boundary, medium_beyond
from pmviewer.kernels.media.varying import transmitted
from pmviewer.kernels.scene import GLOW, L_KIND, light_number
from pmviewer.kernels.surface import leave, surface_at
from pmviewer.kernels.vector import dot, mul, sub

_f4 = np.float32
_i8 = np.int64
_INF = _f4(np.inf)
BEFORE_LIGHT = np.float32(1.0 - 2.0**-13)
"""Shadow rays end a little before the light's own surface."""

ANYWHERE = np.int64(-2)


@device
def place_of(scene, light):
    """The medium that the light's samples have to lie in, ANYWHERE for lights that are no media."""
    if np.int32(light_number(scene, light, L_KIND)) == GLOW:
        return glow_medium(scene, light)
    return ANYWHERE


@device
def light_through(scene, o, end, medium, within):
    """The share (red, green, blue) of light from `end` that reaches the point o in the medium; none where `end` is not
    `within` that medium (ANYWHERE: any)."""
    T = (_f4(1.0), _f4(1.0), _f4(1.0))
    for _ in range(MOST_BOUNDARIES):
        d = sub(end, o)
        length = _f4(math.sqrt(dot(d, d)))
        t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), BEFORE_LIGHT)
        if prim < 0:
            if within != ANYWHERE and within != medium:
                break
            return mul(T, transmitted(scene, medium, o, d, _f4(1.0), length))
        if not is_boundary(scene, _i8(prim)):
            break
        T = mul(T, transmitted(scene, medium, o, d, t, t * length))
        p, ng, _, gap = surface_at(scene, _i8(prim), u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
        medium = medium_beyond(scene, _i8(prim), ng, d, medium)
        o = leave(p, ng, gap, d[0], d[1], d[2])
    return _f4(0.0), _f4(0.0), _f4(0.0)


@device
def next_boundary(scene, o, d, medium):
    """The boundary of a medium that a ray from o in the unit direction d crosses next, which there is: how far it is,
    where the ray goes on, and in which medium."""
    t, found, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), _INF)
    prim = _i8(found)
    if prim < 0:
        return t, o, medium
    p, ng, _, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
    return t, leave(p, ng, gap, d[0], d[1], d[2]), medium_beyond(scene, prim, ng, d, medium)


@device
def next_stretch(scene, crossings, o, d, medium, left):
    """The stretch of a way that begins at o in a medium: up to the next boundary while there are `crossings`, else all
    that is `left`. Its length, where the way goes on, and in which medium."""
    if crossings > 0:
        return next_boundary(scene, o, d, medium)
    return left, o, medium


@device
def way_through(scene, ray, hit):
    """The share (red, green, blue) of light that comes from what the ray met (`pmviewer.render.cast.Hit`)."""
    T = (_f4(1.0), _f4(1.0), _f4(1.0))
    o, medium, left = ray.o, ray.medium, hit.t
    for _ in range(hit.crossed):
        t, beyond, next_medium = next_boundary(scene, o, ray.d, medium)
        T = mul(T, transmitted(scene, medium, o, ray.d, t, t))
        o, medium = beyond, next_medium
        left -= t
    return mul(T, transmitted(scene, medium, o, ray.d, left, left))
