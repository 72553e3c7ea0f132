"""Many copies of a mesh as one mesh, made at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.primitives import unit
from pmviewer.scene.description import Mesh

Float = NDArray[np.float64]


def joined_copies(mesh: Mesh, to_world: Float) -> Mesh:
    """The mesh under each of the matrices (k, 4, 4), in their order, as `primitives.transformed` makes them."""
    linear, count = to_world[:, :3, :3], len(to_world)
    a, b, c = linear[:, :, 0], linear[:, :, 1], linear[:, :, 2]
    with np.errstate(invalid="ignore", over="ignore"):  # broken vertices are `clean`'s business
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
        mirrored = (a * cofactors[:, :, 0]).sum(axis=1) < 0
        vertices = np.einsum("kij,vj->kvi", linear, mesh.vertices) + to_world[:, None, :3, 3]
        normals = None
        if mesh.normals is not None:
            turned = np.einsum("kij,vj->kvi", cofactors, mesh.normals) * np.where(mirrored, -1.0, 1.0)[:, None, None]
            normals = unit(turned.reshape(-1, 3))
    faces = np.where(mirrored[:, None, None], mesh.faces[None, :, ::-1], mesh.faces[None])
    faces = faces + (np.arange(count) * len(mesh.vertices))[:, None, None]
    return Mesh(
        vertices.reshape(-1, 3),
        faces.reshape(-1, 3).astype(np.int32),
        normals,
        None if mesh.uv is None else np.tile(mesh.uv, (count, 1)),
        None if mesh.colours is None else np.tile(mesh.colours, (count, 1)),
    )
