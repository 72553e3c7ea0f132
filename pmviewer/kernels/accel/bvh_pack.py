"""What the tree is made of and what it becomes: boxes of triangles, and wide nodes with blocks of triangles.

Compiled code that names memory by addresses: triangles of nine float32, rows of boxes and binary nodes as in
`bvh_split`, nodes and blocks as in `simd`.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.box import center, joined, nothing, put_row, row_at
from pmviewer.kernels.accel.bvh_split import FIRST, HELD, share_of
from pmviewer.kernels.accel.simd import BLOCK_BYTES, CHILD_OFFSET, ID_OFFSET, LANES, NODE_BYTES, ROW_BYTES
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import load_f4, load_i4, store_f4, store_i4

MIN_SINE = 1e-7
"""A triangle whose edges span a smaller sine has no usable float32 normal: it is left out, like one without area."""

_TRIANGLE_BYTES = 36

_DEEPEST = 1024
"""Wide nodes that can wait to be filled: the build keeps trees below 72 levels, and a level adds at most seven."""

JOB_SOURCE, JOB_TARGET, JOB_NODES, JOB_BLOCKS, JOB_LEFT = range(5)
"""Numbers of a job of `collapse`; those of what it leaves to others are from JOB_LEFT on."""

_STACK = ROW_BYTES * 3
COLLAPSE_BYTES = _STACK + 8 * _DEEPEST
"""Scratch memory of `collapse`: the box around nothing, pairs of int32 for the children of a node, and for nodes."""


@kernel
def triangle_boxes(triangles, boxes, around, begin, end):
    """Fill rows of `boxes` from `begin` on for the usable ones of the triangles [begin, end), with their numbers;
    returns how many. `around` becomes the box around them and, in the next row, that around their centres."""
    row = first = boxes + ROW_BYTES * begin
    box, centers = nothing(), nothing()
    for i in range(begin, end):
        at = triangles + _TRIANGLE_BYTES * i
        total = np.float64(0.0)
        for k in range(3):
            a, b, c = load_f4(at, k), load_f4(at, 3 + k), load_f4(at, 6 + k)
            store_f4(row, k, min(a, min(b, c)))
            store_f4(row, 4 + k, -max(a, max(b, c)))
            total += abs(np.float64(a)) + abs(np.float64(b)) + abs(np.float64(c))
        if _has_area(at) and total < np.inf:
            store_i4(row, FIRST, np.int32(i))
            store_i4(row, HELD, np.int32(0))
            own = row_at(row)
            box, centers = joined(box, own), joined(centers, center(own))
            row += ROW_BYTES
    put_row(box, around)
    put_row(centers, around + ROW_BYTES)
    # Elements that are numbers of triangles, or differences of them.
    for k in range(FIRST, 2 * LANES, HELD - FIRST):
        store_f4(around, k, np.float32(0.0))
    return (row - first) // ROW_BYTES


@device
def _edge(triangle, corner, k):
    return np.float64(load_f4(triangle, 3 * corner + k)) - np.float64(load_f4(triangle, k))


@device
def _has_area(triangle):
    x1, y1, z1 = _edge(triangle, 1, 0), _edge(triangle, 1, 1), _edge(triangle, 1, 2)
    x2, y2, z2 = _edge(triangle, 2, 0), _edge(triangle, 2, 1), _edge(triangle, 2, 2)
    nx, ny, nz = y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2
    longest = (x1 * x1 + y1 * y1 + z1 * z1) * (x2 * x2 + y2 * y2 + z2 * z2)
    return nx * nx + ny * ny + nz * nz > MIN_SINE * MIN_SINE * longest


@device
def _fill_block(triangles, boxes, count, block):
    """The block of the triangles whose boxes are the first `count` at `boxes`."""
    for lane in range(LANES):
        i = load_i4(boxes + ROW_BYTES * lane, FIRST) if lane < count else np.int32(-1)
        at = triangles + _TRIANGLE_BYTES * np.int64(i)
        for k in range(3):
            corner, u, v = np.float32(0), np.float32(0), np.float32(0)
            if i >= 0:
                corner = load_f4(at, k)
                u, v = load_f4(at, 3 + k) - corner, load_f4(at, 6 + k) - corner
            store_f4(block, LANES * k + lane, corner)
            store_f4(block, LANES * (3 + k) + lane, u)
            store_f4(block, LANES * (6 + k) + lane, v)
        store_i4(block + ID_OFFSET, lane, i)


@device
def _set_lane(node, lane, box, child):
    """One child of a wide node; `box` names the row of its box."""
    for k in range(3):
        store_f4(node, 2 * LANES * k + lane, load_f4(box, k))
        store_f4(node, 2 * LANES * k + LANES + lane, -load_f4(box, 4 + k))
    store_i4(node + CHILD_OFFSET, lane, child)
    store_i4(node + CHILD_OFFSET, LANES + lane, np.int32(0))


@device
def _pair(pairs, i):
    return np.int64(load_i4(pairs, 2 * i)), np.int64(load_i4(pairs, 2 * i + 1))


@device
def _put_pair(pairs, i, first, second):
    store_i4(pairs, 2 * i, np.int32(first))
    store_i4(pairs, 2 * i + 1, np.int32(second))


@kernel
def collapse(triangles, boxes, n_triangles, n_boxes, binary, whole, nodes, blocks, n_blocks_total, job, scratch):
    """Turn what is below a node of the binary tree over so many boxes into wide nodes and blocks.

    `job` has int32 numbers (JOB_SOURCE …): the binary node, the wide node that it becomes, and the next free wide node
    and block, which are those after the last used at the end. Binary nodes from `whole` on that become wide nodes are
    left to others: they get their number, and both numbers go to the end of `job`. Where `nodes` is 0 nothing is
    written but `job`.
    """
    n_nodes, n_blocks = np.int64(load_i4(job, JOB_NODES)), np.int64(load_i4(job, JOB_BLOCKS))
    pending, stack, left = scratch + ROW_BYTES, scratch + _STACK, np.int64(0)
    put_row(nothing(), scratch)
    _put_pair(stack, 0, load_i4(job, JOB_SOURCE), load_i4(job, JOB_TARGET))
    size = np.int64(1)
    while size > 0:
        size -= 1
        source, target = _pair(stack, size)
        target = nodes + NODE_BYTES * target
        lane = np.int64(0)
        _put_pair(pending, 0, source, 1)
        waiting = 1 if n_boxes > 0 else 0
        while waiting > 0:
            waiting -= 1
            c, k = _pair(pending, waiting)
            box = binary + ROW_BYTES * c
            begin, held = np.int64(load_i4(box, FIRST)), np.int64(load_i4(box, HELD))
            share = share_of(held, k)
            if held <= 0 and (c == source or (k > 1 and share > 0)):
                k = LANES if c == source else k
                _put_pair(pending, waiting, begin + 1, k - share)
                _put_pair(pending, waiting + 1, begin, share)
                waiting += 2
                continue
            if held <= 0:
                child = n_nodes
                if c < whole:
                    _put_pair(stack, size, c, n_nodes)
                    size += 1
                else:
                    _put_pair(job + 4 * JOB_LEFT, left, c, n_nodes)
                    left += 1
                n_nodes += 1
            elif begin < n_triangles:
                if nodes != 0:
                    _fill_block(triangles, boxes + ROW_BYTES * begin, held, blocks + BLOCK_BYTES * n_blocks)
                child = ~n_blocks
                n_blocks += 1
            else:
                child = ~(n_blocks_total + load_i4(boxes + ROW_BYTES * begin, FIRST))
            if nodes != 0:
                _set_lane(target, lane, box, np.int32(child))
            lane += 1
        if nodes != 0:
            for i in range(lane, LANES):
                _set_lane(target, i, scratch, np.int32(~0))
    store_i4(job, JOB_NODES, np.int32(n_nodes))
    store_i4(job, JOB_BLOCKS, np.int32(n_blocks))
    return left
