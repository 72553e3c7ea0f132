"""Lambert's law through a thin sheet: light leaves alike in all directions of the side that it did not come from.

Mitsuba 0.6's `difftrans`, and what `diff_trans` of Mitsuba 3's `principledthin` lets through: paper, cloth, leaves.
Directions are in local coordinates with the normal along z.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.vector import scale
from pmviewer.kernels.warp import square_to_cosine_hemisphere

_f4 = np.float32
_INV_PI = _f4(1.0 / math.pi)


@device
def diffuse_transmission(transmittance, o, i):
    """(f, pdf) of the lobe; 0 where both directions are on one side."""
    if o[2] * i[2] >= _f4(0.0):
        return (_f4(0.0), _f4(0.0), _f4(0.0)), _f4(0.0)
    return scale(transmittance, _INV_PI), abs(i[2]) * _INV_PI


@device
def sample_other_side(o, u, v):
    """A direction with that density."""
    i = square_to_cosine_hemisphere(u, v)
    return (i[0], i[1], -i[2]) if o[2] > _f4(0.0) else i
