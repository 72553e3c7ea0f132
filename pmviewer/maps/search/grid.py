"""Uniform grid for look-ups of one fixed radius, rebuilt for each pass (M2).

Cells are 2r wide, so a look-up touches at most 2×2×2 of them. Cells that follow each other in x follow each other in
memory: the photons of a row of two cells are one contiguous run, and a look-up is at most four runs that are tested
eight photons at a time. Photons are stored in blocks of eight, each the six words of the record in turn: a run is one
stretch of memory. A stable counting sort in two levels (coarse buckets of cells first, then cells within a bucket)
brings photons into cell order; its scattered writes stay within the caches.

While the cells of the bounding box are not many more than the photons, the grid is dense. Otherwise (small radius in a
large scene) cells are hashed (Teschner et al. 2003) into about n/2 buckets; four neighbours in x share one hash so that
they mostly stay contiguous. Two cells may fall into one bucket; a look-up visits each bucket once, and the distance
test removes strangers.

A grid stores 24 bytes a photon and at most 6 of cell starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pmviewer.errors import SettingError
from pmviewer.kernels.compile.jit import device, inlined, kernel
from pmviewer.kernels.memory import load_i4, stack_get_i4, stack_i4, stack_put_i4
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH, count_bits, facing8, within8

DENSE_CELLS_PER_PHOTON = 1.5
FEWEST_DENSE_CELLS = 1 << 12
MOST_CELLS = 30_000_000
"""A dense grid has at most this many cells: beyond, look-ups miss the caches and a hash is no slower."""

MOST_CELLS_ALONG_AXIS = 1 << 22
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
        mask &= facing8(at, p, disc.n, disc.height, disc.class_mask)
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


@kernel
def _bounds(photons, box):
    """Bounding box of photons (n, 6) into box (2, 3) float32; coordinates that are not numbers are left out."""
    for axis in range(3):
        box[0, axis], box[1, axis] = np.float32(np.inf), np.float32(-np.inf)
    x0, y0, z0 = box[0]
    x1, y1, z1 = box[1]
    for i in range(len(photons)):
        x, y, z = photons[i, 0], photons[i, 1], photons[i, 2]
        x0, y0, z0 = min(x0, x), min(y0, y), min(z0, z)
        x1, y1, z1 = max(x1, x), max(y1, y), max(z1, z)
    box[0, 0], box[0, 1], box[0, 2] = x0, y0, z0
    box[1, 0], box[1, 1], box[1, 2] = x1, y1, z1


@kernel
def _sort(photons, words, records, shift, keys, order, bucket_ends, cell_ends, blocks, starts):
    """Two-level counting sort of photons (n, 6), seen as uint32 in `words`, by cell.

    keys, order: (2, n) and (n,) int32 scratch; bucket_ends: zeroed int64, one per 2^shift cells, plus one; cell_ends:
    (2^shift,) int64 scratch.
    """
    grid = records[0]
    n = len(photons)
    scale = grid.cells_per_length
    for i in range(n):
        cx = min(max(_i8((photons[i, 0] - grid.origin_x) * scale), 0), grid.nx - 1)
        cy = min(max(_i8((photons[i, 1] - grid.origin_y) * scale), 0), grid.ny - 1)
        cz = min(max(_i8((photons[i, 2] - grid.origin_z) * scale), 0), grid.nz - 1)
        if grid.hash_mask == 0:
            key = (cz * grid.ny + cy) * grid.nx + cx
        else:
            key = cell_bucket(cx, cy, cz, grid.hash_mask)
        keys[0, i] = key
        bucket_ends[key >> shift] += 1
    total = 0
    for b in range(len(bucket_ends)):
        size = bucket_ends[b]
        bucket_ends[b] = total
        total += size
    for i in range(n):
        key = keys[0, i]
        place = bucket_ends[key >> shift]
        bucket_ends[key >> shift] = place + 1
        keys[1, place] = key
        order[place] = i
    cells = len(starts) - 1
    begin = 0
    for b in range(len(bucket_ends)):
        end = bucket_ends[b]
        first_cell = b << shift
        width = min(1 << shift, cells - first_cell)
        cell_ends[:width] = 0
        for i in range(begin, end):
            cell_ends[keys[1, i] - first_cell] += 1
        total = begin
        for c in range(width):
            starts[first_cell + c] = total
            total += cell_ends[c]
            cell_ends[c] = starts[first_cell + c]
        for i in range(begin, end):
            c = keys[1, i] - first_cell
            place = cell_ends[c]
            cell_ends[c] = place + 1
            j = order[i]
            for w in range(6):
                blocks[place // WIDTH, w, place % WIDTH] = words[j, w]
        begin = end
    starts[cells] = n


def build_grid(photons: np.ndarray, radius: float, power_unit: float = 1.0) -> PhotonGrid:
    """Sorts photons (n, 6) float32 into a grid for look-ups of at most `radius`. Runs without the GIL.

    Raises SettingError when the radius or the unit of power is not positive and finite.
    """
    if not (math.isfinite(radius) and radius > 0):
        raise SettingError(f"Look-up radius {radius!r} of a photon map: expected a positive length.")
    if not (math.isfinite(power_unit) and power_unit > 0):
        raise SettingError(f"Power unit {power_unit!r} of a photon map: expected a positive power.")
    photons = np.require(photons, np.float32, ["C", "W"])
    n = len(photons)
    box = np.zeros((2, 3), np.float32)
    if n:
        _bounds(photons, box)
    low, high = np.nan_to_num(box.astype(np.float64))
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
    if n:
        shift = max(4, math.ceil(math.log2(cells / 1024)))
        keys, order = np.empty((2, n), np.int32), np.empty(n, np.int32)
        bucket_ends = np.zeros((cells - 1 >> shift) + 1, np.int64)
        cell_ends = np.empty(1 << shift, np.int64)
        words = photons.view(np.uint32)
        _sort(photons, words, record, shift, keys, order, bucket_ends, cell_ends, blocks, starts)
    return PhotonGrid(n, blocks, starts, float(radius), float(power_unit), record)
