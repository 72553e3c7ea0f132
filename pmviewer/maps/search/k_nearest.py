"""The k nearest photons of a point in a kd-tree (`pmviewer.maps.search.kdtree`).

A search keeps an exact lower bound of the distance to each subtree by the offsets along the axes (Arya & Mount 1993).
Neighbours are collected without order until there are 2k; then a selection keeps the nearest k and the search radius
shrinks to the k-th. That visits a few more leaves than a heap, which shrinks the radius with each photon, and is still
much faster: the selection has no unpredictable branches.
"""

from __future__ import annotations

import numpy as np

from pmviewer.errors import SettingError
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.compile.specialise import absent, specialised
from pmviewer.kernels.memory import (
    bits_of_float,
    count_trailing_zeros,
    float_of_bits,
    load_f4,
    load_i4,
    stack_get_f4,
    stack_get_i4,
    stack_get_i8,
    stack_i4,
    stack_put_f4,
    stack_put_i4,
    stack_put_i8,
)
from pmviewer.kernels.vector import dot, sub
from pmviewer.maps.search.kdtree import LEAF, PhotonKdTree
from pmviewer.maps.search.simd import WIDTH, within8
from pmviewer.maps.search.stored import arrives, height_above

MAX_K = 1024
"""Most neighbours that a look-up can be asked for."""

