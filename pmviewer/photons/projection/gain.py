"""By how much more of a lamp's photons aim at what is small (`pmviewer.photons.projection.cones`), from places all over
it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.photons.projection.scales import EVERYWHERE
from pmviewer.photons.projection.small import Small
from pmviewer.scene.description import Cylinder, Disk, Geometry, Mesh, Sphere

Float = NDArray[np.float64]

PLACES = 32
"""Along each of a light's coordinates."""


def gain_of(geometry: Geometry | None, position: Float | None, small: Small) -> float:
    """By how much more of the photons of a lamp aim at what is small, about; 1 where it doesn't shine there.

    The lamp is a surface that emits alike everywhere, or a point.
    """
    if geometry is None:
        assert position is not None
        points, normals, weights = position[None], None, np.ones(1)
    else:
        points, normals, weights = _places(geometry)
    away = small.center - points
    distance = np.linalg.norm(away, axis=1)
    outside = distance > small.radius
    ratio = np.minimum(small.radius / np.maximum(distance, 1e-300), 1.0)
    cones = np.maximum(np.ceil(-np.log2(ratio)), 1.0)
    if normals is None:
        share = (1 - np.sqrt(1 - ratio**2)) / 2
    else:
        cos = np.einsum("ij,ij->i", away, normals) / np.maximum(distance, 1e-300)
        share = np.where(outside, ratio**2 * np.maximum(cos, 0.0), 1.0)
    aimed = np.where(outside, EVERYWHERE * share + (1 - EVERYWHERE) / cones * (share > 0), share)
    usual = float(share @ weights)
    return float(aimed @ weights) / usual if usual > 0 else 1.0


def _places(geometry: Geometry) -> tuple[Float, Float, Float]:
    """Points (n, 3) all over a surface, the unit normals on the side that it faces, and the area of each, of any
    unit."""
    if isinstance(geometry, Mesh):
        corners = geometry.vertices[geometry.faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(cross, axis=1)
        return corners.mean(axis=1), cross / np.maximum(area, 1e-300)[:, None], area
    u, v = (axis.ravel() for axis in np.meshgrid(*[(np.arange(PLACES) + 0.5) / PLACES] * 2))
    phi, ones = 2 * math.pi * v, np.ones(len(u))
    if isinstance(geometry, Sphere):
        z = 2 * u - 1
        normals = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], axis=1)
        side = -1.0 if geometry.flip_normals else 1.0
        return geometry.center + geometry.radius * normals, side * normals, ones
    if isinstance(geometry, Disk):
        s, t = _across(np.array(geometry.normal, float))
        r = geometry.radius * np.sqrt(u)
        points = geometry.center + (r * np.cos(phi))[:, None] * s + (r * np.sin(phi))[:, None] * t
        return points, np.broadcast_to(geometry.normal, points.shape), ones
    if isinstance(geometry, Cylinder):
        axis = np.subtract(geometry.p1, geometry.p0)
        s, t = _across(axis / np.linalg.norm(axis))
        normals = np.cos(phi)[:, None] * s + np.sin(phi)[:, None] * t
        side = -1.0 if geometry.flip_normals else 1.0
        return geometry.p0 + u[:, None] * axis + geometry.radius * normals, side * normals, ones
    normal = np.cross(geometry.edge_u, geometry.edge_v)
    points = np.array(geometry.corner) + u[:, None] * geometry.edge_u + v[:, None] * geometry.edge_v
    return points, np.broadcast_to(normal / np.linalg.norm(normal), points.shape), ones


def _across(axis: Float) -> tuple[Float, Float]:
    """Two unit vectors perpendicular to a unit one and to each other."""
    s = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    s /= np.linalg.norm(s)
    return s, np.cross(axis, s)
