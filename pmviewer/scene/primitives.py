"""Meshes of the unit shapes, vertex normals, and what a transformation does to a mesh."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import Mesh
from pmviewer.scene.mitsuba_transform import Matrix, cofactor, mirrors

Float = NDArray[np.float64]


def cube() -> Mesh:
    """[-1, 1]³ with flat faces, outwards."""
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return Mesh(vertices, np.array([[a, b, c] for a, b, c, _ in quads] + [[a, c, d] for a, _, c, d in quads], np.int32))


def _grid_faces(rows: int, columns: int) -> NDArray[np.int32]:
    """Triangles of a grid of vertices whose last column joins the first."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = b + columns, a + columns
    return np.concatenate([np.stack([a, d, c], -1), np.stack([a, c, b], -1)]).reshape(-1, 3).astype(np.int32)


def sphere(rows: int = 64, columns: int = 128) -> Mesh:
    """Unit sphere, normals outwards. Triangles collapse at the poles; `clean` drops them."""
    theta = np.linspace(0, math.pi, rows + 1)[:, None]
    phi = np.linspace(0, 2 * math.pi, columns, endpoint=False)
    ring = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) * np.ones_like(phi)]
    points = np.stack(ring, axis=-1).reshape(-1, 3)
    return Mesh(points, _grid_faces(rows + 1, columns), points.copy())


def cylinder(columns: int = 128) -> Mesh:
    """Open tube of radius 1 from z = 0 to z = 1, normals away from the axis."""
    phi = np.linspace(0, 2 * math.pi, columns, endpoint=False)
    normal = np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], axis=1)
    points = np.concatenate([normal + [0, 0, 1], normal])
    return Mesh(points, _grid_faces(2, columns), np.concatenate([normal, normal]))


def disk(columns: int = 128) -> Mesh:
    """Unit disk in z = 0, facing +z."""
    phi = np.linspace(0, 2 * math.pi, columns, endpoint=False)
    rim = np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], axis=1)
    j = np.arange(columns)
    return Mesh(
        np.concatenate([[[0.0, 0, 0]], rim]), np.stack([0 * j, 1 + j, 1 + (j + 1) % columns], 1).astype(np.int32)
    )


def fans(polygons: NDArray[np.number]) -> NDArray[np.int64]:
    """(m, n) polygons of n corners as triangles (m·(n-2), 3)."""
    n = polygons.shape[1]
    if n < 3:
        return np.zeros((0, 3), np.int64)
    index = np.array([[0, i, i + 1] for i in range(1, n - 1)])
    with np.errstate(invalid="ignore"):  # NaN as an index becomes one that is out of range
        return polygons[:, index].reshape(-1, 3).astype(np.int64)


def transformed(mesh: Mesh, m: Matrix, flip: bool = False) -> Mesh:
    """The mesh in world space. What was outside stays outside under a mirroring transformation, unless `flip`."""
    mirrored = mirrors(m)
    normals = mesh.normals
    with np.errstate(invalid="ignore", over="ignore"):  # broken vertices are `clean`'s business
        vertices = mesh.vertices @ m[:3, :3].T + m[:3, 3]
        if normals is not None:
            normals = unit(normals @ cofactor(m).T) * (-1.0 if mirrored != flip else 1.0)
    faces = mesh.faces[:, ::-1] if mirrored != flip else mesh.faces
    return Mesh(vertices, np.ascontiguousarray(faces), normals)


def unit(vectors: Float) -> Float:
    """Rows scaled to length one; zero rows stay zero."""
    # Scaling by the largest component first keeps tiny and huge vectors from under- and overflowing.
    with np.errstate(invalid="ignore", over="ignore"):
        largest = np.abs(vectors).max(axis=1, keepdims=True)
        scaled = vectors / np.where(largest > 0, largest, 1)
        length = np.linalg.norm(scaled, axis=1, keepdims=True)
        return scaled / np.where(length > 0, length, 1)


def with_smooth_normals(mesh: Mesh) -> Mesh:
    """The mesh with vertex normals averaged over the faces at each position, weighted by their angle there
    (Thürmer and Wüthrich 1998)."""
    _, position = np.unique(mesh.vertices, axis=0, return_inverse=True)
    position = position.reshape(-1)
    corners = mesh.vertices[mesh.faces]
    with np.errstate(invalid="ignore", over="ignore"):
        face = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        total = np.zeros((position.max(initial=-1) + 1, 3))
        for i in range(3):
            a = unit(corners[:, (i + 1) % 3] - corners[:, i])
            b = unit(corners[:, (i + 2) % 3] - corners[:, i])
            angle = np.arccos(np.clip((a * b).sum(axis=1), -1, 1))
            weighted = np.nan_to_num(face * angle[:, None])
            index = position[mesh.faces[:, i]]
            for axis in range(3):
                total[:, axis] += np.bincount(index, weighted[:, axis], minlength=len(total))
    return Mesh(mesh.vertices, mesh.faces, unit(total)[position])
