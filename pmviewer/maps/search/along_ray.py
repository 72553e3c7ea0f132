"""Photons of a grid around a ray: every one within a radius of it, once.

The ray is followed in slabs of cells across its longest axis. The photons of a slab that lie within the radius r of the
ray have the foot of their perpendicular within r of the slab, so that a rectangle of cells in each slab holds all of
them, and slabs share no cell. Of a hashed grid a bucket may hold cells that are far apart: there a photon counts where
its own cell is visited.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4, load_i4
from pmviewer.maps.search.grid import cell_bucket
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64


class Slabs(NamedTuple):
    """A ray in the coordinates of a grid's cells: origin and direction, the longest axis, the reach around it in cells,
    and the first and last slab."""

    o: Any
    d: Any
    axis: Any
    reach: Any
    first: Any
    last: Any


@device
def slabs_of(grid, o, d, length, radius):
    """The Slabs that a ray of that length from o in the unit direction d visits; last < first where it misses the
    grid."""
    s = grid.cells_per_length
    g = ((o[0] - grid.origin_x) * s, (o[1] - grid.origin_y) * s, (o[2] - grid.origin_z) * s)
    e = (_f8(d[0]) * s, _f8(d[1]) * s, _f8(d[2]) * s)
    axis = 0
    if abs(d[1]) > abs(d[0]):
        axis = 1
    if abs(d[2]) > max(abs(d[0]), abs(d[1])):
        axis = 2
    reach = _f8(radius) * s * (1.0 + 1e-5)
    sizes = (_f8(grid.nx), _f8(grid.ny), _f8(grid.nz))
    near, far = _f8(0.0), _f8(length)
    for k in range(3):
        if abs(e[k]) > 0.0:
            a, b = (-reach - g[k]) / e[k], (sizes[k] + reach - g[k]) / e[k]
            near, far = max(near, min(a, b)), min(far, max(a, b))
        elif g[k] < -reach or g[k] > sizes[k] + reach:
            far = _f8(-1.0)
    if grid.n == 0 or not near <= far:
        return Slabs(g, e, axis, reach, _i8(0), _i8(-1))
    a, b = g[axis] + near * e[axis], g[axis] + far * e[axis]
    first = _i8(max(min(a, b) - reach, 0.0))
    last = min(_i8(max(max(a, b) + reach, 0.0)), _i8(sizes[axis]) - 1)
    return Slabs(g, e, axis, reach, first, last)


@device
def cells_of(grid, slabs, slab, length, k):
    """First and last cell along axis k that the ray's surroundings touch in a slab."""
    axis, reach = slabs.axis, slabs.reach
    if k == axis:
        return slab, slab
    a = (_f8(slab) - reach - slabs.o[axis]) / slabs.d[axis]
    b = (_f8(slab) + 1.0 + reach - slabs.o[axis]) / slabs.d[axis]
    near, far = max(min(a, b), 0.0), min(max(a, b), _f8(length))
    x, y = slabs.o[k] + near * slabs.d[k], slabs.o[k] + far * slabs.d[k]
    most = _i8((grid.nx, grid.ny, grid.nz)[k]) - 1
    low, high = min(x, y) - reach, max(x, y) + reach
    if high < 0.0 or near > far:
        return _i8(0), _i8(-1)
    return _i8(max(low, 0.0)), min(_i8(high), most)


@device
def photons_of_row(grid, x0, x1, y, z):
    """First and end of the photons in cells x0 … x1 of a row; of a hashed grid x0 is x1, and strangers are among
    them."""
    if grid.hash_mask == 0:
        row = (_i8(z) * grid.ny + y) * grid.nx
        return _i8(load_i4(grid.starts, row + x0)), _i8(load_i4(grid.starts, row + x1 + 1))
    bucket = cell_bucket(x0, y, z, grid.hash_mask)
    return _i8(load_i4(grid.starts, bucket)), _i8(load_i4(grid.starts, bucket + 1))


@device
def photon_place(grid, i):
    """Address of the block of photon i, its lane there, and its position."""
    block, lane = grid.blocks + (i // WIDTH) * BLOCK_BYTES, i % WIDTH
    return (
        block,
        lane,
        (
            load_f4(block, lane),
            load_f4(block + ROW_BYTES, lane),
            load_f4(block + 2 * ROW_BYTES, lane),
        ),
    )


@device
def is_in_cell(grid, p, x, y, z):
    """Whether the photon at p is sorted into that cell."""
    s = grid.cells_per_length
    return (
        min(max(_i8((p[0] - grid.origin_x) * s), 0), grid.nx - 1) == x
        and min(max(_i8((p[1] - grid.origin_y) * s), 0), grid.ny - 1) == y
        and min(max(_i8((p[2] - grid.origin_z) * s), 0), grid.nz - 1) == z
    )
