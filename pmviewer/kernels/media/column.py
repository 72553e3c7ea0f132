"""A stretch of a ray in one medium, prepared for many questions: how much light comes through from where, and distances
in proportion to what is stopped.

In scenes without lattices a column is the medium's extinction per channel, and the answers are formulas. On a lattice
the depth up to MARKS places, evenly spread over the part of the stretch in its box, is kept on the stack; a question
walks from the mark before it, so that answers are exact.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import is_a, specialised
from pmviewer.kernels.media.lattice import Line, inside_box, line_of, walk
from pmviewer.kernels.media.medium import depth_of, extinction, shortest_path, transmittance
from pmviewer.kernels.media.varying import OF_EXTINCTION, grid_of, has_grids, thinned
from pmviewer.kernels.memory import stack_get_f4, stack_put_f4

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
MARKS = 64
WORDS = 195
"""Of the stack: three for each mark and the beginning."""


class Column(NamedTuple):
    """Of a scene with lattices: the medium, its lattice (−1: none), extinction and `shortest` mean free path, the ray's
    line there, the part `near` … `far` in the box, the way from mark to mark, and the `marks` (red, green, blue) on the
    stack."""

    medium: Any
    grid: Any
    sigma: Any
    shortest: Any
    line: Any
    near: Any
    far: Any
    step: Any
    marks: Any


@specialised
def column_of(scene, medium, o, d, length, marks):
    """The column from o in the unit direction d; marks: WORDS of the caller's stack, which it lives as long as."""
    if not has_grids(scene):
        return lambda scene, medium, o, d, length, marks: extinction(scene, medium)

    def marked(scene, medium, o, d, length, marks):
        grid, sigma = grid_of(scene, medium, OF_EXTINCTION), extinction(scene, medium)
        shortest = shortest_path(scene, medium)
        nothing = (_f8(0.0), _f8(0.0), _f8(0.0))
        if grid < 0:
            return Column(medium, grid, sigma, shortest, Line(nothing, nothing), 0.0, _f8(length), 0.0, marks)
        line = line_of(scene, grid, o, d)
        near, far = inside_box(scene, grid, line, _f8(0.0), _f8(length))
        far = max(near, far)
        step = (far - near) / MARKS
        depth = nothing
        for k in range(MARKS + 1):
            for c in range(3):
                stack_put_f4(marks, _i8(3 * k + c), _f4(depth[c]))
            if step > 0.0:
                more = walk(scene, grid, line, near + k * step, near + (k + 1) * step, 0, np.inf).depth
                depth = (depth[0] + more[0], depth[1] + more[1], depth[2] + more[2])
        return Column(medium, grid, sigma, shortest, line, near, far, step, marks)

    return marked


@device
def _mark(column, k):
    m = column.marks
    return (
        _f8(stack_get_f4(m, _i8(3 * k))),
        _f8(stack_get_f4(m, _i8(3 * k + 1))),
        _f8(stack_get_f4(m, _i8(3 * k + 2))),
    )


@device
def _depth_to(scene, column, t):
    """Integral of the lattice's numbers up to the distance t, per channel."""
    past = _f8(t) - column.near
    if not (past > 0.0 and column.step > 0.0):
        return _mark(column, 0)
    k = min(_i8(past / column.step), _i8(MARKS))
    depth = _mark(column, k)
    if k == MARKS:
        return depth
    begins = column.near + k * column.step
    more = walk(scene, column.grid, column.line, begins, _f8(t), 0, np.inf).depth
    return depth[0] + more[0], depth[1] + more[1], depth[2] + more[2]


@specialised
def through(scene, column, t):
    """Share of light per channel that comes through from the distance t."""
    if not is_a(column, Column):
        return lambda scene, column, t: (
            _f4(math.exp(-depth_of(column[0], t))),
            _f4(math.exp(-depth_of(column[1], t))),
            _f4(math.exp(-depth_of(column[2], t))),
        )

    def of_lattice(scene, column, t):
        if column.grid < 0:
            return transmittance(scene, column.medium, t)
        return thinned(column.sigma, _depth_to(scene, column, t), 1.0)

    return of_lattice


@specialised
def through_all(scene, medium, column, length):
    """That of the whole column."""
    if not is_a(column, Column):
        return lambda scene, medium, column, length: transmittance(scene, medium, length)
    return lambda scene, medium, column, length: through(scene, column, length)


@device
def stopped_by(column, channel):
    """Share of a channel's light that the column stops."""
    return -math.expm1(-_f8(column.sigma[channel]) * _mark(column, MARKS)[channel])


@device
def where_depth(scene, column, channel, wanted):
    """The distance up to which the channel's integral is `wanted`."""
    low, high = _i8(0), _i8(MARKS)
    while high - low > 1:
        middle = (low + high) // 2
        if _mark(column, middle)[channel] > wanted:
            high = middle
        else:
            low = middle
    near, far = column.near + low * column.step, column.near + high * column.step
    rest = max(wanted - _mark(column, low)[channel], 0.0)
    return walk(scene, column.grid, column.line, near, far, channel, rest).t
