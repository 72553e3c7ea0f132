"""A kd-tree that grows photon by photon, for density control: leaves of CAPACITY photons, split at the median of their
longer side when full; and its M nearest neighbours, told apart by normal, side and required density.

All that a search asks of a leaf's photons lies in the leaf, eight to a vector. Kernels see the tree as one record of
addresses: tuples of arrays would count references in every search.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import (
    aligned_empty,
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
from pmviewer.maps.density.neighbours8 import MEMBER, NEED, ROWS, WORD, X, Y, Z, neighbours8
from pmviewer.maps.search.in_disc import facing8
from pmviewer.maps.search.k_nearest import keep_nearest
from pmviewer.maps.search.simd import BLOCK_BYTES, WIDTH

M = 20
"""Neighbours that measure the density and share the power of a rejected photon."""
CAPACITY = 16
DEEPEST = 250
"""Subtrees that wait in a search; a tree that is deeper is searched in part."""

KEYS = 2 * (2 * M + CAPACITY)
WAITING = 5 * DEEPEST
"""int32 elements of scratch of a search for its neighbours and for subtrees: node, bound and offsets of each."""
NODE_WORDS = 4
PLANE, AXIS, CHILD, LEAST = range(NODE_WORDS)
"""Words of a node: the dividing plane float32, of a leaf how many photons it has; its axis, or LEAF; its left child,
which the right one follows, of a leaf its number; and the float32 that no photon of the subtree needs less than."""
LEAF = np.int32(-1)
LEAF_WORDS = ROWS * CAPACITY
"""A leaf is made of blocks of eight photons (`pmviewer.maps.density.neighbours8`)."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32

TREE = np.dtype([("nodes", np.int64), ("leaves", np.int64)])
"""What kernels see of a tree: addresses of nodes, int32 (nodes, NODE_WORDS), and leaves, float32
(leaves, LEAF_WORDS)."""


class Limits(NamedTuple):
    """Which photons are neighbours: whether only those on the place's side of the surface, and float32 weight of the
    squared height over the surface, and how many times the density needed at the place a neighbour may need."""

    one_side: Any
    steepness: Any
    contrast: Any


class SearchScratch(NamedTuple):
    """Pointers to KEYS, WAITING, 4, 4 and 8 int32 on the stack."""

    keys: Any
    stack: Any
    point: Any
    offsets: Any
    squared: Any


