"""Directions through cones around those of photons (Pharr §0.4): a photon is picked, then a direction in its cone.

The density is exact and integrates to 1 over the sphere: (1/m)·Σⱼ [ω in cone j] / (2π(1 − cos θ)). Parts of cones may
lie below the surface; such directions are drawn and add nothing.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import stack_get_f4
from pmviewer.kernels.vector import from_basis
from pmviewer.kernels.warp import square_to_cone

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64

HALF_ANGLE = math.radians(10.0)
ONE_MINUS_COS = _f4(1.0 - math.cos(HALF_ANGLE))
COS = _f4(math.cos(HALF_ANGLE))
_INV_CONE = _f4(1.0 / (2.0 * math.pi * (1.0 - math.cos(HALF_ANGLE))))


@device
def cones_around(found, m, wi):
    """How many of m photons have wi in their cone. `found` as in `pmviewer.render.gather.guide.photons_near`."""
    inside = _i4(0)
    for j in range(m):
        cos = (
            stack_get_f4(found, 4 * j) * wi[0]
            + stack_get_f4(found, 4 * j + 1) * wi[1]
            + stack_get_f4(found, 4 * j + 2) * wi[2]
        )
        if cos >= COS:
            inside += _i4(1)
    return inside


@device
def cone_pdf(found, m, wi):
    """Density per solid angle of `cone_direction`."""
    return _f4(cones_around(found, m, wi)) * (_INV_CONE / _f4(m))


@device
def cone_direction(found, m, u, v, u_pick):
    """A direction in the cone of one of m photons, and its density."""
    j = min(_i8(u_pick * _f4(m)), m - 1)
    local = square_to_cone(u, v, ONE_MINUS_COS)
    axis = stack_get_f4(found, 4 * j), stack_get_f4(found, 4 * j + 1), stack_get_f4(found, 4 * j + 2)
    wi = from_basis(axis, local[0], local[1], local[2])
    # Rounding may put a direction out of the cone that it was drawn from.
    inside = max(cones_around(found, m, wi), _i4(1))
    return wi, _f4(inside) * (_INV_CONE / _f4(m))
