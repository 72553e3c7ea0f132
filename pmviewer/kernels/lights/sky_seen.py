"""Which part of an image environment is seen from where: through windows, little of it.

Space is cut into cubes, and tables as those of `pmviewer.kernels.lights.sky_facing` stand for the cubes from which
little of the sky is seen: of each cell of the square, what its light counts on a surface that faces a direction, as far
as it arrives there. A part UNSEEN of the samples is as if all of it did: what the few rays that made a table did not
find is sampled, too. `pmviewer.engine.stages.sky_seen` makes them.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4, load_i4

SIDE = 16
"""Cells of the square along each side."""
TABLE = SIDE + SIDE * SIDE
"""Numbers of a table: cumulative shares of its rows, then of the cells within each."""
CUBES = 16
"""Along each side of the space that is cut."""
SEEN_FACINGS = 4
"""Along each side of the octahedral map of the directions that surfaces in a cube face."""
UNSEEN = 0.25
"""With less, what a table takes for unseen and is not is met rarely and counts more: relative variance of irradiance in
a living room 20 with 0.25, 28 with 0.1."""

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


@device
def seen_table(scene, p, n):
    """Address of the table for a surface at p that faces n; 0 where there is none."""
    frame, side = scene.sky_frame, _i8(CUBES)
    if frame == 0:
        return _i8(0)
    inv = load_f4(frame, _i8(3))
    x = (p[0] - load_f4(frame, _i8(0))) * inv
    y = (p[1] - load_f4(frame, _i8(1))) * inv
    z = (p[2] - load_f4(frame, _i8(2))) * inv
    most = _f4(CUBES)
    if not (x >= _f4(0.0) and y >= _f4(0.0) and z >= _f4(0.0) and x < most and y < most and z < most):
        return _i8(0)
    number = _i8(load_i4(scene.sky_cubes, (_i8(z) * side + _i8(y)) * side + _i8(x)))
    if number < 0:
        return _i8(0)
    return scene.sky_seen + (number * _i8(SEEN_FACINGS * SEEN_FACINGS) + facing_cell(n, SEEN_FACINGS)) * _i8(4 * TABLE)
