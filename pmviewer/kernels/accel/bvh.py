"""Building the 8-wide bounding volume hierarchy that `raycast` traverses.

First a binary tree by binned surface-area heuristic (`bvh_binary`), then a collapse of up to eight descendants into one
node, planned by dynamic programming (Ylitie, Karras, Laine, "Efficient incoherent ray traversal on GPUs through
compressed wide BVHs", 2017, section 3.3). Triangles sit in blocks of up to eight; quadrics are leaves of their own.

A child index c of a wide node is a node if c >= 0; otherwise ~c is a block, or, from `n_blocks` on, quadric
~c - n_blocks, or, beyond the quadrics, an instance. Memory layouts are in `simd`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.accel.bvh_binary import build_binary
from pmviewer.kernels.accel.quadric import QUADRIC_FLOATS, quadric_bounds
from pmviewer.kernels.accel.simd import BLOCK_ROWS, LANES, NODE_ROWS
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import aligned_empty
from pmviewer.progress import parallel

MIN_SINE = 1e-7
"""A triangle whose edges span a smaller sine has no usable float32 normal: it is left out, like one without area."""

_AT_ONCE = 1 << 17
"""Triangles that one thread looks at at a time."""

BVH_FIELDS = [
    ("bvh_nodes", "i8"),
    ("bvh_blocks", "i8"),
    ("bvh_quadrics", "i8"),
    ("bvh_n_blocks", "i8"),
    ("n_triangles", "i8"),
]
"""The fields of a scene record that ray casting reads: three addresses and two counts."""

F4 = NDArray[np.float32]


@dataclass(frozen=True)
class Bvh:
    """The tree over triangles 0 … n_triangles - 1 and quadrics n_triangles … ; keep it alive while kernels use it.

    `nodes` (k, 8, 8) and `blocks` (n_blocks, 10, 8) float32 as laid out in `simd`, `quadrics` (m, 12) float32.
    """

    nodes: F4
    blocks: F4
    quadrics: F4
    n_triangles: int

    @property
    def nodes_address(self) -> int:
        """For the scene's record, as the other addresses: kernels read the arrays through it."""
        return self.nodes.ctypes.data

    @property
    def blocks_address(self) -> int:
        """Of the triangles."""
        return self.blocks.ctypes.data

    @property
    def quadrics_address(self) -> int:
        """Of spheres, cylinders and disks."""
        return self.quadrics.ctypes.data

    @property
    def n_blocks(self) -> int:
        """Child indices from this on are quadrics."""
        return len(self.blocks)

    @property
    def bytes(self) -> int:
        """Of all three arrays."""
        return self.nodes.nbytes + self.blocks.nbytes + self.quadrics.nbytes

    def store(self, record: np.record) -> None:
        """Write addresses and counts into a record that has `BVH_FIELDS`."""
        record["bvh_nodes"] = self.nodes_address
        record["bvh_blocks"] = self.blocks_address
        record["bvh_quadrics"] = self.quadrics_address
        record["bvh_n_blocks"] = self.n_blocks
        record["n_triangles"] = self.n_triangles


