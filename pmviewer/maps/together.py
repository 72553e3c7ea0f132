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
from pmviewer.kernels.vector import along, dot, sub
from pmviewer.maps.virtual_lights import FLATNESS

SAME_SIDE = np.float32(0.5)
"""Least cosine between the normals of a photon and of the places that belong to it."""

_f4 = np.float32


@device
def can_hold(scene, prim, uv, surface, n, glossy):
    """Whether photons are stored at a place of a primitive on the side of n; `surface`: point and normals of
    `surface_at`."""
    p, outwards, ns = surface
    material = material_of(scene, prim)
    b = bsdf_at(scene, prim, material, uv[0], uv[1], p, outwards, ns, n, glossy, None)
    return keeps(scene, material, b, outwards, n, glossy) & STORED != 0


@device
def see_each_other(scene, p, n, q, m, gap):
    """Whether nothing stands between places p and q of surfaces with normals n and m, both lifted off theirs: what is
    flatter than the disc of a look-up of that radius hides nothing."""
    way = sub(q, p)
    lift = FLATNESS * _f4(math.sqrt(dot(way, way))) + _f4(2.0) * gap
    a, b = along(p, n, lift), along(q, m, lift)
    d = sub(b, a)
    return not occluded(scene, a[0], a[1], a[2], d[0], d[1], d[2], _f4(0.0), _f4(1.0))