@device
def _at(row, j):
    """Where in a leaf a word of photon j is."""
    return _i8(ROWS * WIDTH) * (j // WIDTH) + _i8(WIDTH) * row + j % WIDTH


@device
def _flat(n, limits):
    """The axis along which the surface with normal n is flattest, and the largest square of an offset along it that a
    disc of the squared radius 1 has."""
    if not limits.steepness > _f4(0.0):
        return _i8(0), _f4(np.inf)
    axis = _i8(0)
    for a in range(1, 3):
        if abs(n[a]) > abs(n[axis]):
            axis = _i8(a)
    # Along n the disc reaches up to 1/√steepness, along the surface up to 1.
    along = abs(n[axis])
    tilt = _f4(np.sqrt(max(_f4(1.0) - along * along, _f4(0.0))))
    most = (tilt + _f4(1.0) / _f4(np.sqrt(limits.steepness))) / along
    return axis, _f4(1.001) * most * most


@device
def search(tree, p, n, need, limits, r2, scratch):
    """Up to M nearest neighbours of a place p with normal n that needs the density `need`, closer than sqrt(r2): keys
    of squared distance (high) and number (low half) in `scratch.keys`. Returns how many they are and, of M, the squared
    distance of the farthest. limits: `Limits`; scratch: `SearchScratch`."""
    ceiling = limits.contrast * need
    flat = _flat(n, limits)
    for axis in range(3):
        stack_put_f4(scratch.point, axis, p[axis])
        stack_put_f4(scratch.offsets, axis, _f4(0.0))
    count, waiting = _i8(0), _i8(0)
    node, bound = _i8(0), _f4(0.0)
    while node >= 0:
        node, waiting = _descend(tree, node, bound, r2, ceiling, flat, scratch, waiting)
        if load_f4(tree.nodes, NODE_WORDS * node + LEAST) <= ceiling:
            leaf = tree.leaves + 4 * LEAF_WORDS * _i8(load_i4(tree.nodes, NODE_WORDS * node + CHILD))
            count = _of_leaf(leaf, p, n, ceiling, limits, r2, scratch, count)
            if count >= 2 * M:
                r2 = keep_nearest(scratch.keys, count, _i4(M), r2)
                count = _i8(M)
        node, bound, waiting = _next_subtree(r2, scratch, waiting)
    if count >= M:
        r2 = keep_nearest(scratch.keys, count, _i4(M), r2)
        count = _i8(M)
    return count, r2


@device
def _descend(tree, node, bound, r2, ceiling, flat, scratch, waiting):
    """From a node down to the leaf that the place is in; subtrees on the way that may hold a neighbour go on the stack.
    Returns the leaf's node and how many subtrees wait. flat: of `_flat`."""
    thin, most = flat[0], flat[1] * r2
    axis = _i8(load_i4(tree.nodes, NODE_WORDS * node + AXIS))
    while axis >= 0:
        side = stack_get_f4(scratch.point, axis) - load_f4(tree.nodes, NODE_WORDS * node + PLANE)
        child = _i8(load_i4(tree.nodes, NODE_WORDS * node + CHILD))
        near = child + _i8(side >= _f4(0.0))
        other = _i8(2) * child + _i8(1) - near
        offset = stack_get_f4(scratch.offsets, axis)
        far = bound - offset * offset + side * side
        if (
            far < r2
            and (axis != thin or side * side < most)
            and load_f4(tree.nodes, NODE_WORDS * other + LEAST) <= ceiling
            and waiting < DEEPEST
        ):
            base = 5 * waiting
            stack_put_i4(scratch.stack, base, _i4(other))
            stack_put_f4(scratch.stack, base + 1, far)
            for a in range(3):
                stack_put_f4(scratch.stack, base + 2 + a, stack_get_f4(scratch.offsets, a))
            stack_put_f4(scratch.stack, base + 2 + axis, side)
            waiting += 1
        node = near
        axis = _i8(load_i4(tree.nodes, NODE_WORDS * node + AXIS))
    return node, waiting


@device
def _next_subtree(r2, scratch, waiting):
    """The latest subtree on the stack that is near enough, its bound, and how many still wait; node −1 without one."""
    while waiting > 0:
        waiting -= 1
        base = 5 * waiting
        bound = stack_get_f4(scratch.stack, base + 1)
        if bound < r2:
            for a in range(3):
                stack_put_f4(scratch.offsets, a, stack_get_f4(scratch.stack, base + 2 + a))
            return _i8(stack_get_i4(scratch.stack, base)), bound, waiting
    return _i8(-1), _f4(0.0), waiting


@device
def _of_leaf(leaf, p, n, ceiling, limits, r2, scratch, count):
    """Add the neighbours among the photons of a leaf, at its address, to the keys; returns how many there are then."""
    for first in range(0, CAPACITY, WIDTH):
        block = leaf + (first // WIDTH) * BLOCK_BYTES
        mask = neighbours8(block, p, n, limits.steepness, r2, ceiling, scratch.squared)
        if mask != 0 and limits.one_side:
            mask &= facing8(block, n)
        count = add_keys(block, mask, scratch, count)
    return count


@device
def add_keys(block, mask, scratch, count):
    """Add the photons of a block, at its address, whose bit is set in `mask` to the keys, at the distances that
    `scratch.squared` has; returns how many there are then."""
    while mask != 0:
        lane = _i8(count_trailing_zeros(mask))
        mask &= mask - _i4(1)
        number = _i8(load_i4(block, WIDTH * MEMBER + lane))
        stack_put_i8(scratch.keys, count, _i8(stack_get_i4(scratch.squared, lane)) << 32 | number)
        count += 1
    return count


@device
def insert(tree, size, p, need, word, i, scratch):
    """Put photon i, which has that place, required density and direction code, into its leaf; size: (nodes, leaves, _)
    of the tree, grows by a split. scratch: LEAF_WORDS and CAPACITY int32."""
    node = _i8(0)
    while True:
        at = tree.nodes + 4 * NODE_WORDS * node
        axis = _i8(load_i4(at, AXIS))
        while axis >= 0:
            store_f4(at, LEAST, min(load_f4(at, LEAST), need))
            node = _i8(load_i4(at, CHILD)) + _i8(p[axis] >= load_f4(at, PLANE))
            at = tree.nodes + 4 * NODE_WORDS * node
            axis = _i8(load_i4(at, AXIS))
        count = _i8(load_i4(at, PLANE))
        if count < CAPACITY:
            leaf = tree.leaves + 4 * LEAF_WORDS * _i8(load_i4(at, CHILD))
            store_f4(leaf, _at(X, count), p[0])
            store_f4(leaf, _at(Y, count), p[1])
            store_f4(leaf, _at(Z, count), p[2])
            store_f4(leaf, _at(NEED, count), need)
            store_i4(leaf, _at(WORD, count), _i4(word))
            store_i4(leaf, _at(MEMBER, count), i)
            store_f4(at, LEAST, min(load_f4(at, LEAST), need))
            store_i4(at, PLANE, _i4(count + 1))
            return
        _halve(tree, size, node, scratch)


@device
def _halve(tree, size, node, scratch):
    """Split a full leaf at the median of its longest side."""
    old, order = scratch
    at = tree.nodes + 4 * NODE_WORDS * node
    number, new = _i8(load_i4(at, CHILD)), size[1]
    leaf = tree.leaves + 4 * LEAF_WORDS * number
    for w in range(LEAF_WORDS):
        stack_put_i4(old, w, load_i4(leaf, w))
    axis = _longest(old)
    for j in range(CAPACITY):  # insertion sort along the axis
        k, x = _i8(j), stack_get_f4(old, _at(axis, _i8(j)))
        while k > 0 and stack_get_f4(old, _at(axis, _i8(stack_get_i4(order, k - 1)))) > x:
            stack_put_i4(order, k, stack_get_i4(order, k - 1))
            k -= 1
        stack_put_i4(order, k, _i4(j))
    half = CAPACITY // 2
    plane = stack_get_f4(old, _at(axis, _i8(stack_get_i4(order, half))))
    left = size[0]
    _fill(tree, left, number, 0, half, old, order)
    _fill(tree, left + 1, new, half, CAPACITY, old, order)
    size[0] += 2
    size[1] += 1
    store_f4(at, PLANE, plane)
    store_i4(at, AXIS, _i4(axis))
    store_i4(at, CHILD, _i4(left))


@device
def _longest(old):
    """The axis along which the photons of a full leaf reach farthest."""
    axis, extent = _i8(0), _f4(-1.0)
    for a in range(3):
        low = high = stack_get_f4(old, _at(a, _i8(0)))
        for j in range(1, CAPACITY):
            x = stack_get_f4(old, _at(a, _i8(j)))
            low, high = min(low, x), max(high, x)
        if high - low > extent:
            axis, extent = _i8(a), high - low
    return axis


@device
def _fill(tree, node, number, begin, end, old, order):
    """Make a node the leaf of that number, with photons order[begin:end] of an old one."""
    leaf = tree.leaves + 4 * LEAF_WORDS * number
    least, far = _f4(np.inf), _f4(np.inf)
    for j in range(CAPACITY):
        if j < end - begin:
            i = _i8(stack_get_i4(order, begin + j))
            for row in range(ROWS):
                store_i4(leaf, _at(row, _i8(j)), stack_get_i4(old, _at(row, i)))
            least = min(least, stack_get_f4(old, _at(NEED, i)))
        else:
            store_f4(leaf, _at(X, _i8(j)), far)
    at = tree.nodes + 4 * NODE_WORDS * node
    store_i4(at, PLANE, _i4(end - begin))
    store_i4(at, AXIS, LEAF)
    store_i4(at, CHILD, _i4(number))
    store_f4(at, LEAST, least)


@dataclass(frozen=True, eq=False)
class GrowingTree:
    """`nodes` int32 (nodes, NODE_WORDS), `leaves` float32 (leaves, LEAF_WORDS), and `record` (1,) of TREE, valid while
    this lives."""

    nodes: NDArray[np.int32]
    leaves: NDArray[np.float32]
    record: NDArray[np.void]


def reserved(tree: GrowingTree | None, size: NDArray[np.int64], photons: int) -> GrowingTree:
    """A copy of the tree, of size[0] nodes and size[1] leaves, with room for so many photons, or an empty one."""
    n = 2 + photons // (CAPACITY // 2)  # halves of a split leaf are never emptier than this
    nodes, leaves = aligned_empty((2 * n, NODE_WORDS), np.int32), aligned_empty((n, LEAF_WORDS), np.float32)
    if tree is None:
        nodes[0] = (0, LEAF, 0, np.float32(np.inf).view(np.int32))
        leaves[0] = np.inf
    else:
        nodes[: size[0]], leaves[: size[1]] = tree.nodes[: size[0]], tree.leaves[: size[1]]
    record = np.zeros(1, TREE)
    record[0] = (nodes.ctypes.data, leaves.ctypes.data)
    return GrowingTree(nodes, leaves, record)


def grown(array: NDArray[Any], used: int, n: int) -> NDArray[Any]:
    """A copy with n rows, of which so many are used; the others are zero."""
    larger = np.zeros((n, *array.shape[1:]), array.dtype)
    larger[:used] = array[:used]
    return larger
