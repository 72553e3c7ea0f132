"""The cells that a photon map's structure divides space into, as boxes to be drawn (M1, M2).

Of a kd-tree these are the nodes from the root down to a level; of a grid, dense or hashed, the cells with photons in
them, or blocks of 2³, 4³ … cells where there are too many. NumPy alone: nothing is compiled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.search.grid import PhotonGrid
from pmviewer.maps.search.kdtree import PhotonKdTree
from pmviewer.maps.search.parts import PhotonParts
from pmviewer.maps.search.simd import WIDTH

Kind = Literal["kd-tree", "grid", "hashed grid"]


@dataclass(frozen=True, eq=False)
class MapCells:
    """Boxes of one map. Lengths in scene units.

    Attributes
    ----------
    map: name of the photon map.
    kind: what the boxes are of.
    low, high: (n, 3) float32 corners.
    photons: (n,) int64 photons in each.
    level: (n,) int64 of the nodes of a tree, 0 the root; of grids all 0.
    total: nodes of the tree on the levels asked for, which the boxes are some of where there are more than were asked
        for; or cells of the grid with photons.
    depth: level of the tree's leaves; 0 for grids.
    parts: parts that the map is in; the cells are those of the first one's tree.
    side: cells of the grid along a box.
    """

    map: str
    kind: Kind
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    photons: NDArray[np.int64]
    level: NDArray[np.int64]
    total: int
    depth: int = 0
    parts: int = 1
    side: int = 1


def cells_of_map(
    name: str, structure: PhotonGrid | PhotonKdTree | PhotonParts, levels: int, limit: int
) -> MapCells | None:
    """Boxes of the map `name`: of a tree the nodes on levels 0 … `levels`, as far as whole levels fit in `limit`
    boxes; of a grid its cells, put together until they are `limit` boxes at most. None without a photon."""
    if structure.n == 0:
        return None
    if isinstance(structure, PhotonParts):
        return _tree_cells(name, structure.trees[0], levels, limit, len(structure.trees))
    if isinstance(structure, PhotonKdTree):
        return _tree_cells(name, structure, levels, limit, 1)
    return _grid_cells(name, structure, limit)


def _tree_cells(name: str, tree: PhotonKdTree, levels: int, limit: int, parts: int) -> MapCells | None:
    n = tree.n
    if n == 0:
        return None
    depth = int(tree.record["depth"][0])
    asked = min(levels, depth)
    last = min(asked, (limit + 1).bit_length() - 2)
    at, axes = tree.planes[:, 0], tree.planes.view(np.int32)[:, 1]
    places = tree.x[:n], tree.y[:n], tree.z[:n]
    low = np.array([[axis.min() for axis in places]], np.float32)
    high = np.array([[axis.max() for axis in places]], np.float32)
    lows, highs, counts = [], [], []
    for level in range(last + 1):
        ends = n * np.arange((1 << level) + 1, dtype=np.int64) >> level
        lows.append(low)
        highs.append(high)
        counts.append(np.diff(ends))
        if level < last:
            nodes = np.arange(1 << level)
            axis, plane = axes[(1 << level) + nodes], at[(1 << level) + nodes]
            low, high = np.repeat(low, 2, axis=0), np.repeat(high, 2, axis=0)
            high[2 * nodes, axis] = plane
            low[2 * nodes + 1, axis] = plane
    level_of = np.repeat(np.arange(last + 1), [len(count) for count in counts])
    boxes = np.concatenate(lows), np.concatenate(highs), np.concatenate(counts)
    return MapCells(name, "kd-tree", *boxes, level_of, (2 << asked) - 1, depth, parts)


def _grid_cells(name: str, grid: PhotonGrid, limit: int) -> MapCells:
    record = grid.record[0]
    origin = np.array([record["origin_x"], record["origin_y"], record["origin_z"]])
    shape = np.array([record["nx"], record["ny"], record["nz"]], np.int64)
    cells, photons = _hashed(grid, origin, shape) if grid.hashed else _dense(grid, shape)
    total, side = len(cells), 1
    while len(cells) > limit:
        side *= 2
        cells, photons = _together(cells // 2, photons)
    size = side / float(record["cells_per_length"])
    low, high = ((origin + (cells + corner) * size).astype(np.float32) for corner in (0, 1))
    kind: Kind = "hashed grid" if grid.hashed else "grid"
    return MapCells(name, kind, low, high, photons, np.zeros(len(cells), np.int64), total, side=side)


def _dense(grid: PhotonGrid, shape: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(cells (m, 3), photons (m,)) of those that hold any."""
    held = np.diff(grid.starts)
    occupied = np.flatnonzero(held)
    x, y, z = occupied % shape[0], occupied // shape[0] % shape[1], occupied // (shape[0] * shape[1])
    return np.stack([x, y, z], axis=1), held[occupied].astype(np.int64)


def _hashed(
    grid: PhotonGrid, origin: NDArray[np.float64], shape: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The same from the photons: which cell a bucket's are in is not kept."""
    photon = np.arange(grid.n)
    places = grid.blocks[photon // WIDTH, :3, photon % WIDTH].view(np.float32).astype(np.float64)
    cells = ((places - origin) * float(grid.record["cells_per_length"][0])).astype(np.int64)
    return _together(np.clip(cells, 0, shape - 1), np.ones(grid.n, np.int64))


def _together(cells: NDArray[np.int64], photons: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Each cell once, with all of its photons."""
    order = np.lexsort(cells.T)
    cells = cells[order]
    first = np.flatnonzero(np.r_[True, (np.diff(cells, axis=0) != 0).any(axis=1)])
    return cells[first], np.add.reduceat(photons[order], first)
