"""The nearest importon of places that are far from all of them.

The planes of a kd-tree bound nothing on its outside: seen from afar nearly all leaves might hold the nearest. So each
node has the box of its importons here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import (
    load_f4,
    stack_get_f4,
    stack_get_i4,
    stack_i4,
    stack_put_f4,
    stack_put_i4,
)
from pmviewer.maps.importance.importance_map import ImportanceMap

WAITING = 64
"""Subtrees that wait in a search: one for each level."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64


def node_boxes(importance: ImportanceMap) -> NDArray[np.float32]:
    """(nodes, 6) float32, low and high corner of the importons below each node of the tree, children of i at 2i and
    2i + 1 as in the tree."""
    boxes = np.empty((2 << int(importance.record[0]["depth"]), 6), np.float32)
    if importance.n:
        _bound(importance.record, boxes)
    return boxes


@kernel
def _bound(maps, boxes):
    tree = maps[0]
    leaves = _i8(1) << tree.depth
    for leaf in range(leaves):
        first, end = (tree.n * leaf) >> tree.depth, (tree.n * (leaf + 1)) >> tree.depth
        for a in range(3):
            boxes[leaves + leaf, a], boxes[leaves + leaf, 3 + a] = _f4(np.inf), _f4(-np.inf)
        for i in range(first, end):
            p = (load_f4(tree.x, i), load_f4(tree.y, i), load_f4(tree.z, i))
            for a in range(3):
                boxes[leaves + leaf, a] = min(boxes[leaves + leaf, a], p[a])
                boxes[leaves + leaf, 3 + a] = max(boxes[leaves + leaf, 3 + a], p[a])
    for node in range(leaves - 1, 0, -1):
        for a in range(3):
            boxes[node, a] = min(boxes[2 * node, a], boxes[2 * node + 1, a])
            boxes[node, 3 + a] = max(boxes[2 * node, 3 + a], boxes[2 * node + 1, 3 + a])


@device
def _squared(boxes, node, p):
    """Of the distance of p to a node's box."""
    d2 = _f4(0.0)
    for a in range(3):
        outside = max(max(boxes[node, a] - p[a], p[a] - boxes[node, 3 + a]), _f4(0.0))
        d2 += outside * outside
    return d2


@kernel
def nearest_importances(maps, boxes, points, gamma, distances, i0, i1):
    """Γ of the importons nearest to points[i0:i1] (m, 3) float32, whatever their side and reach, into gamma (m,)
    float32, and how far they are into distances (m,) float32; 0 and infinite without any, or at no place. boxes: of
    `node_boxes`."""
    tree = maps[0]
    leaves = _i8(1) << tree.depth
    nodes, bounds = stack_i4(WAITING), stack_i4(WAITING)
    for i in range(i0, i1):
        p = (points[i, 0], points[i, 1], points[i, 2])
        best, nearest = _f4(np.inf), _i8(-1)
        node, waiting = _i8(1), _i8(0)
        while node > 0:
            while node < leaves:
                near, far = _i8(2) * node, _i8(2) * node + _i8(1)
                d_near, d_far = _squared(boxes, near, p), _squared(boxes, far, p)
                if d_far < d_near:
                    near, far, d_near, d_far = far, near, d_far, d_near
                if d_far < best:
                    stack_put_i4(nodes, waiting, _i4(far))
                    stack_put_f4(bounds, waiting, d_far)
                    waiting += 1
                node = near if d_near < best else 2 * leaves
            if node < 2 * leaves:
                leaf = node - leaves
                for j in range((tree.n * leaf) >> tree.depth, (tree.n * (leaf + 1)) >> tree.depth):
                    dx, dy, dz = load_f4(tree.x, j) - p[0], load_f4(tree.y, j) - p[1], load_f4(tree.z, j) - p[2]
                    d2 = dx * dx + dy * dy + dz * dz
                    if d2 < best:
                        best, nearest = d2, _i8(j)
            node = _i8(0)
            while waiting > 0 and node == 0:
                waiting -= 1
                if stack_get_f4(bounds, waiting) < best:
                    node = _i8(stack_get_i4(nodes, waiting))
        gamma[i], distances[i] = _f4(0.0), _f4(np.inf)
        if nearest >= 0:
            gamma[i], distances[i] = load_f4(tree.payload, 3 * nearest + 1), _f4(np.sqrt(best))
