"""Balanced kd-tree with leaves of 16 photons for k-nearest look-ups (M1).

The tree is complete and implicit: node i has children 2i and 2i+1, inner nodes store a splitting plane alone, and leaf
i of 2^depth holds photons n·i/2^depth … n·(i+1)/2^depth − 1, at most sixteen, in three arrays of coordinates that are
tested eight at a time.

A search keeps an exact lower bound of the distance to each subtree by the offsets along the axes (Arya & Mount 1993).
Neighbours are collected without order until there are 2k; then a selection keeps the nearest k and the search radius
shrinks to the k-th. That visits a few more leaves than a heap, which shrinks the radius with each photon, and is still
much faster: the selection has no unpredictable branches.

A tree stores 24 bytes a photon, 4 of its place in the input and about 0.8 of planes.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from pmviewer.errors import SettingError
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import (
    bits_of_float,
    count_trailing_zeros,
    float_of_bits,
    load_f4,
    load_i4,
    stack_get_f4,
    stack_get_i4,
    stack_get_i8,
    stack_i4,
    stack_put_f4,
    stack_put_i4,
    stack_put_i8,
)
from pmviewer.maps.search.simd import WIDTH, within8
from pmviewer.maps.search.stored import arrives, height_above

LEAF = 16
MAX_K = 1024
"""Most neighbours that a look-up can be asked for."""

KEYS = 4 * MAX_K + 2 * LEAF
"""int32 elements of scratch for the neighbours of a look-up."""

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

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32


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
        return len(self.payload)

    @property
    def bytes(self) -> int:
        """Memory held, in bytes, photons included."""
        return sum(a.nbytes for a in (self.x, self.y, self.z, self.payload, self.index, self.planes, self.record))


# --- look-up ----------------------------------------------------------------------------------------------------------


@device
def _partition(keys, low, high, pivot):
    """Brings keys below the pivot to the front of keys[low:high]; returns where the others start. No branches."""
    middle = low
    for i in range(low, high):
        key = stack_get_i8(keys, i)
        stack_put_i8(keys, i, stack_get_i8(keys, middle))
        stack_put_i8(keys, middle, key)
        middle += _i8(key < pivot)
    return middle


@device
def _select(keys, count, k, smallest, largest):
    """Brings the k smallest of `count` > k distinct keys to the front.

    All keys lie in [smallest, largest]. The first pivots are interpolated: squared distances of photons on a surface
    are nearly uniform. If that doesn't help, pivots are medians of three.
    """
    low, high = _i8(0), _i8(count)
    tries = 0
    while high - low > 1 and low < k < high:
        if tries < 3:
            a, b = float_of_bits(_u4(smallest >> 32)), float_of_bits(_u4(largest >> 32))
            share = _f4(k - low) / _f4(high - low)
            pivot = (_i8(bits_of_float(a + (b - a) * share)) << 32) + 1
        else:
            a, b, c = stack_get_i8(keys, low), stack_get_i8(keys, (low + high) >> 1), stack_get_i8(keys, high - 1)
            pivot = max(min(a, b), min(max(a, b), c))
        tries += 1
        middle = _partition(keys, low, high, pivot)
        if middle <= k and middle > low:
            low = middle
            smallest = pivot
        elif middle > k and middle < high:
            high = middle
            largest = pivot
        elif tries > 3:
            # The pivot is the smallest key: set it aside.
            for i in range(low, high):
                if stack_get_i8(keys, i) == pivot:
                    stack_put_i8(keys, i, stack_get_i8(keys, low))
                    stack_put_i8(keys, low, pivot)
            low += 1


@device
def _nearest_k(keys, count, k, r2):
    """Keeps the nearest k of `count` ≥ k keys; returns the squared distance of the k-th."""
    if count > k:
        _select(keys, count, k, _i8(0), _i8(bits_of_float(r2)) << 32 | _i8(0xFFFFFFFF))
    farthest = _i8(0)
    for i in range(k):
        farthest = max(farthest, stack_get_i8(keys, i))
    return float_of_bits(_u4(farthest >> 32))


@device
def nearest(tree, px, py, pz, k, r2, keys, facing, nx, ny, nz, steepness, class_mask):
    """The k nearest photons closer than sqrt(r2).

    Parameters
    ----------
    tree: record of a PhotonKdTree.
    px, py, pz: float32 point.
    k: int32, 1 … MAX_K.
    r2: float32 squared largest distance.
    keys: pointer to `KEYS` int32 of scratch that receives the neighbours, unordered, as int64: bits of the squared
        distance in the high, place in the tree in the low half.
    facing: whether only photons count that arrive on the side of the normal n on a path of a class in `class_mask`,
        with the distance max(d², steepness·h²), h being the height above the tangent plane: the k nearest then fill
        the smallest flattened disc |h| ≤ r/sqrt(steepness).

    Returns
    -------
    Number of neighbours found (int64), and if k were found the squared distance of the farthest, otherwise r2.
    """
    if tree.n == 0 or not (abs(px) + abs(py) + abs(pz) < _f4(np.inf)):
        return _i8(0), r2
    point, offsets = stack_i4(4), stack_i4(4)
    squared = stack_i4(8)
    stack = stack_i4(192)
    stack_put_f4(point, 0, px)
    stack_put_f4(point, 1, py)
    stack_put_f4(point, 2, pz)
    for axis in range(3):
        stack_put_f4(offsets, axis, _f4(0.0))
    leaves = _i8(1) << tree.depth
    capacity = 2 * _i8(k)
    count, waiting = _i8(0), _i8(0)
    node, bound = _i8(1), _f4(0.0)
    while True:
        while node < leaves:
            along = _i8(load_i4(tree.planes, 2 * node + 1))
            side = stack_get_f4(point, along) - load_f4(tree.planes, 2 * node)
            offset = stack_get_f4(offsets, along)
            near = 2 * node + _i8(side >= _f4(0.0))
            far_bound = bound - offset * offset + side * side
            if far_bound < r2:
                base = 5 * waiting
                stack_put_i4(stack, base, _i4(near ^ 1))
                stack_put_f4(stack, base + 1, far_bound)
                for other in range(3):
                    stack_put_f4(stack, base + 2 + other, stack_get_f4(offsets, other))
                stack_put_f4(stack, base + 2 + along, side)
                waiting += 1
            node = near
        leaf = node - leaves
        j, end = (tree.n * leaf) >> tree.depth, (tree.n * (leaf + 1)) >> tree.depth
        while j < end:
            mask = within8(tree.x + 4 * j, tree.y + 4 * j, tree.z + 4 * j, px, py, pz, r2, squared)
            if end - j < WIDTH:
                mask &= _i4((1 << (end - j)) - 1)
            while mask != 0:
                lane = count_trailing_zeros(mask)
                mask &= mask - _i4(1)
                d2 = stack_get_f4(squared, lane)
                i = j + lane
                if facing:
                    h = height_above(tree, i, px, py, pz, nx, ny, nz)
                    d2 = max(d2, steepness * h * h)
                    if not (d2 < r2 and arrives(tree, i, nx, ny, nz, class_mask)):
                        continue
                stack_put_i8(keys, count, _i8(bits_of_float(d2)) << 32 | i)
                count += 1
            j += WIDTH
            if count >= capacity:
                r2 = _nearest_k(keys, count, k, r2)
                count = _i8(k)
        found = False
        while waiting > 0 and not found:
            waiting -= 1
            base = 5 * waiting
            bound = stack_get_f4(stack, base + 1)
            if bound < r2:
                node = _i8(stack_get_i4(stack, base))
                for other in range(3):
                    stack_put_f4(offsets, other, stack_get_f4(stack, base + 2 + other))
                found = True
        if not found:
            break
    if count >= k:
        r2 = _nearest_k(keys, count, k, r2)
        count = _i8(k)
    return count, r2


@device
def _order(keys, count):
    """Sorts keys ascending, by insertion: they are few."""
    for i in range(1, count):
        key = stack_get_i8(keys, i)
        j = i
        while j > 0 and stack_get_i8(keys, j - 1) > key:
            stack_put_i8(keys, j, stack_get_i8(keys, j - 1))
            j -= 1
        stack_put_i8(keys, j, key)


@kernel
def nearest_at(trees, points, k, max_radius, ordered, i0, i1, indices, squared):
    """The k nearest photons of points[i0:i1], see `knn`; `ordered`: whether by ascending distance.

    The distance of the k-th neighbour of the point before, plus the way from there, bounds the search, and a little
    more than that distance alone is tried first: points in screen or Morton order are faster than shuffled ones.
    """
    tree = trees[0]
    keys = stack_i4(KEYS)
    zero = _f4(0.0)
    qx, qy, qz, reach = zero, zero, zero, _f4(np.inf)
    for i in range(i0, i1):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        step = np.sqrt((x - qx) * (x - qx) + (y - qy) * (y - qy) + (z - qz) * (z - qz))
        radius = min(max_radius, (reach + step) * _f4(1.00001))
        guess = min(radius, reach * _f4(1.15))
        count, r2 = nearest(tree, x, y, z, k, guess * guess, keys, False, zero, zero, zero, zero, _i4(0))
        if count < k and guess < radius:
            count, r2 = nearest(tree, x, y, z, k, radius * radius, keys, False, zero, zero, zero, zero, _i4(0))
        qx, qy, qz = x, y, z
        reach = np.sqrt(r2) if count == k else _f4(np.inf)
        if ordered:
            _order(keys, count)
        for j in range(count):
            key = stack_get_i8(keys, j)
            indices[i, j] = load_i4(tree.index, key & _i8(0xFFFFFFFF))
            squared[i, j] = float_of_bits(_u4(key >> 32))
        for j in range(count, k):
            indices[i, j] = _i4(-1)
            squared[i, j] = _f4(np.inf)


def knn(
    tree: PhotonKdTree, points: np.ndarray, k: int, max_radius: float = np.inf, ordered: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """The k nearest photons of points (m, 3) float32, closer than `max_radius`.

    Returns
    -------
    indices: (m, k) int32 places in the array that the tree was built from, −1 where there are fewer.
    squared: (m, k) float32 squared distances, infinite where there are fewer.
    """
    check_k(k)
    points = np.require(points, np.float32, ["C", "W"])
    indices, squared = np.empty((len(points), k), np.int32), np.empty((len(points), k), np.float32)
    nearest_at(tree.record, points, np.int32(k), np.float32(max_radius), ordered, 0, len(points), indices, squared)
    return indices, squared


def check_k(k: int) -> None:
    """Raises SettingError unless a look-up can be asked for k neighbours."""
    if not 1 <= k <= MAX_K:
        raise SettingError(f"{k} neighbours of a photon look-up: expected 1 to {MAX_K}.")


# --- construction -----------------------------------------------------------------------------------------------------


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
