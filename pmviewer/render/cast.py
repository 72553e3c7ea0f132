"""A ray and the surface that it meets."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.surface import leave, surface_at

_f4 = np.float32
_i8 = np.int64
_INF = _f4(np.inf)


class Ray(NamedTuple):
    """From o in the unit direction d; meets what lies between the distances near and far."""

    o: Any
    d: Any
    near: Any
    far: Any


class Hit(NamedTuple):
    """What a ray met: primitive (−1: nothing), the coordinates u and v on it, the distance t; there the point p, the
    geometric and the shading normal as the surface has them, and how far rays start off it. Where nothing is met, p is
    the ray's origin and the normals are its direction."""

    prim: Any
    u: Any
    v: Any
    t: Any
    p: Any
    ng: Any
    ns: Any
    gap: Any


@device
def cast(scene, ray):
    """What the ray meets, a Hit."""
    o, d = ray.o, ray.d
    t, found, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], ray.near, ray.far)
    prim = _i8(found)  # One type for every kind of scene.
    if prim < 0:
        return Hit(prim, u, v, t, o, d, d, _f4(0.0))
    p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
    return Hit(prim, u, v, t, p, ng, ns, gap)


@device
def ray_from(p, ng, gap, wi):
    """The ray from a surface point with geometric normal ng, on either side, and that gap in direction wi."""
    return Ray(leave(p, ng, gap, wi[0], wi[1], wi[2]), wi, _f4(0.0), _INF)


@device
def leaving(si, wi):
    """The ray from a SurfaceInteraction in direction wi."""
    return ray_from(si.p, si.ng, si.gap, wi)
