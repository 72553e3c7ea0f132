"""Irradiance from the photons around a point (E1, E2, E6).

    E = Σ w(dᵢ/r) Φᵢ / (disc_mean · π r²)

over photons closer than r that arrive from the front (n·wi > 0), lie inside the disc |n·(xᵢ − x)| ≤ flatness·r (1 is
the full sphere) and belong to a path class whose bit `1 << class` is set in `class_mask`. Photons that fail are left
out before they count.

With a fixed radius the sum is unbiased but for the blur. Sums run in float64: a pass may put millions of photons into
one disc.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.jit import device, kernel
from pmviewer.kernels.memory import count_trailing_zeros, load_f4, load_u4, stack_get_f4, stack_get_i4, stack_i4
from pmviewer.maps.filters import CONSTANT, filter_disc_mean, filter_weight
from pmviewer.maps.grid import grid_ranges
from pmviewer.maps.record import decode_direction, decode_power
from pmviewer.maps.simd import WIDTH, within8

ALL_CLASSES = 0b1111
"""Class mask that takes photons of every path class."""

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32
_PI = _f8(np.pi)


@device
def accepts(photons, i, px, py, pz, nx, ny, nz, height, class_mask):
    """Whether photon i of a grid's or tree's record arrives from the front of the point (p, n), within `height` of its
    tangent plane, on a path of a wanted class."""
    word = load_u4(photons.payload, 3 * i)
    if (class_mask >> _i4((word >> _u4(6)) & _u4(3))) & 1 == 0:
        return False
    wx, wy, wz = decode_direction(word)
    if not nx * wx + ny * wy + nz * wz > _f4(0.0):
        return False
    dx, dy, dz = load_f4(photons.x, i) - px, load_f4(photons.y, i) - py, load_f4(photons.z, i) - pz
    return abs(nx * dx + ny * dy + nz * dz) <= height


@device
def stored_power(photons, i):
    """Red, green, blue power of photon i in units of the map's power."""
    rg, b = load_u4(photons.payload, 3 * i + 1), load_u4(photons.payload, 3 * i + 2)
    return decode_power(rg & _u4(0xFFFF)), decode_power(rg >> _u4(16)), decode_power(b & _u4(0xFFFF))


@device
def irradiance_radius(grid, px, py, pz, nx, ny, nz, radius, flatness, class_mask, filter_kind, cone_k):
    """Irradiance from all photons closer than `radius`.

    Parameters
    ----------
    grid: record of a PhotonGrid; a radius above the grid's own is lowered to it.
    px, py, pz; nx, ny, nz: float32 point and unit normal.
    radius, flatness: float32.
    class_mask, filter_kind: int32; filter_kind is an index into FILTERS.
    cone_k: float32 ≥ 1, used by the cone alone.

    Returns
    -------
    (E red, E green, E blue) float32 in W per unit area, number of photons int32.
    """
    radius = min(radius, grid.radius)
    r2 = radius * radius
    inverse_r2 = _f4(1.0) / r2
    height = flatness * radius
    ranges = stack_i4(16)
    squared = stack_i4(8)
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    count = _i4(0)
    for k in range(grid_ranges(grid, px, py, pz, radius, ranges)):
        j, end = _i8(stack_get_i4(ranges, 2 * k)), _i8(stack_get_i4(ranges, 2 * k + 1))
        while j < end:
            mask = within8(grid.x, grid.y, grid.z, j, px, py, pz, r2, squared)
            if end - j < WIDTH:
                mask &= _i4((1 << (end - j)) - 1)
            while mask != 0:
                lane = count_trailing_zeros(mask)
                mask &= mask - _i4(1)
                i = j + lane
                if accepts(grid, i, px, py, pz, nx, ny, nz, height, class_mask):
                    r, g, b = stored_power(grid, i)
                    if filter_kind != CONSTANT:
                        w = filter_weight(filter_kind, cone_k, stack_get_f4(squared, lane) * inverse_r2)
                        r, g, b = w * r, w * g, w * b
                    red += r
                    green += g
                    blue += b
                    count += _i4(1)
            j += WIDTH
    scale = _f8(grid.power_unit) / (_f8(filter_disc_mean(filter_kind, cone_k)) * _PI * _f8(radius) * _f8(radius))
    return _f4(red * scale), _f4(green * scale), _f4(blue * scale), count


@kernel
def irradiance_at_radius(
    grids, points, normals, radius, flatness, class_mask, filter_kind, cone_k, i0, i1, irradiance, counts
):
    """`irradiance_radius` at points[i0:i1].

    points, normals, irradiance: (m, 3) float32; counts: (m,) int32; grids: the record array of a PhotonGrid.
    """
    grid = grids[0]
    for i in range(i0, i1):
        red, green, blue, count = irradiance_radius(
            grid,
            points[i, 0],
            points[i, 1],
            points[i, 2],
            normals[i, 0],
            normals[i, 1],
            normals[i, 2],
            radius,
            flatness,
            class_mask,
            filter_kind,
            cone_k,
        )
        irradiance[i, 0], irradiance[i, 1], irradiance[i, 2] = red, green, blue
        counts[i] = count
