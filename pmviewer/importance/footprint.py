"""Path differentials: the area on a surface that one pixel sees (I2; Suykens and Willems 2001, Igehy 1999).

Along a path from the camera four pairs of vectors go with the ray: how its place and its direction change with the two
coordinates in the image, by a pixel, and with the two random numbers of scattering, over their whole range. Where the
ray meets a surface, the changes of place span the footprint.

- Travelling and specular reflection and refraction differentiate the ray; the normal changes with the place, over the
  curvature of spheres and cylinders and of smoothly shaded triangles (not of bump and normal maps).
- A rough lobe that is followed reflects or refracts about its half vector, which turns with the normal; its spread is
  that of a solid angle 1/pdf.
- A lobe that stores photons (diffuse and wide gloss) sends the ray where the same random numbers send it from the
  neighbouring place: the direction turns with the normal. Its spread is a solid angle 1/pdf too.

Which random numbers make which part of the solid angle is the sampling's affair; here the two vectors of a spread are
orthogonal and of one length. Several spreads of one path are added up in the one pair, by solid angle: what the
last bounce adds counts.

The footprint's area is √det Σ vvᵀ over its vectors v: the parallelogram of a single pair, and of two very different
pairs the wider one's, whose density is the highest that the path can bring there.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.accel.instance import I_TO_LOCAL, find_instance, has_instances, stored_prim, transform_vector
from pmviewer.kernels.accel.quadric import QUADRIC_FLOATS
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.surface import surface_at
from pmviewer.kernels.vector import add, along, basis, cross, dot, normalize, scale, sub

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_ZERO = (_f4(0.0), _f4(0.0), _f4(0.0))
_STEP = _f4(0.125)
"""Of differences over a triangle, in barycentric coordinates: its shading normal is smooth, its corners are exact."""
_ROUND_STEP = _f4(0.02)
"""Of differences over a sphere or cylinder, in radii."""
_LEAST_COSINE = _f4(1e-4)
_RADIUS = 7
"""Column of a quadric's radius."""


@device
def start(px, py, dx, dy):
    """Changes of place and direction of a ray from the camera whose place changes by px and py a pixel and whose
    direction by dx and dy."""
    return (px, py, _ZERO, _ZERO), (dx, dy, _ZERO, _ZERO)


@device
def _landed(p, dp, d, t, n):
    moved = along(p, dp, t)
    cosine = dot(d, n)
    if abs(cosine) < _LEAST_COSINE:
        cosine = _f4(math.copysign(_LEAST_COSINE, cosine))
    return along(moved, d, -dot(moved, n) / cosine)


@device
def travel(P, D, d, t, n):
    """Changes of place P on the surface with unit normal n that a ray of direction d meets at the distance t."""
    return (
        _landed(P[0], D[0], d, t, n),
        _landed(P[1], D[1], d, t, n),
        _landed(P[2], D[2], d, t, n),
        _landed(P[3], D[3], d, t, n),
    )


@device
def footprint_importance(P):
    """One over the footprint's area, in pixels per unit area; 0 when it has none or is not a number."""
    total = _f8(0.0)
    for i in range(4):
        for j in range(i):
            c = cross(P[i], P[j])
            total += _f8(c[0]) * _f8(c[0]) + _f8(c[1]) * _f8(c[1]) + _f8(c[2]) * _f8(c[2])
    if not (total > 0.0 and total < np.inf):
        return _f4(0.0)
    return _f4(1.0 / math.sqrt(total))


# --- how the normal changes -------------------------------------------------------------------------------------------


@specialised
def _quadric_scale(scene, prim):
    """Lengths in the quadric's own coordinates by lengths in the world, at most."""
    if has_instances(scene):

        def copied(scene, prim):
            if prim < scene.n_stored:
                return _f4(1.0)
            i, most = find_instance(scene, prim), 0.0
            for axis in range(3):
                x, y, z = transform_vector(scene, i, I_TO_LOCAL, _f8(axis == 0), _f8(axis == 1), _f8(axis == 2))
                most += x * x + y * y + z * z
            return _f4(math.sqrt(most))

        return copied
    return lambda scene, prim: _f4(1.0)


