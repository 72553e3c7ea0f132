"""Meshes of the unit shapes, vertex normals, and what a transformation does to a mesh."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import Mesh
from pmviewer.scene.formats.mitsuba.transform import Matrix, cofactor, mirrors

Float = NDArray[np.float64]


@cache
def cube() -> Mesh:
    """[-1, 1]³ with flat faces, outwards; each face has the whole square as texture coordinates."""
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    # Where each face's first corner lies on the texture, counted round it: as Mitsuba lays it on.
    starts = (0, 1, 0, 2, 3, 0)
    corners = vertices[np.array(quads)].reshape(-1, 3)
    square = np.array([[0.0, 0], [0, 1], [1, 1], [1, 0]])
    uv = np.concatenate([np.roll(square, -start, axis=0) for start in starts])
    a = np.arange(0, 24, 4)
    faces = np.concatenate([np.stack([a, a + 1, a + 2], 1), np.stack([a, a + 2, a + 3], 1)]).astype(np.int32)
    return Mesh(corners, faces, uv=uv)


def _grid_faces(rows: int, columns: int) -> NDArray[np.int32]:
    """Triangles of a grid of vertices that is `columns` cells wide."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    a = i * (columns + 1) + j
    b, d = a + 1, a + columns + 1
    c = d + 1
    return np.concatenate([np.stack([a, d, c], -1), np.stack([a, c, b], -1)]).reshape(-1, 3).astype(np.int32)


def sphere(rows: int = 64, columns: int = 128) -> Mesh:
    """Unit sphere, normals outwards. Triangles collapse at the poles; `clean` drops them."""
    theta = np.linspace(0, math.pi, rows + 1)[:, None]
    phi = _around(columns)
    ring = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) * np.ones_like(phi)]
    points = np.stack(ring, axis=-1).reshape(-1, 3)
    return Mesh(points, _grid_faces(rows + 1, columns), points.copy(), _grid_uv(theta[:, 0] / math.pi, columns))


def _around(columns: int) -> Float:
    """(columns + 1,) angles once round; the last one is the first, for a seam in the texture without one in space."""
    return np.append(np.linspace(0, 2 * math.pi, columns, endpoint=False), 0.0)


def _grid_uv(v: Float, columns: int) -> Float:
    """Texture coordinates of a grid of rows at these v, u running from 0 to 1."""
    u = np.linspace(0, 1, columns + 1)
    return np.stack(np.broadcast_arrays(u, v[:, None]), axis=-1).reshape(-1, 2)


def cylinder(columns: int = 128) -> Mesh:
    """Open tube of radius 1 from z = 0 to z = 1, normals away from the axis."""
    phi = _around(columns)
    normal = np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], axis=1)
    points = np.concatenate([normal + [0, 0, 1], normal])
    faces = _grid_faces(2, columns)
    return Mesh(points, faces, np.concatenate([normal, normal]), _grid_uv(np.array([1.0, 0.0]), columns))


def disk(columns: int = 128) -> Mesh:
    """Unit disk in z = 0, facing +z."""
    phi = _around(columns)
    rim = np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], axis=1)
    j = np.arange(columns)
    # The centre once for every triangle: azimuths don't meet there.
    points = np.concatenate([np.zeros((columns, 3)), rim])
    middle = np.stack([np.zeros(columns), (j + 0.5) / columns], axis=1)
    edge = np.stack([np.ones(columns + 1), np.arange(columns + 1) / columns], axis=1)
    faces = np.stack([j, columns + j, columns + j + 1], axis=1).astype(np.int32)
    return Mesh(points, faces, uv=np.concatenate([middle, edge]))


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
    return replace(mesh, vertices=vertices, faces=np.ascontiguousarray(faces), normals=normals)


def unit(vectors: Float) -> Float:
    """Rows scaled to length one; zero rows stay zero."""
    # Scaling by the largest component first keeps tiny and huge vectors from under- and overflowing.
    with np.errstate(invalid="ignore", over="ignore"):
        largest = np.abs(vectors).max(axis=1, keepdims=True)
        scaled = vectors / np.where(largest > 0, largest, 1)
        length = np.linalg.norm(scaled, axis=1, keepdims=True)
        return scaled / np.where(length > 0, length, 1)


def wound_by_normals(mesh: Mesh) -> Mesh:
    """The mesh with its faces turned to the side that their vertex normals point to."""
    assert mesh.normals is not None
    corners = mesh.vertices[mesh.faces]
    with np.errstate(invalid="ignore", over="ignore"):
        face = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        behind = (face * mesh.normals[mesh.faces].sum(axis=1)).sum(axis=1) < 0
    faces = np.where(behind[:, None], mesh.faces[:, ::-1], mesh.faces)
    return replace(mesh, faces=np.ascontiguousarray(faces))


def with_smooth_normals(mesh: Mesh, seams: bool = False) -> Mesh:
    """The mesh with vertex normals averaged over the faces at each position, weighted by their angle there
    (Thürmer and Wüthrich 1998). With `seams` vertices stay apart that the mesh has several times at one position."""
    position = np.arange(len(mesh.vertices))
    if not seams:
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
    return replace(mesh, normals=unit(total)[position])
