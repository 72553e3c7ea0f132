"""The wide tree, made of the binary one: the upper part alone, what is below it on several threads at the same time.

What each of them fills is counted first, so that wide nodes and blocks have the same numbers for any number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.accel.bvh_binary import Binary
from pmviewer.kernels.accel.bvh_pack import COLLAPSE_BYTES, JOB_BLOCKS, JOB_LEFT, JOB_NODES, collapse
from pmviewer.kernels.accel.simd import BLOCK_ROWS, LANES, NODE_ROWS
from pmviewer.kernels.memory import aligned_empty
from pmviewer.progress import parallel

F4 = NDArray[np.float32]
Job = NDArray[np.int32]


@dataclass(frozen=True)
class _Input:
    """Triangles (n, 3, 3), boxes (m, 8), of which the first `n_triangles` are of triangles, and the binary tree."""

    triangles: F4
    boxes: F4
    n_triangles: int
    binary: Binary

    def run(self, job: Job, whole: int, nodes: F4 | None, blocks: F4 | None) -> int:
        """`collapse`; without nodes it only counts."""
        scratch = aligned_empty((COLLAPSE_BYTES,), np.uint8)
        return int(
            collapse(
                self.triangles.ctypes.data, self.boxes.ctypes.data, self.n_triangles, len(self.boxes),
                self.binary.nodes.ctypes.data, whole, 0 if nodes is None else nodes.ctypes.data,
                0 if blocks is None else blocks.ctypes.data, max(self.binary.n_blocks, 1), job.ctypes.data,
                scratch.ctypes.data,
            )
        )  # fmt: skip


def pack(triangles: F4, boxes: F4, n_triangles: int, binary: Binary, memory: F4) -> tuple[F4, F4]:
    """Wide nodes (k, 8, 8) and blocks (max(n_blocks, 1), 10, 8) of the binary tree over the boxes, next to each other:
    in `memory` (n, 8), aligned, where there is room. Raises Cancelled."""
    given = _Input(triangles, boxes, n_triangles, binary)
    everything = len(binary.nodes)
    whole = binary.n_upper if binary.n_upper > 1 else everything
    upper = np.zeros(JOB_LEFT + 2 * LANES * binary.n_upper, np.int32)
    upper[JOB_NODES] = 1
    jobs = [upper.copy()]
    left = given.run(upper, whole, None, None)
    below = [_job(*pair, 0, 0) for pair in upper[JOB_LEFT:][: 2 * left].reshape(-1, 2).tolist()]
    parallel([partial(given.run, job, everything, None, None) for job in below])
    n_nodes, n_blocks = upper[[JOB_NODES, JOB_BLOCKS]].tolist()
    for source, target, own_nodes, own_blocks in (job[:JOB_LEFT].tolist() for job in below):
        jobs.append(_job(source, target, n_nodes, n_blocks))
        n_nodes, n_blocks = n_nodes + own_nodes, n_blocks + own_blocks
    # An unused lane refers to block 0, which therefore always exists.
    ends = np.cumsum([n_nodes * NODE_ROWS, max(binary.n_blocks, 1) * BLOCK_ROWS]).tolist()
    if ends[1] > len(memory):
        memory = aligned_empty((ends[1], LANES), np.float32)
    nodes = memory[: ends[0]].reshape(-1, NODE_ROWS, LANES)
    blocks = memory[ends[0] : ends[1]].reshape(-1, BLOCK_ROWS, LANES)
    blocks[0] = 0.0
    parallel([partial(given.run, job, everything if i else whole, nodes, blocks) for i, job in enumerate(jobs)])
    return nodes, blocks


def _job(source: int, target: int, free_node: int, free_block: int) -> Job:
    """One that makes the wide node `target` of a binary node; other nodes and blocks begin at the free ones."""
    return np.array([source, target, free_node, free_block], np.int32)
