"""Photons of lamps that start the more densely, the nearer they aim at what is small (T7).

Of a dome over a scene, or a lamp high above, hardly any light meets what is small on a floor or before a backdrop
(`pmviewer.photons.projection.small`). Around the middle of that lie balls of the radii r, 2r, 4r …; a point of the
light sees n of them from outside, under cones with cosines c_k. A share EVERYWHERE of its photons starts in any of the
light's directions, the others within one of the cones, all of which have as many. The density, over that of photons
that start anywhere, is m = EVERYWHERE + (1 − EVERYWHERE)/n · Σ 1/(2 (1 − c_k) cos θ) over the cones that a direction
at the angle θ to the surface lies in, and with 2/(1 − c_k) for points, which emit in all directions alike; a photon has
1/m of the usual power. As with discs (`pmviewer.photons.projection.scales`) nothing is biased whatever is taken for
small, and no photon has more than 1/EVERYWHERE times that.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.lights.light import light_direction, light_start
from pmviewer.kernels.scene import L_KIND, POINT, light_number
from pmviewer.kernels.surface import leave
from pmviewer.kernels.vector import dot, from_basis, scale, sub
from pmviewer.kernels.warp import square_to_cone
from pmviewer.photons.projection.scales import EVERYWHERE

_f4 = np.float32
_i8 = np.int64
_EVERYWHERE = _f4(EVERYWHERE)
_NEAR = _f4(1.0 - EVERYWHERE)


@device
def cones_from(projection, p):
    """Of the cones from the place p: the unit direction that they are around, the squared distance to the middle, and
    how many there are, 0 within the innermost ball."""
    away = sub((projection.small_x, projection.small_y, projection.small_z), p)
    distance2, reach = dot(away, away), projection.small_radius
    cones = _i8(0)
    while reach * reach < distance2:
        reach *= _f4(2.0)
        cones += _i8(1)
    if cones == 0:
        return away, distance2, cones
    return scale(away, _f4(1.0) / _f4(math.sqrt(distance2))), distance2, cones


@device
def direction_in_cones(projection, axis, distance2, cones, u, v):
    """A direction in one of these cones, all of which get as many."""
    u *= _f4(cones)
    k = min(_i8(u), cones - _i8(1))
    r_k = projection.small_radius * _f4(_i8(1) << k)
    local = square_to_cone(min(u - _f4(k), _f4(1.0)), v, _narrow(r_k * r_k / distance2))
    return from_basis(axis, local[0], local[1], local[2])


@device
def density_in_cones(projection, axis, distance2, cones, d):
    """That of these directions at d, per solid angle."""
    off = sub(d, axis)
    apart = _f4(0.5) * dot(off, off)  # 1 − cosine, which 1 − dot would round
    m, sin2 = _f4(0.0), projection.small_radius * projection.small_radius / distance2
    for _ in range(cones):
        one_minus_cos = _narrow(sin2)
        if apart <= one_minus_cos:
            m += _f4(1.0) / one_minus_cos
        sin2 *= _f4(4.0)
    return m * _f4(0.5 / math.pi) / _f4(cones)


@device
def start_in_cones(scene, projection, light, position, direction):
    """Origin, unit direction and power of a photon of an area light or a point, and the factor for its power: 0 where
    the light does not shine."""
    point = np.int32(light_number(scene, light, L_KIND)) == POINT
    p, n, front, gap, beta = light_start(scene, light, position)
    axis, distance2, cones = cones_from(projection, p)
    u, v = direction
    if cones == 0 or u < _EVERYWHERE:
        if cones > 0:
            u /= _EVERYWHERE
        d = light_direction(scene, light, n, front, u, v)
        if cones == 0:
            return leave(p, n, gap, d[0], d[1], d[2]), d, beta, _f4(1.0)
    else:
        d = direction_in_cones(projection, axis, distance2, cones, (u - _EVERYWHERE) / _NEAR, v)
    cos = abs(dot(n, d))
    if not point and not (cos > _f4(0.0) and dot(front, d) > _f4(0.0)):
        return p, d, beta, _f4(0.0)
    usual = _f4(0.25 / math.pi) if point else cos * _f4(1.0 / math.pi)
    m = density_in_cones(projection, axis, distance2, cones, d) / usual
    return leave(p, n, gap, d[0], d[1], d[2]), d, beta, _f4(1.0) / (_EVERYWHERE + _NEAR * m)


@device
def _narrow(sin2):
    """1 − cosine of an angle of that squared sine."""
    return sin2 / (_f4(1.0) + _f4(math.sqrt(max(_f4(1.0) - sin2, _f4(0.0)))))
