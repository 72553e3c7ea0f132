"""The binary tree that the wide one is made of: binned surface-area heuristic (Wald, "On fast construction of SAH-based
bounding volume hierarchies", 2007), large nodes split one by one, small ones on several threads at the same time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.accel.box import clear, clear_rows, copy_row, grow, grow_by_center, half_area
from pmviewer.kernels.accel.simd import LANES, ROW_BYTES
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import aligned_empty
from pmviewer.progress import check, grown

BINS = 16
MAX_SAH_DEPTH = 40
"""Below this depth nodes are halved by count, which bounds the depth and with it the traversal's stack."""

LEAF_COST = np.float32(1.2)
"""Of testing a block, relative to a wide node; it steers the collapse."""

ALONE = 1 << 16
"""Boxes up to which a subtree is one thread's work."""

_SIDE, _OWN, _SIDES, _LOW, _SCALE, _COSTS, _SCRATCH_ROWS = np.cumsum([3 * BINS, 1, 1, 2, 1, 1, 2]).tolist()
"""Rows of a thread's scratch memory, behind the bins of three axes."""

F4 = NDArray[np.float32]


@dataclass(frozen=True)
class Binary:
    """`nodes` (k, 8) float32: boxes with (first box, count) for a leaf or (index of the first of two adjacent children,
    0) for an inner node; node 0 is the root. `plan` (k, 8) int8 says how to collapse them, see `plan_range`. `n_blocks`
    leaves hold triangles."""

    nodes: F4
    plan: NDArray[np.int8]
    n_blocks: int


@dataclass
class _Part:
    """A node and what is below it: two more parts, or a whole subtree (its nodes, itself the first, their plan and its
    own costs). `box` (1, 8) has (first box, count) as a leaf would."""

    box: F4
    centers: F4
    depth: int
    children: tuple[_Part, ...] = ()
    nodes: F4 | None = None
    plan: NDArray[np.int8] | None = None
    costs: F4 | None = None
    n_blocks: int = 0


def build_binary(boxes: F4, n_triangles: int) -> Binary:
    """The tree over boxes (n, 8), which it reorders; those from `n_triangles` on are quadrics or instances.

    It is the same for any number of threads. Raises Cancelled.
    """
    root = _Part(aligned_empty((1, 8), np.float32), aligned_empty((1, 8), np.float32), 0)
    bound(boxes, 0, len(boxes), root.box, root.centers)
    root.box.view(np.int32)[0, [3, 7]] = 0, len(boxes)

    def task(part: _Part) -> Callable[[], _Part]:
        return partial(_advance, boxes, n_triangles, part)

    if len(boxes) <= ALONE:
        check()
        _advance(boxes, n_triangles, root)
    else:
        grown([task(root)], lambda part: [task(child) for child in part.children])
    return _joined(root)


def _advance(boxes: F4, n_triangles: int, part: _Part) -> _Part:
    """Split the part in two, or build all of it."""
    count = int(part.box.view(np.int32)[0, 7])
    scratch = aligned_empty((_SCRATCH_ROWS, 8), np.float32)
    spare = aligned_empty((max(count, 1), 8), np.float32)
    if count > ALONE:
        nodes, sides = aligned_empty((3, 8), np.float32), aligned_empty((2, 8), np.float32)
        nodes[0] = part.box[0]
        divide(boxes, n_triangles, nodes, nodes.view(np.int32), part.depth, part.centers, sides, scratch, spare)
        part.children = tuple(_Part(nodes[i + 1 : i + 2], sides[i : i + 1], part.depth + 1) for i in range(2))
        return part
    nodes = aligned_empty((2 * count + 2, 8), np.float32)
    nodes[0] = part.box[0]
    ints = nodes.view(np.int32)
    used, part.n_blocks = subtree(boxes, n_triangles, nodes, ints, part.depth, part.centers, scratch, spare)
    plan, costs = np.empty((used, LANES), np.int8), np.zeros((used + 2, LANES), np.float32)
    plan_range(nodes, ints, costs, plan, 0, used)
    part.nodes, part.plan, part.costs = nodes[:used].copy(), plan, costs[:1].copy()
    return part


def _joined(root: _Part) -> Binary:
    """The parts as one tree, whose collapse is planned above them too."""
    upper = [root]
    for part in upper:
        upper += part.children
    place = {id(part): i for i, part in enumerate(upper)}
    size = len(upper) + sum(len(part.nodes) - 1 for part in upper if part.nodes is not None)
    nodes, plan = aligned_empty((size, 8), np.float32), np.empty((size, LANES), np.int8)
    ints, costs = nodes.view(np.int32), np.empty((len(upper), LANES), np.float32)
    end = len(upper)
    for i, part in enumerate(upper):
        if part.nodes is None or part.plan is None or part.costs is None:
            nodes[i] = part.box[0]
            ints[i, 3], ints[i, 7] = place[id(part.children[0])], 0
            continue
        below = slice(end, end + len(part.nodes) - 1)
        nodes[i], nodes[below], plan[i], plan[below] = part.nodes[0], part.nodes[1:], part.plan[0], part.plan[1:]
        costs[i] = part.costs[0]
        for rows in (slice(i, i + 1), below):
            ints[rows, 3] += np.where(ints[rows, 7] == 0, np.int32(end - 1), np.int32(0))
        end = below.stop
        part.nodes = None
    for i in reversed(range(len(upper))):
        if upper[i].children:
            plan_range(nodes, ints, costs, plan, i, i + 1)
    return Binary(nodes, plan, sum(part.n_blocks for part in upper))