def build(triangles: F4, quadrics: F4, boxed: tuple[F4, F4] | None = None) -> Bvh:
    """The tree over `triangles` (n, 3, 3), world-space vertices, `quadrics` (m, 12), see `quadric`, and instances, of
    which `boxed` has the lower and upper corners, (k, 3) each.

    Triangles without area and primitives with non-finite coordinates are left out of the tree: no ray meets them. Their
    ids stay taken.
    """
    triangles = np.ascontiguousarray(triangles, np.float32).reshape(-1, 3, 3)
    own_quadrics = aligned_empty((max(len(quadrics), 1), QUADRIC_FLOATS), np.float32)
    own_quadrics[:] = 0.0
    own_quadrics[: len(quadrics)] = quadrics
    lower, upper = quadric_bounds(own_quadrics[: len(quadrics)])
    if boxed is not None:
        lower, upper = np.concatenate([lower, boxed[0]]), np.concatenate([upper, boxed[1]])
    boxes = aligned_empty((len(triangles) + len(lower), 8), np.float32)
    n_kept = _boxes_of(triangles, boxes)
    kept = np.flatnonzero(np.isfinite(lower).all(1) & np.isfinite(upper).all(1))
    boxes = boxes[: n_kept + len(kept)]
    boxes[n_kept:, 0:3], boxes[n_kept:, 4:7] = lower[kept], -upper[kept]
    boxes.view(np.int32)[n_kept:, 3] = kept

    binary = build_binary(boxes, n_kept)
    nodes = aligned_empty((len(binary.nodes) // 2 + 1, NODE_ROWS, LANES), np.float32)
    # An unused lane refers to block 0, which therefore always exists.
    blocks = aligned_empty((max(binary.n_blocks, 1), BLOCK_ROWS, LANES), np.float32)
    blocks[0] = 0.0
    n_nodes = _collapse(
        triangles, boxes.view(np.int32), n_kept, binary.nodes, binary.nodes.view(np.int32), binary.plan,
        nodes, nodes.view(np.int32), blocks, blocks.view(np.int32),
    )  # fmt: skip
    own_nodes = aligned_empty((n_nodes, NODE_ROWS, LANES), np.float32)
    own_nodes[:] = nodes[:n_nodes]
    return Bvh(own_nodes, blocks, own_quadrics, len(triangles))


def _boxes_of(triangles: F4, boxes: F4) -> int:
    """Fill `boxes` with those of the usable triangles in their order; returns their number."""
    ids = boxes.view(np.int32)
    starts = range(0, len(triangles), _AT_ONCE)
    tasks = [partial(_triangle_boxes, triangles, boxes, ids, i, min(i + _AT_ONCE, len(triangles))) for i in starts]
    count = 0
    for start, found in zip(starts, parallel(tasks)):
        if count < start:
            boxes[count : count + found] = boxes[start : start + found].copy()
        count += found
    return count


@kernel
def _triangle_boxes(triangles, boxes, box_ids, begin, end):
    """Fill rows of `boxes` (n, 8) from `begin` on, as `bvh_binary` has them, for the usable ones of the triangles
    [begin, end); returns their number."""
    count = begin
    for i in range(begin, end):
        total = np.float64(0.0)
        for k in range(3):
            a, b, c = triangles[i, 0, k], triangles[i, 1, k], triangles[i, 2, k]
            boxes[count, k] = min(a, min(b, c))
            boxes[count, 4 + k] = -max(a, max(b, c))
            total += abs(np.float64(a)) + abs(np.float64(b)) + abs(np.float64(c))
        x1 = np.float64(triangles[i, 1, 0]) - np.float64(triangles[i, 0, 0])
        y1 = np.float64(triangles[i, 1, 1]) - np.float64(triangles[i, 0, 1])
        z1 = np.float64(triangles[i, 1, 2]) - np.float64(triangles[i, 0, 2])
        x2 = np.float64(triangles[i, 2, 0]) - np.float64(triangles[i, 0, 0])
        y2 = np.float64(triangles[i, 2, 1]) - np.float64(triangles[i, 0, 1])
        z2 = np.float64(triangles[i, 2, 2]) - np.float64(triangles[i, 0, 2])
        nx, ny, nz = y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2
        longest = (x1 * x1 + y1 * y1 + z1 * z1) * (x2 * x2 + y2 * y2 + z2 * z2)
        usable = nx * nx + ny * ny + nz * nz > MIN_SINE * MIN_SINE * longest
        if usable and total < np.inf:
            box_ids[count, 3] = i
            box_ids[count, 7] = 0
            count += 1
    return count - begin


@device
def _fill_block(triangles, box_ints, begin, count, block, block_ints):
    for lane in range(LANES):
        i = box_ints[begin + lane, 3] if lane < count else -1
        for k in range(3):
            if i >= 0:
                corner = triangles[i, 0, k]
                block[k, lane] = corner
                block[3 + k, lane] = triangles[i, 1, k] - corner
                block[6 + k, lane] = triangles[i, 2, k] - corner
            else:
                block[k, lane] = block[3 + k, lane] = block[6 + k, lane] = np.float32(0)
        block_ints[9, lane] = i


@kernel
def _collapse(triangles, box_ints, n_triangles, binary, binary_ints, plan, nodes, node_ints, blocks, block_ints):
    """Turn the binary tree into wide nodes and blocks; returns the number of wide nodes."""
    n_blocks_total = len(blocks)
    n_nodes, n_blocks = 1, 0
    stack = np.empty((1024, 2), np.int64)
    stack[0, 0], stack[0, 1] = 0, 0
    size = 1
    pending = np.empty((LANES, 2), np.int64)
    while size > 0:
        size -= 1
        source, target = stack[size, 0], stack[size, 1]
        lane = 0
        pending[0, 0], pending[0, 1] = source, 1
        waiting = 1 if len(box_ints) > 0 else 0
        while waiting > 0:
            waiting -= 1
            c, k = pending[waiting, 0], pending[waiting, 1]
            begin, held = np.int64(binary_ints[c, 3]), np.int64(binary_ints[c, 7])
            share = np.int64(plan[c, k - 1])
            if held == 0 and (c == source or (k > 1 and share > 0)):
                k = LANES if c == source else k
                pending[waiting, 0], pending[waiting, 1] = begin + 1, k - share
                pending[waiting + 1, 0], pending[waiting + 1, 1] = begin, share
                waiting += 2
                continue
            for i in range(3):
                nodes[target, 2 * i, lane], nodes[target, 2 * i + 1, lane] = binary[c, i], -binary[c, 4 + i]
            if held == 0:
                node_ints[target, 6, lane] = n_nodes
                stack[size, 0], stack[size, 1] = c, n_nodes
                size += 1
                n_nodes += 1
            elif begin < n_triangles:
                _fill_block(triangles, box_ints, begin, held, blocks[n_blocks], block_ints[n_blocks])
                node_ints[target, 6, lane] = ~n_blocks
                n_blocks += 1
            else:
                node_ints[target, 6, lane] = ~(n_blocks_total + box_ints[begin, 3])
            lane += 1
        node_ints[target, 7] = 0
        for i in range(lane, LANES):
            for k in range(3):
                nodes[target, 2 * k, i], nodes[target, 2 * k + 1, i] = np.float32(np.inf), np.float32(-np.inf)
            node_ints[target, 6, i] = ~0
    return n_nodes
