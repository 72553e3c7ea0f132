"""Textured area lights: their mean radiance, and how brightness is distributed over them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.texture_coordinates import frame_of, rectangle_of, rectangle_uv, square_uv
from pmviewer.scene.description import Mesh, Parallelogram, Scene, Shape
from pmviewer.scene.texture import LUMINANCE, Bitmap, Texture, evaluate

_MOST_CELLS = 256
_CHECKER_CELLS = 64
_ROUND_CELLS = 128
"""At least, where the texture is bent."""
_SAMPLES = 4
"""Looked at in each cell, squared."""
_DARKEST = 0.01
"""Density of the darkest cells relative to a uniform one: what the samples of a cell missed is still found."""


@dataclass(frozen=True)
class Emission:
    """Of one textured light. `frame` (9,): what `light_frames` holds; `table`: cumulative numbers of the rows, then of
    each row's columns, empty for a light that is picked uniformly."""

    texture: Texture
    frame: NDArray[np.float64]
    rows: int
    columns: int
    table: NDArray[np.float32]


def textured_lights(scene: Scene) -> tuple[Scene, dict[int, Emission]]:
    """The scene as the light table shall see it, and the textured lights by shape.

    There, a textured light has its texture's mean over its surface as radiance, and meshes that are flat rectangles are
    rectangles.
    """
    found: dict[int, Emission] = {}
    shapes = list(scene.shapes)
    for i, shape in enumerate(scene.shapes):
        if shape.emission is not None and shape.radiance is not None:
            shapes[i], found[i] = _examined(shape, shape.emission)
    return (replace(scene, shapes=tuple(shapes)), found) if found else (scene, found)


def _examined(shape: Shape, texture: Texture) -> tuple[Shape, Emission]:
    geometry, affine = shape.geometry, None
    if isinstance(geometry, Mesh) and (rectangle := rectangle_of(geometry)) is not None:
        geometry, affine = rectangle
    frame = np.zeros(9)
    if isinstance(geometry, Parallelogram):
        affine = rectangle_uv(geometry) if affine is None else affine
        frame[:6] = affine.reshape(-1)
    elif not isinstance(geometry, Mesh):
        frame[:] = frame_of(geometry).reshape(-1)
    columns = rows = _CHECKER_CELLS
    if isinstance(texture, Bitmap):
        rows, columns = (max(8, min(_MOST_CELLS, n)) for n in texture.pixels.shape[:2])
        if affine is not None and abs(affine[0, 1]) + abs(affine[1, 2]) < abs(affine[0, 2]) + abs(affine[1, 1]):
            rows, columns = columns, rows  # the texture lies on its side
    if affine is None:
        rows, columns = max(rows, _ROUND_CELLS), max(columns, _ROUND_CELLS)
    v, u = np.meshgrid(*((np.arange(n * _SAMPLES) + 0.5) / (n * _SAMPLES) for n in (rows, columns)), indexing="ij")
    rgb = evaluate(texture, square_uv(geometry, affine, u.reshape(-1), v.reshape(-1)))
    r, g, b = (float(c) for c in rgb.mean(axis=0))
    lit = replace(shape, geometry=geometry, radiance=(r, g, b))
    if isinstance(geometry, Mesh):
        return lit, Emission(texture, frame, 0, 0, np.zeros(0, np.float32))
    cells = (rgb @ LUMINANCE).reshape(rows, _SAMPLES, columns, _SAMPLES).mean(axis=(1, 3))
    return lit, Emission(texture, frame, rows, columns, _cumulative(cells))


def _cumulative(cells: NDArray[np.float64]) -> NDArray[np.float32]:
    weights = cells + _DARKEST * cells.mean() + 1e-30
    by_row = np.cumsum(weights.sum(axis=1))
    within = np.cumsum(weights, axis=1)
    table = np.concatenate([by_row / by_row[-1], (within / within[:, -1:]).reshape(-1)]).astype(np.float32)
    return table
