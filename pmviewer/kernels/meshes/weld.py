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


@kernel
def weld(bits, table, vertices, used, index):
    """Number the different rows of bits (n, 3) uint32 in the order of their first appearance, from `used` on.

    `table` (a power of two,) int32 has the number of the vertex in each slot, −1 for none; vertices (m, 3) uint32, m
    below the table's length, the rows known. index (n,) int32 becomes each row's number. Returns how many rows were
    done before the room for vertices ended, and how many vertices there are now.
    """
    mask = np.uint32(len(table) - 1)
    for i in range(len(bits)):
        a, b, c = bits[i, 0], bits[i, 1], bits[i, 2]
        slot = _mixed(a, b, c) & mask
        while True:
            j = table[slot]
            if j < 0:
                if used == len(vertices):
                    return i, used
                j = np.int32(used)
                table[slot] = j
                vertices[j, 0], vertices[j, 1], vertices[j, 2] = a, b, c
                used += 1
                break
            if vertices[j, 0] == a and vertices[j, 1] == b and vertices[j, 2] == c:
                break
            slot = (slot + np.uint32(1)) & mask
        index[i] = j
    return len(bits), used


@kernel
def rehash(vertices, table):
    """Enter vertices (n, 3) uint32, all different, into a table that is −1 everywhere."""
    mask = np.uint32(len(table) - 1)
    for j in range(len(vertices)):
        slot = _mixed(vertices[j, 0], vertices[j, 1], vertices[j, 2]) & mask
        while table[slot] >= 0:
            slot = (slot + np.uint32(1)) & mask
        table[slot] = j
