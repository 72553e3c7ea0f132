"""Whether a photon lies on the surface that a look-up is made on, by its normal (`pmviewer.maps.record`)."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.vector import dot

SURELY = 0.25
"""Square of the sine of 30°: with more of a cosine, squared, a cell of normals is on one side of a plane whole."""

_f4 = np.float32


@device
def is_apart(m, d, n):
    """Whether a surface that is d away from a place with unit normal n is surely not the same side of the same one,
    wherever in the cell with the middle m its normal is.

    Its normal points away from n, as on the inside of a bent sheet. Or it lies below the plane of the place and has the
    place before it, as the inside of a box has: what is convex has it behind. (The other way round, behind a wall,
    what counts wrongly makes up for what the disc lacks at the foot of that: without it more is wrong than with it.)
    """
    least = _f4(SURELY) * dot(m, m)
    cosine, along = dot(m, n), min(dot(m, d), _f4(0.0))
    return cosine * abs(cosine) < least or (dot(d, n) < _f4(0.0) and along * along > least * dot(d, d))
