"""A kd-tree that grows photon by photon, for density control: leaves of CAPACITY photons, split at the median of their
longer side when full; and its M nearest neighbours, told apart by normal, side and required density.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, inlined
from pmviewer.maps.photon_words import decode_direction

M = 20
"""Neighbours that measure the density and share the power of a rejected photon."""
CAPACITY = 16
DEEPEST = 250
"""Subtrees that wait in a search; a tree that is deeper is searched in part."""
LEAF = np.int8(-1)
"""In place of the axis of a node that is a leaf."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64


class Tree(NamedTuple):
    """Of nodes: axes int8 or LEAF, planes float32, children int32 (the left one, the right one follows; of a leaf its
    number), least float32 (no photon of the subtree needs less). Of leaves: counts int32, members int32
    (leaves, CAPACITY), places float32 (leaves, CAPACITY, 3). Of photons: words uint32 (direction and flags), needs
    float32 (required density)."""

    axes: Any
    planes: Any
    children: Any
    least: Any
    counts: Any
    members: Any
    places: Any
    words: Any
    needs: Any


class Limits(NamedTuple):
    """Which photons are neighbours: float32 weight of the squared height over the surface, what cosines
    of directions exceed, and how many times the density needed at the place a neighbour may need."""

    steepness: Any
    cosine: Any
    contrast: Any


@inlined
def search_scratch():
    """Room for a search: numbers and squared distances of neighbours, nodes and bounds of waiting subtrees."""
    return (
        np.empty(M, np.int32),
        np.empty(M, np.float32),
        np.empty(DEEPEST, np.int64),
        np.empty(DEEPEST, np.float32),
    )


@device
def search(tree, p, n, need, limits, r2, scratch):
    """Up to M nearest neighbours of a place p with normal n that needs the density `need`, closer than sqrt(r2): their
    numbers and squared distances go into `scratch`, of `search_scratch`. Returns how many they are and the squared
    distance of the farthest. limits: `Limits`."""
    axes, planes, children, least, counts, members, places, words, needs = tree
    found, distances, stack_nodes, stack_bounds = scratch
    ceiling = limits.contrast * need
    count = _i8(0)
    farthest = _i8(0)
    waiting = _i8(0)
    node = _i8(0)
    while True:
        while axes[node] >= 0:
            side = p[_i8(axes[node])] - planes[node]
            near = _i8(children[node]) + _i8(side >= _f4(0.0))
            other = _i8(2) * _i8(children[node]) + _i8(1) - near
            if side * side < r2 and least[other] <= ceiling and waiting < DEEPEST:
                stack_nodes[waiting] = other
                stack_bounds[waiting] = side * side
                waiting += 1
            node = near
        leaf = _i8(children[node])
        for j in range(_i8(counts[leaf]) if least[node] <= ceiling else 0):
            dx, dy, dz = places[leaf, j, 0] - p[0], places[leaf, j, 1] - p[1], places[leaf, j, 2] - p[2]
            h = n[0] * dx + n[1] * dy + n[2] * dz
            d2 = max(dx * dx + dy * dy + dz * dz, limits.steepness * h * h)
            if d2 < r2:
                i = members[leaf, j]
                w = decode_direction(words[i])
                if n[0] * w[0] + n[1] * w[1] + n[2] * w[2] > limits.cosine and needs[i] <= ceiling:
                    if count < M:
                        found[count], distances[count] = i, d2
                        if d2 > distances[farthest]:
                            farthest = count
                        count += 1
                    else:
                        found[farthest], distances[farthest] = i, d2
                        for k in range(count):
                            if distances[k] > distances[farthest]:
                                farthest = _i8(k)
                    if count == M:
                        r2 = distances[farthest]
        node = _i8(-1)
        while waiting > 0 and node < 0:
            waiting -= 1
            if stack_bounds[waiting] < r2:
                node = stack_nodes[waiting]
        if node < 0:
            break
    if count == 0:
        return count, _f4(0.0)
    return count, distances[farthest]


