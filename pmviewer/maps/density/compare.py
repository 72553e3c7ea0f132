"""A round of density control against what was stored before it: who shares the power of photons that are not stored."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import (
    stack_get_f4,
    stack_get_i4,
    stack_get_i8,
    stack_i4,
    stack_put_f4,
    stack_put_i4,
)
from pmviewer.kernels.vector import normalize
from pmviewer.maps.density.decide import farthest, sharing
from pmviewer.maps.density.groups import PIECE
from pmviewer.maps.density.growing_tree import KEYS, WAITING, SearchScratch, search
from pmviewer.maps.density.together import (
    BOX,
    MOST_LEAVES,
    NODES,
    collected,
    empty_box,
    leaves_around,
    search_among,
    widen,
)
from pmviewer.maps.photon_words import decode_direction

FEWEST = 3
"""Photons that look for neighbours together at least."""
ALIKE = np.float32(8.0)
"""Their searches differ in area by no more than this."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64


class Placed(NamedTuple):
    """The photons of a round in the order of their `Groups`: order (n,) int32, photons (n, 6) float32, normals (n,)
    uint32 codes, needs (n,) float32; first as in `Arrivals`."""

    order: Any
    photons: Any
    normals: Any
    needs: Any
    first: Any


@kernel
def compare(trees, control, placed, starts, rows, g0, g1, candidates, counts, neighbours):
    """The photons of groups g0 … g1−1 against the tree as it is: counts[j] of neighbours[j] share the power of photon j
    of `placed`, which is not stored; none where this is still open. starts: of `Groups`; rows: address of the stored
    rows; candidates: that of AMONG_WORDS of scratch."""
    tree, order = trees[0], placed.order
    scratch = SearchScratch(stack_i4(KEYS), stack_i4(WAITING), stack_i4(4), stack_i4(4), stack_i4(8))
    leaves, stack, box = stack_i4(MOST_LEAVES), stack_i4(NODES), stack_i4(BOX)
    some, far = stack_i4(PIECE), stack_i4(PIECE)
    for g in range(g0, g1):
        first, left = starts[g], starts[g + 1] - starts[g]
        n = normalize(decode_direction(placed.normals[first]))
        for at in range(left):
            stack_put_i4(some, at, _i4(at))
            stack_put_f4(far, at, farthest(control, placed.needs[first + at], _i8(placed.first) + order[first + at]))
        while left > 0:
            rest, blocks = _alike(placed, first, far, some, left), _i8(-1)
            if left - rest >= FEWEST:
                ceiling = _surround(placed, first, far, some, rest, left, n, control.limits, box)
                count = leaves_around(tree, box, ceiling, stack, leaves)
                if count >= 0:
                    blocks = collected(tree, leaves, count, box, n, ceiling, control.limits, candidates)
            for at in range(rest, left):
                j = first + _i8(stack_get_i4(some, at))
                p, need, index = place(placed, j), placed.needs[j], _i8(placed.first) + _i8(order[j])
                r2 = stack_get_f4(far, j - first)
                if blocks >= 0:
                    count, r2 = search_among(candidates, blocks, p, n, need, control.limits, r2, scratch)
                else:
                    count, r2 = search(tree, p, n, need, control.limits, r2, scratch)
                count = sharing(control, n, need, index, rows, count, r2, scratch)
                counts[j] = _i4(count)
                for k in range(count):
                    neighbours[j, k] = _i4(stack_get_i8(scratch.keys, k) & _i8(0xFFFFFFFF))
            left = rest


@device
def place(placed, j):
    """Where the photon at j of `Placed` or `Arrivals` is."""
    return (placed.photons[j, 0], placed.photons[j, 1], placed.photons[j, 2])


@device
def _alike(placed, first, far, some, count):
    """Brings those of `count` photons to the end that look about as far as the one that looks least far; returns where
    they begin. One that is nowhere, or looks everywhere, stays alone. some: their places from `first` on; far: squared
    distances, by these places."""
    least = _f4(np.inf)
    for k in range(count):
        least = min(least, stack_get_f4(far, _i8(stack_get_i4(some, k))))
    begin, at = _i8(count), _i8(0)
    while at < begin:
        j = _i8(stack_get_i4(some, at))
        p, r2 = place(placed, first + j), stack_get_f4(far, j)
        if r2 <= ALIKE * least and r2 < _f4(np.inf) and abs(p[0]) + abs(p[1]) + abs(p[2]) < _f4(np.inf):
            begin -= 1
            stack_put_i4(some, at, stack_get_i4(some, begin))
            stack_put_i4(some, begin, _i4(j))
        else:
            at += 1
    return min(begin, _i8(count) - 1)


@device
def _surround(placed, first, far, some, begin, end, n, limits, box):
    """The box of what may be neighbours of some photons with normal n, and the most that one of these needs."""
    empty_box(box)
    ceiling = _f4(0.0)
    for at in range(begin, end):
        j = _i8(stack_get_i4(some, at))
        widen(box, place(placed, first + j), n, stack_get_f4(far, j), limits)
        ceiling = max(ceiling, limits.contrast * placed.needs[first + j])
    return ceiling
