"""From a ray's hit to a point on the surface with a small, known error, and rays that leave it without hitting it again.

Hit points are interpolated from the vertices (or projected onto the quadric), so their error does not grow with the
distance of the ray's origin. Rays start off the surface by a multiple of that error, never by a constant: scenes of any
size give the same picture.
"""

from __future__ import annotations


import numpy as np

from pmviewer.kernels.jit import device, device_call
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.quadric import quadric_normal, quadric_project
from pmviewer.kernels.scene import load3
from pmviewer.kernels.vector import cross, dot, normalize, sub

_f4 = np.float32

QUADRIC_SIDE = 9
"""Column of a quadric that is 1, or −1 when its normals are flipped."""

OFFSET = _f4(2.0**-17)
"""Distance off the surface in units of the coordinates' size: 64 rounding errors of float32."""


@device_call
def surface_at(scene, prim, u, v, ox, oy, oz, dx, dy, dz, t):
    """The point hit, its geometric unit normal and its shading unit normal (same side), as three vectors."""
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
        ns = ng
        if scene.normals != 0:
            na = load3(scene.normals, base)
            nb = load3(scene.normals, base + 3)
            nc = load3(scene.normals, base + 6)
            m = (
                w * na[0] + u * nb[0] + v * nc[0],
                w * na[1] + u * nb[1] + v * nc[1],
                w * na[2] + u * nb[2] + v * nc[2],
            )
            if dot(m, m) > _f4(1e-12):
                ns = normalize(m)
                if dot(ns, ng) < _f4(0.0):
                    ns = (-ns[0], -ns[1], -ns[2])
        return p, ng, ns
    j = np.int64(prim) - np.int64(scene.n_triangles)
    p = quadric_project(scene, j, ox + t * dx, oy + t * dy, oz + t * dz)
    side = load_f4(scene.bvh_quadrics, j * 12 + QUADRIC_SIDE)
    ng = quadric_normal(scene, j, p[0], p[1], p[2])
    ng = (side * ng[0], side * ng[1], side * ng[2])
    return p, ng, ng


@device
def leave(p, ng, dx, dy, dz):
    """Origin of a ray that leaves the surface point p in direction (dx, dy, dz), on that direction's side."""
    size = abs(p[0]) + abs(p[1]) + abs(p[2])
    delta = OFFSET * size
    if dx * ng[0] + dy * ng[1] + dz * ng[2] < _f4(0.0):
        delta = -delta
    return p[0] + delta * ng[0], p[1] + delta * ng[1], p[2] + delta * ng[2]


@device
def face(n, d):
    """n turned to the side that the direction d points to."""
    if dot(n, d) < _f4(0.0):
        return -n[0], -n[1], -n[2]
    return n