@device
def insert(tree, size, p, i):
    """Put photon i into its leaf; size: (nodes, leaves, _) of the tree, grows by a split."""
    need = tree.needs[i]
    axes, planes, children, least, counts, members, places, _, _ = tree
    node = _i8(0)
    while True:
        while axes[node] >= 0:
            least[node] = min(least[node], need)
            node = _i8(children[node]) + _i8(p[_i8(axes[node])] >= planes[node])
        leaf = _i8(children[node])
        if counts[leaf] < CAPACITY:
            least[node] = min(least[node], need) if counts[leaf] > 0 else need
            j = _i8(counts[leaf])
            members[leaf, j] = i
            places[leaf, j, 0], places[leaf, j, 1], places[leaf, j, 2] = p
            counts[leaf] += _i4(1)
            return
        _halve(tree, size, node)


@device
def _halve(tree, size, node):
    """Split a full leaf at the median of its longest side."""
    axes, planes, children, least, counts, members, places, _, needs = tree
    leaf = _i8(children[node])
    axis, extent = _i8(0), _f4(-1.0)
    for a in range(3):
        low, high = places[leaf, 0, a], places[leaf, 0, a]
        for j in range(1, CAPACITY):
            low, high = min(low, places[leaf, j, a]), max(high, places[leaf, j, a])
        if high - low > extent:
            axis, extent = _i8(a), high - low
    for j in range(1, CAPACITY):  # insertion sort along the axis
        k = _i8(j)
        while k > 0 and places[leaf, k - 1, axis] > places[leaf, k, axis]:
            for a in range(3):
                x = places[leaf, k, a]
                places[leaf, k, a] = places[leaf, k - 1, a]
                places[leaf, k - 1, a] = x
            x = members[leaf, k]
            members[leaf, k] = members[leaf, k - 1]
            members[leaf, k - 1] = x
            k -= 1
    half = CAPACITY // 2
    new = _i8(size[1])
    size[1] += 1
    for j in range(half, CAPACITY):
        members[new, j - half] = members[leaf, j]
        for a in range(3):
            places[new, j - half, a] = places[leaf, j, a]
    counts[leaf], counts[new] = _i4(half), _i4(CAPACITY - half)
    left = _i8(size[0])
    size[0] += 2
    least[left], least[left + 1] = _f4(np.inf), _f4(np.inf)
    for j in range(half):
        least[left] = min(least[left], needs[members[leaf, j]])
    for j in range(CAPACITY - half):
        least[left + 1] = min(least[left + 1], needs[members[new, j]])
    axes[left], axes[left + 1] = LEAF, LEAF
    children[left], children[left + 1] = _i4(leaf), _i4(new)
    axes[node], planes[node], children[node] = np.int8(axis), places[new, 0, axis], _i4(left)


def reserved(tree: Tree | None, photons: int) -> Tree:
    """A copy of the tree with room for so many photons, or an empty one."""
    leaves = 2 + photons // (CAPACITY // 2)  # halves of a split leaf are never emptier than this
    axes, planes, children, least, counts, members, places, words, needs = tree or Tree(
        np.full(1, LEAF, np.int8),
        np.zeros(1, np.float32),
        np.zeros(1, np.int32),
        np.zeros(1, np.float32),
        np.zeros(1, np.int32),
        np.zeros((1, CAPACITY), np.int32),
        np.zeros((1, CAPACITY, 3), np.float32),
        np.zeros(0, np.uint32),
        np.zeros(0, np.float32),
    )
    nodes = 2 * leaves
    return Tree(
        *(grown(a, nodes) for a in (axes, planes, children, least)),
        *(grown(a, leaves) for a in (counts, members, places)),
        *(grown(a, photons) for a in (words, needs)),
    )


def grown(array: NDArray[Any], n: int) -> NDArray[Any]:
    """A copy with n rows, zero after the old ones."""
    larger = np.zeros((n, *array.shape[1:]), array.dtype)
    larger[: len(array)] = array
    return larger
