"""Lights that lie in the place of another surface: rays can't tell which of the two they meet.

Light samples count the light as visible, rays that look for it meet it or the other surface by chance, so that the
picture is too dark or too bright by as much. The answer is a sentence, not a guess.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels import scene as K
from pmviewer.kernels.accel.raycast import cast_closest
from pmviewer.kernels.surface import OFFSET
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.scene.description import Cylinder, Disk, Geometry, Mesh, Parallelogram, Scene, Sphere

Float = NDArray[np.float64]
PLACES = 8
"""Of a light that are looked at."""
MOST_LIGHTS = 1000
AWAY = 1e-3
"""Where the looking rays start, in radii of the scene off the light."""


def hidden_lights(scene: Scene, flat: FlatScene) -> tuple[str, ...]:
    """A sentence for each of the first area lights that most rays from just before it miss for a surface in the same
    place."""
    lit = [s for s in scene.shapes if s.radiance is not None and any(c > 0 for c in s.radiance)]
    sentences = []
    for number, shape in enumerate(lit[:MOST_LIGHTS]):
        points, normals = _places(shape.geometry)
        away = AWAY * flat.radius
        origins = np.ascontiguousarray(points + away * normals, np.float32)
        n = len(points)
        t, prim, uv = np.empty(n, np.float32), np.empty(n, np.int32), np.empty((n, 2), np.float32)
        ends = np.zeros(n, np.float32), np.full(n, 2 * away, np.float32)
        cast_closest(flat.record[0], origins, np.ascontiguousarray(-normals, np.float32), *ends, t, prim, uv)
        # The light itself is `away` from where a ray starts, give or take the rounding of coordinates.
        rounding = 4 * float(OFFSET) * (float(np.abs(points).max()) + away)
        own = np.array([0 <= p < len(flat.prim_light) and flat.prim_light[p] == number for p in prim])
        other = (prim >= 0) & ~own & (np.abs(t - away) <= rounding)
        if other.sum() * 2 >= n or _twice(flat, number):
            sentences.append(
                f"The light '{shape.name}' lies in the place of another surface: rays can't tell which of them they "
                "meet, and its light may count too little or twice. Move it off by a thousandth of the scene."
            )
    return tuple(sentences)


def _twice(flat: FlatScene, number: int) -> bool:
    """Has another area light the same place, form and size? A ray meets one of them alone."""
    rows = flat.lights
    geometry = np.r_[K.L_KIND, K.L_A : K.LIGHT_COLUMNS]
    same = np.all(rows[:, geometry] == rows[number, geometry], axis=1)
    return int(rows[number, K.L_KIND]) != K.MESH and bool(same.sum() > 1)


def _places(g: Geometry) -> tuple[Float, Float]:
    """Points (n, 3) on the geometry and the unit normals of the side that emits."""
    u = (np.arange(PLACES) + 0.5) / PLACES
    v = (np.arange(PLACES) * 0.6180339887 + 0.31) % 1
    if isinstance(g, Parallelogram):
        a, b = np.array(g.edge_u), np.array(g.edge_v)
        n = np.cross(a, b)
        return np.array(g.corner) + u[:, None] * a + v[:, None] * b, np.tile(n / np.linalg.norm(n), (PLACES, 1))
    if isinstance(g, Mesh):
        corners = g.vertices[g.faces[np.linspace(0, len(g.faces) - 1, PLACES).astype(int)]]
        n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
        return corners.mean(axis=1), n / lengths
    phi = 2 * math.pi * v
    if isinstance(g, Disk):
        s, t = _across(np.array(g.normal))
        r = g.radius * np.sqrt(u)
        points = np.array(g.center) + (r * np.cos(phi))[:, None] * s + (r * np.sin(phi))[:, None] * t
        return points, np.tile(np.array(g.normal), (PLACES, 1))
    side = -1.0 if g.flip_normals else 1.0
    if isinstance(g, Sphere):
        z = 1 - 2 * u
        r = np.sqrt(1 - z * z)
        n = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1)
        return np.array(g.center) + g.radius * n, side * n
    assert isinstance(g, Cylinder)
    axis = np.subtract(g.p1, g.p0)
    s, t = _across(axis / np.linalg.norm(axis))
    n = np.cos(phi)[:, None] * s + np.sin(phi)[:, None] * t
    return np.array(g.p0) + u[:, None] * axis + g.radius * n, side * n


def _across(n: Float) -> tuple[Float, Float]:
    """Two unit vectors at right angles to n and each other."""
    s = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    s /= np.linalg.norm(s)
    return s, np.cross(n, s)
