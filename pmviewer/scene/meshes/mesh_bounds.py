"""The box around a mesh."""

from __future__ import annotations

import weakref

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.meshes.mesh import bounds_of
from pmviewer.scene.description import Mesh

_known: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}
"""By the identity of living meshes, which nobody changes: framing, centring and flattening all ask."""


def mesh_bounds(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest corner of the box around the vertices that the mesh's faces use."""
    if id(mesh) not in _known:
        box = np.empty(3), np.empty(3)
        bounds_of(np.ascontiguousarray(mesh.vertices, np.float64), np.ascontiguousarray(mesh.faces, np.int32), *box)
        _known[id(mesh)] = box
        weakref.finalize(mesh, _known.pop, id(mesh), None)
    low, high = _known[id(mesh)]
    return low.copy(), high.copy()
