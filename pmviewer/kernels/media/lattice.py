"""Numbers on a lattice in a medium, between which values are interpolated trilinearly, and their integral along a ray.

Conventions are Mitsuba 3's `gridvolume`: n numbers along an axis have their places at (i + ½)/n of the lattice's box,
and beyond the outermost ones values stay what they are. Kernels count from half a cell before: number i has its place
at i + 1, so that the box reaches from ½ to n + ½, and what is stored has its outermost numbers twice. Between eight
neighbours (a cell) the value along a ray is a cubic, which two points integrate exactly (Gauss and Legendre): depths
are exact, and need no random numbers. The ray is followed cell by cell (Amanatides and Woo 1987), but not in blocks of
cells whose greatest number, the corners of all cells included, is 0.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4, load_f8, load_i8

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_INF = np.float64(np.inf)

GRID_FRAME, GRID_SIZES, GRID_NUMBERS = 12, 6, 3
"""Lengths of a grid's rows: float64 from world to lattice, by rows; int64 sizes; int32 grids of a medium."""
G_NX, G_NY, G_NZ, G_CHANNELS, G_START, G_BLOCKS = np.arange(6, dtype=np.int64)
"""Columns of the sizes: numbers along the axes and at a place, and where numbers and blocks begin."""
BLOCK = 8
"""Cells along a block's edge."""
_LEAST = 0.5 - 0.5 / math.sqrt(3.0)
_NEWTON = 24


class Line(NamedTuple):
    """A ray in the coordinates of a lattice: origin, change per unit of its own parameter, float64."""

    o: Any
    d: Any


class Walk(NamedTuple):
    """Integral of the numbers along a ray from a parameter to `t` (red, green, blue), where it `stops` or ends."""

    stops: Any
    t: Any
    depth: Any


@device
def line_of(scene, grid, o, d):
    """The Line of a ray from o in direction d."""
    at = scene.grid_frames + _i8(8 * GRID_FRAME) * grid
    p, q = (_f8(o[0]), _f8(o[1]), _f8(o[2])), (_f8(d[0]), _f8(d[1]), _f8(d[2]))
    a, b, c = load_f8(at, 0), load_f8(at, 1), load_f8(at, 2)
    x, u = a * p[0] + b * p[1] + c * p[2] + load_f8(at, 3), a * q[0] + b * q[1] + c * q[2]
    a, b, c = load_f8(at, 4), load_f8(at, 5), load_f8(at, 6)
    y, v = a * p[0] + b * p[1] + c * p[2] + load_f8(at, 7), a * q[0] + b * q[1] + c * q[2]
    a, b, c = load_f8(at, 8), load_f8(at, 9), load_f8(at, 10)
    z, w = a * p[0] + b * p[1] + c * p[2] + load_f8(at, 11), a * q[0] + b * q[1] + c * q[2]
    return Line((x, y, z), (u, v, w))


@device
def size_of(scene, grid, column):
    """One of a grid's sizes."""
    return load_i8(scene.grid_sizes, grid * GRID_SIZES + column)


@device
def _between(scene, at, row, layer, step, x, y, z):
    """The value at (x, y, z) in 0 … 1 of a cell whose first number is at `at`."""
    v = scene.voxels
    a = load_f4(v, at) + x * (load_f4(v, at + step) - load_f4(v, at))
    b = load_f4(v, at + row) + x * (load_f4(v, at + row + step) - load_f4(v, at + row))
    at += layer
    c = load_f4(v, at) + x * (load_f4(v, at + step) - load_f4(v, at))
    e = load_f4(v, at + row) + x * (load_f4(v, at + row + step) - load_f4(v, at + row))
    a += y * (b - a)
    c += y * (e - c)
    return a + z * (c - a)


@device
def _places(scene, grid):
    """Where a grid's numbers begin, and how far apart neighbours are along z, y and x."""
    step = size_of(scene, grid, G_CHANNELS)
    row = step * (size_of(scene, grid, G_NX) + 2)
    return size_of(scene, grid, G_START), row * (size_of(scene, grid, G_NY) + 2), row, step


