"""Building the 8-wide bounding volume hierarchy that `raycast` traverses.

First a binary tree by binned surface-area heuristic (Wald, "On fast construction of SAH-based bounding volume
hierarchies", 2007), then a collapse of up to eight descendants into one node, planned by dynamic programming (Ylitie,
Karras, Laine, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs", 2017, section 3.3). Triangles
sit in blocks of up to eight; quadrics are leaves of their own.

A child index c of a wide node is a node if c >= 0; otherwise ~c is a block, or, from `n_blocks` on, quadric
~c - n_blocks, or, beyond the quadrics, an instance. Memory layouts are in `simd`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.jit import device, kernel
from pmviewer.kernels.memory import aligned_empty
from pmviewer.kernels.quadric import QUADRIC_FLOATS, quadric_bounds
from pmviewer.kernels.simd import BLOCK_ROWS, LANES, NODE_ROWS

BINS = 16
MAX_SAH_DEPTH = 40
"""Below this depth nodes are halved by count, which bounds the depth and with it the traversal's stack."""

LEAF_COST = np.float32(1.2)
"""Of testing a block, relative to a wide node; it steers the collapse."""

MIN_SINE = 1e-7
"""A triangle whose edges span a smaller sine has no usable float32 normal: it is left out, like one without area."""

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
        return self.nodes.ctypes.data

    @property
    def blocks_address(self) -> int:
        return self.blocks.ctypes.data

    @property
    def quadrics_address(self) -> int:
        return self.quadrics.ctypes.data

    @property
    def n_blocks(self) -> int:
        return len(self.blocks)

    @property
    def bytes(self) -> int:
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
    n_kept = _triangle_boxes(triangles, boxes, boxes.view(np.int32))
    kept = np.flatnonzero(np.isfinite(lower).all(1) & np.isfinite(upper).all(1))
    boxes = boxes[: n_kept + len(kept)]
    boxes[n_kept:, 0:3], boxes[n_kept:, 4:7] = lower[kept], upper[kept]
    boxes.view(np.int32)[n_kept:, 3] = kept

    binary = aligned_empty((2 * len(boxes) + 2, 8), np.float32)
    n_binary, n_blocks = _build_binary(boxes, boxes.view(np.int32), n_kept, binary, binary.view(np.int32))
    plan = np.empty((n_binary, LANES), np.int8)
    _plan_collapse(binary, binary.view(np.int32), np.empty((n_binary, LANES), np.float32), plan)
    nodes = aligned_empty((n_binary // 2 + 1, NODE_ROWS, LANES), np.float32)
    # An unused lane refers to block 0, which therefore always exists.
    blocks = aligned_empty((max(n_blocks, 1), BLOCK_ROWS, LANES), np.float32)
    blocks[0] = 0.0
    n_nodes = _collapse(
        triangles, boxes.view(np.int32), n_kept, binary, binary.view(np.int32), plan,
        nodes, nodes.view(np.int32), blocks, blocks.view(np.int32),
    )  # fmt: skip
    own_nodes = aligned_empty((n_nodes, NODE_ROWS, LANES), np.float32)
    own_nodes[:] = nodes[:n_nodes]
    return Bvh(own_nodes, blocks, own_quadrics, len(triangles))


@kernel
def _triangle_boxes(triangles, boxes, box_ids):
    """Fill boxes (n, 8): lower corner, id, upper corner, unused, of the usable triangles; returns their number."""
    count = 0
    for i in range(len(triangles)):
        total = np.float64(0.0)
        for k in range(3):
            a, b, c = triangles[i, 0, k], triangles[i, 1, k], triangles[i, 2, k]
            boxes[count, k] = min(a, min(b, c))
            boxes[count, 4 + k] = max(a, max(b, c))
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
    return count


@device
def _empty(box):
    box[0] = box[1] = box[2] = np.float32(np.inf)
    box[4] = box[5] = box[6] = np.float32(-np.inf)


@device
def _grow(box, other):
    for k in range(3):
        box[k] = min(box[k], other[k])
        box[4 + k] = max(box[4 + k], other[4 + k])


@device
def _make_node(nodes, node_ints, index, boxes, begin, end):
    """Node `index` as a leaf over boxes [begin, end): lower corner, begin, upper corner, count."""
    node = nodes[index]
    _empty(node)
    for i in range(begin, end):
        _grow(node, boxes[i])
    node_ints[index, 3], node_ints[index, 7] = begin, end - begin


@device
def _half_area(box):
    dx, dy, dz = box[4] - box[0], box[5] - box[1], box[6] - box[2]
    return dx * dy + dy * dz + dz * dx


@device
def _bin(value, low, scale):
    # Clamped in floating point: the conversion of a huge number or a NaN to an integer is anything.
    position = (value - low) * scale
    return np.int64(position) if position > np.float32(0) and position < np.float32(BINS) else (
        BINS - 1 if position > np.float32(0) else 0
    )  # fmt: skip


@device
def _split(boxes, box_ints, begin, end, lanes, bin_boxes, bin_counts, costs):
    """Partition boxes [begin, end) at the cheapest bin border; returns the middle (begin < middle < end).

    The cost of a side is its area times the number of blocks of `lanes` primitives it fills.
    """
    low, high = np.empty(3, np.float32), np.empty(3, np.float32)
    low[:], high[:] = np.float32(np.inf), np.float32(-np.inf)
    for i in range(begin, end):
        for k in range(3):
            center = boxes[i, k] + boxes[i, 4 + k]
            low[k], high[k] = min(low[k], center), max(high[k], center)
    scale = np.empty(3, np.float32)
    for k in range(3):
        extent = high[k] - low[k]
        scale[k] = np.float32(BINS * 0.9999) / extent if extent > np.float32(0) else np.float32(0)
    bin_counts[:] = 0
    for k in range(3):
        for b in range(BINS):
            _empty(bin_boxes[k, b])
    for i in range(begin, end):
        for k in range(3):
            b = _bin(boxes[i, k] + boxes[i, 4 + k], low[k], scale[k])
            bin_counts[k, b] += 1
            _grow(bin_boxes[k, b], boxes[i])

    best, best_axis, best_bin = np.float32(np.inf), -1, -1
    side = np.empty(8, np.float32)
    for k in range(3):
        if scale[k] == np.float32(0):
            continue
        count = 0
        _empty(side)
        for b in range(BINS - 1, 0, -1):
            _grow(side, bin_boxes[k, b])
            count += bin_counts[k, b]
            full = np.float32((count + lanes - 1) // lanes)
            costs[b] = _half_area(side) * full if count > 0 else np.float32(np.inf)
        count = 0
        _empty(side)
        for b in range(BINS - 1):
            _grow(side, bin_boxes[k, b])
            count += bin_counts[k, b]
            if count == 0:
                continue
            full = np.float32((count + lanes - 1) // lanes)
            cost = _half_area(side) * full + costs[b + 1]
            if cost < best:
                best, best_axis, best_bin = cost, k, b
    if best_axis < 0:
        return (begin + end) // 2

    i, j, k = begin, end - 1, best_axis
    while True:
        while i <= j and _bin(boxes[i, k] + boxes[i, 4 + k], low[k], scale[k]) <= best_bin:
            i += 1
        while i <= j and _bin(boxes[j, k] + boxes[j, 4 + k], low[k], scale[k]) > best_bin:
            j -= 1
        if i >= j:
            break
        for c in range(8):
            box_ints[i, c], box_ints[j, c] = box_ints[j, c], box_ints[i, c]
    return i if begin < i < end else (begin + end) // 2


@kernel
def _build_binary(boxes, box_ints, n_triangles, nodes, node_ints):
    """Fill nodes (2n + 2, 8) with the tree over boxes (n, 8), reordering them; root 0, children behind their parents.

    Boxes from `n_triangles` on are quadrics. A leaf keeps (first box, count); an inner node (index of the first of two
    adjacent children, 0). Returns the numbers of nodes and of blocks.
    """
    n = len(boxes)
    bin_boxes = np.empty((3, BINS, 8), np.float32)
    bin_counts = np.empty((3, BINS), np.int32)
    costs = np.empty(BINS + 1, np.float32)
    stack = np.empty((256, 2), np.int64)
    n_nodes, n_blocks = np.int64(1), np.int64(0)
    _make_node(nodes, node_ints, np.int64(0), boxes, np.int64(0), np.int64(n))
    stack[0, 0], stack[0, 1] = 0, 0
    size = 1 if n > 0 else 0
    while size > 0:
        size -= 1
        index, depth = stack[size, 0], stack[size, 1]
        begin = np.int64(node_ints[index, 3])
        end = begin + node_ints[index, 7]
        mixed = begin < n_triangles < end
        lanes = LANES if begin < n_triangles else 1
        if end - begin <= lanes and not mixed:
            n_blocks += 1 if begin < n_triangles else 0
            continue
        if mixed:
            middle = np.int64(n_triangles)
        elif depth < MAX_SAH_DEPTH:
            middle = _split(boxes, box_ints, begin, end, lanes, bin_boxes, bin_counts, costs)
        else:
            middle = (begin + end) // 2
        _make_node(nodes, node_ints, n_nodes, boxes, begin, middle)
        _make_node(nodes, node_ints, n_nodes + 1, boxes, middle, end)
        node_ints[index, 3], node_ints[index, 7] = n_nodes, 0
        for child in range(2):
            stack[size, 0], stack[size, 1] = n_nodes + child, depth + 1
            size += 1
        n_nodes += 2
    return n_nodes, n_blocks


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
def _plan_collapse(binary, binary_ints, costs, plan):
    """Which descendants of each binary node become children of a wide node, at least expected cost.

    costs[c, k - 1] is the cost of the subtree c as at most k children of a wide node above it, plan[c, k - 1] how many
    of the k its left half gets; 0: c stays whole, as one child. plan[c, 0] is the left half's share of the eight when c
    is a wide node itself.
    """
    for c in range(len(costs) - 1, -1, -1):
        area = _half_area(binary[c])
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
                nodes[target, 2 * i, lane], nodes[target, 2 * i + 1, lane] = binary[c, i], binary[c, 4 + i]
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
