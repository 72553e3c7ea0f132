"""Which pixels gather and which are interpolated between them (R7; course guide §6.3.2): the screen-space mask, and
tiles that are divided until interpolation may do.

A tile is x0, y0, x1, y1, its corners among its pixels, so that neighbours share a row of them. All pixels of a tile
that is interpolated are safe and its four corners have gathered. Its error is e = ½·max(|x_i − x_j|/R + |n_i − n_j|)
over its diagonals, R the least of the corners' harmonic mean distances: half a diagonal is what the farthest pixel has
to the nearest corner, in the terms of Ward, Rubinstein and Clear 1988.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.random import hash3
from pmviewer.kernels.vector import dot, luminance, sub
from pmviewer.render.gather.estimation import DIFFUSE, FOOTPRINT, KIND, NORMAL, POINT

NO_RECEIVER, CRITICAL, SAFE = 0, 1, 2
"""Of the mask: nothing that could be estimated, gathered as usual, estimated where tiles allow it."""
LEFT, INTERPOLATED, GATHERED = 0, 1, 2
"""How a pixel gets its indirect light: by the eye pass's own gather, between corners, by a full gather."""

BY_NOISE = np.float32(3.0)
"""Standard errors by which four corners may differ for no reason: their range is two on average, and seldom four."""

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_u4 = np.uint32


@device
def _vector(row, at):
    return row[at], row[at + 1], row[at + 2]


@device
def _continues(a, b, least_cosine, step):
    """Whether the surface of one sample goes on in that of a neighbour."""
    if b[KIND] != _f4(DIFFUSE):
        return False
    n, m = _vector(a, NORMAL), _vector(b, NORMAL)
    if dot(n, m) < least_cosine:
        return False
    d = sub(_vector(b, POINT), _vector(a, POINT))
    most = step * a[FOOTPRINT]
    return abs(dot(d, n)) <= most and abs(dot(d, m)) <= most


@kernel
def mark_safe(samples, width, height, least_cosine, step, mask, first, last):
    """Mask of pixels first … last−1 into uint8 (pixels,): critical where the surface breaks off towards one of the
    eight neighbours.

    samples: float32 (pixels, SAMPLE); least_cosine: between the normals of neighbours; step: most distance of a
    neighbour from the plane of a pixel, in pixel footprints.
    """
    for pixel in range(first, last):
        row = samples[pixel]
        if row[KIND] != _f4(DIFFUSE):
            mask[pixel] = NO_RECEIVER
            continue
        x, y = pixel % width, pixel // width
        safe = True
        for v in range(max(y - 1, 0), min(y + 2, height)):
            for u in range(max(x - 1, 0), min(x + 2, width)):
                if (u != x or v != y) and not _continues(row, samples[v * width + u], least_cosine, step):
                    safe = False
        mask[pixel] = SAFE if safe else CRITICAL


@device
def _all_safe(unsafe, x0, y0, x1, y1):
    """By the summed-area table of the pixels that are not safe."""
    return unsafe[y1 + 1, x1 + 1] - unsafe[y0, x1 + 1] - unsafe[y1 + 1, x0] + unsafe[y0, x0] == 0


@kernel
def ask_corners(tiles, unsafe, how, wanted):
    """Marks in `wanted`, uint8 (h, w), the corners that have yet to gather of tiles whose pixels are all safe.

    tiles: int32 (n, 4); unsafe: int32 (h+1, w+1), summed-area table; how: uint8 (h, w), GATHERED where that is done.
    """
    for i in range(len(tiles)):
        x0, y0, x1, y1 = tiles[i]
        if _all_safe(unsafe, x0, y0, x1, y1):
            for y in (y0, y1):
                for x in (x0, x1):
                    if how[y, x] != GATHERED:
                        wanted[y, x] = 1


@device
def tile_error(samples, told, a, b):
    """½(|x_a − x_b|/R + |n_a − n_b|) of two samples, R the least of their harmonic mean distances."""
    d = sub(_vector(samples[a], POINT), _vector(samples[b], POINT))
    m = sub(_vector(samples[a], NORMAL), _vector(samples[b], NORMAL))
    R = min(told[a, 0], told[b, 0])
    turned = _f8(math.sqrt(dot(m, m)))
    if _f4(0.0) >= R:
        return _f8(np.inf)
    return _f8(0.5) * (_f8(math.sqrt(dot(d, d))) / _f8(R) + turned)


