"""Each vertex of loose triangles once, by hashing their bits."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel


@device
def _mixed(a, b, c):
    h = (a * np.uint32(0x9E3779B1)) ^ (b * np.uint32(0x85EBCA77)) ^ (c * np.uint32(0xC2B2AE3D))
    h ^= h >> np.uint32(15)
    h *= np.uint32(0x2C1B3C6D)
    return h ^ (h >> np.uint32(13))


@device
def _plain(bits):
    """The bits of 0 for those of −0."""
    return np.uint32(0) if bits == np.uint32(0x80000000) else np.uint32(bits)


@device
def _is_vertex(vertices, j, a, b, c):
    return vertices[j, 0] == a and vertices[j, 1] == b and vertices[j, 2] == c


@kernel
def weld(corners, table, vertices, used, index):
    """Number the different rows of corners (n, 3, 3), the bits of float32 as uint32, in the order of their first
    appearance, from `used` on; −0 is 0.

    `table` (a power of two,) int32 has the number of the vertex in each slot, −1 for none; vertices (m, 3) uint32, m
    below the table's length, the rows known. index (3 n,) int32 becomes each row's number. Returns how many triangles
    were done before the room for vertices ended, and how many vertices there are now.
    """
    mask = np.uint32(len(table) - 1)
    for f in range(len(corners)):
        if used + 3 > len(vertices):
            return f, used
        for k in range(3):
            a, b, c = _plain(corners[f, k, 0]), _plain(corners[f, k, 1]), _plain(corners[f, k, 2])
            slot = _mixed(a, b, c) & mask
            found = table[slot]
            while found >= 0 and not _is_vertex(vertices, found, a, b, c):
                slot = (slot + np.uint32(1)) & mask
                found = table[slot]
            if found < 0:
                found = np.int32(used)
                table[slot] = found
                vertices[found, 0], vertices[found, 1], vertices[found, 2] = a, b, c
                used += 1
            index[3 * f + k] = found
    return len(corners), used


@kernel
def rehash(vertices, table):
    """Enter vertices (n, 3) uint32, all different, into a table that is −1 everywhere."""
    mask = np.uint32(len(table) - 1)
    for j in range(len(vertices)):
        slot = _mixed(vertices[j, 0], vertices[j, 1], vertices[j, 2]) & mask
        while table[slot] >= 0:
            slot = (slot + np.uint32(1)) & mask
        table[slot] = j
