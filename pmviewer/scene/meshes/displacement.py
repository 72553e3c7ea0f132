"""Displaced meshes: a surface cut finely and moved along its normals by a height that is a formula.

Heights depend on the place alone: on (u, v, 0) of a rectangle, on the place in the bounding cube, from 0 to 1, of any
other shape. Vertices at one place move along one normal, the mean of theirs, so displacement opens no cracks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.textures.noise import add_noise
from pmviewer.scene.arrays.primitives import sphere, transformed, unit, with_smooth_normals
from pmviewer.scene.description import Geometry, Mesh, Parallelogram, Sphere

Float = NDArray[np.float64]
Height = Callable[[Float], Float]
"""Heights (n,) over places (n, 3)."""

MOST_TRIANGLES = 2_000_000


@dataclass(frozen=True)
class Fractal:
    """Fractional Brownian motion: `octaves` of gradient noise, each of twice the frequency and `roughness` times the
    amplitude of the one before, between about −1 and 1.

    The first octave has `frequency` cells along the unit cube, beyond which the noise repeats, so tiles join.
    """

    octaves: int = 6
    roughness: float = 0.5
    frequency: int = 4
    seed: int = 0

    def __call__(self, places: Float) -> Float:
        total = np.zeros(len(places))
        for octave in range(self.octaves):
            add_noise(places, self.frequency << octave, self.seed * 64 + octave, self.roughness**octave, total)
        return total


@dataclass(frozen=True)
class Waves:
    """The heights of a water surface between about −1 and 1: `count` sine waves that repeat on the unit square,
    `frequency` of them along it on average, of random headings within `spread` degrees of u and amplitudes that fall
    with the frequency as on a wind-blown sea (Phillips 1958: the steepness is the same at all lengths)."""

    count: int = 24
    frequency: float = 4.0
    spread: float = 60.0
    seed: int = 0

    def __call__(self, places: Float) -> Float:
        generator = np.random.default_rng(self.seed)
        total = np.zeros(len(places))
        squares = 0.0
        for k in range(self.count):
            length = self.frequency * 4.0 ** ((k + 0.5) / self.count - 0.5)
            heading = math.radians(generator.uniform(-self.spread, self.spread))
            # Whole numbers of waves on the square: the surface repeats without a seam.
            i, j = round(length * math.cos(heading)), round(length * math.sin(heading))
            if i == j == 0:
                i = 1
            amplitude = 1.0 / math.hypot(i, j)
            squares += amplitude**2
            total += amplitude * np.sin(2 * np.pi * (i * places[:, 0] + j * places[:, 1] + generator.uniform()))
        return total / math.sqrt(2.0 * squares)


def n_displaced(geometry: Geometry, cuts: int) -> int:
    """Triangles that `displaced` would make."""
    faces_now = len(geometry.faces) if isinstance(geometry, Mesh) else 64 if isinstance(geometry, Sphere) else 2
    return faces_now * cuts * cuts


def displaced(geometry: Geometry, height: Height, scale: float, offset: float, cuts: int) -> Mesh:
    """The surface moved by `scale` · (height + offset) along its normals, with smooth normals.

    Parameters
    ----------
    geometry: a parallelogram, a sphere or a mesh.
    cuts: each edge becomes that many, a triangle cuts²; a sphere gets 4 · cuts rows.

    Raises ValueError for other geometry and when the result would have more than MOST_TRIANGLES triangles.
    """
    count = n_displaced(geometry, cuts)
    if count > MOST_TRIANGLES:
        raise ValueError(
            f"subdivision {cuts} would make {count:,} triangles of it, at most {MOST_TRIANGLES:,} are made"
        )
    colours: Float | None = None
    if isinstance(geometry, Parallelogram):
        vertices, places, faces = _grid(geometry, cuts)
        directions = np.broadcast_to(unit(np.cross(geometry.edge_u, geometry.edge_v)[None]), vertices.shape)
    elif isinstance(geometry, Mesh | Sphere):
        mesh = geometry if isinstance(geometry, Mesh) else _ball(geometry, cuts)
        vertices, directions, colours, faces = _cut(mesh, cuts if isinstance(geometry, Mesh) else 1)
        low, size = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
        grain = max(1e-9 * size, 1e-300)  # points nearer than this are one place
        _, place = np.unique(np.round((vertices - low) / grain), axis=0, return_inverse=True)
        place = place.reshape(-1)
        normal = unit(np.stack([np.bincount(place, directions[:, k]) for k in range(3)], axis=1))
        first = np.zeros(len(normal), np.int64)
        first[place] = np.arange(len(place))
        colours = None if colours is None else colours[first]
        vertices, directions, faces = vertices[first], normal, place[faces].astype(np.int32)
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        places = (vertices - low) / max(size, 1e-300)
    else:
        raise ValueError("only rectangles, cubes, spheres and meshes can be displaced")
    moved = vertices + scale * (height(places) + offset)[:, None] * directions
    return with_smooth_normals(Mesh(moved, faces, colours=colours))


def _ball(g: Sphere, cuts: int) -> Mesh:
    m = np.eye(4)
    m[:3, :3] *= g.radius
    m[:3, 3] = g.center
    return transformed(sphere(4 * cuts, 8 * cuts), m, g.flip_normals)


def _grid(g: Parallelogram, cuts: int) -> tuple[Float, Float, NDArray[np.int32]]:
    """Vertices, places (u, v, 0) and triangles of a parallelogram of cuts × cuts cells."""
    x = np.linspace(0.0, 1.0, cuts + 1)
    u, v = (a.ravel() for a in np.meshgrid(x, x, indexing="ij"))
    vertices = np.array(g.corner) + u[:, None] * np.array(g.edge_u) + v[:, None] * np.array(g.edge_v)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(cuts), np.arange(cuts), indexing="ij"))
    a = i * (cuts + 1) + j
    b, c, d = a + cuts + 1, a + cuts + 2, a + 1
    # Diagonals alternate, so that they don't show as a grain in one direction.
    even = ((i + j) % 2 == 0)[:, None]
    first = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    second = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    return vertices, np.stack([u, v, 0 * u], 1), np.concatenate([first, second]).astype(np.int32)


def _cut(mesh: Mesh, cuts: int) -> tuple[Float, Float, Float | None, NDArray[np.int32]]:
    """Every triangle cut into cuts²: vertices, unit normals, colours, faces; the parts share no vertex."""
    normals = mesh.normals if mesh.normals is not None else with_smooth_normals(mesh).normals
    assert normals is not None
    steps = [(i, j) for i in range(cuts + 1) for j in range(cuts + 1 - i)]
    index = {step: k for k, step in enumerate(steps)}
    weights = np.array([(cuts - i - j, i, j) for i, j in steps]) / cuts
    up = [(index[i, j], index[i + 1, j], index[i, j + 1]) for i in range(cuts) for j in range(cuts - i)]
    down = [
        (index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]) for i in range(cuts - 1) for j in range(cuts - 1 - i)
    ]
    pattern = np.array(up + down)
    # Sorting the corners first makes both sides of an edge compute the very same points on it.
    order = np.argsort(mesh.faces, axis=1)
    swapped = np.linalg.det(np.eye(3)[order]) < 0
    faces = np.take_along_axis(mesh.faces, order, axis=1)
    given = [mesh.vertices, normals] if mesh.colours is None else [mesh.vertices, normals, mesh.colours]
    parts = [(weights @ values[faces]).reshape(-1, 3) for values in given]
    own = (
        np.where(swapped[:, None, None], pattern[:, ::-1], pattern)
        + (np.arange(len(faces)) * len(steps))[:, None, None]
    )
    return parts[0], unit(parts[1]), parts[2] if len(parts) > 2 else None, own.reshape(-1, 3).astype(np.int32)
