"""Geometry moved, turned and scaled alike in all directions: what every shape can be without becoming another."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import Cylinder, Disk, Frame, Geometry, Mesh, Parallelogram, Sphere, Vec3

Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Similarity:
    """x ↦ size · turn x + move, with a rotation `turn` (3, 3)."""

    turn: Matrix
    size: float
    move: NDArray[np.float64]

    def matrix(self) -> Matrix:
        """(4, 4), for column vectors."""
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = self.size * self.turn, self.move
        return m

    def point(self, p: Vec3) -> Vec3:
        """Where the point goes."""
        return _vec3(self.size * (self.turn @ np.asarray(p, float)) + self.move)

    def vector(self, v: Vec3) -> Vec3:
        """A difference of points: turned and scaled."""
        return _vec3(self.size * (self.turn @ np.asarray(v, float)))

    def direction(self, d: Vec3) -> Vec3:
        """A unit vector: turned alone."""
        return _vec3(self.turn @ np.asarray(d, float))


def similarity(
    middle: NDArray[np.float64], move: Vec3 = (0.0, 0.0, 0.0), turn: Vec3 = (0.0, 0.0, 0.0), size: float = 1.0
) -> Similarity:
    """Scaled and turned around `middle` (3,), then moved. `turn` in degrees, about the x, then y, then z axis."""
    rotation = rotation_of(turn)
    return Similarity(rotation, size, middle - size * (rotation @ middle) + np.asarray(move, float))


def rotation_of(turn: Vec3) -> Matrix:
    """(3, 3): about the x, then the y, then the z axis, right-handed, in degrees."""
    (cx, cy, cz), (sx, sy, sz) = ([f(math.radians(angle)) for angle in turn] for f in (math.cos, math.sin))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def angles_of(rotation: Matrix) -> Vec3:
    """The inverse of `rotation_of`, each angle in −180 … 180 degrees."""
    y = math.asin(min(max(-float(rotation[2, 0]), -1.0), 1.0))
    if abs(math.cos(y)) > 1e-9:
        x, z = math.atan2(rotation[2, 1], rotation[2, 2]), math.atan2(rotation[1, 0], rotation[0, 0])
    else:  # x and z turn about the same axis
        x, z = 0.0, math.atan2(-rotation[0, 1], rotation[1, 1])
    return math.degrees(x), math.degrees(y), math.degrees(z)


def transformed(g: Geometry, by: Similarity) -> Geometry:
    """The geometry elsewhere."""
    if isinstance(g, Mesh):
        normals = None if g.normals is None else g.normals @ by.turn.T
        return replace(g, vertices=by.size * (g.vertices @ by.turn.T) + by.move, normals=normals)
    if isinstance(g, Parallelogram):
        return replace(g, corner=by.point(g.corner), edge_u=by.vector(g.edge_u), edge_v=by.vector(g.edge_v))
    if isinstance(g, Cylinder):
        radius = g.radius * by.size
        return replace(g, p0=by.point(g.p0), p1=by.point(g.p1), radius=radius, frame=_frame(g.frame, by))
    center, radius = by.point(g.center), g.radius * by.size
    if isinstance(g, Disk):
        return replace(g, center=center, normal=by.direction(g.normal), radius=radius, frame=_frame(g.frame, by))
    assert isinstance(g, Sphere)
    axes = g.frame if g.frame is not None else ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return replace(g, center=center, radius=radius, frame=_frame(axes, by))


def _frame(frame: Frame | None, by: Similarity) -> Frame | None:
    if frame is None:
        return None
    x, y, z = frame
    return by.direction(x), by.direction(y), by.direction(z)


def _vec3(v: NDArray[np.float64]) -> Vec3:
    return float(v[0]), float(v[1]), float(v[2])
