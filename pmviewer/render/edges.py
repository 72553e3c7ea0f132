"""Which pixels edges cross: known from scene and camera before there is a sample.

Half of a pixel may show a bright box and half the dark wall behind it: one sample has all of either. Where all else is
smooth, these pixels hold most of the error of the first passes, and two samples, which complement one another, leave a
third of it.

Rays through a pixel's corners tell: it is crossed where two of them meet unlike things, another material, a surface
that faces elsewhere, or one behind the other. To find out costs less than a tenth of a pass: first come corners of
squares of pixels, then those of the pixels of squares that are crossed. What is thinner than a square may be missed,
what is seen in mirrors and drawn on surfaces is not looked for: wrong marks cost time or noise and nothing else.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import surface_at
from pmviewer.kernels.vector import dot
from pmviewer.render.camera import CameraPose
from pmviewer.render.closest_hits import closest_hits
from pmviewer.render.mirrored import block_of
from pmviewer.render.pixel_samples import EDGED
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.tasks import Runner, in_turn

ALIKE = np.float32(0.8)
"""Least cosine between the normals of what is one surface: facets of round things lie closer."""
BEHIND = np.float32(0.7)
"""Sine of the angle to a surface from which on something is not on it but behind."""
SHARP = 1.0
"""Most pixels of a circle of confusion in which an edge is still seen."""
MOST_EDGED = 0.1
"""Share of the pixels up to which edges get more samples by themselves. Error times seconds of two passes, over that
without: 0.73 to 0.96 where 4 or 5 % of the pixels have edges, 1.06 to 1.11 in three scenes with 13 to 18 %."""
PIECE = 32_768
"""Pixels a task, at least: some two milliseconds."""
NONE = np.int32(-1)
_i8 = np.int64


@device
def _unlike(surfaces, materials, i, j):
    """Whether there is an edge between two points."""
    if materials[i] != materials[j]:
        return True
    if materials[i] == NONE:
        return False
    a, b = (surfaces[i, 3], surfaces[i, 4], surfaces[i, 5]), (surfaces[j, 3], surfaces[j, 4], surfaces[j, 5])
    if abs(dot(a, b)) < ALIKE:
        return True
    way = (surfaces[j, 0] - surfaces[i, 0], surfaces[j, 1] - surfaces[i, 1], surfaces[j, 2] - surfaces[i, 2])
    off = max(abs(dot(a, way)), abs(dot(b, way)))
    return off * off > BEHIND * BEHIND * dot(way, way)


@kernel
def mark_crossed(scenes, hits, corners, crossed):
    """Set crossed, bool (m,), where two of four hits, one after the other, are unlike. scenes: SCENE_DTYPE (1,); hits:
    `Hits` of n rays; corners: int64 (m, 4), the numbers of the four around a square."""
    scene, n = scenes[0], len(hits.prims)
    surfaces, materials = np.empty((n, 6), np.float32), np.empty(n, np.int32)
    o, d, uv = hits.origins, hits.directions, hits.uv
    for i in range(n):
        prim = _i8(hits.prims[i])
        materials[i] = NONE
        if prim >= 0:
            materials[i] = np.int32(material_of(scene, prim))
            p, _, ns, _ = surface_at(
                scene, prim, uv[i, 0], uv[i, 1], o[i, 0], o[i, 1], o[i, 2], d[i, 0], d[i, 1], d[i, 2], hits.t[i]
            )
            surfaces[i, 0], surfaces[i, 1], surfaces[i, 2] = p
            surfaces[i, 3], surfaces[i, 4], surfaces[i, 5] = ns
    for k in range(len(corners)):
        crossed[k] = False
        for side in range(4):
            if _unlike(surfaces, materials, corners[k, side], corners[k, (side + 1) & 3]):
                crossed[k] = True


def edged_pixels(scene: FlatScene, camera: CameraPose, most: float = 1.0, run: Runner = in_turn) -> NDArray[np.uint8]:
    """(width · height,) uint8, EDGED where an edge crosses the pixel; (0,) where none does, or more than the share
    `most` of the picture that these pixels are from. Raises Cancelled as `run` does."""
    side = camera.pixel_side
    whole = replace(camera, pixel_side=1.0, width=round(camera.width / side), height=round(camera.height / side))
    block = block_of(whole)
    strip = block * -(-PIECE // (block * whole.width))
    ends = [(first, min(first + strip, whole.height)) for first in range(0, whole.height, strip)]
    found = np.concatenate(run([partial(_crossed_rows, scene, whole, rows, block) for rows in ends]))
    share = found.mean()
    if side < 1.0:
        (found,) = run([partial(_apart, scene, camera)])
    return EDGED * found.astype(np.uint8) if 0.0 < share <= most and found.any() else np.zeros(0, np.uint8)


def _crossed_rows(scene: FlatScene, camera: CameraPose, rows: tuple[int, int], block: int) -> NDArray[np.bool_]:
    """(width · rows,), of pixels of the rows from the first to before the last, which lie side by side."""
    first, last = rows
    squares = _crossed_squares(scene, camera, rows, block)
    if block == 1:
        return squares.ravel()
    found = np.zeros(camera.width * (last - first), bool)
    pixels = np.flatnonzero(squares)
    found[pixels] = _crossed_pixels(scene, camera, rows, pixels)
    return found


def _crossed_squares(scene: FlatScene, camera: CameraPose, rows: tuple[int, int], block: int) -> NDArray[np.bool_]:
    """(rows, width), whether an edge crosses the square of pixels in which one lies."""
    first, last = rows
    across, down = -(-camera.width // block), -(-(last - first) // block)
    x = np.minimum(block * np.arange(across + 1), camera.width)
    y = np.minimum(first + block * np.arange(down + 1), last)
    places = np.tile(x, down + 1), np.repeat(y, across + 1)
    corners = (np.arange(down)[:, None] * (across + 1) + np.arange(across)).ravel()
    crossed = _crossed(scene, camera, *places, _square(corners, across + 1)).reshape(down, across)
    return crossed.repeat(block, axis=0).repeat(block, axis=1)[: last - first, : camera.width]


def _crossed_pixels(
    scene: FlatScene, camera: CameraPose, rows: tuple[int, int], pixels: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """(m,), of pixels with these numbers from the first row on, whose corners are those of their neighbours."""
    first, last = rows
    stride = camera.width + 1
    corners = _square(pixels + pixels // camera.width, stride)
    asked = np.zeros(stride * (last - first + 1), bool)
    asked[corners] = True
    points = np.flatnonzero(asked)
    number = np.cumsum(asked) - 1
    return _crossed(scene, camera, points % stride, first + points // stride, number[corners])


def _apart(scene: FlatScene, camera: CameraPose) -> NDArray[np.bool_]:
    """(width · height,), of pixels that lie apart, each with corners of its own."""
    x, y = (g.ravel() + 0.5 for g in np.meshgrid(np.arange(camera.width), np.arange(camera.height)))
    half = 0.5 * camera.pixel_side
    places = (np.stack([at - half, at - half, at + half, at + half], axis=1) for at in (x, y))
    x, y = (at[:, order].ravel() for at, order in zip(places, ([0, 2, 3, 1], [0, 1, 2, 3]), strict=True))
    return _crossed(scene, camera, x, y, np.arange(len(x)).reshape(-1, 4))


def _square(first: NDArray[np.int64], stride: int) -> NDArray[np.int64]:
    """(m, 4) numbers of the corners, one after the other, of squares of a lattice with so many points a row, from those
    of the first."""
    return first[:, None] + np.array([0, 1, stride + 1, stride])


def _crossed(
    scene: FlatScene, camera: CameraPose, x: NDArray[np.number], y: NDArray[np.number], corners: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """(m,), of squares with corners (m, 4), numbers of places (n,) of the picture in pixels."""
    origins, directions = camera.rays(x, y)
    hits = closest_hits(scene.record[0], origins, directions, near=camera.seen_from(origins, directions))
    crossed = np.empty(len(corners), bool)
    mark_crossed(scene.record, hits, corners, crossed)
    if camera.aperture > 0:
        depth = np.where(hits.prims >= 0, hits.t * (directions @ camera.axes()[2]), np.inf)
        crossed &= camera.confusion(depth[corners].min(axis=1)) <= SHARP  # an edge is that of what is nearer
    return crossed
