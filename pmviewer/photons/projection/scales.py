"""Photons of light from outside that start the more densely, the nearer they pass by what is small on a wide floor.

On the disc across the light's direction that the scene fills, of radius R, lie discs of the radii r, 2r, 4r … < R
around the middle of what is small (`pmviewer.photons.projection.small`). A share EVERYWHERE of the photons starts
anywhere, the others within one of the discs, all of which have as many. The density, over that of photons that start
anywhere, is m = EVERYWHERE + (1 − EVERYWHERE)/n · Σ (R/r_k)² over the discs that a place lies in; a photon has 1/m of
the usual power. Nothing is biased whatever is taken for small, and no photon has more than 1/EVERYWHERE times that.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.vector import along, basis, dot, sub
from pmviewer.kernels.warp import square_to_disk

EVERYWHERE = 0.25
"""Share of the photons that start anywhere."""

_f4 = np.float32
_i8 = np.int64
_EVERYWHERE = _f4(EVERYWHERE)
_NEAR = _f4(1.0 - EVERYWHERE)


def scales(small: float, radius: float) -> int:
    """How many discs there are, around what has the radius `small` in a scene that has the other."""
    return max(math.ceil(math.log2(radius / small)), 1)


def gain(small: float, radius: float) -> float:
    """How many times as densely as usual photons start for what is small, at least."""
    n = scales(small, radius)
    return EVERYWHERE + (1 - EVERYWHERE) / n * sum((radius / (small * 2**k)) ** 2 for k in range(n))


@device
def start_at_scales(scene, projection, d, position):
    """Where a photon in direction d starts, and the factor for its power: 0 beside the scene."""
    s, t = basis(d)
    center = (scene.center_x, scene.center_y, scene.center_z)
    away = sub((projection.small_x, projection.small_y, projection.small_z), center)
    x0, y0 = dot(away, s), dot(away, t)
    R, n = scene.radius, projection.scales
    u = position[0]
    if u < _EVERYWHERE:
        x, y = square_to_disk(u / _EVERYWHERE, position[1])
        x, y = R * x, R * y
    else:
        u = (u - _EVERYWHERE) / _NEAR * _f4(n)
        k = min(_i8(u), n - 1)
        x, y = square_to_disk(min(u - _f4(k), _f4(1.0)), position[1])
        r = projection.small_radius * _f4(1 << k)
        x, y = x0 + r * x, y0 + r * y
    p = along(along(along(center, s, x), t, y), d, -R)
    if x * x + y * y > R * R:
        return p, _f4(0.0)
    off2 = (x - x0) * (x - x0) + (y - y0) * (y - y0)
    m = _f4(0.0)
    r2 = projection.small_radius * projection.small_radius
    for _ in range(n):
        if off2 <= r2:
            m += R * R / r2
        r2 *= _f4(4.0)
    return p, _f4(1.0) / (_EVERYWHERE + _NEAR / _f4(n) * m)
