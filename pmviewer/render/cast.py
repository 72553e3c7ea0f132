"""A ray from a surface and the surface that it meets."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.surface import leave, surface_at

_f4 = np.float32
_INF = _f4(np.inf)


@device
def cast(scene, p, ng, gap, d):
    """What a ray from the surface point p in direction d meets.

    Returns primitive (−1: nothing), its coordinates, point, geometric and shading normal, gap and distance.
    """
    o = leave(p, ng, gap, d[0], d[1], d[2])
    t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), _INF)
    if prim < 0:
        return prim, u, v, o, d, d, gap, t
    q, nq, sq, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
    return prim, u, v, q, nq, sq, gap, t
