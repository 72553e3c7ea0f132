"""Shading frames: tangents, normal maps and bump maps (Blinn 1978; frames as in Mitsuba 3).

A map may turn the shading normal so far that it points below the surface, where a BSDF is black on the lit side and
bright on the other. `shading_frame` keeps it above; `reflecting_normal` keeps a mirror's reflection above as well.

A mapped normal depends on where the surface is seen from: that is Mitsuba's picture, and not reciprocal. Photons see
the surface from where they come, so methods differ a little where slopes face away from the camera or the light.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import (
    M_BUMP_MAP,
    M_BUMP_SCALE,
    M_MAPPED,
    M_NORMAL_MAP,
    MATERIAL_COLUMNS,
    MIRRORED_MAPS,
)
from pmviewer.kernels.textures.texture import texture_gradient, texture_rgb
from pmviewer.kernels.textures.uv import hit_tangents, hit_uv
from pmviewer.kernels.vector import along, basis, cross, dot, normalize, scale

_f4 = np.float32
LOWEST = _f4(0.05)
"""Cosine between shading and geometric normal that maps don't go below: 87 degrees."""
_GRAZING = _f4(0.01)


@device
def orthogonal(n, d):
    """The unit vector orthogonal to the unit vector n that is nearest to d; any when d is along n."""
    t = along(d, n, -dot(n, d))
    size = dot(t, t)
    if not size > _f4(1e-10) * dot(d, d):
        return basis(n)[0]
    return scale(t, _f4(1.0) / _f4(math.sqrt(size)))


@device
def above(n, ng):
    """The unit vector n, bent towards the unit normal ng where it makes a cosine below LOWEST with it."""
    cos = dot(n, ng)
    if cos >= LOWEST:
        return n
    flat = along(n, ng, -cos)
    size = dot(flat, flat)
    if not size > _f4(1e-10):
        return ng
    return along(scale(ng, LOWEST), flat, _f4(math.sqrt((_f4(1.0) - LOWEST * LOWEST) / size)))


@device
def bumped(ns, dp_du, dp_dv, gradient):
    """Unit normal of the surface displaced along ns by a height with that gradient over texture coordinates."""
    du = along(dp_du, ns, gradient[0] - dot(ns, dp_du))
    dv = along(dp_dv, ns, gradient[1] - dot(ns, dp_dv))
    n = cross(du, dv)
    size = dot(n, n)
    if not size > _f4(0.0):
        return ns
    n = scale(n, _f4(1.0) / _f4(math.sqrt(size)))
    if dot(n, ns) < _f4(0.0):  # texture coordinates run the other way round
        return -n[0], -n[1], -n[2]
    return n


@device
def turned(n, axis):
    """The unit vector n, turned by 180° about the unit vector `axis`."""
    return along(scale(n, _f4(-1.0)), axis, _f4(2.0) * dot(n, axis))


@device
def shading_frame(scene, material, prim, b1, b2, p, ng, ns, wo):
    """Shading normal and unit tangent (along ∂p/∂u) at a hit, the material's normal and bump maps applied.

    ng, ns: the geometric and shading normals of `surface_at`, not yet turned towards anybody; b1, b2: the hit's
    barycentric coordinates; wo: where the surface is seen from. The result is on ng's side. Without maps ns stays as it
    is; a mapped normal that would face away from wo leans the other way, as in Mitsuba.
    """
    dp_du, dp_dv = hit_tangents(scene, prim, p, ng)
    row = material * MATERIAL_COLUMNS
    normal_map = np.int64(load_f4(scene.materials, row + M_NORMAL_MAP))
    bump_map = np.int64(load_f4(scene.materials, row + M_BUMP_MAP))
    if normal_map >= 0 or bump_map >= 0:
        smooth = ns
        u, v = hit_uv(scene, prim, b1, b2, p)
        if normal_map >= 0:
            c = texture_rgb(scene, normal_map, u, v)
            s = orthogonal(ns, dp_du)
            t = cross(ns, s)
            x, y, z = (_f4(2.0) * c[0] - _f4(1.0), _f4(2.0) * c[1] - _f4(1.0), _f4(2.0) * c[2] - _f4(1.0))
            n = along(along(scale(s, x), t, y), ns, z)
            if dot(n, n) > _f4(1e-6):
                ns = normalize(n)
        if bump_map >= 0:
            factor = load_f4(scene.materials, row + M_BUMP_SCALE)
            du, dv = texture_gradient(scene, bump_map, u, v)
            ns = bumped(ns, dp_du, dp_dv, (factor * du, factor * dv))
        if dot(ng, wo) < _f4(0.0) and load_f4(scene.materials, row + M_MAPPED) == _f4(MIRRORED_MAPS):
            # Whoever looks from behind turns the normal round: what it has along the surface is to stay.
            ns = turned(ns, smooth)
        if dot(smooth, wo) * dot(ns, wo) <= _f4(0.0):  # a slope that faces away
            ns = turned(ns, smooth)
        ns = above(ns, ng)
    return ns, orthogonal(ns, dp_du)


@device
def shows_back(diffuse, ng, ns, wo):
    """Whether wo sees the back of an opaque material, where a one-sided one is black: from below the surface, and of a
    diffuse one where the shading normal looks away, too, as in Mitsuba. (That of gloss and mirrors is bent instead.)"""
    return dot(ng, wo) < _f4(0.0) or (diffuse and dot(ns, wo) <= _f4(0.0))


@device
def reflecting_normal(ns, ng, wo):
    """ns, bent so that the mirror image of wo leaves on the side of ng that wo is on.

    For lobes around the mirror direction: without it they lose what they send below the surface, in black spots. All
    unit; ng and ns on wo's side of the surface.
    """
    cos = dot(ns, wo)
    r = along(scale(wo, _f4(-1.0)), ns, _f4(2.0) * cos)
    lowest = min(_GRAZING, dot(ng, wo))
    height = dot(r, ng)
    if height >= lowest and cos > _f4(0.0):
        return ns
    # The nearest direction above the surface, and the normal halfway between it and wo.
    r = along(r, ng, lowest - height)
    half = along(normalize(r), wo, _f4(1.0))
    if not dot(half, half) > _f4(1e-6):
        return ng
    return normalize(half)
