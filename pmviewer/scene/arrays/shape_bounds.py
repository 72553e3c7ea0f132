"""Boxes around shapes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import Cylinder, Mesh, Parallelogram, Shape
from pmviewer.scene.meshes.mesh_bounds import mesh_bounds

Corner = NDArray[np.float64]

ROUNDING = 1e-4
"""Of the largest coordinate: what a ray in float32 may be off, and how far off a surface it starts, many times over."""


def shape_bounds(shape: Shape) -> tuple[Corner, Corner]:
    """Lowest and highest corner (3,) of a box around the shape."""
    g = shape.geometry
    if isinstance(g, Mesh):
        return mesh_bounds(g)
    if isinstance(g, Parallelogram):
        corners = np.array(g.corner) + np.array(
            [[0, 0, 0], g.edge_u, g.edge_v, np.add(g.edge_u, g.edge_v)], dtype=float
        )
        return corners.min(axis=0), corners.max(axis=0)
    if isinstance(g, Cylinder):
        return np.minimum(g.p0, g.p1) - g.radius, np.maximum(g.p0, g.p1) + g.radius
    return np.array(g.center) - g.radius, np.array(g.center) + g.radius


def box_around(shapes: Iterable[Shape]) -> tuple[Corner, Corner]:
    """Lowest and highest corner (3,) of a box around all of them; infinite and low > high around none."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for shape in shapes:
        corners = shape_bounds(shape)
        low, high = np.minimum(low, corners[0]), np.maximum(high, corners[1])
    return low, high


def box_to_be_met(shapes: Iterable[Shape], largest: float) -> tuple[Corner, Corner]:
    """`box_around`, with room for rounding in a scene whose coordinates go up to `largest`."""
    low, high = box_around(shapes)
    return low - ROUNDING * largest, high + ROUNDING * largest
