"""Uniform grid for look-ups of one fixed radius, rebuilt for each pass (M2).

Cells are 2r wide, so a look-up touches at most 2×2×2 of them. Cells that follow each other in x follow each other in
memory: the photons of a row of two cells are one contiguous run, and a look-up is at most four runs that are tested
eight photons at a time. Photons are stored in blocks of eight, each the six words of the record in turn: a run is one
stretch of memory. `cell_sort` brings photons into cell order.

While the cells of the bounding box are not many more than the photons, the grid is dense. Otherwise (small radius in a
large scene) cells are hashed (Teschner et al. 2003) into about n/2 buckets; four neighbours in x share one hash so that
they mostly stay contiguous. Two cells may fall into one bucket; a look-up visits each bucket once, and the distance
test removes strangers.

A grid stores 24 bytes a photon and at most 6 of cell starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from pmviewer.errors import SettingError
from pmviewer.kernels.compile.jit import device, inlined, kernel
from pmviewer.kernels.memory import load_i4, stack_get_i4, stack_i4, stack_put_i4
from pmviewer.maps.record import ALL_CLASSES
from pmviewer.maps.search.cell_sort import (
    bounds_of_piece,
    even_ends,
    even_parts,
    places_of,
    sort_by_bucket,
    sort_by_cell,
)
from pmviewer.maps.search.in_disc import apart8, in_disc8
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH, count_bits, within8
from pmviewer.tasks import Steps, in_steps, in_turn

DENSE_CELLS_PER_PHOTON = 1.5
FEWEST_DENSE_CELLS = 1 << 12
MOST_CELLS = 30_000_000
"""A dense grid has at most this many cells: beyond, look-ups miss the caches and a hash is no slower."""

MOST_CELLS_ALONG_AXIS = 1 << 22
FEWEST_OF_PIECE = 1 << 13
"""Photons; fewer are not worth a task of their own."""
MARGIN = 1.0 + 1e-6
"""Photons whose float32 distance rounds to inside may lie this much farther out."""

RANGES = 8
"""Most runs of photons that one look-up visits."""

RECORD = np.dtype(
    [
        ("blocks", np.int64),
        ("starts", np.int64),
        ("n", np.int64),
        ("origin_x", np.float64),
        ("origin_y", np.float64),
        ("origin_z", np.float64),
        ("cells_per_length", np.float64),
        ("nx", np.int32),
        ("ny", np.int32),
        ("nz", np.int32),
        ("hash_mask", np.int32),
        ("radius", np.float32),
        ("power_unit", np.float32),
    ],
    align=True,
)
"""What kernels see of a grid: addresses of its arrays, its geometry; `hash_mask` is 0 for a dense grid."""

_u4 = np.uint32
_i4 = np.int32
_i8 = np.int64


@dataclass(frozen=True, eq=False)
class PhotonGrid:
    """Photons in cell order; within a cell in the order of the input.

    Attributes
    ----------
    blocks: (⌈n/8⌉, 6, 8) uint32, word w of photon i at [i // 8, w, i % 8].
    starts: (cells + 1,) int32, first photon of each cell or hash bucket.
    radius: the largest radius of look-ups.
    power_unit: watts of one unit of stored power.
    record: one-element array of dtype `RECORD` for kernels; valid while this object lives.
    """

    n: int
    blocks: np.ndarray
    starts: np.ndarray
    radius: float
    power_unit: float
    record: np.ndarray

    @property
    def hashed(self) -> bool:
        """Whether cells are found by a hash; a dense grid has an entry for each."""
        return bool(self.record["hash_mask"][0])

    @property
    def bytes(self) -> int:
        """Memory held, in bytes, photons included."""
        return self.blocks.nbytes + self.starts.nbytes + self.record.nbytes

    @property
    def photons(self) -> np.ndarray:
        """A new (n, 6) float32 array of the photons in cell order."""
        return self.blocks.transpose(0, 2, 1).reshape(-1, 6)[: self.n].view(np.float32)


@device
def cell_bucket(cx, cy, cz, mask):
    """Bucket of a cell; four cells with the same cx >> 2 get four successive buckets."""
    h = _u4(_u4(_u4(cx >> 2) * _u4(73856093)) ^ _u4(_u4(cy) * _u4(19349663)) ^ _u4(_u4(cz) * _u4(83492791)))
    h = _u4(_u4(h ^ _u4(h >> _u4(16))) * _u4(0x7FEB352D))
    h = _u4(h ^ _u4(h >> _u4(15)))
    return _i8(_u4(_u4(_u4(h << _u4(2)) | _u4(cx & 3)) & _u4(mask)))


@device
def _row(grid, cx0, cx1, cy, cz, ranges, count):
    """Adds the runs of photons in cells cx0 … cx1 of one row; returns the new number of runs."""
    if grid.hash_mask == 0:
        row = (_i8(cz) * grid.ny + cy) * grid.nx
        first, end = load_i4(grid.starts, row + cx0), load_i4(grid.starts, row + cx1 + 1)
        if first < end:
            stack_put_i4(ranges, 2 * count, first)
            stack_put_i4(ranges, 2 * count + 1, end)
            count += 1
        return count
    for cx in range(cx0, cx1 + 1):
        bucket = cell_bucket(cx, cy, cz, grid.hash_mask)
        first, end = load_i4(grid.starts, bucket), load_i4(grid.starts, bucket + 1)
        if first == end:
            continue
        new = True
        for j in range(count):
            if stack_get_i4(ranges, 2 * j) == first:
                new = False
        if new:
            stack_put_i4(ranges, 2 * count, first)
            stack_put_i4(ranges, 2 * count + 1, end)
            count += 1
    return count


@device
def grid_ranges(grid, px, py, pz, radius, ranges):
    """Runs of photons that contain all within `radius` ≤ grid.radius of a point.

    `ranges` points to 2·RANGES int32 of scratch that receive first and end of each run. Returns the number of runs; 0
    for a point outside the grid or not finite.
    """
    if grid.n == 0:
        return 0
    scale = grid.cells_per_length
    h = radius * scale * MARGIN
    gx = (px - grid.origin_x) * scale
    gy = (py - grid.origin_y) * scale
    gz = (pz - grid.origin_z) * scale
    if not (gx >= -h and gy >= -h and gz >= -h and gx - h <= grid.nx and gy - h <= grid.ny and gz - h <= grid.nz):
        return 0
    x0, x1 = _i8(max(gx - h, 0.0)), min(_i8(gx + h), grid.nx - 1)
    y0, y1 = _i8(max(gy - h, 0.0)), min(_i8(gy + h), grid.ny - 1)
    z0, z1 = _i8(max(gz - h, 0.0)), min(_i8(gz + h), grid.nz - 1)
    count = _i8(0)
    for cz in range(z0, z1 + 1):
        for cy in range(y0, y1 + 1):
            count = _row(grid, x0, x1, cy, cz, ranges, count)
    return count


@device
def thinning_step(ranges, runs, most):
    """Every how many blocks a look-up visits so that it meets some `most` photons of its runs, evenly thinned."""
    candidates = _i8(0)
    for k in range(runs):
        candidates += _i8(stack_get_i4(ranges, 2 * k + 1)) - _i8(stack_get_i4(ranges, 2 * k))
    return _i8(1) + candidates // _i8(most)


@device
def lanes_between(first, end, block):
    """Mask of those of the eight photons of a block that lie in first … end−1."""
    mask = _i4(0xFF)
    start = block * WIDTH
    if first > start:
        mask &= _i4(0xFF << (first - start))
    if end - start < WIDTH:
        mask &= _i4((1 << (end - start)) - 1)
    return mask


@inlined
def counted_in_block(grid, block, first, end, disc, squared):
    """Which of the eight photons of a block count: those of first … end−1 in the disc. Mask as int32.

    disc: a `pmviewer.maps.search.disc.Disc`; squared: pointer to 8 float32 of scratch that receive the squared
    distances. Inlined: it runs for every eight
    photons of a look-up.
    """
    at = grid.blocks + block * BLOCK_BYTES
    p = disc.p
    mask = _i4(
        within8(at, at + ROW_BYTES, at + 2 * ROW_BYTES, p[0], p[1], p[2], disc.r2, squared)
        & lanes_between(first, end, block)
    )
    if mask != 0:
        found = in_disc8(at, p, disc.n, disc.height, disc.class_mask)
        off = mask & (found >> _i4(WIDTH))
        mask &= found
        if off != 0:  # hardly ever on walls and floors
            mask &= ~(off & apart8(at, p, disc.n))
    return mask


@kernel
def count_in_radius(grids, points, radius, i0, i1, counts):
    """Number of photons closer than `radius` to points[i0:i1]; points (m, 3) float32, counts (m,) int32."""
    grid = grids[0]
    ranges = stack_i4(16)
    squared = stack_i4(8)
    radius = min(radius, grid.radius)
    r2 = radius * radius
    for i in range(i0, i1):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        total = _i4(0)
        for k in range(grid_ranges(grid, x, y, z, radius, ranges)):
            first, end = _i8(stack_get_i4(ranges, 2 * k)), _i8(stack_get_i4(ranges, 2 * k + 1))
            for block in range(first // WIDTH, (end - 1) // WIDTH + 1):
                at = grid.blocks + block * BLOCK_BYTES
                inside = within8(at, at + ROW_BYTES, at + 2 * ROW_BYTES, x, y, z, r2, squared)
                total += count_bits(_i4(inside & lanes_between(first, end, block)))
        counts[i] = total


def build_grid(photons: np.ndarray, radius: float, power_unit: float = 1.0) -> PhotonGrid:
    """Sorts photons (n, 6) float32 into a grid for look-ups of at most `radius`. Runs without the GIL.

    Raises SettingError when the radius or the unit of power is not positive and finite.
    """
    return in_steps([grid_steps(photons, radius, power_unit)], in_turn)[0]


def grid_steps(
    photons: np.ndarray, radius: float, power_unit: float = 1.0, pieces: int = 1, classes: int = ALL_CLASSES
) -> Steps[PhotonGrid]:
    """`build_grid` in steps of up to `pieces` tasks each, of photons whose path class has its bit in `classes`. The
    grid does not depend on `pieces`. Raises SettingError as `build_grid` does."""
    if not (math.isfinite(radius) and radius > 0):
        raise SettingError(f"Look-up radius {radius!r} of a photon map: expected a positive length.")
    if not (math.isfinite(power_unit) and power_unit > 0):
        raise SettingError(f"Power unit {power_unit!r} of a photon map: expected a positive power.")
    photons = np.require(photons, np.float32, ["C", "W"])
    words = photons.view(np.uint32)
    ends = even_ends(len(photons), min(pieces, len(photons) // FEWEST_OF_PIECE + 1))
    boxes = np.zeros((len(ends), 2, 3), np.float32)
    kept = np.zeros(len(ends), np.int64)
    yield [
        partial(bounds_of_piece, photons, words, classes, *ends[t], boxes[t], kept[t : t + 1]) for t in range(len(ends))
    ]
    n = int(kept.sum())
    low, high = np.zeros((2, 3))
    if n:
        low = np.nan_to_num(boxes[:, 0].min(axis=0).astype(np.float64))
        high = np.nan_to_num(boxes[:, 1].max(axis=0).astype(np.float64))
    extent = np.maximum(high - low, 0.0)
    # A cell below the spacing of float32 coordinates would separate nothing; a wider one is merely slower.
    cell = max(2.0 * radius * (1.0 + 1e-5), float(extent.max()) / (MOST_CELLS_ALONG_AXIS - 1))
    shape = (extent / cell).astype(np.int64) + 1
    cells = math.prod(int(s) for s in shape)
    hash_mask = 0
    if cells > min(MOST_CELLS, max(DENSE_CELLS_PER_PHOTON * n, FEWEST_DENSE_CELLS)):
        cells = 1 << max(int(n / 2).bit_length(), 3)
        hash_mask = cells - 1
    blocks = np.zeros((-(-n // WIDTH), 6, WIDTH), np.uint32)
    starts = np.zeros(cells + 1, np.int32)
    record = np.zeros(1, RECORD)
    addresses = blocks.ctypes.data, starts.ctypes.data
    record[0] = (*addresses, n, *low, 1.0 / cell, *shape, hash_mask, radius, power_unit)
    grid = PhotonGrid(n, blocks, starts, float(radius), float(power_unit), record)
    if not n:
        return grid
    shift = max(4, math.ceil(math.log2(cells / 1024)))
    keys, sorted_keys, order = np.empty(len(photons), np.int32), np.empty(n, np.int32), np.empty(n, np.int32)
    counts = np.zeros((len(ends), (cells - 1 >> shift) + 1), np.int64)
    yield [partial(_keys, photons, words, classes, record, shift, keys, counts[t], *ends[t]) for t in range(len(ends))]
    places, begins = places_of(counts)
    yield [partial(sort_by_bucket, keys, shift, places[t], sorted_keys, order, *ends[t]) for t in range(len(ends))]
    parts = [(int(a), int(b)) for a, b in even_parts(begins, len(ends))]
    yield [partial(sort_by_cell, words, sorted_keys, order, begins, shift, blocks, starts, *part) for part in parts]
    starts[cells] = n
    return grid


@kernel
def _keys(photons, words, classes, records, shift, keys, counts, first, last):
    """Cells of photons first … last−1 of (n, 6), seen as uint32 in `words`, into keys (n,) int32, −1 of those whose
    class is not in `classes`; `counts` (buckets,) int64 adds up how many lie in 2^shift cells in a row."""
    grid = records[0]
    scale = grid.cells_per_length
    for i in range(first, last):
        if (classes >> _i8((words[i, 3] >> _u4(6)) & _u4(3))) & 1 == 0:
            keys[i] = -1
            continue
        cx = min(max(_i8((photons[i, 0] - grid.origin_x) * scale), 0), grid.nx - 1)
        cy = min(max(_i8((photons[i, 1] - grid.origin_y) * scale), 0), grid.ny - 1)
        cz = min(max(_i8((photons[i, 2] - grid.origin_z) * scale), 0), grid.nz - 1)
        if grid.hash_mask == 0:
            key = (cz * grid.ny + cy) * grid.nx + cx
        else:
            key = cell_bucket(cx, cy, cz, grid.hash_mask)
        keys[i] = key
        counts[key >> shift] += 1
