"""Photons into cell order, in pieces that threads can share (M2).

A stable counting sort in two levels, coarse buckets of cells first, then cells within a bucket, so that its scattered
writes stay within the caches. On the first level each piece of the photons counts its own, and where it writes follows
from the counts of the pieces before it; on the second, buckets are shared out. The order does not depend on the pieces.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.search.simd import WIDTH

_f4 = np.float32
_u4 = np.uint32
_i8 = np.int64


def even_ends(n: int, pieces: int) -> list[tuple[int, int]]:
    """First and last + 1 of so many pieces of n things."""
    at = np.linspace(0, n, pieces + 1).astype(int).tolist()
    return list(pairwise(at))


def even_parts(begins: NDArray[np.int64], parts: int) -> list[tuple[int, int]]:
    """First and last + 1 of the buckets of up to so many parts that hold about as many things each; bucket b holds
    begins[b] … begins[b + 1] − 1."""
    wanted = np.linspace(0, begins[-1], parts + 1)
    at = np.searchsorted(begins, wanted)
    at[0], at[-1] = 0, len(begins) - 1
    at = np.unique(at)
    return list(pairwise(at.tolist()))


def places_of(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """From the counts (pieces, buckets) where each piece begins in each bucket, the same shape, and where buckets
    begin, (buckets + 1,)."""
    pieces, buckets = counts.shape
    ends = np.cumsum(counts.T.ravel()).reshape(buckets, pieces)
    begins = np.concatenate([[0], ends[:, -1]])
    return np.ascontiguousarray((ends - counts.T).T), begins


@kernel
def bounds_of_piece(photons, words, classes, first, last, box, kept):
    """Bounding box of photons first … last−1 of (n, 6), seen as uint32 in `words`, whose path class has its bit in
    `classes`, into box (2, 3) float32, and their number into kept (1,) int64. Coordinates that are not numbers are left
    out of the box."""
    x0, y0, z0 = _f4(np.inf), _f4(np.inf), _f4(np.inf)
    x1, y1, z1 = _f4(-np.inf), _f4(-np.inf), _f4(-np.inf)
    count = _i8(0)
    for i in range(first, last):
        if (classes >> _i8((words[i, 3] >> _u4(6)) & _u4(3))) & 1 == 0:
            continue
        count += 1
        x, y, z = photons[i, 0], photons[i, 1], photons[i, 2]
        x0, y0, z0 = min(x0, x), min(y0, y), min(z0, z)
        x1, y1, z1 = max(x1, x), max(y1, y), max(z1, z)
    box[0, 0], box[0, 1], box[0, 2] = x0, y0, z0
    box[1, 0], box[1, 1], box[1, 2] = x1, y1, z1
    kept[0] = count


@kernel
def sort_by_bucket(keys, shift, places, sorted_keys, order, first, last):
    """Things first … last−1 with their cells `keys` (−1: none) to their buckets of 2^shift cells: cell and number into
    sorted_keys and order, (n,) int32. places: (buckets,) int64, where those of this piece begin; changed."""
    for i in range(first, last):
        key = keys[i]
        if key >= 0:
            place = places[key >> shift]
            places[key >> shift] = place + 1
            sorted_keys[place] = key
            order[place] = i


@kernel
def sort_by_cell(words, sorted_keys, order, begins, shift, blocks, starts, first, last):
    """Photons `words` (…, 6) uint32 of buckets first … last−1 into cell order: `blocks` (⌈n/8⌉, 6, 8), and where each
    cell begins into `starts`, whose last entry is left alone."""
    ends = np.empty(1 << shift, np.int64)
    cells = len(starts) - 1
    for b in range(first, last):
        begin, end = begins[b], begins[b + 1]
        first_cell = b << shift
        width = min(1 << shift, cells - first_cell)
        ends[:width] = 0
        for i in range(begin, end):
            ends[sorted_keys[i] - first_cell] += 1
        total = begin
        for c in range(width):
            starts[first_cell + c] = total
            total += ends[c]
            ends[c] = starts[first_cell + c]
        for i in range(begin, end):
            c = sorted_keys[i] - first_cell
            place = ends[c]
            ends[c] = place + 1
            j = order[i]
            for w in range(6):
                blocks[place // WIDTH, w, place % WIDTH] = words[j, w]
