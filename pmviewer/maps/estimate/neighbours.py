"""The photons of one look-up, a batch at a time, whichever map they come from.

The disc estimate of `pmviewer.maps.estimate.estimate` sums photons as it finds them. Estimates that go through the
photons more than once, or ask where they lie, are written against three functions that compile for the kind of map they
are given: `search` finds the disc, `next_batch` walks over its photons, `place_of` and `power_of` read one.

With the k nearest, the k-th ends the disc and is kept apart: given the disc, the others are spread in it as photons in
a disc of a fixed radius are.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.memory import (
    count_trailing_zeros,
    float_of_bits,
    load_f4,
    load_u4,
    stack_get_f4,
    stack_get_i4,
    stack_get_i8,
    stack_put_f4,
    stack_put_i4,
)
from pmviewer.maps.estimate.nearest import Neighbours, nearest_disc
from pmviewer.maps.photon_words import decode_powers
from pmviewer.maps.search.disc import Disc, Place
from pmviewer.maps.search.grid import counted_in_block, grid_ranges
from pmviewer.maps.search.k_nearest import KEYS
from pmviewer.maps.search.simd import BLOCK_BYTES, WIDTH
from pmviewer.maps.search.stored import stored_power
from pmviewer.maps.variant import is_kdtree

FOUND_WORDS, SQUARED_WORDS, BATCH_WORDS = KEYS, WIDTH, 2 * WIDTH
"""int32 elements of the three pieces of scratch of a look-up: what was found, eight squared distances, the batch."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32


@specialised
def search(photons, eye, radius, p, n, class_mask, scratch):
    """Start a look-up around the point p with unit normal n.

    Parameters
    ----------
    photons: record of a grid (all photons within `radius`) or of a kd-tree (the k nearest within it).
    eye: EYE_DTYPE record: `k`, `share` and `flatness`.
    scratch: three pointers to FOUND_WORDS, SQUARED_WORDS and BATCH_WORDS words.

    Returns
    -------
    What `next_batch` needs to go on; the squared radius of the disc, float32; the place of the photon that ends it,
    int64, −1 with a fixed radius, where there are fewer than k, and in a part of the disc.
    """
    if is_kdtree(photons):

        def k_nearest(photons, eye, radius, p, n, class_mask, scratch):
            neighbours = Neighbours(eye.k, radius, eye.rim, eye.share)
            count, rim, r2 = nearest_disc(photons, Place(p, n, eye.flatness, class_mask), neighbours, scratch[0])
            return count, r2, rim

        return k_nearest

    def within(photons, eye, radius, p, n, class_mask, scratch):
        radius = min(radius, photons.radius)
        runs = grid_ranges(photons, p[0], p[1], p[2], radius, scratch[0])
        r2 = radius * radius
        return (_i8(runs), Disc(p, n, r2, eye.flatness * radius, class_mask)), r2, _i8(-1)

    return within


@specialised
def next_batch(photons, found, run, at, scratch):
    """Some more photons of a look-up; the first call has run = at = 0 (int64).

    Returns (run, at) for the next call and the number of photons, 0 at the end. Scratch 2 receives their places
    (int32) and from element WIDTH on their squared distances (float32; with the k nearest in the metric of the
    flattened disc).
    """
    if is_kdtree(photons):

        def of_keys(photons, found, run, at, scratch):
            some = min(found - at, _i8(WIDTH))
            for j in range(some):
                key = stack_get_i8(scratch[0], at + j)
                stack_put_i4(scratch[2], j, _i4(key & _i8(0xFFFFFFFF)))
                stack_put_f4(scratch[2], WIDTH + j, float_of_bits(_u4(key >> 32)))
            return run, at + some, some

        return of_keys

    def of_runs(photons, found, run, at, scratch):
        runs, disc = found
        ranges, squared, batch = scratch
        while run < runs:
            first, end = _i8(stack_get_i4(ranges, 2 * run)), _i8(stack_get_i4(ranges, 2 * run + 1))
            block = max(at, first // WIDTH)
            if block > (end - 1) // WIDTH:
                run += 1
                at = _i8(0)
                continue
            at = block + 1
            mask = counted_in_block(photons, block, first, end, disc, squared)
            some = _i8(0)
            while mask != 0:
                lane = count_trailing_zeros(mask)
                mask &= mask - _i4(1)
                stack_put_i4(batch, some, _i4(block * WIDTH + lane))
                stack_put_f4(batch, WIDTH + some, stack_get_f4(squared, lane))
                some += 1
            if some > 0:
                return run, at, some
        return run, at, _i8(0)

    return of_runs


@device
def _column(photons, place):
    """Address of the x of a photon of a grid, whose other words follow at multiples of WIDTH."""
    return photons.blocks + (place // WIDTH) * BLOCK_BYTES + 4 * (place % WIDTH)


@specialised
def place_of(photons, place):
    """Position (x, y, z) of the photon at a place (int64)."""
    if is_kdtree(photons):

        def in_tree(photons, place):
            return load_f4(photons.x, place), load_f4(photons.y, place), load_f4(photons.z, place)

        return in_tree

    def in_grid(photons, place):
        at = _column(photons, place)
        return load_f4(at, 0), load_f4(at, WIDTH), load_f4(at, 2 * WIDTH)

    return in_grid


@specialised
def power_of(photons, place):
    """Red, green, blue power of the photon at a place (int64), in units of the map's power."""
    if is_kdtree(photons):

        def in_tree(photons, place):
            return stored_power(photons, place)

        return in_tree

    def in_grid(photons, place):
        at = _column(photons, place)
        return decode_powers(load_u4(at, 4 * WIDTH), load_u4(at, 5 * WIDTH))

    return in_grid
