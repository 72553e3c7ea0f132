"""The box around a mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.mesh import bounds_of
from pmviewer.scene.description import Mesh


def mesh_bounds(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest corner of the box around the vertices that the mesh's faces use."""
    low, high = np.empty(3), np.empty(3)
    bounds_of(np.ascontiguousarray(mesh.vertices, np.float64), np.ascontiguousarray(mesh.faces, np.int32), low, high)
    return low, high
