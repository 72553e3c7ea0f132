"""Which part of an image environment is seen from where: through windows, little of it.

Space is cut into cubes, and tables as those of `pmviewer.kernels.lights.sky_facing` stand for the cubes from which
little of the sky is seen: of each cell of the square, what its light counts on a surface that faces a direction, as far
as it arrives there. `pmviewer.engine.stages.sky_seen` makes them.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.lights.sky_square import TABLE, facing_cell
from pmviewer.kernels.memory import load_f4, load_i4

CUBES = 16
"""Along each side of the space that is cut."""
SEEN_FACINGS = 4
"""Along each side of the octahedral map of the directions that surfaces in a cube face."""

_f4 = np.float32
_i8 = np.int64


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
