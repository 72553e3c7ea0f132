"""Texture coordinates of shapes as arrays: corners of triangles, frames of round shapes, points picked on a shape."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import Cylinder, Disk, Geometry, Mesh, Parallelogram, Sphere

Float = NDArray[np.float64]
_STRAIGHT = 0.9999
"""Cosine between a normal and the surface's own."""


def orthonormal(n: Float) -> Float:
    """(3, 3): two unit vectors and the unit vector n, right-handed, as `pmviewer.kernels.vector.basis` makes them."""
    sign = math.copysign(1.0, n[2])
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    return np.array([[1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]], [b, sign + n[1] * n[1] * a, -n[1]], n])


def _axis(g: Disk | Cylinder) -> Float:
    axis = np.array(g.normal) if isinstance(g, Disk) else np.subtract(g.p1, g.p0)
    return axis / np.linalg.norm(axis)


def frame_of(g: Sphere | Cylinder | Disk) -> Float:
    """(3, 3): the axes that a round shape's texture coordinates refer to."""
    if g.frame is not None:
        return np.array(g.frame, float)
    return np.eye(3) if isinstance(g, Sphere) else orthonormal(_axis(g))


def rectangle_uv(g: Parallelogram) -> Float:
    """(2, 3): u = a + b s + c t and v likewise, s and t running along the edges."""
    uv = np.array([[0.0, 1, 0], [0, 0, 1]])
    return uv[::-1] if g.swap_uv else uv


def corner_uv(g: Geometry) -> Float:
    """(n, 3, 2): of the corners of the triangles that the shape is traced as; NaN where it has no coordinates."""
    if isinstance(g, Parallelogram):
        corners = np.array([[[0.0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
        return corners[..., ::-1] if g.swap_uv else corners
    assert isinstance(g, Mesh)
    return np.full((len(g.faces), 3, 2), np.nan) if g.uv is None else g.uv[g.faces]


def rectangle_of(mesh: Mesh) -> tuple[Parallelogram, Float] | None:
    """A mesh of two triangles that is a parallelogram, and its coordinates as in `rectangle_uv`; None for others, and
    where vertex normals lean over."""
    if len(mesh.faces) != 2 or mesh.uv is None or _leans(mesh):
        return None
    shared = [i for i in range(3) if mesh.faces[0, i] in mesh.faces[1]]
    if len(shared) != 2:
        return None
    lone = ({0, 1, 2} - set(shared)).pop()
    corner, after, before = (mesh.faces[0, (lone + k) % 3] for k in range(3))
    other = next(f for f in mesh.faces[1] if f not in mesh.faces[0])
    a, b, c, d = (np.append(mesh.vertices[i], mesh.uv[i]) for i in (corner, after, before, other))
    size = np.abs(np.stack([b - a, c - a])).max(axis=0)
    if np.any(np.abs(b + c - a - d) > 1e-6 * np.maximum(size, 1e-30) + 1e-9 * np.abs(a)):
        return None
    points = [tuple(float(x) for x in p[:3]) for p in (a, b - a, c - a)]
    uv = np.stack([a[3:], (b - a)[3:], (c - a)[3:]], axis=1)
    return Parallelogram(*points), uv  # type: ignore[arg-type]


def _leans(mesh: Mesh) -> bool:
    if mesh.normals is None:
        return False
    corners = mesh.vertices[mesh.faces]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-300)
    return bool((np.abs((mesh.normals[mesh.faces] * face[:, None]).sum(axis=2)) < _STRAIGHT).any())


def square_uv(g: Geometry, affine: Float | None, s: Float, t: Float) -> Float:
    """(n, 2): texture coordinates where `pmviewer.kernels.lights.light.light_point` maps (s, t) in the unit square;
    `affine` are a rectangle's."""
    if isinstance(g, Parallelogram):
        uv = rectangle_uv(g) if affine is None else affine
        return np.stack([row[0] + row[1] * s + row[2] * t for row in uv], axis=1)
    if isinstance(g, Mesh):
        return _mesh_uv(g, s, t)
    frame = frame_of(g)
    if isinstance(g, Sphere):
        z = 1 - 2 * s
        r, phi = np.sqrt(np.maximum(0, 1 - z * z)), 2 * math.pi * t
        x, y, z = frame @ np.stack([r * np.cos(phi), r * np.sin(phi), z])
        return np.stack([_azimuth(x, y), np.arccos(np.clip(z, -1, 1)) / math.pi], axis=1)
    across = orthonormal(_axis(g))[:2]
    if isinstance(g, Cylinder):
        phi = 2 * math.pi * s
        x, y, _ = frame @ (across.T @ np.stack([np.cos(phi), np.sin(phi)]))
        return np.stack([_azimuth(x, y), t], axis=1)
    x, y, _ = frame @ (across.T @ _disk(s, t))
    return np.stack([np.hypot(x, y), _azimuth(x, y)], axis=1)


def _azimuth(x: Float, y: Float) -> Float:
    return (np.arctan2(y, x) / (2 * math.pi)) % 1.0


def _disk(s: Float, t: Float) -> Float:
    """(2, n): the concentric map."""
    a, b = 2 * s - 1, 2 * t - 1
    wide = np.abs(a) > np.abs(b)
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.where(wide, b / a, np.where(b != 0, a / b, 0.0)) * (math.pi / 4)
    r = np.where(wide, a, b)
    return r * np.where(wide, [np.cos(angle), np.sin(angle)], [np.sin(angle), np.cos(angle)])


def _mesh_uv(mesh: Mesh, s: Float, t: Float) -> Float:
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    cumulative = np.concatenate([[0.0], np.cumsum(areas) / areas.sum()])
    k = np.clip(np.searchsorted(cumulative, s, side="right") - 1, 0, len(areas) - 1)
    s = (s - cumulative[k]) / np.maximum(cumulative[k + 1] - cumulative[k], 1e-300)
    root = np.sqrt(np.clip(s, 0, 1))
    b1, b2 = t * root, 1 - root
    uv = np.array([[0.0, 0], [1, 0], [0, 1]]) if mesh.uv is None else mesh.uv[mesh.faces[k]]
    weights = np.stack([1 - b1 - b2, b1, b2], axis=1)
    return (weights[..., None] * uv).sum(axis=1)
