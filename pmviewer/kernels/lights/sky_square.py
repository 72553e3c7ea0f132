"""What tables of the shares of an image environment look like, by which the unit square of its samples is bent
(`pmviewer.kernels.lights.sky_facing`), and which of them is for a direction that a surface faces."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device

SIDE = 16
"""Cells of the square along each side."""
TABLE = SIDE + SIDE * SIDE
"""Numbers of a table: cumulative shares of its rows, then of the cells within each."""

_f4 = np.float32
_i8 = np.int64


@device
def facing_cell(n, facings):
    """Number of the cell, of facings × facings of an octahedral map, that the unit vector n lies in."""
    inv = _f4(1.0) / (abs(n[0]) + abs(n[1]) + abs(n[2]))
    x, y = n[0] * inv, n[1] * inv
    if n[2] < _f4(0.0):
        a, b = _f4(1.0) - abs(y), _f4(1.0) - abs(x)
        x, y = a if x >= _f4(0.0) else -a, b if y >= _f4(0.0) else -b
    half = _f4(0.5 * facings)
    i = min(max(_i8((x + _f4(1.0)) * half), _i8(0)), _i8(facings - 1))
    j = min(max(_i8((y + _f4(1.0)) * half), _i8(0)), _i8(facings - 1))
    return j * _i8(facings) + i
