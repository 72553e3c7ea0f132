"""Texture coordinates of a hit and how the surface runs along them (Mitsuba 3's conventions).

Triangles interpolate their corners' coordinates; a sphere has (azimuth / 2π, polar angle / π), a cylinder
(azimuth / 2π, height / length), a disk (distance / radius, azimuth / 2π), all in the shape's own frame.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.accel.instance import (
    I_TO_LOCAL,
    I_TO_WORLD,
    find_instance,
    has_instances,
    stored_of,
    transform_point,
    transform_vector,
)
from pmviewer.kernels.accel.quadric import CYLINDER, QUADRIC_FLOATS, SPHERE
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import load3
from pmviewer.kernels.vector import basis, cross, dot, scale, sub

_f4 = np.float32
_PI = _f4(math.pi)
_TURN = _f4(2.0 * math.pi)


@device
def in_frame(address, first, d):
    """Coordinates of the vector d along the three unit axes stored from number `first` on."""
    return dot(load3(address, first), d), dot(load3(address, first + 3), d), dot(load3(address, first + 6), d)


@device
def from_frame(address, first, x, y, z):
    """The vector with those coordinates."""
    a, b, c = load3(address, first), load3(address, first + 3), load3(address, first + 6)
    return x * a[0] + y * b[0] + z * c[0], x * a[1] + y * b[1] + z * c[1], x * a[2] + y * b[2] + z * c[2]


@device
def azimuth(x, y):
    """Angle about the z axis over 2π, in [0, 1)."""
    turn = _f4(math.atan2(y, x)) / _TURN
    if turn < _f4(0.0):
        turn += _f4(1.0)
    return turn


@device
def sphere_uv(x, y, z):
    """Of the unit direction (x, y, z) in a sphere's frame."""
    return azimuth(x, y), _f4(math.acos(max(_f4(-1.0), min(z, _f4(1.0))))) / _PI


@device
def disk_uv(x, y, radius):
    """Of the point (x, y) of a disk's plane."""
    return _f4(math.sqrt(x * x + y * y)) / radius, azimuth(x, y)


@specialised
def hit_uv(scene, prim, b1, b2, p):
    """Texture coordinates of the point p of primitive `prim`; (b1, b2) are a triangle's barycentric coordinates."""
    if not has_instances(scene):
        return lambda scene, prim, b1, b2, p: stored_uv(scene, prim, b1, b2, p)

    def through(scene, prim, b1, b2, p):
        if prim < scene.n_stored:
            return stored_uv(scene, prim, b1, b2, p)
        i = find_instance(scene, prim)
        x, y, z = transform_point(scene, i, I_TO_LOCAL, np.float64(p[0]), np.float64(p[1]), np.float64(p[2]))
        return stored_uv(scene, stored_of(scene, i, prim), b1, b2, (_f4(x), _f4(y), _f4(z)))

    return through


@device
def stored_uv(scene, prim, b1, b2, p):
    """`hit_uv` of a stored primitive, p in the coordinates that it is stored in."""
    if prim < scene.n_triangles:
        base = np.int64(prim) * 6
        u0, v0 = load_f4(scene.uvs, base), load_f4(scene.uvs, base + 1)
        if math.isnan(u0):
            return b1, b2
        b0 = _f4(1.0) - b1 - b2
        return (
            b0 * u0 + b1 * load_f4(scene.uvs, base + 2) + b2 * load_f4(scene.uvs, base + 4),
            b0 * v0 + b1 * load_f4(scene.uvs, base + 3) + b2 * load_f4(scene.uvs, base + 5),
        )
    j = np.int64(prim) - np.int64(scene.n_triangles)
    row = j * QUADRIC_FLOATS
    kind = np.int32(load_f4(scene.bvh_quadrics, row))
    radius = load_f4(scene.bvh_quadrics, row + 7)
    x, y, z = in_frame(scene.quadric_frames, j * 9, sub(p, load3(scene.bvh_quadrics, row + 1)))
    if kind == SPHERE:
        return sphere_uv(x / radius, y / radius, z / radius)
    if kind == CYLINDER:
        return azimuth(x, y), z / load_f4(scene.bvh_quadrics, row + 8)
    return disk_uv(x, y, radius)


