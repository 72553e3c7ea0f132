"""A scene in few triangles, for questions about what is visible that must be answered in no time.

Exact triangles up to `MOST_EXACT`; beyond, vertices are merged in the cells of a grid (Rossignac and Borrel,
"Multi-resolution 3D approximations for rendering complex scenes", 1993), so that rays see walls and furniture but no
detail. Building the scene's own hierarchy would cost seconds for millions of triangles, and the answers decide what is
added to the scene, after which it would have to be built again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels import scene as K
from pmviewer.kernels.accel.bvh import Bvh, build
from pmviewer.kernels.accel.occlusion import cast_occluded
from pmviewer.kernels.accel.raycast import cast_closest
from pmviewer.kernels.meshes.cells import cell_means, spanning
from pmviewer.kernels.meshes.mesh import across
from pmviewer.scene.arrays.tessellate import triangles_of
from pmviewer.scene.description import Group, Mesh, Scene, Shape

Float = NDArray[np.float64]
Bools = NDArray[np.bool_]
MOST_EXACT = 60_000
CELLS, MOST_CELLS = 72, 160
"""Along the longest side of the box that holds all but a hundredth of the vertices to either side: more where so few
leave little."""
SEGMENTS = 16
_MOST_COPIED = 400_000
"""Triangles of instances that are looked at; of more instances every so-manieth counts."""
_OFF = 1e-4
"""Rays start this far from where they begin, in radii of the scene."""


@dataclass(frozen=True)
class Hits:
    """Of n rays: distance (inf without a hit), triangle (−1 without), and whether its front was met."""

    distance: Float
    triangle: NDArray[np.int32]
    front: Bools

    @property
    def met(self) -> Bools:
        """(n,) True for rays that hit something."""
        return self.triangle >= 0


@dataclass(frozen=True)
class Proxy:
    """`corners` (n, 3, 3), unit `normals` (n, 3) towards the front, `areas` (n,), and for each triangle the number of
    its `shape` in `Scene.all_shapes`. `points` (m, 3) are the places of all corners, most of them once. `radius` is
    half the diagonal of everything."""

    corners: Float
    points: Float
    normals: Float
    areas: Float
    shape: NDArray[np.int32]
    radius: float
    _bvh: Bvh
    _record: NDArray[np.void]

    def closest(self, origins: Float, directions: Float) -> Hits:
        """The nearest hits of rays (n, 3) with unit directions."""
        o, d, near, far = self._rays(origins, directions, np.inf)
        t, prim, uv = np.empty(len(o), np.float32), np.empty(len(o), np.int32), np.empty((len(o), 2), np.float32)
        cast_closest(self._record[0], o, d, near, far, t, prim, uv)
        front = np.einsum("ij,ij->i", self.normals[prim], directions) < 0
        return Hits(np.where(prim >= 0, t, np.inf).astype(np.float64), prim, front & (prim >= 0))

    def occluded(self, origins: Float, directions: Float, distance: Float | float) -> Bools:
        """Is anything in the way of the rays up to (nearly) that distance?"""
        o, d, near, far = self._rays(origins, directions, distance)
        hit = np.empty(len(o), np.bool_)
        cast_occluded(self._record[0], o, d, near, far, hit)
        return hit

    def _rays(self, origins: Float, directions: Float, distance: Float | float) -> tuple[NDArray[np.float32], ...]:
        o = np.ascontiguousarray(np.broadcast_to(origins, directions.shape), np.float32)
        d = np.ascontiguousarray(directions, np.float32)
        off = _OFF * self.radius
        far = np.broadcast_to(np.asarray(distance, float) - off, len(d))
        return o, d, np.full(len(d), off, np.float32), np.ascontiguousarray(far, np.float32)

    def sampled(self, count: int, weights: Float | None = None) -> tuple[Float, NDArray[np.int64]]:
        """`count` points (count, 3) spread over the surfaces by area, or by those weights of the triangles, and their
        triangles; the same every time."""
        share = np.cumsum(self.areas if weights is None else weights)
        at = np.searchsorted(share, (np.arange(count) + 0.5) / count * share[-1])
        at = np.minimum(at, len(share) - 1)
        # Roberts' R2 sequence, "The unreasonable effectiveness of quasirandom sequences", 2018
        u, v = ((0.5 + np.arange(count) * step) % 1.0 for step in (0.7548776662466927, 0.5698402909980532))
        folded = u + v > 1
        u, v = np.where(folded, 1 - u, u), np.where(folded, 1 - v, v)
        a, b, c = (self.corners[at, k] for k in range(3))
        return a + u[:, None] * (b - a) + v[:, None] * (c - a), at


def proxy_of(scene: Scene, keep: Bools | None = None) -> Proxy | None:
    """The scene's shapes (`keep` says which of `Scene.all_shapes` count) and instances; None without a triangle."""
    parts = _parts(scene, np.ones(len(scene.all_shapes), bool) if keep is None else keep)
    if not parts:
        return None
    corners, normals, shape, points = (np.concatenate(column) for column in zip(*parts))
    low, high = points.min(axis=0), points.max(axis=0)
    radius = float(np.linalg.norm(high - low)) / 2
    if not 0 < radius < np.inf:
        return None
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.sqrt(np.einsum("ij,ij->i", cross, cross))
    used = length > 1e-12 * radius**2
    if not used.any():
        return None
    if not used.all():
        corners, cross, length, shape, normals = (x[used] for x in (corners, cross, length, shape, normals))
        points = corners.reshape(-1, 3)
    facing = np.where(np.einsum("ij,ij->i", cross, normals) < 0, -1.0, 1.0)
    bvh = build(np.ascontiguousarray(corners, np.float32), np.zeros((0, 12), np.float32))
    record = np.zeros(1, K.SCENE_DTYPE)
    bvh.store(record[0])
    unit = cross * (facing / length)[:, None]
    return Proxy(corners, points, unit, length / 2, shape.astype(np.int32), radius, bvh, record)


