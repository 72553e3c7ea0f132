"""Vertices and triangles in the cells of a grid."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel


@device
def _along(x, start, size, cells):
    """Number of the cell along one axis, 1 … `cells`; 0 and cells + 1 for what lies outside."""
    return np.int32(np.floor(min(max((x - start) / size, -1.0), np.float64(cells)))) + np.int32(1)


@kernel
def cell_means(vertices, start, size, cells, key, mean):
    """key (V,) int32 becomes the cell of each of vertices (V, 3), of `cells`³ of that size from `start` (3,) on and a
    rim around them; mean ((cells + 2)³, 3) the mean of the vertices in each cell that has one."""
    side = np.int32(cells + 2)
    count = np.zeros(len(mean), np.int32)
    mean[:] = 0.0
    for i in range(len(vertices)):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        cx, cy = _along(x, start[0], size, cells), _along(y, start[1], size, cells)
        k = (cx * side + cy) * side + _along(z, start[2], size, cells)
        key[i] = k
        count[k] += 1
        mean[k, 0] += x
        mean[k, 1] += y
        mean[k, 2] += z
    for k in range(len(count)):
        if count[k] > 1:
            for axis in range(3):
                mean[k, axis] /= count[k]


@device
def _mixed(a, b, c):
    h = np.uint64(a) * np.uint64(0x9E3779B97F4A7C15) ^ np.uint64(b) * np.uint64(0xC2B2AE3D27D4EB4F)
    h = (h ^ np.uint64(c)) * np.uint64(0x165667B19E3779F9)
    return h ^ (h >> np.uint64(32))


@kernel
def spanning(faces, key, table, kept):
    """The first face between each three different cells: its number goes to kept (m,) int64. `table` (a power of two
    above m,) int32 is scratch. Returns how many there are, m + 1 for more than m."""
    mask = np.uint64(len(table) - 1)
    table[:] = -1
    count = 0
    for f in range(len(faces)):
        a, b, c = key[faces[f, 0]], key[faces[f, 1]], key[faces[f, 2]]
        if a == b or b == c or c == a:
            continue
        low, high = min(a, min(b, c)), max(a, max(b, c))
        middle = a ^ b ^ c ^ low ^ high
        slot = _mixed(low, middle, high) & mask
        while table[slot] >= 0:
            other = kept[table[slot]]
            p, q, r = key[faces[other, 0]], key[faces[other, 1]], key[faces[other, 2]]
            if min(p, min(q, r)) == low and max(p, max(q, r)) == high and p ^ q ^ r ^ low ^ high == middle:
                break
            slot = (slot + np.uint64(1)) & mask
        if table[slot] >= 0:
            continue
        if count == len(kept):
            return count + 1
        table[slot] = np.int32(count)
        kept[count] = f
        count += 1
    return count
