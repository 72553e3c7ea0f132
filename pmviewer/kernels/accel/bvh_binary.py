"""The binary tree that the wide one is made of: large nodes are split one by one, small ones on several threads at the
same time (`bvh_split`).
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.accel.bvh_split import CENTERS, FIRST, HELD, SCRATCH_BYTES, plan_range, subtree
from pmviewer.kernels.accel.simd import LANES, ROW_BYTES
from pmviewer.kernels.memory import aligned_empty
from pmviewer.progress import check, grown, parallel

ALONE = 1 << 16
"""Boxes up to which a subtree is one thread's work."""

F4 = NDArray[np.float32]


@dataclass(frozen=True)
class Binary:
    """`nodes` (k, 8) float32 as `bvh_split` has them, how to collapse them included (`plan_range`); node 0 is the root,
    and the first `n_upper` are those of which each subtree below is one thread's work. `n_blocks` leaves hold
    triangles."""

    nodes: F4
    n_upper: int
    n_blocks: int


@dataclass
class Part:
    """A node and what is below it: two more parts, or a whole subtree (its nodes, itself the first, and its own costs).
    `box` (8,) has (first box, count) as a leaf would."""

    box: F4
    centers: F4
    depth: int
    children: tuple[Part, ...] = ()
    nodes: F4 | None = None
    costs: F4 | None = None
    n_blocks: int = 0


class _Workshop(threading.local):
    """Memory in which a thread builds one part after the other: fresh pages for each would cost a tenth of the build.
    `nodes` and `costs` (2 n + 2, 8) are for parts of up to n boxes."""

    def __init__(self, n: int) -> None:
        self.nodes = aligned_empty((2 * n + 2, LANES), np.float32)
        self.costs = np.empty((2 * n + 2, LANES), np.float32)
        self.scratch = aligned_empty((SCRATCH_BYTES // ROW_BYTES, LANES), np.float32)


@dataclass(frozen=True)
class _Boxes:
    """All boxes (n, 8), those from `n_triangles` on being quadrics or instances, and memory to sort those from `first`
    on."""

    rows: F4
    n_triangles: int
    first: int
    spare: F4
    workshop: _Workshop


def built_part(rows: F4, n_triangles: int, first: int, box: F4, centers: F4, spare: F4, depth: int = 0) -> Part:
    """The tree over the boxes (n, 8) from `first` on, which it reorders; those from `n_triangles` on are quadrics or
    instances. `box` (8,) is that around all of them, `centers` (8,) that around their centres, `spare` (≥ as many, 8)
    memory to sort them, `depth` how many nodes there will be above.

    It is the same for any number of threads. Raises Cancelled.
    """
    count = len(rows) - first
    boxes = _Boxes(rows, n_triangles, first, spare, _Workshop(min(count, ALONE)))
    root = Part(box.copy(), centers.copy(), depth)
    root.box.view(np.int32)[[FIRST, HELD]] = first, count

    def task(part: Part) -> Callable[[], Part]:
        return partial(_advance, boxes, part)

    if count <= ALONE:
        check()
        _advance(boxes, root)
    else:
        grown([task(root)], lambda part: [task(child) for child in part.children])
    return root


def both(left: Part, right: Part) -> Part:
    """A node above two parts, of which one is no child: their depths must begin with 1."""
    box, centers = np.minimum(left.box, right.box), np.minimum(left.centers, right.centers)
    return Part(box, centers, 0, (left, right))


def _advance(boxes: _Boxes, part: Part) -> Part:
    """Split the part in two, or build all of it."""
    begin, count = part.box.view(np.int32)[[FIRST, HELD]].tolist()
    alone, workshop = count <= ALONE, boxes.workshop
    nodes, scratch = workshop.nodes, workshop.scratch
    nodes[0] = part.box
    stack = scratch[CENTERS // ROW_BYTES :]
    stack[0] = part.centers
    spare = boxes.spare.ctypes.data + ROW_BYTES * (begin - boxes.first)
    used, part.n_blocks = subtree(
        boxes.rows.ctypes.data, boxes.n_triangles, spare, nodes.ctypes.data, part.depth, scratch.ctypes.data,
        2 * count + 2 if alone else 1,
    )  # fmt: skip
    if alone:
        plan_range(nodes.ctypes.data, workshop.costs.ctypes.data, 0, used)
        part.nodes, part.costs = nodes[:used].copy(), workshop.costs[:1].copy()
    else:
        part.children = tuple(Part(nodes[i + 1].copy(), stack[i].copy(), part.depth + 1) for i in range(2))
    return part


def binary_tree(root: Part) -> Binary:
    """What is in the parts as one tree, whose collapse is planned above them too. The parts are used up."""
    upper = [root]
    for part in upper:
        upper += part.children
    place = {id(part): i for i, part in enumerate(upper)}
    size = len(upper) + sum(len(part.nodes) - 1 for part in upper if part.nodes is not None)
    nodes, costs = aligned_empty((size, LANES), np.float32), np.empty((len(upper), LANES), np.float32)
    ints = nodes.view(np.int32)
    end = len(upper)
    copies = []
    for i, part in enumerate(upper):
        if part.nodes is None or part.costs is None:
            nodes[i] = part.box
            ints[i, FIRST], ints[i, HELD] = place[id(part.children[0])], 0
            continue
        copies.append(partial(_place, part, nodes, i, end))
        costs[i] = part.costs[0]
        end += len(part.nodes) - 1
    parallel(copies)
    for i in reversed(range(len(upper))):
        if upper[i].children:
            plan_range(nodes.ctypes.data, costs.ctypes.data, i, i + 1)
    return Binary(nodes, len(upper), sum(part.n_blocks for part in upper))


def _place(part: Part, nodes: F4, root: int, start: int) -> None:
    """Copy a whole subtree to its place: its root to the row `root`, what is below to those from `start` on."""
    assert part.nodes is not None
    below = slice(start, start + len(part.nodes) - 1)
    nodes[root], nodes[below] = part.nodes[0], part.nodes[1:]
    ints = nodes.view(np.int32)
    for rows in (slice(root, root + 1), below):
        ints[rows, FIRST] += np.where(ints[rows, HELD] <= 0, np.int32(start - 1), np.int32(0))
    part.nodes = None
