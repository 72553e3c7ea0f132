"""The point estimate of light that photons in a medium scatter: what a ball around a place holds (E7, M3).

Jensen & Christensen 1998: photons within r of a place add their power Φ times the phase function towards the ray,
over the ball's volume, and give the radiance that the place sends on per length:

    dL/ds = Σ p(dᵢ → −d) Φᵢ / (4/3 π r³)

The ball has a radius that is given, or that of the k-th nearest photon. As for discs (`pmviewer.maps.estimate.nearest`)
the k-th does not count, and the k−1 inner ones in any share of their ball's volume tell the mean of what balls of fixed
radii do: that argument knows nothing of dimensions.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.media.phase import phase
from pmviewer.kernels.memory import float_of_bits, load_u4, stack_get_i8
from pmviewer.kernels.vector import dot, normalize, sub
from pmviewer.maps.estimate.reach import more_in_ball, reach2_of
from pmviewer.maps.photon_words import decode_direction, decode_powers
from pmviewer.maps.search.along_ray import is_in_cell, photon_place, photons_of_row
from pmviewer.maps.search.k_nearest import nearest
from pmviewer.maps.search.simd import ROW_BYTES
from pmviewer.maps.search.stored import stored_place, stored_power

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_u4 = np.uint32
_THIRD = 1.0 / 3.0


@device
def _per_volume(red, green, blue, unit, r2):
    """Those powers in units of the map's over the volume of a ball."""
    r = math.sqrt(_f8(r2))
    volume = _f8(4.0 * math.pi * _THIRD) * r * r * r
    scale = _f8(unit) / volume if volume > 0.0 else 0.0
    return _f4(red * scale), _f4(green * scale), _f4(blue * scale)


@device
def _cells(grid, origin, x, radius, sides):
    """First and last cell along an axis that x − radius … x + radius touches."""
    s = _f8(grid.cells_per_length)
    low, high = (_f8(x) - _f8(radius) - origin) * s, (_f8(x) + _f8(radius) - origin) * s
    last = _i8(sides) - 1
    if high < -1e-4 or low > _f8(sides) + 1e-4:
        return _i8(0), _i8(-1)
    return min(_i8(max(low - 1e-4, 0.0)), last), min(_i8(max(high + 1e-4, 0.0)), last)


@device
def ball_radiance(scene, grid, p, d, radius, paths, column, lobes):
    """Radiance per length (red, green, blue) that photons within the radius of p scatter against the unit direction d
    of a ray in a medium of that column, by the phase function `lobes`, and how many they are. grid: record of a
    PhotonGrid; a radius above the grid's own is lowered to it; paths: the most it is on lattices, in free paths at a
    photon."""
    radius = min(radius, grid.radius)
    r2 = radius * radius
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    count = _i8(0)
    x0, x1 = _cells(grid, _f8(grid.origin_x), p[0], radius, grid.nx)
    y0, y1 = _cells(grid, _f8(grid.origin_y), p[1], radius, grid.ny)
    z0, z1 = _cells(grid, _f8(grid.origin_z), p[2], radius, grid.nz)
    hashed = grid.hash_mask != 0
    step = _i8(1) if hashed else max(x1 - x0 + 1, _i8(1))
    for z in range(z0, z1 + 1):
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1, step):
                first, end = photons_of_row(grid, x, x + step - 1, y, z)
                for i in range(first, end):
                    block, lane, at = photon_place(grid, i)
                    apart = sub(at, p)
                    apart2 = dot(apart, apart)
                    if not apart2 < r2 or (hashed and not is_in_cell(grid, at, x, y, z)):
                        continue
                    reach2 = reach2_of(scene, column, at, r2, paths)
                    if not apart2 < reach2:
                        continue
                    f = _f8(phase(lobes, d, normalize(decode_direction(load_u4(block + 3 * ROW_BYTES, lane)))))
                    f *= _f8(more_in_ball(column, r2, reach2))
                    power = decode_powers(load_u4(block + 4 * ROW_BYTES, lane), load_u4(block + 5 * ROW_BYTES, lane))
                    red += f * _f8(power[0])
                    green += f * _f8(power[1])
                    blue += f * _f8(power[2])
                    count += 1
    return _per_volume(red, green, blue, grid.power_unit, r2), count


@device
def nearest_ball_radiance(scene, tree, p, d, radius, paths, k, share, column, lobes, keys):
    """The same of the k nearest photons, no farther than the radius, counted in the `share` of their ball's volume.

    tree: record of a PhotonKdTree; k: int32, 2 … MAX_K; keys: `pmviewer.maps.search.k_nearest.KEYS` int32 of scratch.
    """
    count, r2 = nearest(tree, p, k, radius * radius, keys, None)
    farthest = _i8(0x7FFFFFFFFFFFFFFF)
    if count == k:  # the k-th, on the rim, is left out
        farthest = _i8(0)
        for j in range(count):
            farthest = max(farthest, stack_get_i8(keys, j))
    least = tree.smallest_radius * tree.smallest_radius
    r2 = max(r2, least)
    part = max(r2 * _f4(math.pow(_f8(share), 2.0 * _THIRD)), least) if share < _f4(1.0) else r2
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    inside = _i8(0)
    for j in range(count):
        key = stack_get_i8(keys, j)
        if key >= farthest or not float_of_bits(_u4(key >> 32)) < part:
            continue
        i = key & _i8(0xFFFFFFFF)
        reach2 = reach2_of(scene, column, stored_place(tree, i), part, paths)
        if not float_of_bits(_u4(key >> 32)) < reach2:
            continue
        f = _f8(more_in_ball(column, part, reach2)) * _f8(
            phase(lobes, d, normalize(decode_direction(load_u4(tree.payload, 3 * i))))
        )
        power = stored_power(tree, i)
        red += f * _f8(power[0])
        green += f * _f8(power[1])
        blue += f * _f8(power[2])
        inside += 1
    return _per_volume(red, green, blue, tree.power_unit, part), inside
