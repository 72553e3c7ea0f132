"""Shape elements as geometry in world space."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.scene.arrays import primitives
from pmviewer.scene.arrays.texture_coordinates import orthonormal
from pmviewer.scene.description import Cylinder, Disk, Frame, Geometry, Parallelogram, Sphere, Vec3
from pmviewer.scene.formats.mitsuba.curves import CURVES, curves
from pmviewer.scene.formats.mitsuba.displacement import displacement
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.mesh_file import MESH_FILES, mesh_file
from pmviewer.scene.formats.mitsuba.transform import Matrix, apply, mirrors, similar_columns

SUPPORTED = (*MESH_FILES, *CURVES, "rectangle", "cube", "sphere", "disk", "cylinder")


def _vec3(v: np.ndarray) -> Vec3:
    x, y, z = (float(c) for c in v)
    return (x, y, z)


def geometry(p: Properties) -> Geometry:
    """Geometry of a supported <shape>, displaced if it has a displacement. Raises SceneError."""
    return displacement(p, _smooth_geometry(p))


def _smooth_geometry(p: Properties) -> Geometry:
    to_world = p.transform()
    flip = p.boolean("flip_normals", False)
    if p.type in MESH_FILES:
        return mesh_file(p, to_world, flip)
    if p.type in CURVES:
        return curves(p, to_world, flip)
    if p.type == "cube":
        return primitives.transformed(primitives.cube(), to_world, flip)
    if p.type == "rectangle":
        return _rectangle(to_world, flip)
    if p.type == "sphere":
        return _sphere(p, to_world, flip)
    if p.type == "disk":
        return _disk(p, to_world, flip)
    return _cylinder(p, to_world, flip)


def _rectangle(m: Matrix, flip: bool) -> Parallelogram:
    edge_u, edge_v = _vec3(2 * m[:3, 0]), _vec3(2 * m[:3, 1])
    swap = mirrors(m) != flip
    if swap:
        edge_u, edge_v = edge_v, edge_u
    return Parallelogram(_vec3(apply(m, (-1, -1, 0))), edge_u, edge_v, swap)


def _frame(m: Matrix) -> Frame:
    """The transformation's axes at unit length."""
    x, y, z = (_vec3(row) for row in primitives.unit(m[:3, :3].T))
    return x, y, z


def _uneven(p: Properties) -> None:
    p.document.warn(f"{p.element} is scaled unevenly: it is cut into triangles.", p.element)


def _sphere(p: Properties, to_world: Matrix, flip: bool) -> Geometry:
    center, radius = p.point("center", (0.0, 0.0, 0.0)), p.number("radius", 1.0)
    # Mitsuba turns a mirrored sphere (or one of negative radius) inside out.
    flip = flip != (mirrors(to_world) != (radius < 0))
    scale = similar_columns(to_world)
    if scale is not None:
        return Sphere(_vec3(apply(to_world, center)), abs(radius) * scale, flip, _frame(to_world))
    _uneven(p)
    local = np.eye(4)
    local[:3, :3] *= abs(radius)
    local[:3, 3] = center
    return primitives.transformed(primitives.sphere(), to_world @ local, flip)


def _disk(p: Properties, to_world: Matrix, flip: bool) -> Geometry:
    radius = similar_columns(to_world, 2)
    if radius is None:
        _uneven(p)
        return primitives.transformed(primitives.disk(), to_world, flip)
    normal = primitives.unit(np.cross(to_world[:3, 0], to_world[:3, 1])[None])[0]
    facing = -normal if mirrors(to_world) != flip else normal
    upright = to_world.copy()
    upright[:3, 2] = normal
    return Disk(_vec3(to_world[:3, 3]), _vec3(facing), radius, _frame(upright))


def _cylinder(p: Properties, to_world: Matrix, flip: bool) -> Geometry:
    p0, p1 = p.point("p0", (0.0, 0.0, 0.0)), p.point("p1", (0.0, 0.0, 1.0))
    radius = abs(p.number("radius", 1.0))
    axis = np.subtract(p1, p0, dtype=np.float64)
    length = float(np.linalg.norm(axis))
    if length == 0:
        return Cylinder(p0, p0, radius, flip)
    w = axis / length
    u, v, _ = orthonormal(w)
    local = np.eye(4)
    local[:3, 0], local[:3, 1], local[:3, 2], local[:3, 3] = radius * u, radius * v, axis, p0
    m = to_world @ local
    world_radius = similar_columns(m, 2)
    upright = np.abs(m[:3, 2] @ m[:3, :2]).max() <= 1e-5 * np.linalg.norm(m[:3, 2]) * (world_radius or 0)
    if world_radius is not None and (upright or math.isclose(radius, 0)):
        return Cylinder(_vec3(m[:3, 3]), _vec3(m[:3, 3] + m[:3, 2]), world_radius, flip, _frame(m))
    _uneven(p)
    return primitives.transformed(primitives.cylinder(), m, flip)
