"""Neighbours of many places at once, for density control.

A search for M neighbours visits a dozen leaves of the tree and goes a long way to each. Places in one leaf with one
normal (`pmviewer.maps.density.groups`) have nearly the same neighbours: the photons that may be one are collected once
for all of them, and each place measures nothing but distances. It finds what a search of its own would find.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import (
    count_trailing_zeros,
    load_f4,
    load_i4,
    stack_get_f4,
    stack_get_i4,
    stack_put_f4,
    stack_put_i4,
    stack_put_i8,
    store_f4,
    store_i4,
)
from pmviewer.maps.density.growing_tree import (
    AXIS,
    CAPACITY,
    CHILD,
    LEAF_WORDS,
    LEAST,
    NODE_WORDS,
    PLANE,
    M,
)
from pmviewer.maps.density.neighbours8 import MEMBER, NEED, ROWS, below8, distances8, inside8
from pmviewer.maps.search.in_disc import facing8
from pmviewer.maps.search.k_nearest import keep_nearest
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH, count_bits

MOST_LEAVES, MOST_CANDIDATES = 128, 1024
"""Of a group; where there are more, places search for themselves."""
BOX = 6
"""int32 elements of scratch for a box: its low and its high corner."""
NODES = 512
"""int32 elements of scratch for nodes that wait."""
CANDIDATE_WORDS = ROWS * MOST_CANDIDATES
AMONG_WORDS = CANDIDATE_WORDS + MOST_CANDIDATES
"""float32 elements of scratch for candidates, and for them and how far they are."""
GUESSES = 8
"""Of a distance within which M are, at most."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64


@device
def empty_box(box):
    """A box that holds nothing; box: BOX int32 of scratch."""
    for axis in range(3):
        stack_put_f4(box, axis, _f4(np.inf))
        stack_put_f4(box, 3 + axis, _f4(-np.inf))


@device
def widen(box, p, n, r2, limits):
    """Have a box hold what may be a neighbour of the place p with normal n, up to the squared distance r2."""
    r, flatness = _f4(1.001) * _f4(np.sqrt(r2)), _f4(1.0)
    if limits.steepness > _f4(0.0):
        flatness = _f4(1.0) / _f4(np.sqrt(limits.steepness))
    for axis in range(3):
        across = _f4(np.sqrt(max(_f4(1.0) - n[axis] * n[axis], _f4(0.0))))
        reach = r * min(across + flatness * abs(n[axis]), _f4(1.0)) + _f4(1e-6) * abs(p[axis])  # what adding it rounds
        stack_put_f4(box, axis, min(stack_get_f4(box, axis), p[axis] - reach))
        stack_put_f4(box, 3 + axis, max(stack_get_f4(box, 3 + axis), p[axis] + reach))


@device
def leaves_around(tree, box, ceiling, stack, leaves):
    """Numbers of the leaves that lie in a box and have photons that need no more than `ceiling`, into `leaves`; how
    many, or −1 where there are too many. stack: NODES, leaves: MOST_LEAVES int32 of scratch."""
    count, waiting = _i8(0), _i8(1)
    stack_put_i4(stack, 0, _i4(0))
    while waiting > 0:
        waiting -= 1
        at = tree.nodes + 4 * NODE_WORDS * _i8(stack_get_i4(stack, waiting))
        if not load_f4(at, LEAST) <= ceiling:
            continue
        axis, child = _i8(load_i4(at, AXIS)), load_i4(at, CHILD)
        if axis >= 0:
            plane = load_f4(at, PLANE)
            if waiting > NODES - 2:
                return _i8(-1)
            stack_put_i4(stack, waiting, child)
            waiting += _i8(stack_get_f4(box, axis) < plane)
            stack_put_i4(stack, waiting, child + _i4(1))
            waiting += _i8(stack_get_f4(box, 3 + axis) >= plane)
        else:
            if count == MOST_LEAVES:
                return _i8(-1)
            stack_put_i4(leaves, count, child)
            count += 1
    return count


@device
def collected(tree, leaves, leaf_count, box, n, ceiling, limits, candidates):
    """Photons of leaves that may be neighbours of places with the normal n whose neighbours a box holds, in blocks of
    eight at the address `candidates`; how many blocks, or −1 where there are too many."""
    low = (stack_get_f4(box, 0), stack_get_f4(box, 1), stack_get_f4(box, 2))
    high = (stack_get_f4(box, 3), stack_get_f4(box, 4), stack_get_f4(box, 5))
    count = _i8(0)
    for leaf in range(leaf_count):
        address = tree.leaves + 4 * LEAF_WORDS * _i8(stack_get_i4(leaves, leaf))
        for first in range(0, CAPACITY, WIDTH):
            block = address + (first // WIDTH) * BLOCK_BYTES
            mask = inside8(block, low, high)
            if mask != 0 and limits.one_side:
                mask &= facing8(block, n)
            if count + WIDTH > MOST_CANDIDATES:
                return _i8(-1)
            while mask != 0:
                lane = _i8(count_trailing_zeros(mask))
                mask &= mask - _i4(1)
                into, place = candidates + BLOCK_BYTES * (count // WIDTH), count % WIDTH
                for row in range(ROWS):
                    store_i4(into, WIDTH * row + place, load_i4(block, WIDTH * row + lane))
                count += _i8(load_f4(block, WIDTH * NEED + lane) <= ceiling)
    blocks = (count + _i8(WIDTH - 1)) // WIDTH
    for free in range(count, WIDTH * blocks):
        store_f4(candidates + BLOCK_BYTES * (free // WIDTH), free % WIDTH, _f4(np.inf))
    return blocks


@device
def search_among(candidates, blocks, p, n, need, limits, r2, scratch):
    """What `growing_tree.search` does, among candidates."""
    ceiling, distances, within = limits.contrast * need, candidates + _i8(4 * CANDIDATE_WORDS), _i8(0)
    for at in range(blocks):
        into = distances + ROW_BYTES * at
        distances8(candidates + BLOCK_BYTES * at, p, n, limits.steepness, ceiling, into)
        within += _i8(count_bits(below8(into, r2)))
    limit, count = _narrowed(distances, blocks, within, r2), _i8(0)
    for at in range(blocks):
        block, row = candidates + BLOCK_BYTES * at, distances + ROW_BYTES * at
        mask = below8(row, limit)
        while mask != 0:
            lane = _i8(count_trailing_zeros(mask))
            mask &= mask - _i4(1)
            number = _i8(load_i4(block, WIDTH * MEMBER + lane))
            stack_put_i8(scratch.keys, count, _i8(load_i4(row, lane)) << 32 | number)
            count += 1
        if count >= 2 * M:
            limit = keep_nearest(scratch.keys, count, _i4(M), limit)
            count = _i8(M)
    if count >= M:
        limit = keep_nearest(scratch.keys, count, _i4(M), limit)
        count = _i8(M)
    return count, limit


@device
def _narrowed(distances, blocks, within, r2):
    """A squared distance below which there are M photons, or a few more, of `within` that are below r2; r2 where these
    are no more than M. distances: address of theirs. Photons on a surface are spread evenly over squared distances:
    where the M-th is can be guessed."""
    low, before, turn = _f4(0.0), _i8(0), 0
    while within > M and turn < GUESSES:
        turn += 1
        share = (_f4(M - before) + _f4(0.5)) / _f4(within - before + 1)
        limit, count = low + (r2 - low) * share, _i8(0)
        for at in range(blocks):
            count += _i8(count_bits(below8(distances + ROW_BYTES * at, limit)))
        if count >= M:
            r2, within = limit, count
        else:
            low, before = limit, count
    return r2