KEYS = 4 * MAX_K + 2 * LEAF
"""int32 elements of scratch for the neighbours of a look-up."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32


@device
def _partition(keys, low, high, pivot):
    """Brings keys below the pivot to the front of keys[low:high]; returns where the others start. No branches."""
    middle = low
    for i in range(low, high):
        key = stack_get_i8(keys, i)
        stack_put_i8(keys, i, stack_get_i8(keys, middle))
        stack_put_i8(keys, middle, key)
        middle += _i8(key < pivot)
    return middle


@device
def _select(keys, count, k, smallest, largest):
    """Brings the k smallest of `count` > k distinct keys to the front.

    All keys lie in [smallest, largest]. The first pivots are interpolated: squared distances of photons on a surface
    are nearly uniform. If that doesn't help, pivots are medians of three.
    """
    low, high = _i8(0), _i8(count)
    tries = 0
    while high - low > 1 and low < k < high:
        if tries < 3:
            a, b = float_of_bits(_u4(smallest >> 32)), float_of_bits(_u4(largest >> 32))
            share = _f4(k - low) / _f4(high - low)
            pivot = (_i8(bits_of_float(a + (b - a) * share)) << 32) + 1
        else:
            a, b, c = stack_get_i8(keys, low), stack_get_i8(keys, (low + high) >> 1), stack_get_i8(keys, high - 1)
            pivot = max(min(a, b), min(max(a, b), c))
        tries += 1
        middle = _partition(keys, low, high, pivot)
        if middle <= k and middle > low:
            low = middle
            smallest = pivot
        elif middle > k and middle < high:
            high = middle
            largest = pivot
        elif tries > 3:
            # The pivot is the smallest key: set it aside.
            for i in range(low, high):
                if stack_get_i8(keys, i) == pivot:
                    stack_put_i8(keys, i, stack_get_i8(keys, low))
                    stack_put_i8(keys, low, pivot)
            low += 1


@device
def keep_nearest(keys, count, k, r2):
    """Keeps the nearest k of `count` ≥ k keys; returns the squared distance of the k-th."""
    if count > k:
        _select(keys, count, k, _i8(0), _i8(bits_of_float(r2)) << 32 | _i8(0xFFFFFFFF))
    farthest = _i8(0)
    for i in range(k):
        farthest = max(farthest, stack_get_i8(keys, i))
    return float_of_bits(_u4(farthest >> 32))


@specialised
def _distance(tree, i, d2, r2, p, facing):
    """The squared distance by which photon i counts, closer than sqrt(d2) as the crow flies; infinite where it does not
    count."""
    if absent(facing):
        return lambda tree, i, d2, r2, p, facing: d2

    def of_disc(tree, i, d2, r2, p, facing):
        h = height_above(tree, i, p, facing.n)
        d2 = max(d2, facing.steepness * h * h)
        if d2 < r2 and arrives(tree, i, p, facing.n, facing.class_mask):
            return d2
        return _f4(np.inf)

    return of_disc


@device
def _descend(tree, node, bound, r2, point, offsets, stack, waiting):
    """From a node down to the leaf that the point is in; the subtrees on the way that may hold a neighbour go on the
    stack. Returns the leaf and how many subtrees wait."""
    leaves = _i8(1) << tree.depth
    while node < leaves:
        along = _i8(load_i4(tree.planes, 2 * node + 1))
        side = stack_get_f4(point, along) - load_f4(tree.planes, 2 * node)
        offset = stack_get_f4(offsets, along)
        near = 2 * node + _i8(side >= _f4(0.0))
        far_bound = bound - offset * offset + side * side
        if far_bound < r2:
            base = 5 * waiting
            stack_put_i4(stack, base, _i4(near ^ 1))
            stack_put_f4(stack, base + 1, far_bound)
            for other in range(3):
                stack_put_f4(stack, base + 2 + other, stack_get_f4(offsets, other))
            stack_put_f4(stack, base + 2 + along, side)
            waiting += 1
        node = near
    return node - leaves, waiting


@device
def _next_subtree(stack, waiting, r2, offsets):
    """The latest subtree on the stack that is near enough, its bound, and how many still wait; node 0 without one."""
    while waiting > 0:
        waiting -= 1
        base = 5 * waiting
        bound = stack_get_f4(stack, base + 1)
        if bound < r2:
            for other in range(3):
                stack_put_f4(offsets, other, stack_get_f4(stack, base + 2 + other))
            return _i8(stack_get_i4(stack, base)), bound, waiting
    return _i8(0), _f4(0.0), waiting


@device
def nearest(tree, p, k, r2, keys, facing):
    """The k nearest photons closer than sqrt(r2) to the point p.

    Parameters
    ----------
    tree: record of a PhotonKdTree.
    p: float32 triple.
    k: int32, 1 … MAX_K.
    r2: float32 squared largest distance.
    keys: pointer to `KEYS` int32 of scratch that receives the neighbours, unordered, as int64: bits of the squared
        distance in the high, place in the tree in the low half.
    facing: a `pmviewer.maps.search.disc.Facing`, or None: all photons count.

    Returns
    -------
    Number of neighbours found (int64), and if k were found the squared distance of the farthest, otherwise r2.
    """
    if tree.n == 0 or not (abs(p[0]) + abs(p[1]) + abs(p[2]) < _f4(np.inf)):
        return _i8(0), r2
    point, offsets = stack_i4(4), stack_i4(4)
    squared = stack_i4(8)
    stack = stack_i4(192)
    stack_put_f4(point, 0, p[0])
    stack_put_f4(point, 1, p[1])
    stack_put_f4(point, 2, p[2])
    for axis in range(3):
        stack_put_f4(offsets, axis, _f4(0.0))
    capacity = 2 * _i8(k)
    count, waiting = _i8(0), _i8(0)
    node, bound = _i8(1), _f4(0.0)
    while node > 0:
        leaf, waiting = _descend(tree, node, bound, r2, point, offsets, stack, waiting)
        j, end = (tree.n * leaf) >> tree.depth, (tree.n * (leaf + 1)) >> tree.depth
        while j < end:
            mask = within8(tree.x + 4 * j, tree.y + 4 * j, tree.z + 4 * j, p[0], p[1], p[2], r2, squared)
            if end - j < WIDTH:
                mask &= _i4((1 << (end - j)) - 1)
            while mask != 0:
                lane = count_trailing_zeros(mask)
                mask &= mask - _i4(1)
                d2 = _distance(tree, j + lane, stack_get_f4(squared, lane), r2, p, facing)
                if d2 < r2:
                    stack_put_i8(keys, count, _i8(bits_of_float(d2)) << 32 | (j + lane))
                    count += 1
            j += WIDTH
            if count >= capacity:
                r2 = keep_nearest(keys, count, k, r2)
                count = _i8(k)
        node, bound, waiting = _next_subtree(stack, waiting, r2, offsets)
    if count >= k:
        r2 = keep_nearest(keys, count, k, r2)
        count = _i8(k)
    return count, r2


@device
def _order(keys, count):
    """Sorts keys ascending, by insertion: they are few."""
    for i in range(1, count):
        key = stack_get_i8(keys, i)
        j = i
        while j > 0 and stack_get_i8(keys, j - 1) > key:
            stack_put_i8(keys, j, stack_get_i8(keys, j - 1))
            j -= 1
        stack_put_i8(keys, j, key)


@kernel
def nearest_at(trees, points, k, max_radius, ordered, i0, i1, indices, squared):
    """The k nearest photons of points[i0:i1], see `knn`; `ordered`: whether by ascending distance.

    The distance of the k-th neighbour of the point before, plus the way from there, bounds the search, and a little
    more than that distance alone is tried first: points in screen or Morton order are faster than shuffled ones.
    """
    tree = trees[0]
    keys = stack_i4(KEYS)
    zero = _f4(0.0)
    before, reach = (zero, zero, zero), _f4(np.inf)
    for i in range(i0, i1):
        p = (points[i, 0], points[i, 1], points[i, 2])
        way = sub(p, before)
        step = np.sqrt(dot(way, way))
        radius = min(max_radius, (reach + step) * _f4(1.00001))
        guess = min(radius, reach * _f4(1.15))
        count, r2 = nearest(tree, p, k, guess * guess, keys, None)
        if count < k and guess < radius:
            count, r2 = nearest(tree, p, k, radius * radius, keys, None)
        before = p
        reach = np.sqrt(r2) if count == k else _f4(np.inf)
        if ordered:
            _order(keys, count)
        for j in range(count):
            key = stack_get_i8(keys, j)
            indices[i, j] = load_i4(tree.index, key & _i8(0xFFFFFFFF))
            squared[i, j] = float_of_bits(_u4(key >> 32))
        for j in range(count, k):
            indices[i, j] = _i4(-1)
            squared[i, j] = _f4(np.inf)


def knn(
    tree: PhotonKdTree, points: np.ndarray, k: int, max_radius: float = np.inf, ordered: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """The k nearest photons of points (m, 3) float32, closer than `max_radius`.

    Returns
    -------
    indices: (m, k) int32 places in the array that the tree was built from, −1 where there are fewer.
    squared: (m, k) float32 squared distances, infinite where there are fewer.
    """
    check_k(k)
    points = np.require(points, np.float32, ["C", "W"])
    indices, squared = np.empty((len(points), k), np.int32), np.empty((len(points), k), np.float32)
    nearest_at(tree.record, points, np.int32(k), np.float32(max_radius), ordered, 0, len(points), indices, squared)
    return indices, squared


def check_k(k: int) -> None:
    """Raises SettingError unless a look-up can be asked for k neighbours."""
    if not 1 <= k <= MAX_K:
        raise SettingError(f"{k} neighbours of a photon look-up: expected 1 to {MAX_K}.")
