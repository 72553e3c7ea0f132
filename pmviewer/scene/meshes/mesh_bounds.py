"""The box around a mesh."""

from __future__ import annotations

import weakref

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.meshes.mesh import mark_used, number_marked
from pmviewer.scene.description import Mesh

_known: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}
"""By the identity of living meshes, which nobody changes: framing, centring and flattening all ask."""


def mesh_bounds(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest corner of the box around the vertices that the mesh's faces use."""
    if id(mesh) not in _known:
        box = np.empty(3), np.empty(3)
        vertices, faces = np.ascontiguousarray(mesh.vertices, np.float64), np.ascontiguousarray(mesh.faces, np.int32)
        number = np.full(len(vertices), -1, np.int32)
        mark_used(faces, number)
        number_marked(vertices, number, *box)
        know_bounds(mesh, *box)
    low, high = _known[id(mesh)]
    return low.copy(), high.copy()


def know_bounds(mesh: Mesh, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
    """What `mesh_bounds` will say of a mesh that nobody changes any more."""
    _known[id(mesh)] = low, high
    weakref.finalize(mesh, _known.pop, id(mesh), None)
