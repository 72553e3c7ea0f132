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
from pmviewer.maps.search.grid import BLOCK_BYTES, ROW_BYTES, grid_ranges, lanes_between
from pmviewer.maps.search.kdtree import KEYS
from pmviewer.maps.search.simd import WIDTH, add_power8, count_bits, facing8, within8
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
    ranges, squared, weights, sums = stack_i4(16), stack_i4(8), stack_i4(8), stack_i4(24)
    for lane in range(WIDTH):
        stack_put_f4(weights, lane, _f4(1.0))
    for lane in range(3 * WIDTH):
        stack_put_f4(sums, lane, _f4(0.0))
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    count, pending = _i4(0), _i4(0)
    for k in range(grid_ranges(grid, px, py, pz, radius, ranges)):
        first, end = _i8(stack_get_i4(ranges, 2 * k)), _i8(stack_get_i4(ranges, 2 * k + 1))
        for block in range(first // WIDTH, (end - 1) // WIDTH + 1):
            x = grid.blocks + block * BLOCK_BYTES
            y, z, words, rg, b = (
                x + ROW_BYTES,
                x + 2 * ROW_BYTES,
                x + 3 * ROW_BYTES,
                x + 4 * ROW_BYTES,
                x + 5 * ROW_BYTES,
            )
            mask = _i4(within8(x, y, z, px, py, pz, r2, squared) & lanes_between(first, end, block))
            if mask != 0:
                mask &= facing8(x, y, z, words, px, py, pz, nx, ny, nz, height, class_mask)
            if mask != 0:
                if filter_kind != CONSTANT:
                    lanes = mask
                    while lanes != 0:
                        lane = count_trailing_zeros(lanes)
                        lanes &= lanes - _i4(1)
                        x2 = stack_get_f4(squared, lane) * inverse_r2
                        stack_put_f4(weights, lane, filter_weight(filter_kind, cone_k, x2))
                add_power8(rg, b, mask, weights, sums)
                count += count_bits(mask)
                pending += _i4(1)
                if pending == FLUSH:
                    red, green, blue = _flush(sums, red, green, blue)
                    pending = _i4(0)
    red, green, blue = _flush(sums, red, green, blue)
    scale = _f8(grid.power_unit) / (_f8(filter_disc_mean(filter_kind, cone_k)) * _PI * _f8(radius) * _f8(radius))
    return _f4(red * scale), _f4(green * scale), _f4(blue * scale), count


@device
def irradiance_knn(tree, px, py, pz, nx, ny, nz, k, max_radius, flatness, class_mask, filter_kind, cone_k, rim, share):
    """Irradiance from the k nearest photons, at most `max_radius` away.

    Parameters
    ----------
    tree: record of a PhotonKdTree.
    k: int32, 2 … MAX_K.
    max_radius: float32, finite.
    rim: int32, RIM_LEFT_OUT, RIM_HALF or RIM_WHOLE.
    share: float32, the part of the disc's area in which photons count (`pmviewer.maps.estimate.nearest`), 1 for all.
    others: as for `irradiance_radius`. In a flattened disc the distance is max(d, |h|/flatness), which on the
        tangent plane is d.

    Returns
    -------
    (E red, E green, E blue) float32, number of photons int32, that on the rim included, radius float32.
    """
    keys = stack_i4(KEYS)
    count, rim_place, r2 = nearest_disc(tree, px, py, pz, nx, ny, nz, k, max_radius, flatness, class_mask, share, keys)
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
        w = _f4(0.5) * _f4(rim) * filter_weight(filter_kind, cone_k, _f4(1.0))
        red += w * r
        green += w * g
        blue += w * b
    scale = _f8(tree.power_unit) / (_f8(filter_disc_mean(filter_kind, cone_k)) * _PI * _f8(r2))
    return _f4(red * scale), _f4(green * scale), _f4(blue * scale), _i4(count), np.sqrt(r2)


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


@kernel
def irradiance_at_knn(
    trees,
    points,
    normals,
    k,
    max_radius,
    flatness,
    class_mask,
    filter_kind,
    cone_k,
    rim,
    share,
    i0,
    i1,
    irradiance,
    counts,
    radii,
):
    """`irradiance_knn` at points[i0:i1].

    points, normals, irradiance: (m, 3) float32; counts: (m,) int32; radii: (m,) float32; trees: the record array of a
    PhotonKdTree.
    """
    tree = trees[0]
    for i in range(i0, i1):
        red, green, blue, count, radius = irradiance_knn(
            tree,
            points[i, 0],
            points[i, 1],
            points[i, 2],
            normals[i, 0],
            normals[i, 1],
            normals[i, 2],
            k,
            max_radius,
            flatness,
            class_mask,
            filter_kind,
            cone_k,
            rim,
            share,
        )
        irradiance[i, 0], irradiance[i, 1], irradiance[i, 2] = red, green, blue
        counts[i] = count
        radii[i] = radius