@device
def value_at(scene, grid, p, inside):
    """The values (red, green, blue) at a point; outside of the box 0 or, unless only `inside` counts, the nearest."""
    w = line_of(scene, grid, p, p).o
    nx, ny, nz = size_of(scene, grid, G_NX), size_of(scene, grid, G_NY), size_of(scene, grid, G_NZ)
    x, y, z = (
        min(max(w[0], 0.5), nx + 0.5),
        min(max(w[1], 0.5), ny + 0.5),
        min(max(w[2], 0.5), nz + 0.5),
    )
    if inside and (x != w[0] or y != w[1] or z != w[2]):
        return _f4(0.0), _f4(0.0), _f4(0.0)
    i, j, k = _i8(x), _i8(y), _i8(z)
    start, layer, row, step = _places(scene, grid)
    at = start + k * layer + j * row + i * step
    x, y, z = _f4(x - i), _f4(y - j), _f4(z - k)
    red = _between(scene, at, row, layer, step, x, y, z)
    if step == 1:
        return red, red, red
    green = _between(scene, at + 1, row, layer, step, x, y, z)
    return red, green, _between(scene, at + 2, row, layer, step, x, y, z)


@device
def inside_box(scene, grid, line, near, far):
    """The part of near … far in the box; far < near where it is missed."""
    for k in range(3):
        most = _f8(size_of(scene, grid, G_NX + k)) + 0.5
        o, d = line.o[k], line.d[k]
        if abs(d) > 0.0:
            a, b = (0.5 - o) / d, (most - o) / d
            near, far = max(near, min(a, b)), min(far, max(a, b))
        elif o < 0.5 or o > most:
            far = near - 1.0
    return near, far


@device
def _cell_mean(scene, at, row, layer, step, channel, cell, line, a, b):
    """Mean of a channel over a … b, which lies in the cell."""
    total = _f4(0.0)
    for k in range(2):
        t = a + (b - a) * (_LEAST if k == 0 else 1.0 - _LEAST)
        x = min(max(line.o[0] + t * line.d[0] - cell[0], 0.0), 1.0)
        y = min(max(line.o[1] + t * line.d[1] - cell[1], 0.0), 1.0)
        z = min(max(line.o[2] + t * line.d[2] - cell[2], 0.0), 1.0)
        total += _between(scene, at + channel, row, layer, step, _f4(x), _f4(y), _f4(z))
    return _f8(total) * 0.5


@device
def _where_it_stops(scene, at, row, layer, step, channel, cell, line, a, b, wanted):
    """The parameter in a … b up to which the channel's integral is `wanted`: Newton's, between bounds."""
    low, high = a, b
    t = 0.5 * (a + b)
    for _ in range(_NEWTON):
        reached = (t - a) * _cell_mean(scene, at, row, layer, step, channel, cell, line, a, t)
        if reached > wanted:
            high = t
        else:
            low = t
        slope = _cell_mean(scene, at, row, layer, step, channel, cell, line, t, t)
        after = t + (wanted - reached) / slope if slope > 0.0 else low
        if not (after > low and after < high):
            after = 0.5 * (low + high)
        if abs(after - t) <= 1e-7 * (b - a):
            return after
        t = after
    return t


@device
def _bound(o, d, index):
    """Where the line leaves the unit of that index."""
    if d > 0.0:
        return (index + 1 - o) / d
    return (index - o) / d if d < 0.0 else _INF