@specialised
def hit_tangents(scene, prim, p, ng):
    """∂p/∂u and ∂p/∂v there; two axes orthogonal to the normal where texture coordinates say nothing."""
    if not has_instances(scene):
        return lambda scene, prim, p, ng: _stored_tangents(scene, prim, p, ng)

    def through(scene, prim, p, ng):
        if prim < scene.n_stored:
            return _stored_tangents(scene, prim, p, ng)
        i = find_instance(scene, prim)
        x, y, z = transform_point(scene, i, I_TO_LOCAL, np.float64(p[0]), np.float64(p[1]), np.float64(p[2]))
        du, dv = _stored_tangents(scene, stored_of(scene, i, prim), (_f4(x), _f4(y), _f4(z)), ng)
        return _to_world(scene, i, du), _to_world(scene, i, dv)

    return through


@device
def _to_world(scene, i, d):
    x, y, z = transform_vector(scene, i, I_TO_WORLD, np.float64(d[0]), np.float64(d[1]), np.float64(d[2]))
    return _f4(x), _f4(y), _f4(z)


@device
def _stored_tangents(scene, prim, p, ng):
    if prim < scene.n_triangles:
        return _triangle_tangents(scene, prim, ng)
    j = np.int64(prim) - np.int64(scene.n_triangles)
    row = j * QUADRIC_FLOATS
    kind = np.int32(load_f4(scene.bvh_quadrics, row))
    radius = load_f4(scene.bvh_quadrics, row + 7)
    frames = scene.quadric_frames
    x, y, z = in_frame(frames, j * 9, sub(p, load3(scene.bvh_quadrics, row + 1)))
    around = from_frame(frames, j * 9, -_TURN * y, _TURN * x, _f4(0.0))
    if kind == CYLINDER:
        return around, scale(load3(frames, j * 9 + 6), load_f4(scene.bvh_quadrics, row + 8))
    r = _f4(math.sqrt(x * x + y * y))
    if not r > _f4(1e-6) * radius:  # a pole, a disk's centre
        return basis(ng)
    cos, sin = x / r, y / r
    if kind == SPHERE:
        return around, from_frame(frames, j * 9, _PI * z * cos, _PI * z * sin, -_PI * r)
    return from_frame(frames, j * 9, radius * cos, radius * sin, _f4(0.0)), around


@device
def _triangle_tangents(scene, prim, ng):
    base = np.int64(prim) * 6
    u0, v0 = load_f4(scene.uvs, base), load_f4(scene.uvs, base + 1)
    du1, dv1 = load_f4(scene.uvs, base + 2) - u0, load_f4(scene.uvs, base + 3) - v0
    du2, dv2 = load_f4(scene.uvs, base + 4) - u0, load_f4(scene.uvs, base + 5) - v0
    determinant = du1 * dv2 - dv1 * du2
    if determinant == _f4(0.0):
        return basis(ng)
    corner = np.int64(prim) * 9
    a = load3(scene.vertices, corner)
    e1, e2 = sub(load3(scene.vertices, corner + 3), a), sub(load3(scene.vertices, corner + 6), a)
    if math.isnan(determinant):  # no coordinates: the barycentric ones
        return e1, e2
    inv = _f4(1.0) / determinant
    return (
        sub(scale(e1, dv2 * inv), scale(e2, dv1 * inv)),
        sub(scale(e2, du1 * inv), scale(e1, du2 * inv)),
    )


@device
def barycentrics(scene, prim, p):
    """(b1, b2) of the point p in the plane of triangle `prim`; (0, 0) for other primitives."""
    if prim >= scene.n_triangles:
        return _f4(0.0), _f4(0.0)
    corner = np.int64(prim) * 9
    a = load3(scene.vertices, corner)
    e1, e2 = sub(load3(scene.vertices, corner + 3), a), sub(load3(scene.vertices, corner + 6), a)
    d, n = sub(p, a), cross(e1, e2)
    inv = _f4(1.0) / dot(n, n)
    return dot(cross(d, e2), n) * inv, dot(cross(e1, d), n) * inv
