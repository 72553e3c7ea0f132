"""Which cell of an image environment two numbers fall to, by the tables of `pmviewer.kernels.lights.environment`.

A large image's tables and texels don't fit into the caches, and each step of a look-up waits for memory that the step
before has asked for. Steps are functions of their own, which have the next one's memory fetched: who needs several
places takes the same step of all of them before the next (`pmviewer.render.direct.places`).
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4, load_i4, prefetch
from pmviewer.kernels.table import find_between, find_interval

_f4 = np.float32
_i8 = np.int64


@device
def row_of_cells(scene, u):
    """The row of cells that u falls to, and u stretched to [0, 1) within it."""
    row = find_interval(scene.sky_rows, scene.sky_height - 1, _i8(0), u)
    low = _f4(0.0) if row == 0 else load_f4(scene.sky_rows, row - 1)
    return row, (u - low) / (load_f4(scene.sky_rows, row) - low)


@device
def _in_guide(scene, row, v):
    """Place in the guide of the step that v lies in."""
    return row * scene.sky_steps + min(_i8(v * _f4(scene.sky_steps)), scene.sky_steps - 1)


@device
def guide_ahead(scene, row, v):
    """Has what `cells_between` reads fetched."""
    prefetch(scene.sky_guide, _in_guide(scene, row, v))


@device
def cells_between(scene, row, v):
    """The first and the last cell of a row that v may fall to. Has their shares fetched."""
    at, high = _in_guide(scene, row, v), scene.sky_width - 1
    low = _i8(load_i4(scene.sky_guide, at))
    if at + 1 < (row + 1) * scene.sky_steps:
        high = min(_i8(load_i4(scene.sky_guide, at + 1)) + 1, high)
    prefetch(scene.sky_cells, row * scene.sky_width + ((low + high) >> 1))
    return low, high


@device
def cell_between(scene, row, low, high, v):
    """The cell of low … high that v falls to, and v stretched to [0, 1) within it. Has its texels fetched."""
    first = row * scene.sky_width
    column = find_between(scene.sky_cells, low, high, first, v)
    prefetch(scene.sky_texels, (first + column) * _i8(3))
    prefetch(scene.sky_texels, (first + scene.sky_width + column) * _i8(3))
    below = _f4(0.0) if column == 0 else load_f4(scene.sky_cells, first + column - 1)
    return column, (v - below) / (load_f4(scene.sky_cells, first + column) - below)


@device
def cell_of(scene, u, v):
    """Row and column of the cell that u and v fall to, and both stretched to [0, 1) within it: all steps of one."""
    row, u = row_of_cells(scene, u)
    low, high = cells_between(scene, row, v)
    column, v = cell_between(scene, row, low, high, v)
    return row, column, u, v
