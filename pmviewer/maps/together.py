"""Which photons a place of a surface belongs to (R10, single step), asked by cells of virtual lights and gather rays.

Both have to ask the same, or weights don't agree in the mean with what normalises them. A place belongs to the nearest
photons of surfaces that face a like way, unless something stands between: the floor under a crate is no gather ray's
end, and photons beside the crate don't stand for it.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.accel.occlusion import occluded
from pmviewer.kernels.bsdf.scattering import STORED, bsdf_at, keeps
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import face, surface_at
from pmviewer.kernels.vector import along, dot, sub
from pmviewer.maps.virtual_lights import FLATNESS

SAME_SIDE = np.float32(0.5)
"""Least cosine between the normals of a photon and of the places that belong to it."""

_f4 = np.float32


@device
def see_each_other(scene, p, n, q, m, gap):
    """Whether nothing stands between places p and q of surfaces with normals n and m, both lifted off theirs: what is
    flatter than the disc of a look-up of that radius hides nothing."""
    way = sub(q, p)
    lift = FLATNESS * _f4(math.sqrt(dot(way, way))) + _f4(2.0) * gap
    a, b = along(p, n, lift), along(q, m, lift)
    d = sub(b, a)
    return not occluded(scene, a[0], a[1], a[2], d[0], d[1], d[2], _f4(0.0), _f4(1.0))


@device
def beside(scene, hit, place, glossy):
    """Where a ray has met a surface, `hit` (prim, u, v, origin, direction, t): the cosine between its normal and that
    of a `place` (p, n, gap), the point and its normal on that side. The cosine is 0 where the surface faces another
    way, holds no photons or is hidden from the place."""
    prim, u, v, o, d, t = hit
    p, n, gap = place
    q, outwards, ns, _ = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
    m = face(outwards, n)
    cos = dot(m, n)
    if cos < SAME_SIDE or not see_each_other(scene, p, n, q, m, gap):
        return _f4(0.0), q, m
    material = material_of(scene, prim)
    b = bsdf_at(scene, prim, material, u, v, q, outwards, ns, n, glossy, None)
    if keeps(scene, material, b, outwards, n, glossy) & STORED == 0:
        return _f4(0.0), q, m
    return cos, q, m
