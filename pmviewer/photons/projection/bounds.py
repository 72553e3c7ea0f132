"""Spheres around the surfaces that photons are to meet: what projection maps are made from."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.instances import instance_bounds
from pmviewer.scene.arrays.texture_coordinates import orthonormal
from pmviewer.scene.description import Cylinder, Disk, Geometry, Mesh, Parallelogram, Scene, Shape

Float = NDArray[np.float64]
MOST_SPHERES = 256
"""A mesh of more triangles is cut into so many clusters."""
PATCHES = 64
"""Of other surfaces than meshes and spheres."""


def spheres_of(scene: Scene, caustic: bool = False) -> Float:
    """(n, 4) centres and radii of spheres that cover the scene's surfaces, meshes by clusters of triangles.

    With `caustic` those that may make caustics: all that are not purely diffuse.
    """

    def counts(shape: Shape) -> bool:
        return not caustic or scene.materials[shape.material].kind != "diffuse"

    every = [_around(s.geometry) for s in scene.shapes if counts(s)]
    shown = [i for i in scene.instances if any(counts(s) for s in i.group.shapes)]
    if len(shown) > MOST_SPHERES:
        every.append(_box(*instance_bounds(tuple(shown))))
    else:
        every += [_box(*instance_bounds((i,))) for i in shown]
    return np.concatenate(every) if every else np.zeros((0, 4))


def _around(geometry: Geometry) -> Float:
    """Spheres around one shape's surface, not around what it encloses: photons may start in there."""
    if isinstance(geometry, Mesh):
        return _mesh(geometry)
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


def _mesh(mesh: Mesh) -> Float:
    corners = mesh.vertices[mesh.faces]
    parts = [np.arange(len(corners))]
    middles = corners.mean(axis=1)
    while len(parts) < MOST_SPHERES and max(map(len, parts)) > 1:
        parts = [half for part in parts for half in _halves(middles, part)]
    spheres = []
    for part in parts:
        points = corners[part].reshape(-1, 3)
        center = (points.min(axis=0) + points.max(axis=0)) / 2
        spheres.append([*center, np.linalg.norm(points - center, axis=1).max()])
    return np.array(spheres)


def _halves(middles: Float, part: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """A cluster cut at the median of its longest axis."""
    if len(part) < 2:
        return [part]
    points = middles[part]
    axis = int(np.argmax(points.max(axis=0) - points.min(axis=0)))
    order = part[np.argsort(points[:, axis], kind="stable")]
    return [order[: len(order) // 2], order[len(order) // 2 :]]
