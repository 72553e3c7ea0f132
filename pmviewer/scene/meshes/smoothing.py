"""Vertex normals with sharp edges: faces share a normal at a vertex where they meet at less than some angle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.primitives import unit, with_smooth_normals
from pmviewer.scene.description import Mesh

_MOST_ROUNDS = 64


def smoothed(mesh: Mesh, degrees: float) -> Mesh:
    """The mesh with vertices at one place joined or split so that only faces within `degrees` of each other share a
    normal, as `maxSmoothAngle` of Mitsuba 0.6 does it; texture coordinates and colours keep their seams.

    At each place the first face gathers those within the angle of it, the first of the rest gathers again, and so on;
    where that goes on for more than 64 rounds the remaining faces keep normals of their own.
    """
    corners = mesh.vertices[mesh.faces]
    with np.errstate(invalid="ignore", over="ignore"):
        face = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    place = _places(mesh)[mesh.faces.reshape(-1)]
    normal = np.repeat(face, 3, axis=0)
    cluster = _clusters(place, normal, math.cos(math.radians(min(degrees, 180.0))))
    _, first, index = np.unique(np.stack([place, cluster], axis=1), axis=0, return_index=True, return_inverse=True)
    old = mesh.faces.reshape(-1)[first]
    split = Mesh(
        mesh.vertices[old],
        index.reshape(-1, 3).astype(np.int32),
        None,
        None if mesh.uv is None else mesh.uv[old],
        None if mesh.colours is None else mesh.colours[old],
    )
    normals = with_smooth_normals(Mesh(split.vertices, split.faces), seams=True).normals
    return Mesh(split.vertices, split.faces, normals, split.uv, split.colours)


def _places(mesh: Mesh) -> NDArray[np.int64]:
    """Number of each vertex, the same for those that agree in all but the normal."""
    columns = [mesh.vertices, *(c for c in (mesh.uv, mesh.colours) if c is not None)]
    _, index = np.unique(np.concatenate(columns, axis=1), axis=0, return_inverse=True)
    return np.asarray(index.reshape(-1), np.int64)


def _clusters(place: NDArray[np.int64], normal: NDArray[np.float64], cosine: float) -> NDArray[np.int64]:
    """Number of the round in which each corner was gathered at its place."""
    cluster = np.full(len(place), -1, np.int64)
    left = np.arange(len(place))
    for turn in range(_MOST_ROUNDS):
        if not len(left):
            return cluster
        _, first, own = np.unique(place[left], return_index=True, return_inverse=True)
        leader = left[first][own.reshape(-1)]
        with np.errstate(invalid="ignore"):
            near = (normal[left] * normal[leader]).sum(axis=1) >= cosine
        near |= left == leader
        cluster[left[near]] = turn
        left = left[~near]
    cluster[left] = _MOST_ROUNDS + np.arange(len(left))
    return cluster
