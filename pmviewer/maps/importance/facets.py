"""Importons by the surfaces that they lie on, so that a search for those of a place meets no others.

A place has the importance of the nearest importon on its side, if that one reaches so far
(`pmviewer.maps.importance.look_up`). Of the importons within the farthest reach most face another way or lie on
another plane, and a search among all of them visits thousands for nothing. So importons of one normal and plane are a
facet with a tree of its own; those of small surfaces along each axis are one together, those of all others the last
one. A cone about its normals, its box and the reaches of its importons (`pmviewer.maps.importance.reached`) tell
whether a facet may count at a place. They may say too much, never too little, so that the importance found is the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import load_f4, stack_get_i8, stack_i4
from pmviewer.maps.importance.importance_map import IMPORTON_DTYPE, ImportanceMap
from pmviewer.maps.importance.look_up import STEEPNESS
from pmviewer.maps.importance.reached import BOXES, ReachedBoxes, reached_boxes
from pmviewer.maps.search.disc import Facing
from pmviewer.maps.search.k_nearest import KEYS, nearest
from pmviewer.maps.search.kdtree import RECORD, PhotonKdTree, build_kdtree
from pmviewer.maps.search.stored import ALL_CLASSES

FLAT = 13
MOST = FLAT + 7
"""Facets of one plane, and all, at most; the latter a multiple of four."""
ALONG = 0.97
"""Cosine from which a normal is along an axis."""
SMALLEST = 1 / 128
"""Facets have at least this share of the importons."""
NORMALS, PLANES = 16, 256
"""Steps of a normal's coordinates, and of a plane's place along the scene, within which importons are of one facet."""
SIMILAR = np.pi / 3
"""Normals of importons that count at a place differ by less from its own (`pmviewer.maps.search.stored.arrives`)."""
ROUNDING = 0.01
"""Radians by which codes of directions, and rounding, may turn a normal."""
AXIS, COSINE, MIDDLE, HALF, LOW, EDGE = 0, 3, 4, 7, 10, 13
SHAPE_WORDS = 14
"""A facet's shape, float64: middle of its cone of normals, cosine to it below which it does not count; middle and half
of the edges of its box; where its reached boxes begin, and the inverse of their edge."""

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32

Float = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Facets:
    """What kernels see: `maps` (facets,) of IMPORTON_DTYPE, `shapes` (facets, SHAPE_WORDS) float64, `boxes` (facets, 4)
    int64: how many reached boxes there are along each axis, and where among `reached` (boxes,) float32 they begin.
    `kept` is what the records point to."""

    maps: NDArray[np.void]
    shapes: NDArray[np.float64]
    boxes: NDArray[np.int64]
    reached: Float
    kept: tuple[PhotonKdTree | Float, ...]


def facets_of(importance: ImportanceMap) -> Facets:
    """The facets of an importance map with importons."""
    positions, normals = importance.positions, importance.normals
    parts = _parts(positions, normals)
    maps = np.zeros(len(parts), IMPORTON_DTYPE)
    shapes, sizes = np.zeros((len(parts), SHAPE_WORDS)), np.zeros((len(parts), 4), np.int64)
    kept: list[PhotonKdTree | Float] = []
    reached: list[Float] = []
    begin = 0
    for g, chosen in enumerate(parts):
        photons = np.zeros((len(chosen), 6), np.float32)
        photons[:, :3] = positions[chosen]
        photons.view(np.uint32)[:, 3:] = importance.tree.payload[chosen]
        tree = build_kdtree(photons)
        reach, weights = importance.reach[chosen][tree.index], importance.weights[chosen][tree.index]
        for name in RECORD.names or ():
            maps[g][name] = tree.record[0][name]
        maps[g]["normals"], maps[g]["farthest"] = 1, reach.max()
        maps[g]["reach"], maps[g]["weight"] = reach.ctypes.data, weights.ctypes.data
        maps[g]["sum_radius"] = importance.record[0]["sum_radius"]
        kept += [tree, reach, weights]
        boxes = reached_boxes(positions[chosen], importance.reach[chosen], BOXES // len(parts))
        shapes[g] = _shape(positions[chosen], normals[chosen], boxes)
        sizes[g] = (*boxes.reached.shape, begin)
        reached.append(boxes.reached.ravel())
        begin += boxes.reached.size
    return Facets(maps, shapes, sizes, np.concatenate(reached), tuple(kept))


def _parts(positions: Float, normals: Float) -> list[NDArray[np.int64]]:
    """Importons by facet: of one plane, the largest first; of others those along each axis; the rest."""
    extent = float(np.ptp(positions, axis=0).max()) or 1.0
    along = (positions * normals).sum(axis=1) / extent
    keys = np.column_stack([np.rint(normals * NORMALS), np.rint(along * PLANES)]).astype(np.int64)
    number = keys @ np.array([1, 64, 4096, 1 << 18])
    _, which, counts = np.unique(number, return_inverse=True, return_counts=True)
    largest = np.argsort(-counts, kind="stable")[:FLAT]
    of_plane = np.full(len(counts), FLAT)
    of_plane[largest] = np.where(counts[largest] >= SMALLEST * len(positions), np.arange(len(largest)), FLAT)
    axis = np.abs(normals).argmax(axis=1)
    towards = np.take_along_axis(normals, axis[:, None], axis=1)[:, 0]
    others = FLAT + np.where(np.abs(towards) > ALONG, 2 * axis + (towards > 0), 6)
    part = np.where(of_plane[which] < FLAT, of_plane[which], others)
    order = np.argsort(part, kind="stable")
    ends = np.bincount(part, minlength=MOST).cumsum()
    return [part for part in np.split(order, ends[:-1]) if len(part)]


def _shape(positions: Float, normals: Float, boxes: ReachedBoxes) -> NDArray[np.float64]:
    mean = normals.mean(axis=0, dtype=np.float64)
    axis = mean / (np.linalg.norm(mean) or 1.0)
    widest = np.arccos(np.clip((normals @ axis).min(), -1, 1)) + SIMILAR + ROUNDING
    cosine = np.cos(widest) if widest < np.pi and mean.any() else -2.0
    low, high = positions.min(axis=0).astype(np.float64), positions.max(axis=0).astype(np.float64)
    half = 0.5 * (high - low) + 1e-6 * np.abs(positions).max()
    return np.array([*axis, cosine, *(0.5 * (low + high)), *half, *boxes.low, 1.0 / boxes.edge])


@device
def faces(shapes, g, n):
    """Whether importons of facet g may count at places with unit normal n."""
    cosine = shapes[g, AXIS] * _f8(n[0]) + shapes[g, AXIS + 1] * _f8(n[1]) + shapes[g, AXIS + 2] * _f8(n[2])
    return cosine >= shapes[g, COSINE]


@device
def farness(shapes, g, p, n):
    """No importon of facet g counts at p, with unit normal n, as nearer than the square root of this."""
    d2, h, thickness = _f8(0.0), _f8(0.0), _f8(0.0)
    for a in range(3):
        off, half = shapes[g, MIDDLE + a] - _f8(p[a]), shapes[g, HALF + a]
        outside = max(abs(off) - half, _f8(0.0))
        d2 += outside * outside
        h += _f8(n[a]) * off
        thickness += abs(_f8(n[a])) * half
    above = max(abs(h) - thickness, _f8(0.0))
    return _f4(_f8(0.9999) * max(d2, _f8(STEEPNESS) * above * above))


@device
def reached_at(shapes, boxes, reached, g, p):
    """How far the importons of facet g reach that touch p's box, 0 where none does."""
    at = _i8(0)
    for a in range(3):
        x = (_f8(p[a]) - shapes[g, LOW + a]) * shapes[g, EDGE]
        if not (x >= _f8(0.0) and x < _f8(boxes[g, a])):
            return _f4(0.0)
        at = at * boxes[g, a] + _i8(x)
    return reached[boxes[g, 3] + at]


@kernel
def sums_on(maps, shapes, points, normals, k, out, i0, i1):
    """The weight of all importons that `importance_sum` counts at points[i0:i1] (m, 3) float32 with unit normals
    (m, 3), if they are fewer than k, else of some k; into out (m,) float32."""
    keys = stack_i4(KEYS)
    for i in range(i0, i1):
        p, n = (points[i, 0], points[i, 1], points[i, 2]), (normals[i, 0], normals[i, 1], normals[i, 2])
        missing, total = _i8(k), _f8(0.0)
        for g in range(len(maps)):
            r2 = maps[g].sum_radius * maps[g].sum_radius
            if missing > 0 and faces(shapes, g, n) and farness(shapes, g, p, n) < r2:
                count, _ = nearest(maps[g], p, _i4(missing), r2, keys, Facing(n, STEEPNESS, _i4(ALL_CLASSES)))
                for j in range(count):
                    total += _f8(load_f4(maps[g].weight, stack_get_i8(keys, j) & _i8(0xFFFFFFFF)))
                missing -= count
        out[i] = _f4(total)
