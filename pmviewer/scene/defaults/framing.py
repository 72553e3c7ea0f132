"""Size of a scene, and how far away a camera must stand to see it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import Camera, Cylinder, Geometry, Mesh, Parallelogram, Shape, Vec3
from pmviewer.scene.meshes.mesh_bounds import mesh_bounds

Float = NDArray[np.float64]
Up = Literal["y", "z"]
FOV = 40.0
MARGIN = 1.06
"""Width of the picture over that of what is in it."""
AZIMUTH, ELEVATION = 36.0, 23.0
"""Degrees, of the view that is taken where nothing else matters: to the right of the front, slightly above."""
_MOST_GUESSES = 48
"""Some four are enough."""


def bounds(shapes: Sequence[Shape]) -> tuple[Float, Float]:
    """Lowest and highest corner of the box around all shapes."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for shape in shapes:
        for corner in _bounds(shape.geometry):
            low, high = np.minimum(low, corner), np.maximum(high, corner)
    return low, high


def _bounds(g: Geometry) -> tuple[Float, Float]:
    if isinstance(g, Mesh):
        return mesh_bounds(g)
    if isinstance(g, Parallelogram):
        c, u, v = np.array(g.corner), np.array(g.edge_u), np.array(g.edge_v)
        corners = np.stack([c, c + u, c + v, c + u + v])
        return corners.min(axis=0), corners.max(axis=0)
    if isinstance(g, Cylinder):
        # A circle around the axis reaches r·sqrt(1 − axis²) along each coordinate.
        axis = np.subtract(g.p1, g.p0) / math.dist(g.p0, g.p1)
        reach = g.radius * np.sqrt(np.maximum(0, 1 - axis**2))
        return np.minimum(g.p0, g.p1) - reach, np.maximum(g.p0, g.p1) + reach
    if hasattr(g, "normal"):
        reach = g.radius * np.sqrt(np.maximum(0, 1 - np.array(g.normal) ** 2))
        return np.array(g.center) - reach, np.array(g.center) + reach
    return np.array(g.center) - g.radius, np.array(g.center) + g.radius


def axes_of(up: Up) -> Float:
    """(3, 3): to the right, up, and towards who stands in front, as rows. What is in front is +z where y is up and −y
    where z is up."""
    return np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]] if up == "y" else [[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def direction(azimuth: float, elevation: float, up: Up) -> Float:
    """Unit vector from the scene to a camera at these angles (degrees), azimuth from the front to the right."""
    a, e = math.radians(azimuth), math.radians(elevation)
    return np.array([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)]) @ axes_of(up)


def fitted(points: Float, towards: Float, up: Up, fov: float = FOV) -> Camera:
    """The nearest camera in the direction `towards` (unit) that has all points (n, 3) in a square picture, with a
    margin. In a wider or higher picture they are in the middle square."""
    top = axes_of(up)[1]
    right = np.cross(top, towards)
    right /= np.linalg.norm(right)
    above = np.cross(towards, right)
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    size = max(float(np.linalg.norm(np.ptp(points, axis=0))), 1e-12)
    near = (points - center) @ towards
    slope = math.tan(math.radians(fov) / 2) / MARGIN
    # A point at (a, z) is inside if |a − x| ≤ slope (D − z): the tightest of all on either side give D.
    place, distance = center.copy(), float(near.max()) + 0.02 * size
    for axis in (right, above):
        across = (points - center) @ axis
        most, least = float((slope * near + across).max()), float((slope * near - across).max())
        distance = max(distance, (most + least) / (2 * slope))
    for axis in (right, above):
        place += _middle((points - center) @ axis, distance - near) * axis
    return looking(place + distance * towards, place, up, fov)


def _middle(across: Float, depth: Float) -> float:
    """Where an eye must stand for points at these places and depths to reach as far to one side of it as to the
    other: (a − x)/z is the largest for one point, the least for another, and their sum is 0.

    Each guess is the answer for the two points that reach farthest from the guess before."""
    low, high = float(across.min()), float(across.max())
    middle = (low + high) / 2
    for _ in range(_MOST_GUESSES):
        seen = (across - middle) / depth
        most, least = int(seen.argmax()), int(seen.argmin())
        reach = float(seen[most] + seen[least])
        low, high = (middle, high) if reach > 0 else (low, middle)
        a, b, p, q = across[most], across[least], depth[most], depth[least]
        guess = float((a * q + b * p) / (p + q))
        if abs(guess - middle) <= 1e-12 * (high - low):
            return guess
        middle = guess if low < guess < high else (low + high) / 2
    return middle


def looking(eye: Float, target: Float, up: Up, fov: float) -> Camera:
    """An upright camera."""
    return Camera(vec3(eye), vec3(target), vec3(axes_of(up)[1]), fov, "smaller")


def framed(shapes: Sequence[Shape], up: Up = "y", box: tuple[Float, Float] | None = None) -> Camera:
    """Three-quarter view from slightly above with everything inside the picture, whatever its shape: all shapes, or
    the box with these corners."""
    low, high = bounds(shapes) if box is None else box
    corners = np.array([[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    return fitted(corners, direction(AZIMUTH, ELEVATION, up), up)


def vec3(v: Float) -> Vec3:
    """The three numbers of an array."""
    return float(v[0]), float(v[1]), float(v[2])
