"""Size of a scene, and a camera for scenes that bring none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import Camera, Cylinder, Geometry, Mesh, Parallelogram, Shape
from pmviewer.scene.mesh_bounds import mesh_bounds

Float = NDArray[np.float64]
FOV = 40.0
_MARGIN = 1.05


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


def framed(shapes: Sequence[Shape], up: Literal["y", "z"] = "y", box: tuple[Float, Float] | None = None) -> Camera:
    """Three-quarter view from slightly above with everything inside the picture, whatever its shape: all shapes, or
    the box with these corners."""
    low, high = bounds(shapes) if box is None else box
    center, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-12)
    direction = np.array([0.55, 0.4, 0.75] if up == "y" else [0.55, -0.75, 0.4])
    direction /= np.linalg.norm(direction)
    distance = _MARGIN * radius / math.sin(math.radians(FOV) / 2)
    eye = center + distance * direction
    return Camera(
        origin=(float(eye[0]), float(eye[1]), float(eye[2])),
        target=(float(center[0]), float(center[1]), float(center[2])),
        up=(0.0, 1.0, 0.0) if up == "y" else (0.0, 0.0, 1.0),
        fov=FOV,
        fov_axis="smaller",
    )
