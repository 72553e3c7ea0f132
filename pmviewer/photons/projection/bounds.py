"""Spheres around the surfaces that photons are to meet: what projection maps are made from."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.instances import instance_bounds
from pmviewer.scene.arrays.texture_coordinates import orthonormal
from pmviewer.scene.description import Cylinder, Disk, Geometry, Mesh, Parallelogram, Scene, Shape

Float = NDArray[np.float64]
MOST_SPHERES = 256
"""A mesh of more triangles is cut into so many clusters."""
MOST_OF_MESHES = 8192
"""Where there are many meshes, they share so many: in a room of 900 of them, all cut into 256 take 3.4 s."""
PATCHES = 64
"""Of other surfaces than meshes and spheres."""


class Spheres(NamedTuple):
    """`around` (n, 4): centres and radii; `caustic` (n,) bool: what is in there may make caustics."""

    around: Float
    caustic: NDArray[np.bool_]


def spheres_of(scene: Scene) -> Spheres:
    """Spheres that cover the scene's surfaces, meshes by clusters of triangles. All that are not purely diffuse may
    make caustics."""

    def caustic(shape: Shape) -> bool:
        return scene.materials[shape.material].kind != "diffuse"

    meshes = sum(isinstance(shape.geometry, Mesh) for shape in scene.shapes)
    most = min(MOST_SPHERES, max(MOST_OF_MESHES // max(meshes, 1), 1))
    every = [(_around(shape.geometry, most), caustic(shape)) for shape in scene.shapes]
    for may in (False, True):
        shown = [i for i in scene.instances if any(map(caustic, i.group.shapes)) == may]
        boxes = [(i,) for i in shown] if len(shown) <= MOST_SPHERES else [tuple(shown)]
        every += [(_box(*instance_bounds(box)), may) for box in boxes]
    around = np.concatenate([np.zeros((0, 4)), *(spheres for spheres, _ in every)])
    return Spheres(around, np.repeat([may for _, may in every], [len(spheres) for spheres, _ in every]).astype(bool))


def _around(geometry: Geometry, most: int) -> Float:
    """Spheres around one shape's surface, not around what it encloses: photons may start in there. About `most` of a
    mesh."""
    if isinstance(geometry, Mesh):
        return _mesh(geometry, most)
    if isinstance(geometry, Parallelogram):
        return _plane(geometry)
    if isinstance(geometry, Cylinder):
        return _cylinder(geometry)
    if isinstance(geometry, Disk):
        return _disk(geometry)
    return np.array([[*geometry.center, geometry.radius]])


def _cells(across: float, along: float) -> tuple[int, int]:
    """How many cells a sheet of that size has either way, about as long as wide."""
    n = min(max(round(math.sqrt(PATCHES * across / max(along, 1e-300))), 1), PATCHES)
    return n, max(PATCHES // n, 1)


def _plane(g: Parallelogram) -> Float:
    u, v = np.array(g.edge_u), np.array(g.edge_v)
    across, along = _cells(float(np.linalg.norm(u)), float(np.linalg.norm(v)))
    i, j = np.meshgrid((np.arange(across) + 0.5) / across, (np.arange(along) + 0.5) / along, indexing="ij")
    centers = np.array(g.corner) + i.reshape(-1, 1) * u + j.reshape(-1, 1) * v
    halves = u / across / 2, v / along / 2
    reach = max(np.linalg.norm(halves[0] + halves[1]), np.linalg.norm(halves[0] - halves[1]))
    return np.column_stack([centers, np.full(len(centers), reach)])


def _cylinder(g: Cylinder) -> Float:
    """A patch's middle is off its corners by a chord of a quarter of its angle's double, and half of its height."""
    axis = np.subtract(g.p1, g.p0)
    height = float(np.linalg.norm(axis))
    around, along = _cells(2 * math.pi * g.radius, height)
    x, y, _ = orthonormal(axis / height)
    phi, z = np.meshgrid((np.arange(around) + 0.5) * 2 * math.pi / around, (np.arange(along) + 0.5) / along)
    phi, z = phi.reshape(-1, 1), z.reshape(-1, 1)
    centers = np.array(g.p0) + z * axis + g.radius * (np.cos(phi) * x + np.sin(phi) * y)
    reach = math.hypot(2 * g.radius * math.sin(math.pi / around / 2), height / along / 2)
    return np.column_stack([centers, np.full(len(centers), reach)])


def _disk(g: Disk) -> Float:
    """Those cells of the square around it that it reaches into."""
    x, y, _ = orthonormal(np.array(g.normal))
    corner = np.array(g.center) - g.radius * (x + y)
    cells = _plane(Parallelogram(tuple(corner), tuple(2 * g.radius * x), tuple(2 * g.radius * y)))
    near = np.linalg.norm(cells[:, :3] - np.array(g.center), axis=1) < g.radius + cells[:, 3]
    return cells[near]


def enclosing(spheres: Float) -> tuple[Float, float]:
    """Centre and radius of one sphere around all."""
    low, high = (spheres[:, :3] - spheres[:, 3:]).min(axis=0), (spheres[:, :3] + spheres[:, 3:]).max(axis=0)
    center = (low + high) / 2
    return center, float((np.linalg.norm(spheres[:, :3] - center, axis=1) + spheres[:, 3]).max())


def _box(low: Float, high: Float) -> Float:
    return np.array([[*(low + high) / 2, np.linalg.norm(high - low) / 2]])


def _mesh(mesh: Mesh, most: int) -> Float:
    vertices = np.ascontiguousarray(mesh.vertices.T, float)
    a, b, c = (np.take(vertices, mesh.faces[:, corner], axis=1) for corner in range(3))
    middles = (a + b + c) / 3
    parts = [np.arange(len(mesh.faces))]
    while len(parts) < most and max(map(len, parts)) > 1:
        parts = [half for part in parts for half in _halves(middles, part)]
    spheres = []
    for part in parts:
        points = np.take(vertices, mesh.faces[part].ravel(), axis=1)
        center = (points.min(axis=1) + points.max(axis=1)) / 2
        spheres.append([*center, math.sqrt(((points - center[:, None]) ** 2).sum(axis=0).max())])
    return np.array(spheres)


def _halves(middles: Float, part: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """A cluster cut at the median of its longest axis; `middles` (3, n)."""
    if len(part) < 2:
        return [part]
    points = np.take(middles, part, axis=1)
    axis = int(np.argmax(points.max(axis=1) - points.min(axis=1)))
    half = len(part) // 2
    order = part[np.argpartition(points[axis], half)]
    return [order[:half], order[half:]]