@device
def _bin(value, low, scale):
    # Clamped in floating point: the conversion of a huge number or a NaN to an integer is anything.
    position = (value - low) * scale
    return np.int64(position) if position > np.float32(0) and position < np.float32(BINS) else (
        BINS - 1 if position > np.float32(0) else 0
    )  # fmt: skip


@kernel
def bound(boxes, begin, end, box, centers):
    """Into the first rows of `box` and `centers`, the box around boxes [begin, end) and that around their centres,
    twice as far out."""
    at, to, around = boxes.ctypes.data, box.ctypes.data, centers.ctypes.data
    clear(to)
    clear(around)
    for i in range(begin, end):
        grow(to, at + ROW_BYTES * i)
        grow_by_center(around, at + ROW_BYTES * i)


@device
def _split(boxes, begin, end, lanes, sah, centers, children, sides, scratch, spare, counts):
    """Partition boxes [begin, end), whose centres lie in `centers`, at the cheapest border of bins; returns the middle
    (begin < middle < end). `children` (2, 8) become the boxes around both sides, `sides` (2, 8) those of their centres.

    The cost of a side is its area times the number of blocks of `lanes` primitives it fills.
    """
    shift = 3 if lanes == LANES else 0
    best, best_axis, best_bin = np.float32(np.inf), -1, -1
    low, scale, costs = scratch[_LOW], scratch[_SCALE], scratch[_COSTS : _COSTS + 2].reshape(16)
    at, bins = boxes.ctypes.data, scratch.ctypes.data
    if sah:
        for k in range(3):
            low[k] = centers[k]
            extent = -centers[4 + k] - centers[k]
            scale[k] = np.float32(BINS * 0.9999) / extent if extent > np.float32(0) else np.float32(0)
        clear_rows(bins, 3 * BINS)
        counts[:] = 0
        l0, l1, l2, s0, s1, s2 = low[0], low[1], low[2], scale[0], scale[1], scale[2]
        for i in range(begin, end):
            b0 = _bin(boxes[i, 0] - boxes[i, 4], l0, s0)
            b1 = BINS + _bin(boxes[i, 1] - boxes[i, 5], l1, s1)
            b2 = 2 * BINS + _bin(boxes[i, 2] - boxes[i, 6], l2, s2)
            counts[b0] += 1
            counts[b1] += 1
            counts[b2] += 1
            row = at + ROW_BYTES * i
            grow(bins + ROW_BYTES * b0, row)
            grow(bins + ROW_BYTES * b1, row)
            grow(bins + ROW_BYTES * b2, row)
        side, side_at = scratch[_SIDE], bins + ROW_BYTES * _SIDE
        for k in range(3):
            if scale[k] == np.float32(0):
                continue
            count = 0
            clear(side_at)
            for b in range(BINS - 1, 0, -1):
                grow(side_at, bins + ROW_BYTES * (k * BINS + b))
                count += counts[k * BINS + b]
                full = np.float32((count + lanes - 1) >> shift)
                costs[b] = half_area(side) * full if count > 0 else np.float32(np.inf)
            count = 0
            clear(side_at)
            for b in range(BINS - 1):
                grow(side_at, bins + ROW_BYTES * (k * BINS + b))
                count += counts[k * BINS + b]
                if count == 0:
                    continue
                full = np.float32((count + lanes - 1) >> shift)
                cost = half_area(side) * full + costs[b + 1]
                if cost < best:
                    best, best_axis, best_bin = cost, k, b
    if best_axis >= 0:
        left = sides.ctypes.data
        clear_rows(left, 2)
        k, lk, sk = best_axis, low[best_axis], scale[best_axis]
        border = np.float32(best_bin + 1)
        i, j, apart = at + ROW_BYTES * begin, np.int64(0), spare.ctypes.data
        for row in range(at + ROW_BYTES * begin, at + ROW_BYTES * end, ROW_BYTES):
            # Without a branch, which the processor would guess wrong half the time: to both places, one of which stays.
            box = (row - at) >> 5
            behind = np.int64((boxes[box, k] - boxes[box, 4 + k] - lk) * sk >= border)
            grow_by_center(left + ROW_BYTES * behind, row)
            copy_row(row, apart + j)
            copy_row(row, i)
            i += ROW_BYTES * (1 - behind)
            j += ROW_BYTES * behind
        for moved in range(0, j, ROW_BYTES):
            copy_row(apart + moved, i + moved)
        i = (i - at) >> 5
        if begin < i < end:
            first = children.ctypes.data
            clear_rows(first, 2)
            for b in range(BINS):
                grow(first if b <= best_bin else first + 32, bins + ROW_BYTES * (k * BINS + b))
            return i
    middle = (begin + end) // 2
    _halve(boxes, begin, middle, end, children, sides)
    return middle


