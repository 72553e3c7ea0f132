"""What is small on a wide floor, or before a backdrop: a house in a landscape, a ship on a stage (T7).

Light from outside arrives over a disc as wide as the whole scene, that of a dome over all that is below it. Where a
floor reaches far beyond everything that stands on it, hardly a photon meets anything else. Such a floor is what is left
out here: surfaces wider than WIDE of what there is, none of which face each other. So do the walls of a room; and a
landscape of many small triangles is not told from what stands in it: then there is nothing to be told apart. What
stands there is looked at again in the same way. Lights are neither floors nor what is to be met: a dome holds what it
lights.
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
"""Of a box around all, corner to corner: a surface of that width is a floor."""
FACING = -0.2
"""Cosine between the directions to two floors below which they face each other."""
NARROW = 0.02
"""Height of a triangle over its longest edge, below which it is no floor."""
ROUND = 4.0
"""Least radius of a sphere that is a floor, relative to that of what stands there."""
SMALL = 0.5
"""Most radius of what stands there, relative to that of all."""


AT_ONCE = 1 << 16
"""Triangles that are looked at together."""


class Small(NamedTuple):
    """A sphere around all but the floor."""

    center: Float
    radius: float


class _Sheets(NamedTuple):
    """Wide surfaces that are flat: points (n, 3) of them and unit normals (n, 3)."""

    points: Float
    normals: Float


def small_of(scene: Scene, radius: float) -> Small | None:
    """What stands on a scene's floor or under a dome, the scene having that bounding sphere; None where neither reaches
    much farther."""
    found = None
    while (smaller := _without_floor(scene, radius)) is not None:
        found, radius = smaller, smaller.radius
    return found


def _without_floor(scene: Scene, radius: float) -> Small | None:
    """What is left without surfaces that are wide within that radius."""
    wide = 2 * WIDE * radius
    lows, highs, sheets, balls = [], [], [], []
    for shape in scene.shapes:
        if shape.shines:
            continue
        low, high = (np.array(corner, float)[None] for corner in shape_bounds(shape))
        if np.linalg.norm(high - low) > wide:
            low = high = np.zeros((0, 3))
            if isinstance(shape.geometry, Mesh):
                low, high, large = _narrow_part(shape.geometry, wide)
                sheets.append(_sheets_of(large))
            elif isinstance(shape.geometry, Sphere):
                balls.append(shape.geometry)
            elif (sheet := _sheet_of(shape.geometry)) is not None:
                sheets.append(sheet)
            else:
                return None
        lows.append(low)
        highs.append(high)
    if scene.instances:
        low, high = (np.array(corner, float)[None] for corner in instance_bounds(scene.instances))
        lows.append(low)
        highs.append(high)
    low, high = (np.concatenate([*corners, np.zeros((0, 3))]) for corners in (lows, highs))
    if not len(low):
        return None
    low, high = low.min(axis=0), high.max(axis=0)
    center, around = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    if not 0 < around <= SMALL * radius or any(ball.radius < ROUND * around for ball in balls):
        return None
    return None if _face_each_other(sheets, balls, center) else Small(center, around)


def _narrow_part(mesh: Mesh, wide: float) -> tuple[Float, Float, Float]:
    """The box, as (0 or 1, 3) corners, around a mesh's triangles of no more than that width, and corners (n, 3, 3) of
    the wider ones. A part at a time: all corners of a large mesh are larger than the mesh."""
    vertices = np.ascontiguousarray(mesh.vertices.T)
    lows, highs, large = [np.zeros((3, 0))], [np.zeros((3, 0))], [np.zeros((0, 3, 3))]
    for first in range(0, len(mesh.faces), AT_ONCE):
        corners = np.take(vertices, mesh.faces[first : first + AT_ONCE].T, axis=1)  # (axes, corners, triangles)
        low, high = corners.min(axis=1), corners.max(axis=1)
        wider = ((high - low) ** 2).sum(axis=0) > wide * wide
        if wider.any():
            large.append(corners[:, :, wider].transpose(2, 1, 0))
            low, high = low[:, ~wider], high[:, ~wider]
        if low.size:
            lows.append(low.min(axis=1, keepdims=True))
            highs.append(high.max(axis=1, keepdims=True))
    lowest, highest = np.concatenate(lows, axis=1), np.concatenate(highs, axis=1)
    if lowest.size:
        lowest, highest = lowest.min(axis=1, keepdims=True), highest.max(axis=1, keepdims=True)
    return lowest.T.astype(float), highest.T.astype(float), np.concatenate(large).astype(float)


def _face_each_other(sheets: list[_Sheets], balls: list[Sphere], center: Float) -> bool:
    """Do two of them lie on opposite sides of what stands there, or does one go around it?"""
    toward = []
    for points, normals in sheets:
        side = np.einsum("ij,ij->i", points - center, normals)
        toward.append(normals * np.where(side < 0, -1.0, 1.0)[:, None])
    for ball in balls:
        away = np.subtract(ball.center, center)
        distance = float(np.linalg.norm(away))
        if distance <= ball.radius:
            return True
        toward.append(away[None] / distance)
    out = np.unique(np.round(np.concatenate([*toward, np.zeros((0, 3))]), 2), axis=0)
    return bool((out @ out.T).min(initial=1.0) < FACING)


def _sheets_of(corners: Float) -> _Sheets:
    """Of triangles (n, 3, 3); narrow ones, such as the sides of a slab, are none."""
    edges = corners - np.roll(corners, 1, axis=1)
    normals = np.cross(edges[:, 1], edges[:, 2])
    areas = np.linalg.norm(normals, axis=1)
    sheet = areas > NARROW * (edges**2).sum(axis=2).max(axis=1)
    return _Sheets(corners[sheet, 0], normals[sheet] / areas[sheet, None])


def _sheet_of(geometry: Geometry) -> _Sheets | None:
    """Of another surface that may be a floor, which is a flat one."""
    if isinstance(geometry, Parallelogram):
        corner = np.array(geometry.corner, float)
        return _sheets_of(np.stack([corner, corner + geometry.edge_u, corner + geometry.edge_v])[None])
    if isinstance(geometry, Disk):
        return _Sheets(np.array(geometry.center, float)[None], np.array(geometry.normal, float)[None])
    return None