@device
def curvature(scene, prim, u, v, p, ng):
    """Two tangents of the surface at a hit, and how the shading normal changes along each: (tu, tv, nu, nv).

    prim, u, v, p, ng: of the hit (`surface_at`).
    """
    zero = _f4(0.0)
    stored = stored_prim(scene, prim)
    if stored < scene.n_triangles:
        if scene.normals == 0:
            s, t = basis(ng)
            return s, t, _ZERO, _ZERO
        h = _STEP
        p0, _, n0, _ = surface_at(scene, prim, u - h, v, p[0], p[1], p[2], zero, zero, zero, zero)
        p1, _, n1, _ = surface_at(scene, prim, u + h, v, p[0], p[1], p[2], zero, zero, zero, zero)
        p2, _, n2, _ = surface_at(scene, prim, u, v - h, p[0], p[1], p[2], zero, zero, zero, zero)
        p3, _, n3, _ = surface_at(scene, prim, u, v + h, p[0], p[1], p[2], zero, zero, zero, zero)
        inv = _f4(0.5) / h
        return scale(sub(p1, p0), inv), scale(sub(p3, p2), inv), scale(sub(n1, n0), inv), scale(sub(n3, n2), inv)
    s, t = basis(ng)
    row = (stored - _i8(scene.n_triangles)) * QUADRIC_FLOATS
    h = _ROUND_STEP * load_f4(scene.bvh_quadrics, row + _RADIUS) / _quadric_scale(scene, prim)
    a, b, c, e = along(p, s, -h), along(p, s, h), along(p, t, -h), along(p, t, h)
    _, _, n0, _ = surface_at(scene, prim, u, v, a[0], a[1], a[2], zero, zero, zero, zero)
    _, _, n1, _ = surface_at(scene, prim, u, v, b[0], b[1], b[2], zero, zero, zero, zero)
    _, _, n2, _ = surface_at(scene, prim, u, v, c[0], c[1], c[2], zero, zero, zero, zero)
    _, _, n3, _ = surface_at(scene, prim, u, v, e[0], e[1], e[2], zero, zero, zero, zero)
    inv = _f4(0.5) / h
    return s, t, scale(sub(n1, n0), inv), scale(sub(n3, n2), inv)


@device
def _normal_change(bend, dp):
    """Change of the normal over the change of place dp in the surface, by `curvature`."""
    tu, tv, nu, nv = bend
    uu, uv, vv = dot(tu, tu), dot(tu, tv), dot(tv, tv)
    det = uu * vv - uv * uv
    if not det > _f4(0.0):
        return _ZERO
    pu, pv = dot(dp, tu), dot(dp, tv)
    a, b = (vv * pu - uv * pv) / det, (uu * pv - uv * pu) / det
    return add(scale(nu, a), scale(nv, b))


@device
def _turned(n, dn, w):
    """Change of the direction w that is fixed to the normal n, when that changes by dn."""
    return cross(cross(n, dn), w)


# --- bounces ----------------------------------------------------------------------------------------------------------


@device
def _bent(bend, n, h, wo, dp, dd, eta):
    """Change of the direction after a specular bounce about h of a ray that arrived from wo, whose place and direction
    change by dp and dd.

    n: shading normal with `curvature` bend; h: on the side of wo; eta: 0 for reflection, else n_i/n_t.
    """
    dh = _turned(n, _normal_change(bend, dp), h)
    d = (-wo[0], -wo[1], -wo[2])
    cosine = dot(d, h)  # negative
    dc = dot(dd, h) + dot(d, dh)
    if eta == _f4(0.0):
        return sub(dd, scale(add(scale(dh, cosine), scale(h, dc)), _f4(2.0)))
    cos_t = -_f4(math.sqrt(max(_f4(1.0) - eta * eta * (_f4(1.0) - cosine * cosine), _f4(1e-8))))
    m = eta * cosine - cos_t
    dm = (eta - eta * eta * cosine / cos_t) * dc
    return sub(scale(dd, eta), add(scale(dh, m), scale(h, dm)))


@device
def bounce_specular(bend, n, P, D, wo, wi, transmitted, eta, delta):
    """Changes of direction after a FOLLOWED lobe sent the ray from wo to wi.

    n: shading normal on the geometry's side, `bend` its `curvature`; eta: n_i/n_t; delta: whether the lobe reflects
    about the normal itself.
    """
    h = n
    if not delta:
        half = add(wo, wi) if not transmitted else add(scale(wo, eta), wi)
        if dot(half, half) > _f4(1e-6):
            h = normalize(half)
    if dot(h, wo) < _f4(0.0):
        h = (-h[0], -h[1], -h[2])
    if not transmitted:
        eta = _f4(0.0)
    return (
        _bent(bend, n, h, wo, P[0], D[0], eta),
        _bent(bend, n, h, wo, P[1], D[1], eta),
        _bent(bend, n, h, wo, P[2], D[2], eta),
        _bent(bend, n, h, wo, P[3], D[3], eta),
    )


@device
def bounce_stored(bend, n, P, wi):
    """The same after a STORED lobe: the direction turns with the normal n."""
    return (
        _turned(n, _normal_change(bend, P[0]), wi),
        _turned(n, _normal_change(bend, P[1]), wi),
        _turned(n, _normal_change(bend, P[2]), wi),
        _turned(n, _normal_change(bend, P[3]), wi),
    )


@device
def spread(D, wi, pdf):
    """Changes of direction with the spread of a lobe that was sampled with that density per solid angle added."""
    angle = _f4(1.0) / pdf
    c = cross(D[2], D[3])
    before = _f4(math.sqrt(dot(c, c)))
    if angle >= before:
        s, t = basis(wi)
        size = _f4(math.sqrt(angle + before))
        return D[0], D[1], scale(s, size), scale(t, size)
    size = _f4(math.sqrt((angle + before) / before))
    return D[0], D[1], scale(D[2], size), scale(D[3], size)
