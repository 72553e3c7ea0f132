"""Whether a photon lies on the surface that a look-up is made on, by its normal (`pmviewer.maps.record`)."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.vector import dot

SURELY = 0.25
"""Square of the cosine of 60° and of the sine of 30°: cells of normals reach 30° away from their middles."""

_f4 = np.float32


@device
def is_apart(m, d, n):
    """Whether a surface that is d away from a place with unit normal n is not the same side of the same one, the normal
    there being in the cell with the middle m.

    The middle leans away from n by more than 60°, as a wall from its floor and the inside of a bent sheet from its
    outside. Or the surface lies below the plane of the place and surely has the place before it, as the inside of a box
    has: what is convex has it behind. (The same above the plane is what lies in a hollow.)
    """
    least = _f4(SURELY) * dot(m, m)
    cosine, along = dot(m, n), min(dot(m, d), _f4(0.0))
    return cosine * abs(cosine) < least or (dot(d, n) < _f4(0.0) and along * along > least * dot(d, d))
