"""Each vertex of loose triangles once, by hashing their bits."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel

EMPTY = np.uint32(0xFFFFFFFF)
"""A slot without a vertex: there are fewer vertices than slots."""


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
def _hash_of(corners, f, k):
    return _mixed(_plain(corners[f, k, 0]), _plain(corners[f, k, 1]), _plain(corners[f, k, 2]))


@device
def _is_vertex(vertices, j, a, b, c):
    return ((vertices[j, 0] ^ a) | (vertices[j, 1] ^ b) | (vertices[j, 2] ^ c)) == 0


@kernel
def weld(corners, table, vertices, used, index, ahead):
    """Number the different rows of corners (n, 3, 3), the bits of float32 as uint32, in the order of their first
    appearance, from `used` on; −0 is 0.

    `table` (a power of two,) uint32 has in each slot EMPTY or a vertex's number with the hash's upper bits above it,
    which tell most others apart without a look at their coordinates; vertices (m, 3) uint32, m below the table's
    length, are the rows known. index (3 n,) int32 becomes each row's number. `ahead` (2, 3 k) uint32 is scratch for k
    triangles at a time. Returns how many triangles were done before the room for vertices ended, and how many vertices
    there are now.
    """
    mask, most = np.uint32(len(table) - 1), ahead.shape[1] // 3
    for first in range(0, len(corners), most):
        end = min(first + most, len(corners))
        if used + 3 * (end - first) > len(vertices):
            return first, used
        # Nothing depends on what is found, so that the processor waits for many places of the table at the same time.
        for f in range(first, end):
            for k in range(3):
                h = _hash_of(corners, f, k)
                i = 3 * (f - first) + k
                ahead[0, i], ahead[1, i] = h, table[h & mask]
        for f in range(first, end):
            for k in range(3):
                i = 3 * (f - first) + k
                a, b, c = _plain(corners[f, k, 0]), _plain(corners[f, k, 1]), _plain(corners[f, k, 2])
                slot, upper = ahead[0, i] & mask, ahead[0, i] & ~mask
                entry = ahead[1, i] if ahead[1, i] != EMPTY else table[slot]
                while entry != EMPTY:
                    if (entry ^ upper) <= mask and _is_vertex(vertices, entry & mask, a, b, c):
                        break
                    slot = (slot + np.uint32(1)) & mask
                    entry = table[slot]
                if entry == EMPTY:
                    entry = np.uint32(used) | upper
                    table[slot] = entry
                    vertices[used, 0], vertices[used, 1], vertices[used, 2] = a, b, c
                    used += 1
                index[3 * f + k] = np.int32(entry & mask)
    return len(corners), used


@kernel
def rehash(vertices, table):
    """Enter vertices (n, 3) uint32, all different, into a table that is EMPTY everywhere."""
    mask = np.uint32(len(table) - 1)
    for j in range(len(vertices)):
        h = _mixed(vertices[j, 0], vertices[j, 1], vertices[j, 2])
        slot = h & mask
        while table[slot] != EMPTY:
            slot = (slot + np.uint32(1)) & mask
        table[slot] = np.uint32(j) | (h & ~mask)
