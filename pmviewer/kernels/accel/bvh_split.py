"""Splitting boxes by the binned surface-area heuristic (Wald, "On fast construction of SAH-based bounding volume
hierarchies", 2007): the compiled part of `bvh_binary`.

All memory is rows of 32 bytes (`box`) named by their addresses. A node is a box with two int32: in FIRST the first of
its boxes, or of its two adjacent children; in HELD the number of its boxes, or for an inner node a number below 1,
which `plan_range` fills.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.box import (
    BINS,
    beyond,
    bins_of,
    center,
    count_one,
    half_area,
    is_beyond,
    joined,
    nothing,
    position_along,
    put_row,
    row_at,
    short_of,
)
from pmviewer.kernels.accel.simd import LANES, ROW_BYTES
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import load_f4, load_i4, store_f4, store_i4

MAX_SAH_DEPTH = 40
"""Below this depth nodes are halved by count, which bounds the depth and with it the traversal's stack."""

LEAF_COST = np.float32(1.2)
"""Of testing a block, relative to a wide node; it steers the collapse."""

FIRST, HELD = 3, 7
"""Elements of a node's row that are integers."""

WAITING = 256
"""Nodes that can wait to be split, at most: two a level."""

_COUNTS, _LOW, _SCALE, _COSTS, _SIDES, _CENTERS, _STACK, _END = (
    ROW_BYTES * np.cumsum([3 * BINS, 3 * BINS // LANES, 1, 1, BINS // LANES, 2, WAITING, 2 * WAITING // LANES])
).tolist()
"""Where in a thread's scratch memory what begins; the bins of three axes are first. CENTERS are the boxes around the
centres of the boxes of each waiting node, STACK its number and depth."""

CENTERS, SCRATCH_BYTES = _CENTERS, _END


@device
def _count_bins(first, last, scratch):
    """Sort the boxes at [first, last) into bins: the box around those in each, and their number."""
    low, scale, counts = row_at(scratch + _LOW), row_at(scratch + _SCALE), scratch + _COUNTS
    for row in range(scratch, counts, ROW_BYTES):
        put_row(nothing(), row)
    for i in range(3 * BINS):
        store_i4(counts, i, np.int32(0))
    # From both halves by turns: neighbours are in the same bin, and the second would wait for the first.
    half = (last - first) // (2 * ROW_BYTES) * ROW_BYTES
    for at in range(first, first + half, ROW_BYTES):
        _enter(row_at(at), scratch, low, scale)
        _enter(row_at(at + half), scratch, low, scale)
    for at in range(first + 2 * half, last, ROW_BYTES):
        _enter(row_at(at), scratch, low, scale)


@device
def _enter(box, bins, low, scale):
    x, y, z = bins_of(center(box), low, scale)
    _enter_in(box, bins, x)
    _enter_in(box, bins, y)
    _enter_in(box, bins, z)


@device
def _enter_in(box, bins, i):
    row = bins + ROW_BYTES * i
    put_row(joined(row_at(row), box), row)
    count_one(bins + _COUNTS, i)


@device
def _best_border(scratch, shift):
    """The cheapest border of bins: the number of the last bin before it, −1 without one.

    The cost of a side is its area times the number of blocks of 2^shift primitives that it fills.
    """
    best, place = np.float32(np.inf), np.int64(-1)
    costs, more = scratch + _COSTS, (1 << shift) - 1
    for k in range(3):
        if load_f4(scratch + _SCALE, k) == np.float32(0):
            continue
        bins, counts = scratch + ROW_BYTES * BINS * k, scratch + _COUNTS + 4 * BINS * k
        side, count = nothing(), np.int64(0)
        for b in range(BINS - 1, 0, -1):
            side = joined(side, row_at(bins + ROW_BYTES * b))
            count += load_i4(counts, b)
            full = np.float32((count + more) >> shift)
            store_f4(costs, b, half_area(side) * full if count > 0 else np.float32(np.inf))
        side, count = nothing(), np.int64(0)
        for b in range(BINS - 1):
            side = joined(side, row_at(bins + ROW_BYTES * b))
            count += load_i4(counts, b)
            if count > 0:
                cost = half_area(side) * np.float32((count + more) >> shift) + load_f4(costs, b + 1)
                if cost < best:
                    best, place = cost, np.int64(BINS * k + b)
    return place


@device
def _partition(first, last, spare, place, children, scratch):
    """Put the boxes at [first, last) on their side of the border behind bin `place`; returns where the second side
    begins. `children` becomes the boxes around both sides, the scratch's sides those around their centres."""
    axis, bin_ = place // BINS, place % BINS
    low, scale, border = load_f4(scratch + _LOW, axis), load_f4(scratch + _SCALE, axis), np.float32(bin_ + 1)
    left, right = nothing(), nothing()
    front, apart = first, spare
    for at in range(first, last, ROW_BYTES):
        # Without a branch, which the processor would guess wrong half the time: to both places, one of which stays.
        box, position = row_at(at), position_along(at, axis, low, scale)
        left = joined(left, short_of(center(box), position, border))
        right = joined(right, beyond(center(box), position, border))
        put_row(box, apart)
        put_row(box, front)
        behind = ROW_BYTES * is_beyond(position, border)
        front += ROW_BYTES - behind
        apart += behind
    for at in range(spare, apart, ROW_BYTES):
        put_row(row_at(at), front + (at - spare))
    put_row(left, scratch + _SIDES)
    put_row(right, scratch + _SIDES + ROW_BYTES)
    left, right = nothing(), nothing()
    bins = scratch + ROW_BYTES * BINS * axis
    for b in range(bin_ + 1):
        left = joined(left, row_at(bins + ROW_BYTES * b))
    for b in range(bin_ + 1, BINS):
        right = joined(right, row_at(bins + ROW_BYTES * b))
    put_row(left, children)
    put_row(right, children + ROW_BYTES)
    return front


@device
def _halve(first, middle, last, children, scratch):
    """The same for a border that is given by the place of a box."""
    for side in range(2):
        around, centers = nothing(), nothing()
        for at in range(middle if side else first, last if side else middle, ROW_BYTES):
            box = row_at(at)
            around, centers = joined(around, box), joined(centers, center(box))
        put_row(around, children + ROW_BYTES * side)
        put_row(centers, scratch + _SIDES + ROW_BYTES * side)


@device
def _split(first, last, spare, shift, centers, children, scratch):
    """Partition the boxes at [first, last), whose centres lie in the row at `centers`, at the cheapest border; returns
    where the second side begins, `first` where there is no border between them."""
    for k in range(3):
        low = load_f4(centers, k)
        extent = -load_f4(centers, 4 + k) - low
        store_f4(scratch + _LOW, k, low)
        scale = np.float32(BINS * 0.9999) / extent if extent > np.float32(0) else np.float32(0)
        store_f4(scratch + _SCALE, k, scale)
    _count_bins(first, last, scratch)
    place = _best_border(scratch, shift)
    return _partition(first, last, spare, place, children, scratch) if place >= 0 else first


@kernel
def subtree(boxes, n_triangles, spare, nodes, depth, scratch, rounds):
    """Descendants of node 0, behind it in `nodes`, children behind their parents: all, or those of the first `rounds`
    splits. Returns the numbers of nodes and of blocks.

    `boxes` (n, 8), those from `n_triangles` on being no triangles; `spare` has room for as many rows as node 0 has
    boxes, the row at `scratch` + CENTERS the box around their centres. After one round the rows there have those of
    both children.
    """
    centers, stack = scratch + CENTERS, scratch + _STACK
    store_i4(stack, 0, np.int32(0))
    store_i4(stack, 1, np.int32(depth))
    size, used, n_blocks = np.int64(1), np.int64(1), np.int64(0)
    while size > 0 and rounds > 0:
        size, rounds = size - 1, rounds - 1
        node = nodes + ROW_BYTES * np.int64(load_i4(stack, 2 * size))
        depth = np.int64(load_i4(stack, 2 * size + 1))
        begin = np.int64(load_i4(node, FIRST))
        end = begin + load_i4(node, HELD)
        mixed, shift = begin < n_triangles < end, 3 if begin < n_triangles else 0
        if end - begin <= 1 << shift and not mixed:
            n_blocks += 1 if begin < n_triangles and end > begin else 0
            continue
        first, last, children = boxes + ROW_BYTES * begin, boxes + ROW_BYTES * end, nodes + ROW_BYTES * used
        middle = boxes + ROW_BYTES * n_triangles if mixed else first
        if depth < MAX_SAH_DEPTH and not mixed:
            middle = _split(first, last, spare, shift, centers + ROW_BYTES * size, children, scratch)
        if mixed or not first < middle < last:
            middle = middle if mixed else boxes + ROW_BYTES * ((begin + end) // 2)
            _halve(first, middle, last, children, scratch)
        parted = (middle - boxes) // ROW_BYTES
        store_i4(node, FIRST, np.int32(used))
        store_i4(node, HELD, np.int32(0))
        for i in range(2):
            store_i4(children + ROW_BYTES * i, FIRST, np.int32(parted if i else begin))
            store_i4(children + ROW_BYTES * i, HELD, np.int32(end - parted if i else parted - begin))
            store_i4(stack, 2 * size, np.int32(used + i))
            store_i4(stack, 2 * size + 1, np.int32(depth + 1))
            put_row(row_at(scratch + _SIDES + ROW_BYTES * i), centers + ROW_BYTES * size)
            size += 1
        used += 2
    return used, n_blocks


@kernel
def plan_range(nodes, costs, first, end):
    """For the nodes [first, end), last to first: which descendants of each become children of a wide node, at least
    expected cost (Ylitie, Karras and Laine 2017, section 3.3).

    Element k - 1 of the row c of `costs` is the cost of the subtree c as at most k children of a wide node above it.
    How many of the k its left half gets goes into HELD (`share_of`); 0: c stays whole, as one child. The share for
    k = 1 is the left half's of the eight when c is a wide node itself.
    """
    for c in range(end - 1, first - 1, -1):
        node, own = nodes + ROW_BYTES * c, costs + ROW_BYTES * c
        area = half_area(row_at(node))
        if load_i4(node, HELD) > 0:
            for k in range(LANES):
                store_f4(own, k, area * LEAF_COST)
            continue
        left = costs + ROW_BYTES * np.int64(load_i4(node, FIRST))
        shares = np.int64(0)
        for k in range(LANES, 0, -1):
            wanted = k if k > 1 else LANES
            best, share = np.float32(np.inf), np.int64(1)
            for i in range(1, wanted):
                cost = load_f4(left, i - 1) + load_f4(left, LANES + wanted - i - 1)
                if cost < best:
                    best, share = cost, np.int64(i)
            store_f4(own, k - 1, best + area if k == 1 else best)
            shares = shares << 3 | share
        whole = load_f4(own, 0)
        for k in range(1, LANES):
            if whole <= load_f4(own, k):
                store_f4(own, k, whole)
                shares &= ~(7 << 3 * k)
        store_i4(node, HELD, np.int32(~shares))


@device
def share_of(held, k):
    """What an inner node's HELD says its left half gets of k children."""
    return np.int64(~held >> 3 * (k - 1)) & 7