@device
def _contrast(estimates, told, a, b, c, d):
    """Largest less smallest of four luminances, less what noise explains, over their mean."""
    least, most, total, error = _f4(np.inf), _f4(0.0), _f4(0.0), _f4(0.0)
    for pixel in (a, b, c, d):
        Y = luminance((estimates[pixel, 0], estimates[pixel, 1], estimates[pixel, 2]))
        least, most, total, error = min(least, Y), max(most, Y), total + Y, error + told[pixel, 1]
    return (_f4(4.0) * (most - least) - BY_NOISE * error) / total if total > _f4(0.0) else _f4(0.0)


@device
def _may_interpolate(tile, samples, estimates, told, how, limits):
    """Whether the corners of an all-safe tile have gathered and tell enough, however small it is; and whether they
    have gathered at all."""
    x0, y0, x1, y1 = tile
    width = how.shape[1]
    a, b, c, d = y0 * width + x0, y0 * width + x1, y1 * width + x0, y1 * width + x1
    if min(how[y0, x0], how[y0, x1], how[y1, x0], how[y1, x1]) != GATHERED:  # the largest value of all
        return False, False
    error, contrast = limits
    if max(tile_error(samples, told, a, d), tile_error(samples, told, b, c)) > error:
        return False, True
    return _contrast(estimates, told, a, b, c, d) <= contrast, True


@device
def _interpolate(tile, estimates, told, how, level, depth):
    """Bilinear irradiance for the pixels of a tile that have none yet, and share of reprojected directions."""
    x0, y0, x1, y1 = tile
    width = how.shape[1]
    for y in range(y0, y1 + 1):
        v = _f4(y - y0) / _f4(max(y1 - y0, 1))
        for x in range(x0, x1 + 1):
            if how[y, x] != LEFT:
                continue
            u = _f4(x - x0) / _f4(max(x1 - x0, 1))
            out = estimates[y * width + x]
            for k in range(3):
                upper = (_f4(1.0) - u) * estimates[y0 * width + x0, k] + u * estimates[y0 * width + x1, k]
                lower = (_f4(1.0) - u) * estimates[y1 * width + x0, k] + u * estimates[y1 * width + x1, k]
                out[k] = max((_f4(1.0) - v) * upper + v * lower, _f4(0.0))  # v may round to above 1
            out[3] = _f4(1.0)
            upper = (_f4(1.0) - u) * told[y0 * width + x0, 2] + u * told[y0 * width + x1, 2]
            lower = (_f4(1.0) - u) * told[y1 * width + x0, 2] + u * told[y1 * width + x1, 2]
            told[y * width + x, 2] = (_f4(1.0) - v) * upper + v * lower
            how[y, x], level[y, x] = INTERPOLATED, depth


@kernel
def divide_tiles(tiles, unsafe, samples, estimates, told, how, level, depth, rule, parts):
    """Interpolates tiles that allow it and divides the others into `parts`, int32 (4n, 4); returns how many.

    depth: how often the tiles have been divided; level: uint8 (h, w), filled in; rule: the largest error and contrast,
    the width of the smallest tile, the share of those that are interpolated whatever their error, and the key by which
    chance picks them; the rest as above.
    """
    error, contrast, smallest, share, key = rule
    count = 0
    for i in range(len(tiles)):
        x0, y0, x1, y1 = tiles[i]
        ends = max(x1 - x0, y1 - y0) <= smallest
        if _all_safe(unsafe, x0, y0, x1, y1):
            enough, known = _may_interpolate((x0, y0, x1, y1), samples, estimates, told, how, (error, contrast))
            if ends and known and not enough:
                u = _f8(hash3(_u4(key), _u4(x0), _u4(y0))) * _f8(2.0**-32)
                enough = u < share
            if enough:
                _interpolate((x0, y0, x1, y1), estimates, told, how, level, depth)
                continue
        if ends:
            continue
        xm = (x0 + x1) // 2 if x1 - x0 > smallest else x1
        ym = (y0 + y1) // 2 if y1 - y0 > smallest else y1
        for upper in range(2 if ym < y1 else 1):
            for left in range(2 if xm < x1 else 1):
                parts[count, 0], parts[count, 2] = (x0, xm) if left == 0 else (xm, x1)
                parts[count, 1], parts[count, 3] = (y0, ym) if upper == 0 else (ym, y1)
                count += 1
    return count
