"""Importance further back (I6): importons scattered on from where the picture looks a map up.

Light takes a path and importance takes it backwards, so the light pass's own kernel does it: "photons" start at
importons, and where they arrive surfaces will send real photons on to important places. Surfaces are taken to send on
FIRST of what arrives there; what lies between is exact. What comes of it decides how many photons are emitted where,
and never what they count.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.surface import gap_of, leave
from pmviewer.kernels.vector import from_basis
from pmviewer.kernels.warp import square_to_cosine_hemisphere

FIRST = 0.5
SCATTERED_DTYPE = np.dtype(
    [
        ("scattered", "i4"),  # how many importons
        ("places", "i8"),  # float32 (n, 7): position, unit normal, importance
    ],
    align=True,
)

_f4 = np.float32
_i8 = np.int64


def scattered_record(places: NDArray[np.float32]) -> NDArray[np.void]:
    """For kernels, in the place of the records of projection maps: trajectory i starts at row i modulo n of places
    (n, 7), C-contiguous. Valid while that lives."""
    records = np.zeros(2, SCATTERED_DTYPE)
    records["scattered"], records["places"] = len(places), places.ctypes.data
    return records


@device
def emit_scattered(scattered, i, direction):
    """Origin, direction and importance of trajectory i."""
    row = 7 * (_i8(i) % _i8(scattered.scattered))
    p = (load_f4(scattered.places, row), load_f4(scattered.places, row + 1), load_f4(scattered.places, row + 2))
    n = (load_f4(scattered.places, row + 3), load_f4(scattered.places, row + 4), load_f4(scattered.places, row + 5))
    local = square_to_cosine_hemisphere(direction[0], direction[1])
    d = from_basis(n, local[0], local[1], local[2])
    gap = gap_of(n, abs(p[0]), abs(p[1]), abs(p[2]))
    return leave(p, n, gap, d[0], d[1], d[2]), d, load_f4(scattered.places, row + 6)
