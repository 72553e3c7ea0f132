"""Photons of a round by where they are among those stored, for density control: near ones together, which have nearly
the same neighbours and nearly the same importance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.memory import load_f4, load_i4, stack_get_i4, stack_i4, stack_put_i4
from pmviewer.maps.density.growing_tree import AXIS, CHILD, NODE_WORDS, PLANE, GrowingTree
from pmviewer.tasks import Runner

PIECE = 256
"""Photons of a group at most: comparing their normals takes the square of it."""

ABREAST = 8
"""Photons that descend the tree side by side."""

_i4 = np.int32
_i8 = np.int64


@kernel
def leaf_ranks(trees, ranks):
    """Where each leaf comes, by number, if near ones follow one another: from left to right below each node."""
    tree, stack = trees[0], np.empty(len(ranks) + 1, np.int32)
    stack[0], waiting, rank = 0, _i8(1), _i4(0)
    while waiting > 0:
        waiting -= 1
        at = tree.nodes + 4 * NODE_WORDS * _i8(stack[waiting])
        child = load_i4(at, CHILD)
        if load_i4(at, AXIS) >= 0:
            stack[waiting], stack[waiting + 1] = child + _i4(1), child
            waiting += 2
        else:
            ranks[child] = rank
            rank += 1


@kernel
def leaves_at(trees, ranks, photons, leaves, i0, i1):
    """The ranks of the leaves that photons i0 … i1−1 of (n, 6) lie in, into leaves (n,) int32. Some descend side by
    side: each step waits for its node, and that of the next photon need not wait for it."""
    tree, nodes = trees[0], stack_i4(ABREAST)
    for begin in range(i0, i1, ABREAST):
        some, descending = min(_i8(ABREAST), _i8(i1) - begin), True
        for k in range(some):
            stack_put_i4(nodes, k, _i4(0))
        while descending:
            descending = False
            for k in range(some):
                at = tree.nodes + 4 * NODE_WORDS * _i8(stack_get_i4(nodes, k))
                axis = _i8(load_i4(at, AXIS))
                if axis >= 0:
                    side = _i4(photons[begin + k, axis] >= load_f4(at, PLANE))
                    stack_put_i4(nodes, k, load_i4(at, CHILD) + side)
                    descending = True
        for k in range(some):
            leaves[begin + k] = ranks[load_i4(tree.nodes, NODE_WORDS * _i8(stack_get_i4(nodes, k)) + CHILD)]


@kernel
def sort_by_leaf(leaves, begins, order):
    """Numbers of photons by the ranks of their leaves (n,), in order, into order (n,) int32; those of rank l are
    begins[l] … begins[l + 1] − 1. begins: int64, zero, for all leaves and two more."""
    for i in range(len(leaves)):
        begins[_i8(leaves[i]) + 2] += 1
    for leaf in range(2, len(begins)):
        begins[leaf] += begins[leaf - 1]
    for i in range(len(leaves)):
        after = _i8(leaves[i]) + 1
        order[begins[after]] = i
        begins[after] += 1


@kernel
def sort_by_normal(begins, normals, order, starts):
    """Bring photons of one leaf that have the same normal code together in `order`, in PIECE of them at most. starts:
    (n + 1,) int64, receives where each such group begins, and n; returns how many they are."""
    groups = _i8(0)
    for leaf in range(len(begins) - 2):
        begin = begins[leaf]
        while begin < begins[leaf + 1]:
            end = min(begin + PIECE, begins[leaf + 1])
            while begin < end:
                starts[groups] = begin
                groups += 1
                normal, stop = normals[order[begin]], begin
                for at in range(begin, end):
                    if normals[order[at]] == normal:
                        order[at], order[stop] = order[stop], order[at]
                        stop += 1
                begin = stop
    starts[groups] = len(order)
    return groups


@dataclass(frozen=True, eq=False)
class Groups:
    """Photons by where they are: those of group g lie in one leaf and have one normal, and their numbers are
    order[starts[g]:starts[g + 1]]. order: (n,) int32; starts: (groups + 1,) int64; photons (n, 6) and normals (n,):
    in that order."""

    order: NDArray[np.int32]
    starts: NDArray[np.int64]
    photons: NDArray[np.float32]
    normals: NDArray[np.uint32]

    def parts(self, size: int) -> list[tuple[int, int]]:
        """First and last + 1 of the groups of tasks of about so many photons."""
        cuts = np.searchsorted(self.starts, np.arange(0, len(self.order), size))
        return list(pairwise(np.unique([*cuts, len(self.starts) - 1]).tolist()))


def groups_of(
    tree: GrowingTree, leaves: int, photons: NDArray[np.float32], normals: NDArray[np.uint32], size: int, run: Runner
) -> Groups:
    """Of photons (n, 6) with normal codes (n,) in a tree of so many leaves, found in tasks of `size`."""
    n = len(photons)
    of_leaf, begins, order = np.empty(n, np.int32), np.zeros(leaves + 2, np.int64), np.empty(n, np.int32)
    ranks = np.empty(leaves, np.int32)
    leaf_ranks(tree.record, ranks)
    run([partial(leaves_at, tree.record, ranks, photons, of_leaf, i0, min(i0 + size, n)) for i0 in range(0, n, size)])
    sort_by_leaf(of_leaf, begins, order)
    starts = np.empty(n + 1, np.int64)
    groups = sort_by_normal(begins, normals, order, starts)
    return Groups(order, starts[: groups + 1], photons[order], normals[order])