@device
def _halve(boxes, begin, middle, end, children, sides):
    at, first, left = boxes.ctypes.data, children.ctypes.data, sides.ctypes.data
    clear_rows(first, 2)
    clear_rows(left, 2)
    for i in range(begin, end):
        side = 0 if i < middle else 32
        grow(first + side, at + ROW_BYTES * i)
        grow_by_center(left + side, at + ROW_BYTES * i)


@device
def _divide(boxes, n_triangles, nodes, node_ints, node, first, depth, centers, sides, scratch, spare, counts):
    """Give an inner node its children, rows `first` and `first` + 1; returns where their boxes part."""
    begin = np.int64(node_ints[node, 3])
    end = begin + node_ints[node, 7]
    children = nodes[first : first + 2]
    if begin < n_triangles < end:
        middle = np.int64(n_triangles)
        _halve(boxes, begin, middle, end, children, sides)
    else:
        lanes = LANES if begin < n_triangles else 1
        sah = depth < MAX_SAH_DEPTH
        middle = _split(boxes, begin, end, lanes, sah, centers, children, sides, scratch, spare, counts)
    node_ints[first, 3], node_ints[first, 7] = begin, middle - begin
    node_ints[first + 1, 3], node_ints[first + 1, 7] = middle, end - middle
    node_ints[node, 3], node_ints[node, 7] = first, 0
    return middle


@device
def _put(row, into):
    # Numba's own assignment of rows takes a second to compile: it can tell of rows that don't match.
    for k in range(LANES):
        into[k] = row[k]


@kernel
def divide(boxes, n_triangles, nodes, node_ints, depth, centers, sides, scratch, spare):
    """Give node 0 of nodes (3, 8) the children 1 and 2, with their boxes as leaves would have them; `centers` (1, 8)
    and `sides` (2, 8) hold the boxes around the centres of its and of their boxes."""
    counts = np.empty(3 * BINS, np.int32)
    _divide(boxes, n_triangles, nodes, node_ints, 0, 1, depth, centers[0], sides, scratch, spare, counts)


@kernel
def subtree(boxes, n_triangles, nodes, node_ints, depth, centers, scratch, spare):
    """All descendants of node 0, behind it in `nodes`, children behind their parents; returns the numbers of nodes and
    of blocks."""
    counts = np.empty(3 * BINS, np.int32)
    stack = np.empty((256, 2), np.int64)
    waiting = np.empty((256, 8), np.float32)
    own, sides = scratch[_OWN], scratch[_SIDES : _SIDES + 2]
    stack[0, 0], stack[0, 1] = 0, depth
    _put(centers[0], waiting[0])
    size, used, n_blocks = 1, np.int64(1), np.int64(0)
    while size > 0:
        size -= 1
        index, depth = stack[size, 0], stack[size, 1]
        begin = np.int64(node_ints[index, 3])
        end = begin + node_ints[index, 7]
        if end - begin <= (LANES if begin < n_triangles else 1) and not begin < n_triangles < end:
            n_blocks += 1 if begin < n_triangles and end > begin else 0
            continue
        _put(waiting[size], own)
        _divide(boxes, n_triangles, nodes, node_ints, index, used, depth, own, sides, scratch, spare, counts)
        for child in range(2):
            stack[size, 0], stack[size, 1] = used + child, depth + 1
            _put(sides[child], waiting[size])
            size += 1
        used += 2
    return used, n_blocks


@kernel
def plan_range(binary, binary_ints, costs, plan, first, end):
    """For the nodes [first, end), last to first: which descendants of each become children of a wide node, at least
    expected cost (Ylitie, Karras and Laine 2017, section 3.3).

    costs[c, k - 1] is the cost of the subtree c as at most k children of a wide node above it, plan[c, k - 1] how many
    of the k its left half gets; 0: c stays whole, as one child. plan[c, 0] is the left half's share of the eight when c
    is a wide node itself.
    """
    for c in range(end - 1, first - 1, -1):
        area = half_area(binary[c])
        if binary_ints[c, 7] > 0:
            costs[c], plan[c] = area * LEAF_COST, 0
            continue
        left = np.int64(binary_ints[c, 3])
        for k in range(LANES, 0, -1):
            wanted = k if k > 1 else LANES
            best, share = np.float32(np.inf), 1
            for i in range(1, wanted):
                cost = costs[left, i - 1] + costs[left + 1, wanted - i - 1]
                if cost < best:
                    best, share = cost, i
            costs[c, k - 1], plan[c, k - 1] = best, share
        costs[c, 0] += area
        for k in range(1, LANES):
            if costs[c, 0] <= costs[c, k]:
                costs[c, k], plan[c, k] = costs[c, 0], 0
