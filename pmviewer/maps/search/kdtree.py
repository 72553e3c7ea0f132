"""Balanced kd-tree with leaves of 16 photons for k-nearest look-ups (M1), which are in
`pmviewer.maps.search.k_nearest`.

The tree is complete and implicit: node i has children 2i and 2i+1, inner nodes store a splitting plane alone, and leaf
i of 2^depth holds photons n·i/2^depth … n·(i+1)/2^depth − 1, at most sixteen, in three arrays of coordinates that are
tested eight at a time.

A tree stores 24 bytes a photon, 4 of its place in the input and about 0.8 of planes.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.maps.search.simd import WIDTH

LEAF = 16

RECORD = np.dtype(
    [
        ("x", np.int64),
        ("y", np.int64),
        ("z", np.int64),
        ("payload", np.int64),
        ("index", np.int64),
        ("planes", np.int64),
        ("n", np.int64),
        ("depth", np.int64),
        ("power_unit", np.float32),
        ("smallest_radius", np.float32),
    ],
    align=True,
)
"""What kernels see of a tree; `smallest_radius` is the resolution of its float32 positions."""


@dataclass(frozen=True, eq=False)
class PhotonKdTree:
    """Photons in leaf order.

    Attributes
    ----------
    x, y, z: (n + 8,) float32 positions, the last 8 padding: photons are loaded eight at a time.
    payload: (n, 3) uint32, words 3–5 of the photon record.
    index: (n,) int32, each photon's place in the input.
    planes: (2^depth, 2) float32 position and (as int32) axis of the splitting planes, from element 1.
    power_unit: watts of one unit of stored power.
    record: one-element array of dtype `RECORD` for kernels; valid while this object lives.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    payload: np.ndarray
    index: np.ndarray
    planes: np.ndarray
    power_unit: float
    record: np.ndarray

    @property
    def n(self) -> int:
        """Of photons."""
        return len(self.payload)

    @property
    def bytes(self) -> int:
        """Memory held, in bytes, photons included."""
        return sum(a.nbytes for a in (self.x, self.y, self.z, self.payload, self.index, self.planes, self.record))


@device
def _longest_axis(nodes, first, end):
    """Axis along which positions first … end−1 extend most."""
    x0, y0, z0 = nodes[first, 0], nodes[first, 1], nodes[first, 2]
    x1, y1, z1 = x0, y0, z0
    for i in range(first + 1, end):
        x, y, z = nodes[i, 0], nodes[i, 1], nodes[i, 2]
        x0, y0, z0 = min(x0, x), min(y0, y), min(z0, z)
        x1, y1, z1 = max(x1, x), max(y1, y), max(z1, z)
    if x1 - x0 >= y1 - y0 and x1 - x0 >= z1 - z0:
        return 0
    return 1 if y1 - y0 >= z1 - z0 else 2


@device
def _partial_sort(nodes, pairs, first, end, rank, axis):
    """Rearranges nodes[first:end] so that none before `rank` is larger and none after it smaller along the axis
    (quickselect after Hoare). `pairs` are the same 16-byte nodes as two int64 each, which move faster."""
    low, high = first, end - 1
    while low < high:
        a, b, c = nodes[low, axis], nodes[(low + high) >> 1, axis], nodes[high, axis]
        pivot = max(min(a, b), min(max(a, b), c))
        i, j = low, high
        while i <= j:
            while nodes[i, axis] < pivot:
                i += 1
            while nodes[j, axis] > pivot:
                j -= 1
            if i <= j:
                head, tail = pairs[i, 0], pairs[i, 1]
                pairs[i, 0], pairs[i, 1] = pairs[j, 0], pairs[j, 1]
                pairs[j, 0], pairs[j, 1] = head, tail
                i += 1
                j -= 1
        if rank <= j:
            high = j
        elif rank >= i:
            low = i
        else:
            return


@kernel
def _split(nodes, pairs, planes, axes, depth, level, i, stop):
    """Splits the subtree of node i of `level` down to level `stop` of a tree of the given depth."""
    n = len(nodes)
    todo = np.empty((64, 2), np.int64)
    todo[0, 0], todo[0, 1] = level, i
    waiting = 1
    while waiting > 0:
        waiting -= 1
        level, i = todo[waiting, 0], todo[waiting, 1]
        if level == stop:
            continue
        first, middle, end = (n * i) >> level, (n * (2 * i + 1)) >> (level + 1), (n * (i + 1)) >> level
        axis = _longest_axis(nodes, first, end)
        _partial_sort(nodes, pairs, first, end, middle, axis)
        planes[(1 << level) + i, 0] = nodes[middle, axis]
        axes[(1 << level) + i, 1] = axis
        todo[waiting, 0], todo[waiting, 1] = level + 1, 2 * i
        todo[waiting + 1, 0], todo[waiting + 1, 1] = level + 1, 2 * i + 1
        waiting += 2


@kernel
def _collect(photons, nodes, places):
    """Positions and places of photons (n, 6) as 16-byte nodes; `places` is the int32 view of `nodes`."""
    for i in range(len(photons)):
        nodes[i, 0], nodes[i, 1], nodes[i, 2] = photons[i, 0], photons[i, 1], photons[i, 2]
        places[i, 3] = i


@kernel
def _store(words, nodes, places, x, y, z, payload, index):
    """Writes photons, seen as uint32 in `words`, in the order of the nodes."""
    for i in range(len(nodes)):
        j = places[i, 3]
        index[i] = j
        x[i], y[i], z[i] = nodes[i, 0], nodes[i, 1], nodes[i, 2]
        payload[i, 0], payload[i, 1], payload[i, 2] = words[j, 3], words[j, 4], words[j, 5]


def build_kdtree(photons: np.ndarray, power_unit: float = 1.0, pool: Executor | None = None) -> PhotonKdTree:
    """Sorts finite photons (n, 6) float32 into a tree, without the GIL, on the threads of `pool` if given.

    The tree is the same for any number of threads.
    """
    photons = np.require(photons, np.float32, ["C", "W"])
    n = len(photons)
    depth = max(0, (-(-n // LEAF) - 1).bit_length())
    nodes = np.empty((n, 4), np.float32)
    planes = np.zeros((1 << depth, 2), np.float32)
    x, y, z = (np.zeros(n + WIDTH, np.float32) for _ in range(3))
    payload, index = np.empty((n, 3), np.uint32), np.empty(n, np.int32)
    smallest_radius = 0.0
    if n:
        places, pairs, axes = nodes.view(np.int32), nodes.view(np.int64), planes.view(np.int32)
        _collect(photons, nodes, places)
        extent = nodes[:, :3].max(axis=0).astype(np.float64) - nodes[:, :3].min(axis=0)
        smallest_radius = 1e-7 * (max(float(extent.max()), float(np.abs(nodes[0, :3]).max())) or 1.0)
        top = min(depth, 4) if pool is not None and depth > 8 else depth
        _split(nodes, pairs, planes, axes, depth, 0, 0, top)
        if pool is not None and top < depth:
            futures = [pool.submit(_split, nodes, pairs, planes, axes, depth, top, i, depth) for i in range(1 << top)]
            for future in futures:
                future.result()
        _store(photons.view(np.uint32), nodes, places, x, y, z, payload, index)
    record = np.zeros(1, RECORD)
    addresses = (a.ctypes.data for a in (x, y, z, payload, index, planes))
    record[0] = (*addresses, n, depth, power_unit, smallest_radius)
    return PhotonKdTree(x, y, z, payload, index, planes, float(power_unit), record)
