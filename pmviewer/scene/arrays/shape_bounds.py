"""Boxes around shapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import Cylinder, Mesh, Parallelogram, Shape
from pmviewer.scene.meshes.mesh_bounds import mesh_bounds


def shape_bounds(shape: Shape) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
