"""The nearest importon that counts at a place: what `pmviewer.maps.search.k_nearest.nearest` finds for k = 1.

With one neighbour there is nothing to select: each importon that is nearer than all before shrinks the search at once.
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
    stack_i4,
    stack_put_f4,
    stack_put_i4,
)
from pmviewer.maps.search.simd import WIDTH, nearer8
from pmviewer.maps.search.stored import ALL_CLASSES, arrives, height_above

ROOT = np.int64(1)

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64


@device
def squared_distance(tree, i, p, n, steepness):
    """Squared distance by which importon i counts at a place p with unit normal n, infinite where it does not; and that
    in space."""
    dx, dy, dz = load_f4(tree.x, i) - p[0], load_f4(tree.y, i) - p[1], load_f4(tree.z, i) - p[2]
    e2 = dx * dx + dy * dy + dz * dz
    if not arrives(tree, i, p, n, _i4(ALL_CLASSES)):
        return _f4(np.inf), e2
    h = height_above(tree, i, p, n)
    return max(e2, steepness * h * h), e2


@device
def nearest_in_block(tree, j, end, p, n, steepness, best, r2, e2, squared):
    """The importon nearest to a place p with unit normal n among eight from j on, up to `end`, nearer than sqrt(r2), or
    as far but nearer than sqrt(e2) in space, and both squares; `best` and these without one. squared: 16 int32 of
    scratch."""
    mask = nearer8(tree.x + 4 * j, tree.y + 4 * j, tree.z + 4 * j, p, n, steepness, r2, e2, squared)
    if end - j < WIDTH:
        mask &= _i4((1 << (end - j)) - 1)
    while mask != 0:
        lane = count_trailing_zeros(mask)
        mask &= mask - _i4(1)
        d2, e = stack_get_f4(squared, lane), stack_get_f4(squared, WIDTH + lane)
        if d2 < r2 or (d2 == r2 and e < e2):
            if arrives(tree, j + lane, p, n, _i4(ALL_CLASSES)):
                r2, e2, best = d2, e, j + lane
    return best, r2, e2


@device
def nearest_one(tree, p, n, steepness, start, best, r2, e2):
    """The importon nearest to a finite place p with unit normal n, closer than sqrt(r2), and its squared distance;
    `best` and r2 without one. tree: record of an importance map, not empty; steepness: weight of the squared height
    over the surface; start: the node to start at, ROOT or a leaf where it may be. The leaf that it is in comes last;
    `start` without one.

    From a leaf on a search climbs, down into what it passes where that may hold one: the steps of a climb are known
    beforehand, and none waits for the one before.
    """
    squared, point, stack = stack_i4(16), stack_i4(4), stack_i4(128)
    for axis in range(3):
        stack_put_f4(point, axis, p[axis])
    leaves = _i8(1) << tree.depth
    node, passed, waiting, found = _i8(start), _i8(start), _i8(0), _i8(start)
    while node > 0:
        while node < leaves:
            side = _above(tree, node, point)
            near = 2 * node + _i8(side >= _f4(0.0))
            if side * side < r2:
                stack_put_i4(stack, 2 * waiting, _i4(near ^ 1))
                stack_put_f4(stack, 2 * waiting + 1, side * side)
                waiting += 1
            node = near
        j, end = (tree.n * (node - leaves)) >> tree.depth, (tree.n * (node - leaves + 1)) >> tree.depth
        while j < end:
            before = best
            best, r2, e2 = nearest_in_block(tree, j, end, p, n, steepness, best, r2, e2, squared)
            if best != before:
                found = node
            j += WIDTH
        node = _i8(0)
        while waiting > 0 and node == 0:
            waiting -= 1
            if stack_get_f4(stack, 2 * waiting + 1) < r2:
                node = _i8(stack_get_i4(stack, 2 * waiting))
        while passed > ROOT and node == 0:
            above = passed >> 1
            side = _above(tree, above, point)
            if side * side < r2 or 2 * above + _i8(side >= _f4(0.0)) != passed:
                node = passed ^ 1
            passed = above
    return best, r2, e2, found


@device
def _above(tree, node, point):
    """How far a place lies above the plane of a node."""
    return stack_get_f4(point, _i8(load_i4(tree.planes, 2 * node + 1))) - load_f4(tree.planes, 2 * node)
