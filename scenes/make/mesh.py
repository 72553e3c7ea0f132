"""Geometry from formulas: quads, boxes, height fields, objects of revolution, and their PLY files.

All arithmetic is float64 and rounded once, to float32 in the file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

F8 = NDArray[np.float64]


@dataclass
class Mesh:
    """`vertices` (n, 3) in metres, `faces` (m, 3); `normals` (n, 3) and `uv` (n, 2) when the mesh is smooth."""

    vertices: F8
    faces: NDArray[np.int32]
    normals: F8 | None = None
    uv: F8 | None = None


def joined(*meshes: Mesh) -> Mesh:
    """One flat mesh of several."""
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + np.int32(offset) for m, offset in zip(meshes, offsets, strict=False)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces).astype(np.int32))


def quad(a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> Mesh:
    """Corners in counter-clockwise order seen from the side that its normal points to."""
    return Mesh(np.array([a, b, c, d], np.float64), np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def prism(bottom: Sequence[tuple[float, float]], low: float, high: float) -> Mesh:
    """Upright prism over a convex outline (x, z), sides and top, no bottom, normals outwards.

    The outline runs so that its sides face outwards when seen from above in the order x → z.
    """
    n = len(bottom)
    ring = np.array(bottom, np.float64)
    vertices = np.concatenate([np.insert(ring, 1, y, axis=1) for y in (low, high)])
    sides = [f for i in range(n) for j in [(i + 1) % n] for f in ((i, n + i, n + j), (i, n + j, j))]
    top = [(n, n + i + 1, n + i) for i in range(1, n - 1)]
    area = sum(ring[i, 0] * ring[(i + 1) % n, 1] - ring[(i + 1) % n, 0] * ring[i, 1] for i in range(n))
    faces = np.array(sides + top, np.int32)
    return Mesh(vertices, faces if area > 0 else faces[:, ::-1].copy())


def block(low: Sequence[float], high: Sequence[float]) -> Mesh:
    """Closed box between two corners (x, y, z), normals outwards."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    bottom = quad((x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1))
    return joined(prism([(x0, z0), (x1, z0), (x1, z1), (x0, z1)], y0, y1), bottom)


def room(low: Sequence[float], high: Sequence[float]) -> dict[str, Mesh]:
    """The six inner faces of a box: "floor", "ceiling", "left" (low x), "right", "back" (low z) and "front"."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return {
        "floor": quad((x0, y0, z0), (x0, y0, z1), (x1, y0, z1), (x1, y0, z0)),
        "ceiling": quad((x0, y1, z0), (x1, y1, z0), (x1, y1, z1), (x0, y1, z1)),
        "left": quad((x0, y0, z0), (x0, y1, z0), (x0, y1, z1), (x0, y0, z1)),
        "right": quad((x1, y0, z1), (x1, y1, z1), (x1, y1, z0), (x1, y0, z0)),
        "back": quad((x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)),
        "front": quad((x0, y0, z1), (x0, y1, z1), (x1, y1, z1), (x1, y0, z1)),
    }


def height_field(x: F8, z: F8, height: Callable[[F8, F8], F8], smooth: bool = True) -> Mesh:
    """y = height(x, z) over the grid of the given coordinates, normals up.

    Smooth normals are central differences of `height` itself, so that they do not depend on the grid.
    """
    gx, gz = np.meshgrid(x, z, indexing="ij")
    vertices = np.stack([gx, height(gx, gz), gz], axis=-1).reshape(-1, 3)
    rows = len(z)
    i = (np.arange(len(x) - 1)[:, None] * rows + np.arange(rows - 1)).reshape(-1)
    faces = np.concatenate([np.stack([i, i + 1, i + rows], 1), np.stack([i + 1, i + rows + 1, i + rows], 1)])
    normals = None
    if smooth:
        step = 1e-5
        slope_x = (height(gx + step, gz) - height(gx - step, gz)) / (2 * step)
        slope_z = (height(gx, gz + step) - height(gx, gz - step)) / (2 * step)
        normals = np.stack([-slope_x, np.ones_like(slope_x), -slope_z], axis=-1).reshape(-1, 3)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(vertices, faces.astype(np.int32), normals)


def lathe(profiles: Sequence[ArrayLike], segments: int, with_uv: bool = False) -> Mesh:
    """Revolve profiles of points (radius, y) about the y axis.

    A profile walks with the outside to its right: from the bottom up an outer surface has its normals away from the
    axis. Within a profile normals are smooth; between profiles there is an edge.
    """
    angle = 2 * np.pi * np.arange(segments + 1) / segments
    cos, sin = np.cos(angle), np.sin(angle)
    cos[-1], sin[-1] = 1.0, 0.0
    vertices, normals, uv, faces = [], [], [], []
    offset = 0
    for points in (np.asarray(p, np.float64) for p in profiles):
        tangent = np.gradient(points, axis=0)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        n, m = len(points), segments + 1
        r, y = points[:, :1], points[:, 1:]
        vertices.append(np.stack([r * cos, np.broadcast_to(y, (n, m)), r * sin], -1).reshape(-1, 3))
        out, up = tangent[:, 1:], -tangent[:, :1]
        normals.append(np.stack([out * cos, np.broadcast_to(up, (n, m)), out * sin], -1).reshape(-1, 3))
        u, v = np.meshgrid(along / along[-1], np.arange(m) / segments, indexing="ij")
        uv.append(np.stack([v, u], -1).reshape(-1, 2))
        i = offset + (np.arange(n - 1)[:, None] * m + np.arange(segments))
        on_axis = np.broadcast_to(points[:, 0] < 1e-12, (segments, n)).T
        lower = np.stack([i, i + m, i + 1], -1)[~on_axis[:-1]]
        upper = np.stack([i + 1, i + m, i + m + 1], -1)[~on_axis[1:]]
        faces += [lower, upper]
        offset += n * m
    return Mesh(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        np.concatenate(normals),
        np.concatenate(uv) if with_uv else None,
    )


def write_ply(path: Path, mesh: Mesh) -> None:
    """Binary little-endian PLY: positions, normals and texture coordinates if there are any, triangles."""
    columns, names = [mesh.vertices], ["x", "y", "z"]
    if mesh.normals is not None:
        columns.append(mesh.normals)
        names += ["nx", "ny", "nz"]
    if mesh.uv is not None:
        columns.append(mesh.uv)
        names += ["u", "v"]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header", ""]
    faces = np.empty(len(mesh.faces), np.dtype([("n", "u1"), ("i", "<i4", 3)]))
    faces["n"], faces["i"] = 3, mesh.faces
    body = (np.concatenate(columns, axis=1) + 0.0).astype("<f4").tobytes() + faces.tobytes()
    path.write_bytes("\n".join(header).encode("ascii") + body)