Part = tuple[Float, Float, NDArray[np.int64], Float]
"""Corners (n, 3, 3), a vector to the front of each (n, 3), shape (n,), and the places of the corners (m, 3)."""
About = Callable[[NDArray[np.int64]], tuple[Float, NDArray[np.int64]]]
"""Vectors to the front of faces, and the numbers of their shapes."""


def _parts(scene: Scene, keep: Bools) -> list[Part]:
    own = [(i, s) for i, s in enumerate(scene.shapes) if keep[i]]
    parts = _reduced(own)
    start = len(scene.shapes)
    budget = _MOST_COPIED
    places: dict[Group, list[Float]] = {}
    for instance in scene.instances:
        places.setdefault(instance.group, []).append(instance.to_world)
    for group in scene.groups:
        numbered = [(start + i, s) for i, s in enumerate(group.shapes) if keep[start + i]]
        start += len(group.shapes)
        inside = _reduced(numbered)
        shown = places[group]
        count = sum(len(part[0]) for part in inside) * len(shown)
        step = max(1, -(-count // max(budget, 1)))
        budget -= count // step
        if inside:
            parts += _copied(np.stack(shown[::step]), inside)
    if sum(len(part[0]) for part in parts) > 2 * MOST_EXACT and scene.instances:
        corners, normals, shape, _ = (np.concatenate(column) for column in zip(*parts))
        faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
        return [_merged(corners.reshape(-1, 3), faces, lambda kept: (normals[kept], shape[kept]))]
    return parts


def _copied(to_world: Float, inside: list[Part]) -> list[Part]:
    """The parts of a group under each of the matrices (k, 4, 4)."""
    linear, moved = to_world[:, :3, :3], to_world[:, None, None, :3, 3]
    sign = np.where(np.linalg.det(linear) < 0, -1.0, 1.0)[:, None, None]
    turned = np.linalg.inv(linear) * sign
    parts = []
    for corners, normals, shape, points in inside:
        placed = np.einsum("kij,ncj->knci", linear, corners) + moved
        facing = np.einsum("nj,kji->kni", normals, turned)
        places = np.einsum("kij,nj->kni", linear, points) + moved[:, 0]
        shapes = np.tile(shape, len(to_world))
        parts.append((placed.reshape(-1, 3, 3), facing.reshape(-1, 3), shapes, places.reshape(-1, 3)))
    return parts


def _reduced(shapes: list[tuple[int, Shape]]) -> list[Part]:
    meshes = [(i, s.geometry) for i, s in shapes if isinstance(s.geometry, Mesh)]
    parts: list[Part] = []
    for i, shape in shapes:
        if not isinstance(shape.geometry, Mesh):
            corners, normals = triangles_of(shape.geometry, SEGMENTS)
            parts.append((corners, normals.mean(axis=1), np.full(len(corners), i), corners.reshape(-1, 3)))
    if not meshes:
        return parts
    starts = np.cumsum([0, *(len(mesh.vertices) for _, mesh in meshes)])
    if len(meshes) == 1:
        vertices, faces = meshes[0][1].vertices, meshes[0][1].faces
    else:
        vertices = np.concatenate([mesh.vertices for _, mesh in meshes])
        faces = np.concatenate([mesh.faces + start for (_, mesh), start in zip(meshes, starts)])
    firsts = np.cumsum([0, *(len(mesh.faces) for _, mesh in meshes)])

    def about(kept: NDArray[np.int64]) -> tuple[Float, NDArray[np.int64]]:
        """Sums of the vertex normals of these faces, or, without, what the order of the corners says; and whose they
        are."""
        found = np.empty((len(kept), 3))
        owner = np.searchsorted(firsts, kept, side="right") - 1
        for k in np.flatnonzero(np.bincount(owner)):
            mesh, at = meshes[k][1], owner == k
            chosen = kept[at] - firsts[k]
            if mesh.normals is not None:
                found[at] = mesh.normals[mesh.faces[chosen]].sum(axis=1)
            else:
                own = np.empty((len(chosen), 3))
                across(np.ascontiguousarray(mesh.vertices, np.float64), np.ascontiguousarray(mesh.faces), chosen, own)
                found[at] = own
        return found, np.array([i for i, _ in meshes])[owner]

    if len(faces) <= MOST_EXACT:
        normals, numbers = about(np.arange(len(faces)))
        parts.append((vertices[faces], normals, numbers, vertices))
    else:
        parts.append(_merged(vertices, faces, about))
    return parts


def _merged(vertices: Float, faces: NDArray, about: About, cells: int = CELLS) -> Part:
    """The triangles between the means of the vertices in each cell. What lies far outside goes to the grid's rim, where
    few vertices share a cell, so that backdrops stay in their place."""
    some = vertices[:: max(1, len(vertices) // 100_000)]
    low, high = np.percentile(some, (1, 99), axis=0)
    size = float((high - low).max()) * 1.2 / cells
    if not size > 0:
        size = max(float(np.ptp(some, axis=0).max()) / cells, 1e-300)
    start = (low + high) / 2 - cells / 2 * size
    side = cells + 2
    key, mean = np.empty(len(vertices), np.int32), np.empty((side**3, 3))
    cell_means(np.ascontiguousarray(vertices, np.float64), start, size, cells, key, mean)
    faces = np.ascontiguousarray(faces)
    most = 2 * MOST_EXACT if cells > 8 else len(faces)
    kept = np.empty(min(most, len(faces)), np.int64)
    count = spanning(faces, key, np.empty(1 << (2 * len(kept)).bit_length(), np.int32), kept)
    if count > len(kept):
        return _merged(vertices, faces, about, cells // 2)
    kept = kept[:count].copy()
    k = key[faces[kept]]
    finer = min(MOST_CELLS, int(cells * math.sqrt(MOST_EXACT / 2 / max(len(k), 1))))
    if cells == CELLS and finer > 1.3 * CELLS:
        return _merged(vertices, faces, about, finer)
    met = np.zeros(len(mean), bool)
    met[k] = True
    normals, shape = about(kept)
    return mean[k], normals, shape, mean[met]
