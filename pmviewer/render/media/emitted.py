"""What media emit along a stretch of a ray."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.media.column import MARKS, WORDS, column_of, through_all
from pmviewer.kernels.media.glow import near_a_glow, near_glow
from pmviewer.kernels.media.lattice import line_of, walk
from pmviewer.kernels.media.medium import emission_of, emitted_along, has_media
from pmviewer.kernels.media.varying import OF_EMISSION, OF_EXTINCTION, emission_at, grid_of, has_grids, thinned
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.vector import add, along, largest, mul, scale
from pmviewer.render.media.through import next_stretch

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))
_WHITE = (_f4(1.0), _f4(1.0), _f4(1.0))
_MOST_STEPS = 64
"""Parts of the way from one mark to the next."""


@specialised
def emitted_in(scene, medium, column, o, d, length):
    """Radiance that the column sends out at its beginning: ∫ ε T ds."""
    if not has_grids(scene):
        return lambda scene, medium, column, o, d, length: emitted_along(scene, medium, length)

    def of_lattice(scene, medium, column, o, d, length):
        if not largest(emission_of(scene, medium)) > _f4(0.0):
            return _BLACK
        if column.grid < 0:
            return emitted_along(scene, medium, length)
        return _emitted_on_lattice(scene, medium, column, o, d)

    return of_lattice


@device
def _finest(scene, medium, column, o, d):
    """Numbers of the finer of the lattices of extinction and emission that a mark's step passes."""
    most = 0.0
    for which in (OF_EXTINCTION, OF_EMISSION):
        grid = grid_of(scene, medium, which)
        if grid >= 0:
            line = line_of(scene, grid, o, d)
            most = max(most, max(abs(line.d[0]), max(abs(line.d[1]), abs(line.d[2]))))
    return most * column.step


@device
def _emitted_on_lattice(scene, medium, column, o, d):
    """By parts half a number long at most: the mean emission of two points of each, times what the part stops over its
    depth, times the transmittance up to it."""
    total = _BLACK
    if not column.step > 0.0:
        return total
    parts = min(_i8(2.0 * _finest(scene, medium, column, o, d)) + _i8(1), _i8(_MOST_STEPS))
    h = column.step / parts
    sigma, T = column.sigma, _WHITE
    for i in range(MARKS * parts):
        a = column.near + i * h
        emission = add(
            emission_at(scene, medium, along(o, d, _f4(a + 0.2113248654 * h))),
            emission_at(scene, medium, along(o, d, _f4(a + 0.7886751346 * h))),
        )
        depth = walk(scene, column.grid, column.line, a, a + h, 0, np.inf).depth
        if largest(emission) > _f4(0.0):
            share = (
                _gap(_f8(sigma[0]) * depth[0]),
                _gap(_f8(sigma[1]) * depth[1]),
                _gap(_f8(sigma[2]) * depth[2]),
            )
            total = add(total, mul(T, mul(share, scale(emission, _f4(0.5 * h)))))
        T = mul(T, thinned(sigma, depth, 1.0))
        if not largest(T) > _f4(1e-9):
            break
    return total


@device
def _gap(depth):
    """(1 − exp(−τ))/τ"""
    return _f4(-math.expm1(-depth) / depth) if depth > 1e-6 else _f4(1.0)


@device
def emitted_on_the_way(scene, ray, hit, x, everything):
    """Radiance that media send back along a ray that left x, up to what it met: `everything`, or of media that light
    samples at x leave out (`pmviewer.kernels.media.glow`)."""
    total, T = _BLACK, _WHITE
    o, medium, left = ray.o, ray.medium, hit.t
    marks = stack_i4(WORDS)
    for k in range(hit.crossed + 1):
        length, beyond, next_medium = next_stretch(scene, hit.crossed - k, o, ray.d, medium, left)
        if medium >= 0:
            column = column_of(scene, medium, o, ray.d, length, marks)
            if everything or near_glow(scene, medium, x):
                total = add(total, mul(T, emitted_in(scene, medium, column, o, ray.d, length)))
            T = mul(T, through_all(scene, medium, column, length))
        o, medium = beyond, next_medium
        left -= length
    return total


@specialised
def emitted_nearby(scene, ray, hit, x):
    """The same of media that light samples at x leave out."""
    if not has_media(scene):
        return lambda scene, ray, hit, x: _BLACK

    def nearby(scene, ray, hit, x):
        return emitted_on_the_way(scene, ray, hit, x, False) if near_a_glow(scene, x) else _BLACK

    return nearby
