"""Directions by the cells of a hemisphere, filled with the light of photons times the BSDF (Jensen 1995, "Importance
Driven Path Tracing using the Photon Map").

Cells are rings of equal sin² by sectors of equal azimuth around the shading normal: each holds the same share of
cosine-weighted directions, so that evenly spread light fills them evenly. A cell is drawn by its share, and a direction
within it by the cosine. Every cell has at least FLOOR of an even share: directions without photons are drawn, too.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.scattering import STORED, bsdf_f, shading_normal
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import stack_get_f4, stack_put_f4
from pmviewer.kernels.vector import basis, dot, from_basis, luminance

RINGS, SECTORS = 8, 16
CELLS = RINGS * SECTORS
FLOOR = np.float32(0.2)

_f4 = np.float32
_i8 = np.int64
_INV_PI = _f4(1.0 / math.pi)
_TURN = _f4(2.0 * math.pi)


@device
def cell_of(n, w):
    """Cell of a unit direction above the surface with normal n, and its cosine."""
    s, t = basis(n)
    x, y, z = dot(w, s), dot(w, t), dot(w, n)
    ring = min(_i8((_f4(1.0) - z * z) * _f4(RINGS)), _i8(RINGS - 1))
    turn = _f4(math.atan2(y, x)) / _TURN
    if turn < _f4(0.0):
        turn += _f4(1.0)
    return max(ring, _i8(0)) * SECTORS + min(_i8(turn * _f4(SECTORS)), _i8(SECTORS - 1)), z


@device
def fill_cells(found, at, m, b, wo):
    """Shares of the cells from m photons (`pmviewer.render.gather.guide.photons_near`), into `found` from word `at`
    on."""
    n = shading_normal(b)
    for cell in range(CELLS):
        stack_put_f4(found, at + cell, _f4(0.0))
    total = _f4(0.0)
    for j in range(m):
        w = (stack_get_f4(found, 4 * j), stack_get_f4(found, 4 * j + 1), stack_get_f4(found, 4 * j + 2))
        light = stack_get_f4(found, 4 * j + 3) * luminance(bsdf_f(b, STORED, wo, w))
        if light > _f4(0.0):
            cell, _ = cell_of(n, w)
            stack_put_f4(found, at + cell, stack_get_f4(found, at + cell) + light)
            total += light
    even = _f4(1.0 / CELLS)
    for cell in range(CELLS):
        share = even
        if total > _f4(0.0):
            share = FLOOR * even + (_f4(1.0) - FLOOR) * stack_get_f4(found, at + cell) / total
        stack_put_f4(found, at + cell, share)


@device
def cell_pdf(found, at, b, wi):
    """Density per solid angle of `cell_direction`."""
    cell, cos = cell_of(shading_normal(b), wi)
    if not cos > _f4(0.0):
        return _f4(0.0)
    return stack_get_f4(found, at + cell) * _f4(CELLS) * cos * _INV_PI


@device
def cell_direction(found, at, b, u, v, u_pick):
    """A direction within a cell, and its density."""
    below, cell = _f4(0.0), _i8(0)
    share = stack_get_f4(found, at)
    while cell < CELLS - 1 and u_pick >= below + share:
        below += share
        cell += 1
        share = stack_get_f4(found, at + cell)
    sin2 = (_f4(cell // SECTORS) + u) * _f4(1.0 / RINGS)
    phi = (_f4(cell % SECTORS) + v) * (_TURN * _f4(1.0 / SECTORS))
    sin, cos = _f4(math.sqrt(sin2)), _f4(math.sqrt(max(_f4(1.0) - sin2, _f4(0.0))))
    wi = from_basis(shading_normal(b), sin * _f4(math.cos(phi)), sin * _f4(math.sin(phi)), cos)
    return wi, share * _f4(CELLS) * cos * _INV_PI
