"""Irradiance from the photons around a point (E1, E2, E6).

    E = Σ w(dᵢ/r) Φᵢ / (disc_mean · π r²)

over photons closer than r that arrive from the front (n·wi > 0), lie inside the disc |n·(xᵢ − x)| ≤ flatness·r (1 is
the full sphere) and belong to a path class whose bit `1 << class` is set in `class_mask`. Photons that fail are left
out before they count.

With a fixed radius the sum is unbiased but for the blur. With the k nearest photons, r is the distance of the k-th, and
the disc is known to end exactly at a photon: given r, the k−1 inner photons are independent and uniform in the disc, so
that their sum alone is unbiased; stratified photons fill their disc more evenly and the rim photon counts half. Where
fewer than k lie within the largest radius, that is the radius and nothing is corrected. How the disc shrinks from pass
to pass is in `pmviewer.maps.estimate.nearest`.

A pass may put millions of photons into one disc: float32 sums are short, and their sum is float64.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import (
    count_trailing_zeros,
    float_of_bits,
    stack_get_f4,
    stack_get_i4,
    stack_get_i8,
    stack_i4,
    stack_put_f4,
)
from pmviewer.maps.estimate.filters import CONSTANT, filter_disc_mean, filter_weight
from pmviewer.maps.estimate.nearest import nearest_disc
from pmviewer.maps.search.disc import Disc, Place
from pmviewer.maps.search.grid import counted_in_block, grid_ranges
from pmviewer.maps.search.k_nearest import KEYS
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH, add_power8, count_bits
from pmviewer.maps.search.stored import stored_power

RIM_LEFT_OUT, RIM_HALF, RIM_WHOLE = 0, 1, 2
"""What the farthest of k nearest photons counts: nothing (exact for independently scattered photons), half
(Christensen's rule; for stratified first hits), whole."""

FLUSH = 64
"""Float32 sums take at most this many photons before they move to float64."""

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32
_PI = _f8(np.pi)


@device
def _flush(sums, red, green, blue):
    """Moves the eight float32 partial sums of each channel into the float64 sums."""
    for lane in range(WIDTH):
        red += _f8(stack_get_f4(sums, lane))
        green += _f8(stack_get_f4(sums, WIDTH + lane))
        blue += _f8(stack_get_f4(sums, 2 * WIDTH + lane))
    for lane in range(3 * WIDTH):
        stack_put_f4(sums, lane, _f4(0.0))
    return red, green, blue


@device
def irradiance_radius(grid, place, radius, weighting):
    """Irradiance from all photons closer than `radius`.

    Parameters
    ----------
    grid: record of a PhotonGrid; a radius above the grid's own is lowered to it.
    place: a `pmviewer.maps.search.disc.Place`.
    radius: float32.
    weighting: a `pmviewer.maps.estimate.filters.Filter`.

    Returns
    -------
    (E red, E green, E blue) float32 in W per unit area, number of photons int32.
    """
    radius = min(radius, grid.radius)
    r2 = radius * radius
    inverse_r2 = _f4(1.0) / r2
    p = place.p
    filter_kind, cone_k = weighting
    disc = Disc(p, place.n, r2, place.flatness * radius, place.class_mask)
    ranges, squared, weights, sums = stack_i4(16), stack_i4(8), stack_i4(8), stack_i4(24)
    runs = grid_ranges(grid, p[0], p[1], p[2], radius, ranges)
    if runs == 0:  # most look-ups for caustics
        return _f4(0.0), _f4(0.0), _f4(0.0), _i4(0)
    for lane in range(WIDTH):
        stack_put_f4(weights, lane, _f4(1.0))
    for lane in range(3 * WIDTH):
        stack_put_f4(sums, lane, _f4(0.0))
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    count, pending = _i4(0), _i4(0)
    for k in range(runs):
        first, end = _i8(stack_get_i4(ranges, 2 * k)), _i8(stack_get_i4(ranges, 2 * k + 1))
        for block in range(first // WIDTH, (end - 1) // WIDTH + 1):
            mask = counted_in_block(grid, block, first, end, disc, squared)
            if mask != 0:
                if filter_kind != CONSTANT:
                    lanes = mask
                    while lanes != 0:
                        lane = count_trailing_zeros(lanes)
                        lanes &= lanes - _i4(1)
                        x2 = stack_get_f4(squared, lane) * inverse_r2
                        stack_put_f4(weights, lane, filter_weight(filter_kind, cone_k, x2))
                powers = grid.blocks + block * BLOCK_BYTES + 4 * ROW_BYTES
                add_power8(powers, powers + ROW_BYTES, mask, weights, sums)
                count += count_bits(mask)
                pending += _i4(1)
                if pending == FLUSH:
                    red, green, blue = _flush(sums, red, green, blue)
                    pending = _i4(0)
    red, green, blue = _flush(sums, red, green, blue)
    scale = _f8(grid.power_unit) / (_f8(filter_disc_mean(filter_kind, cone_k)) * _PI * _f8(radius) * _f8(radius))
    return _f4(red * scale), _f4(green * scale), _f4(blue * scale), count


@device
def irradiance_knn(tree, place, neighbours, weighting):
    """Irradiance from the k nearest photons.

    Parameters
    ----------
    tree: record of a PhotonKdTree.
    place: as for `irradiance_radius`. In a flattened disc the distance is max(d, |h|/flatness), which on the tangent
        plane is d.
    neighbours: a `pmviewer.maps.estimate.nearest.Neighbours`.
    weighting: as for `irradiance_radius`.

    Returns
    -------
    (E red, E green, E blue) float32, number of photons int32, that on the rim included, radius float32.
    """
    keys = stack_i4(KEYS)
    filter_kind, cone_k = weighting
    count, rim_place, r2 = nearest_disc(tree, place, neighbours, keys)
    inverse_r2 = _f4(1.0) / r2
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    for j in range(count):
        key = stack_get_i8(keys, j)
        r, g, b = stored_power(tree, key & _i8(0xFFFFFFFF))
        w = filter_weight(filter_kind, cone_k, float_of_bits(_u4(key >> 32)) * inverse_r2)
        red += w * r
        green += w * g
        blue += w * b
    if rim_place >= 0:
        count += 1
        r, g, b = stored_power(tree, rim_place)
        w = _f4(0.5) * _f4(neighbours.rim) * filter_weight(filter_kind, cone_k, _f4(1.0))
        red += w * r
        green += w * g
        blue += w * b
    scale = _f8(tree.power_unit) / (_f8(filter_disc_mean(filter_kind, cone_k)) * _PI * _f8(r2))
    return _f4(red * scale), _f4(green * scale), _f4(blue * scale), _i4(count), np.sqrt(r2)


@kernel
def irradiance_at_radius(grids, points, normals, radius, flatness, class_mask, weighting, i0, i1, irradiance, counts):
    """`irradiance_radius` at points[i0:i1].

    points, normals, irradiance: (m, 3) float32; counts: (m,) int32; grids: the record array of a PhotonGrid; flatness,
    class_mask: as in a `Place`.
    """
    grid = grids[0]
    for i in range(i0, i1):
        p, n = (points[i, 0], points[i, 1], points[i, 2]), (normals[i, 0], normals[i, 1], normals[i, 2])
        red, green, blue, count = irradiance_radius(grid, Place(p, n, flatness, class_mask), radius, weighting)
        irradiance[i, 0], irradiance[i, 1], irradiance[i, 2] = red, green, blue
        counts[i] = count


@kernel
def irradiance_at_knn(
    trees, points, normals, neighbours, flatness, class_mask, weighting, i0, i1, irradiance, counts, radii
):
    """`irradiance_knn` at points[i0:i1].

    points, normals, irradiance: (m, 3) float32; counts: (m,) int32; radii: (m,) float32; trees: the record array of a
    PhotonKdTree; flatness, class_mask: as in a `Place`.
    """
    tree = trees[0]
    for i in range(i0, i1):
        p, n = (points[i, 0], points[i, 1], points[i, 2]), (normals[i, 0], normals[i, 1], normals[i, 2])
        red, green, blue, count, radius = irradiance_knn(tree, Place(p, n, flatness, class_mask), neighbours, weighting)
        irradiance[i, 0], irradiance[i, 1], irradiance[i, 2] = red, green, blue
        counts[i] = count
        radii[i] = radius
