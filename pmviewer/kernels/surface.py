"""From a ray's hit to a point on the surface with a known error, and rays that leave it without hitting it again.

Hit points are interpolated from the vertices (or projected onto the quadric), so their error does not grow with the
distance of the ray's origin, but it does with the coordinates of the whole triangle. Along the normal n it is at most a
few roundings of Σ|nᵢ|·max|vᵢ| over the vertices v; rays start off the surface by a multiple of that, the `gap`, never
by a constant: scenes of any size give the same picture, and a wide floor parallel to the axes needs no wide gap.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.instance import (
    I_TO_LOCAL,
    I_TO_WORLD,
    find_instance,
    has_instances,
    normal_to_world,
    stored_of,
    transform_point,
)
from pmviewer.kernels.accel.quadric import quadric_normal, quadric_project
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import load3
from pmviewer.kernels.vector import cross, dot, normalize, sub

_f4 = np.float32

QUADRIC_SIDE = 9
"""Column of a quadric that is 1, or −1 when its normals are flipped."""

STRAIGHT = _f4(0.9999)
"""Cosine between the normals from which a shading normal is the surface's own."""

_LEAST_COSINES = _f4(1e-5)
"""Bound on what a shading normal makes of one photon. It costs 6e-5 of the light on a surface whose shading normals are
unlike its own all over; 1e-3 would cost 0.4 %."""

OFFSET = _f4(2.0**-17)
"""Distance off the surface in units of the coordinates' size: 64 rounding errors of float32."""


@device
def gap_of(n, size_x, size_y, size_z):
    """How far rays start off a surface with unit normal n whose coordinates have these magnitudes."""
    return OFFSET * (abs(n[0]) * size_x + abs(n[1]) * size_y + abs(n[2]) * size_z)


@specialised
def surface_at(scene, prim, u, v, ox, oy, oz, dx, dy, dz, t):
    """The point hit, its geometric unit normal, its shading unit normal (same side), and the gap for `leave`."""
    if has_instances(scene):
        return lambda scene, prim, u, v, ox, oy, oz, dx, dy, dz, t: _through_instances(
            scene, prim, u, v, ox, oy, oz, dx, dy, dz, t
        )
    return lambda scene, prim, u, v, ox, oy, oz, dx, dy, dz, t: _stored_surface(
        scene, prim, u, v, ox, oy, oz, dx, dy, dz, t
    )


@device
def _through_instances(scene, prim, u, v, ox, oy, oz, dx, dy, dz, t):
    """`surface_at` for a scene with instances.

    A distance h off a plane with unit normal n in the group is h / |Wᵀn| in the world, W being the linear part of the
    way into the group; so the gap of the group's coordinates counts, and that of the world's comes on top.
    """
    if prim < scene.n_stored:
        return _stored_surface(scene, prim, u, v, ox, oy, oz, dx, dy, dz, t)
    i = find_instance(scene, prim)
    stored = stored_of(scene, i, prim)
    far = np.float64(t)
    x, y, z = transform_point(scene, i, I_TO_LOCAL, ox + far * dx, oy + far * dy, oz + far * dz)
    no = _f4(0.0)
    q, local, shading, local_gap = _stored_surface(scene, stored, u, v, _f4(x), _f4(y), _f4(z), no, no, no, no)
    x, y, z = transform_point(scene, i, I_TO_WORLD, q[0], q[1], q[2])
    nx, ny, nz, stretch = normal_to_world(scene, i, local[0], local[1], local[2])
    ng = (nx, ny, nz)
    nx, ny, nz, _ = normal_to_world(scene, i, shading[0], shading[1], shading[2])
    ns = (nx, ny, nz)
    if dot(ns, ng) < _f4(0.0):
        ns = (-ns[0], -ns[1], -ns[2])
    p = (_f4(x), _f4(y), _f4(z))
    return p, ng, ns, gap_of(ng, abs(p[0]), abs(p[1]), abs(p[2])) + _f4(local_gap / stretch)


@device
def _stored_surface(scene, prim, u, v, ox, oy, oz, dx, dy, dz, t):
    if prim < scene.n_triangles:
        base = np.int64(prim) * 9
        a = load3(scene.vertices, base)
        b = load3(scene.vertices, base + 3)
        c = load3(scene.vertices, base + 6)
        w = _f4(1.0) - u - v
        p = (
            w * a[0] + u * b[0] + v * c[0],
            w * a[1] + u * b[1] + v * c[1],
            w * a[2] + u * b[2] + v * c[2],
        )
        ng = normalize(cross(sub(b, a), sub(c, a)))
        gap = gap_of(
            ng,
            max(abs(a[0]), max(abs(b[0]), abs(c[0]))),
            max(abs(a[1]), max(abs(b[1]), abs(c[1]))),
            max(abs(a[2]), max(abs(b[2]), abs(c[2]))),
        )
        ns = interpolated_normal(scene, base, u, v, ng)
        if dot(ns, ng) < _f4(0.0):
            ns = (-ns[0], -ns[1], -ns[2])
        return p, ng, ns, gap
    j = np.int64(prim) - np.int64(scene.n_triangles)
    p = quadric_project(scene, j, ox + t * dx, oy + t * dy, oz + t * dz)
    side = load_f4(scene.bvh_quadrics, j * 12 + QUADRIC_SIDE)
    ng = quadric_normal(scene, j, p[0], p[1], p[2])
    ng = (side * ng[0], side * ng[1], side * ng[2])
    return p, ng, ng, gap_of(ng, abs(p[0]), abs(p[1]), abs(p[2]))


@device
def interpolated_normal(scene, base, u, v, ng):
    """The vertex normals of the triangle whose numbers begin at `base`, interpolated; its normal ng if it has none."""
    if scene.normals == 0:
        return ng
    a, b, c = load3(scene.normals, base), load3(scene.normals, base + 3), load3(scene.normals, base + 6)
    w = _f4(1.0) - u - v
    m = (w * a[0] + u * b[0] + v * c[0], w * a[1] + u * b[1] + v * c[1], w * a[2] + u * b[2] + v * c[2])
    if dot(m, m) > _f4(1e-12):
        return normalize(m)
    return ng


@device
def leave(p, ng, gap, dx, dy, dz):
    """Where a ray leaves the surface point p in direction (dx, dy, dz): `gap` off it on that direction's side."""
    if dx * ng[0] + dy * ng[1] + dz * ng[2] < _f4(0.0):
        gap = -gap
    return p[0] + gap * ng[0], p[1] + gap * ng[1], p[2] + gap * ng[2]


@device
def adjoint_cosines(ns, ng, wi, wo):
    """What a shading normal ns multiplies a photon's weight by on its way from wi to wo (Veach 1997, §5.3).

    Eye paths use f·|ns·wi| where the surface has |ng·wi|. For photons, which travel the other way, the same scattering
    is f·|ns·wi|·|ng·wo|/(|ng·wi|·|ns·wo|) per |ns·wo|.
    """
    return (abs(dot(ns, wi)) * abs(dot(ng, wo))) / max(abs(dot(ng, wi)) * abs(dot(ns, wo)), _LEAST_COSINES)


@device
def face(n, d):
    """n turned to the side that the direction d points to."""
    if dot(n, d) < _f4(0.0):
        return -n[0], -n[1], -n[2]
    return n