@device
def walk(scene, grid, line, near, far, channel, wanted):
    """The Walk along near … far until the channel's integral exceeds `wanted`, or to the end."""
    depth = (_f8(0.0), _f8(0.0), _f8(0.0))
    t, end = inside_box(scene, grid, line, near, far)
    if not t < end:
        return Walk(False, far, depth)
    o, d = line.o, line.d
    n = (size_of(scene, grid, G_NX), size_of(scene, grid, G_NY), size_of(scene, grid, G_NZ))
    across = (n[0] // BLOCK + 1, n[1] // BLOCK + 1, n[2] // BLOCK + 1)
    start, layer, row, step = _places(scene, grid)
    blocks = size_of(scene, grid, G_BLOCKS)
    of_channel = channel if step > 1 else 0
    # Of blocks and of cells the next ones are found from indices alone: rounding can't bring the walk to a halt.
    bx = min(max(_i8((o[0] + t * d[0]) / BLOCK), 0), across[0] - 1)
    by = min(max(_i8((o[1] + t * d[1]) / BLOCK), 0), across[1] - 1)
    bz = min(max(_i8((o[2] + t * d[2]) / BLOCK), 0), across[2] - 1)
    while t < end:
        tx, ty = _bound(o[0] / BLOCK, d[0] / BLOCK, bx), _bound(o[1] / BLOCK, d[1] / BLOCK, by)
        tz = _bound(o[2] / BLOCK, d[2] / BLOCK, bz)
        leaves = min(min(tx, ty), min(tz, end))
        if load_f4(scene.grid_blocks, blocks + (bz * across[1] + by) * across[0] + bx) > _f4(0.0):
            i = min(max(_i8(o[0] + t * d[0]), bx * BLOCK), min(bx * BLOCK + BLOCK - 1, n[0]))
            j = min(max(_i8(o[1] + t * d[1]), by * BLOCK), min(by * BLOCK + BLOCK - 1, n[1]))
            k = min(max(_i8(o[2] + t * d[2]), bz * BLOCK), min(bz * BLOCK + BLOCK - 1, n[2]))
            while t < leaves:
                ux, uy, uz = _bound(o[0], d[0], i), _bound(o[1], d[1], j), _bound(o[2], d[2], k)
                after = max(min(min(ux, uy), min(uz, leaves)), t)
                at = start + k * layer + j * row + i * step
                cell = (_f8(i), _f8(j), _f8(k))
                own = (after - t) * _cell_mean(scene, at, row, layer, step, of_channel, cell, line, t, after)
                before = depth[of_channel]
                stops = before + own > wanted
                if stops:
                    s = _where_it_stops(scene, at, row, layer, step, of_channel, cell, line, t, after, wanted - before)
                    after, own = s, wanted - before
                if step == 1:
                    depth = (before + own, before + own, before + own)
                else:
                    depth = (
                        depth[0] + (after - t) * _cell_mean(scene, at, row, layer, step, 0, cell, line, t, after),
                        depth[1] + (after - t) * _cell_mean(scene, at, row, layer, step, 1, cell, line, t, after),
                        depth[2] + (after - t) * _cell_mean(scene, at, row, layer, step, 2, cell, line, t, after),
                    )
                if stops:
                    return Walk(True, after, depth)
                t = after
                if ux <= uy and ux <= uz:
                    i += 1 if d[0] > 0.0 else -1
                    if i < bx * BLOCK or i >= min(bx * BLOCK + BLOCK, n[0] + 1):
                        break
                elif uy <= uz:
                    j += 1 if d[1] > 0.0 else -1
                    if j < by * BLOCK or j >= min(by * BLOCK + BLOCK, n[1] + 1):
                        break
                else:
                    k += 1 if d[2] > 0.0 else -1
                    if k < bz * BLOCK or k >= min(bz * BLOCK + BLOCK, n[2] + 1):
                        break
        t = max(t, leaves)
        if tx <= ty and tx <= tz:
            bx += 1 if d[0] > 0.0 else -1
            if bx < 0 or bx >= across[0]:
                break
        elif ty <= tz:
            by += 1 if d[1] > 0.0 else -1
            if by < 0 or by >= across[1]:
                break
        else:
            bz += 1 if d[2] > 0.0 else -1
            if bz < 0 or bz >= across[2]:
                break
    return Walk(False, far, depth)
