"""Kernels by which photons start in strata of emission (`pmviewer.photons.emission.strata`). They know nothing of the
scene's description, or every change of it would compile the light pass again."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.dimensions import STRATUM
from pmviewer.kernels.lights.light import emit_from
from pmviewer.kernels.memory import load_f4, load_f8, load_i4
from pmviewer.kernels.random import INDEPENDENT, draw1
from pmviewer.photons.emission.window import WINDOW_FIELDS

STRATA_DTYPE = np.dtype(
    [
        ("strata", "i4"),  # their number
        ("tests", "i4"),  # whether trajectory i starts in stratum i modulo their number, its photons' light being i
        ("cdf", "i8"),  # float64 (strata,), cumulative: their shares of the trajectories
        ("light", "i8"),  # int32 (strata,)
        ("first", "i8"),  # int32 (n_lights,): each light's first stratum
        ("cells", "i8"),  # int32 (n_lights, 4): divisions of the place's two numbers and of the direction's
        ("weight", "i8"),  # float32 (strata,): power of their photons in units of the map's
        *WINDOW_FIELDS,
    ],
    align=True,
)

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_BELOW_ONE = _f4(0.99999994)


@device
def _stratum(strata, u):
    """The first whose cumulative share is above u, float64 in [0, 1)."""
    low, high = _i8(0), _i8(strata.strata) - 1
    while low < high:
        middle = (low + high) >> 1
        if u < load_f8(strata.cdf, middle):
            high = middle
        else:
            low = middle + 1
    return low


@device
def _within(cell, cells, u):
    return min((_f4(cell) + u) / _f4(cells), _BELOW_ONE)


@device
def emit_stratified(scene, strata, i, seed, index, u_pick, position, direction):
    """As `pmviewer.photons.projection.projected.emission`, of trajectory i of a pass."""
    if strata.tests != 0:
        s = _i8(i) % _i8(strata.strata)
    else:  # a share may be near the 2⁻²⁴ of one random number
        fine = draw1(INDEPENDENT, seed, index, STRATUM)
        s = _stratum(strata, _f8(u_pick) + _f8(fine) * _f8(2.0**-24))
    light = _i8(load_i4(strata.light, s))
    cell = s - _i8(load_i4(strata.first, light))
    a, b = _i8(load_i4(strata.cells, 4 * light)), _i8(load_i4(strata.cells, 4 * light + 1))
    c, d = _i8(load_i4(strata.cells, 4 * light + 2)), _i8(load_i4(strata.cells, 4 * light + 3))
    place = (_within(cell // (b * c * d), a, position[0]), _within(cell // (c * d) % b, b, position[1]))
    way = (_within(cell // d % c, c, direction[0]), _within(cell % d, d, direction[1]))
    p, d_out, beta = emit_from(scene, light, place, way)
    if strata.tests != 0:
        light = _i8(i) & _i8(0xFFFF)
    return p, d_out, beta, light, load_f4(strata.weight, s)
