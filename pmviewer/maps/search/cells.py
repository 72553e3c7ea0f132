"""The cells that a photon map's structure divides space into, as boxes to be drawn (M1, M2).

Of a kd-tree these are the nodes from the root down to a level; of a grid, dense or hashed, the cells with photons in
them. NumPy alone: nothing is compiled, and of a hashed grid only those buckets are read that are drawn.
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
    total: nodes of the tree on the levels asked for, cells of the grid with photons, or such buckets of its hash: what
        the boxes are some of, where there are more of them than were asked for.
    depth: level of the tree's leaves; 0 for grids.
    parts: parts that the map is in; the cells are those of the first one's tree.
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


def cells_of_map(
    name: str, structure: PhotonGrid | PhotonKdTree | PhotonParts, levels: int, limit: int
) -> MapCells | None:
    """Boxes of the map `name`: of a tree the nodes on levels 0 … `levels`, as far as whole levels fit in `limit`
    boxes; of a grid at most `limit` cells (of a hashed one the cells of so many buckets), evenly thinned. None without
    a photon."""
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
    occupied = np.flatnonzero(np.diff(grid.starts))
    chosen = occupied[:: -(-len(occupied) // limit)]
    origin = np.array([record["origin_x"], record["origin_y"], record["origin_z"]])
    shape = np.array([record["nx"], record["ny"], record["nz"]], np.int64)
    if grid.hashed:
        cells, photons = _cells_in(grid, chosen, origin, shape)
    else:
        cells = np.stack([chosen % shape[0], chosen // shape[0] % shape[1], chosen // (shape[0] * shape[1])], axis=1)
        photons = (grid.starts[chosen + 1] - grid.starts[chosen]).astype(np.int64)
    size = 1.0 / float(record["cells_per_length"])
    low, high = ((origin + (cells + corner) * size).astype(np.float32) for corner in (0, 1))
    kind: Kind = "hashed grid" if grid.hashed else "grid"
    return MapCells(name, kind, low, high, photons, np.zeros(len(cells), np.int64), len(occupied))


def _cells_in(
    grid: PhotonGrid, buckets: NDArray[np.int64], origin: NDArray[np.float64], shape: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(cells (m, 3), photons (m,)): the cells whose photons are in these buckets. All photons of a cell are in one
    bucket, which may hold those of others."""
    first = grid.starts[buckets].astype(np.int64)
    sizes = grid.starts[buckets + 1] - first
    photon = np.repeat(first - np.cumsum(sizes) + sizes, sizes) + np.arange(sizes.sum())
    places = grid.blocks[photon // WIDTH, :3, photon % WIDTH].view(np.float32).astype(np.float64)
    cells = ((places - origin) * float(grid.record["cells_per_length"][0])).astype(np.int64)
    found, photons = np.unique(np.clip(cells, 0, shape - 1), axis=0, return_counts=True)
    return found, photons.astype(np.int64)
