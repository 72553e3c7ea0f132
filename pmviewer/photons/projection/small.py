"""What is small on a wide floor: a house in a landscape, a ball on a plane (T7).

Light from outside arrives over a disc as wide as the whole scene. Where a floor reaches far beyond everything that
stands on it, hardly a photon meets anything else. Such a floor is what is left out here: surfaces that are wider than
WIDE of the scene, all of them level with one another. Walls of a room are not, and a landscape of many small triangles
is not told from what stands in it: then there is nothing to be told apart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.instances import instance_bounds
from pmviewer.scene.arrays.shape_bounds import shape_bounds
from pmviewer.scene.description import Disk, Geometry, Mesh, Parallelogram, Scene, Sphere

Float = NDArray[np.float64]

WIDE = 0.25
"""Of the scene's box, corner to corner: a surface of that width is a floor."""
LEVEL = 0.99
"""Least cosine between the normals of floors."""
SMALL = 0.5
"""Most radius of what stands there, relative to the scene's."""


class Small(NamedTuple):
    """A sphere around all but the floor."""

    center: Float
    radius: float


def small_of(scene: Scene, radius: float) -> Small | None:
    """What stands on a scene's floor, the scene having that bounding sphere; None where it has no floor, or that
    reaches little farther."""
    wide = 2 * WIDE * radius
    lows, highs, normals, grounds = [], [], [], []
    for shape in scene.shapes:
        low, high = (np.array(corner, float)[None] for corner in shape_bounds(shape))
        if np.linalg.norm(high - low) > wide:
            low = high = np.zeros((0, 3))
            if isinstance(shape.geometry, Mesh):
                corners = shape.geometry.vertices[shape.geometry.faces].astype(float)
                low, high = corners.min(axis=1), corners.max(axis=1)
                large = np.linalg.norm(high - low, axis=1) > wide
                normals.append(_normals_of(corners[large]))
                low, high = low[~large], high[~large]
            elif isinstance(shape.geometry, Sphere):
                grounds.append(np.array(shape.geometry.center, float))
            elif (normal := _normal_of(shape.geometry)) is not None:
                normals.append(normal)
            else:
                return None
        lows.append(low)
        highs.append(high)
    if scene.instances:
        low, high = (np.array(corner, float)[None] for corner in instance_bounds(scene.instances))
        lows.append(low)
        highs.append(high)
    low, high, every = np.concatenate(lows), np.concatenate(highs), np.concatenate([*normals, np.zeros((0, 3))])
    if not len(low) or not (len(every) or grounds):
        return None
    low, high = low.min(axis=0), high.max(axis=0)
    center, around = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    every = np.concatenate([every, *((center - ground)[None] for ground in grounds)])
    every = every / np.maximum(np.linalg.norm(every, axis=1, keepdims=True), 1e-300)
    if not 0 < around <= SMALL * radius or not np.all(np.abs(every @ every[0]) >= LEVEL):
        return None
    return Small(center, around)


def _normals_of(corners: Float) -> Float:
    """Of triangles (n, 3, 3), of any length; those without area have none."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals[np.linalg.norm(normals, axis=1) > 0]


def _normal_of(geometry: Geometry) -> Float | None:
    """(1, 3) of a flat surface, of any length."""
    if isinstance(geometry, Parallelogram):
        return np.cross(geometry.edge_u, geometry.edge_v)[None]
    return np.array(geometry.normal, float)[None] if isinstance(geometry, Disk) else None
