"""Building the 8-wide bounding volume hierarchy that `raycast` traverses.

First a binary tree by binned surface-area heuristic (`bvh_binary`), then a collapse of up to eight descendants into one
node (`bvh_wide`), planned by dynamic programming (Ylitie, Karras, Laine, "Efficient incoherent ray traversal on GPUs
through compressed wide BVHs", 2017, section 3.3). Triangles sit in blocks of up to eight; quadrics are leaves of their
own.

A child index c of a wide node is a node if c >= 0; otherwise ~c is a block, or, from `n_blocks` on, quadric
~c - n_blocks, or, beyond the quadrics, an instance. Memory layouts are in `simd`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.accel.bvh_binary import Part, binary_tree, both, built_part
from pmviewer.kernels.accel.bvh_pack import collapse, triangle_boxes
from pmviewer.kernels.accel.bvh_split import plan_range, subtree
from pmviewer.kernels.accel.bvh_wide import pack
from pmviewer.kernels.accel.quadric import QUADRIC_FLOATS, quadric_bounds
from pmviewer.kernels.accel.simd import LANES
from pmviewer.kernels.memory import aligned_empty
from pmviewer.progress import parallel

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

TURNED = [4, 5, 6, 7, 0, 1, 2, 3]
"""Elements of a box with its halves changed over."""

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


@dataclass(frozen=True)
class Begun:
    """The tree over the first `n_triangles` of `triangles` (n, 3, 3), to which others are added that aren't there yet,
    up to `room` primitives: `begun` makes it, `build` finishes it, once. `boxes` (n_kept + room, 8), `memory` that
    sorting them took."""

    triangles: F4
    n_triangles: int
    boxes: F4
    memory: F4
    n_kept: int
    root: Part
    room: int


def begun(triangles: F4, n_triangles: int, room: int) -> Begun | None:
    """Build the tree over the first `n_triangles` of `triangles` (n, 3, 3) float32, C-contiguous, as far as can be done
    before the others are known. None if none of them is usable. Raises Cancelled."""
    boxes = aligned_empty((n_triangles + room, LANES), np.float32)
    n_kept, around = _boxes_of(triangles[:n_triangles], 0, boxes, 0)
    if not n_kept:
        return None
    box, centers = around.min(axis=0)
    memory = _memory(n_kept)
    root = built_part(boxes[:n_kept], n_kept, 0, box, centers, memory, 1)
    return Begun(triangles, n_triangles, boxes[: n_kept + room], memory, n_kept, root, room)


def build(triangles: F4, quadrics: F4, boxed: tuple[F4, F4] | None = None, started: Begun | None = None) -> Bvh:
    """The tree over `triangles` (n, 3, 3), world-space vertices, `quadrics` (m, 12), see `quadric`, and instances, of
    which `boxed` has the lower and upper corners, (k, 3) each. `started` is what was begun with the first of the
    triangles; if there is no room for the others, it is built anew.

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
    if started is not None and len(triangles) - started.n_triangles + len(lower) > started.room:
        started = None
    known, done = (0, 0) if started is None else (started.n_triangles, started.n_kept)
    boxes = started.boxes if started else aligned_empty((len(triangles) + len(lower), LANES), np.float32)
    more, around = _boxes_of(triangles, known, boxes, done)
    kept = np.flatnonzero(np.isfinite(lower).all(1) & np.isfinite(upper).all(1))
    n_kept = done + more
    boxes = boxes[: n_kept + len(kept)]
    others = boxes[n_kept:]
    others[:, 0:3], others[:, 4:7] = lower[kept], -upper[kept]
    others[:, 3], others[:, 7] = 0.0, 0.0
    around = np.concatenate([around, [[_joined(others), _joined(others - others[:, TURNED])]]]).min(axis=0)
    others.view(np.int32)[:, 3] = kept

    memory = _memory(len(boxes)) if started is None else started.memory
    if started is None:
        root = built_part(boxes, n_kept, 0, around[0], around[1], memory)
    elif len(boxes) == done:
        root = started.root
    else:
        added = built_part(boxes, n_kept, done, around[0], around[1], _memory(len(boxes) - done), 1)
        root = both(started.root, added)
    nodes, blocks = pack(triangles, boxes, n_kept, binary_tree(root), memory)
    return Bvh(nodes, blocks, own_quadrics, len(triangles))


def _memory(n: int) -> F4:
    """Rows in which n boxes can be sorted, and that the wide tree takes over then unless its blocks have less than
    seven triangles: the system need not clear other memory for it. Rows beyond the boxes are none until used."""
    return aligned_empty((max(13 * n // 8, 1), LANES), np.float32)


def _joined(rows: F4) -> F4:
    """The box around boxes (n, 8)."""
    return np.asarray(rows.min(axis=0, initial=np.inf), np.float32)


def _boxes_of(triangles: F4, first: int, boxes: F4, row: int) -> tuple[int, F4]:
    """Fill `boxes` from `row` on, at most `first`, with those of the usable ones of the triangles from `first` on, in
    their order; returns their number and, (k, 2, 8), boxes around parts of them with those around their centres."""
    starts = range(first, len(triangles), _AT_ONCE)
    around = aligned_empty((len(starts) + 1, 2, LANES), np.float32)
    around[-1] = np.inf
    apart = first - row
    from_, to, over = triangles.ctypes.data, boxes.ctypes.data - boxes.strides[0] * apart, around.ctypes.data
    found = parallel(
        [
            partial(triangle_boxes, from_, to, over + around.strides[0] * k, i, min(i + _AT_ONCE, len(triangles)))
            for k, i in enumerate(starts)
        ]
    )
    end = row
    for start, more in zip(starts, found):
        if end < start - apart:
            boxes[end : end + more] = boxes[start - apart : start - apart + more].copy()
        end += more
    return end - row, around


def builder_kernels() -> list[Callable[[], object]]:
    """Calls for nothing, each of which compiles a kernel that `build` needs, last to first: for a process that compiles
    while another one does so in the order of `build`."""
    rows = aligned_empty((2048, LANES), np.float32)
    rows[:] = 0.0
    at, apart = rows.ctypes.data, rows[1024:].ctypes.data
    return [
        partial(_with_memory, rows, collapse, at, at, 0, 0, at, 0, 0, at, 1, at, apart),
        partial(_with_memory, rows, plan_range, at, at, 0, 0),
        partial(_with_memory, rows, subtree, at, 0, at, at, 0, apart, 0),
        partial(_with_memory, rows, triangle_boxes, at, at, apart, 0, 0),
    ]


def _with_memory(rows: F4, function: Callable[..., object], *addresses: int) -> object:
    """Call it while `rows` live."""
    return function(*addresses)
