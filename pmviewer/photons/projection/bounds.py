"""Spheres around the surfaces that photons are to meet: what projection maps are made from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.instances import instance_bounds
from pmviewer.scene.defaults.framing import bounds
from pmviewer.scene.description import Mesh, Scene, Shape

Float = NDArray[np.float64]
MOST_SPHERES = 256
"""A mesh of more triangles is cut into so many clusters."""


def spheres_of(scene: Scene, caustic: bool = False) -> Float:
    """(n, 4) centres and radii of spheres that cover the scene's surfaces, meshes by clusters of triangles.

    With `caustic` those that may make caustics: all that are not purely diffuse.
    """

    def counts(shape: Shape) -> bool:
        return not caustic or scene.materials[shape.material].kind != "diffuse"

    every = [_shape(s) for s in scene.shapes if counts(s)]
    shown = [i for i in scene.instances if any(counts(s) for s in i.group.shapes)]
    if len(shown) > MOST_SPHERES:
        every.append(_box(*instance_bounds(tuple(shown))))
    else:
        every += [_box(*instance_bounds((i,))) for i in shown]
    return np.concatenate(every) if every else np.zeros((0, 4))


def _shape(shape: Shape) -> Float:
    return _mesh(shape.geometry) if isinstance(shape.geometry, Mesh) else _box(*bounds([shape]))


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
